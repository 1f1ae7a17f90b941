// shadow_error.h: what a picture's shadows and colours are off by, held against the ray caster. `umbra --report` and the
// report of the tests are both this code. It needs the shadow methods of the lesson only as a template parameter.
#pragma once
#include "our_gl.h"
#include "truth.h"

#include <cmath>
#include <cstdio>
#include <string>
#include <span>
#include <stdexcept>
#include <vector>

struct ShadowError {
    long facing = 0;        // pixels whose surface faces the light: the whole that the percentages are of
    long falsely_dark = 0;  // of those lit in truth: acne, and half of what a ragged boundary costs
    long falsely_lit = 0;   // of those shadowed in truth: leaks, and the other half

    double percent() const { return percent_of(falsely_dark + falsely_lit); }
    double percent_dark() const { return percent_of(falsely_dark); }
    double percent_lit() const { return percent_of(falsely_lit); }

private:
    double percent_of(long wrong) const {
        return facing ? 100. * static_cast<double>(wrong) / static_cast<double>(facing) : 0;
    }
};

// Compares a method's verdicts, one for each pixel, row 0 at the bottom, 0 dark and anything else lit. Only those of
// the facing pixels are looked at. Throws std::invalid_argument where the sizes differ.
ShadowError compare(const TruthImage& truth, std::span<const std::uint8_t> lit);

// A shadow method that is never wrong: it knows the truth of every pixel of one view.
struct TrueShadow {
    const TruthImage& truth;
    void vertex(int, int, const vec3&) {}
    bool lit(const Fragment& f) const {
        const auto x = static_cast<std::size_t>(f.screen.x), y = static_cast<std::size_t>(f.screen.y);
        const Truth t = truth.pixel[y * static_cast<std::size_t>(truth.width) + x];
        return t == Truth::lit || t == Truth::background;
    }
};

// What a method says of each pixel, whatever its colour: 255 lit, 0 dark; and for a dark one found in a shadow buffer,
// whether the texel that darkens it shows the fragment's own face (cause 1) or another one (cause 2).
template <class Shadow>
struct VerdictShader final : IShader {
    const Model& model;
    mat4 uniform_M;  // object to clip
    Shadow shadow;
    int first_number;
    const FaceBuffer& casters;  // on the light's screen, empty for a method without a buffer

    VerdictShader(const Model& m, const Camera& viewer, const Shadow& s, int first, const FaceBuffer& c)
        : model(m), uniform_M(viewer.object_to_clip()), shadow(s), first_number(first), casters(c) {}
    vec4 vertex(int face, int corner) override {
        const vec3& v = model.vert(face, corner);
        shadow.vertex(first_number + face, corner, v);
        return uniform_M * point(v);
    }
    TGAColor fragment(const Fragment& f) const override {
        const bool lit = shadow.lit(f);
        std::uint8_t cause = 0;
        if constexpr (requires { shadow.shadowbuffer; }) {
            const vec3 p = shadow.on_light_screen(f.bar);
            if (!lit) cause = casters.at(p.x - Shadow::shift, p.y - Shadow::shift) == shadow.number ? 1 : 2;
        }
        return {{static_cast<std::uint8_t>(lit ? 255 : 0), cause, 0, 0}};
    }
};

struct Verdicts {
    std::vector<std::uint8_t> lit, cause;  // a pixel each, row 0 at the bottom
};

template <class Shadow>
Verdicts verdicts_of(const std::vector<Model>& models, const Camera& viewer, const Shadow& shadow, const FaceBuffer& faces,
                     const FaceBuffer& casters) {
    TGAImage image(faces.width(), faces.height(), TGAImage::RGB);
    const std::vector<char> seen = numbers_seen(faces, face_count(models));
    int first = 0;
    for (const Model& model : models) {
        const VerdictShader<Shadow> shader(model, viewer, shadow, first, casters);
        draw_color(0, model.nfaces(), shader, viewer.Viewport, faces, seen, first, image, 1);
        first += model.nfaces();
    }
    Verdicts v;
    for (int y = 0; y < image.height(); y++)
        for (int x = 0; x < image.width(); x++)
            v.lit.push_back(image.pixel(x, y)[0]), v.cause.push_back(image.pixel(x, y)[1]);
    return v;
}

// One line of name value pairs: pixels that only one of picture and truth covers (a silhouette within the snapping of the
// corners: no shadow's doing, and left out of what follows); the pixels whose surface faces the light; those of them that
// are falsely dark (and of these the ones darkened by their own face) and falsely lit, as counts and in percent; and the
// root of the mean square of what the facing pixels' channels are off by from the picture with exact shadows.
std::string report_line(TruthImage truth, const FaceBuffer& faces, const Verdicts& verdicts, const TGAImage& picture,
                        const TGAImage& exact);
