// truth.h: what a picture should show, found by casting rays: the measure that every shadow method is held against.
// It is slow, exact and shares nothing with the renderer but the vectors and the loader; it does not shade.
//
// Every decision (does the ray meet the triangle, which of two is nearer, is the occluder in front of the surface) is
// the sign of a polynomial in the given doubles, and each sign is the exact one: computed in double where the rounding
// error is provably too small to matter, else without rounding. So there is no epsilon: no gap along a shared edge, no
// surface that shadows itself at grazing light, no light through a crease. That holds as long as nothing over- or
// underflows: for coordinates that are 0 or from 1e-30 to 1e40 in magnitude.
#pragma once
#include "geometry.h"
#include "model.h"

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

using Triangle = std::array<vec3, 3>;  // counter-clockwise where its front is seen

// The lesson's camera. With z = (eye-center)/|eye-center|, x = up cross z, y = z cross x (all of unit length) the point
// center + X*x + Y*y is seen at (X,Y), and the square [-1,1]^2 covers the middle three quarters of the shorter side.
// Where up is zero or parallel to the view, the axis least parallel to the view takes its place.
struct View {
    vec3 eye{1, 1, 4}, center{}, up{0, 1, 0};
    int width = 800, height = 800;
    double zoom = 1;

    // From the eye through the centre of the pixel (px,py), (0,0) at the bottom left; its length takes it to the plane
    // through `center`. Throws std::invalid_argument where eye = center.
    vec3 direction(int px, int py) const;
};

struct Hit {
    int triangle;  // counted over the faces of all models, in their order
    double t;      // hit = origin + t * direction, t > 0
    vec3 point;
    vec3 weight;  // barycentric coordinates of the hit, none negative, their sum 1 up to rounding
};

class RayCaster {
public:
    // Copies the triangles and sorts them into a bounding volume hierarchy.
    // Throws std::runtime_error for a coordinate that is not finite or beyond 1e40.
    explicit RayCaster(std::span<const Model> models);
    explicit RayCaster(std::vector<Triangle> triangles);

    int ntriangles() const { return static_cast<int>(triangles_.size()); }
    const Triangle& triangle(int number) const { return triangles_[number]; }

    // The nearest triangle in front of the origin, seen from either side; its edges and corners belong to it, and one
    // that is seen edge-on is not there. Of several at exactly the same distance the one whose front is seen, then the
    // one with the smaller number.
    std::optional<Hit> first_hit(const vec3& origin, const vec3& direction) const;

    // Whether anything but the triangle itself lies in front (0 < t < until) of its point (w0*v0 + w1*v1 + w2*v2)/
    // (w0+w1+w2) in the direction. The weights need a positive sum; the point may lie outside the triangle, in its
    // plane. Where until is finite t is a rounded number.
    bool occluded(int triangle, const vec3& weight, const vec3& direction, double until = INFINITY) const;

    // Whether anything lies in front of a free point with beyond < t: what a comparison of depths with a bias decides.
    // Only here is t a rounded number.
    bool occluded(const vec3& origin, const vec3& direction, double beyond) const;

    // Whether the front of the triangle faces the direction: normal . direction > 0.
    bool faces(int triangle, const vec3& direction) const;

private:
    struct Node {  // a leaf holds the triangles order_[first, first+count), an inner node the nodes first and first+1
        vec3 low, high;
        int first, count, axis;  // count is 0 for an inner node; its first has the smaller coordinates along the axis
    };
    struct Ray;
    struct ExactTriangle;
    struct Meeting;

    void build(int node, int begin, int end);
    template <typename Visit>
    void traverse(const Ray& ray, Visit visit) const;
    bool blocked(const Ray& ray, int own, double beyond, double until) const;

    std::vector<Triangle> triangles_;
    std::vector<int> order_;   // their numbers, leaf after leaf
    std::vector<Node> nodes_;  // the root first
};

enum class Truth : std::uint8_t {
    background,  // no surface
    away,        // the front of the visible triangle does not face the light
    shadowed,    // it does, and something stands between
    lit
};

struct TruthImage {
    int width = 0, height = 0;
    std::vector<Truth> pixel;   // row 0 at the bottom
    std::vector<int> triangle;  // the visible one, -1 for none
};

// A light far off in a direction, of any length; or one at a place, that looks at the view's center. Outside of a spot
// light's beam all is `away`; outside of the square pyramid that a point light's shadows come from all is lit.
struct LightSource {
    enum Kind { far_off, round_spot, square_spot, point } kind;
    vec3 at;
    double tangent = 0;  // of the half angle
    LightSource(const vec3& to_light) : kind(far_off), at(to_light) {}
    LightSource(Kind k, const vec3& place, double degrees);
    bool reaches(const vec3& p, const View& view) const;  // whether p is within the beam or the pyramid
};

// What is visible at each pixel's centre, and whether that point of the surface sees the light. The result does not
// depend on the number of threads.
TruthImage cast(const RayCaster& caster, const View& view, const LightSource& light, int threads = 1);

// Calls body(row) for the rows [0,height), on several threads.
void for_rows(int height, int threads, const std::function<void(int)>& body);
