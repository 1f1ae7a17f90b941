// geometry_test.cpp: vectors and matrices, by example and by property on random matrices.
#include "check.h"
#include "geometry.h"

#include <algorithm>
#include <random>

template <int n>
static mat<n, n> random_matrix(std::mt19937& rng) {
    mat<n, n> m;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) m[i][j] = static_cast<double>(rng()) / 2147483648. - 1;
    return m;
}

template <int n>
static double largest_difference(const mat<n, n>& a, const mat<n, n>& b) {
    double d = 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) d = std::fmax(d, std::fabs(a[i][j] - b[i][j]));
    return d;
}

template <int n>
static double largest_element(const mat<n, n>& a) {
    return largest_difference(a, mat<n, n>{});
}

// Everything that is free of square roots works at compile time.
static_assert(vec3{1, 2, 3} + vec3{1, 1, 1} == vec3{2, 3, 4});
static_assert(2 * vec2{1, 2} - vec2{1, 1} == vec2{1, 3});
static_assert(dot(vec3{1, 2, 3}, vec3{4, 5, 6}) == 32);
static_assert(cross(vec3{1, 0, 0}, vec3{0, 1, 0}) == vec3{0, 0, 1});
static_assert(mat<2, 3>{{{1, 2, 3}, {4, 5, 6}}} * vec3{1, 0, -1} == vec2{-2, -2});
static_assert(transpose(mat<2, 3>{{{1, 2, 3}, {4, 5, 6}}}) == mat<3, 2>{{{1, 4}, {2, 5}, {3, 6}}});
static_assert(vec<5>{{1, 2, 3, 4, 5}}[4] == 5);
static_assert(sizeof(vec3) == 24 && sizeof(mat<4, 4, float>) == 64);

TEST("a point moves with a translation, a direction does not") {
    const mat4 move{{{1, 0, 0, 5}, {0, 1, 0, 6}, {0, 0, 1, 7}, {0, 0, 0, 1}}};
    CHECK((move * point(vec3{1, 2, 3})).xyz() == (vec3{6, 8, 10}));
    CHECK((move * direction(vec3{1, 2, 3})).xyz() == (vec3{1, 2, 3}));
    CHECK(project(vec4{2, 4, 6, 2}) == (vec3{1, 2, 3}));
}

TEST("lengths keep their precision from 1e-300 to 1e300") {
    for (const double s : {1e-300, 1e-160, 1e-10, 1., 1e10, 1e160, 1e300}) {
        CHECK_NEAR(norm(vec3{3 * s, 0, 4 * s}) / s, 5, 1e-14);
        CHECK_NEAR(norm(normalized(vec3{3 * s, 0, 4 * s})), 1, 1e-15);
    }
    CHECK_NEAR(norm(vec<2, float>{3e-30F, 4e-30F}) / 1e-30F, 5, 1e-6);
    CHECK(norm(vec3{}) == 0);
    CHECK(normalized(vec3{}) == vec3{});
}

TEST("a product with the inverse is the identity") {
    std::mt19937 rng(1);
    for (int k = 0; k < 20000; k++) {
        const auto m = random_matrix<4>(rng);
        const auto inverse = invert(m);
        if (!CHECK(inverse.has_value())) continue;
        constexpr double epsilon = std::numeric_limits<double>::epsilon();
        // The residual of an inverse is bounded by a few roundings of |M| |M^-1|.
        const double bound = 64 * epsilon * largest_element(m) * largest_element(*inverse);
        CHECK_NEAR(largest_difference(m * *inverse, mat4::identity()), 0, bound);
        CHECK_NEAR(largest_difference(*inverse * m, mat4::identity()), 0, bound);
        CHECK(*invert_transpose(m) == transpose(*inverse));
    }
}

TEST("a singular matrix is reported, whatever its units") {
    CHECK(!invert(mat3{}).has_value());
    CHECK(!invert(mat3{{{1, 2, 3}, {2, 4, 6}, {1, 0, 1}}}).has_value());
    CHECK(!invert(mat3{{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}}).has_value());
    CHECK(!invert(mat3{{{1, 0, 0}, {0, NAN, 0}, {0, 0, 1}}}).has_value());
    CHECK(!invert(mat3{{{1, 0, 0}, {0, INFINITY, 0}, {0, 0, 1}}}).has_value());
    std::mt19937 rng(3);
    for (int k = 0; k < 2000; k++) {  // random matrices of rank 3: the last row is a combination of the others
        auto m = random_matrix<4>(rng);
        m[3] = m[0] * .25 + m[1] * .5 - m[2];
        CHECK(!invert(m).has_value());
    }
    // Not singular, only in awkward units.
    const auto a = invert(mat3{{{1e-200, 0, 0}, {0, 1, 0}, {0, 0, 1e200}}});
    if (CHECK(a.has_value())) CHECK(*a == (mat3{{{1 / 1e-200, 0, 0}, {0, 1, 0}, {0, 0, 1 / 1e200}}}));
    // Nearly singular, and the inverse is still good to what its condition allows.
    const auto b = invert(mat<2, 2>{{{1, 1}, {1, 1 + 1e-12}}});
    if (CHECK(b.has_value())) CHECK_NEAR((*b)[1][1] * 1e-12, 1, 1e-3);
}

