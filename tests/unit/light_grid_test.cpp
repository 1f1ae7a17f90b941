// light_grid_test.cpp: the grid of casters finds what a look at every face finds, and no face shadows its neighbours in
// a plane.
#include "check.h"
#include "our_gl.h"
#include "random.h"

namespace {

// Three corners a face.
Model model_of(const std::vector<vec3>& corners) {
    std::vector<Model::Corner> indices;
    for (int i = 0; i < static_cast<int>(corners.size()); i++) indices.push_back({i, -1, 0});
    return {corners, {}, {{0, 0, 1}}, indices};
}

// A regular grid of 2 n^2 faces over (x,y) in [-1,1]^2, at the given height.
template <class Height>
std::vector<vec3> surface(int n, Height&& z) {
    std::vector<vec3> corners;
    const auto at = [&](int i, int j) {
        const double x = 2. * i / n - 1, y = 2. * j / n - 1;
        return vec3{x, y, z(x, y)};
    };
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            for (const vec3& v : {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)})
                corners.push_back(v);
    return corners;
}

bool shadows(const LightGrid& grid, const vec3& p, int face) {
    return grid.shadows({p.x, p.y, p.z}, face)[lanes - 1];
}

Camera light_on(const std::vector<Model>& models, const vec3& direction, int size) {
    return fitted({lookat(direction, {}, {0, 1, 0})}, models, size);
}

}  // namespace

TEST("the fitted camera shows all of a model and no more") {
    Random r(1);
    for (int k = 0; k < 50; k++) {
        std::vector<vec3> corners;
        const vec3 away = r.point(100);
        for (int i = 0; i < 30; i++) corners.push_back(r.point(3) + away);
        const std::vector<Model> models{model_of(corners)};
        const Camera c = light_on(models, r.point(1), 64);
        vec3 low{1e9, 1e9, 1e9}, high = -low;
        for (const vec3& v : corners) {
            const vec3 p = project(c.to_screen() * point(v));
            for (int i = 0; i < 3; i++) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
        }
        for (int i = 0; i < 3; i++) {
            CHECK_NEAR(low[i], 0, 1e-9);
            CHECK_NEAR(high[i], i < 2 ? 64 : screen_depth, 1e-9);
        }
    }
    // A model without extent in a direction, and one that is a single point: no division by zero.
    for (const auto& corners : {surface(1, [](double, double) { return .25; }), std::vector<vec3>(3, vec3{1, 2, 3})}) {
        const mat4 m = light_on({model_of(corners)}, {0, 0, 1}, 64).to_screen();
        for (const vec3& v : corners) CHECK(std::isfinite(norm((m * point(v)).xyz())));
    }
}

TEST("the grid agrees with a look at every face") {
    Random r(2);
    LightGrid grid;  // built again and again in the same memory
    for (int k = 0; k < 12; k++) {
        std::vector<vec3> corners;
        const double size = std::exp(r.in(-3, 0));
        for (int i = 0; i < 200; i++) {
            const vec3 c = r.point(1);
            for (int j = 0; j < 3; j++) corners.push_back(c + r.point(size));
        }
        const std::vector<Model> models{model_of(corners)};
        const int cells = 1 + k * 5;
        const Camera light = light_on(models, r.point(1), cells);
        const Camera lamp{lookat({0, 0, 9}, {}, {0, 1, 0}), beam(9, 20), {}};
        grid.build(models, fitted(lamp, models, 64), 64);  // nothing of that may be left
        grid.build(models, light, cells);
        for (int i = 0; i < 4000; i++) {
            // A point on one of the faces; in long double: is any other face above it?
            const int own = static_cast<int>(r.rng() % 200);
            double u = r.in(0, 1), v = r.in(0, 1);
            if (u + v > 1) u = 1 - u, v = 1 - v;
            const auto on_screen = [&](int face, int c) {
                return project(light.to_screen() * point(models[0].vert(face, c)));
            };
            const vec3 p = on_screen(own, 0) * (1 - u - v) + on_screen(own, 1) * u + on_screen(own, 2) * v;
            bool shadowed = false, close = false;
            for (int face = 0; face < 200; face++) {
                if (face == own) continue;
                const vec3 a = on_screen(face, 0) - p, b = on_screen(face, 1) - p, c = on_screen(face, 2) - p;
                using wide = long double;
                const wide x = wide(b.x) * c.y - wide(b.y) * c.x, y = wide(c.x) * a.y - wide(c.y) * a.x,
                           z = wide(a.x) * b.y - wide(a.y) * b.x, area = x + y + z;
                const wide height = (x * a.z + y * b.z + z * c.z) / area;
                const wide least = std::min({x / area, y / area, z / area});
                shadowed |= least > 0 && height > 0;
                close |= std::fabs(least) < 1e-9L || (least > 0 && std::fabs(height) < 1e-9L);
            }
            if (!close) CHECK_EQ(shadows(grid, p, own), shadowed);
        }
    }
}

