// our_gl.h: the pipeline, from a face to its pixels: cameras, shaders, the z-buffer, drawing, and what shadows need. It
// knows nothing of files or of what a shader computes. Lesson paragraphs: lookat, projection, viewport, rasterization.
//
// Spaces, in the order in which a corner passes through them:
//     object --ModelView--> eye --Projection--> clip --Viewport--> screen (homogeneous) --divide by w--> screen
// Right-handed; the viewer looks down -z, so a larger z is nearer. On the screen x and y are in pixels, pixel (0,0) is
// the bottom-left one and its centre is (0.5, 0.5); z is in [0, screen_depth] for what lies in the cube [-1,1]^3.
#pragma once
#include "geometry.h"
#include "model.h"
#include "tgaimage.h"

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <vector>

// ---- cameras ----

constexpr double screen_depth = 2000;  // what the viewport makes of the z range [-1,1]

// Puts center at the origin and looks at it from eye, which comes to lie on the +z axis; up appears upwards.
// All in object space. Where up is zero or parallel to the view, the axis least parallel to the view takes its place;
// where eye and center are the same point, the view is along -z.
mat4 lookat(const vec3& eye, const vec3& center, const vec3& up);

// Central projection onto the plane z = 0 for an eye at z = -1/c: the identity with c at row 3, column 2, so w = 1 + c
// z. c = 0 is the orthographic camera. What lies in that plane keeps its size however near the eye is, and a nearer eye
// only bends what is before and behind it more: to see a scene larger, zoom.
mat4 projection(double c);

// The same for a light at that distance from the center: what is within so many degrees of its axis, to each side,
// comes to [-1,1]^2.
mat4 beam(double distance, double half_angle);

mat4 translation(const vec3& by);

// Counterclockwise about the axis as it points at the viewer; about +y where it has no direction.
mat4 rotation(const vec3& axis, double degrees);

// Takes [-1,1]^3 to [x,x+w] x [y,y+h] x [0,screen_depth]; x, y, w, h in pixels.
mat4 viewport(double x, double y, double w, double h);

// [-1,1]^2 in the middle three quarters of the shorter side of a picture, so that nothing is stretched; times zoom.
mat4 middle_viewport(int width, int height, double zoom = 1);

// A camera is a value, so that two passes and several lights can live side by side.
struct Camera {
    mat4 ModelView = mat4::identity(), Projection = mat4::identity(), Viewport = mat4::identity();
    mat4 to_clip() const { return Projection * ModelView; }
    mat4 to_screen() const { return Viewport * to_clip(); }
    // The inverse of to_screen(), factor by factor: the product itself is singular to working precision for an eye
    // within 1e-15 of center. Each factor must have an inverse.
    mat4 from_screen() const {
        return invert(ModelView).value() * (invert(Projection).value() * invert(Viewport).value());
    }
};

// Some models of a scene.
struct Models : std::vector<const Model*> {
    Models() = default;
    Models(const std::vector<Model>& all) {
        for (const Model& model : all) push_back(&model);
    }
};

// Makes a scene fill the picture, all models by one transform: the centre of their box comes to the origin, and they
// are as large as the middle three quarters hold every vertex, seen from eye towards the origin. A scene is left alone,
// and the result false, where from there every vertex falls into a square picture, the box's largest half side is at
// least 1/2 and its centre is within 1/2 of the origin.
bool fit(std::vector<Model>& scene, const vec3& eye = {1, 1, 4}, const vec3& up = {0, 1, 0});

// A light's camera, fitted: its projection and viewport are replaced so that the models, or with a perspective what of
// them is before it and in [-1,1]^2, fill all of size x size pixels and of [0, screen_depth].
Camera fitted(const Camera& camera, const Models& models, int size);

// Those of the models of which the camera may see a part on a picture of so many pixels: judged by their boxes.
Models seen_by(const Camera& camera, const Models& models, int width, int height);

// Those that may throw a shadow onto a receiver, judged by their boxes as the light sees them; where it has a place,
// those before it and in [-1,1]^2, if there is a receiver.
Models casters(const Models& models, const Models& receivers, const Camera& light);

// ---- the z-buffer ----

