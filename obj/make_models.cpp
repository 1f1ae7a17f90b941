// make_models.cpp: the program that makes every model and texture of this folder out of formulas. It is not part of the
// renderer and not of the default build; its output is committed. Lesson paragraph: none, it only prepares the input.
//
// The idol is a signed distance function: a solid is { p : sdf(p) < 0 }, parts are joined by smooth minima. From it
// come a triangle mesh (sections "mesh" and "simplify"), a texture atlas ("atlas") and, texel by texel, the maps
// ("bake"): a texel's colour and normal depend on its point in space alone, therefore no seam shows where two charts
// meet. The output is the same byte for byte from every compiler: beyond + - * / only sqrt, floor, fabs, min and max
// are used, all exactly rounded, and no result depends on the order in which threads run.
#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <queue>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "geometry.h"
#include "tgaimage.h"

namespace {

// ---- small mathematics ----

double clamp01(double x) { return std::min(1., std::max(0., x)); }
double mix(double a, double b, double t) { return a + (b - a) * t; }
vec3 mix(const vec3& a, const vec3& b, double t) { return a + (b - a) * t; }
// From 0 at lo to 1 at hi; lo may be the larger.
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

// The angle of (x,y) in turns, in [-1/2,1/2], by the polynomial for the arc tangent on [0,1] of Abramowitz and Stegun,
// "Handbook of Mathematical Functions", 4.4.49: the error is below 2e-8 radians.
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

// ---- noise ----

// A well mixed 32-bit number for every lattice point (the finalizer of MurmurHash3).
std::uint32_t hash(int x, int y, int z) {
    std::uint32_t h = static_cast<std::uint32_t>(x) * 0x8da6b343u ^ static_cast<std::uint32_t>(y) * 0xd8163841u ^
                      static_cast<std::uint32_t>(z) * 0xcb1ab31fu;
    h ^= h >> 16, h *= 0x85ebca6bu, h ^= h >> 13, h *= 0xc2b2ae35u;
    return h ^ h >> 16;
}
double hash01(int x, int y, int z) { return hash(x, y, z) * (1 / 4294967296.); }

// Gradient noise in about [-1,1] with continuous second derivatives, for normals are taken from it (Perlin, "Improving
// noise", 2002).
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

// Distance to the nearest wall between the cells of a jittered lattice (about 0 on a wall, up to 1/2): cracks.
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

// ---- signed distances ----

// Smooth minimum and maximum: where the two differ by less than k they are blended by a quadratic.
double smin(double a, double b, double k) {
    const double h = std::max(0., k - std::fabs(a - b));
    return std::min(a, b) - h * h / (4 * k);
}
double smax(double a, double b, double k) { return -smin(-a, -b, k); }

// Not exact, but zero at the right place, with a gradient of about one near it.
double ellipsoid(const vec3& p, const vec3& centre, const vec3& r) {
    const double x = (p.x - centre.x) / r.x, y = (p.y - centre.y) / r.y, z = (p.z - centre.z) / r.z;
    const double k0 = std::sqrt(x * x + y * y + z * z);
    const double gx = x / r.x, gy = y / r.y, gz = z / r.z;
    const double k1 = std::sqrt(gx * gx + gy * gy + gz * gz);
    return k1 > 1e-9 ? k0 * (k0 - 1) / k1 : -std::min(r.x, std::min(r.y, r.z));
}
double sphere(const vec3& p, const vec3& centre, double r) { return norm(p - centre) - r; }

// A segment from a to b whose thickness goes from ra to rb.
double rod(const vec3& p, const vec3& a, const vec3& b, double ra, double rb) {
    const vec3 d = b - a, q = p - a;
    const double t = clamp01(dot(q, d) / dot(d, d));
    return norm(q - d * t) - mix(ra, rb, t);
}

double rounded_box(const vec3& p, const vec3& centre, const vec3& half, double r) {
    const double x = std::fabs(p.x - centre.x) - half.x + r, y = std::fabs(p.y - centre.y) - half.y + r,
                 z = std::fabs(p.z - centre.z) - half.z + r;
    const double ox = std::max(x, 0.), oy = std::max(y, 0.), oz = std::max(z, 0.);
    return std::sqrt(ox * ox + oy * oy + oz * oz) + std::min(0., std::max(x, std::max(y, z))) - r;
}

// ---- the idol ----

// Where the idol is: its own coordinates (x to its left, y up, z where it looks) are turned about y, towards the light.
constexpr double turn_cos = 0.9563047559630354, turn_sin = 0.2923717047227368;  // 17 degrees
vec3 to_idol(const vec3& p) { return {p.x * turn_cos - p.z * turn_sin, p.y, p.x * turn_sin + p.z * turn_cos}; }
vec3 from_idol(const vec3& p) { return {p.x * turn_cos + p.z * turn_sin, p.y, p.z * turn_cos - p.x * turn_sin}; }

// The two halves are mirror images. A smooth |x| keeps the surface smooth across the mirror plane: there is no crease.
double mirrored(double x) { return std::sqrt(x * x + 1e-4); }

// A horn's axis: a curve of degree five through space, its control points those of a Bezier curve.
constexpr vec3 horn_control[6] = {{.10, .34, .03},  {.38, .58, -.10}, {.64, .56, -.26},
                                  {.82, .82, -.06}, {.84, .60, .50},  {.34, .16, .61}};
// The point C(t) of the axis nearest to a point in space.
struct HornPoint {
    double t, distance;  // parameter; how far away it is
    double radius;       // of the horn there
    double along;        // length of the axis up to there
    vec3 offset;         // from the axis to the point in space
};

struct HornCurve {
    vec3 c[6];  // power basis
    vec3 sample[33];
    double length[33] = {};
    HornCurve() {
        constexpr double binomial[6] = {1, 5, 10, 10, 5, 1};
        for (int i = 0; i < 6; i++) {  // c_i = C(5,i) * the i-th forward difference of the control points
            vec3 d[6];
            std::copy(horn_control, horn_control + 6, d);
            for (int k = 0; k < i; k++)
                for (int j = 0; j < 5 - k; j++) d[j] = d[j + 1] - d[j];
            c[i] = d[0] * binomial[i];
        }
        for (int i = 0; i <= 32; i++) {
            sample[i] = at(i / 32.);
            if (i) length[i] = length[i - 1] + norm(sample[i] - sample[i - 1]);
        }
    }
    vec3 at(double t) const { return c[0] + (c[1] + (c[2] + (c[3] + (c[4] + c[5] * t) * t) * t) * t) * t; }
    vec3 slope(double t) const { return c[1] + (c[2] * 2 + (c[3] * 3 + (c[4] * 4 + c[5] * (5 * t)) * t) * t) * t; }
    vec3 bend(double t) const { return c[2] * 2 + (c[3] * 6 + (c[4] * 12 + c[5] * (20 * t)) * t) * t; }

