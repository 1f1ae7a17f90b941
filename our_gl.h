// our_gl.h: the pipeline, from a face to its pixels: cameras, shaders, clipping, coverage, the z-buffer.
// It knows nothing of files or of what a shader computes. Lesson paragraphs: lookat, projection, viewport, rasterization.
//
// Spaces, in the order in which a corner passes through them:
//     object --ModelView--> eye --Projection--> clip --Viewport--> screen (homogeneous) --divide by w--> screen
// Right-handed; the viewer looks down -z, so a larger z is nearer. On the screen x and y are in pixels, pixel (0,0) is the
// bottom-left one and its centre is (0.5, 0.5); z is in [0, screen_depth] for what lies in the cube [-1,1]^3.
#pragma once
#include "geometry.h"
#include "model.h"
#include "tgaimage.h"

#include <algorithm>
#include <barrier>
#include <cmath>
#include <cstdint>
#include <latch>
#include <limits>
#include <optional>
#include <stdexcept>
#include <thread>
#include <vector>

// ---- cameras ----

constexpr double screen_depth = 2000;  // what the viewport makes of the z range [-1,1]

// Puts center at the origin and looks at it from eye, which comes to lie on the +z axis; up appears upwards.
// All in object space. Where up is zero or parallel to the view, the axis least parallel to the view takes its place;
// where eye and center are the same point, the view is along -z.
mat4 lookat(const vec3& eye, const vec3& center, const vec3& up);

// Central projection onto the plane z = 0 for an eye at z = -1/c: the identity with c at row 3, column 2, so w = 1 + c z.
// c = 0 is the orthographic camera.
mat4 projection(double c);

mat4 translation(const vec3& by);

// Takes [-1,1]^3 to [x,x+w] x [y,y+h] x [0,screen_depth]; x, y, w, h in pixels.
mat4 viewport(double x, double y, double w, double h);

// [-1,1]^2 in the middle three quarters of the shorter side of a picture, so that nothing is stretched.
mat4 middle_viewport(int width, int height);

// A camera is a value, so that two passes, several lights and several threads can live side by side.
struct Camera {
    mat4 ModelView = mat4::identity(), Projection = mat4::identity(), Viewport = mat4::identity();
    mat4 object_to_clip() const { return Projection * ModelView; }
    mat4 object_to_screen() const { return Viewport * (Projection * ModelView); }
};

// ---- models in a scene: their faces are numbered through, one model after the other ----

int face_count(const std::vector<Model>& models);

// The orthographic camera that looks along -direction and shows all models as large as its size x size pixels allow.
Camera fitted_camera(const std::vector<Model>& models, const vec3& direction, const vec3& up, int size);

// ---- the z-buffer ----

constexpr int max_size = 16384;  // pixels a side; the range of the integer edge functions below rests on it

// One value a pixel, rows from the bottom up.
template <class T>
class Buffer {
public:
    Buffer() = default;
    Buffer(int width, int height, T empty) : w_(width), h_(height), empty_(empty) {  // 1 to max_size a side, or std::invalid_argument
        if (w_ < 1 || h_ < 1 || w_ > max_size || h_ > max_size)
            throw std::invalid_argument("a buffer has 1 to 16384 pixels a side");
        cells_.assign(static_cast<std::size_t>(w_) * static_cast<std::size_t>(h_), empty);
    }
    int width() const { return w_; }
    int height() const { return h_; }
    std::size_t bytes() const { return cells_.size() * sizeof(T); }
    // Of the pixel that the point (x,y) lies in; outside of the buffer there is nothing.
    T at(double x, double y) const {
        return x >= 0 && y >= 0 && x < w_ && y < h_ ? row(static_cast<int>(y))[static_cast<int>(x)] : empty_;
    }
    T* row(int y) { return cells_.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(w_); }
    const T* row(int y) const { return cells_.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(w_); }

private:
    int w_ = 0, h_ = 0;
    T empty_{};
    std::vector<T> cells_;
};

// Depth on the screen, larger is nearer, minus infinity where nothing was drawn.
struct DepthBuffer : Buffer<float> {
    DepthBuffer() = default;
    DepthBuffer(int width, int height) : Buffer(width, height, -std::numeric_limits<float>::infinity()) {}
};

