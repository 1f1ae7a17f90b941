// mesh.h: triangles that enclose a solid.
#pragma once
#include <algorithm>
#include <array>
#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "geometry.h"

using Face = std::array<int, 3>;

struct Mesh {
    std::vector<vec3> verts;
    std::vector<Face> faces;  // counter-clockwise seen from outside

    int nverts() const { return static_cast<int>(verts.size()); }
    int nfaces() const { return static_cast<int>(faces.size()); }
    vec3 area_vector(const Face& f) const {  // along the outward normal, twice the area long
        return cross(verts[f[1]] - verts[f[0]], verts[f[2]] - verts[f[0]]);
    }
};

// Throws std::runtime_error unless every edge is shared by exactly two faces that run along it in opposite directions,
// every vertex has one fan of faces around it, no face is degenerate, the volume is positive and the Euler
// characteristic is as expected.
void check_closed(const Mesh& m, const std::string& name, int euler);

Mesh surface_net(int n);             // the idol's surface, by a grid of n^3 cells over [-1,1]^3
Mesh simplify(Mesh m, int nfaces);   // the same with fewer faces, where they matter least for the idol

// Runs work(i) for 0 <= i < n on all cores. The calls must not depend on each other.
template <typename F>
void parallel(int n, const F& work) {
    std::atomic<int> next{0};
    std::vector<std::jthread> threads;
    for (unsigned k = 0; k < std::max(1u, std::thread::hardware_concurrency()); k++)
        threads.emplace_back([&] {
            for (int i; (i = next++) < n;) work(i);
        });
}
