// truth.cpp: exact arithmetic, the meeting of a ray and a triangle, the bounding volume hierarchy, and what is made of
// them: the true picture of visibility and shadow.
#include "truth.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <tuple>

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double u = std::numeric_limits<double>::epsilon() / 2;  // the largest relative error of one operation

// A number as a sum of doubles whose digits do not overlap, the smallest first, so that sums and products of doubles
// have no rounding: Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates"
// (1997).
class Exact {
public:
    Exact(double value = 0) { add(value); }
    int sign() const { return parts_.empty() ? 0 : parts_.back() > 0 ? 1 : -1; }
    double rounded() const { return std::accumulate(parts_.begin(), parts_.end(), 0.); }
    friend Exact operator+(Exact a, const Exact& b) {
        for (const double part : b.parts_) a.add(part);
        return a;
    }
    friend Exact operator-(const Exact& a, const Exact& b) { return a + b * -1; }
    friend Exact operator*(const Exact& a, const Exact& b) {
        Exact product;
        for (const double x : a.parts_)
            for (const double y : b.parts_) {
                const double p = x * y;
                product.add(std::fma(x, y, -p));  // what p lost
                product.add(p);
            }
        return product;
    }

private:
    void add(double b) {  // Shewchuk's Grow-Expansion, zeros left out
        std::size_t kept = 0;
        for (const double part : parts_) {
            const double sum = b + part, of_part = sum - b;
            const double lost = (b - (sum - of_part)) + (part - of_part);
            if (lost != 0) parts_[kept++] = lost;
            b = sum;
        }
        parts_.resize(kept);
        if (b != 0) parts_.push_back(b);
    }

    std::vector<double> parts_;
};

using Exact3 = vec<3, Exact>;

Exact3 exact(const vec3& v) { return {v.x, v.y, v.z}; }

double largest(const vec3& v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); }

int sign(double x) { return (x > 0) - (x < 0); }

// The axis to which v is the least parallel, y before x before z.
vec3 least_axis(const vec3& v) {
    const vec3 a{std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)};
    return a.y <= a.x && a.y <= a.z ? vec3{0, 1, 0} : a.x <= a.z ? vec3{1, 0, 0} : vec3{0, 0, 1};
}

}  // namespace

void for_rows(int height, int threads, const std::function<void(int)>& body) {
    std::atomic<int> next{0};
    const auto work = [&] {
        for (int row = next++; row < height; row = next++) body(row);
    };
    std::vector<std::jthread> others;
    try {
        for (int i = 1; i < std::min(threads, height); i++) others.emplace_back(work);
    } catch (const std::system_error&) {
        // no more threads to be had: those that run do the work
    }
    work();
}

// The axes of a camera that looks along -z.
static std::array<vec3, 3> axes(const vec3& back, const vec3& up) {
    const vec3 z = normalized(back);
    vec3 x = normalized(cross(up, z));
    if (!(norm(x) > 0)) x = normalized(cross(least_axis(z), z));
    return {x, cross(z, x), z};
}

vec3 View::direction(int px, int py) const {
    const auto [x, y, z] = axes(eye - center, up);
    if (!(norm(x) > 0 && norm(y) > 0)) throw std::invalid_argument("a view without a direction");
    const double side = .75 * std::min(width, height) * zoom;
    return (center - eye) + x * ((2 * px + 1 - width) / side) + y * ((2 * py + 1 - height) / side);
}

// ---- a ray and a triangle ----

// A ray in the form that meets triangles fast. It starts on a triangle at a point given by weights, since that names a
// point of the surface exactly where its rounded coordinates do not; for a free origin all corners of that triangle are
// the origin.
//
// Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection" (2013): the scene is moved to put the start at the
// origin, and sheared to put the ray on an axis, the one where its direction has the largest component. The ray then
// meets a triangle where (0,0) is inside the triangle's projection.
struct RayCaster::Ray {
    Triangle start;
    vec3 weight, direction;
    vec3 offset;     // of the starting point from start[0]
    int kx, ky, kz;  // the axes after a cyclic permutation that makes kz the largest
    double shear_x, shear_y, per_z;
    double error;                                 // no sheared coordinate is off by more
    vec3 origin_low, origin_high, per_direction;  // for boxes: the origin minus and plus the slack

