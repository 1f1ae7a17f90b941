// geometry.h: small vectors and matrices of fixed size, written the way the mathematics is, and numbers in lanes.
// It knows nothing of pictures, models or cameras. Lesson paragraph: "a bit of linear algebra".
//
// Conventions: vectors are columns, matrices are rows of numbers, M*v transforms v. Every operation is plain IEEE
// arithmetic in the order written here, so results do not depend on the compiler.
#pragma once
#include <cassert>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

// For the small functions that a shader is made of: a call would cost more than what they do.
#define INLINED [[gnu::always_inline]] inline

// ---- lanes: several numbers side by side, as a GPU has them ----
//
// What is written once with these types is done for a few pixels at once, in the processor's vector registers: a coord
// says where something is, in doubles; a real says how bright it is, for which floats are enough; a mask is a yes or
// no. Each lane holds what the number alone would be, bit for bit, so that the count of lanes shows in no picture.

#if !defined(__GNUC__)  // neither gcc nor clang: no vectors that have operators, so one lane
constexpr int lanes = 1;
#elif defined(__AVX__)
constexpr int lanes = 8;
#define ONE_OF_TWO 0, 2, 4, 6, 8, 10, 12, 14
#define EACH_TWICE_LOW 0, 0, 1, 1, 2, 2, 3, 3
#define EACH_TWICE_HIGH 4, 4, 5, 5, 6, 6, 7, 7
#define ALL_OF_BOTH 0, 1, 2, 3, 4, 5, 6, 7
#else
constexpr int lanes = 4;
#define ONE_OF_TWO 0, 2, 4, 6
#define EACH_TWICE_LOW 0, 0, 1, 1
#define EACH_TWICE_HIGH 2, 2, 3, 3
#define ALL_OF_BOTH 0, 1, 2, 3
#endif

template <class T, int n>
struct vector_of {
#if defined(__GNUC__)
    typedef T type __attribute__((vector_size(n * sizeof(T))));
#else
    typedef T type;
#endif
};

// Floats and 32-bit integers fill one register, doubles and 64-bit integers two.
template <class T>
struct pack {
    static constexpr int parts = lanes > 1 ? static_cast<int>(sizeof(T)) / 4 : 1;
    using part = typename vector_of<T, lanes / parts>::type;
    part p[parts];

    pack() = default;
    INLINED pack(double s) { for (part& each : p) each = static_cast<T>(s) - part{}; }
    INLINED explicit pack(const T (&values)[lanes]) { *this = load(values); }
    INLINED static pack load(const T* from) {
        pack out;
        std::memcpy(out.p, from, sizeof out.p);
        return out;
    }
    INLINED void store(T* to) const { std::memcpy(to, p, sizeof p); }
    INLINED T operator[](int i) const {
        T values[lanes];
        store(values);
        return values[i];
    }

#define LANEWISE(op)                                                       \
    INLINED friend pack operator op(const pack& a, const pack& b) {        \
        pack out;                                                          \
        for (int i = 0; i < parts; i++) out.p[i] = a.p[i] op b.p[i];       \
        return out;                                                        \
    }
    LANEWISE(+) LANEWISE(-) LANEWISE(*) LANEWISE(/)
#undef LANEWISE
    INLINED friend pack operator-(const pack& a) { return pack(-0.) - a; }
    INLINED friend pack min(const pack& a, const pack& b) {  // as std::min, also of a NaN
        pack out;
        for (int i = 0; i < parts; i++) out.p[i] = b.p[i] < a.p[i] ? b.p[i] : a.p[i];
        return out;
    }
    INLINED friend pack max(const pack& a, const pack& b) {
        pack out;
        for (int i = 0; i < parts; i++) out.p[i] = a.p[i] < b.p[i] ? b.p[i] : a.p[i];
        return out;
    }
};

using real = pack<float>;
using coord = pack<double>;