    // The nearest point of the axis: the nearest of 33 samples, then Newton's method on (p - C(t)) . C'(t) = 0.
    HornPoint nearest(const vec3& p) const {
        double best = 1e9, t = 0;
        for (int i = 0; i <= 32; i++) {
            const vec3 q = p - sample[i];
            const double d = dot(q, q);
            if (d < best) best = d, t = i / 32.;
        }
        for (int i = 0; i < 4; i++) {
            const vec3 q = p - at(t), s = slope(t);
            const double f = dot(q, s), df = dot(q, bend(t)) - dot(s, s);
            if (df < 0) t = clamp01(t - std::min(.03, std::max(-.03, f / df)));
        }
        const vec3 q = p - at(t);
        const int i = std::min(31, static_cast<int>(t * 32));
        return {t, norm(q), .102 * (1 - t * t * t) * (1 - .25 * t) + .006, mix(length[i], length[i + 1], t * 32 - i),
                q};
    }
};
const HornCurve horn_curve;

double horn_rings(double along) {  // growth rings: a steep edge and a gentle one
    const double s = along * 20 + 5 * along * along, f = s - std::floor(s);
    return smoothstep(0, .28, f) * (1 - smoothstep(.3, 1, f));
}

double horn(const vec3& p) {
    const double far = sphere(p, {.46, .56, .2}, .62);
    if (far > .15) return far;
    const HornPoint h = horn_curve.nearest(p);
    const double fade = smoothstep(1, .75, h.t) * smoothstep(.06, .16, h.along);
    return (h.distance - h.radius - .012 * fade * (h.radius / .1) * horn_rings(h.along)) * .9;
}

constexpr vec3 eye_centre{.113, .128, .205};
constexpr double eye_radius = .072;

// The distances to the parts, one for each material.
enum Part { Stone, Hair, Horn, Gold, Crystal, Eye, part_count };
struct Parts {
    double d[part_count];
};

// The parts of the head, in its own coordinates, with x >= 0.
double face(const vec3& p) {
    double d =
        smin(ellipsoid(p, {0, .215, -.03}, {.262, .29, .335}), ellipsoid(p, {0, -.01, .10}, {.2, .255, .225}), .11);
    d = smin(d, rod(p, {.168, -.06, .02}, {.045, -.2, .22}, .055, .05), .06);       // jaw
    d = smin(d, ellipsoid(p, {0, -.212, .262}, {.072, .052, .062}), .05);           // chin
    d = smin(d, rod(p, {.205, .07, .10}, {.125, .04, .245}, .045, .04), .05);       // cheekbone
    d = smax(d, -ellipsoid(p, {.2, -.06, .235}, {.05, .075, .08}), .08);            // the hollow below it
    d = smax(d, -ellipsoid(p, {.30, .2, .15}, {.05, .08, .1}), .06);                // temple
    d = smin(d, ellipsoid(p, {0, .285, .12}, {.2, .13, .175}), .06);                // forehead
    d = smax(d, -ellipsoid(p, {.112, .128, .335}, {.082, .05, .085}), .045);        // eye socket
    d = smin(d, rod(p, {.028, .170, .318}, {.105, .206, .298}, .018, .019), .045);  // brow
    d = smin(d, rod(p, {.105, .206, .298}, {.200, .198, .205}, .019, .012), .055);
    d = smax(d, -rod(p, {0, .21, .338}, {.0, .185, .345}, .002, .002), .03);  // frown
    // eyelids: a shell around the eyeball, open between two planes through its centre
    const vec3 q = p - eye_centre;
    const double ey = q.y - .14 * q.x;  // the outer corner stands higher
    const double upper = ey * .95 - q.z * .33, lower = -ey * .96 - q.z * .27;
    const double ball = norm(q);
    d = smin(d, ball - eye_radius - .004, .02);
    d = smin(d, smax(ball - eye_radius - .014, -upper, .008), .012);
    d = smin(d, smax(ball - eye_radius - .012, -lower, .008), .012);
    d = smax(d, -smax(smax(upper, lower, .006), ball - eye_radius - .03, .006), .006);
    // nose
    d = smin(d, rod(p, {0, .17, .280}, {0, .01, .335}, .03, .042), .03);
    d = smin(d, rod(p, {0, .18, .312}, {0, .03, .388}, .021, .026), .04);
    d = smin(d, ellipsoid(p, {0, .004, .396}, {.035, .032, .036}), .03);
    d = smin(d, ellipsoid(p, {.041, -.008, .350}, {.028, .026, .038}), .03);
    d = smax(d, -ellipsoid(p, {.026, -.039, .368}, {.011, .013, .016}), .012);
    // mouth
    d = smin(d, ellipsoid(p, {0, -.105, .255}, {.095, .07, .075}), .04);
    d = smax(d, -rod(p, {.057, -.002, .345}, {.118, -.09, .262}, .005, .003), .035);
    d = smax(d, -rod(p, {0, -.05, .365}, {0, -.078, .355}, .006, .006), .02);
    d = smin(d, rod(p, {.012, -.088, .329}, {.072, -.109, .285}, .017, .008), .014);
    d = smin(d, rod(p, {0, -.131, .322}, {.062, -.117, .288}, .021, .009), .014);
    d = smax(d, -rod(p, {0, -.1085, .352}, {.082, -.118, .295}, .004, .003), .012);
    d = smax(d, -ellipsoid(p, {0, -.166, .34}, {.055, .014, .03}), .03);
    return d;
}

double ear(const vec3& p) {  // pointed, below the horn
    const double far = sphere(p, {.34, .13, -.05}, .17);
    if (far > .1) return far;
    double d = rod(p, {.25, .09, -.03}, {.43, .20, -.12}, .062, .008);
    const double flat = std::fabs((p.x - .25) * .42 + (p.z + .03) * .9) - .024;
    d = smax(d, flat, .03);
    return smax(d, -rod(p, {.27, .10, .005}, {.40, .18, -.075}, .030, .004), .02);
}

// The trunk without the muscles of the neck: the collar lies on this.
double trunk(const vec3& p) {
    const double far = p.y - .02;
    if (far > .2) return far;
    double d = rod(p, {0, -.1, -.06}, {0, -.5, -.09}, .185, .195);
    d = smin(d, rod(p, {.0, -.2, -.16}, {.47, -.56, -.12}, .1, .08), .14);  // trapezius
    d = smin(d, rod(p, {.1, -.48, -.02}, {.46, -.59, -.05}, .10, .09), .08);
    d = smin(d, ellipsoid(p, {0, -.78, -.05}, {.5, .31, .25}), .12);
    d = smin(d, ellipsoid(p, {.49, -.72, -.08}, {.18, .26, .2}), .10);  // shoulder
    d = smin(d, ellipsoid(p, {.2, -.71, .10}, {.22, .14, .12}), .06);   // breast
    d = smax(d, p.x - .60, .03);
    return smax(d, -.81 - p.y, .02);
}

double pedestal(const vec3& p) {
    double d = rounded_box(p, {0, -.915, -.03}, {.69, .045, .33}, .012);
    d = smin(d, rounded_box(p, {0, -.85, -.03}, {.61, .05, .27}, .015), .01);
    return d;
}

// The head is modelled at its own scale, turned further towards the light and raised a little.
constexpr double head_scale = 1.24;
constexpr vec3 head_pivot{0, -.36, -.04}, head_joint{0, -.05, -.04};
constexpr double yaw_cos = 0.9961946980917455, yaw_sin = 0.0871557427476582;      // 5 degrees
constexpr double pitch_cos = 0.9455185755993168, pitch_sin = 0.3255681544571567;  // 19 degrees
vec3 to_head(const vec3& p) {
    const vec3 q = (p - head_pivot) / head_scale + head_pivot - head_joint;
    const vec3 r{q.x * yaw_cos - q.z * yaw_sin, q.y, q.x * yaw_sin + q.z * yaw_cos};
    return vec3{r.x, r.y * pitch_cos - r.z * pitch_sin, r.y * pitch_sin + r.z * pitch_cos} + head_joint;
}
vec3 from_head(const vec3& h) {
    const vec3 q = h - head_joint;
    const vec3 r{q.x, q.y * pitch_cos + q.z * pitch_sin, q.z * pitch_cos - q.y * pitch_sin};
    const vec3 p{r.x * yaw_cos + r.z * yaw_sin, r.y, r.z * yaw_cos - r.x * yaw_sin};
    return (p + head_joint - head_pivot) * head_scale + head_pivot;
}

// The height of the circlet's plane over a point: it rises towards the back.
double over_band(const vec3& h) { return h.y - .318 - (.2 - h.z) * .12; }
double skull_cap(const vec3& h) { return ellipsoid(h, {0, .225, -.04}, {.28, .305, .362}); }

// How far a point is from the base of the neck: the rings of the collar.
double collar_radius(const vec3& p) { return norm(vec3{p.x / 1.22, p.y + .33, (p.z + .075) / 1.3}); }

// The distances from a point of the model's space. Far from the head a lower bound stands for its parts.
Parts parts(const vec3& world) {
    const vec3 l = to_idol(world), p{mirrored(l.x), l.y, l.z};
    vec3 h = to_head(l);
    h.x = mirrored(h.x);
    Parts out;
    double& stone = out.d[Stone];
    const double far = sphere(h, {0, .1, .02}, .56);
    stone = out.d[Hair] = out.d[Gold] = out.d[Crystal] = out.d[Eye] = far;
    if (far < .2) {
        stone = smin(face(h), ear(h), .04);
        const double cap = skull_cap(h), band = over_band(h);
        const double locks = .009 * std::fabs(sin_turns(h.x * 11 + .25)) * smoothstep(-.02, .08, band);
        out.d[Hair] = smax(cap - locks, -std::max(band, std::min(band + .4, -.12 - h.z + h.y * .2)), .02);
        out.d[Hair] = smin(out.d[Hair], ellipsoid(h, {0, -.01, -.235}, {.15, .22, .10}), .07);
        // circlet and the setting of the crystal
        double gold = smax(cap - .016, std::fabs(band) - .021, .008);
        const vec3 g{h.x, h.y - .335, h.z - .302};
        const vec3 j{g.x, g.y * .958 - g.z * .287, g.z * .958 + g.y * .287};
        const double lozenge = j.x * .87 + std::fabs(j.y) * .5;
        const double front = std::max(j.x * .62 + std::fabs(j.y) * .36 + j.z * .7 - .042, j.z - .036);
        out.d[Crystal] = std::max(std::max(lozenge - .048, front), -.05 - j.z);
        gold = smin(gold, smax(smax(lozenge - .064, std::fabs(j.z) - .02, .008), .046 - lozenge, .008), .01);
        out.d[Gold] = gold;
        out.d[Eye] = sphere(h, eye_centre, eye_radius);
    }
    out.d[Horn] = horn(h);
    stone = smin(stone, out.d[Horn] + .02, .05);
    out.d[Hair] = smin(out.d[Hair], out.d[Horn] + .02, .05);
    for (double& d : out.d) d *= head_scale;
    const double body = trunk(p), R = collar_radius(p);
    const double muscle = rod(p, {.19, .0, -.06}, {.05, -.42, .10}, .04, .03);  // from the ear to the breastbone
    stone = smin(stone, p.y > .2 ? body : smin(body, muscle, .05), .04);
    stone = std::min(stone, pedestal(p));
    const double collar = smax(body - .016, std::max(std::fabs(R - .275) - .075, p.y + .30 - .3 * (p.z + .1)), .01);
    out.d[Gold] = std::min(out.d[Gold], collar);
    return out;
}

double idol(const vec3& p) {
    const Parts s = parts(p);
    return *std::min_element(s.d, s.d + part_count);
}

// ---- the idol's surface: what the maps hold beyond the triangles ----

template <typename F>
vec3 gradient(const F& f, const vec3& p, double e) {  // by four values at the corners of a tetrahedron of size e
    const double a = f(p + vec3{e, -e, -e}), b = f(p + vec3{-e, -e, e}), c = f(p + vec3{-e, e, -e}),
                 d = f(p + vec3{e, e, e});
    return vec3{a - b - c + d, -a - b + c + d, -a + b - c + d} / (4 * e);
}

vec3 onto_surface(vec3 p) {  // along the gradient, by Newton's method
    for (int i = 0; i < 3; i++) {
        const vec3 g = gradient(idol, p, .001);
        const double gg = std::max(.2, dot(g, g));
        p = p - g * (std::max(-.01, std::min(.01, idol(p))) / gg);
    }
    return p;
}

Part part_at(const Parts& s) { return static_cast<Part>(std::min_element(s.d, s.d + part_count) - s.d); }

double cracks(const vec3& p) {  // 1 in a crack, 0 beside it
    const vec3 warped =
        p * 2.6 + vec3{fbm(p * 5, 3), fbm(p * 5 + vec3{9, 9, 9}, 3), fbm(p * 5 + vec3{5, 1, 8}, 3)} * .5;
    const vec3 h = to_head(to_idol(p));
    const double here =
        smoothstep(.05, .3, noise(p * 1.7 + vec3{3.3, 1.1, 8.2})) * smoothstep(.12, .2, norm(h - vec3{.03, .08, .3}));
    return here * (1 - smoothstep(.002, .011, cell_wall(warped)));
}

// The collar's ornaments: rows of rounded plates between rims. Returns the height in [0,1]; enamel becomes 1 on the
// coloured row and stays 0 elsewhere.
double collar_relief(const vec3& p, double& enamel) {
    const double R = collar_radius(p), turn = atan_turns(p.x / 1.22, (p.z + .075) / 1.3);
    const double row = (R - .2) / .05, r = row - std::floor(row);
    const int k = static_cast<int>(std::floor(row));
    const double count = k <= 0 ? 48 : k == 1 ? 56 : 40;
    const double s = turn * count + .5 * (k & 1), c = std::fabs(s - std::floor(s) - .5) * 2;
    const double plate = smoothstep(.0, .16, r - .08) * (1 - smoothstep(.8, .94, r)) * (1 - smoothstep(.72, .98, c));
    enamel = k == 1 ? plate : 0;
    return plate;
}

// Gold leaf let into the stone: two lines below each eye, dots over the brow, a meander around the
// pedestal. 1 on the gold.
double inlay(const vec3& l, const vec3& h) {
    double line = 9;
    if (h.z > .1 && h.y > -.2) {
        const double x = std::fabs(h.x);
        const vec3 q{x, h.y, 0};
        line = std::min(rod(q, {.082, .05, 0}, {.075, -.035, 0}, .0065, .002),
                        rod(q, {.118, .053, 0}, {.128, -.06, 0}, .0065, .002));
        for (int i = 0; i < 5; i++)
            line =
                std::min(line, norm(q - vec3{.05 + .032 * i, .222 + .018 * i - .0028 * i * i, 0}) - .0085 + .0008 * i);
    }
    if (l.y < -.87 && l.y > -.96) {
        constexpr const char* meander[5] = {"######## ", "#      # ", "# #### # ", "# #    # ", "# ###### "};
        const double along = std::fabs(l.x) > .66 ? l.z : l.x, cell = .011;
        const int column = static_cast<int>(std::floor(along / cell + 900)) % 9,
                  row = static_cast<int>(std::floor((-.888 - l.y) / cell));
        if (row >= 0 && row < 5 && (std::fabs(l.x) > .675 || l.z > .285 || l.z < -.345))
            line = meander[row][column] == '#' ? -.01 : .01;
    }
    return smoothstep(.002, -.002, line);
}

// The relief that is too fine for triangles, as a height over the surface.
double relief(const vec3& p, const Parts& s) {
    const vec3 l = to_idol(p), h = to_head(l);
    const vec3 m{mirrored(h.x), h.y, h.z};
    switch (part_at(s)) {
        case Stone: {
            const double smooth = smoothstep(.36, .22, norm(h - vec3{0, .08, .22}));  // the face was polished
            const double grain = .0008 * noise(p * 105) + .0012 * fbm(p * 44, 3) + .0028 * fbm(p * 11, 2);
            const double pits = .004 * smoothstep(.45, .75, noise(p * 38)) * smoothstep(.0, .3, noise(p * 5));
            return mix(1, .6, smooth) * (grain - pits) - .006 * cracks(p) - .002 * inlay(l, h);
        }
        case Hair: {
            const double u = h.x * 70 + 1.2 * noise(h * 9);
            return .0022 * sin_turns(u) + .0012 * noise(vec3{h.x * 190, h.y * 12, h.z * 12});
        }
        case Horn: {
            const HornPoint q = horn_curve.nearest(m);
            const vec3 round = q.offset / std::max(.01, q.distance);
            return .0012 * noise(round * 16 + vec3{0, 0, q.along * 4}) +
                   .0010 * noise(vec3{q.along * 160, round.x * 3, round.y * 3}) + .0008 * noise(p * 90);
        }
        case Gold: {
            double enamel;
            if (l.y < -.23) return .006 * collar_relief(l, enamel) + .0007 * noise(p * 60);
            const double notches = smoothstep(.2, .5, sin_turns(atan_turns(h.x, h.z + .045) * 72));
            return .003 * notches * smoothstep(.016, .010, std::fabs(over_band(h))) + .0007 * noise(p * 60);
        }
        default:
            return 0;
    }
}

double fine_idol(const vec3& p) {
    const Parts s = parts(p);
    return *std::min_element(s.d, s.d + part_count) - relief(p, s);
}

struct Surface {
    vec3 normal, diffuse, glow;  // unit vector in object space; colours in [0,1]
    double exponent;
};

Surface surface(const vec3& p) {
    const Parts s = parts(p);
    const vec3 l = to_idol(p), h = to_head(l);
    const vec3 coarse = normalized(gradient(idol, p, .004));
    Surface out;
    out.normal = normalized(gradient(fine_idol, p, .0012));
    // how closed in the point is (0 open, 1 a deep crevice), and how worn an edge it stands on
    double closed = 0, weight = .55;
    for (const double reach : {.012, .03, .065, .12}) {
        closed += weight * clamp01(1 - idol(p + coarse * reach) / reach);
        weight *= .72;
    }
    closed = clamp01(closed * 1.1);
    const double worn = clamp01(-18 * (idol(p - coarse * .02) + .02));
    const double large = fbm(p * 3.1, 3), mid = fbm(p * 13, 3), fine = fbm(p * 60, 2);
    out.glow = {};
    switch (part_at(s)) {
        case Stone: {
            vec3 c = mix({.95, .84, .68}, {.80, .72, .63}, smoothstep(-.3, .3, large));
            c = mix(c, {.86, .63, .44}, .55 * smoothstep(.05, .35, fbm(vec3{p.x * 2, p.y * 7, p.z * 2}, 3)));
            c = c * (1 + .22 * mid + .18 * fine);
            c = mix(c, {.9, .85, .74}, .5 * worn);
            // verdigris: run down from the gold, and in the crevices
            const double run = smoothstep(-.05, .3, fbm(vec3{p.x * 22, p.y * 3, p.z * 22}, 3));
            const double below = l.y < -.23 ? smoothstep(.47, .36, collar_radius(l))
                                            : smoothstep(.14, .03, -over_band(h)) * smoothstep(-.05, .0, -over_band(h));
            c = mix(c, {.26, .58, .50}, .75 * clamp01(run * below + .6 * closed * smoothstep(.0, .3, large + mid)));
            c = mix(c, {.26, .19, .14}, clamp01(closed * .62 + .6 * cracks(p)));
            const double leaf = inlay(l, h) * smoothstep(-.75, -.35, mid + .5 * fine);
            out.diffuse = mix(c, vec3{1., .70, .24} * (1 - .6 * closed), leaf);
            out.exponent = mix(26 + 50 * closed + 14 * clamp01(.5 + mid), 22, leaf);
            break;
        }
        case Hair: {
            const double u = h.x * 70 + 1.2 * noise(h * 9);
            out.diffuse = vec3{.30, .23, .20} * (1 + .25 * sin_turns(u) + .4 * mid) * (1 - .7 * closed);
            out.exponent = 12;
            break;
        }
        case Horn: {
            const HornPoint q = horn_curve.nearest({mirrored(h.x), h.y, h.z});
            vec3 c = mix({.36, .25, .17}, {.86, .76, .58}, smoothstep(.1, 1, q.t + .25 * mid));
            c = c * (.62 + .5 * horn_rings(q.along) + .3 * mid) *
                (1 + .3 * noise(vec3{q.along * 160, q.offset.x * 30, q.offset.y * 30}));
            out.diffuse = mix(c, {.10, .07, .05}, .7 * closed);
            out.exponent = 18 + 20 * q.t;
            break;
        }
        case Gold: {
            double enamel = 0;
            const double plate = l.y < -.23 ? collar_relief(l, enamel) : 1;
            vec3 c = mix({1., .72, .26}, {.86, .50, .20}, clamp01(.5 + large + mid));
            c = mix(c, {.30, .18, .07}, clamp01(.75 * (1 - plate) + .8 * closed));
            c = mix(c, {.26, .58, .50}, .6 * clamp01(closed * 1.5) * smoothstep(-.1, .3, mid));
            c = mix(c, {.05, .34, .46}, enamel);
            out.diffuse = c;
            out.exponent = 24 + 10 * mid;
            break;
        }
        case Crystal:
            out.diffuse = {.2, .75, .85};
            out.glow = vec3{.05, .62, .80} * (.55 + .5 * clamp01(1 - 14 * mirrored(h.x)) + .35 * fine);
            out.exponent = 60;
            break;
        default: {                                 // eye
            const double side = h.x < 0 ? -1 : 1;  // both eyes look at the default camera
            const vec3 e =
                (h - vec3{side * eye_centre.x - .012 - .006 * side, eye_centre.y, eye_centre.z}) / eye_radius;
            const double r = std::sqrt(e.x * e.x + e.y * e.y), turn = atan_turns(e.y, e.x);
            const double iris = smoothstep(.56, .50, r),
                         pupil = smoothstep(.07, .02, std::fabs(e.x) - .10 * (1 - 3.4 * e.y * e.y));
            const double fibres = .8 + .35 * noise(vec3{turn * 40, r * 3, 2});
            out.diffuse = mix({.55, .62, .58}, {.1, .4, .45}, iris);
            out.glow = mix(vec3{.04, .27, .32} * (1 - .5 * smoothstep(.6, 1, r)),
                           mix(vec3{.80, 1., .97}, vec3{.04, .78, .90}, smoothstep(.12, .42, r)) * fibres, iris);
            out.glow = out.glow * (1 - .75 * smoothstep(.44, .50, r) * iris) * (1 - .92 * pupil);
            out.exponent = 60;
        }
    }
    // the light that eyes and crystal shed on what is near
    if (part_at(s) != Eye && part_at(s) != Crystal)
        for (const double side : {-1., 0., 1.}) {
            const vec3 source =
                side != 0. ? vec3{side * eye_centre.x, eye_centre.y, eye_centre.z + .1} : vec3{0, .335, .38};
            const vec3 lamp = from_idol(from_head(source));
            const vec3 to = lamp - p;
            const double r2 = dot(to, to), facing = dot(out.normal, to) / std::sqrt(r2 + 1e-6);
            const double e = .0055 * clamp01(facing * .8 + .2) / (r2 + .004) * (1 - smoothstep(.05, .30, r2));
            for (int i = 0; i < 3; i++)
                out.glow[i] += std::min(.8, e) * vec3{.10, .75, .85}[i] * (.25 + out.diffuse[i]);
        }
    return out;
}

// ---- mesh: from the distance function to triangles ----

using Face = std::array<int, 3>;
struct Mesh {
    std::vector<vec3> verts;
    std::vector<Face> faces;  // counter-clockwise seen from outside
};

std::size_t at(int i) { return static_cast<std::size_t>(i); }
vec3 face_cross(const Mesh& m, const Face& f) {  // along the outward normal, twice the area long
    return cross(m.verts[at(f[1])] - m.verts[at(f[0])], m.verts[at(f[2])] - m.verts[at(f[0])]);
}

// Runs work(i) for 0 <= i < n on all cores. The calls must not depend on each other.
template <typename F>
void parallel(int n, const F& work) {
    std::atomic<int> next{0};
    std::vector<std::thread> threads;
    for (unsigned k = 0; k < std::max(1u, std::thread::hardware_concurrency()); k++)
        threads.emplace_back([&] {
            for (int i; (i = next++) < n;) work(i);
        });
    for (std::thread& t : threads) t.join();
}

// Throws unless every edge is shared by exactly two faces that run along it in opposite directions, every vertex has
// one fan of faces around it, no face is degenerate, the volume is positive and the Euler characteristic is as
// expected.
void check_closed(const Mesh& m, const std::string& name, int euler) {
    std::map<std::pair<int, int>, int> next;  // the directed edge (a,b) of a face -> its third vertex
    double volume = 0;
    for (const Face& f : m.faces) {
        for (int k = 0; k < 3; k++)
            if (!next.insert({{f[at(k)], f[at((k + 1) % 3)]}, f[at((k + 2) % 3)]}).second)
                throw std::runtime_error(name + ": an edge is used twice");
        if (!(norm(face_cross(m, f)) > 1e-9)) throw std::runtime_error(name + ": a face is degenerate");
        volume += dot(m.verts[at(f[0])], cross(m.verts[at(f[1])], m.verts[at(f[2])])) / 6;
    }
    std::vector<int> degree(m.verts.size()), start(m.verts.size(), -1);
    for (const auto& [edge, third] : next) {
        if (!next.count({edge.second, edge.first})) throw std::runtime_error(name + ": an edge is open");
        degree[at(edge.first)]++, start[at(edge.first)] = edge.second;
    }
    for (int v = 0; v < static_cast<int>(m.verts.size()); v++) {
        int turns = degree[at(v)] ? 1 : 0;
        if (turns)
            for (int w = next.at({v, start[at(v)]}); w != start[at(v)]; w = next.at({v, w})) turns++;
        if (!turns || turns != degree[at(v)]) throw std::runtime_error(name + ": a vertex without exactly one fan");
    }
    if (!(volume > 0)) throw std::runtime_error(name + ": the faces look inwards");
    const int chi =
        static_cast<int>(m.verts.size()) + static_cast<int>(m.faces.size()) - static_cast<int>(next.size() / 2);
    if (chi != euler) throw std::runtime_error(name + ": Euler characteristic " + std::to_string(chi));
}

// Moves every vertex onto the surface, but for those that would turn or flatten a face by it.
void settle(Mesh& m) {
    std::vector<vec3> target(m.verts.size());
    std::vector<std::vector<int>> fans(m.verts.size());
    parallel(static_cast<int>(m.verts.size()), [&](int i) { target[at(i)] = onto_surface(m.verts[at(i)]); });
    for (int f = 0; f < static_cast<int>(m.faces.size()); f++)
        for (const int v : m.faces[at(f)]) fans[at(v)].push_back(f);
    for (std::size_t v = 0; v < m.verts.size(); v++) {
        const vec3 before = m.verts[v];
        std::vector<vec3> was;
        for (const int f : fans[v]) was.push_back(face_cross(m, m.faces[at(f)]));
        m.verts[v] = target[v];
        bool fine = true;
        for (std::size_t k = 0; k < fans[v].size(); k++) {
            const vec3 is = face_cross(m, m.faces[at(fans[v][k])]);
            if (dot(was[k], is) < .5 * norm(was[k]) * norm(is) || norm(is) < .2 * norm(was[k])) fine = false;
        }
        if (!fine) m.verts[v] = before;
    }
}

// Naive surface nets over [-1,1]^3 with n^3 cells: one vertex in every cell that the surface crosses, one quad across
// every grid edge that it crosses. That is a closed manifold as long as no cell has two sheets in it: such cells are
// filled.
Mesh surface_net(int n) {
    const int m = n + 1;
    const double cell = 2. / n;
    const auto index = [&](int x, int y, int z) { return (at(z) * at(m) + at(y)) * at(m) + at(x); };
    const auto place = [&](int x, int y, int z) { return vec3{x * cell - 1, y * cell - 1, z * cell - 1}; };
    std::vector<double> value(at(m) * at(m) * at(m));
    constexpr int block = 8;
    const int blocks = (m + block - 1) / block;
    parallel(blocks * blocks * blocks, [&](int b) {
        const int x0 = b % blocks * block, y0 = b / blocks % blocks * block, z0 = b / blocks / blocks * block;
        const double middle = idol(place(x0, y0, z0) + vec3{1, 1, 1} * (block * cell / 2));
        const bool empty =
            std::fabs(middle) > 2 * .87 * block * cell;  // twice half the block's diagonal: no surface in it
        for (int z = z0; z < std::min(m, z0 + block); z++)
            for (int y = y0; y < std::min(m, y0 + block); y++)
                for (int x = x0; x < std::min(m, x0 + block); x++)
                    value[index(x, y, z)] = empty ? middle : idol(place(x, y, z));
    });

    const auto corner = [&](int x, int y, int z, int c) { return index(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)); };
    // Whether the surface passes through a cell as one sheet: on no face do opposite corners pair up, nor do they alone
    // in the whole cube. Bit c of INSIDE tells of corner c.
    const auto one_sheet = [](int inside) {
        for (int axis = 0; axis < 3; axis++)
            for (int side = 0; side < 2; side++) {
                const int a = 1 << (axis + 1) % 3, b = 1 << (axis + 2) % 3, o = side << axis;
                const auto in = [&](int c) { return inside >> c & 1; };
                if (in(o) == in(o + a + b) && in(o + a) == in(o + b) && in(o) != in(o + a)) return false;
            }
        for (int c = 0; c < 4; c++)
            if (inside == (1 << c | 1 << (7 - c)) || inside == (255 ^ (1 << c | 1 << (7 - c)))) return false;
        return true;
    };
    std::array<bool, 256> good{};
    for (int i = 0; i < 256; i++) good[at(i)] = one_sheet(i);
    const auto mask = [&](int x, int y, int z) {
        int inside = 0;
        for (int c = 0; c < 8; c++) inside |= (value[corner(x, y, z, c)] < 0) << c;
        return inside;
    };
    for (bool changed = true; changed;) {
        changed = false;
        for (int z = 0; z < n; z++)
            for (int y = 0; y < n; y++)
                for (int x = 0; x < n; x++) {
                    if (good[at(mask(x, y, z))]) continue;
                    std::size_t nearest = 0;
                    double smallest = 1e9;
                    for (int c = 0; c < 8; c++) {
                        const double v = value[corner(x, y, z, c)];
                        if (v >= 0 && v < smallest) smallest = v, nearest = corner(x, y, z, c);
                    }
                    value[nearest] = -1e-6;
                    changed = true;
                }
    }