    Ray(const Triangle& from, const vec3& w, const vec3& d, const Node& scene) : start(from), weight(w), direction(d) {
        if (!(largest(d) > 0 && std::isfinite(largest(d)))) throw std::invalid_argument("a ray without a direction");
        const double sum = w.x + w.y + w.z;
        const vec3 edge1 = from[1] - from[0], edge2 = from[2] - from[0];
        offset = (edge1 * w.y + edge2 * w.z) / sum;

        kz = std::fabs(d.x) == largest(d) ? 0 : std::fabs(d.y) == largest(d) ? 1 : 2;
        kx = (kz + 1) % 3;
        ky = (kx + 1) % 3;
        shear_x = d[kx] / d[kz];
        shear_y = d[ky] / d[kz];
        per_z = 1 / d[kz];

        // Let E = max(|edge1|, |edge2|) in the largest component, s the share of the weights (|w1| + |w2|)/sum and
        // k = (|w0| + |w1| + |w2|)/sum, 1 inside the triangle. The offset is at most sE and off by 4u sE (edges,
        // products, sum, quotient) + 2uk sE (the sum of the weights) <= 6u ksE. Let m = ksE + the largest distance of a
        // vertex from start[0]. A moved vertex, at most m, is off by u m + 6u m + u m = 8u m. A sheared one, at most
        // 2m, is off by twice that, + 2u m (the shear and its product) + 2u m (the difference) = 20u m. What 32 has
        // more is enough for the terms in u^2.
        const double share = (std::fabs(w.y) + std::fabs(w.z)) / sum, k = share + std::fabs(w.x) / sum;
        const double reach = k * share * std::max(largest(edge1), largest(edge2));
        const double m = reach + std::max(largest(scene.high - from[0]), largest(scene.low - from[0]));
        error = 32 * u * m;

        // No box is missed by rounding if it grows by the error of the origin. `traverse` sees to the relative errors.
        const vec3 origin = from[0] + offset;
        const double slack = error + 4 * u * (largest(origin) + std::max(largest(scene.high), largest(scene.low)));
        for (int i = 0; i < 3; i++) {
            origin_low[i] = origin[i] - slack;
            origin_high[i] = origin[i] + slack;
            // Parallel to the slab the quotients must become large with the right sign, but never 0 * infinity.
            per_direction[i] = std::fabs(d[i]) > 1e-200 ? 1 / d[i] : 1e200;
        }
    }
};

// The corners of a triangle in the moved scene, times the sum of the weights, and what they span: without rounding.
struct RayCaster::ExactTriangle {
    Exact3 direction, corner[3];
    double sum;

    ExactTriangle(const Ray& ray, const Triangle& triangle)
        : direction(exact(ray.direction)), sum(ray.weight.x + ray.weight.y + ray.weight.z) {
        const Exact3 base = exact(ray.start[0]);
        for (int i = 0; i < 3; i++)
            corner[i] = (exact(triangle[i]) - base) * (Exact(ray.weight.x) + ray.weight.y + ray.weight.z) -
                        (exact(ray.start[1]) - base) * ray.weight.y - (exact(ray.start[2]) - base) * ray.weight.z;
    }
    // Opposite the corner i, the determinant with the direction: the area of the meeting, unsheared.
    Exact area(int i) const { return dot(direction, cross(corner[(i + 1) % 3], corner[(i + 2) % 3])); }
    // The determinant of the corners; the shear leaves it as it is.
    Exact volume() const { return dot(corner[0], cross(corner[1], corner[2])); }
};

// Where the line of a ray meets a triangle, if it does.
struct RayCaster::Meeting {
    bool in_front = false;    // it meets the triangle, at t > 0
    bool front_seen = false;  // by an eye that looks along the ray
    double t = 0, t_error = 0;
    vec3 weight;  // none negative; their sum is not 1

