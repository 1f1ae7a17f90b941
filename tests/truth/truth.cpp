// truth.cpp: exact arithmetic, the meeting of a ray and a triangle, the bounding volume hierarchy, and what is made of
// them: the true picture of visibility and shadow, and the figures that say how far a shadow method is from it.
#include "truth.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double u = std::numeric_limits<double>::epsilon() / 2;  // the largest relative error of one operation

// A number as a sum of doubles whose digits do not overlap, the smallest first, so that sums and products of doubles
// have no rounding: Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates"
// (1997).
class Exact {
public:
    Exact(double value = 0) {
        if (value != 0) parts_.push_back(value);
    }
    int sign() const { return parts_.empty() ? 0 : parts_.back() > 0 ? 1 : -1; }
    double rounded() const {
        double sum = 0;
        for (const double part : parts_) sum += part;
        return sum;
    }
    Exact& operator+=(const Exact& b) {
        for (const double part : b.parts_) add(part);
        return *this;
    }
    Exact& operator-=(const Exact& b) {
        for (const double part : b.parts_) add(-part);
        return *this;
    }
    friend Exact operator+(Exact a, const Exact& b) { return a += b; }
    friend Exact operator-(Exact a, const Exact& b) { return a -= b; }
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
    Exact& operator*=(const Exact& b) { return *this = *this * b; }

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

vec3 View::direction(int px, int py) const {
    const vec3 z = normalized(eye - center);
    vec3 x = normalized(cross(up, z));
    if (!(norm(x) > 0)) x = normalized(cross(least_axis(z), z));
    const vec3 y = cross(z, x);
    if (!(norm(x) > 0 && norm(y) > 0)) throw std::invalid_argument("a view without a direction");
    const double side = .75 * std::min(width, height);
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

        const vec3 a{std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)};
        kz = a.x > a.y ? (a.x > a.z ? 0 : 2) : (a.y > a.z ? 1 : 2);
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

    // A vertex in the moved scene, times the sum of the weights, without rounding.
    Exact3 moved(const vec3& v) const {
        const Exact3 base = exact(start[0]);
        return (exact(v) - base) * (Exact(weight.x) + weight.y + weight.z) - (exact(start[1]) - base) * weight.y -
               (exact(start[2]) - base) * weight.z;
    }
};

// Where the line of a ray meets a triangle, if it does.
struct RayCaster::Meeting {
    bool meets = false;
    bool in_front = false;    // t > 0
    bool front_seen = false;  // by an eye that looks along the ray
    double t = 0, t_error = 0;
    vec3 weight;  // none negative; their sum is not 1

    Meeting(const Ray& ray, const Triangle& triangle) {
        double x[3], y[3], z[3], size = 0, depth = 0;
        for (int i = 0; i < 3; i++) {
            const vec3 moved = (triangle[static_cast<std::size_t>(i)] - ray.start[0]) - ray.offset;
            z[i] = moved[ray.kz];
            x[i] = moved[ray.kx] - ray.shear_x * z[i];
            y[i] = moved[ray.ky] - ray.shear_y * z[i];
            size = std::max(size, std::fabs(x[i]) + std::fabs(y[i]));
            depth = std::max(depth, std::fabs(z[i]));
        }
        // Twice the areas that (0,0) spans with the sides, with signs. The two products of one come to size^2 at most,
        // their factors are off by ray.error: together 2 error size + 2 error^2 + 2u size^2; and size <= 4m makes the
        // last of these less than error size / 4.
        vec3 area{x[1] * y[2] - y[1] * x[2], x[2] * y[0] - y[2] * x[0], x[0] * y[1] - y[0] * x[1]};
        const double area_error = 3 * ray.error * (size + ray.error);
        const double lowest = std::min({area.x, area.y, area.z}), highest = std::max({area.x, area.y, area.z});
        if (lowest < -area_error && highest > area_error) return;
        if (lowest <= area_error && highest >= -area_error) {  // too close to call
            for (int i = 0; i < 3; i++)
                if (std::fabs(area[i]) <= area_error) area[i] = exact_area(ray, triangle, i);
            const bool left = area.x > 0 || area.y > 0 || area.z > 0, right = area.x < 0 || area.y < 0 || area.z < 0;
            if (left == right) return;  // outside; or all are 0: the triangle is seen edge-on or has no area
        }
        meets = true;
        const double sum = area.x + area.y + area.z;
        weight = area * sign(sum);
        front_seen = sum * ray.per_z < 0;

        // t = volume / (sum * direction). Depths are off by less than ray.error and not beyond m, so the volume's own
        // rounding, at most 4u |sum| m, is well within the second error below.
        double volume = area.x * z[0] + area.y * z[1] + area.z * z[2];
        const double volume_error = 3 * area_error * (depth + ray.error) + 2 * std::fabs(sum) * ray.error;
        if (std::fabs(volume) <= volume_error) volume = exact_volume(ray, triangle);
        in_front = sign(volume) * sign(sum) * sign(ray.per_z) > 0;
        // The sum is off by 3 area_error and its own rounding, less than one more; the steps after it add 4u.
        t = volume / sum * ray.per_z;
        const double sum_certain = std::fabs(sum) - 4 * area_error;
        t_error = sum_certain > 0
                      ? (volume_error + std::fabs(volume / sum) * 4 * area_error) / sum_certain * std::fabs(ray.per_z) +
                            4 * u * std::fabs(t)
                      : infinity;
    }

