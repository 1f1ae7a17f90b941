// formulas.cpp: interpolation, the circle, noise.
#include "formulas.h"

#include <cstdint>

double smoothstep(double lo, double hi, double x) {
    const double t = clamp01((x - lo) / (hi - lo));
    return t * t * (3 - 2 * t);
}

// sin(2 pi t) by its Taylor series on a quarter of a turn: the error is below 6e-8, the first term left out. The
// library's own sine may be rounded differently by a compiler that evaluates it beforehand.
double sin_turns(double t) {
    t -= std::floor(t);
    if (t > .5) return -sin_turns(t - .5);
    if (t > .25) t = .5 - t;
    const double x = 6.283185307179586 * t, y = x * x;
    return x * (1 - y / 6 * (1 - y / 20 * (1 - y / 42 * (1 - y / 72 * (1 - y / 110)))));
}
double cos_turns(double t) { return sin_turns(t + .25); }

// By the polynomial for the arc tangent on [0,1] of Abramowitz and Stegun, "Handbook of Mathematical Functions",
// 4.4.49: the error is below 2e-8 radians.
double atan_turns(double y, double x) {
    const double ax = std::fabs(x), ay = std::fabs(y), largest = std::max(ax, ay);
    if (!(largest > 0)) return 0;
    const double q = std::min(ax, ay) / largest;
    double sum = 0;
    for (const double c :
         {-.0040540580, .0218612288, -.0559098861, .0964200441, -.1390853351, .1994653599, -.3332985605, .9999993329})
        sum = sum * q * q + c;
    double a = sum * q * .15915494309189535;
    if (ay > ax) a = .25 - a;
    if (x < 0) a = .5 - a;
    return y < 0 ? -a : a;
}

// Well mixed bits for every lattice point (the finalizer of MurmurHash3).
static std::uint32_t hash(int x, int y, int z) {
    std::uint32_t h = x * 0x8da6b343u ^ y * 0xd8163841u ^ z * 0xcb1ab31fu;
    h ^= h >> 16, h *= 0x85ebca6bu, h ^= h >> 13, h *= 0xc2b2ae35u;
    return h ^ h >> 16;
}
double hash01(int x, int y, int z) { return hash(x, y, z) * (1 / 4294967296.); }

// Gradient noise (Perlin, "Improving noise", 2002).
double noise(const vec3& p) {
    const double fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
    const int x = static_cast<int>(fx), y = static_cast<int>(fy), z = static_cast<int>(fz);
    const auto fade = [](double t) { return t * t * t * (t * (t * 6 - 15) + 10); };
    const auto slope = [&](int i, int j, int k) {  // towards one of the twelve edges of a cube
        const std::uint32_t h = hash(x + i, y + j, z + k) & 15;
        const double a = p.x - fx - i, b = p.y - fy - j, c = p.z - fz - k;
        const double u = h < 8 ? a : b, v = h < 4 ? b : h == 12 || h == 14 ? a : c;
        return (h & 1 ? -u : u) + (h & 2 ? -v : v);
    };
    const double u = fade(p.x - fx), v = fade(p.y - fy), w = fade(p.z - fz);
    const auto row = [&](int j, int k) { return mix(slope(0, j, k), slope(1, j, k), u); };
    return 1.2 * mix(mix(row(0, 0), row(1, 0), v), mix(row(0, 1), row(1, 1), v), w);
}

double fbm(vec3 p, int octaves) {
    double sum = 0, amplitude = .5;
    for (int i = 0; i < octaves; i++, amplitude *= .5) {
        sum += amplitude * noise(p);
        p = vec3{p.y * 1.62 + p.z * 1.17, p.z * 1.62 - p.x * 1.17, p.x * 1.62 - p.y * 1.17} + vec3{7.3, 3.1, 5.7};
    }
    return sum;
}

double cell_wall(const vec3& p) {
    const vec3 base{std::floor(p.x), std::floor(p.y), std::floor(p.z)};
    double d1 = 9, d2 = 9;
    for (int i = -1; i <= 1; i++)
        for (int j = -1; j <= 1; j++)
            for (int k = -1; k <= 1; k++) {
                const vec3 c = base + vec3{1. * i, 1. * j, 1. * k};
                const int x = static_cast<int>(c.x), y = static_cast<int>(c.y), z = static_cast<int>(c.z);
                const vec3 q = p - c - vec3{hash01(x, y, z), hash01(y, z + 71, x), hash01(z, x + 37, y)};
                const double d = dot(q, q);
                if (d < d1) d2 = d1, d1 = d;
                else if (d < d2) d2 = d;
            }
    return (std::sqrt(d2) - std::sqrt(d1)) * .5;
}

double rounded(double x, double steps) { return std::floor(x * steps + .5) / steps + 0.; }  // + 0. turns -0 into 0
vec3 rounded(const vec3& v, double steps) { return {rounded(v.x, steps), rounded(v.y, steps), rounded(v.z, steps)}; }
