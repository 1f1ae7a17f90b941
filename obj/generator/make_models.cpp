// make_models.cpp: the program that makes every model and texture of this folder out of formulas. It is not part of the
// renderer and not of the default build; its output is committed. The bytes are the same from every compiler, at any
// number of threads.
//
//     make_models FOLDER    writes FOLDER/idol, FOLDER/floor and so on
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "textured.h"

namespace {

// Throws std::runtime_error if the mesh leaves [-1,1]^3 or a file cannot be written.
void write(const std::filesystem::path& folder, const std::string& name, const std::string& title, const Textured& t,
           const Maps& maps) {
    const std::filesystem::path stem = folder / name / name, path = stem.string() + ".obj";
    std::string text = "# " + title + ", made by make_models.cpp\n";
    const auto add = [&](const char* format, auto... numbers) {
        char line[160];
        std::snprintf(line, sizeof line, format, numbers...);
        text += line;
    };
    for (int i = 0; i < t.mesh.nverts(); i++) {
        const vec3& v = t.mesh.verts[i];
        for (int k = 0; k < 3; k++)
            if (!(std::fabs(v[k]) <= 1)) throw std::runtime_error(path.string() + ": a vertex outside [-1,1]^3");
        add("v %.5f %.5f %.5f", v.x, v.y, v.z);
        if (!t.colors.empty()) add(" %.2f %.2f %.2f", t.colors[i].x, t.colors[i].y, t.colors[i].z);
        text += "\n";
    }
    for (const vec2& v : t.uvs) add("vt %.5f %.5f\n", v.x, v.y);
    for (const vec3& v : t.normals) add("vn %.4f %.4f %.4f\n", v.x, v.y, v.z);
    for (int f = 0; f < t.mesh.nfaces(); f++) {
        text += "f";
        for (int k = 0; k < 3; k++)
            if (t.uvs.empty()) add(" %d", t.mesh.faces[f][k] + 1);
            else add(" %d/%d/%d", t.mesh.faces[f][k] + 1, t.uv_of[f][k] + 1, t.normal_of[f][k] + 1);
        text += "\n";
    }
    std::filesystem::create_directories(folder / name);
    std::ofstream file(path, std::ios::binary);
    if (!(file << text << std::flush)) throw std::runtime_error(path.string() + ": cannot write");
    std::printf("%s.obj: %d triangles, %d vertices\n", name.c_str(), t.mesh.nfaces(), t.mesh.nverts());

    const auto write_map = [&](const TGAImage& image, const char* suffix) {
        if (!image.empty()) image.write_tga_file(stem.string() + suffix);
    };
    write_map(maps.diffuse, "_diffuse.tga");
    write_map(maps.normal, "_nm.tga");
    write_map(maps.tangent, "_nm_tangent.tga");
    write_map(maps.specular, "_spec.tga");
    write_map(maps.glow, "_glow.tga");
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc != 2) {
        std::fprintf(stderr, "usage: make_models FOLDER\n");
        return 2;
    }
    const Mesh net = surface_net(176);
    // 300 texels per unit: a texel is as large as a pixel of the default picture
    const Textured idol = unwrap(simplify(net, 16000), 1024, 300), slab = floor_slab(), tube = knot();
    check_closed(idol.mesh, "idol", 2);
    check_closed(slab.mesh, "floor", 2);
    check_closed(tube.mesh, "knot", 0);
    write(argv[1], "idol", "The idol: a horned bust", idol, bake_idol(idol, 1024));
    write(argv[1], "floor", "The floor: a slab of flagstones", slab, bake_floor(512));
    write(argv[1], "sky", "The sky: a dome above the clouds", sky_dome(), bake_sky(1024, 512));
    write(argv[1], "knot", "The knot: a tube along the torus knot (2,3)", tube, {});
    write(argv[1], "fences", "The fences: four of them, on a field", fences(), {});
} catch (const std::exception& error) {
    std::fprintf(stderr, "make_models: %s\n", error.what());
    return 1;
}
