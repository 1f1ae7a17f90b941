// our_gl.cpp: the cameras' matrices; the way of a face from clip space to the pixels that it covers, and of these to
// their colours; the threads; the bias and the grid of the shadows.
#include "our_gl.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <numbers>
#include <stdexcept>
#include <system_error>
#include <thread>

// ---- cameras ----

mat4 lookat(const vec3& eye, const vec3& center, const vec3& up) {
    vec3 z = normalized(eye - center);
    if (z == vec3{}) z = {0, 0, 1};
    vec3 x = normalized(cross(normalized(up), z));
    if (x == vec3{}) {
        const vec3 a{std::fabs(z.x), std::fabs(z.y), std::fabs(z.z)};
        const vec3 axis = a.y <= a.x && a.y <= a.z ? vec3{0, 1, 0} : a.x <= a.z ? vec3{1, 0, 0} : vec3{0, 0, 1};
        x = normalized(cross(axis, z));
    }
    const vec3 y = cross(z, x);
    const mat4 rotation{{{x.x, x.y, x.z, 0}, {y.x, y.y, y.z, 0}, {z.x, z.y, z.z, 0}, {0, 0, 0, 1}}};
    return rotation * translation(-center);  // rotate about the centre, not about the origin
}

mat4 projection(double c) { return {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, c, 1}}}; }

mat4 rotation(const vec3& axis, double degrees) {  // O. Rodrigues, 1840
    const vec3 k = axis == vec3{} ? vec3{0, 1, 0} : normalized(axis);
    const double angle = std::fmod(degrees, 360) * std::numbers::pi / 180, c = std::cos(angle), s = std::sin(angle);
    mat4 m = mat4::identity();
    for (int j = 0; j < 3; j++) {
        vec3 e;
        e[j] = 1;
        const vec3 turned = e * c + cross(k, e) * s + k * (k[j] * (1 - c));
        for (int i = 0; i < 3; i++) m[i][j] = turned[i];
    }
    return m;
}

mat4 beam(double distance, double half_angle) {
    const double reach = distance * std::tan(half_angle * std::numbers::pi / 180);  // in the plane of the center
    mat4 m = projection(-1 / distance);
    m[0].x = m[1].y = 1 / reach;
    return m;
}

mat4 viewport(double x, double y, double w, double h) {
    const double d = screen_depth;
    return {{{w / 2, 0, 0, x + w / 2}, {0, h / 2, 0, y + h / 2}, {0, 0, d / 2, d / 2}, {0, 0, 0, 1}}};
}

mat4 translation(const vec3& by) { return {{{1, 0, 0, by.x}, {0, 1, 0, by.y}, {0, 0, 1, by.z}, {0, 0, 0, 1}}}; }

mat4 middle_viewport(int width, int height, double zoom) {
    const double side = .75 * std::min(width, height) * zoom;
    return viewport((width - side) / 2, (height - side) / 2, side, side);
}

bool fit(std::vector<Model>& scene, const vec3& eye, const vec3& up) {
    const mat4 ModelView = lookat(eye, {}, up);
    const double distance = norm(eye), reach = 4. / 3;  // where a picture ends whose middle three quarters are [-1,1]^2
    const auto largest = [](const vec3& v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); };
    // Times s = 1/need a vertex is seen on the border of [-1,1]^2: there s max(|x|,|y|) = w = 1 - s z/|eye|.
    const auto need = [&](const vec3& v, double border) {
        const vec4 p = ModelView * point(v);
        return std::max(std::fabs(p.x), std::fabs(p.y)) / border + p.z / distance;
    };
    vec3 low = scene[0].low(), high = scene[0].high();
    bool in_view = true;
    for (const Model& model : scene) {
        for (int i = 0; i < 3; i++) {
            low[i] = std::min(low[i], model.low()[i]);
            high[i] = std::max(high[i], model.high()[i]);
        }
        for (const vec3& v : model.verts()) in_view = in_view && need(v, reach) < 1;
    }
    const double extent = std::max(largest(low), largest(high));
    if (extent == 0 || (in_view && largest(high - low) >= 1 && norm(low + high) <= 1)) return false;

    // First the largest coordinate is brought into [1,2), so that nothing overflows. From there on the numbers are the
    // same whatever power of two the scene is multiplied by, and so are their roundings. (2^1023 is the largest one.)
    const double unit = std::scalbn(1., std::min(-std::ilogb(extent), 1023));
    low = low * unit, high = high * unit;
    double most = 0;
    for (Model& model : scene) {
        // Twice the way from the centre, which itself may be no double.
        model.move([&](const vec3& v) { return (v * unit - low) - (high - v * unit); });
        for (const vec3& v : model.verts()) most = std::max(most, need(v, 1));
    }
    for (Model& model : scene) model.move([&](const vec3& v) { return most > 0 ? v / most : v; });
    return true;
}

// The near plane, as a share of the distance from eye to centre. w = 1 + c z is near zero there and carries the
// rounding of a number near one, some 2^-50 after the matrix products; a corner on the guard band at 2^15 pixels then
// moves by 2^15 * 2^-50 / w_near. With w_near = 2^-22 that is 2^-13 pixel, which no picture shows, and things stay
// visible down to a quarter of a millionth of the viewing distance.
static constexpr double w_near = 1. / (1 << 22);

Camera fitted(const Camera& camera, const Models& models, int size) {
    constexpr double inf = std::numeric_limits<double>::infinity();
    const mat4 to_clip = camera.to_clip();
    const double c = camera.Projection[3].z;  // 0: orthographic
    const auto for_each_vertex = [&](auto&& visit) {
        for (const Model* model : models)
            for (const vec3& v : model->verts()) visit(to_clip * point(v));
    };
    // What is nearer to a light with a place than a thousandth of the way to what is farthest has larger depths than
    // screen_depth: else all others would share what is left of it.
    double nearest = w_near;
    if (c != 0) for_each_vertex([&](const vec4& p) { nearest = std::max(nearest, p.w / 1024); });
    vec3 low{inf, inf, inf}, high{-inf, -inf, -inf};
    for_each_vertex([&](const vec4& p) {
        const bool is_before = p.w >= nearest;
        const vec3 q = c == 0 ? p.xyz() : is_before ? project(p) : vec3{1, 1, (nearest - 1) / c / nearest};
        for (int i = 0; i < 3; i++) {
            low[i] = std::min(low[i], is_before || i == 2 ? q[i] : -q[i]);
            high[i] = std::max(high[i], q[i]);
        }
    });
    for (int i = 0; i < 2 && c != 0; i++) low[i] = std::max(low[i], -1.), high[i] = std::min(high[i], 1.);
    mat4 to_cube = mat4::identity();
    double largest = 0;
    for (int i = 0; i < 3; i++)
        largest = std::max(largest, std::max(std::fabs(low[i]), std::fabs(high[i])) / camera.Projection[i][i]);
    for (int i = 0; i < 3; i++) {  // the box [low,high] to [-1,1]^3
        double half = high[i] / 2 - low[i] / 2;
        // What is flat as the light sees it has a depth of rounding alone, which must not be blown up: it is some 2^-50
        // of the largest coordinate, and screen_depth/2 * 2^-50 / 2^-24 is below a quarter of depth_rounding.
        if (i == 2) half = std::max(half, largest * 0x1p-24);
        if (!(half >= 0x1p-1000)) half = 1;  // no extent, or one whose inverse is no double: any scale will do
        to_cube[i][i] = 1 / half;
        to_cube[i][3] = -(low[i] + half) / half;
    }
    return {camera.ModelView, to_cube * camera.Projection, viewport(0, 0, size, size)};
}