constexpr int max_size = 16384;  // pixels a side; the range of the integer edge functions rests on it

// Depth on the screen, larger is nearer, minus infinity where nothing was drawn: every cell, the first one too. Rows
// from the bottom up.
class DepthBuffer {
public:
    static constexpr float nothing = -std::numeric_limits<float>::infinity();

    DepthBuffer() = default;
    DepthBuffer(int width, int height);  // 1 to max_size a side, or std::invalid_argument; holds anything until draw()
    int width() const { return w_; }
    int height() const { return h_; }
    std::size_t bytes() const { return std::size_t{1} * stride_ * h_ * sizeof(float); }
    float* row(int y) { return cells_.get() + std::ptrdiff_t{stride_} * y; }
    const float* row(int y) const { return cells_.get() + std::ptrdiff_t{stride_} * y; }

    // Of the pixel that the point lies in; outside of the buffer there is nothing.
    INLINED coord at(const vec<3, coord>& p) const {
        const mask inside = (!(p.x < 0)) & (!(p.y < 0)) & (p.x < w_) & (p.y < h_);
        const pack<std::int32_t> y = to_int(select(inside, p.y, 0)), x = to_int(select(inside, p.x, 0));
        const real z = looked_up<float>(y * stride_ + x, [this](int cell) { return cells_[cell]; });
        return to_coord(select(inside, z, nothing));
    }

private:
    int w_ = 0, h_ = 0, stride_ = 0;  // a row is as long as a whole number of lanes
    std::unique_ptr<float[]> cells_;
};

// The depths as a grey picture: the nearest is white, the farthest a dark grey, and what was not drawn is black. Cells
// that are aspect times as wide as high come out square: the picture has the buffer's size, and black at two sides.
TGAImage depth_picture(const DepthBuffer& depths, double aspect = 1);

// ---- shaders ----

// Some neighbouring pixels of one face, one in each lane: what the pipeline hands to IShader::fragment.
struct Fragment {
    int face;              // of the model
    vec<3, coord> screen;  // the pixel's centre and the depth there
    bool front_facing;     // seen from where its corners run counterclockwise
    vec<3, coord> bar;     // barycentric coordinates on the face itself (perspective undone): each >= 0, their sum is 1
};

using Color = vec<3, real>;  // a TGAColor in each lane: blue, green, red from 0 up; what is above 255 is drawn as 255

// What a model says of colours has red first.
template <typename T>
INLINED Color bgr(const vec<3, T>& rgb) { return {rgb.z, rgb.y, rgb.x}; }

// Light of a colour on a surface that reflects so much of each channel.
INLINED Color reflected(const Color& light, const Color& share) {
    return {light.x * share.x, light.y * share.y, light.z * share.z};
}

// A uniform is the same for a whole pass. A varying is written for each corner of a face, and fragment() reads it. Each
// thread draws with a copy of its own.
struct IShader {
    const Model& model;
    virtual ~IShader() = default;
    virtual vec4 vertex(int vert) const = 0;                 // where a vertex of the model is, in clip space
    virtual void varying(int /*iface*/, int /*nthvert*/) {}  // the rest of a corner, of faces that are seen alone
    virtual Color fragment(const Fragment&) const { return {}; }  // not called where depth alone is wanted

protected:
    explicit IShader(const Model& m) : model(m) {}
    IShader(const IShader&) = default;
};

// A varying at a fragment: its values at the corners, weighted.
template <int n>
INLINED vec<n, coord> interpolated(const vec<n> (&varying)[3], const vec<3, coord>& bar) {
    return componentwise<n, coord>(
        [&](int i) { return varying[0][i] * bar.x + varying[1][i] * bar.y + varying[2][i] * bar.z; });
}

// Texture coordinates of any size, and wrapped round to [0,1]: rounding may give 1 itself. 0 where one is beyond the
// range of a double.
struct UV {
    vec<2, coord> given, wrapped;
    INLINED UV(const vec<2, coord>& uv) : given(uv), wrapped(componentwise<2, coord>([&](int i) {
        return max(coord(0), uv[i] - floor(uv[i]));  // of 0 and NaN it is 0
    })) {}
};

