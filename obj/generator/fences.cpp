// fences.cpp: a field with four fences, each twice as high as the one before it: how low may be what throws a shadow?
#include "textured.h"

Textured fences() {
    Textured out;
    const auto corner = [&](const vec3& place, const vec3& color) {
        out.mesh.verts.push_back(place);
        out.colors.push_back(color);
    };
    const auto quad = [&](int first, const std::array<int, 4>& c) {  // counter-clockwise
        for (const int k : {1, 2}) out.mesh.faces.push_back({first + c[0], first + c[k], first + c[k + 1]});
    };
    for (const auto& [x, z] : {vec2{-1, .8}, {1, .8}, {1, -.8}, {-1, -.8}}) corner({x, 0, z}, {.8, .8, .8});
    quad(0, {0, 1, 2, 3});
    constexpr double x[] = {-.85, -.55, -.1, .75}, height[] = {.015, .03, .06, .12}, thickness = .015, half = .7;
    for (int i = 0; i < 4; i++) {
        const int first = out.mesh.nverts();
        for (int k = 0; k < 8; k++)  // a bit for each axis
            corner({x[i] + (k & 1) * thickness, (k >> 1 & 1) * height[i], k & 4 ? half : -half}, {.2, .7, .25});
        for (const std::array<int, 4>& side : {std::array{4, 5, 7, 6}, {1, 0, 2, 3}, {5, 1, 3, 7}, {0, 4, 6, 2},
                                               {6, 7, 3, 2}, {0, 1, 5, 4}})
            quad(first, side);
    }
    return out;
}
