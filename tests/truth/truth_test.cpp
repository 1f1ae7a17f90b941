// truth_test.cpp: is the truth true? The ray caster against brute force in long double, and where rounding would show:
// edges and corners hit exactly, coincident faces, grazing light, creases, far and tiny scenes.
#include "truth.h"

#include "check.h"
#include "files.h"
#include "random.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace {

constexpr double pi = std::numbers::pi;

vec3 unit(Random& random) { return normalized(random.point(1)); }

// ---- meshes ----

using Mesh = std::vector<Triangle>;

Mesh operator+(Mesh a, const Mesh& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

void quad(Mesh& mesh, const vec3& a, const vec3& b, const vec3& c, const vec3& d) {
    mesh.push_back({a, b, c});
    mesh.push_back({a, c, d});
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

// Its sides cut n by n, their fronts outwards.
Mesh box(const vec3& low, const vec3& high, int n = 1) {
    Mesh mesh;
    for (int side = 0; side < 6; side++)
        mesh = mesh + grid(n, 1, [&](const vec3& v) {  // the grid is the top, turned
            const int k = side % 3, sign = side < 3 ? 1 : -1;
            vec3 p;
            p[k] = sign, p[(k + 1) % 3] = v.z, p[(k + 2) % 3] = sign * v.x;
            for (int i = 0; i < 3; i++) p[i] = low[i] + (high[i] - low[i]) * ((p[i] + 1) / 2);
            return p;
        });
    return mesh;
}

// A closed mesh around the origin, star-shaped: its vertices are on the unit sphere, times 1 + a random share of bumps.
// Rings are turned by half a sector against each other: without bumps it is strictly convex.
Mesh sphere(int rings, int sectors, double bumps = 0) {
    Random random(1);
    std::vector<vec3> vertices;
    for (int i = 0; i < (rings + 1) * sectors; i++) {
        const double r = i / sectors, a = pi * r / rings, b = 2 * pi * (i % sectors + r / 2) / sectors;
        vertices.push_back(vec3{std::sin(a) * std::cos(b), std::cos(a), -std::sin(a) * std::sin(b)} *
                           (1 + bumps * random.in(0, 1)));
    }
    const auto at = [&](int r, int s) {  // all of a pole's vertices are one
        return vertices[r * sectors + (r == 0 || r == rings ? 0 : s % sectors)];
    };
    Mesh mesh;
    for (int r = 0; r < rings; r++)
        for (int s = 0; s < sectors; s++) {
            if (r > 0) mesh.push_back({at(r, s), at(r + 1, s), at(r, s + 1)});
            if (r < rings - 1) mesh.push_back({at(r, s + 1), at(r + 1, s), at(r + 1, s + 1)});
        }
    return mesh;
}

Mesh landscape(int n) {  // creases of all kinds
    return grid(n, 1, [](const vec3& v) {
        return vec3{v.x, .4 * std::sin(50 * v.x + 170 * v.z * v.x + 80 * v.z), v.z};
    });
}

Mesh soup(int n, double length, double width) {
    Random random(4);
    Mesh mesh;
    for (int i = 0; i < n; i++) {
        const vec3 a = random.point(1), b = a + random.point(length);
        mesh.push_back({a, b, b + random.point(width)});
    }
    return mesh;
}

// ---- pictures ----

long count(const TruthImage& image, Truth truth) { return std::count(image.pixel.begin(), image.pixel.end(), truth); }

// Whether the surface is lit wherever it is seen, by at least so many pixels.
bool all_lit(const TruthImage& image, long least) {
    const long lit = count(image, Truth::lit);
    return lit >= least && lit + count(image, Truth::background) == long{image.width} * image.height;
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
Verdict brute_force(const Mesh& mesh, const vec3l& eye, const vec3l& to_pixel, const vec3l& light) {
    constexpr long double margin = 1e-9L, none = std::numeric_limits<long double>::infinity();
    Verdict verdict;
    const auto meet = [&](const Triangle& triangle, const vec3l& from, const vec3l& along) {  // where, or nowhere
        const vec3l e1 = wide(triangle[1]) - wide(triangle[0]), e2 = wide(triangle[2]) - wide(triangle[0]);
        const vec3l p = cross(along, e2), s = from - wide(triangle[0]), q = cross(s, e1);
        const long double det = dot(e1, p), u = dot(s, p) / det, v = dot(along, q) / det, t = dot(e2, q) / det;
        const long double inside = std::min({u, v, 1 - u - v});
        verdict.close |= !(std::fabs(det) > margin * margin * norm(along) * norm(e1) * norm(e2)) ||
                         std::fabs(inside) < margin || (inside > 0 && std::fabs(t) < margin);
        return inside > 0 && t > 0 ? t : none;
    };
    long double nearest = none, second = none;
    for (int i = 0; i < static_cast<int>(mesh.size()); i++) {
        const long double t = meet(mesh[i], eye, to_pixel);
        second = std::min(second, std::max(t, nearest));
        if (t < nearest) nearest = t, verdict.triangle = i;
    }
    if (verdict.triangle < 0) return verdict;
    const Triangle& seen = mesh[verdict.triangle];
    const vec3l n = normalized(cross(wide(seen[1]) - wide(seen[0]), wide(seen[2]) - wide(seen[0])));
    verdict.close |= second - nearest < margin * nearest || std::fabs(dot(n, light)) < margin;
    verdict.truth = dot(n, light) > 0 ? Truth::lit : Truth::away;
    for (int i = 0; i < static_cast<int>(mesh.size()) && dot(n, light) > 0; i++)
        if (i != verdict.triangle && meet(mesh[i], eye + to_pixel * nearest, light) < none)
            verdict.truth = Truth::shadowed;
    return verdict;
}

}  // namespace

TEST("brute force: bumps, boxes, creases, needles, and soups of large and small triangles") {
    unsigned seed = 1000;
    for (const Mesh& mesh : {sphere(12, 16, .5), box({-1, -.5, -1}, {1, 0, 1}) + box({-.5, 0, -.5}, {.25, 1, .5}),
                             landscape(12), soup(300, 1, .05), soup(300, 1, 1e-5) + landscape(4), soup(60, 1, 1),
                             soup(1500, .15, .15)}) {
        Random random(seed++);
        const RayCaster caster(mesh);
        int pixels = 0, close = 0, counts[4] = {};
        for (int i = 0; i < 5; i++) {
            const View view{unit(random) * random.in(1.5, 6), random.point(.3), unit(random), 24, 20};
            const vec3 light = unit(random);
            const TruthImage image = cast(caster, view, light);
            // The camera as it is defined, written out once more.
            const vec3l z = normalized(wide(view.eye - view.center)), x = normalized(cross(wide(view.up), z)),
                        y = cross(z, x);
            for (; pixels < (i + 1) * 480; pixels++) {
                const int at = pixels % 480;
                const vec3l seen =
                    x * ((at % 24 + .5L - 12) / 7.5L) + y * ((at / 24 + .5L - 10) / 7.5L) + wide(view.center);
                const Verdict v = brute_force(mesh, wide(view.eye), seen - wide(view.eye), wide(light));
                counts[static_cast<int>(image.pixel[at])]++;
                close += v.close;
                if (v.close) continue;
                CHECK_EQ(image.triangle[at], v.triangle);
                CHECK_EQ(static_cast<int>(image.pixel[at]), static_cast<int>(v.truth));
            }
        }
        CHECK(close * 1000 <= pixels);                    // the margin must not hide what is compared
        for (const int count : counts) CHECK(count > 0);  // and every outcome must occur
    }
}

// ---- watertight ----

// From a point within a closed mesh every ray must meet it: aimed at corners, at points of edges, anywhere.
static void cannot_escape(const Mesh& mesh, const vec3& origin, int rays) {
    Random random(11);
    const Triangle receiver{origin, origin + vec3{0x1p-20, 0, 0}, origin + vec3{0, 0x1p-20, 0}};  // of shadow rays
    const RayCaster caster(mesh), shadow_caster(mesh + Mesh{receiver});
    double size = 0;
    for (const Triangle& t : mesh)
        for (const vec3& v : t) size = std::max(size, norm(v));
    for (int i = 0; i < rays; i++) {
        const Triangle& t = mesh[random.below(caster.ntriangles())];
        const int c = random.below(3), kind = random.below(4);
        const double along = kind == 0 ? 0 : kind == 1 ? .5 : random.in(0, 1);
        vec3 direction = kind == 3 ? unit(random) : t[c] * (1 - along) + t[(c + 1) % 3] * along - origin;
        if (random.below(2)) direction = direction * random.in(.1, 10);  // moves it by rounding
        const auto hit = caster.first_hit(origin, direction);
        if (CHECK(hit.has_value())) CHECK_NEAR(norm(hit->point - (origin + direction * hit->t)) / size, 0, 1e-13);
        CHECK(shadow_caster.occluded(caster.ntriangles(), {1, 0, 0}, direction));
        CHECK(caster.occluded(origin, direction, 0));
    }
}

TEST("watertight: no ray slips out of a bumpy sphere, of a cube of integer edges, or of a needle's tip") {
    cannot_escape(sphere(40, 64, .3), {0, 0, 0}, 10000);
    cannot_escape(sphere(40, 64, .3), {.123, -.234, .345}, 10000);
    const Mesh cube = box({-4, -4, -4}, {4, 4, 4}, 8);
    cannot_escape(cube, {0, 0, 0}, 5000);
    cannot_escape(cube, {1, -2, 3}, 5000);
    for (int side = 0; side < 6; side++) {  // along the axes the rays run in the planes of edges
        vec3 direction;
        direction[side % 3] = side < 3 ? 1 : -1;
        const auto hit = RayCaster(cube).first_hit({1, -2, 3}, direction);
        if (CHECK(hit.has_value())) CHECK_EQ(hit->point[side % 3], side < 3 ? 4. : -4.);
    }
    const vec3 tip{1e3, 0, 0}, a{0, 1e-3, 0}, b{0, -1e-3, 1e-3}, c{0, -1e-3, -1e-3};
    cannot_escape({{a, b, tip}, {b, c, tip}, {c, a, tip}, {a, c, b}}, {1, 0, 0}, 5000);
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
    CHECK_EQ(both.first_hit({0, .25, 1}, {0, 0, -1})->triangle, 0);  // the smaller number
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
    const auto below = caster.first_hit({0, 4, 0}, {.25, -1, 0});
    CHECK(!below || below->triangle == 0);
    CHECK(!caster.first_hit({5, 5, 4}, {0, 0, 1}).has_value());
    CHECK(caster.first_hit({-2, 2e-30, 0}, {1, -1e-30, 0}).has_value());  // not quite edge-on
}

// ---- ties ----

TEST("of coincident faces the one is seen that shows its front, and neither shadows the other") {
    Mesh mesh = grid(5, 1, [](const vec3& v) { return vec3{v.x, .3 * v.x - .7 * v.z, v.z}; });
    for (int i = 0; i < 50; i++) mesh.push_back({mesh[i][1], mesh[i][0], mesh[i][2]});  // the back, other corners first
    const vec3 normal{-.3, 1, .7};
    Random random(21);
    for (int i = 0; i < 10; i++) {
        const auto on_side = [&](const vec3& v) { return (dot(v, normal) < 0) == (i % 2 == 1) ? v : -v; };
        const TruthImage image =
            cast(RayCaster(mesh), {on_side(unit(random) * 3), {}, {0, 1, 0}, 60, 60}, on_side(unit(random)));
        CHECK(all_lit(image, 100));
        for (const int triangle : image.triangle) CHECK(triangle < 0 || (triangle >= 50) == i % 2);
    }
}
TEST("of layers any distance apart the nearer one is seen") {
    for (const double gap : {1e-3, 1e-9, 1e-15, 1e-25}) {
        Mesh mesh;  // the nearer layer is cut otherwise
        quad(mesh, {-1, -1, gap}, {1, -1, gap}, {1, 1, gap}, {-1, 1, gap});
        quad(mesh, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {-1, -1, 0});
        for (const bool swapped : {false, true}) {
            if (swapped) std::rotate(mesh.begin(), mesh.begin() + 2, mesh.end());
            const TruthImage image = cast(RayCaster(mesh), {{.3, .4, 3}, {}, {0, 1, 0}, 50, 50}, vec3{.5, .25, 1});
            long seen[2] = {};
            for (const int triangle : image.triangle)
                if (triangle >= 0) seen[triangle / 2]++;
            CHECK(seen[swapped] > 500);
            CHECK(seen[!swapped] < (gap < 1e-3 ? 1 : 50));  // of the rear one a parallax's strip at most
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
    const RayCaster flat(grid(40, 1, std::identity{})), askew(grid(40, 1, tilted));
    for (const double slope : {1e-1, 1e-4, 1e-6, 1e-9, 1e-12})
        for (const vec3& along : {vec3{1, slope, 0}, vec3{-1, slope, .3}, vec3{.6, slope, .8}}) {
            CHECK(all_lit(cast(flat, {{.5, 2, 3}, {}, {0, 1, 0}, 120, 120}, along), 2000));
            if (slope < 1e-6) continue;  // the corners' rounding casts true shadows of 1e-16/slope
            CHECK(all_lit(cast(askew, {tilted({.5, 2, 3}), {}, {0, 1, 0}, 120, 120}, tilted(along)), 2000));
        }
    // The eye above the middle of a picture of odd size looks at corners: a cell is a pixel wide.
    constexpr double pixel = 2 / (.75 * 33);
    for (const double height : {0., .25}) {
        const Mesh mesh = grid(30, 15 * pixel, [&](const vec3& v) { return v + vec3{0, height, 0}; });
        CHECK(all_lit(cast(RayCaster(mesh), {{0, 4, 0}, {}, {0, 0, -1}, 33, 33}, vec3{1, 1e-4, .3}), 29 * 29));
    }
}
TEST("a convex body does not shadow itself, not even at a facet's edges") {
    const RayCaster caster(sphere(9, 12));  // strictly convex
    Random random(31);
    for (int i = 0; i < 20; i++) {
        // From the edges of a facet and inside of it, the light as good as in its plane.
        const int number = random.below(caster.ntriangles());
        const Triangle& t = caster.triangle(number);
        const vec3 normal = normalized(cross(t[1] - t[0], t[2] - t[0]));
        for (const double slope : {1., 1e-4, 1e-8, 1e-12}) {
            const vec3 light = normalized(cross(normal, unit(random))) + normal * slope;
            CHECK(caster.faces(number, light));
            for (const double w : {0., 1e-100, 1e-17, 1e-3, .4})
                for (const vec3& weight : {vec3{w, .5, .5 - w}, {.5, w, .5 - w}, {.5, .5 - w, w}, {1 - w, w, 0}})
                    CHECK(!caster.occluded(number, weight, light));
        }
        const TruthImage image = cast(caster, {unit(random) * 3, {}, {0, 1, 0}, 80, 80}, unit(random));
        CHECK(count(image, Truth::lit) + count(image, Truth::away) > 1000);
        CHECK_EQ(count(image, Truth::shadowed), 0);
    }
}
TEST("in a crease the shadow begins at the crease") {
    Random random(41);
    for (int i = 0; i < 200; i++) {
        // A wall x = 0 on a floor y = 0, the edge between them on the z axis, turned and rounded.
        const vec3 x = unit(random), y = normalized(cross(x, unit(random))), z = cross(x, y);
        const RayCaster caster({{-z, z, x}, {z, -z, y}});
        const double slope = random.in(.1, 1);
        const vec3 through_wall = y * slope - x, beside_wall = y * slope + x;
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
    CHECK(!caster.occluded(0, {1, 0, 0}, {0, 1, 0}));
    for (const double w : {.5, 1e-8, 1e-17, 1e-80}) {
        CHECK(caster.occluded(0, {1 - 2 * w, w, w}, {0, 1, 0}));
        CHECK(!caster.occluded(0, {1 - 2 * w, w, w}, {0, -1, 0}));
        CHECK(!caster.occluded(0, {1 - 2 * w, w, w}, {2, 1, 0}));
    }
}
TEST("a light in the plane of a triangle does not shine on its front") {
    Random random(45);
    for (int i = 0; i < 300; i++) {
        // Coordinates with few digits, so that the sums below are exact and the light is in the plane to the bit.
        Triangle t;
        for (vec3& v : t)
            for (int k = 0; k < 3; k++) v[k] = std::round(random.in(-1, 1) * 0x1p40) * 0x1p-40;
        const vec3 e1 = t[1] - t[0], e2 = t[2] - t[0], light = e1 * (random.below(7) - 3) + e2 * (random.below(7) - 3);
        const RayCaster caster(Mesh{t});
        CHECK(!caster.faces(0, light) && !caster.faces(0, -light));
        const vec3 normal = normalized(cross(e1, e2));
        CHECK(caster.faces(0, light + normal * 1e-12) && !caster.faces(0, light - normal * 1e-12));
    }
}

TEST("the same scene far away, huge or tiny makes the same picture") {
    Mesh mesh = landscape(8) + sphere(8, 12, .3);
    for (Triangle& t : mesh)
        for (vec3& v : t)
            for (int i = 0; i < 3; i++) v[i] = std::round(v[i] * 1024) / 1024;  // so that moving it is exact
    const View view{{1, 2, 4}, {}, {0, 1, 0}, 100, 100};
    const vec3 light{1, 1, .5};
    const TruthImage expected = cast(RayCaster(mesh), view, light);
    CHECK(count(expected, Truth::shadowed) > 200);
    for (const auto& [scale, by] :
         {std::pair(1., 0x1p20), {1, 0x1p40}, {0x1p-90, 0}, {0x1p-90, 0x1p40}, {0x1p120, 0}, {0x1p90, 0x1p40}}) {
        const auto moved = [&, s = scale, d = by](const vec3& v) { return (v + vec3{d, -d, d}) * s; };
        Mesh other = mesh;
        for (Triangle& t : other)
            for (vec3& v : t) v = moved(v);
        const RayCaster caster(other);
        for (int at = 0; at < 10000; at++) {
            const auto hit = caster.first_hit(moved(view.eye), view.direction(at % 100, at / 100) * scale);
            const Truth truth = !hit                                                 ? Truth::background
                                : !caster.faces(hit->triangle, light)                ? Truth::away
                                : caster.occluded(hit->triangle, hit->weight, light) ? Truth::shadowed
                                                                                     : Truth::lit;
            CHECK_EQ(hit ? hit->triangle : -1, expected.triangle[at]);
            CHECK(truth == expected.pixel[at]);
        }
    }
}
TEST("the view: the picture's corners, and an up that says nothing") {
    for (const vec3& up : {vec3{0, 1, 0}, {}, {0, 0, -3}}) {
        const View view{{0, 0, 2}, {0, 0, 0}, up, 8, 4};
        CHECK(view.direction(0, 0) == (vec3{-7 / 3., -1, -2}));
        CHECK(view.direction(7, 3) == (vec3{7 / 3., 1, -2}));
    }
    const vec3 from_above = View{{0, 3, 0}, {0, 0, 0}, {0, 1, 0}, 4, 4}.direction(3, 2);
    CHECK_NEAR(norm(from_above - vec3{1 / 3., -3, 1}), 0, 0x1p-50);
}

// ---- the interface ----

TEST("the number of threads does not matter") {
    const RayCaster caster(landscape(16) + sphere(10, 10, .4));
    const View view{{1, 1, 4}, {}, {0, 1, 0}, 97, 61};
    const TruthImage one = cast(caster, view, vec3{1, 1, 0}, 1);
    CHECK(count(one, Truth::shadowed) > 100);
    for (const int threads : {2, 3, 7, 100}) {
        const TruthImage many = cast(caster, view, vec3{1, 1, 0}, threads);
        CHECK(many.pixel == one.pixel && many.triangle == one.triangle && many.width == 97 && many.height == 61);
    }
}
TEST("triangles are counted over the models in their order") {
    const TemporaryFolder folder("truth_test");
    std::ofstream(folder / "two.obj") << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";
    std::ofstream(folder / "one.obj") << "v 0 0 -1\nv 5 0 -1\nv 0 5 -1\nf 1 2 3\n";
    const std::vector<Model> models{Model(folder / "two.obj"), Model(folder / "one.obj")};
    const RayCaster caster{std::span<const Model>(models)};
    CHECK_EQ(caster.ntriangles(), 3);
    CHECK_EQ(caster.first_hit({.5, .25, 2}, {0, 0, -1})->triangle, 0);
    CHECK_EQ(caster.first_hit({.25, .5, 2}, {0, 0, -1})->triangle, 1);
    const Hit hit = *caster.first_hit({2, 1, 3}, {0, 0, -2});
    CHECK(hit.triangle == 2 && hit.t == 2 && hit.point == (vec3{2, 1, -1}));
    CHECK(norm(hit.weight - vec3{.4, .4, .2}) < 1e-15);
    CHECK(caster.triangle(2)[1] == (vec3{5, 0, -1}));
}
TEST("without triangles there is nothing to see") {
    const RayCaster caster(Mesh{});
    CHECK_EQ(caster.ntriangles(), 0);
    CHECK(!caster.first_hit({}, {0, 0, 1}).has_value());
    CHECK(!caster.occluded({}, {0, 0, 1}, 0));
    CHECK_EQ(count(cast(caster, {{1, 1, 4}, {}, {0, 1, 0}, 3, 2}, vec3{1, 1, 0}), Truth::background), 6);
}
// A plate above a floor, a light above both: the shadow is the plate seen from the light. Beside a spot light's beam
// all is away, beside what a point light's shadows come from all is lit.
TEST("a light at a place") {
    const RayCaster caster(Mesh{{{{-9, 0, -9}, {0, 0, 9}, {9, 0, -9}}}, {{{-.5, 1, -.5}, {0, 1, 1}, {.5, 1, -.5}}}});
    const View view{{0, 8, .001}, {}, {0, 0, -1}, 60, 60};
    const auto check = [&](LightSource::Kind kind, double degrees, auto&& reached) {
        const TruthImage image = cast(caster, view, {kind, {0, 2, 0}, degrees});
        for (int i = 0; i < 3600; i++) {
            if (image.triangle[i] != 0) continue;
            const vec3 d = view.direction(i % 60, i / 60), p = view.eye - d * (view.eye.y / d.y);
            const vec3 q = p * .5;  // where the way to the light goes through the plate's plane
            const bool shadowed = q.z > -.5 && q.z < 1 - 3 * std::fabs(q.x);
            const Truth outside = kind == LightSource::point ? Truth::lit : Truth::away;
            CHECK(image.pixel[i] == (!reached(p) ? outside : shadowed ? Truth::shadowed : Truth::lit));
        }
    };
    const auto square = [](const vec3& p) { return std::max(std::fabs(p.x), std::fabs(p.z)) < 2; };
    check(LightSource::square_spot, 45, square);
    check(LightSource::point, 45, square);
    check(LightSource::round_spot, 45, [](const vec3& p) { return p.x * p.x + p.z * p.z < 4; });
    check(LightSource::point, 89, [](const vec3&) { return true; });
}

TEST("meaningless input is refused") {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    CHECK_THROWS(RayCaster(Mesh{{{{0, 0, nan}, {1, 0, 0}, {0, 1, 0}}}}), "coordinate");
    CHECK_THROWS(RayCaster(Mesh{{{{0, 0, 2e40}, {1, 0, 0}, {0, 1, 0}}}}), "coordinate");
    const RayCaster caster(box({-1, -1, -1}, {1, 1, 1}));
    CHECK_THROWS(caster.first_hit({}, {}), "direction");
    CHECK_THROWS(caster.first_hit({}, {nan, 1, 0}), "direction");
    CHECK_THROWS(cast(caster, {{1, 2, 3}, {1, 2, 3}, {0, 1, 0}, 4, 4}, vec3{1, 1, 0}, 2), "view");
    CHECK_THROWS(cast(caster, {{1, 2, nan}, {}, {0, 1, 0}, 4, 4}, vec3{1, 1, 0}, 2), "view");
    CHECK_THROWS(cast(caster, {{1, 1, 4}, {}, {0, 1, 0}, 0, 4}, vec3{1, 1, 0}, 2), "pixels");
    CHECK_THROWS(cast(caster, {}, vec3{0, 0, 0}, 2), "light");
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
