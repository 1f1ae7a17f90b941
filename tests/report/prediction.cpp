// prediction.cpp: needles thrown over the surface.
#include "prediction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <thread>

#include "our_gl.h"

namespace {

struct LightFrame {  // of the scene as the light sees it
    vec3 x, y, z;    // unit; z towards the light
    LightFrame(const vec3& to_light, const vec3& up) {
        const mat4 m = lookat(to_light, {}, up);
        x = m[0].xyz(), y = m[1].xyz(), z = m[2].xyz();
    }
    vec2 seen(const vec3& p) const { return {dot(p, x), dot(p, y)}; }
};

struct Random {  // splitmix64 (Steele, Lea, Flood 2014)
    std::uint64_t state;
    double operator()() {  // in [0,1)
        std::uint64_t r = state += 0x9e3779b97f4a7c15;
        r = (r ^ (r >> 30)) * 0xbf58476d1ce4e5b9;
        r = (r ^ (r >> 27)) * 0x94d049bb133111eb;
        return static_cast<double>((r ^ (r >> 31)) >> 11) * 0x1p-53;
    }
};

// What a shadow buffer of endless resolution would hold: the surface nearest to the light.
class Front {
public:
    Front(const RayCaster& caster, const LightFrame& light) : caster_(caster), light_(light) {
        for (int f = 0; f < caster.ntriangles(); f++)
            for (const vec3& corner : caster.triangle(f))
                for (int i = 0; i < 3; i++) size_ = std::max(size_, 2 * std::fabs(corner[i]));
    }
    struct Point {
        int face;       // -1 where there is nothing
        double height;  // towards the light; there minus infinity
    };
    Point at(const vec2& p) const {  // as the light sees it
        const vec3 above = light_.x * p.x + light_.y * p.y + light_.z * size_;
        const auto hit = caster_.first_hit(above, -light_.z);
        if (!hit) return {-1, -std::numeric_limits<double>::infinity()};
        return {hit->triangle, dot(hit->point, light_.z)};
    }
    // A height is known to some ten roundings of numbers of the scene's size.
    double rounding() const { return 16 * size_ * std::numeric_limits<double>::epsilon(); }

private:
    const RayCaster& caster_;
    LightFrame light_;
    double size_ = 0;  // more than any height
};

struct Count {
    long facing = 0, wrong = 0;   // pixels: all, and those wrong without any needle
    long crossings = 0, net = 0;  // needles: all that cross, and those that make wrong less those that put right
};

// Calls visit(hit, random, count) for the pixels whose surface faces the light. Rows have seeds of their own, so the
// result does not depend on the number of threads.
template <class Visit>
Count for_each_facing(const RayCaster& caster, const View& view, const vec3& to_light, int threads, Visit visit) {
    std::vector<Count> rows(static_cast<std::size_t>(view.height));
    const auto work = [&](int first) {
        for (int y = first; y < view.height; y += threads) {
            Count& count = rows[static_cast<std::size_t>(y)];
            Random random{static_cast<std::uint64_t>(y)};
            for (int x = 0; x < view.width; x++) {
                const auto hit = caster.first_hit(view.eye, view.direction(x, y));
                if (!hit || !caster.faces(hit->triangle, to_light)) continue;
                count.facing++;
                visit(*hit, random, count);
            }
        }
    };
    {
        std::vector<std::jthread> others;
        for (int i = 1; i < threads; i++) others.emplace_back(work, i);
        work(0);
    }
    Count sum;
    for (const Count& row : rows)
        sum.facing += row.facing, sum.wrong += row.wrong, sum.crossings += row.crossings, sum.net += row.net;
    return sum;
}

Theory theory(const Count& count, double mean_needle, int needles) {
    if (count.facing == 0) return {0, mean_needle, 0, 0};
    const double facing = static_cast<double>(count.facing);
    const double per_crossing = std::numbers::pi / (2 * mean_needle * needles * facing);
    return {static_cast<double>(count.wrong) / facing, mean_needle, static_cast<double>(count.net) * per_crossing,
            std::sqrt(static_cast<double>(count.crossings)) * per_crossing};
}

}  // namespace

