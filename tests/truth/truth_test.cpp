// truth_test.cpp: is the truth true? The ray caster against brute force in long double, against closed forms, and where
// rounding would show: edges and corners hit exactly, coincident faces, grazing light, creases, far and tiny scenes.
#include "truth.h"

#include "check.h"
#include "files.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace {

constexpr double pi = std::numbers::pi;

// Numbers in [low,high), the same from every standard library.
struct Random {
    std::mt19937_64 engine;
    explicit Random(unsigned seed) : engine(seed) {}
    double operator()(double low, double high) {
        return low + (high - low) * (static_cast<double>(engine() >> 11) * 0x1p-53);
    }
    int below(int n) { return static_cast<int>(engine() % static_cast<unsigned>(n)); }
    vec3 in_cube(double half) { return {(*this)(-half, half), (*this)(-half, half), (*this)(-half, half)}; }
    vec3 unit() {
        for (;;) {
            const vec3 v = in_cube(1);
            if (norm(v) > .1 && norm(v) < 1) return normalized(v);
        }
    }
};

// ---- meshes ----

using Mesh = std::vector<Triangle>;

void append(Mesh& mesh, const Mesh& more) { mesh.insert(mesh.end(), more.begin(), more.end()); }

void quad(Mesh& mesh, const vec3& a, const vec3& b, const vec3& c, const vec3& d) {
    mesh.push_back({a, b, c});
    mesh.push_back({a, c, d});
}

Mesh box(const vec3& l, const vec3& h) {
    Mesh mesh;
    quad(mesh, {l.x, l.y, h.z}, {h.x, l.y, h.z}, {h.x, h.y, h.z}, {l.x, h.y, h.z});
    quad(mesh, {h.x, l.y, l.z}, {l.x, l.y, l.z}, {l.x, h.y, l.z}, {h.x, h.y, l.z});
    quad(mesh, {h.x, l.y, h.z}, {h.x, l.y, l.z}, {h.x, h.y, l.z}, {h.x, h.y, h.z});
    quad(mesh, {l.x, l.y, l.z}, {l.x, l.y, h.z}, {l.x, h.y, h.z}, {l.x, h.y, l.z});
    quad(mesh, {l.x, h.y, h.z}, {h.x, h.y, h.z}, {h.x, h.y, l.z}, {l.x, h.y, l.z});
    quad(mesh, {l.x, l.y, l.z}, {h.x, l.y, l.z}, {h.x, l.y, h.z}, {l.x, l.y, h.z});
    return mesh;
}

// A closed mesh around the origin, star-shaped: its vertices are on the unit sphere, times 1 + a random share of bumps.
Mesh sphere(int rings, int sectors, double bumps = 0, unsigned seed = 1) {
    Random random(seed);
    std::vector<vec3> vertices;
    for (int r = 0; r <= rings; r++)
        for (int s = 0; s < sectors; s++) {
            const double a = pi * r / rings, b = 2 * pi * s / sectors;
            vertices.push_back(vec3{std::sin(a) * std::cos(b), std::cos(a), -std::sin(a) * std::sin(b)} *
                               (1 + bumps * random(0, 1)));
        }
    const auto at = [&](int r, int s) {  // all of a pole's vertices are one
        return vertices[static_cast<std::size_t>(r * sectors + (r == 0 || r == rings ? 0 : s % sectors))];
    };
    Mesh mesh;
    for (int r = 0; r < rings; r++)
        for (int s = 0; s < sectors; s++) {
            if (r > 0) mesh.push_back({at(r, s), at(r + 1, s), at(r, s + 1)});
            if (r < rings - 1) mesh.push_back({at(r, s + 1), at(r + 1, s), at(r + 1, s + 1)});
        }
    return mesh;
}

