// geometry.h: small vectors and matrices of fixed size, written the way the mathematics is, and numbers in lanes.
// It knows nothing of pictures, models or cameras. Lesson paragraph: "a bit of linear algebra".
//
// Conventions: vectors are columns, matrices are rows of numbers, M*v transforms v. Every operation is plain IEEE
// arithmetic in the order written here, so results do not depend on the compiler.
#pragma once
#include <cassert>
#include <cmath>
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

#if !defined(__GNUC__) || defined(UMBRA_ONE_LANE)  // neither gcc nor clang: no vectors that have operators
constexpr int lanes = 1;
#elif defined(__AVX__)
constexpr int lanes = 8;
#define BOTH_HALVES 0, 1, 2, 3, 4, 5, 6, 7
#else
constexpr int lanes = 4;
#define BOTH_HALVES 0, 1, 2, 3
#endif
#if defined(BOTH_HALVES) && !defined(__AVX512F__)
constexpr int registers_for_doubles = 2;
#else
constexpr int registers_for_doubles = 1;
#endif

template <class T, int n>
struct vector_of {
#if defined(BOTH_HALVES)
    typedef T type __attribute__((vector_size(n * sizeof(T))));
#else
    typedef T type;
#endif
};

// Floats and 32-bit integers fill one register; doubles and 64-bit integers two, or one that is twice as long.
template <class T>
struct pack {
    static constexpr int parts = sizeof(T) == 8 ? registers_for_doubles : 1;
    using part = typename vector_of<T, lanes / parts>::type;
    part p[parts];

    pack() = default;
    template <class S> requires std::is_arithmetic_v<S>
    INLINED pack(S s) { for (part& each : p) each = static_cast<T>(s) - part{}; }
    INLINED static pack load(const T* from) {  // by registers: what is copied in smaller pieces waits in memory
        pack out;
        for (int i = 0; i < parts; i++) std::memcpy(&out.p[i], from + lanes / parts * i, sizeof(part));
        return out;
    }
    INLINED void store(T* to) const {
        for (int i = 0; i < parts; i++) std::memcpy(to + lanes / parts * i, &p[i], sizeof(part));
    }
    INLINED T operator[](int i) const {
        T values[lanes];
        store(values);
        return values[i];
    }

#define LANEWISE(function, result)                                     \
    INLINED friend pack function(const pack& a, const pack& b) {       \
        pack out;                                                      \
        for (int i = 0; i < parts; i++) out.p[i] = result;             \
        return out;                                                    \
    }
    LANEWISE(operator+, a.p[i] + b.p[i])
    LANEWISE(operator-, a.p[i] - b.p[i])
    LANEWISE(operator*, a.p[i] * b.p[i])
    LANEWISE(operator/, a.p[i] / b.p[i])
    LANEWISE(operator&, a.p[i] & b.p[i])
    LANEWISE(operator|, a.p[i] | b.p[i])
    LANEWISE(operator>>, a.p[i] >> b.p[i])
    LANEWISE(min, b.p[i] < a.p[i] ? b.p[i] : a.p[i])  // as std::min, also of a NaN
    LANEWISE(max, a.p[i] < b.p[i] ? b.p[i] : a.p[i])
#undef LANEWISE
    INLINED friend pack operator-(const pack& a) { return pack(-0.) - a; }
};

using real = pack<float>;
using coord = pack<double>;

// In each lane what static_cast gives, between types of four and of eight bytes.
template <class To, class From>
INLINED pack<To> converted(const pack<From>& a) {
    pack<To> out;
#if !defined(BOTH_HALVES)
    out.p[0] = static_cast<To>(a.p[0]);
#else
    if constexpr (pack<To>::parts == pack<From>::parts) {
        for (int i = 0; i < a.parts; i++) out.p[i] = __builtin_convertvector(a.p[i], typename pack<To>::part);
    } else if constexpr (sizeof(To) < sizeof(From)) {
        using half = typename vector_of<To, lanes / 2>::type;
        const half low = __builtin_convertvector(a.p[0], half), high = __builtin_convertvector(a.p[1], half);
        out.p[0] = __builtin_shufflevector(low, high, BOTH_HALVES);
    } else {
        typename vector_of<From, lanes / 2>::type halves[2];
        std::memcpy(halves, a.p, sizeof halves);
        for (int i = 0; i < 2; i++) out.p[i] = __builtin_convertvector(halves[i], typename pack<To>::part);
    }
#endif
    return out;
}
template <class T>
INLINED real to_real(const pack<T>& a) { return converted<float>(a); }
template <class T>
INLINED coord to_coord(const pack<T>& a) { return converted<double>(a); }
template <class T>
INLINED pack<std::int32_t> to_int(const pack<T>& a) { return converted<std::int32_t>(a); }  // towards zero

