// random.h: numbers that are the same in every run, with every standard library: its distributions are not.
#pragma once
#include "geometry.h"

#include <random>

struct Random {
    std::mt19937 rng;
    explicit Random(unsigned seed) : rng(seed) {}
    double in(double a, double b) { return a + (b - a) * (static_cast<double>(rng()) / 4294967295.); }
    int below(int n) { return static_cast<int>(rng() % static_cast<unsigned>(n)); }
    vec3 point(double r) { return {in(-r, r), in(-r, r), in(-r, r)}; }  // in [-r,r]^3
};