// Where a map that is scaled and shifted has them. Called, because few maps are and many look-ups ask.
vec<2, coord> moved(const Map& map, const UV& uv);

// The texels (floor(u*w), floor(v*h)) of a map's picture, one a lane: the nearest. [i] is their channel i.
class Texels {
public:
    INLINED Texels(const Map& map, const UV& at) {
        const vec<2, coord> uv = map.is_moved ? moved(map, at) : at.wrapped;
        const int w = map->width(), h = map->height();
        const pack<std::int32_t> x = min(to_int(uv.x * w), w - 1), y = min(to_int(uv.y * h), h - 1);
        const auto index = converted<std::uint32_t>(y) * w + converted<std::uint32_t>(x);  // a picture may have 2^32
        bytes_ = looked_up<std::int32_t>(index, [first = map->pixel(0, 0), bytespp = map->bytespp()](std::uint32_t i) {
            std::int32_t bytes;
            std::memcpy(&bytes, first + std::size_t{i} * bytespp, 4);
            return bytes;
        });
        if (map->bytespp() == 1) bytes_ = (bytes_ & 255) * 0x10101;  // grey
    }
    INLINED real operator[](int channel) const { return to_real(bytes_ >> 8 * channel & 255); }
    INLINED Color bgr() const { return {(*this)[0], (*this)[1], (*this)[2]}; }
    INLINED vec<3, real> normal() const {  // (r,g,b) from [0,255] to [-1,1]
        return {(*this)[2] * (2 / 255.) - 1, (*this)[1] * (2 / 255.) - 1, (*this)[0] * (2 / 255.) - 1};
    }

private:
    pack<std::int32_t> bytes_;  // four from the texel on, the first one lowest: some may belong to its neighbours
};

// base^exponent for integers from 0 to 255, by repeated squaring: the same product in the same order everywhere, which
// a library's pow does not promise.
INLINED real power(real base, const real& exponent) {
    const pack<std::int32_t> e = to_int(exponent);
    real result = 1;
    for (int bit = 1; bit < 256; bit *= 2, base = base * base)
        result = select((e & bit) > 0, result * base, result);
    return result;
}

// The sky: behind everything and infinitely far off. No light falls on it, and it throws no shadow.
struct SkyShader final : IShader {
    mat4 uniform_PM;           // Projection*ModelView, so scaled that w does not vanish for an eye far off
    const Material* material;  // the face's
    vec2 varying_uv[3];

    SkyShader(const Model& m, const Camera& camera);
    vec4 vertex(int vert) const override;
    void varying(int iface, int nthvert) override;
    Color fragment(const Fragment& f) const override;
};

// ---- drawing ----

// What a pass did, and what it left out. The same at any number of threads.
struct Counters {
    long triangles = 0;        // faces handed in
    long outside = 0;          // ... of which beyond all pixels' centres on one side, or behind the eye
    long between_samples = 0;  // ... of which small, and beside or between the pixels' centres
    long covered = 0;          // samples inside of a face: depth tests
    long shaded = 0;           // pixels that fragment() coloured: each visible one once
    Counters& operator+=(const Counters& c);
};

// How many threads parallel_for uses: all processors at first. No picture depends on it, so it is the one setting that
// belongs to the process and is not handed from function to function.
void use_threads(int n);
int thread_count();

// Calls work(i, thread) once for each i in [0,n), on as many threads as can be had, with a thread number below
// thread_count(). In what order is not defined. What the call with the lowest i throws is thrown here, once all have
// ended. Not to be called by two threads at once, nor by work itself.
void parallel_for(int n, const std::function<void(int i, int thread)>& work);

// A pass: draws the faces of all shaders. Into a z-buffer go the depths of what is nearest, whatever it held before
// (the first drawn wins a tie), of all faces or of those alone that are seen from behind. Into a picture of three or
// four channels go the colours: fragment() is called once for every pixel that is seen, however many faces lie behind
// it, and the rest is black. shader(i, thread) is the thread's own copy of the i-th.
using Shaders = std::function<IShader&(int i, int thread)>;
enum class Faces { all, back };
Counters draw(const Shaders& shader, int nshaders, const mat4& Viewport, DepthBuffer& zbuffer, Faces faces);
Counters draw(const Shaders& shader, int nshaders, const mat4& Viewport, TGAImage& picture);