    Mesh out;
    std::vector<int> vertex(at(n) * at(n) * at(n), -1);
    const auto cell_index = [&](int x, int y, int z) { return (at(z) * at(n) + at(y)) * at(n) + at(x); };
    for (int z = 0; z < n; z++)
        for (int y = 0; y < n; y++)
            for (int x = 0; x < n; x++) {
                const int inside = mask(x, y, z);
                if (inside == 0 || inside == 255) continue;
                vec3 sum;
                int crossings = 0;
                for (int c = 0; c < 8; c++)
                    for (int axis = 0; axis < 3; axis++) {
                        const int d = c | 1 << axis;
                        if (d == c || (inside >> c & 1) == (inside >> d & 1)) continue;
                        const double a = value[corner(x, y, z, c)], b = value[corner(x, y, z, d)];
                        vec3 p{1. * (c & 1), 1. * (c >> 1 & 1), 1. * (c >> 2)};
                        const double t = std::min(.9, std::max(.1, a / (a - b)));  // no quad shrinks to a point
                        p[axis] = t;
                        sum = sum + p, crossings++;
                    }
                vertex[cell_index(x, y, z)] = static_cast<int>(out.verts.size());
                out.verts.push_back(place(x, y, z) + sum * (cell / crossings));
            }
    for (int z = 1; z < n; z++)
        for (int y = 1; y < n; y++)
            for (int x = 1; x < n; x++)
                for (int axis = 0; axis < 3; axis++) {
                    const int dx = axis == 0, dy = axis == 1, dz = axis == 2;
                    const bool a = value[index(x, y, z)] < 0, b = value[index(x + dx, y + dy, z + dz)] < 0;
                    if (a == b) continue;
                    int q[4];  // the four cells around the edge, counter-clockwise seen from the edge's end
                    constexpr int around[4][2] = {{1, 1}, {0, 1}, {0, 0}, {1, 0}};
                    for (int k = 0; k < 4; k++) {
                        int c[3] = {x, y, z};
                        c[(axis + 1) % 3] -= around[k][0], c[(axis + 2) % 3] -= around[k][1];
                        q[k] = vertex[cell_index(c[0], c[1], c[2])];
                    }
                    if (b) std::swap(q[1], q[3]);
                    const auto edge = [&](int i, int j) { return norm(out.verts[at(q[i])] - out.verts[at(q[j])]); };
                    const int s = edge(0, 2) <= edge(1, 3) ? 0 : 1;
                    out.faces.push_back({q[s], q[s + 1], q[(s + 2) % 4]});
                    out.faces.push_back({q[s], q[(s + 2) % 4], q[(s + 3) % 4]});
                }
    settle(out);
    return out;
}

