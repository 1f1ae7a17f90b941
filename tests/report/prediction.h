// prediction.h: what theory says of a shadow buffer's error, before a buffer is drawn: the length of the shadow's
// boundary, by needles, times the size of the texels. It knows the ray caster and the shape of a texel, and no shadow
// method's code.
//
// A buffer judges a point by a sample beside it. Where the boundary of the shadow passes between the two, the verdict
// is wrong. So the error is the probability that a needle from a point to its sample crosses the boundary; the needle
// is uniform over the texel, and by Crofton's formula its crossings measure the boundary's length L. With A the area
// that faces the light, both as the light sees them, and m the needle's mean length,
//     share of wrong pixels = floor + 2/pi * m * L/A,
// where 2/pi is the mean of |cos| between needle and boundary, and the floor is what a bias makes wrong by itself. The
// boundary is that of the shadow which the bias leaves; a needle that puts a wrong pixel right counts -1.
#pragma once
#include <functional>
#include <numbers>

#include "truth.h"

// 2/pi * m for square texels of side 1 that are read at their centres; read at a corner, it is twice that.
inline constexpr double nearest_texel_error = 0.2435693614160477;  // (sqrt(2) + ln(1 + sqrt(2))) / (3 pi)

// A texel of the light's picture, as the light sees it, in the scene's unit; x and y are those of lookat().
struct Texel {
    double width, height;
};

// The mean distance of the points of a texel from its centre: the integral over a quarter of it, by hand.
double mean_distance(const Texel& texel);

struct Theory {
    double floor = 0;              // share of the facing pixels that is wrong with the finest buffer
    double mean_needle = 0;        // m, in the scene's unit
    double boundary_per_area = 0;  // L/A, in one over the scene's unit
    double deviation = 0;          // of L/A as it was estimated, if crossings were independent

    // The share of the facing pixels that is wrong.
    double wrong() const { return floor + 2 / std::numbers::pi * mean_needle * boundary_per_area; }
    // The same boundary under texels larger by a factor.
    Theory with_texels(double factor) const { return {floor, mean_needle * factor, boundary_per_area, deviation}; }
};

// The theory of one scene. What it returns does not depend on the number of threads.
class Theorist {
public:
    Theorist(RayCaster caster, const View& view, const vec3& to_light, int threads);

    // Of a buffer of size x size texels that all triangles just fit into.
    Texel fitted_texel(int size) const { return {(high_.x - low_.x) / size, (high_.y - low_.y) / size}; }

    // A bias derived from the slopes: a point's plane is carried to the sample, the texel's centre; what is above it
    // there may be lower by what the nearest surface falls within a texel (along each axis the smaller of the two
    // differences, half of it on a ridge). The floor is what that leaks where sample and point are the same. It and the
    // boundary depend on the texel: a shadow's coast has more creeks the finer it is looked at.
    Theory derived_bias(const Texel& texel, int needles = 3) const;

    // A constant bias, in the scene's unit; samples at the texels' corners with the smallest x and y, as an index cut
    // to an integer finds them. The bias smooths the coast away, so one texel stands for all; it must be smaller than
    // the bias over a surface's slope, or that is taken for its own shadow.
    Theory constant_bias(double bias, const Texel& texel, int needles = 3) const;

private:
    vec2 seen(const vec3& p) const { return {dot(p, x_), dot(p, y_)}; }
    Theory theory(const Texel& texel, bool at_corner, int needles,
                  const std::function<bool(const Hit&, const vec2& needle)>& dark) const;

    RayCaster caster_;
    View view_;
    vec3 to_light_;
    int threads_;
    vec3 x_, y_, z_;   // the scene as the light sees it; unit, z towards the light
    vec2 low_, high_;  // what all triangles are within, along x and y
    double size_ = 0;  // of the scene: more than any height
};