TEST("no light falls through a seam, no flat surface shadows itself") {
    // A tilted plane under another one. Points exactly on edges and corners of the upper one are in its shadow; points
    // of the upper one that lie on its own edges are lit, though the neighbours are above them by rounding alone.
    for (const double tilt : {0., .1, 3., 1e3, 1e6}) {
        std::vector<vec3> corners = surface(16, [&](double x, double y) { return tilt * (x + .3 * y) + 1 + tilt; });
        const std::size_t upper = corners.size();
        for (const vec3& v : surface(16, [&](double x, double y) { return tilt * (x + .3 * y) - 1 - tilt; }))
            corners.push_back(v);
        const std::vector<Model> models{model_of(corners)};
        const int cells = 20;
        const Camera light = light_on(models, {0, 0, 1}, cells);
        const LightGrid grid(models, light, cells);
        Random r(3);
        int lit = 0, dark = 0, expected = 0;
        for (std::size_t face = 0; face < corners.size() / 3; face++) {
            vec3 s[3];
            for (int c = 0; c < 3; c++) s[c] = project(light.to_screen() * point(corners[face * 3 + c]));
            for (int k = 0; k < 40; k++) {
                const double t = k < 10 ? 0 : r.in(0, 1);  // corners, then points of the edges
                const vec3 p = s[k % 3] * (1 - t) + s[(k + 1) % 3] * t;
                // The outline is nobody's: a point on it may come to lie beside the upper surface by rounding.
                if (std::min(p.x, p.y) < 1e-6 || std::max(p.x, p.y) > cells - 1e-6) continue;
                expected++;
                (shadows(grid, p, static_cast<int>(face)) ? dark : lit) += 1;
                CHECK_EQ(shadows(grid, p, static_cast<int>(face)), face >= upper / 3);
            }
        }
        CHECK(expected > 30000 && lit > 15000 && dark > 15000);
    }
}

TEST("a soup of large faces takes memory by the face, and is still right") {
    Random r(4);
    std::vector<vec3> corners;
    for (int i = 0; i < 2000 * 3; i++) corners.push_back(r.point(1));
    const std::vector<Model> models{model_of(corners)};
    const Camera fine = light_on(models, {0, 0, 1}, 512), coarse = light_on(models, {0, 0, 1}, 1);
    const LightGrid grid(models, fine, 512), whole(models, coarse, 1);
    CHECK(grid.bytes() <= 600 * 2000);
    for (int i = 0; i < 2000; i++) {
        const int face = static_cast<int>(r.rng() % 2000);
        const auto at = [&](const Camera& c) {
            vec3 s;
            for (int k = 0; k < 3; k++) s = s + project(c.to_screen() * point(models[0].vert(face, k))) / 3;
            return s;
        };
        CHECK_EQ(shadows(grid, at(fine), face), shadows(whole, at(coarse), face));
    }
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
