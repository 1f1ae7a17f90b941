// geometry.h: small vectors and matrices of fixed size, written the way the mathematics is.
// It knows nothing of pictures, models or cameras. Lesson paragraph: "a bit of linear algebra".
//
// Conventions: vectors are columns, matrices are rows of numbers, M*v transforms v. Every operation is plain IEEE
// arithmetic in the order written here, so results do not depend on the compiler.
#pragma once
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

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

template <int n, typename T>
constexpr vec<n, T> operator+(vec<n, T> a, const vec<n, T>& b) {
    for (int i = 0; i < n; i++) a[i] += b[i];
    return a;
}

template <int n, typename T>
constexpr vec<n, T> operator-(vec<n, T> a, const vec<n, T>& b) {
    for (int i = 0; i < n; i++) a[i] -= b[i];
    return a;
}

template <int n, typename T>
constexpr vec<n, T> operator-(vec<n, T> a) {
    for (int i = 0; i < n; i++) a[i] = -a[i];
    return a;
}

template <int n, typename T>
constexpr vec<n, T> operator*(vec<n, T> a, std::type_identity_t<T> s) {
    for (int i = 0; i < n; i++) a[i] *= s;
    return a;
}

template <int n, typename T>
constexpr vec<n, T> operator*(std::type_identity_t<T> s, const vec<n, T>& a) {
    return a * s;
}

template <int n, typename T>
constexpr vec<n, T> operator/(vec<n, T> a, std::type_identity_t<T> s) {
    for (int i = 0; i < n; i++) a[i] /= s;
    return a;
}

template <int n, typename T>
constexpr bool operator==(const vec<n, T>& a, const vec<n, T>& b) {
    for (int i = 0; i < n; i++)
        if (a[i] != b[i]) return false;
    return true;
}

template <int n, typename T>
constexpr T dot(const vec<n, T>& a, const vec<n, T>& b) {
    T sum = a[0] * b[0];
    for (int i = 1; i < n; i++) sum += a[i] * b[i];
    return sum;
}

// Right-handed: x cross y = z.
template <typename T>
constexpr vec<3, T> cross(const vec<3, T>& a, const vec<3, T>& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
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

// Homogeneous coordinates. A point moves with a translation, a direction does not: they are embedded by two different
// functions, because the wrong one compiles just as well and leaks the projection into every normal.
template <int n, typename T>
constexpr vec<n + 1, T> point(const vec<n, T>& v) {
    vec<n + 1, T> h;
    for (int i = 0; i < n; i++) h[i] = v[i];
    h[n] = 1;
    return h;
}

template <int n, typename T>
constexpr vec<n + 1, T> direction(const vec<n, T>& v) {
    vec<n + 1, T> h;
    for (int i = 0; i < n; i++) h[i] = v[i];
    h[n] = 0;
    return h;
}

// From homogeneous back to Cartesian coordinates: the perspective division. The caller sees to it that w is not zero.
template <typename T>
constexpr vec<3, T> project(const vec<4, T>& h) {
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

template <int r, int c, typename T>
constexpr vec<r, T> operator*(const mat<r, c, T>& m, const vec<c, T>& v) {
    vec<r, T> out;
    for (int i = 0; i < r; i++) out[i] = dot(m[i], v);
    return out;
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

// Laplace expansion along the first row: exact enough and short for the sizes that a renderer uses.
template <int n, typename T>
constexpr T determinant(const mat<n, n, T>& m) {
    if constexpr (n == 1) {
        return m[0][0];
    } else {
        T sum = 0;
        for (int j = 0; j < n; j++) {
            mat<n - 1, n - 1, T> minor;
            for (int r = 1; r < n; r++)
                for (int c = 0, k = 0; c < n; c++)
                    if (c != j) minor[r - 1][k++] = m[r][c];
            sum += (j % 2 ? -m[0][j] : m[0][j]) * determinant(minor);
        }
        return sum;
    }
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