namespace {

// A corner of a model's box, transformed, and what rounding may have done to each coordinate: to the products that make
// up M and to four more with their sums, some 20 half-units of 2^-53 of their sizes; 2^-48 is 32.
struct Corner {
    vec4 at, off;
};
std::array<Corner, 8> box_corners(const Model& model, const mat4& M) {
    const vec3 sides[] = {model.low(), model.high()};
    std::array<Corner, 8> corners;
    for (int k = 0; k < 8; k++) {
        const vec4 p = point(vec3{sides[k & 1].x, sides[k >> 1 & 1].y, sides[k >> 2].z});
        corners[k].at = M * p;
        for (int i = 0; i < 4; i++)
            for (int j = 0; j < 4; j++) corners[k].off[i] += std::fabs(M[i][j] * p[j]) * 0x1p-48;
    }
    return corners;
}

}  // namespace

Models seen_by(const Camera& camera, const Models& models, int width, int height) {
    Models seen;
    for (const Model* model : models) {
        const auto corners = box_corners(*model, camera.to_screen());
        const auto all = [&](auto&& beyond) { return std::all_of(corners.begin(), corners.end(), beyond); };
        // What is no number is beyond nothing.
        if (all([](const Corner& c) { return c.at.w + c.off.w < 0; }) ||
            all([](const Corner& c) { return c.at.x + c.off.x < 0; }) ||
            all([](const Corner& c) { return c.at.y + c.off.y < 0; }) ||
            all([=](const Corner& c) { return c.at.x - c.off.x > width * (c.at.w + c.off.w); }) ||
            all([=](const Corner& c) { return c.at.y - c.off.y > height * (c.at.w + c.off.w); }))
            continue;
        seen.push_back(model);
    }
    return seen;
}

Models casters(const Models& models, const Models& receivers, const Camera& light) {
    if (light.Projection[3].z != 0) {
        const Camera reach{light.ModelView, light.Projection, viewport(0, 0, 1, 1)};
        return receivers.empty() ? Models() : seen_by(reach, models, 1, 1);
    }
    const auto box = [&](const Model* model) {
        constexpr double inf = std::numeric_limits<double>::infinity();
        vec3 low{inf, inf, inf}, high = -low;
        for (const Corner& c : box_corners(*model, light.ModelView))
            for (int i = 0; i < 3; i++) {
                low[i] = std::min(low[i], c.at[i] - c.off[i]);
                high[i] = std::max(high[i], c.at[i] + c.off[i]);
            }
        return std::pair(low, high);
    };
    std::vector<std::pair<vec3, vec3>> lit;
    for (const Model* receiver : receivers) lit.push_back(box(receiver));
    Models result;
    for (const Model* model : models) {
        const auto [low, high] = box(model);
        const auto may_shadow = [l = low, h = high](const auto& receiver) {
            const auto& [from, to] = receiver;
            return !(l.x > to.x || h.x < from.x || l.y > to.y || h.y < from.y || h.z < from.z);
        };
        if (std::any_of(lit.begin(), lit.end(), may_shadow)) result.push_back(model);
    }
    return result;
}

// ---- the z-buffer ----

DepthBuffer::DepthBuffer(int width, int height) : w_(width), h_(height), stride_((width + lanes - 1) / lanes * lanes) {
    if (w_ < 1 || h_ < 1 || w_ > max_size || h_ > max_size)
        throw std::invalid_argument("a buffer has 1 to 16384 pixels a side");
    cells_ = std::make_unique_for_overwrite<float[]>(std::size_t{1} * stride_ * h_);
}

TGAImage depth_picture(const DepthBuffer& depths, double aspect) {
    constexpr double darkest = 32, white = 255;
    float far = -DepthBuffer::nothing, near = DepthBuffer::nothing;
    for (int y = 0; y < depths.height(); y++)
        for (int x = 0; x < depths.width(); x++)
            if (const float z = depths.row(y)[x]; z != DepthBuffer::nothing)
                far = std::min(far, z), near = std::max(near, z);
    const double scale = near > far ? (white - darkest) / (double{near} - double{far}) : 0;
    const int w = depths.width(), h = depths.height();
    // What is flat as the light sees it has no aspect to speak of: a column or row of it is left.
    const int columns = std::max(1, static_cast<int>(w * std::min(1., aspect) + .5));
    const int rows = std::max(1, static_cast<int>(h * std::min(1., 1 / aspect) + .5));
    TGAImage picture(w, h, TGAImage::GRAYSCALE);
    for (int y = 0; y < rows; y++)
        for (int x = 0; x < columns; x++) {  // the cell in which the pixel's centre lies
            const float z = depths.row((2 * y + 1) * h / (2 * rows))[(2 * x + 1) * w / (2 * columns)];
            std::uint8_t& pixel = *picture.pixel((w - columns) / 2 + x, (h - rows) / 2 + y);
            const double below = scale * (double{near} - double{z});  // rounding may make it too large by a hair
            if (z != DepthBuffer::nothing) pixel = static_cast<std::uint8_t>(white - std::min(below, white - darkest));
        }
    return picture;
}

SkyShader::SkyShader(const Model& m, const Camera& camera) : IShader(m), uniform_PM(camera.to_clip()) {
    for (int i = 0; i < 4; i++) uniform_PM[i] = uniform_PM[i] / -camera.Projection[3].z;
}

vec4 SkyShader::vertex(int vert) const {
    vec4 p = uniform_PM * direction(normalized(model.vert(vert)));  // where the eye is does not count
    p.z = -1e20 * p.w;  // behind all that a scene of less than 1e17 units could hold: screen_depth is for two units
    return p;
}

void SkyShader::varying(int iface, int nthvert) {
    material = &model.material(iface);
    varying_uv[nthvert] = model.uv(iface, nthvert);
}

Color SkyShader::fragment(const Fragment& f) const {
    if (!material->diffuse) return bgr(material->Kd * 255);
    return Texels(material->diffuse, interpolated(varying_uv, f.bar)).bgr();
}

vec<2, coord> moved(const Map& map, const UV& uv) {
    return UV({uv.given.x * map.scale.x + map.offset.x, uv.given.y * map.scale.y + map.offset.y}).wrapped;
}

// ---- threads ----

namespace {

// Threads that wait for work, which is given out in rounds. Who gives it out works too. (A condition variable, because
// waiting for an atomic hung under mingw once in a dozen runs.)
class Pool {
public:
    explicit Pool(int threads) {
        try {
            for (int me = 1; me < threads; me++) others_.emplace_back([this, me] { work_in_rounds(me); });
        } catch (const std::exception&) {
            // no more threads to be had: those that run share the work
        }
    }
    ~Pool() {
        work_ = nullptr;
        change([this] { round_++; });
    }

    void run(int n, const std::function<void(int, int)>& work) {
        work_ = &work, n_ = n, next_ = 0, error_ = nullptr;
        change([this] { working_ = static_cast<int>(others_.size()), round_++; });
        share(0);
        wait_for([this] { return working_ == 0; });
        if (error_) std::rethrow_exception(error_);
    }

private:
    void share(int me) {
        int i = 0;
        try {
            while ((i = next_++) < n_) (*work_)(i, me);
        } catch (...) {
            const std::lock_guard lock(mutex_);
            if (!error_ || i < failed_) error_ = std::current_exception(), failed_ = i;
        }
    }
    void work_in_rounds(int me) {
        for (int round = 0;; round++) {
            wait_for([&] { return round_ != round; });
            if (!work_) return;
            share(me);
            change([this] { working_--; });
        }
    }
    template <class F>
    void change(F&& f) {
        {
            const std::lock_guard lock(mutex_);
            f();
        }
        changed_.notify_all();
    }
    template <class F>
    void wait_for(F&& ready) {
        for (int i = 0; i < 4000; i++)  // some microseconds: often sooner than to sleep and be woken up
            if (ready()) return;
        std::unique_lock lock(mutex_);
        changed_.wait(lock, ready);
    }

