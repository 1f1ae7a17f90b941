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
// A real is one number for each of a few pixels, a mask one truth value for each. What is written once is done for all of
// them, in the processor's vector registers; each lane holds what the number alone would be, bit for bit, so the number
// of lanes shows in no picture. A real is made of parts as large as a register.

#if defined(__AVX__)
constexpr int lanes = 8, register_bytes = 32;
#else
constexpr int lanes = 4, register_bytes = 16;
#endif

#if defined(__GNUC__)  // gcc and clang know operators of whole registers
template <class T>
struct part_of {
    typedef T type __attribute__((vector_size(register_bytes)));
};
#else
template <class T>
struct part_of {
    typedef T type;
};
#endif

template <class T>
struct pack {
    using part = typename part_of<T>::type;
    static constexpr int parts = lanes * static_cast<int>(sizeof(T)) / static_cast<int>(sizeof(part));
    part p[parts];

    pack() = default;
    INLINED pack(T s) { for (part& each : p) each = s - part{}; }
    INLINED explicit pack(const T (&values)[lanes]) { std::memcpy(p, values, sizeof p); }
    INLINED void store(T (&values)[lanes]) const { std::memcpy(values, p, sizeof p); }
    INLINED T operator[](int i) const {
        T values[lanes];
        store(values);
        return values[i];
    }
};

using real = pack<double>;

struct mask {
    pack<std::int64_t> m;  // 0 is false
    mask() = default;
    INLINED mask(bool b) : m(b ? -1 : 0) {}
    INLINED bool operator[](int i) const { return m[i] != 0; }
};

#define UMBRA_LANEWISE(result, op, type, a, b)                                     \
    INLINED result operator op(const type& a_, const type& b_) {                   \
        result out;                                                                \
        for (int i = 0; i < real::parts; i++) out.a[i] = a_.b[i] op b_.b[i];       \
        return out;                                                                \
    }
UMBRA_LANEWISE(real, +, real, p, p)
UMBRA_LANEWISE(real, -, real, p, p)
UMBRA_LANEWISE(real, *, real, p, p)
UMBRA_LANEWISE(real, /, real, p, p)
UMBRA_LANEWISE(mask, <, real, m.p, p)
UMBRA_LANEWISE(mask, >, real, m.p, p)
UMBRA_LANEWISE(mask, ==, real, m.p, p)
UMBRA_LANEWISE(mask, &, mask, m.p, m.p)
UMBRA_LANEWISE(mask, |, mask, m.p, m.p)
#undef UMBRA_LANEWISE
INLINED real operator-(const real& a) { return real(-0.) - a; }
INLINED mask operator!(const mask& a) {
    mask out;
    for (int i = 0; i < real::parts; i++) out.m.p[i] = a.m.p[i] == 0;
    return out;
}
INLINED real& operator+=(real& a, const real& b) { return a = a + b; }
INLINED real& operator*=(real& a, const real& b) { return a = a * b; }

// a where the mask is true, b elsewhere.
INLINED real select(const mask& m, const real& a, const real& b) {
    real out;
    for (int i = 0; i < real::parts; i++) out.p[i] = m.m.p[i] ? a.p[i] : b.p[i];
    return out;
}
INLINED bool any(const mask& m) {
    pack<std::int64_t>::part sum = m.m.p[0];
    for (int i = 1; i < real::parts; i++) sum |= m.m.p[i];
    std::int64_t lane[sizeof sum / 8], all = 0;
    std::memcpy(lane, &sum, sizeof sum);
    for (const std::int64_t each : lane) all |= each;
    return all != 0;
}
INLINED real min(const real& a, const real& b) { return select(b < a, b, a); }  // as std::min, also of a NaN
INLINED real max(const real& a, const real& b) { return select(a < b, b, a); }

// f(number) in each lane.
template <class F>
INLINED real each(const real& a, F&& f) {
    double values[lanes];
    a.store(values);
    for (double& v : values) v = f(v);
    return real(values);
}
INLINED real sqrt(const real& a) { return each(a, [](double v) { return std::sqrt(v); }); }
INLINED real floor(const real& a) { return each(a, [](double v) { return std::floor(v); }); }
INLINED real abs(const real& a) { return each(a, [](double v) { return std::fabs(v); }); }

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
    constexpr const T& operator[](int i) const { assert(i >= 0 && i < 4); return i < 2 ? (i ? y : x) : (i == 2 ? z : w); }
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
    if (any(!(squared > 1e-30) | !(squared < 1e30))) {
        double lane[n][lanes];
        for (int l = 0; l < lanes; l++) {
            vec<n> one;
            for (int i = 0; i < n; i++) one[i] = v[i][l];
            one = normalized(one);
            for (int i = 0; i < n; i++) lane[i][l] = one[i];
        }
        for (int i = 0; i < n; i++) unit[i] = real(lane[i]);
    }
    return unit;
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