struct mask {
    pack<std::int32_t>::part m;  // 0 is no
    mask() = default;
    INLINED mask(bool b) : m((b ? -1 : 0) - pack<std::int32_t>::part{}) {}
    INLINED explicit mask(const pack<std::int32_t>& a) : m(a.p[0] != 0) {}
    INLINED explicit mask(const pack<std::int64_t>& a) {
#if defined(__GNUC__)
        using halves = pack<std::int32_t>::part;
        m = __builtin_shufflevector((halves)a.p[0], (halves)a.p[1], ONE_OF_TWO);
#else
        m = a.p[0] != 0;
#endif
    }
    INLINED bool operator[](int i) const {
        std::int32_t values[lanes];
        std::memcpy(values, &m, sizeof m);
        return values[i] != 0;
    }
    INLINED friend mask operator!(const mask& a) { return mask(a.m == 0, 0); }
    INLINED friend mask operator&(const mask& a, const mask& b) { return mask(a.m & b.m, 0); }
    INLINED friend mask operator|(const mask& a, const mask& b) { return mask(a.m | b.m, 0); }

private:
    INLINED mask(const pack<std::int32_t>::part& a, int) : m(a) {}
};

INLINED bool any(const mask& a) {
    std::int64_t values[lanes / 2 + lanes % 2] = {}, all = 0;
    std::memcpy(values, &a.m, sizeof a.m);
    for (const std::int64_t v : values) all |= v;
    return all != 0;
}

#define COMPARING(T, integer, op)                                                    \
    INLINED mask operator op(const pack<T>& a, const pack<T>& b) {                   \
        pack<integer> out;                                                           \
        for (int i = 0; i < pack<T>::parts; i++) out.p[i] = a.p[i] op b.p[i];        \
        return mask(out);                                                            \
    }
COMPARING(float, std::int32_t, <) COMPARING(float, std::int32_t, >) COMPARING(float, std::int32_t, ==)
COMPARING(std::int32_t, std::int32_t, <) COMPARING(std::int32_t, std::int32_t, >)
COMPARING(double, std::int64_t, <) COMPARING(double, std::int64_t, >) COMPARING(double, std::int64_t, ==)
#undef COMPARING

// a where the mask says yes, b elsewhere. Numbers alone are taken for reals.
INLINED real select(const mask& m, const real& a, const real& b) {
    real out;
    out.p[0] = m.m ? a.p[0] : b.p[0];
    return out;
}
template <class T>
    requires(sizeof(T) == 4)
INLINED pack<T> select(const mask& m, const pack<T>& a, const pack<T>& b) {
    pack<T> out;
    out.p[0] = m.m ? a.p[0] : b.p[0];
    return out;
}
INLINED coord select(const mask& m, const std::same_as<coord> auto& a, const coord& b) {
    coord out;
#if defined(__GNUC__)
    using wide = pack<std::int64_t>::part;
    out.p[0] = (wide)__builtin_shufflevector(m.m, m.m, EACH_TWICE_LOW) ? a.p[0] : b.p[0];
    out.p[1] = (wide)__builtin_shufflevector(m.m, m.m, EACH_TWICE_HIGH) ? a.p[1] : b.p[1];
#else
    out.p[0] = m.m ? a.p[0] : b.p[0];
#endif
    return out;
}

// In each lane what static_cast gives: the nearest float, the same number in double, or the integer towards zero.
#if defined(__GNUC__)
template <class To>
INLINED pack<To> narrowed(const coord& a) {
    using half = typename vector_of<To, lanes / 2>::type;
    const half low = __builtin_convertvector(a.p[0], half), high = __builtin_convertvector(a.p[1], half);
    pack<To> out;
    out.p[0] = __builtin_shufflevector(low, high, ALL_OF_BOTH);
    return out;
}
template <class T>
    requires(sizeof(T) == 4)
INLINED coord to_coord(const pack<T>& a) {
    typename vector_of<T, lanes / 2>::type halves[2];
    std::memcpy(halves, a.p, sizeof halves);
    coord out;
    for (int i = 0; i < 2; i++) out.p[i] = __builtin_convertvector(halves[i], coord::part);
    return out;
}
INLINED pack<std::int32_t> to_int(const real& a) {
    pack<std::int32_t> out;
    out.p[0] = __builtin_convertvector(a.p[0], pack<std::int32_t>::part);
    return out;
}
INLINED real to_real(const pack<std::int32_t>& a) {
    real out;
    out.p[0] = __builtin_convertvector(a.p[0], real::part);
    return out;
}
#else
template <class To>
INLINED pack<To> narrowed(const coord& a) { return static_cast<To>(a.p[0]); }
template <class T>
INLINED coord to_coord(const pack<T>& a) { return a.p[0]; }
INLINED pack<std::int32_t> to_int(const real& a) { return static_cast<std::int32_t>(a.p[0]); }
INLINED real to_real(const pack<std::int32_t>& a) { return static_cast<float>(a.p[0]); }
#endif
INLINED real to_real(const coord& a) { return narrowed<float>(a); }
INLINED pack<std::int32_t> to_int(const coord& a) { return narrowed<std::int32_t>(a); }

