// sky.cpp: a dome with a dusk sky above the clouds. Its texture goes round it three times.
#include "formulas.h"
#include "textured.h"

namespace {

constexpr int around = 48, up = 24, repeats = 3;

// HEIGHT is -1 at 45 degrees below the horizon and beyond, 1 at 45 degrees above it; TURN is along the horizon.
vec3 sky_colour(double turn, double height) {
    const vec3 horizon{.72, .56, .50}, zenith{.13, .20, .40}, depth{.09, .10, .20};
    const vec3 clear = mix(horizon, height > 0 ? zenith : depth, smoothstep(0, height > 0 ? .9 : -.7, height));
    // A noise that repeats: along a circle. Clouds are flat, more so towards the horizon.
    const double c = cos_turns(turn) * 1.6, s = sin_turns(turn) * 1.6, y = height * (4 + 3 / (.3 + std::fabs(height)));
    const double cloud = smoothstep(-.15, .75, fbm(vec3{c, s, y}, 5) + .35 * noise(vec3{c * .7, s * .7, y * .4 + 7}));
    const vec3 lit = mix({.95, .76, .62}, height > 0 ? vec3{.48, .47, .60} : vec3{.26, .25, .37},
                         smoothstep(0, height > 0 ? .8 : -.6, height));
    return mix(clear, lit, .75 * cloud);
}

}  // namespace

// Seen from inside: its triangles are counter-clockwise there.
Textured sky_dome() {
    Textured out;
    for (int j = 0; j <= up; j++) {
        const double elevation = (1. * j / up - .5) / 2;  // -1/4 to 1/4 of a turn
        for (int i = 0; i <= around; i++) {
            const double turn = 1. * i / around, flat = cos_turns(elevation);
            const vec3 v{flat * sin_turns(turn), sin_turns(elevation), flat * cos_turns(turn)};
            out.mesh.verts.push_back(rounded(v, 1e5));
            out.uvs.push_back({rounded(turn * repeats, 1e5), rounded(clamp01(elevation * 4 + .5), 1e5)});
            out.normals.push_back(-v);
        }
    }
    for (int j = 0; j < up; j++)
        for (int i = 0; i < around; i++) {
            const auto v = [&](int di, int dj) { return (j + dj) * (around + 1) + i + di; };
            for (const Face& f : {Face{v(0, 0), v(1, 1), v(1, 0)}, Face{v(0, 0), v(0, 1), v(1, 1)}}) {
                out.mesh.faces.push_back(f);
                out.uv_of.push_back(f);
                out.normal_of.push_back(f);
            }
        }
    return out;
}

Maps bake_sky(int width, int height) {
    Maps out{{width, height, TGAImage::RGB}, {}, {}, {}, {}};
    parallel(height, [&](int y) {
        for (int x = 0; x < width; x++)
            out.diffuse.set(x, y, colour(sky_colour((x + .5) / width, (y + .5) / height * 2 - 1)));
    });
    return out;
}