double mean_distance(const Texel& texel) {
    const double w = texel.width, h = texel.height, d = std::hypot(w, h);
    return d / 6 + w * w / (12 * h) * std::log((h + d) / w) + h * h / (12 * w) * std::log((w + d) / h);
}

Texel fitted_texel(const RayCaster& caster, const vec3& to_light, const vec3& up, int size) {
    constexpr double inf = std::numeric_limits<double>::infinity();
    const LightFrame light(to_light, up);
    vec2 low{inf, inf}, high{-inf, -inf};
    for (int f = 0; f < caster.ntriangles(); f++)
        for (const vec3& corner : caster.triangle(f)) {
            const vec2 p = light.seen(corner);
            for (int i = 0; i < 2; i++) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
        }
    return {(high.x - low.x) / size, (high.y - low.y) / size};
}

double Theory::wrong() const { return floor + 2 / std::numbers::pi * mean_needle * boundary_per_area; }

Theory Theory::with_texels(double factor) const { return {floor, mean_needle * factor, boundary_per_area, deviation}; }

Theory theory_of_derived_bias(const RayCaster& caster, const View& view, const vec3& to_light, const Texel& texel,
                              int needles, int threads) {
    const LightFrame light(to_light, view.up);
    const Front front(caster, light);
    const Count count = for_each_facing(caster, view, to_light, threads, [&](const Hit& hit, Random& random, Count& c) {
        const Triangle& t = caster.triangle(hit.triangle);
        const vec3 n = cross(t[1] - t[0], t[2] - t[0]);
        const vec2 start = light.seen(hit.point);
        const vec2 slope = light.seen(n) / -dot(n, light.z);  // of the receiver, along the light's x and y
        const double height = dot(hit.point, light.z);
        const auto dark = [&](const vec2& needle) {
            const Front::Point above = front.at(start + needle);
            if (above.face == hit.triangle || above.height <= height + dot(slope, needle) + front.rounding()) return false;
            double lowest = above.height;
            for (const vec2& side : {vec2{texel.width, 0}, vec2{0, texel.height}}) {
                const double a = front.at(start + needle + side).height, b = front.at(start + needle - side).height;
                const double fall = std::min(std::fabs(above.height - a), std::fabs(above.height - b));
                lowest -= a < above.height && b < above.height ? fall / 2 : fall;
            }
            return lowest > height + front.rounding();
        };
        const bool shadowed = caster.occluded(hit.triangle, hit.weight, to_light);
        const bool wrong = dark({}) != shadowed;
        c.wrong += wrong;
        for (int i = 0; i < needles; i++) {
            const double x = (random() - .5) * texel.width, y = (random() - .5) * texel.height;
            const bool crosses = (dark({x, y}) != shadowed) != wrong;
            c.crossings += crosses, c.net += crosses ? (wrong ? -1 : 1) : 0;
        }
    });
    return theory(count, mean_distance(texel), needles);
}

Theory theory_of_constant_bias(const RayCaster& caster, const View& view, const vec3& to_light, double bias,
                               const Texel& texel, int needles, int threads) {
    const LightFrame light(to_light, view.up);
    const Count count = for_each_facing(caster, view, to_light, threads, [&](const Hit& hit, Random& random, Count& c) {
        const bool dark = caster.occluded(hit.point, light.z, bias);
        const bool wrong = dark != caster.occluded(hit.triangle, hit.weight, to_light);
        c.wrong += wrong;
        for (int i = 0; i < needles; i++) {
            const double x = random() * texel.width, y = random() * texel.height;
            const bool crosses = caster.occluded(hit.point - light.x * x - light.y * y, light.z, bias) != dark;
            c.crossings += crosses, c.net += crosses ? (wrong ? -1 : 1) : 0;
        }
    });
    return theory(count, 2 * mean_distance(texel),
                  needles);  // from a corner: the mean from the centre of one twice as large
}