// The most that a depth in [0,screen_depth] differs from the exact one: half a unit in the last place of a float below 2048.
constexpr double depth_rounding = 1. / (1 << 14);

// The number of the face that is nearest, -1 where nothing was drawn.
struct FaceBuffer : Buffer<std::int32_t> {
    FaceBuffer() = default;
    FaceBuffer(int width, int height) : Buffer(width, height, -1) {}
};

// The depths as a grey picture: the nearest is white, the farthest a dark grey, and what was not drawn is black.
TGAImage depth_picture(const DepthBuffer& depths);

// ---- shaders ----

// base^exponent by repeated squaring: the same product in the same order everywhere, which a library's pow does not promise.
constexpr double power(double base, unsigned exponent) {
    double result = 1;
    for (; exponent; exponent >>= 1, base *= base)
        if (exponent & 1) result *= base;
    return result;
}

// The texel (floor(u*w), floor(v*h)): nearest, wrapped round. uv finite, of any size; the picture not empty.
inline const std::uint8_t* sample2D(const TGAImage& map, const vec2& uv) {
    const auto wrapped = [](double t, int size) {
        const double f = t - std::floor(t);  // may round up to 1; no number where t is beyond the range of a double
        return f >= 0 ? std::min(static_cast<int>(f * size), size - 1) : 0;
    };
    return map.pixel(wrapped(uv.x, map.width()), wrapped(uv.y, map.height()));
}

// Where a fragment is: what the pipeline hands to IShader::fragment.
struct Fragment {
    vec3 screen;  // the pixel's centre and the depth there
    vec3 bar;     // barycentric coordinates on the face itself (perspective undone): each >= 0, their sum is 1
};

// A shader is a cheap value: every thread works on its own copy, and what a fragment reads was written by the three
// vertex calls of its own face. Derive it as a final class: then no call below is virtual at run time.
struct IShader {
    virtual ~IShader() = default;
    virtual vec4 vertex(int face, int corner) = 0;                   // the corner in clip space; may note varyings
    virtual TGAColor fragment(const Fragment&) const { return {}; }  // not called in a pass that wants depth alone
};

// A varying at a fragment: its values at the corners, weighted.
template <class T>
T interpolated(const T (&varying)[3], const vec3& bar) {
    return varying[0] * bar.x + varying[1] * bar.y + varying[2] * bar.z;
}

// The texel of a normal map as a vector: (r,g,b) from [0,255] to [-1,1].
inline vec3 sample_normal(const TGAImage& map, const vec2& uv) {
    const std::uint8_t* const bgr = sample2D(map, uv);
    return {bgr[2] * 2 / 255. - 1, bgr[1] * 2 / 255. - 1, bgr[0] * 2 / 255. - 1};
}

// ---- triangles ----

// A face ready to be rasterized: its coverage as an integer polygon, and depth and barycentric coordinates as functions
// that are linear on the screen. Corners are snapped to 1/65536 pixel for coverage only; the linear functions come from
// the unsnapped corners, so interpolation is exact to double precision.
struct TriangleSetup {
    static constexpr int subpixel_bits = 16;
    static constexpr int max_corners = 8;  // a triangle cut by the near plane and four guard planes

    int face = 0;
    int corners = 0;                            // of the convex polygon below, counter-clockwise or clockwise
    std::int32_t x[max_corners], y[max_corners];  // in 1/65536 pixel
    int xmin, xmax, ymin, ymax;                 // pixels whose centre lies in the polygon's box, inclusive

    vec2 origin;        // a pixel centre near the polygon; dx, dy below are relative to it
    vec3 ex, ey, e0;    // e = ex dx + ey dy + e0 is proportional to the barycentric coordinates on the face
    double zx, zy, z0;  // depth = zx dx + zy dy + z0 ...
    double zmin, zmax;  // ... and a fragment's depth lies between those of its polygon's corners

    double depth(int px, int py) const {
        return std::clamp(zx * (px + .5 - origin.x) + (zy * (py + .5 - origin.y) + z0), zmin, zmax);
    }

