// scenes.h: models that tests write as text: polygons, and a small scene that has shadows on all sides.
#pragma once
#include "geometry.h"

#include <array>
#include <sstream>
#include <string>
#include <vector>

// Seventeen digits give the same double back.
inline std::string number(double x) {
    std::ostringstream out;
    out.precision(17);
    out << x;
    return out.str();
}
inline std::string triple(const vec3& v) { return number(v.x) + "," + number(v.y) + "," + number(v.z); }

class Obj {
public:
    int vertex(const vec3& v) {
        text_ << "v " << number(v.x) << ' ' << number(v.y) << ' ' << number(v.z) << '\n';
        return ++n_;
    }
    void polygon(const std::vector<vec3>& corners) {
        std::string line = "f";
        for (const vec3& v : corners) line += ' ' + std::to_string(vertex(v));
        text_ << line << '\n';
    }
    std::string text() const { return text_.str(); }

private:
    std::ostringstream text_;
    int n_ = 0;
};

// The six sides of a box, seen from outside, or from inside where LOW and HIGH are exchanged.
inline std::vector<std::array<vec3, 4>> box_sides(const vec3& low, const vec3& high) {
    const auto at = [&](int x, int y, int z) {
        return vec3{x ? high.x : low.x, y ? high.y : low.y, z ? high.z : low.z};
    };
    return {{at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)}, {at(1, 0, 0), at(0, 0, 0), at(0, 1, 0), at(1, 1, 0)},
            {at(1, 0, 1), at(1, 0, 0), at(1, 1, 0), at(1, 1, 1)}, {at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0)},
            {at(0, 1, 1), at(1, 1, 1), at(1, 1, 0), at(0, 1, 0)}, {at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)}};
}

// A floor, a wall and a floating block. All coordinates are multiples of 1/8, so that moving them by a whole number or
// multiplying them by a power of two is exact.
inline std::string yard(const vec3& scale = {1, 1, 1}, const vec3& by = {}) {
    Obj obj;
    const auto placed = [&](const vec3& v) { return vec3{v.x * scale.x, v.y * scale.y, v.z * scale.z} + by; };
    const auto box = [&](const vec3& low, const vec3& high) {
        for (const auto& [a, b, c, d] : box_sides(low, high))
            obj.polygon({placed(a), placed(b), placed(c), placed(d)});
    };
    box({-1, -.625, -1}, {1, -.5, 1});
    box({-.5, -.5, -.5}, {-.25, .5, .5});
    box({.125, 0, 0}, {.5, .25, .5});
    return obj.text();
}
inline std::string yard(double scale) { return yard(vec3{scale, scale, scale}); }
