// formulas.h: the functions that shapes, colours and relief are made of. They know nothing of what is made of them.
// Beyond + - * / only sqrt, floor, fabs, min and max are used, all exactly rounded: every compiler gets the same bits.
#pragma once
#include <algorithm>

#include "geometry.h"

inline double clamp01(double x) { return std::clamp(x, 0., 1.); }
inline double mix(double a, double b, double t) { return a + (b - a) * t; }
inline vec3 mix(const vec3& a, const vec3& b, double t) { return a + (b - a) * t; }
double smoothstep(double lo, double hi, double x);  // from 0 at lo to 1 at hi; lo may be the larger

// A turn is the whole circle.
double sin_turns(double t);
double cos_turns(double t);
double atan_turns(double y, double x);  // the angle of (x,y), in [-1/2,1/2]

double hash01(int x, int y, int z);    // a number in [0,1) for every lattice point
double noise(const vec3& p);           // in about [-1,1], with continuous second derivatives: normals are taken from it
double fbm(vec3 p, int octaves);       // noise of halving size and height, summed
double cell_wall(const vec3& p);       // distance to the nearest wall between the cells of a jittered lattice: cracks

// x rounded to a multiple of 1/steps; never -0.
double rounded(double x, double steps);
vec3 rounded(const vec3& v, double steps);