    // Coverage is snapped, so a sample may lie outside of the exact triangle by a hair: it stays on the face.
    Fragment fragment(int px, int py) const {
        vec3 e = ex * (px + .5 - origin.x) + (ey * (py + .5 - origin.y) + e0);
        for (int i = 0; i < 3; i++) e[i] = std::max(e[i], 0.);
        const double sum = e.x + e.y + e.z;
        return {{px + .5, py + .5, depth(px, py)}, sum > 0 ? e / sum : vec3{1, 0, 0}};
    }
};

enum class Setup { drawn, outside, between_samples };

// Clips, snaps and prepares one face for a picture of the given size. clip: its corners in clip space, any w.
// outside: no part of it is in front of the eye and inside the picture; between_samples: it covers no pixel's centre.
Setup setup_triangle(const vec4 (&clip)[3], const mat4& Viewport, int width, int height, TriangleSetup& out);

// What a pass did, and what it left out. The same at any number of threads.
struct Counters {
    long triangles = 0;        // faces handed in
    long outside = 0;          // ... of which wholly outside of the picture
    long between_samples = 0;  // ... of which between the pixels' centres
    long covered = 0;          // samples inside of a face: depth tests
    long nearer = 0;           // ... of which passed
    long shaded = 0;           // calls of fragment()
    Counters& operator+=(const Counters& c) {
        triangles += c.triangles, outside += c.outside, between_samples += c.between_samples;
        covered += c.covered, nearer += c.nearer, shaded += c.shaded;
        return *this;
    }
};

// Calls visit(y, x_begin, x_end) for the pixels on the rows [y_begin, y_end) of the triangle of corners 0, k-1 and k. The edge
// function of two corners is twice a signed area: positive inside; where it is zero the pixel's centre lies on the edge and
// belongs to it if the edge is a left one (it runs down, counter-clockwise) or a top one (it runs left), so that of two
// triangles sharing an edge exactly one owns the pixel. Range: with max_size pixels and the guard band, differences of
// coordinates are below 2^30.6, edge functions below 2^62.2.
template <class Visit>
void for_each_span_of_fan(const TriangleSetup& t, int k, int y_begin, int y_end, Visit&& visit) {
    constexpr std::int64_t one = std::int64_t{1} << TriangleSetup::subpixel_bits, half = one / 2;
    int corner[3] = {0, k - 1, k};
    const std::int64_t area = (std::int64_t{t.x[k - 1]} - t.x[0]) * (std::int64_t{t.y[k]} - t.y[0]) -
                              (std::int64_t{t.y[k - 1]} - t.y[0]) * (std::int64_t{t.x[k]} - t.x[0]);
    if (area == 0) return;
    if (area < 0) std::swap(corner[1], corner[2]);
    std::int64_t row[3], step_x[3], step_y[3];
    for (int i = 0; i < 3; i++) {
        const int p = corner[i], q = corner[(i + 1) % 3];
        const std::int64_t dx = std::int64_t{t.x[q]} - t.x[p], dy = std::int64_t{t.y[q]} - t.y[p];
        const bool top_left = dy < 0 || (dy == 0 && dx < 0);
        row[i] = dx * (y_begin * one + half - t.y[p]) - dy * (t.xmin * one + half - t.x[p]) - (top_left ? 0 : 1);
        step_x[i] = -dy * one;
        step_y[i] = dx * one;
    }
    for (int y = y_begin; y < y_end; y++) {
        std::int64_t e0 = row[0], e1 = row[1], e2 = row[2];
        int x = t.xmin;
        while (x <= t.xmax && (e0 | e1 | e2) < 0) x++, e0 += step_x[0], e1 += step_x[1], e2 += step_x[2];
        const int first = x;
        while (x <= t.xmax && (e0 | e1 | e2) >= 0) x++, e0 += step_x[0], e1 += step_x[1], e2 += step_x[2];
        if (x > first) visit(y, first, x);
        for (int i = 0; i < 3; i++) row[i] += step_y[i];
    }
}