TEST("normals stay perpendicular under the inverse transpose") {
    std::mt19937 rng(4);
    for (int k = 0; k < 5000; k++) {
        const auto m = random_matrix<3>(rng);
        const auto carries = invert_transpose(m);
        if (!carries || largest_element(*carries) > 100) continue;
        const vec3 t = random_matrix<3>(rng)[0], u = random_matrix<3>(rng)[1], n = cross(t, u);
        CHECK_NEAR(dot(*carries * n, m * t), 0, 1e-10);
    }
}

// Every lane of every operation is what the number alone would give, to the bit.
template <class T>
static void compare_lanes(std::mt19937& rng) {
    constexpr T inf = std::numeric_limits<T>::infinity(), nan = std::numeric_limits<T>::quiet_NaN();
    constexpr T least = std::numeric_limits<T>::denorm_min();
    const T special[] = {0,   -T(0), 1,   -1,  T(.5), T(2.5), T(-2.5), T(1e30), T(-1e-30), least,
                         inf, -inf,  nan, 255, T(2e9), T(-2e9)};
    T x[lanes], y[lanes];
    for (T* each : {x, y})
        for (int i = 0; i < lanes; i++)
            each[i] = rng() % 2 ? T(rng()) / T(2147483648.) - 1 : special[rng() % std::size(special)];
    const auto a = pack<T>::load(x), b = pack<T>::load(y);
    bool some = false;
    for (int i = 0; i < lanes; i++) {
        const auto same = [&](const auto& got, auto want) {
            return (got[i] == want && std::signbit(got[i]) == std::signbit(want)) || (got[i] != got[i] && want != want);
        };
        CHECK(same(a + b, x[i] + y[i]) && same(a - b, x[i] - y[i]) && same(a * b, x[i] * y[i]));
        CHECK(same(a / b, x[i] / y[i]) && same(-a, -x[i]));
        CHECK(same(min(a, b), std::min(x[i], y[i])) && same(max(a, b), std::max(x[i], y[i])));
        CHECK((a < b)[i] == (x[i] < y[i]) && (a > b)[i] == (x[i] > y[i]) && (a == b)[i] == (x[i] == y[i]));
        CHECK((!(a < b))[i] == !(x[i] < y[i]) && ((a < b) | (a == b))[i] == (x[i] <= y[i]));
        CHECK(!((a < b) & (a > b))[i] && same(select(a < b, a, b), x[i] < y[i] ? x[i] : y[i]));
        if constexpr (sizeof(T) == 8) {
            CHECK(same(abs(a), std::fabs(x[i])) && same(floor(a), std::floor(x[i])));
            CHECK(same(to_real(a), static_cast<float>(x[i])));
        } else {
            CHECK(same(sqrt(a), std::sqrt(x[i])) && same(to_coord(a), static_cast<double>(x[i])));
        }
        if (std::fabs(x[i]) < 2147483648.) {
            const auto n = static_cast<std::int32_t>(x[i]);
            CHECK(to_int(a)[i] == n && (to_int(a) >> i)[i] == n >> i);
            CHECK((to_int(a) & 12345)[i] == (n & 12345) && (to_int(a) | 12345)[i] == (n | 12345));
        }
        some |= x[i] < y[i];
    }
    CHECK(any(a < b) == some);
}

TEST("lanes compute what numbers do") {
    std::mt19937 rng(5);
    for (int k = 0; k < 20000; k++) {
        compare_lanes<float>(rng);
        compare_lanes<double>(rng);
    }
    for (int i = 0; i < lanes; i++)
        CHECK(real(.3)[i] == .3F && std::signbit(coord(-0.)[i]) && mask(true)[i] && !mask(false)[i]);
}

TEST("vectors of lanes compute what vectors do") {
    std::mt19937 rng(6);
    for (int k = 0; k < 2000; k++) {
        const mat4 m = random_matrix<4>(rng);
        const vec3 u = random_matrix<3>(rng)[0];
        double component[3][lanes];
        for (auto& each : component)
            for (double& v : each)
                v = (static_cast<double>(rng()) / 2147483648. - 1) * (k % 10 || rng() % 2 ? 1 : 1e-20);
        const vec<3, coord> v{coord::load(component[0]), coord::load(component[1]), coord::load(component[2])};
        const auto lane = [](const auto& w, int i) {
            return vec<3, std::decay_t<decltype(w.x[i])>>{w.x[i], w.y[i], w.z[i]};
        };
        for (int i = 0; i < lanes; i++) {
            const vec3 alone = lane(v, i);
            CHECK(lane(normalized(to_real(v)), i) == normalized(lane(to_real(v), i)));
            CHECK(lane(project(m * point(v)), i) == project(m * point(alone)));
            CHECK(lane(cross(u, v), i) == cross(u, alone) && dot(u, v)[i] == dot(u, alone));
            CHECK(lane(v * 2 - u, i) == alone * 2 - u && lane(-v / 3 + u, i) == -alone / 3 + u);
        }
    }
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
