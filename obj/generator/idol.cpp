// idol.cpp: the idol's signed distance, made of ellipsoids, rods and boxes joined by smooth minima; then its materials,
// colours and relief.
#include "idol.h"

#include "formulas.h"

namespace {

// ---- distances ----

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
    return k1 > 1e-9 ? k0 * (k0 - 1) / k1 : -std::min({r.x, r.y, r.z});
}
double sphere(const vec3& p, const vec3& centre, double r) { return norm(p - centre) - r; }

// A segment from a to b whose thickness goes from ra to rb.
double rod(const vec3& p, const vec3& a, const vec3& b, double ra, double rb) {
    const vec3 d = b - a, q = p - a;
    const double t = clamp01(dot(q, d) / dot(d, d));
    return norm(q - d * t) - mix(ra, rb, t);
}

double rounded_box(const vec3& p, const vec3& centre, const vec3& half, double r) {
    vec3 d, outside;
    for (int i = 0; i < 3; i++) {
        d[i] = std::fabs(p[i] - centre[i]) - half[i] + r;
        outside[i] = std::max(d[i], 0.);
    }
    return std::sqrt(dot(outside, outside)) + std::min(0., std::max({d.x, d.y, d.z})) - r;
}

// ---- where the idol and its head are ----

vec3 about_y(const vec3& p, double cos, double sin) { return {p.x * cos - p.z * sin, p.y, p.x * sin + p.z * cos}; }
vec3 about_x(const vec3& p, double cos, double sin) { return {p.x, p.y * cos - p.z * sin, p.y * sin + p.z * cos}; }

constexpr double turn_cos = 0.9563047559630354, turn_sin = 0.2923717047227368;    // 17 degrees, towards the light
constexpr double yaw_cos = 0.9961946980917455, yaw_sin = 0.0871557427476582;      // 5 degrees
constexpr double pitch_cos = 0.9455185755993168, pitch_sin = 0.3255681544571567;  // 19 degrees
constexpr double head_scale = 1.24;
constexpr vec3 head_pivot{0, -.36, -.04}, head_joint{0, -.05, -.04};

vec3 to_idol(const vec3& p) { return about_y(p, turn_cos, turn_sin); }
vec3 to_head(const vec3& l) {
    const vec3 q = (l - head_pivot) / head_scale + head_pivot - head_joint;
    return about_x(about_y(q, yaw_cos, yaw_sin), pitch_cos, pitch_sin) + head_joint;
}
vec3 from_head(const vec3& h) {
    const vec3 q = about_y(about_x(h - head_joint, pitch_cos, -pitch_sin), yaw_cos, -yaw_sin);
    return about_y((q + head_joint - head_pivot) * head_scale + head_pivot, turn_cos, -turn_sin);
}

// The two halves are mirror images. A smooth |x| keeps the surface smooth across the mirror plane: there is no crease.
double mirrored(double x) { return std::sqrt(x * x + 1e-4); }

// ---- the parts ----

// A horn's axis: a curve of degree five through space, its control points those of a Bezier curve.
constexpr vec3 horn_control[6] = {{.10, .34, .03},  {.38, .58, -.10}, {.64, .56, -.26},
                                  {.82, .82, -.06}, {.84, .60, .50},  {.34, .16, .61}};
// The point of the axis nearest to a point in space.
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
            if (df < 0) t = clamp01(t - std::clamp(f / df, -.03, .03));
        }
        const vec3 q = p - at(t);
        const int i = std::min(31, static_cast<int>(t * 32));
        const double radius = .102 * (1 - t * t * t) * (1 - .25 * t) + .006;
        return {t, norm(q), radius, mix(length[i], length[i + 1], t * 32 - i), q};
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
    return smin(rounded_box(p, {0, -.915, -.03}, {.69, .045, .33}, .012),
                rounded_box(p, {0, -.85, -.03}, {.61, .05, .27}, .015), .01);
}

double skull_cap(const vec3& h) { return ellipsoid(h, {0, .225, -.04}, {.28, .305, .362}); }

// The height over the circlet's plane, which rises towards the back.
double over_band(const vec3& h) { return h.y - .318 - (.2 - h.z) * .12; }
// How far a point is from the base of the neck: the rings of the collar.
double collar_radius(const vec3& p) { return norm(vec3{p.x / 1.22, p.y + .33, (p.z + .075) / 1.3}); }

// The distances to the parts, one for each material.
enum Part { Stone, Hair, Horn, Gold, Crystal, Eye, part_count };
struct Parts {
    double d[part_count];
    Part nearest() const { return static_cast<Part>(std::min_element(d, d + part_count) - d); }
    double least() const { return d[nearest()]; }
};

// Far from the head a lower bound stands for its parts.
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
        out.d[Crystal] = std::max({lozenge - .048, front, -.05 - j.z});
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

template <typename F>
vec3 gradient(const F& f, const vec3& p, double e) {  // by four values at the corners of a tetrahedron of size e
    const double a = f(p + vec3{e, -e, -e}), b = f(p + vec3{-e, -e, e}), c = f(p + vec3{-e, e, -e}),
                 d = f(p + vec3{e, e, e});
    return vec3{a - b - c + d, -a - b + c + d, -a + b - c + d} / (4 * e);
}

}  // namespace