// ---- simplify: edge collapses in the order of the quadric error (Garland and Heckbert, "Surface simplification using
// quadric error metrics", 1997) ----

struct Quadric {  // x'Ax + 2b'x + c: a weighted sum of squared distances to planes
    mat3 A;
    vec3 b;
    double c = 0;
    void add_plane(const vec3& n, double d, double w) {
        for (int i = 0; i < 3; i++) A[i] = A[i] + n * (n[i] * w);
        b = b + n * (d * w), c += d * d * w;
    }
    void add(const Quadric& q) {
        for (int i = 0; i < 3; i++) A[i] = A[i] + q.A[i];
        b = b + q.b, c += q.c;
    }
    double error(const vec3& p) const { return dot(p, A * p) + 2 * dot(b, p) + c; }
};

// How much an error matters: most in the face, least where nobody looks.
double importance(const vec3& p) {
    const vec3 h = to_head(to_idol(p));
    const double face_region = smoothstep(.34, .18, norm(h - vec3{0, .08, .22}));
    const double below = smoothstep(-.80, -.86, p.y);
    return (1 + 7 * face_region) * (1 - .8 * below);
}

Mesh simplify(Mesh m, int target) {
    const int nverts = static_cast<int>(m.verts.size());
    std::vector<Quadric> quadric(m.verts.size());
    std::vector<std::vector<int>> fans(m.verts.size());  // the faces around each vertex
    for (int i = 0; i < static_cast<int>(m.faces.size()); i++) {
        const Face& f = m.faces[at(i)];
        const vec3 c = face_cross(m, f), n = normalized(c),
                   middle = (m.verts[at(f[0])] + m.verts[at(f[1])] + m.verts[at(f[2])]) / 3;
        const double w = norm(c) * importance(middle);
        for (const int v : f) {
            quadric[at(v)].add_plane(n, -dot(n, m.verts[at(v)]), w);
            for (int k = 0; k < 3; k++) {  // a weak pull to the place itself: flat parts keep well-shaped triangles
                vec3 e;
                e[k] = 1;
                quadric[at(v)].add_plane(e, -m.verts[at(v)][k], w * 2e-3);
            }
            fans[at(v)].push_back(i);
        }
    }
    std::vector<bool> dead_face(m.faces.size()), dead(m.verts.size());
    std::vector<int> stamp(m.verts.size());

    struct Candidate {
        double cost;
        int a, b, stamp_a, stamp_b;
        vec3 p;
    };
    const auto later = [](const Candidate& x, const Candidate& y) {
        return x.cost != y.cost ? x.cost > y.cost : x.a != y.a ? x.a > y.a : x.b > y.b;
    };
    std::priority_queue<Candidate, std::vector<Candidate>, decltype(later)> heap(later);
    const auto offer = [&](int a, int b) {
        if (a > b) std::swap(a, b);
        Quadric q = quadric[at(a)];
        q.add(quadric[at(b)]);
        const vec3 middle = (m.verts[at(a)] + m.verts[at(b)]) / 2;
        vec3 p = middle;
        if (const auto inverse = invert(q.A)) p = *inverse * (-q.b);
        if (norm(p - middle) > norm(m.verts[at(a)] - m.verts[at(b)])) p = middle;
        heap.push({std::max(0., q.error(p)), a, b, stamp[at(a)], stamp[at(b)], p});
    };
    const auto neighbours = [&](int v) {
        std::vector<int> out;
        for (const int f : fans[at(v)])
            for (const int w : m.faces[at(f)])
                if (w != v) out.push_back(w);
        std::sort(out.begin(), out.end());
        out.erase(std::unique(out.begin(), out.end()), out.end());
        return out;
    };
    for (int v = 0; v < nverts; v++)
        for (const int w : neighbours(v))
            if (v < w) offer(v, w);

    int left = static_cast<int>(m.faces.size());
    while (left > target && !heap.empty()) {
        const Candidate c = heap.top();
        heap.pop();
        if (dead[at(c.a)] || dead[at(c.b)] || stamp[at(c.a)] != c.stamp_a || stamp[at(c.b)] != c.stamp_b) continue;
        const std::vector<int> na = neighbours(c.a), nb = neighbours(c.b);
        std::vector<int> common;
        std::set_intersection(na.begin(), na.end(), nb.begin(), nb.end(), std::back_inserter(common));
        if (common.size() != 2 || na.size() + nb.size() < 8) continue;  // the surface would pinch
        bool fine = true;
        for (const int end : {c.a, c.b})
            for (const int f : fans[at(end)]) {
                const Face& t = m.faces[at(f)];
                const bool shared = std::count(t.begin(), t.end(), c.a) && std::count(t.begin(), t.end(), c.b);
                if (shared) continue;
                vec3 p[3];
                for (int k = 0; k < 3; k++) p[k] = t[at(k)] == end ? c.p : m.verts[at(t[at(k)])];
                const vec3 before = face_cross(m, t), after = cross(p[1] - p[0], p[2] - p[0]);
                const double longest = std::max(norm(p[1] - p[0]), std::max(norm(p[2] - p[1]), norm(p[0] - p[2])));
                if (dot(before, after) < .6 * norm(before) * norm(after) || norm(after) < .12 * longest * longest)
                    fine = false;
            }
        if (!fine) continue;
        m.verts[at(c.a)] = c.p;
        quadric[at(c.a)].add(quadric[at(c.b)]);
        dead[at(c.b)] = true;
        for (const int f : fans[at(c.b)]) {
            Face& t = m.faces[at(f)];
            if (std::count(t.begin(), t.end(), c.a)) {
                dead_face[at(f)] = true, left--;
                for (const int v : t)
                    if (v != c.b) fans[at(v)].erase(std::find(fans[at(v)].begin(), fans[at(v)].end(), f));
            } else {
                std::replace(t.begin(), t.end(), c.b, c.a);
                fans[at(c.a)].push_back(f);
            }
        }
        fans[at(c.b)].clear();
        stamp[at(c.a)]++;
        for (const int w : neighbours(c.a)) offer(c.a, w);
    }

    Mesh out;
    std::vector<int> renamed(m.verts.size(), -1);
    for (int v = 0; v < nverts; v++)
        if (!dead[at(v)]) renamed[at(v)] = static_cast<int>(out.verts.size()), out.verts.push_back(m.verts[at(v)]);
    for (std::size_t f = 0; f < m.faces.size(); f++)
        if (!dead_face[f])
            out.faces.push_back({renamed[at(m.faces[f][0])], renamed[at(m.faces[f][1])], renamed[at(m.faces[f][2])]});
    settle(out);
    return out;
}