// Calls visit(y, x_begin, x_end) for the pixels of a prepared face on the rows [y_begin, y_end) that it touches, each once.
// The polygon is a fan of triangles; nearly always there is one.
template <class Visit>
void for_each_span(const TriangleSetup& t, int y_begin, int y_end, Visit&& visit) {
    y_begin = std::max(y_begin, t.ymin);
    y_end = std::min(y_end, t.ymax + 1);
    if (t.corners == 3) return for_each_span_of_fan(t, 2, y_begin, y_end, visit);
    // Snapping and clipping round: a cut polygon may be convex but for a hair, and then its fan overlaps itself.
    for (int row = y_begin; row < y_end; row++) {
        std::pair<int, int> spans[TriangleSetup::max_corners];
        int n = 0;
        for (int k = 2; k < t.corners; k++)
            for_each_span_of_fan(t, k, row, row + 1, [&](int, int begin, int end) {
                int i = n++;  // from left to right
                for (; i > 0 && spans[i - 1].first > begin; i--) spans[i] = spans[i - 1];
                spans[i] = {begin, end};
            });
        for (int i = 0; i < n;) {
            auto [begin, end] = spans[i++];
            for (; i < n && spans[i].first <= end; i++) end = std::max(end, spans[i].second);
            visit(row, begin, end);
        }
    }
}

// The rows of a picture that one of several threads draws: strips of 16 in turn.
struct Share {
    int thread = 0, threads = 1;
    static constexpr int strip = 16;

    template <class Visit>
    void for_each_span(const TriangleSetup& t, Visit&& visit) const {
        if (threads == 1) return ::for_each_span(t, t.ymin, t.ymax + 1, visit);
        for (int s = t.ymin / strip; s <= t.ymax / strip; s++)
            if (s % threads == thread) ::for_each_span(t, s * strip, (s + 1) * strip, visit);
    }
};

// Draws a prepared face into the z-buffer; the first drawn wins a tie. Where it is nearest, faces (if given) gets its number.
void triangle(const TriangleSetup& t, int number, DepthBuffer& zbuffer, FaceBuffer* faces, const Share& share, Counters& count);

// Colours the pixels that the z-buffer's pass left to this face. shader is the thread's own copy.
template <class Shader>
void shade(const TriangleSetup& t, int number, Shader& shader, const FaceBuffer& faces, TGAImage& picture,
           const Share& share, Counters& count) {
    bool varyings_set = false;
    share.for_each_span(t, [&](int y, int x_begin, int x_end) {
        const std::int32_t* const nearest = faces.row(y);
        for (int x = x_begin; x < x_end; x++) {
            if (nearest[x] != number) continue;
            if (!varyings_set)
                for (int c = 0; c < 3; c++) shader.vertex(t.face, c);
            varyings_set = true;
            count.shaded++;
            const TGAColor color = shader.fragment(t.fragment(x, y));
            std::copy_n(color.bgra, picture.bytespp(), picture.pixel(x, y));
        }
    });
}

// Sets up the faces [begin,end) that wanted(face) accepts and calls visit(setup, shader, share, counters) for each, in
// their order, on every thread: each draws the rows of its share, so a pixel sees the faces in their order whatever the
// number of threads. Faces are set up in blocks that the threads divide among themselves.
template <class Shader, class Wanted, class Visit>
Counters for_each_face(int begin, int end, const Shader& shader, const mat4& Viewport, int width, int height, int threads,
                       Wanted&& wanted, Visit&& visit) {
    constexpr int block = 4096, least = 256;  // faces set up at a time; faces below which a thread is not worth starting
    threads = std::clamp(threads, 1, std::max(1, (end - begin) / least));
    struct Worker {
        TriangleSetup* setups = nullptr;
        std::size_t drawn = 0;
        Counters count;
    };
    std::vector<TriangleSetup> setups(static_cast<std::size_t>(std::clamp(end - begin, 0, block)));
    std::vector<Worker> workers(static_cast<std::size_t>(threads));
    std::latch ready(1);  // when it is known how many threads there are
    std::optional<std::barrier<>> sync;

    const auto work = [&](int me) {  // cannot throw
        Worker& mine = workers[static_cast<std::size_t>(me)];
        Shader own = shader;
        for (int from = begin; from < end; from += block) {
            const int n = std::min(block, end - from);
            mine.setups = setups.data() + n * me / threads;
            mine.drawn = 0;
            for (int i = n * me / threads; i < n * (me + 1) / threads; i++) {
                const int face = from + i;
                if (!wanted(face)) continue;
                const vec4 clip[3] = {own.vertex(face, 0), own.vertex(face, 1), own.vertex(face, 2)};
                TriangleSetup& t = mine.setups[mine.drawn];
                t.face = face;
                const Setup outcome = setup_triangle(clip, Viewport, width, height, t);
                mine.count.triangles++;
                mine.count.outside += outcome == Setup::outside;
                mine.count.between_samples += outcome == Setup::between_samples;
                mine.drawn += outcome == Setup::drawn;
            }
            sync->arrive_and_wait();
            for (const Worker& w : workers)
                for (std::size_t i = 0; i < w.drawn; i++) visit(w.setups[i], own, Share{me, threads}, mine.count);
            sync->arrive_and_wait();
        }
    };
    std::vector<std::jthread> others;
    others.reserve(static_cast<std::size_t>(threads - 1));
    const auto wait_and_work = [&](int me) {
        ready.wait();
        work(me);
    };
    try {
        for (int i = 1; i < threads; i++) others.emplace_back(wait_and_work, i);
    } catch (const std::exception&) {
        // no more threads to be had: those that run share the work
    }
    threads = static_cast<int>(others.size()) + 1;
    sync.emplace(threads);
    ready.count_down();
    work(0);
    others.clear();

    Counters total;
    for (const Worker& w : workers) total += w.count;
    return total;
}

