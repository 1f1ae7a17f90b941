// knot.cpp: a tube along a (2,3) torus knot.
#include "formulas.h"
#include "textured.h"

Textured knot() {
    constexpr int along = 240, around = 18, p = 2, q = 3;
    constexpr double major = .61, minor = .24, tube = .135;
    Textured out;
    const auto curve = [](double t) {
        const double r = major + minor * cos_turns(q * t);
        return vec3{r * cos_turns(p * t), r * sin_turns(p * t), minor * sin_turns(q * t)};
    };
    for (int i = 0; i < along; i++) {
        const double t = 1. * i / along;
        const vec3 c = curve(t), tangent = normalized(curve(t + 1e-3) - curve(t - 1e-3));
        const double cos_q = cos_turns(q * t);
        const vec3 outward{cos_turns(p * t) * cos_q, sin_turns(p * t) * cos_q, sin_turns(q * t)};  // from the torus
        const vec3 b = normalized(cross(tangent, outward)), a = cross(b, tangent);
        for (int k = 0; k < around; k++) {
            const double s = 1. * k / around;
            out.mesh.verts.push_back(rounded(c + (a * cos_turns(s) + b * sin_turns(s)) * tube, 1e5));
        }
    }
    for (int i = 0; i < along; i++)
        for (int k = 0; k < around; k++) {
            const auto v = [&](int di, int dk) { return (i + di) % along * around + (k + dk) % around; };
            out.mesh.faces.push_back({v(0, 0), v(1, 1), v(1, 0)});
            out.mesh.faces.push_back({v(0, 0), v(0, 1), v(1, 1)});
        }
    return out;
}