    Meeting(const Ray& ray, const Triangle& triangle) {
        vec3 x, y, z;
        double size = 0;
        for (int i = 0; i < 3; i++) {
            const vec3 moved = (triangle[i] - ray.start[0]) - ray.offset;
            z[i] = moved[ray.kz];
            x[i] = moved[ray.kx] - ray.shear_x * z[i];
            y[i] = moved[ray.ky] - ray.shear_y * z[i];
            size = std::max(size, std::fabs(x[i]) + std::fabs(y[i]));
        }
        // Twice the areas that (0,0) spans with the sides, with signs. The two products of one come to size^2 at most,
        // their factors are off by ray.error: together 2 error size + 2 error^2 + 2u size^2; and size <= 4m makes the
        // last of these less than error size / 4.
        vec3 area = cross(x, y);
        const double area_error = 3 * ray.error * (size + ray.error);
        const double lowest = std::min({area.x, area.y, area.z}), highest = std::max({area.x, area.y, area.z});
        if (lowest < -area_error && highest > area_error) return;
        if (lowest <= area_error && highest >= -area_error) {  // too close to call
            const ExactTriangle e(ray, triangle);
            for (int i = 0; i < 3; i++)  // exact but for the last step: the rounding of a value with the right sign
                if (std::fabs(area[i]) <= area_error) area[i] = e.area(i).rounded() * ray.per_z / (e.sum * e.sum);
            const bool left = area.x > 0 || area.y > 0 || area.z > 0, right = area.x < 0 || area.y < 0 || area.z < 0;
            if (left == right) return;  // outside; or all are 0: the triangle is seen edge-on or has no area
        }
        const double sum = area.x + area.y + area.z;
        weight = area * sign(sum);
        front_seen = sum * ray.per_z < 0;

        // t = volume / (sum * direction). Depths are off by less than ray.error and not beyond m, so the volume's own
        // rounding, at most 4u |sum| m, is well within the second error below.
        double volume = dot(area, z);
        const double volume_error = 3 * area_error * (largest(z) + ray.error) + 2 * std::fabs(sum) * ray.error;
        if (std::fabs(volume) <= volume_error) {
            const ExactTriangle e(ray, triangle);
            volume = e.volume().rounded() / (e.sum * e.sum * e.sum);
        }
        in_front = sign(volume) * sign(sum) * sign(ray.per_z) > 0;
        // The sum is off by 3 area_error and its own rounding, less than one more; the steps after it add 4u.
        t = volume / sum * ray.per_z;
        const double sum_certain = std::fabs(sum) - 4 * area_error;
        t_error = sum_certain > 0
                      ? (volume_error + std::fabs(volume / sum) * 4 * area_error) / sum_certain * std::fabs(ray.per_z) +
                            4 * u * std::fabs(t)
                      : infinity;
    }

    // Whether the ray meets the triangle a before (-1), together with (0) or after (1) the triangle b: the quotients
    // volume / sum of the areas compared by cross-multiplication.
    static int exact_order(const Ray& ray, const Triangle& a, const Triangle& b) {
        const ExactTriangle p(ray, a), q(ray, b);
        const Exact sum_p = p.area(0) + p.area(1) + p.area(2), sum_q = q.area(0) + q.area(1) + q.area(2);
        return (p.volume() * sum_q - q.volume() * sum_p).sign() * sum_p.sign() * sum_q.sign();
    }
};

// ---- the hierarchy ----