// What is nearest of a model with nfaces faces: the depth and, in faces unless it is null, the face's number, counted from
// first_number.
template <class Shader>
Counters draw_depth(int nfaces, const Shader& shader, const mat4& Viewport, DepthBuffer& zbuffer, FaceBuffer* faces,
                    int first_number, int threads) {
    return for_each_face(
        0, nfaces, shader, Viewport, zbuffer.width(), zbuffer.height(), threads, [](int) { return true; },
        [&](const TriangleSetup& t, Shader&, const Share& share, Counters& count) {
            triangle(t, first_number + t.face, zbuffer, faces, share, count);
        });
}

// Calls visit(model, number of its first face) for one model after the other.
template <class Visit>
void for_each_model(const std::vector<Model>& models, Visit&& visit) {
    int first = 0;
    for (const Model& model : models) visit(model, first), first += model.nfaces();
}

// Which of the numbers 0 to count-1 a pixel shows: the faces that are worth shading.
std::vector<char> numbers_seen(const FaceBuffer& faces, int count);

// Colours the pixels that show one of the faces [begin,end), each exactly once, and returns their number. A face that is
// not seen costs nothing.
template <class Shader>
long draw_color(int begin, int end, const Shader& shader, const mat4& Viewport, const FaceBuffer& faces,
                    const std::vector<char>& seen, int first_number, TGAImage& picture, int threads) {
    assert(picture.width() == faces.width() && picture.height() == faces.height());
    return for_each_face(
        begin, end, shader, Viewport, picture.width(), picture.height(), threads,
        [&](int face) { return seen[static_cast<std::size_t>(first_number + face)] != 0; },
        [&](const TriangleSetup& t, Shader& own, const Share& share, Counters& count) {
            shade(t, first_number + t.face, own, faces, picture, share, count);
        }).shaded;
}

// ---- the exact shadow ----

// Faces sorted into the cells of a grid on the light's screen, so that the few that may stand between a point and the light
// are found at once. No resolution, no bias: whether one does is decided on the face itself.
class LightGrid {
public:
    LightGrid() = default;
    // The light's screen is cells x cells large and shows all faces. Takes at most 720 bytes a face and 4 a cell.
    LightGrid(const std::vector<Model>& models, const Camera& light, int cells);

    // About one cell a face: measured, fewer make long lists and more take longer to fill than they save.
    static int good_cells(int faces) { return std::clamp(static_cast<int>(std::sqrt(faces)), 1, 2048); }

    // Whether any face but `number` lies between the light and a point of that face, given on the light's screen.
    bool shadows(const vec3& on_screen, int number) const;

    std::size_t bytes() const;

private:
    struct Entry {
        float zmax;  // of the face, rounded up
        std::int32_t face;
    };
    bool covers(int face, const vec3& p) const;

    int cells_ = 0;                     // a side
    double scale_ = 1;                  // cells to a pixel of the light's screen
    double zmax_ = 0;                   // the largest |z| of all corners
    std::vector<vec3> corners_;         // three a face
    std::vector<std::uint32_t> first_;  // entries of cell c: first_[c] to first_[c+1]
    std::vector<Entry> entries_;        // in each cell the nearest to the light first
};
