// bake.cpp: the idol's maps, texel by texel. Colour and normal depend on the point of the surface alone, so no seam
// shows where two charts meet.
#include "formulas.h"
#include "idol.h"
#include "textured.h"

namespace {

// The face that each texel belongs to, -1 where there is none; three texels around every chart belong to a face beside
// them.
std::vector<int> owners(const Textured& t, int size) {
    std::vector<int> owner(size * size, -1);
    const auto inside = [&](int x, int y) { return x >= 0 && y >= 0 && x < size && y < size; };
    for (int f = 0; f < t.mesh.nfaces(); f++) {
        Corners corner = t.uv(f);
        for (vec2& c : corner) c = c * size;
        cover(corner, 0, [&](int x, int y) {
            if (inside(x, y)) owner[y * size + x] = f;
        });
    }
    for (int round = 0; round < 3; round++) {
        const std::vector<int> before = owner;
        for (int y = 0; y < size; y++)
            for (int x = 0; x < size; x++) {
                constexpr int near[8][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}};
                int& texel = owner[y * size + x];
                for (int k = 0; k < 8 && texel < 0; k++) {
                    const int nx = x + near[k][0], ny = y + near[k][1];
                    if (inside(nx, ny)) texel = before[ny * size + nx];
                }
            }
    }
    return owner;
}

vec3 barycentric(const Corners& t, const vec2& p) {
    const double whole = cross(t[1] - t[0], t[2] - t[0]);
    const double b = cross(p - t[0], t[2] - t[0]) / whole, c = cross(t[1] - t[0], p - t[0]) / whole;
    return {1 - b - c, b, c};
}

// The normal N in the frame that the renderer builds from the triangle: columns i, j (along the gradients of u and v in
// the plane orthogonal to the interpolated normal) and that normal. The columns i and j need not be orthogonal.
vec3 to_tangent(const std::array<vec3, 3>& p, const Corners& uv, const vec3& interpolated, const vec3& n) {
    const vec3 e1 = p[1] - p[0], e2 = p[2] - p[0], c1 = cross(e2, interpolated), c2 = cross(interpolated, e1);
    const double sign = dot(e1, c1) < 0 ? -1 : 1;
    const vec3 i = normalized((c1 * (uv[1].x - uv[0].x) + c2 * (uv[2].x - uv[0].x)) * sign);
    const vec3 j = normalized((c1 * (uv[1].y - uv[0].y) + c2 * (uv[2].y - uv[0].y)) * sign);
    const auto inverse = invert(transpose(mat3{{i, j, interpolated}}));
    return inverse ? normalized(*inverse * n) : vec3{0, 0, 1};
}

// The picture at half its size: each pixel is the mean of those of its four that are not 0 (0: no face there).
TGAImage halved(const TGAImage& image) {
    TGAImage out(image.width() / 2, image.height() / 2, TGAImage::GRAYSCALE);
    for (int y = 0; y < out.height(); y++)
        for (int x = 0; x < out.width(); x++) {
            int sum = 0, count = 0;
            for (int k = 0; k < 4; k++) {
                const int value = image.get(2 * x + k % 2, 2 * y + k / 2)[0];
                sum += value, count += value > 0;
            }
            if (count) out.set(x, y, grey((sum + count / 2) / count));
        }
    return out;
}

}  // namespace

TGAColor colour(const vec3& c) {
    TGAColor out{{0, 0, 0, 255}};
    for (int k = 0; k < 3; k++) out[2 - k] = static_cast<std::uint8_t>(std::floor(clamp01(c[k]) * 255 + .5));
    return out;
}
TGAColor encoded(const vec3& n) { return colour((n + vec3{1, 1, 1}) / 2); }
TGAColor grey(double value) { return {{static_cast<std::uint8_t>(value), 0, 0, 0}}; }

Maps bake_idol(const Textured& t, int size) {
    const std::vector<int> owner = owners(t, size);
    const TGAImage rgb(size, size, TGAImage::RGB);
    Maps out{rgb, rgb, rgb, {size, size, TGAImage::GRAYSCALE}, rgb};
    parallel(size, [&](int y) {
        for (int x = 0; x < size; x++) {
            const int f = owner[y * size + x];
            if (f < 0) continue;
            const Corners uv = t.uv(f);
            const vec3 b = barycentric(uv, {(x + .5) / size, (y + .5) / size});
            std::array<vec3, 3> p;
            vec3 place, n;
            for (int k = 0; k < 3; k++) {
                p[k] = t.mesh.verts[t.mesh.faces[f][k]];
                place = place + p[k] * b[k], n = n + t.normals[t.normal_of[f][k]] * b[k];
            }
            const Surface s = surface(onto_surface(place));
            out.diffuse.set(x, y, colour(s.diffuse));
            out.normal.set(x, y, encoded(s.normal));
            out.tangent.set(x, y, encoded(to_tangent(p, uv, normalized(n), s.normal)));
            out.specular.set(x, y, grey(std::clamp(std::floor(s.exponent + .5), 1., 255.)));
            out.glow.set(x, y, colour(s.glow));
        }
    });
    out.specular = halved(out.specular);  // it varies slowly
    return out;
}