// The icosahedron with every face cut into 4^levels, vertices on the unit sphere: strictly convex.
Mesh icosphere(int levels) {
    const double g = std::numbers::phi;
    const vec3 v[12] = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                        {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    const int faces[20][3] = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                              {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                              {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    Mesh mesh;
    for (const auto& f : faces) mesh.push_back({normalized(v[f[0]]), normalized(v[f[1]]), normalized(v[f[2]])});
    for (int level = 0; level < levels; level++) {
        Mesh finer;
        for (const auto& [a, b, c] : mesh) {
            const vec3 ab = normalized(a + b), bc = normalized(b + c), ca = normalized(c + a);
            append(finer, {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
        }
        mesh = finer;
    }
    return mesh;
}

// The square [-size,size]^2 in the plane y = 0, its front upwards, n by n cells, moved by `place`.
template <typename Place>
Mesh grid(int n, double size, const Place& place) {
    const auto at = [&](int i, int j) { return place(vec3{size * (2 * i - n) / n, 0, size * (2 * j - n) / n}); };
    Mesh mesh;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) quad(mesh, at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
    return mesh;
}

vec3 unchanged(const vec3& v) { return v; }

Mesh landscape(int n, unsigned seed) {  // creases of all kinds
    Random random(seed);
    std::vector<double> heights(static_cast<std::size_t>((n + 1) * (n + 1)));
    for (double& h : heights) h = random(-.4, .4);
    return grid(n, 1, [&](const vec3& v) {
        const long i = std::lround((v.x + 1) * n / 2), j = std::lround((v.z + 1) * n / 2);
        return vec3{v.x, heights[static_cast<std::size_t>(i * (n + 1) + j)], v.z};
    });
}

Mesh needles(int n, double thickness, unsigned seed) {
    Random random(seed);
    Mesh mesh;
    for (int i = 0; i < n; i++) {
        const vec3 a = random.in_cube(1), b = random.in_cube(1);
        mesh.push_back({a, b, b + random.unit() * thickness});
    }
    return mesh;
}

Mesh soup(int n, double size, unsigned seed) {
    Random random(seed);
    Mesh mesh;
    for (int i = 0; i < n; i++) {
        const vec3 a = random.in_cube(1);
        mesh.push_back({a, a + random.in_cube(size), a + random.in_cube(size)});
    }
    return mesh;
}

// ---- brute force ----

using vec3l = vec<3, long double>;

vec3l wide(const vec3& v) { return {v.x, v.y, v.z}; }

struct Verdict {
    Truth truth = Truth::background;
    int triangle = -1;
    bool close = false;  // something was too close to call in long double
};

// Möller, Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection" (1997), for all triangles one after the other.
// What comes nearer than `margin` to another outcome, relative to the triangle and the distance, is called close; the
// margin is far above the long double's rounding (5e-20 times a few, over the sines of angles) and far below a pixel.
Verdict brute_force(const Mesh& mesh, const vec3l& origin, const vec3l& direction, const vec3l& light) {
    constexpr long double margin = 1e-9L;
    struct Meeting {
        bool meets, close;
        long double t;
    };
    const auto meet = [](const Triangle& triangle, const vec3l& from, const vec3l& along) {
        const vec3l e1 = wide(triangle[1]) - wide(triangle[0]), e2 = wide(triangle[2]) - wide(triangle[0]);
        const vec3l p = cross(along, e2), s = from - wide(triangle[0]), q = cross(s, e1);
        const long double det = dot(e1, p);
        if (std::fabs(det) <= margin * margin * norm(along) * norm(e1) * norm(e2)) return Meeting{false, true, 0};
        const long double u = dot(s, p) / det, v = dot(along, q) / det, t = dot(e2, q) / det;
        const long double inside = std::min({u, v, 1 - u - v});
        return Meeting{inside > 0 && t > 0, std::fabs(inside) < margin || (inside > 0 && std::fabs(t) < margin), t};
    };

    Verdict verdict;
    long double nearest = std::numeric_limits<long double>::infinity(), second = nearest;
    for (std::size_t i = 0; i < mesh.size(); i++) {
        const Meeting m = meet(mesh[i], origin, direction);
        verdict.close |= m.close;
        if (!m.meets) continue;
        if (m.t < nearest) {
            second = nearest;
            nearest = m.t;
            verdict.triangle = static_cast<int>(i);
        } else {
            second = std::min(second, m.t);
        }
    }
    if (verdict.triangle < 0) return verdict;
    verdict.close |= second - nearest < margin * nearest;

    const Triangle& seen = mesh[static_cast<std::size_t>(verdict.triangle)];
    const vec3l n = normalized(cross(wide(seen[1]) - wide(seen[0]), wide(seen[2]) - wide(seen[0])));
    verdict.close |= std::fabs(dot(n, light)) < margin;
    if (dot(n, light) <= 0) {
        verdict.truth = Truth::away;
        return verdict;
    }
    verdict.truth = Truth::lit;
    const vec3l point = origin + direction * nearest;
    for (std::size_t i = 0; i < mesh.size(); i++) {
        if (static_cast<int>(i) == verdict.triangle) continue;
        const Meeting m = meet(mesh[i], point, light);
        verdict.close |= m.close;
        if (m.meets) verdict.truth = Truth::shadowed;
    }
    return verdict;
}

void compare_with_brute_force(const Mesh& mesh, unsigned seed, int views = 6) {
    Random random(seed + 1000);  // not the mesh's numbers once more
    const RayCaster caster(mesh);
    int pixels = 0, close = 0, counts[4] = {};
    for (int i = 0; i < views; i++) {
        const View view{random.unit() * random(1.5, 6), random.in_cube(.3), random.unit(), 24, 20};
        const vec3 light = random.unit();
        const TruthImage image = cast(caster, view, light);
        for (int y = 0; y < view.height; y++)
            for (int x = 0; x < view.width; x++) {
                const Verdict v = brute_force(mesh, wide(view.eye), wide(view.direction(x, y)), wide(light));
                const std::size_t at = static_cast<std::size_t>(y * view.width + x);
                pixels++;
                counts[static_cast<int>(image.pixel[at])]++;
                if (v.close) {
                    close++;
                    continue;
                }
                CHECK_EQ(image.triangle[at], v.triangle);
                CHECK_EQ(static_cast<int>(image.pixel[at]), static_cast<int>(v.truth));
            }
    }
    CHECK(close * 1000 <= pixels);                    // the margin must not hide what is compared
    for (const int count : counts) CHECK(count > 0);  // and every outcome must occur
}

// ---- pictures ----

long count(const TruthImage& image, Truth truth) { return std::count(image.pixel.begin(), image.pixel.end(), truth); }

bool same(const TruthImage& a, const TruthImage& b) {
    return a.width == b.width && a.height == b.height && a.pixel == b.pixel && a.triangle == b.triangle;
}

}  // namespace

// ---- against brute force ----

TEST("brute force: a bumpy sphere") { compare_with_brute_force(sphere(12, 16, .5), 1); }
TEST("brute force: boxes, one standing on the other") {
    Mesh mesh = box({-1, -.5, -1}, {1, 0, 1});
    append(mesh, box({-.5, 0, -.5}, {.25, 1, .5}));
    compare_with_brute_force(mesh, 2);
}
TEST("brute force: a landscape with creases") { compare_with_brute_force(landscape(12, 3), 3); }
TEST("brute force: thin needles") {
    compare_with_brute_force(needles(300, .05, 4), 4);
    Mesh mesh = needles(300, 1e-5, 5);
    append(mesh, landscape(4, 5));
    compare_with_brute_force(mesh, 5);
}
TEST("brute force: a soup of large and of small triangles") {
    compare_with_brute_force(soup(60, 1, 6), 6);
    compare_with_brute_force(soup(1500, .15, 7), 7, 3);
}

// ---- watertight ----

// From a point within a closed mesh every ray must meet it: aimed at corners, at points of edges, anywhere.
static void cannot_escape(const Mesh& mesh, const vec3& origin, int rays, unsigned seed) {
    Random random(seed);
    Mesh with_receiver = mesh;  // a triangle with the origin as a corner, to send shadow rays from
    with_receiver.push_back({origin, origin + vec3{0x1p-20, 0, 0}, origin + vec3{0, 0x1p-20, 0}});
    const RayCaster caster(mesh), shadow_caster(with_receiver);
    const int receiver = static_cast<int>(mesh.size());
    double size = 0;
    for (const Triangle& t : mesh)
        for (const vec3& v : t) size = std::max(size, norm(v));
    for (int i = 0; i < rays; i++) {
        const Triangle& t = mesh[static_cast<std::size_t>(random.below(static_cast<int>(mesh.size())))];
        const int c = random.below(3);
        const vec3 &a = t[static_cast<std::size_t>(c)], &b = t[static_cast<std::size_t>((c + 1) % 3)];
        const int kind = random.below(4);
        const vec3 target = kind == 0   ? a
                            : kind == 1 ? a * .5 + b * .5
                            : kind == 2 ? a + (b - a) * random(0, 1)
                                        : vec3{};
        vec3 direction = kind == 3 ? random.unit() : target - origin;
        if (random.below(2)) direction = direction * random(.1, 10);  // moves it by rounding
        const auto hit = caster.first_hit(origin, direction);
        if (CHECK(hit.has_value())) CHECK_NEAR(norm(hit->point - (origin + direction * hit->t)) / size, 0, 1e-13);
        CHECK(shadow_caster.occluded(receiver, {1, 0, 0}, direction));
        CHECK(caster.occluded(origin, direction, 0));
    }
}

TEST("watertight: no ray slips out of a bumpy sphere") {
    cannot_escape(sphere(40, 64, .3), {0, 0, 0}, 10000, 11);
    cannot_escape(sphere(40, 64, .3), {.123, -.234, .345}, 10000, 12);
}
TEST("watertight: no ray slips out of a cube, hitting integer edges and corners exactly") {
    Mesh mesh;  // its sides cut into 8 by 8
    const auto side = [&](auto place) { append(mesh, grid(8, 4, place)); };
    side([](const vec3& v) { return vec3{v.x, 4, v.z}; });
    side([](const vec3& v) { return vec3{v.x, -4, v.z}; });
    side([](const vec3& v) { return vec3{4, v.x, v.z}; });
    side([](const vec3& v) { return vec3{-4, v.x, v.z}; });
    side([](const vec3& v) { return vec3{v.x, v.z, 4}; });
    side([](const vec3& v) { return vec3{v.x, v.z, -4}; });
    cannot_escape(mesh, {0, 0, 0}, 5000, 13);
    cannot_escape(mesh, {1, -2, 3}, 5000, 14);
    const RayCaster caster(mesh);
    for (int axis = 0; axis < 3; axis++)  // along the axes the rays run in the planes of edges
        for (const double s : {-1., 1.}) {
            vec3 direction;
            direction[axis] = s;
            const auto hit = caster.first_hit({1, -2, 3}, direction);
            if (CHECK(hit.has_value())) CHECK_EQ(hit->point[axis], 4 * s);
        }
}
TEST("watertight: no ray slips out of a needle's tip") {
    // A closed pyramid a million times longer than wide.
    const vec3 tip{1e3, 0, 0}, a{0, 1e-3, 0}, b{0, -1e-3, 1e-3}, c{0, -1e-3, -1e-3};
    cannot_escape({{a, b, tip}, {b, c, tip}, {c, a, tip}, {a, c, b}}, {1, 0, 0}, 5000, 15);
}
TEST("watertight: an edge that is hit belongs to the triangles on both sides") {
    const vec3 a{0, -1, 0}, b{0, 1, 0}, left{-1, 0, 0}, right{1, 0, 0};
    const RayCaster both({{a, b, left}, {b, a, right}}), one({{a, b, left}}), other({{b, a, right}});
    for (const RayCaster* caster : {&both, &one, &other}) {
        CHECK(caster->first_hit({0, .25, 1}, {0, 0, -1}).has_value());
        CHECK(caster->first_hit({0, 1, 1}, {0, 0, -1}).has_value());  // the corner
        CHECK(caster->first_hit({1, .25, 1}, {-1, 0, -1}).has_value());
        CHECK(!caster->first_hit({0, 1 + 0x1p-52, 1}, {0, 0, -1}).has_value());
        CHECK(!caster->first_hit({0, .25, 1}, {0, 0, 1}).has_value());
    }
    // A hair beside the edge only one is left. The hair is far below the rounding of the coordinates.
    CHECK_EQ(both.first_hit({1e-30, .25, 1}, {0, 0, -1})->triangle, 1);
    CHECK_EQ(both.first_hit({-1e-30, .25, 1}, {0, 0, -1})->triangle, 0);
    CHECK(!one.first_hit({1e-30, .25, 1}, {0, 0, -1}).has_value());
    CHECK(!other.first_hit({-1e-30, .25, 1}, {0, 0, -1}).has_value());
}
TEST("a triangle that is seen edge-on or has no area is not there") {
    const RayCaster caster({{{{-1, 0, -1}, {1, 0, -1}, {0, 0, 1}}},
                            {{{-1, 3, 0}, {0, 3, 0}, {1, 3, 0}}},
                            {{{5, 5, 5}, {5, 5, 5}, {5, 5, 5}}}});
    CHECK(!caster.first_hit({-2, 0, 0}, {1, 0, 0}).has_value());
    CHECK(!caster.first_hit({0, 4, 0}, {.25, -1, 0}).has_value() ||
          caster.first_hit({0, 4, 0}, {.25, -1, 0})->triangle == 0);
    CHECK(!caster.first_hit({5, 5, 4}, {0, 0, 1}).has_value());
    CHECK(caster.first_hit({-2, 2e-30, 0}, {1, -1e-30, 0}).has_value());  // not quite edge-on
}

// ---- ties ----

TEST("of coincident faces the one is seen that shows its front, and neither shadows the other") {
    Mesh mesh = grid(5, 1, [](const vec3& v) { return vec3{v.x, .3 * v.x - .7 * v.z, v.z}; });
    const int n = static_cast<int>(mesh.size());
    for (int i = 0; i < n; i++) {  // the back, other corners first
        const Triangle t = mesh[static_cast<std::size_t>(i)];
        mesh.push_back({t[1], t[0], t[2]});
    }
    for (const bool from_above : {true, false}) {
        Random random(21);
        for (int i = 0; i < 5; i++) {
            vec3 eye = random.unit() * 3, light = random.unit();
            const vec3 normal{-.3, 1, .7};
            if (dot(eye, normal) < 0) eye = -eye;
            if (dot(light, normal) < 0) light = -light;
            const View view{from_above ? eye : -eye, {}, {0, 1, 0}, 60, 60};
            const TruthImage image = cast(RayCaster(mesh), view, from_above ? light : -light);
            CHECK(count(image, Truth::lit) > 100);
            CHECK_EQ(count(image, Truth::lit) + count(image, Truth::background), 3600);
            for (const int triangle : image.triangle) CHECK(triangle < 0 || (triangle >= n) == !from_above);
        }
    }
}
TEST("of layers any distance apart the nearer one is seen") {
    for (const double gap : {1e-3, 1e-9, 1e-15, 1e-25}) {
        Mesh mesh;  // the nearer layer is cut otherwise
        quad(mesh, {-1, -1, gap}, {1, -1, gap}, {1, 1, gap}, {-1, 1, gap});
        quad(mesh, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {-1, -1, 0});
        for (const bool swapped : {false, true}) {
            if (swapped) std::rotate(mesh.begin(), mesh.begin() + 2, mesh.end());
            const TruthImage image = cast(RayCaster(mesh), {{.3, .4, 3}, {}, {0, 1, 0}, 50, 50}, {.5, .25, 1});
            long seen[2] = {};
            for (const int triangle : image.triangle)
                if (triangle >= 0) seen[triangle / 2]++;
            CHECK(seen[swapped] > 500);
            CHECK(seen[!swapped] < 50);  // of the rear one a parallax's strip at most
            if (gap < 1e-3) CHECK_EQ(seen[!swapped], 0);
            CHECK_EQ(count(image, Truth::shadowed), 0);
        }
    }
}

// ---- shadows where they begin ----

TEST("grazing light on a plane makes no shadow") {
    const double c = std::cos(.3), s = std::sin(.3);
    const auto tilted = [&](const vec3& v) {  // rounded: no four corners are in one plane
        const vec3 w{c * v.x - s * v.y, s * v.x + c * v.y, v.z};
        return vec3{w.x, c * w.y - s * w.z, s * w.y + c * w.z};
    };
    for (const double slope : {1e-1, 1e-4, 1e-6, 1e-9, 1e-12}) {
        for (const vec3& along : {vec3{1, slope, 0}, vec3{-1, slope, .3}, vec3{.6, slope, .8}}) {
            const TruthImage flat =
                cast(RayCaster(grid(40, 1, unchanged)), {{.5, 2, 3}, {}, {0, 1, 0}, 120, 120}, along);
            CHECK(count(flat, Truth::lit) > 2000);
            CHECK_EQ(count(flat, Truth::lit) + count(flat, Truth::background), 14400);
            if (slope < 1e-6) continue;  // the corners' rounding casts true shadows of 1e-16/slope
            const View view{tilted({.5, 2, 3}), {}, {0, 1, 0}, 120, 120};
            const TruthImage askew = cast(RayCaster(grid(40, 1, tilted)), view, tilted(along));
            CHECK(count(askew, Truth::lit) > 2000);
            CHECK_EQ(count(askew, Truth::lit) + count(askew, Truth::background), 14400);
        }
    }
}
TEST("a pixel's ray through the edges and corners of a flat grid makes no shadow") {
    // The eye above the middle of a picture of odd size looks at corners: a cell is a pixel wide.
    const int size = 33;
    const View view{{0, 4, 0}, {}, {0, 0, -1}, size, size};
    const double pixel = 2 / (.75 * size);
    for (const double height : {0., .25}) {
        const Mesh mesh = grid(30, 15 * pixel, [&](const vec3& v) { return v + vec3{0, height, 0}; });
        const TruthImage image = cast(RayCaster(mesh), view, {1, 1e-4, .3});
        CHECK(count(image, Truth::lit) >= 29 * 29);
        CHECK_EQ(count(image, Truth::lit) + count(image, Truth::background), size * size);
    }
}
TEST("a convex body does not shadow itself, not even at a facet's edges") {
    const Mesh mesh = icosphere(2);
    for (const Triangle& t : mesh)  // it is convex: no corner lies in front of a facet
        for (const Triangle& other : mesh)
            for (const vec3& v : other) {
                if (v == t[0] || v == t[1] || v == t[2]) continue;
                CHECK(dot(cross(t[1] - t[0], t[2] - t[0]), v - t[0]) < -1e-6);
            }
    const RayCaster caster(mesh);
    Random random(31);
    for (int i = 0; i < 20; i++) {
        // From the edges of a facet and inside of it, the light as good as in its plane.
        const int number = random.below(static_cast<int>(mesh.size()));
        const Triangle& t = caster.triangle(number);
        const vec3 normal = normalized(cross(t[1] - t[0], t[2] - t[0]));
        for (const double slope : {1., 1e-4, 1e-8, 1e-12}) {
            const vec3 light = normalized(cross(normal, random.unit())) + normal * slope;
            if (!CHECK(caster.faces(number, light))) continue;
            for (const double w : {0., 1e-100, 1e-17, 1e-3, .4})
                for (const vec3& weight :
                     {vec3{w, .5, .5 - w}, vec3{.5, w, .5 - w}, vec3{.5, .5 - w, w}, vec3{1 - w, w, 0}})
                    CHECK(!caster.occluded(number, weight, light));
        }
        const TruthImage image = cast(caster, {random.unit() * 3, {}, {0, 1, 0}, 80, 80}, random.unit());
        CHECK(count(image, Truth::lit) + count(image, Truth::away) > 1000);
        CHECK_EQ(count(image, Truth::shadowed), 0);
    }
}
TEST("in a crease the shadow begins at the crease") {
    Random random(41);
    for (int i = 0; i < 200; i++) {
        // A wall x = 0 on a floor y = 0, the edge between them on the z axis, turned and rounded.
        const vec3 x = random.unit(), y = normalized(cross(x, random.unit())), z = cross(x, y);
        const auto turned = [&](double a, double b, double c) { return x * a + y * b + z * c; };
        const vec3 near = turned(0, 0, 1), far = turned(0, 0, -1);
        const RayCaster caster({{far, near, turned(1, 0, 0)}, {near, far, turned(0, 1, 0)}});
        const double slope = random(.1, 1);
        const vec3 through_wall = turned(-1, slope, 0), beside_wall = turned(1, slope, 0);
        CHECK(caster.faces(0, through_wall) && caster.faces(0, beside_wall));
        for (const double w : {.3, 1e-3, 1e-9, 1e-16, 1e-40, 1e-80}) {
            CHECK(caster.occluded(0, {.5 - .5 * w, .5 - .5 * w, w}, through_wall));
            CHECK(!caster.occluded(0, {.5 - .5 * w, .5 - .5 * w, w}, beside_wall));
            CHECK(!caster.occluded(1, {.5 - .5 * w, .5 - .5 * w, w}, beside_wall));
        }
        // On the crease itself nothing is in front; behind it, in the floor's plane, the wall is not above.
        CHECK(!caster.occluded(0, {.3, .7, 0}, through_wall));
        CHECK(!caster.occluded(0, {.6, .6, -.2}, through_wall));
        CHECK(caster.occluded(0, {.6, .6, -.2}, beside_wall));
    }
}
TEST("a triangle that only touches the receiver with a corner shadows what is behind that corner") {
    // The flag stands on the floor's corner (0,0,0) and leans over it.
    const RayCaster caster({{{{0, 0, 0}, {1, 0, 1}, {1, 0, -1}}}, {{{0, 0, 0}, {1, 1, -1}, {1, 1, 1}}}});
    const vec3 up{0, 1, 0};
    CHECK(!caster.occluded(0, {1, 0, 0}, up));
    for (const double w : {.5, 1e-8, 1e-17, 1e-80}) {
        CHECK(caster.occluded(0, {1 - 2 * w, w, w}, up));
        CHECK(!caster.occluded(0, {1 - 2 * w, w, w}, -up));
        CHECK(!caster.occluded(0, {1 - 2 * w, w, w}, {2, 1, 0}));
    }
}

TEST("a light in the plane of a triangle does not shine on its front") {
    Random random(45);
    for (int i = 0; i < 300; i++) {
        // Coordinates with few digits, so that the sums below are exact and the light is in the plane to the bit.
        Triangle t;
        for (vec3& v : t)
            for (int k = 0; k < 3; k++) v[k] = std::round(random.in_cube(1)[k] * 0x1p40) * 0x1p-40;
        const vec3 e1 = t[1] - t[0], e2 = t[2] - t[0], light = e1 * (random.below(7) - 3) + e2 * (random.below(7) - 3);
        const RayCaster caster(Mesh{t});
        CHECK(!caster.faces(0, light) && !caster.faces(0, -light));
        const vec3 normal = normalized(cross(e1, e2));
        CHECK(caster.faces(0, light + normal * 1e-12) && !caster.faces(0, light - normal * 1e-12));
    }
}

// ---- closed forms ----

TEST("the shadow of a box on a floor") {
    const vec3 low{-.5, .25, -.6}, high{.5, 1.25, .4}, light{-1, 2, .5};
    Mesh mesh = box(low, high);
    append(mesh, grid(7, 3, unchanged));
    const View view{{1, 4, 5}, {.2, .1, -.3}, {.1, 1, 0}, 240, 160};
    const TruthImage image = cast(RayCaster(mesh), view, light);

    // Where the line origin + t direction is in the box: from `in` to `out`, through the side +-(axis + 1).
    struct Range {
        double in, out;
        int side;
    };
    const auto range = [&](const vec3& origin, const vec3& direction) {
        Range r{-1e300, 1e300, 0};
        for (int i = 0; i < 3; i++) {
            const bool up = direction[i] > 0;
            const double in = ((up ? low : high)[i] - origin[i]) / direction[i];
            const double out = ((up ? high : low)[i] - origin[i]) / direction[i];
            if (in > r.in) r.in = in, r.side = up ? -(i + 1) : i + 1;
            r.out = std::min(r.out, out);
        }
        return r;
    };
    int close = 0;
    for (int y = 0; y < view.height; y++)
        for (int x = 0; x < view.width; x++) {
            // The camera as it is defined, written out once more.
            const vec3 az = normalized(view.eye - view.center), ax = normalized(cross(view.up, az)), ay = cross(az, ax);
            const vec3 at = view.center + ax * ((x + .5 - 120) / 60) + ay * ((y + .5 - 80) / 60);
            const vec3 direction = at - view.eye;
            const Range seen = range(view.eye, direction);
            const vec3 on_floor = view.eye + direction * (-view.eye.y / direction.y);
            Truth expected = Truth::background;
            double margin = std::fabs(seen.out - seen.in);
            if (seen.in < seen.out) {
                vec3 normal;
                normal[std::abs(seen.side) - 1] = seen.side;
                expected = dot(normal, light) > 0 ? Truth::lit : Truth::away;  // the box is convex
            } else if (std::fabs(on_floor.x) < 3 && std::fabs(on_floor.z) < 3 && direction.y < 0) {
                const Range shadow = range(on_floor, light);
                expected = shadow.in < shadow.out ? Truth::shadowed : Truth::lit;
                margin = std::min(margin, std::fabs(shadow.out - shadow.in));
            }
            margin = std::min({margin, std::fabs(std::fabs(on_floor.x) - 3), std::fabs(std::fabs(on_floor.z) - 3)});
            if (margin < 1e-9) close++;
            else
                CHECK_EQ(static_cast<int>(image.pixel[static_cast<std::size_t>(y * view.width + x)]),
                         static_cast<int>(expected));
        }
    CHECK_EQ(close, 0);
    for (const Truth truth : {Truth::background, Truth::away, Truth::shadowed, Truth::lit})
        CHECK(count(image, truth) > 200);
}

TEST("the same scene far away, huge or tiny makes the same picture") {
    Mesh mesh = landscape(8, 51);
    append(mesh, sphere(8, 12, .3, 52));
    for (Triangle& t : mesh)
        for (vec3& v : t)
            for (int i = 0; i < 3; i++) v[i] = std::round(v[i] * 1024) / 1024;  // so that moving it is exact
    const View view{{1, 2, 4}, {}, {0, 1, 0}, 100, 100};
    const vec3 light{1, 1, .5};
    const TruthImage expected = cast(RayCaster(mesh), view, light);
    CHECK(count(expected, Truth::shadowed) > 200);

    struct Move {
        double scale, shift;
    };
    for (const Move& move :
         {Move{1, 0x1p20}, {1, 0x1p40}, {0x1p-90, 0}, {0x1p-90, 0x1p40}, {0x1p120, 0}, {0x1p90, 0x1p40}}) {
        const auto moved = [&](const vec3& v) { return (v + vec3{move.shift, -move.shift, move.shift}) * move.scale; };
        Mesh other = mesh;
        for (Triangle& t : other)
            for (vec3& v : t) v = moved(v);
        const RayCaster caster(other);
        for (int y = 0; y < view.height; y++)
            for (int x = 0; x < view.width; x++) {
                const std::size_t at = static_cast<std::size_t>(y * view.width + x);
                const auto hit = caster.first_hit(moved(view.eye), view.direction(x, y) * move.scale);
                CHECK_EQ(hit ? hit->triangle : -1, expected.triangle[at]);
                if (!hit || hit->triangle != expected.triangle[at]) continue;
                CHECK_EQ(caster.faces(hit->triangle, light), expected.pixel[at] != Truth::away);
                if (expected.pixel[at] == Truth::away) continue;
                CHECK_EQ(caster.occluded(hit->triangle, hit->weight, light), expected.pixel[at] == Truth::shadowed);
            }
    }
}
TEST("the view: the picture's middle, its corners, and an up that says nothing") {
    const View view{{0, 0, 2}, {0, 0, 0}, {0, 1, 0}, 8, 4};
    CHECK(view.direction(0, 0) == (vec3{-7 / 3., -1, -2}));
    CHECK(view.direction(7, 3) == (vec3{7 / 3., 1, -2}));
    for (const vec3& up : {vec3{}, vec3{0, 0, -3}}) {
        const View other{{0, 0, 2}, {0, 0, 0}, up, 8, 4};
        CHECK(other.direction(7, 3) == view.direction(7, 3));
    }
    const vec3 from_above = View{{0, 3, 0}, {0, 0, 0}, {0, 1, 0}, 4, 4}.direction(3, 2);
    CHECK_NEAR(norm(from_above - vec3{1 / 3., -3, 1}), 0, 0x1p-50);
}

// ---- the interface ----

TEST("the number of threads does not matter") {
    Mesh mesh = landscape(16, 61);
    append(mesh, sphere(10, 10, .4, 62));
    const RayCaster caster(mesh);
    const View view{{1, 1, 4}, {}, {0, 1, 0}, 97, 61};
    const TruthImage one = cast(caster, view, {1, 1, 0}, 1);
    CHECK(count(one, Truth::shadowed) > 100);
    for (const int threads : {2, 3, 7, 100}) CHECK(same(one, cast(caster, view, {1, 1, 0}, threads)));
}
TEST("triangles are counted over the models in their order") {
    const TemporaryFolder folder("truth_test");
    const auto model = [&](const std::string& name, const std::string& text) {
        write_bytes(folder / name, Bytes(text.begin(), text.end()));
        return Model(folder / name);
    };
    std::vector<Model> models;
    models.push_back(model("two.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"));
    models.push_back(model("one.obj", "v 0 0 -1\nv 5 0 -1\nv 0 5 -1\nf 1 2 3\n"));
    const RayCaster caster{std::span<const Model>(models)};
    CHECK_EQ(caster.ntriangles(), 3);
    CHECK_EQ(caster.first_hit({.5, .25, 2}, {0, 0, -1})->triangle, 0);
    CHECK_EQ(caster.first_hit({.25, .5, 2}, {0, 0, -1})->triangle, 1);
    const Hit hit = *caster.first_hit({2, 1, 3}, {0, 0, -2});
    CHECK_EQ(hit.triangle, 2);
    CHECK_EQ(hit.t, 2);
    CHECK(hit.point == (vec3{2, 1, -1}));
    CHECK(norm(hit.weight - vec3{.4, .4, .2}) < 1e-15);
    CHECK(caster.triangle(2)[1] == (vec3{5, 0, -1}));
}
TEST("without triangles there is nothing to see") {
    const RayCaster caster(Mesh{});
    CHECK_EQ(caster.ntriangles(), 0);
    CHECK(!caster.first_hit({}, {0, 0, 1}).has_value());
    CHECK(!caster.occluded({}, {0, 0, 1}, 0));
    CHECK_EQ(count(cast(caster, {{1, 1, 4}, {}, {0, 1, 0}, 3, 2}, {1, 1, 0}), Truth::background), 6);
}
TEST("meaningless input is refused") {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    CHECK_THROWS(RayCaster(Mesh{{{{0, 0, nan}, {1, 0, 0}, {0, 1, 0}}}}), "coordinate");
    CHECK_THROWS(RayCaster(Mesh{{{{0, 0, 2e40}, {1, 0, 0}, {0, 1, 0}}}}), "coordinate");
    const RayCaster caster(box({-1, -1, -1}, {1, 1, 1}));
    CHECK_THROWS(caster.first_hit({}, {}), "direction");
    CHECK_THROWS(caster.first_hit({}, {nan, 1, 0}), "direction");
    CHECK_THROWS(cast(caster, {{1, 2, 3}, {1, 2, 3}, {0, 1, 0}, 4, 4}, {1, 1, 0}, 2), "view");
    CHECK_THROWS(cast(caster, {{1, 2, nan}, {}, {0, 1, 0}, 4, 4}, {1, 1, 0}, 2), "view");
    CHECK_THROWS(cast(caster, {{1, 1, 4}, {}, {0, 1, 0}, 0, 4}, {1, 1, 0}, 2), "pixels");
    CHECK_THROWS(cast(caster, {}, {0, 0, 0}, 2), "light");
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