double idol(const vec3& p) { return parts(p).least(); }

vec3 onto_surface(vec3 p) {  // along the gradient, by Newton's method
    for (int i = 0; i < 3; i++) {
        const vec3 g = gradient(idol, p, .001);
        const double gg = std::max(.2, dot(g, g));
        p = p - g * (std::clamp(idol(p), -.01, .01) / gg);
    }
    return p;
}

vec3 idol_normal(const vec3& p) { return normalized(gradient(idol, p, .006)); }

double importance(const vec3& p) {  // least where nobody looks
    const double below = smoothstep(-.80, -.86, p.y);
    const double face = smoothstep(.34, .18, norm(to_head(to_idol(p)) - vec3{0, .08, .22}));
    return (1 + 7 * face) * (1 - .8 * below);
}

// ---- what the maps hold beyond the triangles ----

namespace {

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

double strands(const vec3& h) { return sin_turns(h.x * 70 + 1.2 * noise(h * 9)); }

// Gold leaf let into the stone: two lines below each eye, dots over the brow, a meander around the pedestal. 1 on the
// gold.
double inlay(const vec3& l, const vec3& h) {
    double line = 9;
    if (h.z > .1 && h.y > -.2) {
        const vec3 q{std::fabs(h.x), h.y, 0};
        line = std::min(rod(q, {.082, .05, 0}, {.075, -.035, 0}, .0065, .002),
                        rod(q, {.118, .053, 0}, {.128, -.06, 0}, .0065, .002));
        for (int i = 0; i < 5; i++) {
            const vec3 dot_centre{.05 + .032 * i, .222 + .018 * i - .0028 * i * i, 0};
            line = std::min(line, norm(q - dot_centre) - .0085 + .0008 * i);
        }
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
    switch (s.nearest()) {
        case Stone: {
            const double smooth = smoothstep(.36, .22, norm(h - vec3{0, .08, .22}));  // the face was polished
            const double grain = .0008 * noise(p * 105) + .0012 * fbm(p * 44, 3) + .0028 * fbm(p * 11, 2);
            const double pits = .004 * smoothstep(.45, .75, noise(p * 38)) * smoothstep(.0, .3, noise(p * 5));
            return mix(1, .6, smooth) * (grain - pits) - .006 * cracks(p) - .002 * inlay(l, h);
        }
        case Hair:
            return .0022 * strands(h) + .0012 * noise(vec3{h.x * 190, h.y * 12, h.z * 12});
        case Horn: {
            const HornPoint q = horn_curve.nearest({mirrored(h.x), h.y, h.z});
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

vec3 eye_lamp(int side) { return {side * eye_centre.x, eye_centre.y, eye_centre.z + .1}; }

double fine_idol(const vec3& p) {
    const Parts s = parts(p);
    return s.least() - relief(p, s);
}

}  // namespace

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
    switch (s.nearest()) {
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
        case Hair:
            out.diffuse = vec3{.30, .23, .20} * (1 + .25 * strands(h) + .4 * mid) * (1 - .7 * closed);
            out.exponent = 12;
            break;
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
            const vec3 pupil_centre{side * eye_centre.x - .012 - .006 * side, eye_centre.y, eye_centre.z};
            const vec3 e = (h - pupil_centre) / eye_radius;
            const double r = std::sqrt(e.x * e.x + e.y * e.y), turn = atan_turns(e.y, e.x);
            const double iris = smoothstep(.56, .50, r);
            const double pupil = smoothstep(.07, .02, std::fabs(e.x) - .10 * (1 - 3.4 * e.y * e.y));
            const double fibres = .8 + .35 * noise(vec3{turn * 40, r * 3, 2});
            out.diffuse = mix({.55, .62, .58}, {.1, .4, .45}, iris);
            out.glow = mix(vec3{.04, .27, .32} * (1 - .5 * smoothstep(.6, 1, r)),
                           mix(vec3{.80, 1., .97}, vec3{.04, .78, .90}, smoothstep(.12, .42, r)) * fibres, iris);
            out.glow = out.glow * (1 - .75 * smoothstep(.44, .50, r) * iris) * (1 - .92 * pupil);
            out.exponent = 60;
        }
    }
    // the light that eyes and crystal shed on what is near
    if (s.nearest() != Eye && s.nearest() != Crystal)
        for (const vec3& lamp : {eye_lamp(-1), vec3{0, .335, .38}, eye_lamp(1)}) {
            const vec3 to = from_head(lamp) - p;
            const double r2 = dot(to, to), facing = dot(out.normal, to) / std::sqrt(r2 + 1e-6);
            const double e = .0055 * clamp01(facing * .8 + .2) / (r2 + .004) * (1 - smoothstep(.05, .30, r2));
            for (int i = 0; i < 3; i++)
                out.glow[i] += std::min(.8, e) * vec3{.10, .75, .85}[i] * (.25 + out.diffuse[i]);
        }
    return out;
}