// f(number) in each lane.
template <class T, class F>
INLINED pack<T> each(const pack<T>& a, F&& f) {
    T values[lanes];
    a.store(values);
    for (T& v : values) v = f(v);
    return pack<T>(values);
}
INLINED real sqrt(const real& a) { return each(a, [](float v) { return std::sqrt(v); }); }
INLINED coord floor(const coord& a) { return each(a, [](double v) { return std::floor(v); }); }
INLINED coord abs(const coord& a) { return each(a, [](double v) { return std::fabs(v); }); }

// ---- vectors: any size and scalar; two, three and four components also have names ----

template <int n, typename T = double>
struct vec {
    T data[n] = {};
    constexpr T& operator[](int i) { assert(i >= 0 && i < n); return data[i]; }
    constexpr const T& operator[](int i) const { assert(i >= 0 && i < n); return data[i]; }
};

template <typename T>
struct vec<2, T> {
    T x{}, y{};
    constexpr T& operator[](int i) { assert(i >= 0 && i < 2); return i ? y : x; }
    constexpr const T& operator[](int i) const { assert(i >= 0 && i < 2); return i ? y : x; }
};

template <typename T>
struct vec<3, T> {
    T x{}, y{}, z{};
    constexpr T& operator[](int i) { assert(i >= 0 && i < 3); return i ? (i == 1 ? y : z) : x; }
    constexpr const T& operator[](int i) const { assert(i >= 0 && i < 3); return i ? (i == 1 ? y : z) : x; }
};

template <typename T>
struct vec<4, T> {
    T x{}, y{}, z{}, w{};
    constexpr T& operator[](int i) { assert(i >= 0 && i < 4); return i < 2 ? (i ? y : x) : (i == 2 ? z : w); }
    constexpr const T& operator[](int i) const {
        assert(i >= 0 && i < 4);
        return i < 2 ? (i ? y : x) : (i == 2 ? z : w);
    }
    constexpr vec<3, T> xyz() const { return {x, y, z}; }
};

using vec2 = vec<2>;
using vec3 = vec<3>;
using vec4 = vec<4>;

// Component by component. A vector of lanes times a plain one gives lanes.
template <int n, typename T, typename F>
INLINED constexpr auto componentwise(F&& f) {
    vec<n, T> out;
    for (int i = 0; i < n; i++) out[i] = f(i);
    return out;
}
template <int n, typename T, typename S>
INLINED constexpr auto operator+(const vec<n, T>& a, const vec<n, S>& b) {
    return componentwise<n, decltype(a[0] + b[0])>([&](int i) { return a[i] + b[i]; });
}
template <int n, typename T, typename S>
INLINED constexpr auto operator-(const vec<n, T>& a, const vec<n, S>& b) {
    return componentwise<n, decltype(a[0] - b[0])>([&](int i) { return a[i] - b[i]; });
}
template <int n, typename T>
INLINED constexpr vec<n, T> operator-(const vec<n, T>& a) {
    return componentwise<n, T>([&](int i) { return -a[i]; });
}
template <int n, typename T>
INLINED constexpr vec<n, T> operator*(const vec<n, T>& a, const std::type_identity_t<T>& s) {
    return componentwise<n, T>([&](int i) { return a[i] * s; });
}
template <int n, typename T>
INLINED constexpr vec<n, T> operator*(const std::type_identity_t<T>& s, const vec<n, T>& a) {
    return a * s;
}
template <int n, typename T>
INLINED constexpr vec<n, T> operator/(const vec<n, T>& a, const std::type_identity_t<T>& s) {
    return componentwise<n, T>([&](int i) { return a[i] / s; });
}

template <int n, typename T>
constexpr bool operator==(const vec<n, T>& a, const vec<n, T>& b) {
    for (int i = 0; i < n; i++)
        if (a[i] != b[i]) return false;
    return true;
}

template <int n, typename T, typename S>
INLINED constexpr auto dot(const vec<n, T>& a, const vec<n, S>& b) {
    auto sum = a[0] * b[0];
    for (int i = 1; i < n; i++) sum = sum + a[i] * b[i];
    return sum;
}

