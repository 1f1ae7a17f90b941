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

double area(const vec2& a, const vec2& b, const vec2& c) {  // twice the signed one
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

struct Random {  // splitmix64 (Steele, Lea, Flood 2014)
    std::uint64_t state;
    double operator()() {  // in [0,1)
        std::uint64_t r = state += 0x9e3779b97f4a7c15;
        r = (r ^ (r >> 30)) * 0xbf58476d1ce4e5b9;
        r = (r ^ (r >> 27)) * 0x94d049bb133111eb;
        return static_cast<double>((r ^ (r >> 31)) >> 11) * 0x1p-53;
    }
};

// The faces on the other sides of a face's edges. Corners belong together where they are at the same place.
class Neighbours {
public:
    explicit Neighbours(const RayCaster& caster) {
        for (int f = 0; f < caster.ntriangles(); f++)
            for (std::size_t i = 0; i < 3; i++)
                edges_.push_back({caster.triangle(f)[i], caster.triangle(f)[(i + 1) % 3], f});
        std::sort(edges_.begin(), edges_.end(), [](const Edge& a, const Edge& b) {
            const int order = compare(a, b);
            return order != 0 ? order < 0 : a.face < b.face;
        });
    }
    int across(const vec3& from, const vec3& to) const {  // the face that runs from `to` to `from`, -1 for none
        const Edge wanted{to, from, 0};
        const auto e = std::lower_bound(edges_.begin(), edges_.end(), wanted,
                                        [](const Edge& a, const Edge& b) { return compare(a, b) < 0; });
        return e != edges_.end() && compare(*e, wanted) == 0 ? e->face : -1;
    }

private:
    struct Edge {
        vec3 from, to;
        int face;
    };
    static int compare(const Edge& a, const Edge& b) {
        for (int i = 0; i < 6; i++) {
            const double left = i < 3 ? a.from[i] : a.to[i - 3], right = i < 3 ? b.from[i] : b.to[i - 3];
            if (left != right) return left < right ? -1 : 1;
        }
        return 0;
    }
    std::vector<Edge> edges_;
};

// Where a needle that starts on a face ends: on which face, and where on its plane.
struct NeedleEnd {
    int face;
    vec3 weight;
};

NeedleEnd walk(const RayCaster& caster, const Neighbours& neighbours, const LightFrame& light, int face,
               const vec2& start, const vec2& goal, const vec3& to_light) {
    NeedleEnd end{face, {}};
    int came_over = -1;
    // A straight line meets a convex face once: more steps than faces would be rounding's doing.
    for (int step = 0; step < caster.ntriangles(); step++) {
        const Triangle& t = caster.triangle(end.face);
        const vec2 p[3] = {light.seen(t[0]), light.seen(t[1]), light.seen(t[2])};
        int leave_over = -1;  // the edge that lies opposite to this corner
        double leave_at = std::numeric_limits<double>::infinity();
        for (int i = 0; i < 3; i++) {
            const vec2 &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
            end.weight[i] = area(a, b, goal);
            if (!(end.weight[i] < 0) || i == came_over) continue;
            const double before = std::max(area(a, b, start), 0.), at = before / (before - end.weight[i]);
            if (at < leave_at) leave_over = i, leave_at = at;
        }
        if (leave_over < 0) return end;
        const vec3 &a = t[static_cast<std::size_t>((leave_over + 1) % 3)],
                   &b = t[static_cast<std::size_t>((leave_over + 2) % 3)];
        const int next = neighbours.across(a, b);
        if (next < 0 || !caster.faces(next, to_light))
            return end;  // the surface ends: its plane goes on, as in a buffer
        end.face = next;
        came_over = 0;
        while (caster.triangle(next)[static_cast<std::size_t>((came_over + 1) % 3)] != b) came_over++;
    }
    return end;
}

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

Theory theory_of_exact_bias(const RayCaster& caster, const View& view, const vec3& to_light, const Texel& texel,
                            int needles, int threads) {
    const LightFrame light(to_light, view.up);
    const Neighbours neighbours(caster);
    const Count count = for_each_facing(caster, view, to_light, threads, [&](const Hit& hit, Random& random, Count& c) {
        const bool dark = caster.occluded(hit.triangle, hit.weight, to_light);
        const vec2 start = light.seen(hit.point);
        for (int i = 0; i < needles; i++) {
            const double x = (random() - .5) * texel.width, y = (random() - .5) * texel.height;
            const NeedleEnd end = walk(caster, neighbours, light, hit.triangle, start, start + vec2{x, y}, to_light);
            const bool crosses = caster.occluded(end.face, end.weight, to_light) != dark;
            c.crossings += crosses, c.net += crosses;
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
