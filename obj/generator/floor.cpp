// floor.cpp: a slab of worn flagstones under the idol, with a ring of gold let in.
#include <map>

#include "formulas.h"
#include "textured.h"

namespace {

constexpr double floor_top = -.95, floor_bottom = -.995, floor_half = .99;
constexpr int floor_cells = 20;

// The texture is the slab unfolded: the top in the middle, the sides around it. So many units of length make up a side.
constexpr double floor_uv = 2 * (floor_half + floor_top - floor_bottom);

struct Flag {
    double height, seam, gold;  // seam, gold: 1 in the mortar, 1 on the ring
    vec3 tint;
};

Flag flagstone(double x, double z) {
    constexpr double length = .33, width = .22;
    const double row = z / width + 40, j = std::floor(row), column = x / length + .37 * j + 40, i = std::floor(column);
    const double in_x = column - i, in_z = row - j, wobble = .004 * noise(vec3{x * 30, z * 30, 1});
    const double edge = std::min({in_x * length, (1 - in_x) * length, in_z * width, (1 - in_z) * width}) + wobble;
    const auto chance = [&](int k) { return hash01(static_cast<int>(i), static_cast<int>(j), k); };  // one a stone
    const double bumps = .5 * fbm(vec3{x * 16, z * 16, 3 + i}, 4) + .25 * noise(vec3{x * 70, z * 70, 9});
    Flag out;
    out.seam = 1 - smoothstep(.004, .014, edge);
    const double tilt = .006 * (chance(8) - .5) * (in_x - .5);
    out.height = .010 * smoothstep(.002, .02, edge) + .005 * bumps + tilt * (1 - out.seam);
    out.tint = mix({.40, .37, .36}, {.52, .44, .36}, chance(2)) * (.75 + .35 * chance(5) + .35 * bumps);
    out.tint = mix(out.tint, {.12, .10, .09}, .85 * out.seam);

    const double r = std::sqrt(x * x + z * z), turn = atan_turns(z, x) * 96, f = turn - std::floor(turn);
    const double plate = smoothstep(.04, .12, f) * (1 - smoothstep(.88, .96, f));
    const vec3 brass = vec3{.80, .55, .20} * (.45 + .5 * plate + .25 * noise(vec3{x * 25, z * 25, 4}));
    out.gold = smoothstep(.86, .868, r) * (1 - smoothstep(.922, .93, r));
    out.height = mix(out.height, .008 + .003 * plate * out.gold, out.gold);
    out.tint = mix(out.tint, brass, out.gold);
    out.seam *= 1 - out.gold;
    return out;
}

}  // namespace

Textured floor_slab() {
    Textured out;
    std::map<std::array<int, 3>, int> index;  // lattice point -> vertex; the second coordinate: 1 top, 0 bottom
    constexpr int n = floor_cells;
    constexpr double margin = (floor_top - floor_bottom) / floor_uv, inner = 1 - 2 * margin;
    const vec3 axes[6] = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}, {0, 0, 1}, {0, 0, -1}};
    out.normals.assign(axes, axes + 6);
    const auto corner = [&](const std::array<int, 3>& c) {
        const auto [found, fresh] = index.insert({c, out.mesh.nverts()});
        const auto along = [](int i) { return (2. * i / n - 1) * floor_half; };
        if (fresh)
            out.mesh.verts.push_back(rounded({along(c[0]), c[1] ? floor_top : floor_bottom, along(c[2])}, 1e5));
        return found->second;
    };
    const auto quad = [&](const std::array<std::array<int, 3>, 4>& c, int normal) {  // counter-clockwise
        int v[4], uv[4];
        for (int k = 0; k < 4; k++) {
            const auto& q = c[k];
            v[k] = corner(q);
            vec2 t{margin + inner * q[0] / n, margin + inner * (n - q[2]) / n};
            if (normal >= 2 && !q[1]) t = t + vec2{out.normals[normal].x, -out.normals[normal].z} * margin;
            uv[k] = static_cast<int>(out.uvs.size());
            out.uvs.push_back({rounded(t.x, 1e5), rounded(t.y, 1e5)});
        }
        for (const int k : {1, 2}) {
            out.mesh.faces.push_back({v[0], v[k], v[k + 1]});
            out.uv_of.push_back({uv[0], uv[k], uv[k + 1]});
            out.normal_of.push_back({normal, normal, normal});
        }
    };
    for (int a = 0; a < n; a++) {
        for (int b = 0; b < n; b++) {
            quad({{{a, 1, b + 1}, {a + 1, 1, b + 1}, {a + 1, 1, b}, {a, 1, b}}}, 0);
            quad({{{a, 0, b}, {a + 1, 0, b}, {a + 1, 0, b + 1}, {a, 0, b + 1}}}, 1);
        }
        quad({{{n, 0, a + 1}, {n, 0, a}, {n, 1, a}, {n, 1, a + 1}}}, 2);
        quad({{{0, 0, a}, {0, 0, a + 1}, {0, 1, a + 1}, {0, 1, a}}}, 3);
        quad({{{a, 0, n}, {a + 1, 0, n}, {a + 1, 1, n}, {a, 1, n}}}, 4);
        quad({{{a + 1, 0, 0}, {a, 0, 0}, {a, 1, 0}, {a + 1, 1, 0}}}, 5);
    }
    return out;
}

// u runs along x and v along -z; on the sides the texture goes on as if the slab were unfolded. Bump mapping (Blinn
// 1978): the normal of a height field h over (u,v) is (-dh/du, -dh/dv, 1).
Maps bake_floor(int size) {
    Maps out{{size, size, TGAImage::RGB}, {}, {size, size, TGAImage::RGB}, {size, size, TGAImage::GRAYSCALE}, {}};
    parallel(size, [&](int y) {
        for (int x = 0; x < size; x++) {
            const double px = ((x + .5) / size - .5) * floor_uv, pz = -((y + .5) / size - .5) * floor_uv, e = .002;
            const Flag f = flagstone(px, pz);
            const double hu = (flagstone(px + e, pz).height - flagstone(px - e, pz).height) / (2 * e);
            const double hv = (flagstone(px, pz - e).height - flagstone(px, pz + e).height) / (2 * e);
            out.diffuse.set(x, y, colour(f.tint));
            out.tangent.set(x, y, encoded(normalized(vec3{-hu, -hv, 1})));
            out.specular.set(x, y, grey(f.gold > .5 ? 20 : 40 + std::floor(60 * f.seam)));
        }
    });
    return out;
}