// Right-handed: x cross y = z.
template <typename T, typename S>
INLINED constexpr auto cross(const vec<3, T>& a, const vec<3, S>& b) {
    return vec<3, decltype(a.x * b.y)>{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Euclidean length. The vector is first scaled by a power of two (exactly), so neither 1e-200 nor 1e200 is lost.
template <int n, typename T>
T norm(const vec<n, T>& v) {
    const T squared = dot(v, v);
    if (squared > T(1e-30) && squared < T(1e30)) return std::sqrt(squared);  // the usual case needs no scaling
    T largest = 0;
    for (int i = 0; i < n; i++) largest = std::fmax(largest, std::fabs(v[i]));
    if (!(largest > 0) || !std::isfinite(largest)) return std::sqrt(squared);
    const int e = std::ilogb(largest);
    vec<n, T> scaled = v;
    for (int i = 0; i < n; i++) scaled[i] = std::scalbn(v[i], -e);
    return std::scalbn(std::sqrt(dot(scaled, scaled)), e);
}

// The unit vector along v; the zero vector stays zero, since it has no direction.
template <int n, typename T>
vec<n, T> normalized(const vec<n, T>& v) {
    const T squared = dot(v, v);
    if (squared > T(1e-30) && squared < T(1e30)) return v / std::sqrt(squared);
    T largest = 0;
    for (int i = 0; i < n; i++) largest = std::fmax(largest, std::fabs(v[i]));
    if (!(largest > 0) || !std::isfinite(largest)) return v;
    vec<n, T> scaled = v;
    for (int i = 0; i < n; i++) scaled[i] = std::scalbn(v[i], -std::ilogb(largest));
    return scaled / std::sqrt(dot(scaled, scaled));
}
template <int n>
INLINED vec<n, real> normalized(const vec<n, real>& v) {
    const real squared = dot(v, v);
    vec<n, real> unit = v / sqrt(squared);
    if (any(!(squared > 1e-30) | !(squared < 1e30))) {  // rare: each lane by itself
        float lane[n][lanes];
        for (int l = 0; l < lanes; l++) {
            vec<n, float> one;
            for (int i = 0; i < n; i++) one[i] = v[i][l];
            one = normalized(one);
            for (int i = 0; i < n; i++) lane[i][l] = one[i];
        }
        for (int i = 0; i < n; i++) unit[i] = real(lane[i]);
    }
    return unit;
}
template <int n>
INLINED vec<n, real> to_real(const vec<n, coord>& v) {
    return componentwise<n, real>([&](int i) { return to_real(v[i]); });
}

// Homogeneous coordinates. A point moves with a translation, a direction does not: they are embedded by two different
// functions, because the wrong one compiles just as well and leaks the projection into every normal.
template <int n, typename T>
INLINED constexpr vec<n + 1, T> point(const vec<n, T>& v) {
    vec<n + 1, T> h;
    for (int i = 0; i < n; i++) h[i] = v[i];
    h[n] = 1;
    return h;
}

template <int n, typename T>
INLINED constexpr vec<n + 1, T> direction(const vec<n, T>& v) {
    vec<n + 1, T> h;
    for (int i = 0; i < n; i++) h[i] = v[i];
    h[n] = 0;
    return h;
}

// From homogeneous back to Cartesian coordinates: the perspective division. The caller sees to it that w is not zero.
template <typename T>
INLINED constexpr vec<3, T> project(const vec<4, T>& h) {
    return {h.x / h.w, h.y / h.w, h.z / h.w};
}

// ---- matrices ----

template <int nrows, int ncols, typename T = double>
struct mat {
    vec<ncols, T> rows[nrows] = {};

    constexpr vec<ncols, T>& operator[](int i) { assert(i >= 0 && i < nrows); return rows[i]; }
    constexpr const vec<ncols, T>& operator[](int i) const { assert(i >= 0 && i < nrows); return rows[i]; }

    constexpr vec<nrows, T> col(int j) const {
        vec<nrows, T> c;
        for (int i = 0; i < nrows; i++) c[i] = rows[i][j];
        return c;
    }
    static constexpr mat identity() requires(nrows == ncols) {
        mat m;
        for (int i = 0; i < nrows; i++) m[i][i] = 1;
        return m;
    }
};

using mat3 = mat<3, 3>;
using mat4 = mat<4, 4>;

template <int r, int c, typename T, typename S>
INLINED constexpr vec<r, S> operator*(const mat<r, c, T>& m, const vec<c, S>& v) {
    return componentwise<r, S>([&](int i) { return dot(m[i], v); });
}

template <int r, int k, int c, typename T>
constexpr mat<r, c, T> operator*(const mat<r, k, T>& a, const mat<k, c, T>& b) {
    mat<r, c, T> out;
    for (int i = 0; i < r; i++)
        for (int j = 0; j < c; j++) out[i][j] = dot(a[i], b.col(j));
    return out;
}

template <int r, int c, typename T>
constexpr bool operator==(const mat<r, c, T>& a, const mat<r, c, T>& b) {
    for (int i = 0; i < r; i++)
        if (!(a[i] == b[i])) return false;
    return true;
}

template <int r, int c, typename T>
constexpr mat<c, r, T> transpose(const mat<r, c, T>& m) {
    mat<c, r, T> out;
    for (int i = 0; i < r; i++)
        for (int j = 0; j < c; j++) out[j][i] = m[i][j];
    return out;
}

// The inverse, or nothing where the matrix is singular to working precision (or holds a NaN or an infinity).
// Gauss-Jordan elimination with full pivoting, after rows and columns have been scaled by powers of two (exactly) to a
// largest element in [1,2): so the verdict does not depend on units. The largest pivot left is then compared with the
// rounding that n steps can leave in a matrix of elements below 2: 2n units of the last place.
template <int n, typename T>
std::optional<mat<n, n, T>> invert(mat<n, n, T> a) {
    int row_exponent[n], col_exponent[n];
    const auto largest_exponent = [](const vec<n, T>& v) -> std::optional<int> {
        T largest = 0;
        for (int i = 0; i < n; i++) {
            if (!std::isfinite(v[i])) return {};
            largest = std::fmax(largest, std::fabs(v[i]));
        }
        if (!(largest > 0)) return {};
        return std::ilogb(largest);
    };
    for (int i = 0; i < n; i++) {
        const auto e = largest_exponent(a[i]);
        if (!e) return {};
        row_exponent[i] = *e;
        for (int j = 0; j < n; j++) a[i][j] = std::scalbn(a[i][j], -*e);
    }
    for (int j = 0; j < n; j++) {
        const auto e = largest_exponent(a.col(j));
        if (!e) return {};
        col_exponent[j] = *e;
        for (int i = 0; i < n; i++) a[i][j] = std::scalbn(a[i][j], -*e);
    }

    auto inv = mat<n, n, T>::identity();
    int order[n];  // order[k]: the column that was eliminated with row k
    bool used[n] = {};
    for (int k = 0; k < n; k++) {
        int pr = k, pc = 0;
        T best = -1;
        for (int i = k; i < n; i++)
            for (int j = 0; j < n; j++)
                if (!used[j] && std::fabs(a[i][j]) > best) best = std::fabs(a[i][j]), pr = i, pc = j;
        if (!(best > 2 * n * std::numeric_limits<T>::epsilon())) return {};
        std::swap(a[k], a[pr]);
        std::swap(inv[k], inv[pr]);
        used[pc] = true;
        order[k] = pc;
        const T pivot = a[k][pc];
        a[k] = a[k] / pivot;
        inv[k] = inv[k] / pivot;
        for (int i = 0; i < n; i++) {
            if (i == k) continue;
            const T factor = a[i][pc];
            a[i] = a[i] - a[k] * factor;
            inv[i] = inv[i] - inv[k] * factor;
        }
    }

    mat<n, n, T> out;
    for (int k = 0; k < n; k++)
        for (int j = 0; j < n; j++)
            out[order[k]][j] = std::scalbn(inv[k][j], -col_exponent[order[k]] - row_exponent[j]);
    return out;
}

// What M does to directions: M without its translation.
template <typename T>
constexpr mat<4, 4, T> linear_part(mat<4, 4, T> m) {
    for (int i = 0; i < 3; i++) m[i][3] = 0;
    return m;
}

// What carries normals where M carries points: the inverse, transposed.
template <int n, typename T>
std::optional<mat<n, n, T>> invert_transpose(const mat<n, n, T>& m) {
    const auto inverse = invert(m);
    if (!inverse) return {};
    return transpose(*inverse);
}