template <class Shader>
Counters draw(const std::vector<Shader>& shaders, const mat4& Viewport, DepthBuffer& zbuffer,
              Faces faces = Faces::all) {
    std::vector<std::vector<Shader>> own(thread_count(), shaders);
    const auto shader = [&](int i, int thread) -> IShader& { return own[thread][i]; };
    return draw(shader, static_cast<int>(shaders.size()), Viewport, zbuffer, faces);
}

template <class Shader, class Other = Shader>
Counters draw(const std::vector<Shader>& shaders, const std::vector<Other>& others, const mat4& Viewport,
              TGAImage& picture) {
    const int n = static_cast<int>(shaders.size());
    std::vector<std::vector<Shader>> own(thread_count(), shaders);
    std::vector<std::vector<Other>> other(thread_count(), others);
    const auto shader = [&](int i, int thread) -> IShader& {
        if (i < n) return own[thread][i];
        return other[thread][i - n];
    };
    return draw(shader, n + static_cast<int>(others.size()), Viewport, picture);
}

// ---- shadows ----

// How far a texel of the shadow buffer may stand above a fragment without shadowing it, in units of depth: what the
// slopes of receiver and caster explain. sb_p: the fragment on the light's screen; stored: what the buffer holds there;
// slope: of the fragment's face.
coord derived_bias(const DepthBuffer& shadowbuffer, const vec<3, coord>& sb_p, const coord& stored, const vec2& slope);

// How much the depth of a face rises from pixel to pixel along x and y. corner: on a light's screen, homogeneous.
vec2 depth_slope(const vec4 (&corner)[3]);

// The exact shadow: faces sorted into the cells of a grid on the light's screen, so that the few that may stand between
// a point and the light are found at once. No resolution, no bias: whether one does is decided on the face itself.
class LightGrid {
public:
    LightGrid() = default;
    // The light's screen is cells x cells large; what of the faces is beyond it throws no shadow. Takes at most
    // 32 bytes a vertex, 2.5 KB a face and 5 bytes a cell.
    LightGrid(const Models& models, const Camera& light, int cells) { build(models, light, cells); }
    void build(const Models& models, const Camera& light, int cells);  // anew, in the same memory

    // A cell for eight faces: measured up to 2.5 million of them, more take longer to fill than they save.
    static int good_cells(const Models& models);

    // The number of a model's first face here; that of no face of it where the model is none of those.
    int first_face(const Model& model) const;

    // Whether any face but `number` lies between the light and a point of that face, given on the light's screen.
    mask shadows(const vec<3, coord>& on_screen, int number) const;

    std::size_t bytes() const;  // that are read when shadows are looked up

private:
    struct Entry {
        float zmax;  // of the face, rounded up
        std::int32_t face;
    };
    struct Touch : Entry {  // before the lists are made
        std::int32_t cell;  // of its band
    };
    void sort_into_bands(int face, std::vector<std::vector<Touch>>& touches, std::atomic<std::int64_t>& left);
    void fill(int band);
    vec3 on_screen(int v) const { return ws_.empty() ? verts_[v] : verts_[v] / ws_[v]; }
    mask covers(int face, const vec<3, coord>& p) const;

    struct Band {
        std::vector<std::uint32_t> first;  // entries of cell c: first[c] to first[c+1]
        std::vector<Entry> entries;        // in each cell the nearest to the light first
    };
    int cells_ = 0;                          // a side
    double side_ = 0;                        // of the light's screen, in cells: no more than there are
    int band_rows_ = 1;                      // of cells, in a band
    double scale_ = 1;                       // cells to a pixel of the light's screen
    double zmax_ = 0;                        // the largest |z| of all vertices that are not next to the light
    Models models_;
    std::vector<vec3> verts_;                // x and y in cells; where ws_ are, homogeneous
    std::vector<double> ws_;                 // of a light with a place
    std::vector<std::array<int, 3>> faces_;  // as indices of vertices
    std::vector<Band> bands_;
    std::vector<std::vector<std::vector<Touch>>> touches_;  // found by each part of build(), of each band
};
