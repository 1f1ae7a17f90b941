// idol.h: the idol as a formula: a signed distance, { p : idol(p) < 0 } is the solid, and what its surface looks like.
// All places are in the model's space, y up.
#pragma once
#include "geometry.h"

// Not exact, but zero on the surface, with a gradient of about one near it.
double idol(const vec3& p);

vec3 onto_surface(vec3 p);         // the point of the surface near p
vec3 idol_normal(const vec3& p);   // of the shape alone, smoothed over about the size of a triangle; unit
double importance(const vec3& p);  // how much an error of the mesh matters: most in the face, least below

struct Surface {
    vec3 normal, diffuse, glow;  // unit vector, with the relief that is too fine for triangles; colours in [0,1]
    double exponent = 0;         // of the highlight
};
Surface surface(const vec3& p);