    // The area opposite the corner i. Unsheared it is the determinant with the direction, which is exact up to its last
    // step, the rounding of a value with the right sign.
    static double exact_area(const Ray& ray, const Triangle& triangle, int i) {
        const Exact3 a = ray.moved(triangle[static_cast<std::size_t>((i + 1) % 3)]);
        const Exact3 b = ray.moved(triangle[static_cast<std::size_t>((i + 2) % 3)]);
        const double sum = ray.weight.x + ray.weight.y + ray.weight.z;
        return dot(exact(ray.direction), cross(a, b)).rounded() * ray.per_z / (sum * sum);
    }

    // The determinant of the three corners, likewise; the shear leaves it as it is.
    static double exact_volume(const Ray& ray, const Triangle& triangle) {
        const Exact3 a = ray.moved(triangle[0]), b = ray.moved(triangle[1]), c = ray.moved(triangle[2]);
        const double sum = ray.weight.x + ray.weight.y + ray.weight.z;
        return dot(a, cross(b, c)).rounded() / (sum * sum * sum);
    }

    // Whether the ray meets the triangle a before (-1), together with (0) or after (1) the triangle b: the quotients
    // volume / sum compared by cross-multiplication.
    static int exact_order(const Ray& ray, const Triangle& a, const Triangle& b) {
        const auto quotient = [&](const Triangle& triangle) {
            const Exact3 p = ray.moved(triangle[0]), q = ray.moved(triangle[1]), r = ray.moved(triangle[2]);
            return std::pair{dot(p, cross(q, r)), dot(exact(ray.direction), cross(q - p, r - p))};
        };
        const auto [volume_a, sum_a] = quotient(a);
        const auto [volume_b, sum_b] = quotient(b);
        return (volume_a * sum_b - volume_b * sum_a).sign() * sum_a.sign() * sum_b.sign();
    }
};

// ---- the hierarchy ----

// Splits by the surface area heuristic: a ray meets a box inside another with the probability of the quotient of their
// surfaces, so a split is as good as the sum of surface times triangles on both sides is small (MacDonald, Booth 1990).
struct RayCaster::Builder {
    static constexpr int nbins = 16, leaf_size = 4;
    static constexpr int heuristic_depth = 40;  // from here on in halves: no more than 31 levels for 2^31 triangles
    static constexpr int max_depth = heuristic_depth + 32;

    struct Box {
        vec3 low{infinity, infinity, infinity}, high{-infinity, -infinity, -infinity};
        void add(const vec3& p) {
            low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
            high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
        }
        void add(const Box& b) {
            add(b.low);
            add(b.high);
        }
        double half_surface() const {
            const vec3 d = high - low;
            return d.x * d.y + d.y * d.z + d.z * d.x;
        }
    };
    struct Item {
        Box box;
        vec3 centre;
        int number;
    };
    struct Split {
        int axis = -1;
        double at = 0, cost = infinity;
    };

    std::vector<Item> items;
    std::vector<Node>& nodes;

    Builder(const std::vector<Triangle>& triangles, std::vector<Node>& out) : nodes(out) {
        items.reserve(triangles.size());
        for (const Triangle& triangle : triangles) {
            Item item{{}, {}, static_cast<int>(items.size())};
            for (const vec3& v : triangle) item.box.add(v);
            item.centre = item.box.low * .5 + item.box.high * .5;
            items.push_back(item);
        }
        nodes.reserve(triangles.size());
        nodes.emplace_back();
        build(0, 0, static_cast<int>(items.size()), 0);
    }

    Item* at(int i) { return items.data() + i; }