// ---- atlas: the mesh cut into charts that lie flat in the texture ----

struct Textured {  // a mesh as the renderer will read it back, rounded to the decimals that the file has
    Mesh mesh;
    std::vector<vec3> normals;
    std::vector<vec2> uvs;
    std::vector<Face> uv_of, normal_of;  // indices, three a face
};

double rounded(double x, double steps) { return std::floor(x * steps + .5) / steps + 0.; }  // + 0. turns -0 into 0
vec3 rounded(const vec3& v, double steps) { return {rounded(v.x, steps), rounded(v.y, steps), rounded(v.z, steps)}; }

// Calls visit(x,y) for the texels whose centres are in the triangle or within MARGIN texels of it.
template <typename F>
void cover(const std::array<vec2, 3>& t, double margin, const F& visit) {
    double lo[2], hi[2];
    for (int k = 0; k < 2; k++) {
        lo[k] = std::floor(std::min(t[0][k], std::min(t[1][k], t[2][k])) - margin);
        hi[k] = std::ceil(std::max(t[0][k], std::max(t[1][k], t[2][k])) + margin);
    }
    const double area = (t[1].x - t[0].x) * (t[2].y - t[0].y) - (t[1].y - t[0].y) * (t[2].x - t[0].x),
                 sign = area < 0 ? -1 : 1;
    for (int y = static_cast<int>(lo[1]); y < static_cast<int>(hi[1]); y++)
        for (int x = static_cast<int>(lo[0]); x < static_cast<int>(hi[0]); x++) {
            bool inside = true;
            for (int k = 0; k < 3 && inside; k++) {
                const vec2 a = t[at(k)], e = t[at((k + 1) % 3)] - a, q = vec2{x + .5, y + .5} - a;
                inside = sign * (e.x * q.y - e.y * q.x) >= -margin * norm(e);
            }
            if (inside) visit(x, y);
        }
}