    const std::function<void(int, int)>* work_ = nullptr;
    int n_ = 0, failed_ = 0;
    std::atomic<int> next_ = 0, working_ = 0, round_ = 0;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::exception_ptr error_;
    std::vector<std::jthread> others_;  // last: they end before what they use
};

int wanted_threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));

}  // namespace

void use_threads(int n) { wanted_threads = n; }
int thread_count() { return wanted_threads; }

void parallel_for(int n, const std::function<void(int, int)>& work) {
    static std::optional<Pool> pool;
    static int threads = 0;
    if (threads != thread_count()) pool.reset(), pool.emplace(threads = thread_count());
    pool->run(n, work);
}

namespace {

// The vertices or the faces of several models, numbered through: first[m] is the first of model m, first.back() their
// count. They are dealt out in parts of consecutive ones. A thread gets several, in case that some take longer than
// others; none is worth fewer than 64.
int parts(const std::vector<int>& first) { return std::clamp(first.back() / 64, 1, 8 * thread_count()); }

// Calls work(part, m, begin, end, thread) for [begin,end) of model m, which belongs to a part.
template <class Work>
void in_parts(const std::vector<int>& first, Work&& work) {
    const int n = parts(first);
    const auto begin_of = [&](int part) { return static_cast<int>(std::int64_t{first.back()} * part / n); };
    parallel_for(n, [&](int part, int thread) {
        int begin = begin_of(part), end = begin_of(part + 1);
        auto m = static_cast<int>(std::upper_bound(first.begin(), first.end(), begin) - first.begin()) - 1;
        for (; begin < end; begin = first[++m])
            work(part, m, begin - first[m], std::min(end, first[m + 1]) - first[m], thread);
    });
}

// ---- a face on the screen ----

// Corners are snapped to 1/65536 pixel for coverage, which is decided in whole numbers, and for what is nearest;
// barycentric coordinates come from the corners as they are.
constexpr int subpixel_bits = 16;
// Of a triangle cut by five planes. A plane adds one corner to what is convex; where rounding bends a face seen edge-on
// it may add one for every two: 3, 4, 6, 9, 13, 19.
constexpr int most_corners = 19;

// How far outside of the picture, in pixels, coverage is still computed exactly instead of being clipped: most faces
// that cross the border need no clipping. 2 * 4096 + 16384 pixels at 16 sub-pixel bits make differences below 2^30.6.
constexpr double guard = 4096;

// A face in homogeneous screen coordinates, which may be scaled at will: near is the w of the near plane at their
// scale, size their largest magnitude.
struct Screen {
    vec4 corner[3];
    double size = 0, near = w_near;
};

// Measures the corners. False for a coordinate beyond the range of a double, which has no place on the screen.
bool measure(Screen& s) {
    for (const vec4& p : s.corner) {
        for (int k = 0; k < 4; k++) {
            if (!std::isfinite(p[k])) return false;
            s.size = std::max(s.size, std::fabs(p[k]));
        }
    }
    // Clipping adds up to 2^15 times the coordinates: a power of two, which is exact, keeps that in a double's range.
    if (s.size > 0x1p1000) {
        for (vec4& p : s.corner) p = p * 0x1p-40;
        s.size *= 0x1p-40, s.near *= 0x1p-40;
    }
    return true;
}

// Whether the face is wholly behind the eye or beyond one side of the picture.
bool is_outside(const Screen& s, int width, int height) {
    const auto all = [&s](auto&& beyond) { return beyond(s.corner[0]) && beyond(s.corner[1]) && beyond(s.corner[2]); };
    return all([&](const vec4& p) { return !(p.w >= s.near); }) || all([](const vec4& p) { return !(p.x > 0); }) ||
           all([](const vec4& p) { return !(p.y > 0); }) || all([=](const vec4& p) { return !(p.x < width * p.w); }) ||
           all([=](const vec4& p) { return !(p.y < height * p.w); });
}

// A clipping plane, x, y or w = bound w (or near, for w): what is inside has a distance of at least 0.
struct Plane {
    int axis;
    double side, bound;
    double distance(const vec4& s) const { return axis == 3 ? s.w - bound : side * (s[axis] - bound * s.w); }
    // What a sum of large numbers lost of a distance that is zero: the end of an edge that is 1e20 pixels long would be
    // thousands of pixels off its plane.
    void pull(vec4& s) const { s[axis] = axis == 3 ? bound : bound * s.w; }
};

// Sutherland and Hodgman, one plane. A cut edge gets the same new corner from both of its faces, bit for bit: it is
// always computed from the inner towards the outer end.
int clip_polygon(const Plane& plane, const vec4* in, int n, vec4* out) {
    int m = 0;
    for (int i = 0; i < n; i++) {
        const vec4 &a = in[i], &b = in[(i + 1) % n];
        const double da = plane.distance(a), db = plane.distance(b);
        if (da >= 0) out[m++] = a;
        if ((da >= 0) != (db >= 0)) {
            const bool a_inside = da >= 0;
            const double d_in = a_inside ? da : db, d_out = a_inside ? db : da;
            const vec4 &p = a_inside ? a : b, &q = a_inside ? b : a;
            // A mean with positive weights: p + (q - p) t would lose a q that is some 2^53 times smaller than p.
            const double length = d_in - d_out;
            out[m] = p * (-d_out / length) + q * (d_in / length);
            plane.pull(out[m++]);
        }
    }
    return m;
}

// A corner after the division by w: on the grid of 1/65536 pixel, and its depth.
struct Point {
    std::int32_t x, y;
    double z;
};

constexpr std::int32_t to_be_clipped = INT32_MIN / 2;  // the x of a vertex that is not within the guard band

INLINED Point snapped(const vec4& s, int width, int height) {
    constexpr double one = 1 << subpixel_bits;
    const vec3 p = project(s);
    // On a guard plane rounding may land a hair outside: that is no more than 2^-10 of a sub-pixel.
    return {static_cast<std::int32_t>(std::floor(std::clamp(p.x, -guard, width + guard) * one + .5)),
            static_cast<std::int32_t>(std::floor(std::clamp(p.y, -guard, height + guard) * one + .5)), p.z};
}

// Cuts the face to what is in front of the eye and inside the guard band; returns the number of corners, 0 for nothing.
int clip(const Screen& s, int width, int height, Point (&corners)[most_corners]) {
    const Plane planes[] = {
        {3, 1, s.near}, {0, 1, -guard}, {0, -1, width + guard}, {1, 1, -guard}, {1, -1, height + guard}};
    vec4 polygon[most_corners];
    std::copy_n(s.corner, 3, polygon);
    int n = 3;
    for (const Plane& plane : planes) {
        const auto is_inside = [&](const vec4& p) { return plane.distance(p) >= 0; };
        if (std::all_of(s.corner, s.corner + 3, is_inside)) continue;
        vec4 cut[most_corners];
        n = clip_polygon(plane, polygon, n, cut);
        std::copy_n(cut, n, polygon);
    }
    if (n < 3) return 0;
    for (int i = 0; i < n; i++) corners[i] = snapped(polygon[i], width, height);
    return n;
}

// The pixels whose centres lie in the box of a face, and the depths of its corners.
struct Box {
    int xmin, xmax, ymin, ymax;
    bool is_small;  // at most small_box pixels wide and high
    bool is_cut;    // the face has been clipped
    double zmin, zmax;
};

constexpr int small_box = 60;

// The box and the range of depths of a polygon; false where it covers no pixel's centre.
INLINED bool bound(const Point* corners, int n, int width, int height, Box& c) {
    constexpr std::int32_t half = 1 << (subpixel_bits - 1);
    Point low = corners[0], high = low;
    for (int i = 1; i < n; i++) {
        const Point& p = corners[i];
        low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
        high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    // A depth beyond the range of a float is drawn as its largest one, not as infinity.
    constexpr double most = std::numeric_limits<float>::max();
    c.zmin = std::clamp(low.z, -most, most), c.zmax = std::clamp(high.z, -most, most);
    c.is_small = std::max(high.x - low.x, high.y - low.y) <= small_box << subpixel_bits;
    // Pixel x has its centre at x + half: the first at or right of low, the last at or left of high.
    c.xmin = std::max(0, (low.x + half - 1) >> subpixel_bits);
    c.ymin = std::max(0, (low.y + half - 1) >> subpixel_bits);
    c.xmax = std::min(width - 1, (high.x - half) >> subpixel_bits);
    c.ymax = std::min(height - 1, (high.y - half) >> subpixel_bits);
    return c.xmin <= c.xmax && c.ymin <= c.ymax;
}

// Which of the faces [first,end), one a lane, cover no pixel's centre: there is none in their box, or one that lies
// outside of them. A dense mesh is made of these, and to find them side by side takes .8 of the time.
INLINED mask cover_nothing(const Model& model, const Point* vertices, int first, int end) {
    using Lanes = pack<std::int32_t>;
    constexpr std::int32_t one = 1 << subpixel_bits, half = one / 2;
    Lanes x[3], y[3];
    for (int k = 0; k < 3; k++) {
        std::int32_t xs[lanes], ys[lanes];
        for (int i = 0; i < lanes; i++) {
            const Point& p = vertices[model.corner(std::min(first + i, end - 1), k).vert];
            xs[i] = p.x, ys[i] = p.y;
        }
        x[k] = Lanes::load(xs), y[k] = Lanes::load(ys);
    }
    // As in bound(), but not limited to the picture.
    const auto first_in = [](const Lanes (&a)[3]) { return (min(min(a[0], a[1]), a[2]) + half - 1) >> subpixel_bits; };
    const auto last_in = [](const Lanes (&a)[3]) { return (max(max(a[0], a[1]), a[2]) - half) >> subpixel_bits; };
    const Lanes xmin = first_in(x), xmax = last_in(x), ymin = first_in(y), ymax = last_in(y);
    // Twice the areas that this one centre has with the edges: exact, since it is less than a pixel from each corner.
    coord dx[3], dy[3];
    for (int k = 0; k < 3; k++) {
        dx[k] = to_coord(x[k]) - to_coord(xmin * one + half);
        dy[k] = to_coord(y[k]) - to_coord(ymin * one + half);
    }
    const auto area2 = [&](int i, int j) { return dx[i] * dy[j] - dy[i] * dx[j]; };
    const coord u = area2(1, 2), v = area2(2, 0), w = area2(0, 1);
    const mask is_one = (xmin == xmax) & (ymin == ymax), is_beside = (min(min(u, v), w) < 0) & (max(max(u, v), w) > 0);
    const mask is_cut = (x[0] == to_be_clipped) | (x[1] == to_be_clipped) | (x[2] == to_be_clipped);
    return ((xmin > xmax) | (ymin > ymax) | (is_one & is_beside)) & !is_cut;
}

// Depth is linear on the screen: zx (x - xmin) + zy (y - ymin) + z0 at the centre of the pixel (x,y), where (xmin,ymin)
// is the first of the face's box.
struct DepthPlane {
    double zx, zy, z0;
};

// Through the corners of a triangle as they are snapped, whose signed area is half of area2. So a depth is off by what
// half a sub-pixel along each axis may change, and inside it is a mean of the corners'.
INLINED DepthPlane depth_plane(const Point& a, const Point& b, const Point& c, double area2, const Box& box) {
    constexpr double one = 1 << subpixel_bits;
    const double bx = b.x - a.x, by = b.y - a.y, bz = b.z - a.z, cx = c.x - a.x, cy = c.y - a.y, cz = c.z - a.z;
    const double share = one / area2, zx = (bz * cy - cz * by) * share, zy = (cz * bx - bz * cx) * share;
    return {zx, zy, a.z + zx * (box.xmin + .5 - a.x / one) + zy * (box.ymin + .5 - a.y / one)};
}

// Perspective without a division per corner (Olano and Greer, "Triangle scan conversion using 2D homogeneous
// coordinates", 1997): with the corners as rows (x,y,w) of a matrix, the columns of its adjugate are functions ex dx +
// ey dy + e0 that are linear on the screen, and in the ratio of the barycentric coordinates on the face. They hold for
// the whole face, clipped or not, corners behind the eye included. dx and dy are relative to the centre of the pixel
// (xmin, ymin) of the face, which keeps the products small.
struct Barycentric : DepthPlane {
    vec3 ex, ey, e0;
    bool front_facing;
};

// The depth is sum(z_i e_i) / sum(w_i e_i): the denominator is |det| everywhere.
INLINED Barycentric planes(Screen& s, const Box& box) {
    // The products of three coordinates that follow stay within the range of a double for these sizes; others are
    // scaled.
    if (!(s.size > 0x1p-200 && s.size < 0x1p200))
        for (vec4& p : s.corner)
            for (int i = 0; i < 4; i++) p[i] = std::scalbn(p[i], -std::ilogb(s.size));
    const vec4* const p = s.corner;
    vec3 v[3];
    for (int i = 0; i < 3; i++) v[i] = {p[i].x - (box.xmin + .5) * p[i].w, p[i].y - (box.ymin + .5) * p[i].w, p[i].w};
    vec3 e[3] = {cross(v[1], v[2]), cross(v[2], v[0]), cross(v[0], v[1])};
    const double det = dot(v[0], e[0]);
    // Seen exactly edge-on, yet snapped to a sliver: its neighbours leave those samples to it. It shows corner 0.
    if (det == 0 || !std::isfinite(det)) return {{0, 0, box.zmax}, {}, {}, {1, 0, 0}, true};
    if (det < 0)
        for (vec3& f : e) f = -f;
    Barycentric b{{}, {e[0].x, e[1].x, e[2].x}, {e[0].y, e[1].y, e[2].y}, {e[0].z, e[1].z, e[2].z}, det > 0};
    // Depths are taken relative to that of the corner farthest in front of the eye, so that a small slope is not the
    // difference of large numbers.
    const int r = p[0].w >= p[1].w ? (p[0].w >= p[2].w ? 0 : 2) : (p[1].w >= p[2].w ? 1 : 2);
    const double z_r = p[r].z / p[r].w;
    vec3 z{p[0].z - z_r * p[0].w, p[1].z - z_r * p[1].w, p[2].z - z_r * p[2].w};
    z[r] = 0;
    const double share = 1 / std::fabs(det);
    b.zx = dot(z, b.ex) * share, b.zy = dot(z, b.ey) * share, b.z0 = z_r + dot(z, b.e0) * share;
    return b;
}

// ---- the pixels of a face ----

const pack<std::int32_t> lane_numbers = [] {
    std::int32_t numbers[lanes];
    for (int i = 0; i < lanes; i++) numbers[i] = i;
    return pack<std::int32_t>::load(numbers);
}();
const coord lane_coords = to_coord(lane_numbers);

// The edge function of two corners is twice a signed area: positive inside; where it is zero the pixel's centre lies on
// the edge and belongs to it if the edge is a left one (it runs down) or a top one (it runs left), so that of two
// triangles sharing an edge exactly one owns the pixel. With max_size pixels and the guard band, differences of
// coordinates are below 2^30.6 and edge functions below 2^62.2. From pixel to pixel they change by multiples of
// 2^subpixel_bits: the bits below decide nothing and are cut off.
struct Edge {
    std::int64_t first, right, up;  // the function at the centre of the first pixel, and its steps from pixel to pixel
};

// Calls visit(x0, y, inside) for the pixels of a triangle on the rows [y_begin, y_end): x0 is a multiple of lanes,
// inside says which of the pixels from there on. The edges' first pixel is (c.xmin / lanes * lanes, y_begin). Returns
// in each lane how many pixels are inside. This one asks at every pixel of the box, and takes less time for small ones:
// corners differ by at most 60 pixels, and a pixel beside the box by at most 7 more, so that what is left of two
// products without the bits that are cut off is below 2 * 60 * 67 * 2^16 < 2^29.
template <class Visit>
INLINED pack<std::int32_t> for_each_in_box(const Box& c, const Edge (&edges)[3], int y_begin, int y_end,
                                           Visit&& visit) {
    using Lanes = pack<std::int32_t>;
    Lanes row[3], right[3], up[3], inside_in_all = 0;
    for (int i = 0; i < 3; i++) {
        const auto step = static_cast<std::int32_t>(edges[i].right);
        row[i] = lane_numbers * step + static_cast<std::int32_t>(edges[i].first);
        right[i] = step * lanes, up[i] = static_cast<std::int32_t>(edges[i].up);
    }
    for (int y = y_begin; y < y_end; y++) {
        Lanes e[3] = {row[0], row[1], row[2]};
        for (int x0 = c.xmin / lanes * lanes; x0 <= c.xmax; x0 += lanes) {
            const mask inside = (min(min(e[0], e[1]), e[2]) > -1) & (lane_numbers < c.xmax + 1 - x0);
            visit(x0, y, inside);
            inside_in_all = inside_in_all + select(inside, Lanes(1), 0);
            for (int i = 0; i < 3; i++) e[i] = e[i] + right[i];
        }
        for (int i = 0; i < 3; i++) row[i] = row[i] + up[i];
    }
    return inside_in_all;
}

// The same for a triangle of any size. How often the step along a row goes into an edge function is where that changes
// its sign; from row to row it grows by a quotient and a remainder, as in Bresenham's lines.
template <class Visit>
INLINED pack<std::int32_t> for_each_in_spans(const Box& c, const Edge (&edges)[3], int y_begin, int y_end,
                                             Visit&& visit) {
    struct Crossing {
        std::int64_t divisor, times, rest, more_times, more_rest;
    } crossings[3];
    for (int i = 0; i < 3; i++) {
        Crossing& e = crossings[i];
        e.divisor = edges[i].right ? std::abs(edges[i].right) : 1;
        const auto divide = [&e](std::int64_t n, std::int64_t& quotient, std::int64_t& remainder) {  // rounded down
            quotient = n / e.divisor, remainder = n % e.divisor;
            if (remainder < 0) quotient--, remainder += e.divisor;
        };
        divide(edges[i].first, e.times, e.rest);
        divide(edges[i].up, e.more_times, e.more_rest);
    }
    const int x_first = c.xmin / lanes * lanes;
    pack<std::int32_t> inside_in_all = 0;
    for (int y = y_begin; y < y_end; y++) {
        std::int64_t begin = 0, end = c.xmax + 1 - x_first;
        for (int i = 0; i < 3; i++) {
            Crossing& e = crossings[i];
            if (edges[i].right > 0) begin = std::max(begin, -e.times);
            else if (edges[i].right < 0) end = std::min(end, e.times + 1);
            else if (e.times < 0) end = 0;
            e.times += e.more_times, e.rest += e.more_rest;
            const std::int64_t carry = (e.divisor - 1 - e.rest) >> 63;  // -1 or 0; a branch would be guessed wrong
            e.times -= carry, e.rest -= e.divisor & carry;
        }
        if (begin >= end) continue;
        for (auto x = static_cast<int>(begin) / lanes * lanes; x < end; x += lanes) {
            const mask inside = (lane_numbers > begin - x - 1) & (lane_numbers < end - x);
            visit(x_first + x, y, inside);
            inside_in_all = inside_in_all + select(inside, pack<std::int32_t>(1), 0);
        }
    }
    return inside_in_all;
}

// ---- drawing ----

struct Face {
    int shader, iface;
    int vertex[3];  // among all
};
struct FaceInBox : Face, Box {};

// Some consecutive faces, looked at by one thread.
struct Block {
    std::vector<std::vector<Face>> touching;  // those that touch a strip
    Counters count;
};

// What a thread needs for a strip.
struct Workspace {
    std::vector<float> depth;
    std::vector<std::int32_t> nearest;  // which of the faces is nearest at each pixel, -1 for none
    std::vector<FaceInBox> faces;
    Counters count;
};

struct Pass {
    const Shaders& shader;
    const int nshaders;
    const mat4& Viewport;
    const int width, height;
    DepthBuffer* const zbuffer;  // one of the two is drawn into
    TGAImage* const picture;
    const Faces drawn;           // which faces

    // The picture is drawn in strips of rows, each by one thread from the first face to the last: so a pixel sees the
    // faces in their order. A strip's depths and marks, 8 bytes a pixel, fit into the cache of a core.
    const int strip_rows = std::clamp(32768 / width, 8, 64), strips = (height + strip_rows - 1) / strip_rows;
    const int stride = (width + lanes - 1) / lanes * lanes;  // a row is as long as a whole number of lanes
    std::vector<int> first_face{0};  // of each shader, among all
    std::vector<int> first_vertex{0};
    std::vector<Point>& vertices = kept<Point>();
    std::vector<Block>& blocks = kept<Block>();
    std::vector<Workspace>& spaces = kept<Workspace>();

    // The memory of the last pass: on 160 000 faces to touch fresh one costs a sixth of the time.
    template <class T>
    static std::vector<T>& kept() {
        static std::vector<T> all;
        return all;
    }

    Counters draw() {
        for (int i = 0; i < nshaders; i++) {
            const Model& model = shader(i, 0).model;
            first_face.push_back(first_face[i] + model.nfaces());
            first_vertex.push_back(first_vertex[i] + model.nverts());
        }
        vertices.resize(first_vertex.back());
        in_parts(first_vertex, [this](int, int s, int begin, int end, int thread) {
            const IShader& own = shader(s, thread);
            for (int i = begin; i < end; i++) vertices[first_vertex[s] + i] = placed(Viewport * own.vertex(i));
        });
        blocks.resize(parts(first_face));
        for (Block& b : blocks) {
            b.touching.resize(strips), b.count = {};
            for (std::vector<Face>& faces : b.touching) faces.clear();
        }
        in_parts(first_face, [this](int part, int s, int begin, int end, int thread) {
            const IShader& own = shader(s, thread);
            sort_into_strips(s, begin, end, own, blocks[part]);
        });
        spaces.resize(thread_count());
        for (Workspace& w : spaces) w.count = {};
        parallel_for(strips, [this](int strip, int thread) { draw_strip(strip, thread); });
        Counters total;
        for (const Block& b : blocks) total += b.count;
        for (const Workspace& w : spaces) total += w.count;
        return total;
    }

    Point placed(const vec4& s) const {
        const bool inside = s.w >= w_near && s.x >= -guard * s.w && s.x <= (width + guard) * s.w &&
                            s.y >= -guard * s.w && s.y <= (height + guard) * s.w && s.w <= 0x1p100 &&
                            std::fabs(s.z) <= 0x1p100;
        return inside ? snapped(s, width, height) : Point{to_be_clipped, 0, 0};
    }

    Screen homogeneous(const Face& face, const IShader& own) const {
        Screen s;
        for (int i = 0; i < 3; i++) s.corner[i] = Viewport * own.vertex(face.vertex[i] - first_vertex[face.shader]);
        return s;
    }

    Barycentric planes_of(const FaceInBox& face, const IShader& own) const {
        Screen screen = homogeneous(face, own);
        measure(screen);
        return planes(screen, face);
    }

    // The corners of what is left of a face after clipping. Returns how many these are.
    int corners_of(const Face& face, const IShader& own, Point (&corners)[most_corners], bool& is_cut) const {
        is_cut = false;
        for (int i = 0; i < 3; i++) {
            corners[i] = vertices[face.vertex[i]];
            is_cut = is_cut || corners[i].x == to_be_clipped;
        }
        if (!is_cut) return 3;
        Screen screen = homogeneous(face, own);
        return measure(screen) && !is_outside(screen, width, height) ? clip(screen, width, height, corners) : 0;
    }

    // The faces [begin,end) of the shader s.
    void sort_into_strips(int s, int begin, int end, const IShader& own, Block& block) const {
        block.count.triangles += end - begin;
        for (int first = begin; first < end; first += lanes) {
            std::int32_t none[lanes];
            cover_nothing(own.model, &vertices[first_vertex[s]], first, end).m.store(none);
            for (int i = first; i < std::min(first + lanes, end); i++) {
                const auto vertex = [&](int k) { return first_vertex[s] + own.model.corner(i, k).vert; };
                if (none[i - first]) block.count.between_samples++;
                else sort_into_strips({s, i, {vertex(0), vertex(1), vertex(2)}}, own, block);
            }
        }
    }

    void sort_into_strips(const Face& face, const IShader& own, Block& block) const {
        Point corners[most_corners];
        Box c;
        const int n = corners_of(face, own, corners, c.is_cut);
        if (n == 0) block.count.outside++;
        else if (!bound(corners, n, width, height, c)) {
            const bool beside = c.xmin >= width || c.ymin >= height || c.xmax < 0 || c.ymax < 0;
            (beside ? block.count.outside : block.count.between_samples)++;
        } else for (int s = c.ymin / strip_rows; s <= c.ymax / strip_rows; s++)
            block.touching[s].push_back(face);
    }

    void draw_strip(int strip, int thread) const {
        Workspace& w = spaces[thread];
        const int y_begin = strip * strip_rows, y_end = std::min(y_begin + strip_rows, height);
        const int cells = stride * (y_end - y_begin);
        float* depth = zbuffer ? zbuffer->row(y_begin) : (w.depth.resize(cells), w.depth.data());
        std::fill_n(depth, cells, DepthBuffer::nothing);
        if (picture) w.nearest.assign(cells, -1), w.faces.clear();
        for (const Block& b : blocks) {
            pack<std::int32_t> covered = 0;
            for (const Face& each : b.touching[strip]) {
                FaceInBox face{each, {}};
                const IShader& own = shader(face.shader, thread);
                Point corners[most_corners];
                const int n = corners_of(face, own, corners, face.is_cut);
                bound(corners, n, width, height, face);
                for (int k = 2; k < n; k++)  // what has been cut is a fan of triangles
                    covered = covered + triangle(face, own, corners[0], corners[k - 1], corners[k], y_begin, y_end,
                                                 depth, w);
                if (picture) w.faces.push_back(face);
            }
            for (int i = 0; i < lanes; i++) w.count.covered += covered[i];
        }
        if (!picture) return;
        std::memset(picture->pixel(0, y_begin), 0, std::size_t{1} * picture->bytespp() * width * (y_end - y_begin));
        for (int mark = 0; mark < static_cast<int>(w.faces.size()); mark++)
            w.count.shaded += shade(mark, thread, y_begin, y_end);
    }

    // Draws a triangle of a face into the rows of a strip. Returns the number of samples in each lane.
    pack<std::int32_t> triangle(const FaceInBox& face, const IShader& own, const Point& a, const Point& b,
                                const Point& c, int y_begin, int y_end, float* depth, Workspace& w) const {
        using wide = std::int64_t;
        constexpr wide one = wide{1} << subpixel_bits, half = one / 2;
        const wide area = (wide{b.x} - a.x) * (wide{c.y} - a.y) - (wide{b.y} - a.y) * (wide{c.x} - a.x);
        if (area == 0 || (area > 0 && drawn == Faces::back)) return 0;
        // Where a face has been cut its depths reach screen_depth / 2 / w_near, 4e9: half a sub-pixel changes too much.
        const DepthPlane plane =
            face.is_cut ? planes_of(face, own) : depth_plane(a, b, c, static_cast<double>(area), face);
        const Point* const corner[] = {&a, area < 0 ? &c : &b, area < 0 ? &b : &c, &a};  // counterclockwise
        const int y_first = std::max(y_begin, face.ymin), y_stop = std::min(y_end, face.ymax + 1);
        const wide first_x = face.xmin / lanes * lanes * one + half, first_y = y_first * one + half;
        Edge edges[3];
        for (int i = 0; i < 3; i++) {
            const Point &p = *corner[i], &q = *corner[i + 1];
            const wide dx = wide{q.x} - p.x, dy = wide{q.y} - p.y;
            const bool top_left = dy < 0 || (dy == 0 && dx < 0);
            edges[i] = {(dx * (first_y - p.y) - dy * (first_x - p.x) - !top_left) >> subpixel_bits, -dy, dx};
        }

        const coord zx = plane.zx, zmin = face.zmin, zmax = face.zmax;
        const pack<std::int32_t> mark(static_cast<int>(w.faces.size()));
        std::int32_t* const nearest = picture ? w.nearest.data() : nullptr;
        const auto visit = [&, row_length = std::ptrdiff_t{stride}](int x0, int y, const mask& inside) {
            const coord z_row = plane.zy * (y - face.ymin) + plane.z0;
            const std::ptrdiff_t at = row_length * (y - y_begin) + x0;
            const real z = to_real(min(max(zx * (lane_coords + (x0 - face.xmin)) + z_row, zmin), zmax));
            const real old = real::load(depth + at);
            const mask nearer = (z > old) & inside;
            select(nearer, z, old).store(depth + at);
            if (nearest) select(nearer, mark, pack<std::int32_t>::load(nearest + at)).store(nearest + at);
        };
        if (face.is_small && face.xmax - face.xmin < 4 * lanes)
            return for_each_in_box(face, edges, y_first, y_stop, visit);
        return for_each_in_spans(face, edges, y_first, y_stop, visit);
    }

    // Colours those pixels of a strip that have the mark of a face, as many at once as there are lanes. Returns their
    // number.
    long shade(int mark, int thread, int y_begin, int y_end) const {
        const Workspace& w = spaces[thread];
        const FaceInBox& face = w.faces[mark];
        IShader& own = shader(face.shader, thread);
        constexpr int most = 32 * lanes;  // pixels that are collected before they are coloured
        std::int32_t xs[most], ys[most];
        int n = 0;
        long shaded = 0;
        Barycentric b;
        const auto color = [&] {
            for (int i = 0; i < 3 && shaded == 0; i++) own.varying(face.iface, i);  // it is seen
            if (shaded == 0) b = planes_of(face, own);
            shaded += n;
            for (int i = n; i % lanes; i++) xs[i] = xs[n - 1], ys[i] = ys[n - 1];  // the last one fills the lanes
            for (int i = 0; i < n; i += lanes) color_lanes(face, b, own, xs + i, ys + i, std::min(n - i, lanes));
            n = 0;
        };
        for (int y = std::max(y_begin, face.ymin); y < std::min(y_end, face.ymax + 1); y++) {
            const std::int32_t* const row = &w.nearest[std::ptrdiff_t{stride} * (y - y_begin)];
            for (int x = face.xmin; x <= face.xmax; x++) {
                xs[n] = x, ys[n] = y;
                n += row[x] == mark;  // no branch: it would be guessed wrong at both ends of a row
                if (n == most) color();
            }
        }
        if (n > 0) color();
        return shaded;
    }

    void color_lanes(const FaceInBox& face, const Barycentric& b, const IShader& own, const std::int32_t* xs,
                     const std::int32_t* ys, int n) const {
        const coord x = to_coord(pack<std::int32_t>::load(xs)), y = to_coord(pack<std::int32_t>::load(ys));
        const coord dx = x - face.xmin, dy = y - face.ymin;
        Fragment f;
        f.face = face.iface, f.front_facing = b.front_facing;
        f.screen = {x + .5, y + .5, min(max(b.zx * dx + (b.zy * dy + b.z0), face.zmin), face.zmax)};
        // Coverage is snapped, so a sample may lie outside of the face by a hair: it stays on it.
        for (int i = 0; i < 3; i++) f.bar[i] = max(b.ex[i] * dx + (b.ey[i] * dy + b.e0[i]), 0.);
        const coord sum = f.bar.x + f.bar.y + f.bar.z, share = 1 / sum;
        for (int i = 0; i < 3; i++) f.bar[i] = select(sum > 0, f.bar[i] * share, i == 0);
        const Color color = own.fragment(f);
        pack<std::int32_t> byte[3];
        for (int k = 0; k < 3; k++) byte[k] = to_int(min(color[k], 255));
        std::int32_t bgr[lanes];
        (byte[0] + byte[1] * 256 + byte[2] * 65536).store(bgr);
        for (int i = 0; i < n; i++) std::memcpy(picture->pixel(xs[i], ys[i]), &bgr[i], 3);
    }
};

}  // namespace

Counters& Counters::operator+=(const Counters& c) {
    triangles += c.triangles, outside += c.outside, between_samples += c.between_samples;
    covered += c.covered, shaded += c.shaded;
    return *this;
}

Counters draw(const Shaders& shader, int nshaders, const mat4& Viewport, DepthBuffer& zbuffer, Faces faces) {
    return Pass{shader, nshaders, Viewport, zbuffer.width(), zbuffer.height(), &zbuffer, nullptr, faces}.draw();
}
Counters draw(const Shaders& shader, int nshaders, const mat4& Viewport, TGAImage& picture) {
    assert(picture.bytespp() >= 3 && std::max(picture.width(), picture.height()) <= max_size);
    return Pass{shader, nshaders, Viewport, picture.width(), picture.height(), nullptr, &picture, Faces::all}.draw();
}

// ---- shadows ----

// The buffer knows depths at the centres of its texels only. Both terms say how much of a height above the fragment
// means nothing; what stands higher than either throws a shadow.
// - The receiver: its own plane, at the centre of the texel that the fragment lies in. If nothing is above it there the
//   fragment is lit: no face shadows itself, at any angle.
// - The caster: what is above may fall, on its way from there to the fragment, as far as to the next texel's depth.
//   Along each axis the neighbour nearer in depth tells by how much (the other may be another surface); if both are
//   lower, half. What is one texel thin, with nothing on either side, may fall without end: it throws no shadow.
//
// And rounding: depths are floats, which are off by half a unit in the last place, 2^-25 of them, at most (below 2048,
// where nearly all are, by that of 2048); corners are snapped by half a sub-pixel.
coord derived_bias(const DepthBuffer& shadowbuffer, const vec<3, coord>& sb_p, const coord& stored, const vec2& slope) {
    const vec<2, coord> to_centre{floor(sb_p.x) + .5 - sb_p.x, floor(sb_p.y) + .5 - sb_p.y};
    const double snapping = (std::fabs(slope.x) + std::fabs(slope.y)) / (2 << subpixel_bits);
    const coord rounding = max(2048, stored) * 0x1p-25 + snapping;
    const coord receiver = dot(slope, to_centre);
    if (!any(stored > sb_p.z + (receiver + rounding))) return receiver + rounding;

    const auto depth = [&](double dx, double dy) {
        return shadowbuffer.at(vec<3, coord>{sb_p.x + dx, sb_p.y + dy, sb_p.z});
    };
    const auto fall = [&](const coord& a, const coord& b) {
        return min(abs(stored - a), abs(stored - b)) / select((a < stored) & (b < stored), coord(2), 1);
    };
    const coord caster = fall(depth(-1, 0), depth(1, 0)) + fall(depth(0, -1), depth(0, 1));
    return max(receiver, caster) + rounding;
}

vec2 depth_slope(const vec4 (&corner)[3]) {
    // As in planes(), relative to the corner farthest in front: the others may be behind the light.
    const auto w_is_less = [](const vec4& p, const vec4& q) { return p.w < q.w; };
    const vec3 nearest = project(*std::max_element(corner, corner + 3, w_is_less));
    vec3 v[3];
    double z[3];
    for (int i = 0; i < 3; i++) {
        const vec4& p = corner[i];
        v[i] = {p.x - nearest.x * p.w, p.y - nearest.y * p.w, p.w}, z[i] = p.z - nearest.z * p.w;
    }
    const vec3 e[3] = {cross(v[1], v[2]), cross(v[2], v[0]), cross(v[0], v[1])};
    const vec3 sum = e[0] * z[0] + e[1] * z[1] + e[2] * z[2];
    return vec2{sum.x, sum.y} / dot(v[0], e[0]);
}

int LightGrid::good_cells(const Models& models) {
    int faces = 0;
    for (const Model* model : models) faces += model->nfaces();
    return std::clamp(static_cast<int>(std::sqrt(faces / 8.)), 1, 2048);
}

void LightGrid::build(const Models& models, const Camera& light, int cells) {
    cells_ = cells, side_ = cells, scale_ = 1, models_ = models;
    const mat4 to_screen = light.to_screen();
    std::vector<int> first_vert{0}, first_face{0};
    for (const Model* model : models) {
        first_vert.push_back(first_vert.back() + model->nverts());
        first_face.push_back(first_face.back() + model->nfaces());
    }
    verts_.resize(first_vert.back()), faces_.resize(first_face.back());
    ws_.resize(light.Projection[3].z != 0 ? verts_.size() : 0);
    std::vector<double> highest(parts(first_vert));
    in_parts(first_vert, [&](int part, int m, int begin, int end, int) {
        for (int i = begin, v = first_vert[m] + begin; i < end; i++, v++) {
            const vec4 p = to_screen * point(models[m]->vert(i));
            verts_[v] = p.xyz();
            if (!ws_.empty()) ws_[v] = p.w;
            const double z = std::fabs(on_screen(v).z);
            if (z <= 2 * screen_depth) highest[part] = std::max(highest[part], z);
        }
    });
    zmax_ = *std::max_element(highest.begin(), highest.end());
    in_parts(first_face, [&](int, int m, int begin, int end, int) {
        for (int i = begin; i < end; i++)
            for (int k = 0; k < 3; k++) faces_[first_face[m] + i][k] = first_vert[m] + models[m]->corner(i, k).vert;
    });

    // A face in a soup of large ones may touch every cell. Where the large ones would make the lists longer than 64
    // entries a face, the cells are made larger by powers of two, which changes no result: so memory is bounded by the
    // number of faces.
    for (;;) {
        band_rows_ = (cells_ + 63) / 64;
        bands_.resize((cells_ + band_rows_ - 1) / band_rows_);
        touches_.resize(parts(first_face));
        for (auto& of_bands : touches_) {
            of_bands.resize(bands_.size());
            for (auto& touches : of_bands) touches.clear();
        }
        std::atomic<std::int64_t> left = std::int64_t{64} * first_face.back();  // places for large faces
        in_parts(first_face, [&](int part, int m, int begin, int end, int) {
            for (int face = first_face[m] + begin; face < first_face[m] + end; face++)
                sort_into_bands(face, touches_[part], left);
        });
        if (left >= 0) break;
        cells_ = (cells_ + 1) / 2, scale_ /= 2, side_ /= 2;
        for (vec3& v : verts_) v.x /= 2, v.y /= 2;
    }
    parallel_for(static_cast<int>(bands_.size()), [&](int b, int) { fill(b); });
}

// Notes which cells a face touches. None for one that the light sees edge-on, which casts no shadow, or one beyond the
// range of a double. A large one takes the cells of its box from the places left, and none if there are too few.
void LightGrid::sort_into_bands(int face, std::vector<std::vector<Touch>>& touches, std::atomic<std::int64_t>& left) {
    vec3 p[4];
    int n = 3;
    bool is_cut = false;  // it has a corner behind the light: then it is what is before it that counts
    for (const int v : faces_[face]) is_cut = is_cut || (!ws_.empty() && !(ws_[v] >= w_near));
    if (is_cut) {
        vec4 corners[3], cut[4];
        for (int k = 0; k < 3; k++) {
            const vec3& v = verts_[faces_[face][k]];
            corners[k] = {v.x, v.y, v.z, ws_[faces_[face][k]]};
        }
        n = clip_polygon({3, 1, w_near}, corners, 3, cut);
        if (n < 3) return;
        for (int k = 0; k < n; k++) p[k] = project(cut[k]);
    } else {
        for (int k = 0; k < 3; k++) p[k] = on_screen(faces_[face][k]);
    }
    const double side = cross(p[1] - p[0], p[2] - p[0]).z;  // positive where it is counterclockwise
    if (!is_cut && !(std::fabs(side) > 0)) return;
    vec3 low = p[0], high = p[0];
    for (int k = 1; k < n; k++)
        for (int i = 0; i < 3; i++) low[i] = std::min(low[i], p[k][i]), high[i] = std::max(high[i], p[k][i]);
    const auto cell = [&](double v) {  // NaN: 0
        return v > 0 ? static_cast<int>(std::min(v, cells_ - 1.)) : 0;
    };
    const int x0 = cell(low.x), x1 = cell(high.x), y0 = cell(low.y), y1 = cell(high.y);
    const int cells = (x1 - x0 + 1) * (y1 - y0 + 1);
    if (cells > 9 && (left -= cells) < 0) return;
    const float zmax = is_cut ? INFINITY : std::nextafter(static_cast<float>(high.z), INFINITY);
    // Of a larger box those that lie on the inner side of its three edges, at least in part; asking costs more than it
    // saves for a small one.
    for (int y = y0; y <= y1; y++) {
        for (int x = x0; x <= x1; x++) {
            bool outside = false;
            for (int i = 0; i < 3 && !outside && cells > 9 && !is_cut; i++) {
                const vec3 &a = p[i], &b = p[(i + 1) % 3];
                // The cell's corner farthest inwards. Rounding of the products is below 2^-50 of their size.
                const double nx = side < 0 ? b.y - a.y : a.y - b.y, ny = side < 0 ? a.x - b.x : b.x - a.x;
                const double dx = (nx > 0 ? x + 1 : x) - a.x, dy = (ny > 0 ? y + 1 : y) - a.y;
                outside = nx * dx + ny * dy < -(std::fabs(nx * dx) + std::fabs(ny * dy)) * 0x1p-48;
            }
            if (!outside) touches[y / band_rows_].push_back({{zmax, face}, cells_ * (y % band_rows_) + x});
        }
    }
}

// Makes the lists of a band's cells, all in one array: count, sum up, fill.
void LightGrid::fill(int band) {
    std::vector<std::uint32_t>& first = bands_[band].first;
    std::vector<Entry>& entries = bands_[band].entries;
    const std::size_t cells = std::size_t{1} * cells_ * band_rows_;
    first.assign(cells + 2, 0);
    for (const auto& of_bands : touches_)
        for (const Touch& t : of_bands[band]) first[t.cell + 2]++;
    for (std::size_t c = 2; c < first.size(); c++) first[c] += first[c - 1];
    entries.resize(first.back());
    for (const auto& of_bands : touches_)
        for (const Touch& t : of_bands[band]) entries[first[t.cell + 1]++] = t;
    first.pop_back();
    const auto is_nearer = [](const Entry& p, const Entry& q) { return p.zmax > q.zmax; };
    for (std::size_t c = 0; c < cells; c++)
        std::sort(entries.begin() + first[c], entries.begin() + first[c + 1], is_nearer);
}

int LightGrid::first_face(const Model& model) const {
    int first = 0;
    for (const Model* each : models_) {
        if (each == &model) return first;
        first += each->nfaces();
    }
    return -model.nfaces();
}

std::size_t LightGrid::bytes() const {
    std::size_t sum = verts_.size() * sizeof(vec3) + ws_.size() * sizeof(double) + faces_.size() * sizeof(faces_[0]);
    for (const auto& [first, entries] : bands_) sum += first.size() * sizeof(first[0]) + entries.size() * sizeof(Entry);
    return sum;
}

mask LightGrid::shadows(const vec<3, coord>& on_screen, int number) const {
    const vec<3, coord> p{on_screen.x * scale_, on_screen.y * scale_, on_screen.z};
    // Beside all casters there is light.
    const mask inside = (!(p.x < 0)) & (!(p.y < 0)) & (p.x < side_) & (p.y < side_);
    const pack<std::int32_t> x = to_int(select(inside, p.x, 0)), y = to_int(select(inside, p.y, 0));
    const pack<std::int32_t> cell = select(inside, y * cells_ + x, -1);
    mask dark = false, left = inside;
    while (any(left)) {  // most often the neighbours are in one cell
        int i = 0;
        while (!left[i]) i++;
        const mask here = cell == cell[i];
        left = left & !here;
        const auto& [first, entries] = bands_[y[i] / band_rows_];
        const int c = cells_ * (y[i] % band_rows_) + x[i];
        for (std::uint32_t k = first[c]; k < first[c + 1]; k++) {
            // What does not reach higher than a point does not shadow it, nor do those that follow.
            if (!any(here & !dark & (p.z < double{entries[k].zmax}))) break;
            if (entries[k].face != number) dark = dark | (here & covers(entries[k].face, p));
        }
    }
    return dark;
}

// Is p under the face, seen from the light? With a, b, c the corners relative to p, the areas b x c, c x a, a x b are
// the barycentric coordinates of p; a shared edge gives its two faces exactly opposite values, so no light falls
// through. Under a light with a place the corners are homogeneous: relative to p is what is left of them after as much
// of p as their w says. The way through p meets the face before the light if w there is beyond that of the near plane.
mask LightGrid::covers(int face, const vec<3, coord>& p) const {
    const auto [i, j, k] = faces_[face];
    const bool is_far = ws_.empty();
    const vec3 ws = is_far ? vec3{1, 1, 1} : vec3{ws_[i], ws_[j], ws_[k]};
    const auto relative = [&](int v, double w) { return is_far ? verts_[v] - p : verts_[v] - p * w; };
    const vec<3, coord> a = relative(i, ws.x), b = relative(j, ws.y), c = relative(k, ws.z);
    const coord u = b.x * c.y - b.y * c.x, v = c.x * a.y - c.y * a.x, w = a.x * b.y - a.y * b.x;
    const coord least = min(min(u, v), w), most = max(max(u, v), w);
    const mask left = !(least < 0), right = !(most > 0);
    // The height over p times twice the area (and times w).
    const coord side = select(left, coord(1), -1), above = (u * a.z + v * b.z + w * c.z) * side;
    mask is_under = (left | right) & (above > 0);
    if (!is_far)
        is_under = is_under & ((u * (ws.x - w_near) + v * (ws.y - w_near) + w * (ws.z - w_near)) * side > 0);
    if (!any(is_under)) return false;
    // A face in the plane of p's own, its neighbour on a flat wall, is above p by rounding alone. Corners and p are
    // known to eps of their size (cells_ sideways, zmax_ or p's own in height, times the largest w): with r and h the
    // largest of the differences sideways and in height, an area is off by 4 r (cells_ + r) eps, and the sum by what
    // follows.
    constexpr double eps = std::numeric_limits<double>::epsilon();
    const double wmax = std::max({std::fabs(ws.x), std::fabs(ws.y), std::fabs(ws.z)});
    coord r = 0, h = 0;
    for (const auto& d : {a, b, c}) r = max(r, max(abs(d.x), abs(d.y))), h = max(h, abs(d.z));
    const coord sideways = cells_ * wmax + r, height = max(zmax_, abs(p.z)) * wmax + h;
    return is_under & (above > eps * (12 * r * sideways * h + 4 * abs(u + v + w) * height));
}