// Halves of as many triangles, so there are no more than 31 levels for 2^31 of them.
void RayCaster::build(int node, int begin, int end) {
    Node box{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}, begin, end - begin, 0};
    for (int i = begin; i < end; i++)
        for (const vec3& v : triangles_[order_[i]])
            for (int k = 0; k < 3; k++)
                box.low[k] = std::min(box.low[k], v[k]), box.high[k] = std::max(box.high[k], v[k]);
    const vec3 side = box.high - box.low;
    const int axis = box.axis = side.x == largest(side) ? 0 : side.y == largest(side) ? 1 : 2;
    nodes_[node] = box;
    if (end - begin <= 4) return;
    const int middle = begin + (end - begin) / 2, children = static_cast<int>(nodes_.size());
    const auto place = [&](int triangle) {
        const Triangle& t = triangles_[triangle];
        return t[0][axis] + t[1][axis] + t[2][axis];
    };
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](int a, int b) { return place(a) < place(b); });
    nodes_[node].first = children, nodes_[node].count = 0;
    nodes_.resize(nodes_.size() + 2);
    build(children, begin, middle);
    build(children + 1, middle, end);
}

// Calls visit(number) for every triangle whose box the ray meets within the limit, nearer boxes first. `visit` returns
// the new limit, below 0 to stop.
template <typename Visit>
void RayCaster::traverse(const Ray& ray, Visit visit) const {
    double limit = infinity;
    int stack[64] = {}, n = 1;
    while (n > 0) {
        const Node& node = nodes_[stack[--n]];
        double near = 0, far = limit;
        for (int i = 0; i < 3; i++) {
            const bool forward = ray.per_direction[i] > 0;
            const double in = forward ? node.low[i] - ray.origin_high[i] : node.high[i] - ray.origin_low[i];
            const double out = forward ? node.high[i] - ray.origin_low[i] : node.low[i] - ray.origin_high[i];
            near = std::max(near, in * ray.per_direction[i]);
            far = std::min(far, out * ray.per_direction[i]);
        }
        if (!(near <= far * (1 + 16 * u))) continue;  // each is off by 3u: difference, reciprocal, product
        for (int i = node.first; i < node.first + node.count; i++)
            if ((limit = visit(order_[i])) < 0) return;
        if (node.count > 0) continue;
        const int forward = ray.direction[node.axis] > 0;
        stack[n++] = node.first + forward;
        stack[n++] = node.first + 1 - forward;
    }
}

RayCaster::RayCaster(std::span<const Model> models)
    : RayCaster([&] {
          std::vector<Triangle> triangles;
          for (const Model& model : models)
              for (int face = 0; face < model.nfaces(); face++)
                  triangles.push_back({model.vert(face, 0), model.vert(face, 1), model.vert(face, 2)});
          return triangles;
      }()) {}

RayCaster::RayCaster(std::vector<Triangle> triangles) : triangles_(std::move(triangles)), order_(triangles_.size()) {
    for (const Triangle& triangle : triangles_)
        for (const vec3& v : triangle)
            if (!(std::fabs(v.x) <= 1e40 && std::fabs(v.y) <= 1e40 && std::fabs(v.z) <= 1e40))
                throw std::runtime_error("the truth is known up to 1e40, and a coordinate is not finite or beyond");
    std::iota(order_.begin(), order_.end(), 0);
    nodes_.resize(1);
    build(0, 0, ntriangles());
}

std::optional<Hit> RayCaster::first_hit(const vec3& origin, const vec3& direction) const {
    if (triangles_.empty()) return {};
    const Ray ray({origin, origin, origin}, {1, 0, 0}, direction, nodes_[0]);
    std::optional<Meeting> best;
    int nearest = -1;
    traverse(ray, [&](int number) {
        const Meeting meeting(ray, triangles_[number]);
        if (meeting.in_front) {
            bool nearer = !best || meeting.t < best->t;
            if (best && std::fabs(meeting.t - best->t) <= meeting.t_error + best->t_error)  // too close to call
                nearer = std::tuple(Meeting::exact_order(ray, triangles_[number], triangles_[nearest]),
                                    !meeting.front_seen, number) < std::tuple(0, !best->front_seen, nearest);
            if (nearer) best = meeting, nearest = number;
        }
        return best ? best->t + best->t_error : infinity;
    });
    if (!best) return {};
    const vec3 w = best->weight / (best->weight.x + best->weight.y + best->weight.z);
    const Triangle& v = triangles_[nearest];
    return Hit{nearest, best->t, v[0] * w.x + v[1] * w.y + v[2] * w.z, w};
}