struct Chart {
    std::vector<int> faces;
    vec3 u, v, w;                               // an orthonormal frame: the chart is the projection along w
    double shrink = 1;                          // its scale, relative to the atlas's
    int x0 = 0, y0 = 0, width = 0, height = 0;  // its box in blocks; x0, y0: in the chart's own coordinates
    std::vector<std::vector<bool>> mask;        // blocks it needs, padding included
    int at_x = 0, at_y = 0;                     // its place in the atlas, in blocks
};

vec2 flat(const Chart& c, const vec3& p, double scale) { return vec2{dot(p, c.u), dot(p, c.v)} * (scale * c.shrink); }

// Charts grow from a seed over faces that look roughly the same way, and stop where the projection would fold over
// itself. SCALE is in texels per unit of length.
std::vector<Chart> cut(const Mesh& m, double scale) {
    std::map<std::pair<int, int>, int> owner;
    for (int f = 0; f < static_cast<int>(m.faces.size()); f++)
        for (int k = 0; k < 3; k++) owner[{m.faces[at(f)][at(k)], m.faces[at(f)][at((k + 1) % 3)]}] = f;
    std::vector<Face> beside(m.faces.size());
    std::vector<vec3> normal(m.faces.size()), middle(m.faces.size());
    for (std::size_t f = 0; f < m.faces.size(); f++) {
        normal[f] = normalized(face_cross(m, m.faces[f]));
        for (int k = 0; k < 3; k++) {
            beside[f][at(k)] = owner.at({m.faces[f][at((k + 1) % 3)], m.faces[f][at(k)]});
            middle[f] = middle[f] + m.verts[at(m.faces[f][at(k)])] / 3;
        }
    }
    std::vector<int> chart_of(m.faces.size(), -1);
    std::vector<Chart> charts;

    // Grows one chart from SEED over the faces whose normals have at least the cosine LEAST with its direction W.
    const auto grow = [&](int seed, const vec3& w, double least) {
        Chart c;
        c.w = w;
        c.u = normalized(cross(std::fabs(w.y) < .8 ? vec3{0, 1, 0} : vec3{0, 0, 1}, w));
        c.v = cross(w, c.u);
        std::map<std::pair<int, int>, double> heights;  // texel -> where the surface is above it
        using Entry = std::pair<double, int>;
        std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> open;
        open.push({0, seed});
        std::vector<bool> seen(m.faces.size());
        seen[at(seed)] = true;
        while (!open.empty()) {
            const int f = open.top().second;
            open.pop();
            const double facing = dot(normal[at(f)], w);
            if (chart_of[at(f)] >= 0 || facing < least) continue;
            std::array<vec2, 3> t;
            for (int k = 0; k < 3; k++) t[at(k)] = flat(c, m.verts[at(m.faces[at(f)][at(k)])], scale);
            std::vector<std::pair<std::pair<int, int>, double>> fresh;
            bool folds = false;
            cover(t, 1.5, [&](int x, int y) {
                const vec3 q = c.u * ((x + .5) / scale) + c.v * ((y + .5) / scale);
                const double height = dot(middle[at(f)] - q, normal[at(f)]) / facing;
                const auto found = heights.find({x, y});
                if (found == heights.end()) fresh.push_back({{x, y}, height});
                else if (std::fabs(found->second - height) > 7 / scale) folds = true;
            });
            if (folds) continue;
            heights.insert(fresh.begin(), fresh.end());
            c.faces.push_back(f);
            for (const int g : beside[at(f)])
                if (!seen[at(g)] && chart_of[at(g)] < 0) {
                    seen[at(g)] = true;
                    open.push({norm(middle[at(g)] - middle[at(seed)]) + .25 * (1 - dot(normal[at(g)], w)), g});
                }
        }
        return c;
    };
    for (int seed = 0; seed < static_cast<int>(m.faces.size()); seed++) {
        if (chart_of[at(seed)] >= 0) continue;
        Chart c = grow(seed, normal[at(seed)], .72);
        for (int round = 0; round < 2; round++) {
            vec3 mean;
            for (const int f : c.faces) mean = mean + face_cross(m, m.faces[at(f)]);
            mean = normalized(mean);
            if (dot(mean, normal[at(seed)]) < .62) break;
            c = grow(seed, mean, .6);
        }
        if (middle[at(seed)].y < -.95 && c.w.y < -.99) c.shrink = .25;  // under the pedestal: nobody looks there
        for (const int f : c.faces) chart_of[at(f)] = static_cast<int>(charts.size());
        charts.push_back(std::move(c));
    }
    return charts;
}

// Places the charts in a square of SIZE texels, first fit, large ones first. Returns whether they all fit at this
// scale.
constexpr int block_texels = 2;
bool pack(const Mesh& m, std::vector<Chart>& charts, double scale, int size) {
    constexpr double padding = 2.5;  // texels around every chart that hold what lies just outside
    const int blocks = size / block_texels, words = blocks / 64 + 1;
    std::vector<std::size_t> order(charts.size());
    for (std::size_t i = 0; i < charts.size(); i++) {
        Chart& c = charts[i];
        double lo[2] = {1e9, 1e9}, hi[2] = {-1e9, -1e9};
        for (const int f : c.faces)
            for (const int v : m.faces[at(f)])
                for (int k = 0; k < 2; k++) {
                    const double s = flat(c, m.verts[at(v)], scale)[k];
                    lo[k] = std::min(lo[k], s), hi[k] = std::max(hi[k], s);
                }
        c.x0 = static_cast<int>(std::floor((lo[0] - padding) / block_texels)),
        c.y0 = static_cast<int>(std::floor((lo[1] - padding) / block_texels));
        c.width = static_cast<int>(std::ceil((hi[0] + padding) / block_texels)) - c.x0;
        c.height = static_cast<int>(std::ceil((hi[1] + padding) / block_texels)) - c.y0;
        c.mask.assign(at(c.height), std::vector<bool>(at(c.width)));
        for (const int f : c.faces) {
            std::array<vec2, 3> t;
            for (int k = 0; k < 3; k++)
                t[at(k)] = flat(c, m.verts[at(m.faces[at(f)][at(k)])], scale) -
                           vec2{1. * c.x0 * block_texels, 1. * c.y0 * block_texels};
            cover(t, padding, [&](int x, int y) {
                const int bx = x / block_texels, by = y / block_texels;
                if (bx >= 0 && by >= 0 && bx < c.width && by < c.height) c.mask[at(by)][at(bx)] = true;
            });
        }
        order[i] = i;
    }
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        const int sa = charts[a].width * charts[a].height, sb = charts[b].width * charts[b].height;
        return sa != sb ? sa > sb : a < b;
    });
    std::vector<std::vector<std::uint64_t>> used(at(blocks), std::vector<std::uint64_t>(at(words)));
    for (const std::size_t i : order) {
        Chart& c = charts[i];
        const int chart_words = c.width / 64 + 1;
        std::vector<std::vector<std::uint64_t>> bits(at(c.height), std::vector<std::uint64_t>(at(chart_words)));
        for (int y = 0; y < c.height; y++)
            for (int x = 0; x < c.width; x++)
                if (c.mask[at(y)][at(x)]) bits[at(y)][at(x / 64)] |= std::uint64_t{1} << (x & 63);
        const auto fits = [&](int x, int y) {
            for (int r = 0; r < c.height; r++)
                for (int k = 0; k < chart_words; k++) {
                    const std::uint64_t b = bits[at(r)][at(k)];
                    if (!b) continue;
                    const int first = x + k * 64, word = first / 64, shift = first & 63;
                    const auto& row = used[at(y + r)];
                    std::uint64_t there = row[at(word)] >> shift;
                    if (shift && word + 1 < words) there |= row[at(word + 1)] << (64 - shift);
                    if (there & b) return false;
                }
            return true;
        };
        bool placed = false;
        for (int y = 0; y + c.height <= blocks && !placed; y++)
            for (int x = 0; x + c.width <= blocks && !placed; x++)
                if (fits(x, y)) placed = true, c.at_x = x, c.at_y = y;
        if (!placed) return false;
        for (int y = 0; y < c.height; y++)
            for (int x = 0; x < c.width; x++)
                if (c.mask[at(y)][at(x)])
                    used[at(c.at_y + y)][at((c.at_x + x) / 64)] |= std::uint64_t{1} << ((c.at_x + x) & 63);
    }
    return true;
}