    Split best_split(int begin, int end, const Box& centres) {
        Split best;
        for (int axis = 0; axis < 3; axis++) {
            const double low = centres.low[axis], width = centres.high[axis] - low;
            if (!(width > 0)) continue;
            Box boxes[nbins], right_boxes[nbins];
            int counts[nbins] = {};
            for (const Item* item = at(begin); item != at(end); item++) {
                const int bin = std::min(nbins - 1, static_cast<int>((item->centre[axis] - low) / width * nbins));
                boxes[bin].add(item->box);
                counts[bin]++;
            }
            right_boxes[nbins - 1] = boxes[nbins - 1];
            for (int i = nbins - 2; i > 0; i--) {
                right_boxes[i] = right_boxes[i + 1];
                right_boxes[i].add(boxes[i]);
            }
            Box left;
            for (int i = 1, n = 0; i < nbins; i++) {
                left.add(boxes[i - 1]);
                n += counts[i - 1];
                if (n == 0 || n == end - begin) continue;
                const double cost = left.half_surface() * n + right_boxes[i].half_surface() * (end - begin - n);
                if (cost < best.cost) best = {axis, low + width * i / nbins, cost};
            }
        }
        return best;
    }

    void build(int node, int begin, int end, int depth) {
        Box box, centres;
        for (const Item* item = at(begin); item != at(end); item++) {
            box.add(item->box);
            centres.add(item->centre);
        }
        nodes[static_cast<std::size_t>(node)] = {box.low, box.high, begin, end - begin};
        if (end - begin <= leaf_size) return;

        Item* middle = at(begin);
        if (depth < heuristic_depth) {
            const Split split = best_split(begin, end, centres);
            if (split.axis >= 0)
                middle =
                    std::partition(at(begin), at(end), [&](const Item& i) { return i.centre[split.axis] < split.at; });
        }
        if (middle == at(begin) || middle == at(end)) middle = at(begin + (end - begin) / 2);

        const int children = static_cast<int>(nodes.size());
        nodes.resize(nodes.size() + 2);
        nodes[static_cast<std::size_t>(node)].first = children;
        nodes[static_cast<std::size_t>(node)].count = 0;
        const int cut = static_cast<int>(middle - at(0));
        build(children, begin, cut, depth + 1);
        build(children + 1, cut, end, depth + 1);
    }
};

// Calls visit(position) for every triangle whose box the ray meets within the limit, nearer boxes first. `visit`
// returns the new limit, below 0 to stop.
template <typename Visit>
void RayCaster::traverse(const Ray& ray, Visit visit) const {
    double limit = infinity;
    const auto entry = [&](const Node& node) {  // infinity for a box that is missed
        double near = 0, far = infinity;
        for (int i = 0; i < 3; i++) {
            const bool forward = ray.per_direction[i] > 0;
            const double in = forward ? node.low[i] - ray.origin_high[i] : node.high[i] - ray.origin_low[i];
            const double out = forward ? node.high[i] - ray.origin_low[i] : node.low[i] - ray.origin_high[i];
            near = std::max(near, in * ray.per_direction[i]);
            far = std::min(far, out * ray.per_direction[i]);
        }
        return near <= far * (1 + 16 * u) ? near : infinity;  // each is off by 3u: difference, reciprocal, product
    };
    struct Waiting {
        int node;
        double near;
    };
    std::array<Waiting, Builder::max_depth + 2> stack;
    std::size_t n = 0;
    const auto push = [&](int node, double near) {
        if (near < infinity) stack[n++] = {node, near};
    };
    push(0, entry(nodes_[0]));
    while (n > 0) {
        const Waiting next = stack[--n];
        if (next.near > limit * (1 + 16 * u)) continue;
        const Node& node = nodes_[static_cast<std::size_t>(next.node)];
        for (int i = node.first; i < node.first + node.count; i++)
            if ((limit = visit(i)) < 0) return;
        if (node.count > 0) continue;
        const double near0 = entry(nodes_[static_cast<std::size_t>(node.first)]);
        const double near1 = entry(nodes_[static_cast<std::size_t>(node.first) + 1]);
        if (near0 > near1) {
            push(node.first, near0);
            push(node.first + 1, near1);
        } else {
            push(node.first + 1, near1);
            push(node.first, near0);
        }
    }
}

namespace {

std::vector<Triangle> triangles_of(std::span<const Model> models) {
    std::vector<Triangle> triangles;
    for (const Model& model : models)
        for (int face = 0; face < model.nfaces(); face++)
            triangles.push_back({model.vert(face, 0), model.vert(face, 1), model.vert(face, 2)});
    return triangles;
}

}  // namespace

RayCaster::RayCaster(std::span<const Model> models) : RayCaster(triangles_of(models)) {}

RayCaster::RayCaster(std::vector<Triangle> triangles) {
    for (const Triangle& triangle : triangles)
        for (const vec3& v : triangle)
            for (int i = 0; i < 3; i++)
                if (!(std::fabs(v[i]) <= 1e40))
                    throw std::runtime_error("the truth is known up to 1e40, and a coordinate is not finite or beyond");
    if (triangles.empty()) return;
    const Builder builder(triangles, nodes_);
    position_.resize(triangles.size());
    for (const auto& item : builder.items) {
        position_[static_cast<std::size_t>(item.number)] = static_cast<int>(triangles_.size());
        number_.push_back(item.number);
        triangles_.push_back(triangles[static_cast<std::size_t>(item.number)]);
    }
}