// The own triangle would be found at t = 0, but only by exact arithmetic.
bool RayCaster::blocked(const Ray& ray, int own, double beyond, double until) const {
    bool found = false;
    traverse(ray, [&](int number) {
        if (number != own) {
            const Meeting meeting(ray, triangles_[number]);
            found = meeting.in_front && meeting.t > beyond && meeting.t < until;
        }
        return found ? -1 : infinity;
    });
    return found;
}

bool RayCaster::occluded(int triangle, const vec3& weight, const vec3& direction, double until) const {
    return blocked(Ray(triangles_[triangle], weight, direction, nodes_[0]), triangle, -infinity, until);
}

bool RayCaster::occluded(const vec3& origin, const vec3& direction, double beyond) const {
    if (triangles_.empty()) return false;
    return blocked(Ray({origin, origin, origin}, {1, 0, 0}, direction, nodes_[0]), -1, beyond, infinity);
}

bool RayCaster::faces(int number, const vec3& direction) const {
    const Triangle& v = triangle(number);
    // Exact at once: this is asked once a pixel, and a filter in doubles saves no time that could be measured.
    return dot(cross(exact(v[1]) - exact(v[0]), exact(v[2]) - exact(v[0])), exact(direction)).sign() > 0;
}

// ---- pictures ----

LightSource::LightSource(Kind k, const vec3& place, double degrees)
    : kind(k), at(place), tangent(std::tan(degrees * std::numbers::pi / 180)) {}

bool LightSource::reaches(const vec3& p, const View& view) const {
    const auto [x, y, z] = axes(at - view.center, view.up);
    const double right = dot(p - at, x), above = dot(p - at, y), edge = -dot(p - at, z) * tangent;
    if (kind == round_spot) return edge > 0 && right * right + above * above < edge * edge;
    return kind == far_off || std::max(std::fabs(right), std::fabs(above)) < edge;
}

TruthImage cast(const RayCaster& caster, const View& view, const LightSource& light, int threads) {
    // Refused is what would make every ray meaningless; what is left cannot throw in a thread.
    if (view.width < 1 || view.height < 1) throw std::invalid_argument("a picture without pixels");
    (void)view.direction(0, 0);
    const vec3 back = light.kind == LightSource::far_off ? light.at : light.at - view.center;
    if (!(largest(back) > 0 && std::isfinite(largest(back))))
        throw std::invalid_argument("a light without a direction");
    const std::size_t pixels = static_cast<std::size_t>(view.width) * view.height;
    TruthImage image{view.width, view.height, std::vector<Truth>(pixels, Truth::background),
                     std::vector<int>(pixels, -1)};
    for_rows(view.height, threads, [&](int y) {
        for (int x = 0; x < view.width; x++) {
            const auto hit = caster.first_hit(view.eye, view.direction(x, y));
            if (!hit) continue;
            const std::size_t i = static_cast<std::size_t>(y) * view.width + x;
            image.triangle[i] = hit->triangle;
            // A surface that the light lies on throws no shadow; the way to the light is rounded to a few 2^-53 of it.
            const bool is_far = light.kind == LightSource::far_off;
            const double until = is_far ? infinity : 1 - 0x1p-40;
            const bool reached = light.reaches(hit->point, view);
            const vec3 to_light = is_far ? light.at : light.at - hit->point;
            const bool dark = !reached && light.kind != LightSource::point;  // beside the beam
            const vec3 from_plane = is_far ? light.at : light.at - caster.triangle(hit->triangle)[0];
            image.pixel[i] = dark || !caster.faces(hit->triangle, from_plane) ? Truth::away
                             : reached && caster.occluded(hit->triangle, hit->weight, to_light, until) ? Truth::shadowed
                                                                                                       : Truth::lit;
        }
    });
    return image;
}