// A mesh with texture coordinates: one scale everywhere, SCALE texels per unit of length or what fits into SIZE^2
// texels.
Textured unwrap(Mesh m, int size, double scale) {
    Textured out;
    for (vec3& v : m.verts) v = rounded(v, 1e5);
    std::vector<Chart> charts = cut(m, scale);
    while (!pack(m, charts, scale, size)) scale *= .98;
    std::printf("  %zu charts, %.0f texels per unit\n", charts.size(), scale);
    out.uv_of.resize(m.faces.size());
    for (const Chart& c : charts) {
        std::map<int, int> uv_of_vertex;
        for (const int f : c.faces)
            for (int k = 0; k < 3; k++) {
                const int v = m.faces[at(f)][at(k)];
                const auto [found, fresh] = uv_of_vertex.insert({v, static_cast<int>(out.uvs.size())});
                if (fresh) {
                    const vec2 t = flat(c, m.verts[at(v)], scale) +
                                   vec2{1. * (c.at_x - c.x0) * block_texels, 1. * (c.at_y - c.y0) * block_texels};
                    out.uvs.push_back({rounded(t.x / size, 1e5), rounded(t.y / size, 1e5)});
                }
                out.uv_of[at(f)][at(k)] = found->second;
            }
    }
    for (const vec3& v : m.verts) out.normals.push_back(rounded(normalized(gradient(idol, v, .006)), 1e4));
    out.normal_of = m.faces;
    out.mesh = std::move(m);
    return out;
}

// ---- bake: from the surface to the texels ----

// The face that each texel belongs to, -1 where there is none; three texels around every chart belong to a face beside
// them.
std::vector<int> owners(const Textured& t, int size) {
    std::vector<int> owner(at(size) * at(size), -1);
    const auto texel = [&](int x, int y) -> int& { return owner[at(y) * at(size) + at(x)]; };
    for (int f = 0; f < static_cast<int>(t.uv_of.size()); f++) {
        std::array<vec2, 3> corner;
        for (int k = 0; k < 3; k++) corner[at(k)] = t.uvs[at(t.uv_of[at(f)][at(k)])] * size;
        cover(corner, 0, [&](int x, int y) {
            if (x >= 0 && y >= 0 && x < size && y < size) texel(x, y) = f;
        });
    }
    for (int round = 0; round < 3; round++) {
        const std::vector<int> before = owner;
        for (int y = 0; y < size; y++)
            for (int x = 0; x < size; x++) {
                constexpr int near[8][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}};
                for (int k = 0; k < 8 && texel(x, y) < 0; k++) {
                    const int nx = x + near[k][0], ny = y + near[k][1];
                    if (nx >= 0 && ny >= 0 && nx < size && ny < size) texel(x, y) = before[at(ny) * at(size) + at(nx)];
                }
            }
    }
    return owner;
}

std::array<double, 3> barycentric(const std::array<vec2, 3>& t, const vec2& p) {
    const auto area = [](const vec2& a, const vec2& b) { return a.x * b.y - a.y * b.x; };
    const double whole = area(t[1] - t[0], t[2] - t[0]);
    const double b = area(p - t[0], t[2] - t[0]) / whole, c = area(t[1] - t[0], p - t[0]) / whole;
    return {1 - b - c, b, c};
}

// The normal N in the frame that the renderer builds from the triangle: columns i, j (along the gradients of u and v in
// the plane orthogonal to the interpolated normal) and that normal. The columns i and j need not be orthogonal.
vec3 to_tangent(const std::array<vec3, 3>& p, const std::array<vec2, 3>& uv, const vec3& interpolated, const vec3& n) {
    const vec3 e1 = p[1] - p[0], e2 = p[2] - p[0], c1 = cross(e2, interpolated), c2 = cross(interpolated, e1);
    const double sign = dot(e1, c1) < 0 ? -1 : 1;
    const vec3 i = normalized((c1 * (uv[1].x - uv[0].x) + c2 * (uv[2].x - uv[0].x)) * sign);
    const vec3 j = normalized((c1 * (uv[1].y - uv[0].y) + c2 * (uv[2].y - uv[0].y)) * sign);
    const auto inverse = invert(transpose(mat3{{i, j, interpolated}}));
    return inverse ? normalized(*inverse * n) : vec3{0, 0, 1};
}

std::uint8_t byte(double x) { return static_cast<std::uint8_t>(std::floor(clamp01(x) * 255 + .5)); }
TGAColor colour(const vec3& c) { return {{byte(c.z), byte(c.y), byte(c.x), 255}}; }
TGAColor encoded(const vec3& n) { return colour((n + vec3{1, 1, 1}) / 2); }

struct Maps {
    TGAImage diffuse, normal, tangent, specular, glow;
};

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
            if (count) out.set(x, y, {{static_cast<std::uint8_t>((sum + count / 2) / count), 0, 0, 0}});
        }
    return out;
}

Maps bake_idol(const Textured& t, int size) {
    const std::vector<int> owner = owners(t, size);
    Maps out{{size, size, TGAImage::RGB},
             {size, size, TGAImage::RGB},
             {size, size, TGAImage::RGB},
             {size, size, TGAImage::GRAYSCALE},
             {size, size, TGAImage::RGB}};
    parallel(size, [&](int y) {
        for (int x = 0; x < size; x++) {
            const int f = owner[at(y) * at(size) + at(x)];
            if (f < 0) continue;
            std::array<vec3, 3> p;
            std::array<vec2, 3> uv;
            for (int k = 0; k < 3; k++)
                p[at(k)] = t.mesh.verts[at(t.mesh.faces[at(f)][at(k)])], uv[at(k)] = t.uvs[at(t.uv_of[at(f)][at(k)])];
            const auto b = barycentric(uv, vec2{(x + .5) / size, (y + .5) / size});
            vec3 place, n;
            for (int k = 0; k < 3; k++)
                place = place + p[at(k)] * b[at(k)], n = n + t.normals[at(t.normal_of[at(f)][at(k)])] * b[at(k)];
            const Surface s = surface(onto_surface(place));
            out.diffuse.set(x, y, colour(s.diffuse));
            out.normal.set(x, y, encoded(s.normal));
            out.tangent.set(x, y, encoded(to_tangent(p, uv, normalized(n), s.normal)));
            out.specular.set(
                x, y,
                {{static_cast<std::uint8_t>(std::min(255., std::max(1., std::floor(s.exponent + .5)))), 0, 0, 0}});
            out.glow.set(x, y, colour(s.glow));
        }
    });
    out.specular = halved(out.specular);  // it varies slowly
    return out;
}

// ---- the floor: a slab of worn flagstones under the idol, with a ring of gold let in ----

constexpr double floor_top = -.95, floor_bottom = -.995, floor_half = .99;
constexpr int floor_cells = 20;

// The texture is the slab unfolded: the top in the middle, the sides around it. FLOOR_UV units of length make up one
// side.
constexpr double floor_uv = 2 * (floor_half + floor_top - floor_bottom);

struct Flag {
    double height, seam, gold;  // seam, gold: 1 in the mortar, 1 on the ring
    vec3 tint;
};

Flag flagstone(double x, double z) {
    constexpr double length = .33, width = .22;
    const double row = z / width + 40, j = std::floor(row), column = x / length + .37 * j + 40, i = std::floor(column);
    const double in_x = column - i, in_z = row - j, wobble = .004 * noise(vec3{x * 30, z * 30, 1});
    const double edge = std::min(std::min(in_x, 1 - in_x) * length, std::min(in_z, 1 - in_z) * width) + wobble;
    const auto chance = [&](int k) { return hash01(static_cast<int>(i), static_cast<int>(j), k); };  // one a stone
    const double bumps = .5 * fbm(vec3{x * 16, z * 16, 3 + i}, 4) + .25 * noise(vec3{x * 70, z * 70, 9});
    Flag out;
    out.seam = 1 - smoothstep(.004, .014, edge);
    out.height =
        .010 * smoothstep(.002, .02, edge) + .005 * bumps + .006 * (chance(8) - .5) * (in_x - .5) * (1 - out.seam);
    out.tint = mix({.40, .37, .36}, {.52, .44, .36}, chance(2)) * (.75 + .35 * chance(5) + .35 * bumps);
    out.tint = mix(out.tint, {.12, .10, .09}, .85 * out.seam);

    const double r = std::sqrt(x * x + z * z), turn = atan_turns(z, x) * 96, f = turn - std::floor(turn);
    const double plate = smoothstep(.04, .12, f) * (1 - smoothstep(.88, .96, f));
    const vec3 brass = vec3{.80, .55, .20} * (.45 + .5 * plate + .25 * noise(vec3{x * 25, z * 25, 4}));
    out.gold = smoothstep(.86, .868, r) * (1 - smoothstep(.922, .93, r));
    out.height = mix(out.height, .008 + .003 * plate * out.gold, out.gold);
    out.tint = mix(out.tint, brass, out.gold);
    out.seam *= 1 - out.gold;
    return out;
}

