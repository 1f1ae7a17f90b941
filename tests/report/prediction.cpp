// prediction.cpp: needles thrown over the surface.
#include "prediction.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "our_gl.h"
#include "random.h"

double mean_distance(const Texel& texel) {
    const double w = texel.width, h = texel.height, d = std::hypot(w, h);
    return d / 6 + w * w / (12 * h) * std::log((h + d) / w) + h * h / (12 * w) * std::log((w + d) / h);
}

Theorist::Theorist(RayCaster caster, const View& view, const vec3& to_light, int threads)
    : caster_(std::move(caster)), view_(view), to_light_(to_light), threads_(threads) {
    const mat4 m = lookat(to_light, {}, view.up);
    x_ = m[0].xyz(), y_ = m[1].xyz(), z_ = m[2].xyz();
    low_ = high_ = seen(caster_.triangle(0)[0]);
    for (int f = 0; f < caster_.ntriangles(); f++)
        for (const vec3& corner : caster_.triangle(f)) {
            const vec2 p = seen(corner);
            for (int i = 0; i < 2; i++) low_[i] = std::min(low_[i], p[i]), high_[i] = std::max(high_[i], p[i]);
            for (int i = 0; i < 3; i++) size_ = std::max(size_, 2 * std::fabs(corner[i]));
        }
}

// dark: the verdict on a point by the sample at the end of the needle.
Theory Theorist::theory(const Texel& texel, bool at_corner, int needles,
                        const std::function<bool(const Hit&, const vec2&)>& dark) const {
    struct Count {
        double facing = 0, wrong = 0;   // pixels: all, and those wrong without any needle
        double crossings = 0, net = 0;  // needles: all that cross, and those that make wrong less those that put right
    };
    std::vector<Count> rows(view_.height);
    for_rows(view_.height, threads_, [&](int y) {
        Random random(y);  // a seed for each row, whichever thread takes it
        Count& count = rows[y];
        for (int x = 0; x < view_.width; x++) {
            const auto hit = caster_.first_hit(view_.eye, view_.direction(x, y));
            if (!hit || !caster_.faces(hit->triangle, to_light_)) continue;
            const bool shadowed = caster_.occluded(hit->triangle, hit->weight, to_light_),
                       wrong = dark(*hit, {}) != shadowed;
            count.facing++, count.wrong += wrong;
            for (int i = 0; i < needles; i++) {
                const double low = at_corner ? 0 : -.5;
                const vec2 needle{random.in(low, low + 1) * texel.width, random.in(low, low + 1) * texel.height};
                if ((dark(*hit, needle) != shadowed) != wrong) count.crossings++, count.net += wrong ? -1 : 1;
            }
        }
    });
    Count sum;
    for (const Count& c : rows)
        sum.facing += c.facing, sum.wrong += c.wrong, sum.crossings += c.crossings, sum.net += c.net;
    // The mean distance from a corner is that from the centre of a texel twice as large.
    const double mean_needle = (1 + at_corner) * mean_distance(texel), facing = std::max(1., sum.facing);
    const double per_crossing = std::numbers::pi / (2 * mean_needle * needles * facing);
    return {sum.wrong / facing, mean_needle, sum.net * per_crossing, std::sqrt(sum.crossings) * per_crossing};
}

Theory Theorist::derived_bias(const Texel& texel, int needles) const {
    // What a shadow buffer of endless resolution would hold: the surface nearest to the light. A height is towards it.
    const auto front = [&](const vec2& p) {  // its face and height
        const auto hit = caster_.first_hit(x_ * p.x + y_ * p.y + z_ * size_, -z_);
        return hit ? std::pair(hit->triangle, dot(hit->point, z_)) : std::pair(-1, -HUGE_VAL);
    };
    // A height is known to some ten roundings of numbers of the scene's size.
    const double rounding = 16 * size_ * std::numeric_limits<double>::epsilon();
    return theory(texel, false, needles, [&](const Hit& hit, const vec2& needle) {
        const Triangle& t = caster_.triangle(hit.triangle);
        const vec3 n = cross(t[1] - t[0], t[2] - t[0]);
        const vec2 sample = seen(hit.point) + needle, slope = seen(n) / -dot(n, z_);  // of the receiver, along x and y
        const double height = dot(hit.point, z_);
        const auto [face, above] = front(sample);
        if (face == hit.triangle || above <= height + dot(slope, needle) + rounding) return false;
        double lowest = above;
        for (const vec2& side : {vec2{texel.width, 0}, vec2{0, texel.height}}) {
            const double a = front(sample + side).second, b = front(sample - side).second;
            const double fall = std::min(std::fabs(above - a), std::fabs(above - b));
            lowest -= a < above && b < above ? fall / 2 : fall;
        }
        return lowest > height + rounding;
    });
}

Theory Theorist::constant_bias(double bias, const Texel& texel, int needles) const {
    return theory(texel, true, needles, [&](const Hit& hit, const vec2& needle) {
        return caster_.occluded(hit.point - x_ * needle.x - y_ * needle.y, z_, bias);
    });
}