struct mask {
    pack<std::int32_t> m;  // -1 is yes, 0 no
    mask() = default;
    INLINED mask(bool b) : m(b ? -1 : 0) {}
    INLINED explicit mask(const pack<std::int32_t>& a) : m(a) {}
    INLINED bool operator[](int i) const { return m[i] != 0; }
    INLINED friend mask operator!(const mask& a) { return mask(-1 - a.m); }
    INLINED friend mask operator&(const mask& a, const mask& b) { return mask(a.m & b.m); }
    INLINED friend mask operator|(const mask& a, const mask& b) { return mask(a.m | b.m); }
};

INLINED bool any(const mask& a) {
    std::int64_t values[lanes / 2 + lanes % 2] = {}, all = 0;
    std::memcpy(values, a.m.p, sizeof a.m.p);
    for (const std::int64_t v : values) all |= v;
    return all != 0;
}

#define COMPARING(T, op)                                                                              \
    INLINED mask operator op(const pack<T>& a, const pack<T>& b) {                                    \
        pack<std::conditional_t<sizeof(T) == 8, std::int64_t, std::int32_t>> out = 0;                 \
        for (int i = 0; i < a.parts; i++) out.p[i] = a.p[i] op b.p[i] ? ~out.p[i] : out.p[i];         \
        return mask(to_int(out));                                                                     \
    }
COMPARING(float, <) COMPARING(float, >) COMPARING(float, ==)
COMPARING(double, <) COMPARING(double, >) COMPARING(double, ==)
COMPARING(std::int32_t, <) COMPARING(std::int32_t, >) COMPARING(std::int32_t, ==)
#undef COMPARING

// a where the mask says yes, b elsewhere. Numbers alone are taken for reals.
template <class T>
INLINED pack<T> select(const mask& m, const pack<T>& a, const std::type_identity_t<pack<T>>& b) {
    using integer = std::conditional_t<sizeof(T) == 8, std::int64_t, std::int32_t>;
    const pack<integer> wide = converted<integer>(m.m);
    pack<T> out;
    for (int i = 0; i < a.parts; i++) out.p[i] = wide.p[i] ? a.p[i] : b.p[i];
    return out;
}
INLINED real select(const mask& m, double a, const real& b) { return select(m, real(a), b); }

// look_up(number) in each lane. Not a loop: compilers make gather instructions of loops that read, which take longer.
template <class T, class Index, class F, int... i>
INLINED pack<T> looked_up(const pack<Index>& numbers, F&& look_up, std::integer_sequence<int, i...>) {
    Index at[lanes];
    numbers.store(at);
    const T values[]{look_up(at[i])...};
    return pack<T>::load(values);
}
template <class T, class Index, class F>
INLINED pack<T> looked_up(const pack<Index>& numbers, F&& look_up) {
    return looked_up<T>(numbers, look_up, std::make_integer_sequence<int, lanes>());
}

// f(number) in each lane.
template <class T, class F>
INLINED pack<T> each(const pack<T>& a, F&& f) {
    T values[lanes];
    a.store(values);
    for (T& v : values) v = f(v);
    return pack<T>::load(values);
}
INLINED real sqrt(const real& a) { return each(a, [](float v) { return std::sqrt(v); }); }
INLINED coord sqrt(const coord& a) { return each(a, [](double v) { return std::sqrt(v); }); }
INLINED coord floor(const coord& a) { return each(a, [](double v) { return std::floor(v); }); }
INLINED coord abs(const coord& a) { return each(a, [](double v) { return std::fabs(v); }); }

// ---- vectors: any size and scalar; two, three and four components also have names ----

template <int n, typename T = double>
struct vec {
    T data[n] = {};
    bool operator==(const vec&) const = default;
    constexpr T& operator[](int i) { assert(i >= 0 && i < n); return data[i]; }
    constexpr const T& operator[](int i) const { assert(i >= 0 && i < n); return data[i]; }
};

template <typename T>
struct vec<2, T> {
    T x{}, y{};
    bool operator==(const vec&) const = default;
    constexpr T& operator[](int i) { assert(i >= 0 && i < 2); return i ? y : x; }
    constexpr const T& operator[](int i) const { assert(i >= 0 && i < 2); return i ? y : x; }
};

template <typename T>
struct vec<3, T> {
    T x{}, y{}, z{};
    bool operator==(const vec&) const = default;
    constexpr T& operator[](int i) { assert(i >= 0 && i < 3); return i ? (i == 1 ? y : z) : x; }
    constexpr const T& operator[](int i) const { assert(i >= 0 && i < 3); return i ? (i == 1 ? y : z) : x; }
};