std::optional<Hit> RayCaster::first_hit(const vec3& origin, const vec3& direction) const {
    if (nodes_.empty()) return {};
    const Ray ray({origin, origin, origin}, {1, 0, 0}, direction, nodes_[0]);
    std::optional<Meeting> best;
    int best_position = -1;
    traverse(ray, [&](int position) {
        const Triangle& triangle = triangles_[static_cast<std::size_t>(position)];
        const Meeting meeting(ray, triangle);
        if (meeting.meets && meeting.in_front) {
            bool nearer = !best || meeting.t < best->t;
            if (best && std::fabs(meeting.t - best->t) <= meeting.t_error + best->t_error) {  // too close to call
                const int order =
                    Meeting::exact_order(ray, triangle, triangles_[static_cast<std::size_t>(best_position)]);
                if (order != 0) nearer = order < 0;
                else if (meeting.front_seen != best->front_seen) nearer = meeting.front_seen;
                else
                    nearer =
                        number_[static_cast<std::size_t>(position)] < number_[static_cast<std::size_t>(best_position)];
            }
            if (nearer) {
                best = meeting;
                best_position = position;
            }
        }
        return best ? best->t + best->t_error : infinity;
    });
    if (!best) return {};
    const vec3 w = best->weight / (best->weight.x + best->weight.y + best->weight.z);
    const Triangle& v = triangles_[static_cast<std::size_t>(best_position)];
    return Hit{number_[static_cast<std::size_t>(best_position)], best->t, v[0] * w.x + v[1] * w.y + v[2] * w.z, w};
}

bool RayCaster::occluded(int triangle, const vec3& weight, const vec3& direction) const {
    const int own = position_[static_cast<std::size_t>(triangle)];
    const Ray ray(triangles_[static_cast<std::size_t>(own)], weight, direction, nodes_[0]);
    bool found = false;
    traverse(ray, [&](int position) {
        if (position != own) {  // it would be found at t = 0, but only by exact arithmetic
            const Meeting meeting(ray, triangles_[static_cast<std::size_t>(position)]);
            found = meeting.meets && meeting.in_front;
        }
        return found ? -1 : infinity;
    });
    return found;
}

bool RayCaster::occluded(const vec3& origin, const vec3& direction, double beyond) const {
    if (nodes_.empty()) return false;
    const Ray ray({origin, origin, origin}, {1, 0, 0}, direction, nodes_[0]);
    bool found = false;
    traverse(ray, [&](int position) {
        const Meeting meeting(ray, triangles_[static_cast<std::size_t>(position)]);
        found = meeting.meets && meeting.in_front && meeting.t > beyond;
        return found ? -1 : infinity;
    });
    return found;
}

bool RayCaster::faces(int number, const vec3& direction) const {
    const Triangle& v = triangle(number);
    const vec3 a = v[1] - v[0], b = v[2] - v[0];
    const double volume = dot(cross(a, b), direction);
    // Six products of three factors, each with at most 7 roundings on its way.
    const double error = 64 * u * largest(a) * largest(b) * largest(direction);
    if (std::fabs(volume) > error) return volume > 0;
    return dot(cross(exact(v[1]) - exact(v[0]), exact(v[2]) - exact(v[0])), exact(direction)).sign() > 0;
}

// ---- pictures and figures ----

namespace {

// Refuses what would make every ray meaningless; what is left cannot throw in a thread.
void check_view(const View& view, const vec3& to_light) {
    if (view.width < 1 || view.height < 1) throw std::invalid_argument("a picture without pixels");
    (void)view.direction(0, 0);
    if (!(largest(to_light) > 0 && std::isfinite(largest(to_light))))
        throw std::invalid_argument("a light without a direction");
}

}  // namespace

TruthImage cast(const RayCaster& caster, const View& view, const vec3& to_light, int threads) {
    check_view(view, to_light);
    const std::size_t width = static_cast<std::size_t>(view.width), height = static_cast<std::size_t>(view.height);
    TruthImage image{view.width, view.height, std::vector<Truth>(width * height, Truth::background),
                     std::vector<int>(width * height, -1)};
    for_rows(view.height, threads, [&](int y) {
        for (int x = 0; x < view.width; x++) {
            const auto hit = caster.first_hit(view.eye, view.direction(x, y));
            if (!hit) continue;
            const std::size_t i = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
            image.triangle[i] = hit->triangle;
            image.pixel[i] = !caster.faces(hit->triangle, to_light)                  ? Truth::away
                             : caster.occluded(hit->triangle, hit->weight, to_light) ? Truth::shadowed
                                                                                     : Truth::lit;
        }
    });
    return image;
}