Textured floor_mesh() {
    Textured out;
    std::map<std::array<int, 3>, int> index;  // lattice point -> vertex; the second coordinate: 1 top, 0 bottom
    constexpr int n = floor_cells;
    constexpr double margin = (floor_top - floor_bottom) / floor_uv, inner = 1 - 2 * margin;
    const vec3 axes[6] = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}, {0, 0, 1}, {0, 0, -1}};
    out.normals.assign(axes, axes + 6);
    const auto corner = [&](const std::array<int, 3>& c) {
        const auto [found, fresh] = index.insert({c, static_cast<int>(out.mesh.verts.size())});
        if (fresh)
            out.mesh.verts.push_back(rounded(
                {(2. * c[0] / n - 1) * floor_half, c[1] ? floor_top : floor_bottom, (2. * c[2] / n - 1) * floor_half},
                1e5));
        return found->second;
    };
    const auto quad = [&](const std::array<std::array<int, 3>, 4>& c, int normal) {  // counter-clockwise
        int v[4], uv[4];
        for (int k = 0; k < 4; k++) {
            const auto& q = c[at(k)];
            v[k] = corner(q);
            vec2 t{margin + inner * q[0] / n, margin + inner * (n - q[2]) / n};
            if (normal >= 2 && !q[1]) t = t + vec2{out.normals[at(normal)].x, -out.normals[at(normal)].z} * margin;
            uv[k] = static_cast<int>(out.uvs.size());
            out.uvs.push_back({rounded(t.x, 1e5), rounded(t.y, 1e5)});
        }
        for (const int k : {1, 2}) {
            out.mesh.faces.push_back({v[0], v[k], v[k + 1]});
            out.uv_of.push_back({uv[0], uv[k], uv[k + 1]});
            out.normal_of.push_back({normal, normal, normal});
        }
    };
    for (int a = 0; a < n; a++) {
        for (int b = 0; b < n; b++) {
            quad({{{a, 1, b + 1}, {a + 1, 1, b + 1}, {a + 1, 1, b}, {a, 1, b}}}, 0);
            quad({{{a, 0, b}, {a + 1, 0, b}, {a + 1, 0, b + 1}, {a, 0, b + 1}}}, 1);
        }
        quad({{{n, 0, a + 1}, {n, 0, a}, {n, 1, a}, {n, 1, a + 1}}}, 2);
        quad({{{0, 0, a}, {0, 0, a + 1}, {0, 1, a + 1}, {0, 1, a}}}, 3);
        quad({{{a, 0, n}, {a + 1, 0, n}, {a + 1, 1, n}, {a, 1, n}}}, 4);
        quad({{{a + 1, 0, 0}, {a, 0, 0}, {a, 1, 0}, {a + 1, 1, 0}}}, 5);
    }
    return out;
}

// u runs along x and v along -z; on the sides the texture goes on as if the slab were unfolded. Bump mapping (Blinn
// 1978): the normal of a height field h over (u,v) is (-dh/du, -dh/dv, 1).
Maps bake_floor(int size) {
    Maps out{{size, size, TGAImage::RGB}, {}, {size, size, TGAImage::RGB}, {size, size, TGAImage::GRAYSCALE}, {}};
    parallel(size, [&](int y) {
        for (int x = 0; x < size; x++) {
            const double px = ((x + .5) / size - .5) * floor_uv, pz = -((y + .5) / size - .5) * floor_uv, e = .002;
            const Flag f = flagstone(px, pz);
            const double hu = (flagstone(px + e, pz).height - flagstone(px - e, pz).height) / (2 * e);
            const double hv = (flagstone(px, pz - e).height - flagstone(px, pz + e).height) / (2 * e);
            out.diffuse.set(x, y, colour(f.tint));
            out.tangent.set(x, y, encoded(normalized(vec3{-hu, -hv, 1})));
            out.specular.set(x, y,
                             {{static_cast<std::uint8_t>(f.gold > .5 ? 20 : 40 + std::floor(60 * f.seam)), 0, 0, 0}});
        }
    });
    return out;
}

// ---- the knot: a tube along a (2,3) torus knot ----

Mesh knot_mesh() {
    constexpr int along = 240, around = 18, p = 2, q = 3;
    constexpr double major = .61, minor = .24, tube = .135;
    Mesh out;
    const auto curve = [](double t) {
        const double r = major + minor * cos_turns(q * t);
        return vec3{r * cos_turns(p * t), r * sin_turns(p * t), minor * sin_turns(q * t)};
    };
    for (int i = 0; i < along; i++) {
        const double t = 1. * i / along;
        const vec3 c = curve(t), tangent = normalized(curve(t + 1e-3) - curve(t - 1e-3));
        const vec3 outward = vec3{cos_turns(p * t) * cos_turns(q * t), sin_turns(p * t) * cos_turns(q * t),
                                  sin_turns(q * t)};  // the torus's normal
        const vec3 b = normalized(cross(tangent, outward)), a = cross(b, tangent);
        for (int k = 0; k < around; k++) {
            const double s = 1. * k / around;
            out.verts.push_back(rounded(c + (a * cos_turns(s) + b * sin_turns(s)) * tube, 1e5));
        }
    }
    for (int i = 0; i < along; i++)
        for (int k = 0; k < around; k++) {
            const auto v = [&](int di, int dk) { return (i + di) % along * around + (k + dk) % around; };
            out.faces.push_back({v(0, 0), v(1, 1), v(1, 0)});
            out.faces.push_back({v(0, 0), v(0, 1), v(1, 1)});
        }
    return out;
}

// ---- write ----

// Throws std::runtime_error if the mesh leaves [-1,1]^3 or the file cannot be written.
void write_obj(const std::filesystem::path& path, const Textured& t, const std::string& title) {
    std::string text = "# " + title + ", made by make_models.cpp\n";
    const auto add = [&](const char* format, auto... numbers) {
        char line[160];
        std::snprintf(line, sizeof line, format, numbers...);
        text += line;
    };
    for (const vec3& v : t.mesh.verts) {
        for (int k = 0; k < 3; k++)
            if (!(std::fabs(v[k]) <= 1)) throw std::runtime_error(path.string() + ": a vertex outside [-1,1]^3");
        add("v %.5f %.5f %.5f\n", v.x, v.y, v.z);
    }
    for (const vec2& v : t.uvs) add("vt %.5f %.5f\n", v.x, v.y);
    for (const vec3& v : t.normals) add("vn %.4f %.4f %.4f\n", v.x, v.y, v.z);
    for (std::size_t f = 0; f < t.mesh.faces.size(); f++) {
        text += "f";
        for (std::size_t k = 0; k < 3; k++)
            if (t.uvs.empty()) add(" %d", t.mesh.faces[f][k] + 1);
            else add(" %d/%d/%d", t.mesh.faces[f][k] + 1, t.uv_of[f][k] + 1, t.normal_of[f][k] + 1);
        text += "\n";
    }
    std::ofstream file(path, std::ios::binary);
    file.write(text.data(), static_cast<std::streamsize>(text.size())).flush();
    if (!file) throw std::runtime_error(path.string() + ": cannot write");
    std::printf("%s: %zu triangles, %zu vertices\n", path.filename().c_str(), t.mesh.faces.size(), t.mesh.verts.size());
}

void write_maps(const std::filesystem::path& stem, const Maps& maps) {
    const auto write = [&](const TGAImage& image, const char* suffix) {
        if (!image.empty()) image.write_tga_file(stem.string() + suffix);
    };
    write(maps.diffuse, "_diffuse.tga");
    write(maps.normal, "_nm.tga");
    write(maps.tangent, "_nm_tangent.tga");
    write(maps.specular, "_spec.tga");
    write(maps.glow, "_glow.tga");
}

}  // namespace

// usage: make_models FOLDER  (writes FOLDER/idol, FOLDER/floor, FOLDER/knot)
int main(int argc, char** argv) {
    if (argc != 2) {
        std::fprintf(stderr, "usage: make_models FOLDER\n");
        return 2;
    }
    try {
        const std::filesystem::path folder = argv[1];
        for (const char* name : {"idol", "floor", "knot"}) std::filesystem::create_directories(folder / name);

        const Mesh net = surface_net(176);
        // 300 texels per unit: a texel is as large as a pixel of the default picture
        const Textured idol_mesh = unwrap(simplify(net, 16000), 1024, 300);
        check_closed(idol_mesh.mesh, "idol", 2);
        write_obj(folder / "idol" / "idol.obj", idol_mesh, "The idol: a horned bust");
        write_maps(folder / "idol" / "idol", bake_idol(idol_mesh, 1024));

        const Textured slab = floor_mesh();
        check_closed(slab.mesh, "floor", 2);
        write_obj(folder / "floor" / "floor.obj", slab, "The floor: a slab of flagstones");
        write_maps(folder / "floor" / "floor", bake_floor(512));

        Textured knot;
        knot.mesh = knot_mesh();
        check_closed(knot.mesh, "knot", 0);
        write_obj(folder / "knot" / "knot.obj", knot, "The knot: a tube along the torus knot (2,3)");
    } catch (const std::exception& error) {
        std::fprintf(stderr, "make_models: %s\n", error.what());
        return 1;
    }
}