template <typename T>
struct vec<4, T> {
    T x{}, y{}, z{}, w{};
    bool operator==(const vec&) const = default;
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

// The vector times a power of two (which is exact) so that its square neither overflows nor vanishes, and the exponent
// that was taken out. What has no length, or no finite one, stays as it is.
template <int n, typename T>
std::pair<vec<n, T>, int> moderate(vec<n, T> v) {
    const T squared = dot(v, v);
    if (squared > T(1e-30) && squared < T(1e30)) return {v, 0};  // the usual case
    T largest = 0;
    for (int i = 0; i < n; i++) largest = std::fmax(largest, std::fabs(v[i]));
    if (!(largest > 0) || !std::isfinite(largest)) return {v, 0};
    const int e = std::ilogb(largest);
    for (int i = 0; i < n; i++) v[i] = std::scalbn(v[i], -e);
    return {v, e};
}

// Euclidean length: neither 1e-200 nor 1e200 is lost.
template <int n, typename T>
T norm(const vec<n, T>& v) {
    const auto [scaled, e] = moderate(v);
    const T length = std::sqrt(dot(scaled, scaled));
    return e ? std::scalbn(length, e) : length;
}

// The unit vector along v; the zero vector stays zero, since it has no direction.
template <int n, typename T>
vec<n, T> normalized(const vec<n, T>& v) {
    const vec<n, T> scaled = moderate(v).first;
    const T squared = dot(scaled, scaled);
    return squared > 0 && std::isfinite(squared) ? scaled / std::sqrt(squared) : v;
}
template <int n, typename T>
INLINED vec<n, pack<T>> normalized(const vec<n, pack<T>>& v) {
    const pack<T> squared = dot(v, v);
    vec<n, pack<T>> unit = v / sqrt(squared);
    const mask is_usual = (squared > 1e-30) & (squared < 1e30);
    if (any(!is_usual)) {  // rare: each lane by itself
        T lane[n][lanes];
        for (int l = 0; l < lanes; l++) {
            vec<n, T> one;
            for (int i = 0; i < n; i++) one[i] = v[i][l];
            one = normalized(one);
            for (int i = 0; i < n; i++) lane[i][l] = one[i];
        }
        for (int i = 0; i < n; i++) unit[i] = pack<T>::load(lane[i]);
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
    return componentwise<n + 1, T>([&](int i) { return i < n ? v[i] : T(1); });
}
template <int n, typename T>
INLINED constexpr vec<n + 1, T> direction(const vec<n, T>& v) {
    return componentwise<n + 1, T>([&](int i) { return i < n ? v[i] : T(0); });
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
    bool operator==(const mat&) const = default;

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
constexpr mat<c, r, T> transpose(const mat<r, c, T>& m) {
    mat<c, r, T> out;
    for (int i = 0; i < r; i++)
        for (int j = 0; j < c; j++) out[j][i] = m[i][j];
    return out;
}

// The inverse, or nothing where the matrix is singular to working precision (or holds a NaN or an infinity).
// Gauss-Jordan elimination. The verdict is the diagonal of |M^-1| |M|, a condition number that no choice of units for
// rows and columns changes: n steps may round by 2n units of the last place times that.
template <int n, typename T>
std::optional<mat<n, n, T>> invert(const mat<n, n, T>& m) {
    mat<n, n, T> a = m, inverse = mat<n, n, T>::identity();
    for (int k = 0; k < n; k++) {
        int pivot = k;
        for (int i = k + 1; i < n; i++)
            if (std::fabs(a[i][k]) > std::fabs(a[pivot][k])) pivot = i;
        std::swap(a[k], a[pivot]);
        std::swap(inverse[k], inverse[pivot]);
        inverse[k] = inverse[k] / a[k][k];
        a[k] = a[k] / a[k][k];
        for (int i = 0; i < n; i++) {
            if (i == k) continue;
            inverse[i] = inverse[i] - inverse[k] * a[i][k];
            a[i] = a[i] - a[k] * a[i][k];
        }
    }
    for (int i = 0; i < n; i++) {
        T condition = 0;
        for (int k = 0; k < n; k++) condition += std::fabs(inverse[i][k] * m[k][i]);
        if (!(condition * 2 * n * std::numeric_limits<T>::epsilon() < 1)) return {};
    }
    return inverse;
}

// What carries normals where M carries points: the inverse, transposed.
template <int n, typename T>
std::optional<mat<n, n, T>> invert_transpose(const mat<n, n, T>& m) {
    const auto inverse = invert(m);
    if (!inverse) return {};
    return transpose(*inverse);
}
