// textured.h: a mesh with texture coordinates, and its maps: what is written to the files.
#pragma once
#include "mesh.h"
#include "tgaimage.h"

using Corners = std::array<vec2, 3>;  // of a triangle in the texture

struct Textured {  // a mesh as the renderer will read it back, rounded to the decimals that the file has
    Mesh mesh;
    std::vector<vec3> normals;
    std::vector<vec3> colors;  // of the vertices, red first, in [0,1]; or none
    std::vector<vec2> uvs;
    std::vector<Face> uv_of, normal_of;  // indices, three a face

    Corners uv(int f) const { return {uvs[uv_of[f][0]], uvs[uv_of[f][1]], uvs[uv_of[f][2]]}; }
};

struct Maps {  // empty: there is no such map
    TGAImage diffuse, normal, tangent, specular, glow;
};

TGAColor colour(const vec3& rgb);          // of values in [0,1]
TGAColor encoded(const vec3& normal);      // from [-1,1]
TGAColor grey(double value);               // 0 to 255

// Texture coordinates for the idol's mesh, at one scale everywhere: texels per unit of length, or what fits into size^2
// texels.
Textured unwrap(Mesh m, int size, double scale);
Maps bake_idol(const Textured& t, int size);

Textured floor_slab();
Maps bake_floor(int size);
Textured knot();
Textured fences();
Textured sky_dome();
Maps bake_sky(int width, int height);

// Twice the area from a to b, counter-clockwise.
inline double cross(const vec2& a, const vec2& b) { return a.x * b.y - a.y * b.x; }

// Calls visit(x,y) for the texels whose centres are in the triangle or within MARGIN texels of it.
template <typename F>
void cover(const Corners& t, double margin, const F& visit) {
    double lo[2], hi[2];
    for (int k = 0; k < 2; k++) {
        lo[k] = std::floor(std::min({t[0][k], t[1][k], t[2][k]}) - margin);
        hi[k] = std::ceil(std::max({t[0][k], t[1][k], t[2][k]}) + margin);
    }
    const double sign = cross(t[1] - t[0], t[2] - t[0]) < 0 ? -1 : 1;
    for (int y = static_cast<int>(lo[1]); y < static_cast<int>(hi[1]); y++)
        for (int x = static_cast<int>(lo[0]); x < static_cast<int>(hi[0]); x++) {
            bool inside = true;
            for (int k = 0; k < 3 && inside; k++) {
                const vec2 a = t[k], e = t[(k + 1) % 3] - a, q = vec2{x + .5, y + .5} - a;
                inside = sign * cross(e, q) >= -margin * norm(e);
            }
            if (inside) visit(x, y);
        }
}
