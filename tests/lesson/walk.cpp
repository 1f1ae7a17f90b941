// walk.cpp: one pixel of the default picture on its way into the shadow buffer, in numbers: what the lesson computes
// there. `walk X,Y`, counted from the lower left.
#include "our_gl.h"

#include <cstdio>
#include <cstdlib>
#include <stdexcept>

namespace {

struct DepthShader final : IShader {
    mat4 uniform_PM;
    DepthShader(const Model& m, const Camera& camera) : IShader(m), uniform_PM(camera.to_clip()) {}
    vec4 vertex(int vert) const override { return uniform_PM * point(model.vert(vert)); }
};

// Looks for one pixel and draws nothing.
struct FindingShader final : IShader {
    struct Found {
        int x, y, face = -1;
        double z = 0;
    };
    mat4 uniform_PM;
    Found& found;
    FindingShader(const Model& m, const Camera& camera, Found& f)
        : IShader(m), uniform_PM(camera.to_clip()), found(f) {}
    vec4 vertex(int vert) const override { return uniform_PM * point(model.vert(vert)); }
    Color fragment(const Fragment& f) const override {
        for (int i = 0; i < lanes; i++)
            if (f.screen.x[i] == found.x + .5 && f.screen.y[i] == found.y + .5)
                found.face = f.face, found.z = f.screen.z[i];
        return {};
    }
};

// As many digits as a pocket calculator needs to follow.
void print(const char* name, const mat4& m) {
    for (int i = 0; i < 4; i++) {
        std::printf("%-26s", i ? "" : name);
        for (int k = 0; k < 4; k++) {
            const double v = m[i][k], size = std::fabs(v);
            std::printf(size > 1e-12 && size < .01 ? " %12.3e" : " %12.6f", v);
        }
        std::putchar('\n');
    }
}
void print(const char* name, const vec3& v) { std::printf("%-26s %12.4f %12.4f %12.4f\n", name, v.x, v.y, v.z); }

}  // namespace

int main(int argc, char** argv) try {
    FindingShader::Found found{};
    if (argc != 2 || std::sscanf(argv[1], "%d,%d", &found.x, &found.y) != 2)
        throw std::invalid_argument("usage: walk X,Y");
    constexpr int size = 800;
    const std::vector<Model> models(1, Model(UMBRA_OBJ_DIR "/idol/idol.obj"));
    const vec3 eye{1, 1, 4}, center{0, 0, 0}, up{0, 1, 0}, to_light{1, 1, 0};

    const Camera light = fitted({lookat(to_light, center, up), projection(0), {}}, models, size);
    const mat4 M = light.to_screen();
    DepthBuffer shadowbuffer(size, size);
    draw(std::vector{DepthShader(models[0], light)}, light.Viewport, shadowbuffer);

    const Camera viewer{lookat(eye, center, up), projection(-1 / norm(eye - center)), middle_viewport(size, size)};
    TGAImage picture(size, size, TGAImage::RGB);
    use_threads(1);
    draw(std::vector{FindingShader(models[0], viewer, found)}, {}, viewer.Viewport, picture);
    if (found.face < 0) throw std::invalid_argument("nothing is drawn there");

    const vec3 pixel{found.x + .5, found.y + .5, found.z};
    const mat4 from_screen = viewer.from_screen(), Mshadow = M * from_screen;
    const vec4 object = from_screen * point(pixel), sb_h = Mshadow * point(pixel);
    const vec3 sb_p = project(sb_h);
    vec4 corners[3];
    for (int i = 0; i < 3; i++) corners[i] = M * point(models[0].vert(found.face, i));
    const vec<3, coord> in_lanes{sb_p.x, sb_p.y, sb_p.z};
    const double stored = shadowbuffer.at(in_lanes)[0];
    const double bias = derived_bias(shadowbuffer, in_lanes, stored, depth_slope(corners))[0];

    print("M", M);
    print("Mshadow", Mshadow);
    print("pixel and its depth", pixel);
    print("the same in object space", project(object));
    std::printf("%-26s %12.4f %12.4f %12.4f %12.4f\n", "Mshadow * pixel", sb_h.x, sb_h.y, sb_h.z, sb_h.w);
    print("divided by w: sb_p", sb_p);
    std::printf("%-26s %38.4f\n%-26s %38.4f\n", "stored in the buffer", stored, "sb_p.z + bias", sb_p.z + bias);
    std::puts(stored > sb_p.z + bias ? "something is nearer to the light: in shadow" : "nothing is nearer: lit");
    return 0;
} catch (const std::exception& e) {
    std::fprintf(stderr, "walk: %s\n", e.what());
    return 1;
}
