// drawing.h: faces given in clip space, put through the pipeline: for tests of coverage and of extreme corners.
#pragma once
#include "our_gl.h"

// Three corners a face. A pixel gets the number of its face, from 1 on, as b + 256 g + 65536 r.
struct ClipShader : IShader {
    std::shared_ptr<const Model> own;
    const std::vector<vec4>& clip;
    explicit ClipShader(const std::vector<vec4>& c) : ClipShader(c, std::make_shared<Model>(faces(c.size()))) {}
    ClipShader(const std::vector<vec4>& c, std::shared_ptr<const Model> m) : IShader(*m), own(m), clip(c) {}
    static Model faces(std::size_t corners) {
        std::vector<Model::Corner> c;
        for (int i = 0; i < static_cast<int>(corners); i++) c.push_back({i, -1, 0});
        return {std::vector<vec3>(corners), {}, {{0, 0, 1}}, c};
    }
    vec4 vertex(int vert) const override { return clip[vert]; }
    Color fragment(const Fragment& f) const override {
        const int n = f.face + 1;
        return {n & 255, n >> 8 & 255, n >> 16};
    }
};

struct Drawing {
    DepthBuffer z;
    TGAImage picture;
    Counters count;

    int width() const { return z.width(); }
    int height() const { return z.height(); }
    bool drawn(int x, int y) const { return z.row(y)[x] != DepthBuffer::nothing; }
    int face(int x, int y) const {  // -1 for none
        const std::uint8_t* const p = picture.pixel(x, y);
        return p[0] + 256 * p[1] + 65536 * p[2] - 1;
    }
    long seen() const {
        long n = 0;
        for (int y = 0; y < height(); y++)
            for (int x = 0; x < width(); x++) n += drawn(x, y);
        return n;
    }
};

template <class Shader>
Drawing drawing(const Shader& shader, int width, int height, const mat4& Viewport) {
    Drawing d{DepthBuffer(width, height), TGAImage(width, height, TGAImage::RGB), {}};
    const std::vector<Shader> shaders{shader};
    draw(shaders, Viewport, d.z);
    d.count = draw(shaders, {}, Viewport, d.picture);
    return d;
}
inline Drawing drawing(const std::vector<vec4>& clip, int width, int height) {
    return drawing(ClipShader(clip), width, height, viewport(0, 0, width, height));
}

inline bool same(const Drawing& a, const Drawing& b) {
    for (int y = 0; y < a.height(); y++)
        for (int x = 0; x < a.width(); x++)
            if (a.z.row(y)[x] != b.z.row(y)[x] || a.face(x, y) != b.face(x, y)) return false;
    return a.count.triangles == b.count.triangles && a.count.outside == b.count.outside &&
           a.count.between_samples == b.count.between_samples && a.count.covered == b.count.covered &&
           a.count.shaded == b.count.shaded;
}
