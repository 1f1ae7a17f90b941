// our_gl.cpp: the cameras' matrices, and the way of a face from clip space to integer coverage.
#include "our_gl.h"

#include <cmath>

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

mat4 viewport(double x, double y, double w, double h) {
    const double d = screen_depth;
    return {{{w / 2, 0, 0, x + w / 2}, {0, h / 2, 0, y + h / 2}, {0, 0, d / 2, d / 2}, {0, 0, 0, 1}}};
}

mat4 translation(const vec3& by) { return {{{1, 0, 0, by.x}, {0, 1, 0, by.y}, {0, 0, 1, by.z}, {0, 0, 0, 1}}}; }

mat4 middle_viewport(int width, int height) {
    const double side = .75 * std::min(width, height);
    return viewport((width - side) / 2, (height - side) / 2, side, side);
}

int face_count(const std::vector<Model>& models) {
    int n = 0;
    for (const Model& model : models) n += model.nfaces();
    return n;
}

Camera fitted_camera(const std::vector<Model>& models, const vec3& direction, const vec3& up, int size) {
    constexpr double inf = std::numeric_limits<double>::infinity();
    Camera camera{lookat(direction, {}, up), mat4::identity(), viewport(0, 0, size, size)};
    vec3 low{inf, inf, inf}, high{-inf, -inf, -inf};
    for (const Model& model : models) {
        for (int corner = 0; corner < model.nfaces() * 3; corner++) {
            const vec3 p = (camera.ModelView * point(model.vert(corner / 3, corner % 3))).xyz();
            for (int i = 0; i < 3; i++) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
        }
    }
    double largest = 0;
    for (int i = 0; i < 3; i++) largest = std::max({largest, std::fabs(low[i]), std::fabs(high[i])});
    for (int i = 0; i < 3; i++) {  // the box [low,high] to [-1,1]^3
        double half = high[i] / 2 - low[i] / 2;
        // What is flat as the light sees it has a depth of rounding alone, which must not be blown up: it is some 2^-50 of
        // the largest coordinate, and screen_depth/2 * 2^-50 / 2^-24 is below a quarter of depth_rounding.
        if (i == 2) half = std::max(half, largest * 0x1p-24);
        if (!(half >= 0x1p-1000)) half = 1;  // no extent, or one whose inverse is no double: any scale will do
        camera.Projection[i][i] = 1 / half;
        camera.Projection[i][3] = -(low[i] + half) / half;
    }
    return camera;
}

TGAImage depth_picture(const DepthBuffer& depths) {
    constexpr float nothing = -std::numeric_limits<float>::infinity();
    constexpr double darkest = 32, white = 255;
    float far = std::numeric_limits<float>::infinity(), near = nothing;
    for (int y = 0; y < depths.height(); y++)
        for (int x = 0; x < depths.width(); x++)
            if (const float z = depths.row(y)[x]; z != nothing) far = std::min(far, z), near = std::max(near, z);
    const double scale = near > far ? (white - darkest) / (static_cast<double>(near) - static_cast<double>(far)) : 0;
    TGAImage picture(depths.width(), depths.height(), TGAImage::GRAYSCALE);
    for (int y = 0; y < depths.height(); y++)
        for (int x = 0; x < depths.width(); x++)
            if (const float z = depths.row(y)[x]; z != nothing)
                *picture.pixel(x, y) = static_cast<std::uint8_t>(white - scale * (static_cast<double>(near) - static_cast<double>(z)));
    return picture;
}

namespace {

// The near plane, as a share of the distance from eye to centre. w = 1 + c z is near zero there and carries the rounding of
// a number near one, some 2^-50 after the matrix products; a corner on the guard band at 2^15 pixels then moves by
// 2^15 * 2^-50 / w_near. With w_near = 2^-22 that is 2^-13 pixel, which no picture shows, and things stay visible
// down to a quarter of a millionth of the viewing distance.
constexpr double w_near = 1. / (1 << 22);

// How far outside of the picture, in pixels, coverage is still computed exactly instead of being clipped: most faces that
// cross the border need no clipping. 2 * 4096 + 16384 pixels at 16 sub-pixel bits make differences below 2^30.6.
constexpr double guard = 4096;

// Distances to the clipping planes, homogeneous; inside where >= 0. s is a corner in homogeneous screen coordinates.
struct Planes {
    double near, right, top;
    static constexpr int count = 5;
    double distance(int plane, const vec4& s) const {
        switch (plane) {
            case 0: return s.w - near;
            case 1: return s.x + guard * s.w;
            case 2: return right * s.w - s.x;
            case 3: return s.y + guard * s.w;
            default: return top * s.w - s.y;
        }
    }
    // What a sum of large numbers lost of a distance that is zero: the end of an edge that is 1e20 pixels long would be
    // thousands of pixels off its plane.
    void put_on(int plane, vec4& s) const {
        switch (plane) {
            case 0: s.w = near; break;
            case 1: s.x = -guard * s.w; break;
            case 2: s.x = right * s.w; break;
            case 3: s.y = -guard * s.w; break;
            default: s.y = top * s.w;
        }
    }
};

// Sutherland and Hodgman, one plane. A cut edge gets the same new corner from both of its faces, bit for bit: it is always
// computed from the inner towards the outer end.
int clip_polygon(const Planes& planes, int plane, const vec4* in, int n, vec4* out) {
    int m = 0;
    for (int i = 0; i < n; i++) {
        const vec4 &a = in[i], &b = in[(i + 1) % n];
        const double da = planes.distance(plane, a), db = planes.distance(plane, b);
        if (da >= 0) out[m++] = a;
        if ((da >= 0) != (db >= 0)) {
            const bool a_inside = da >= 0;
            const double d_in = a_inside ? da : db, d_out = a_inside ? db : da;
            const vec4 &p = a_inside ? a : b, &q = a_inside ? b : a;
            // A mean with positive weights: p + (q - p) t would lose a q that is some 2^53 times smaller than p.
            const double length = d_in - d_out;
            out[m] = p * (-d_out / length) + q * (d_in / length);
            planes.put_on(plane, out[m++]);
        }
    }
    return m;
}

}  // namespace

Setup setup_triangle(const vec4 (&clip)[3], const mat4& Viewport, int width, int height, TriangleSetup& t) {
    vec4 s[3] = {Viewport * clip[0], Viewport * clip[1], Viewport * clip[2]};

    for (const vec4& p : s)  // a coordinate beyond the range of a double has no place on the screen
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z) || !std::isfinite(p.w)) return Setup::outside;

    // Homogeneous coordinates may be scaled: by a power of two, exactly. Distances to the planes are sums of up to 2^15 times
    // the coordinates, which must not leave the range of a double.
    double size = 0, near = w_near;
    for (const vec4& p : s) size = std::max({size, std::fabs(p.x), std::fabs(p.y), std::fabs(p.z), std::fabs(p.w)});
    if (size > 0x1p1000) {
        for (vec4& p : s) p = p * 0x1p-40;
        size *= 0x1p-40, near *= 0x1p-40;
    }

    // Wholly behind the eye or beyond one side of the picture.
    const auto all = [&s](auto&& outside) { return outside(s[0]) && outside(s[1]) && outside(s[2]); };
    if (all([=](const vec4& p) { return !(p.w >= near); }) || all([](const vec4& p) { return !(p.x > 0); }) ||
        all([](const vec4& p) { return !(p.y > 0); }) || all([=](const vec4& p) { return !(p.x < width * p.w); }) ||
        all([=](const vec4& p) { return !(p.y < height * p.w); }))
        return Setup::outside;

    // Clip against those planes that a corner is outside of.
    const Planes planes{near, width + guard, height + guard};
    vec4 buffer[2][TriangleSetup::max_corners];
    vec4* polygon = buffer[0];
    std::copy_n(s, 3, polygon);
    int n = 3;
    for (int plane = 0; plane < Planes::count; plane++) {
        if (!all([&](const vec4& p) { return planes.distance(plane, p) >= 0; })) {
            vec4* const target = polygon == buffer[0] ? buffer[1] : buffer[0];
            n = clip_polygon(planes, plane, polygon, n, target);
            polygon = target;
        }
    }
    if (n < 3) return Setup::outside;

    // Divide by w and snap.
    constexpr double one = 1 << TriangleSetup::subpixel_bits;
    constexpr std::int32_t half = 1 << (TriangleSetup::subpixel_bits - 1);
    t.corners = n;
    t.zmin = std::numeric_limits<double>::infinity();
    t.zmax = -t.zmin;
    std::int32_t lo[2] = {INT32_MAX, INT32_MAX}, hi[2] = {INT32_MIN, INT32_MIN};
    for (int i = 0; i < n; i++) {
        const vec3 p = project(polygon[i]);
        // On a guard plane rounding may land a hair outside: that is no more than 2^-10 of a sub-pixel.
        t.x[i] = static_cast<std::int32_t>(std::floor(std::clamp(p.x, -guard, width + guard) * one + .5));
        t.y[i] = static_cast<std::int32_t>(std::floor(std::clamp(p.y, -guard, height + guard) * one + .5));
        lo[0] = std::min(lo[0], t.x[i]), hi[0] = std::max(hi[0], t.x[i]);
        lo[1] = std::min(lo[1], t.y[i]), hi[1] = std::max(hi[1], t.y[i]);
        t.zmin = std::min(t.zmin, p.z), t.zmax = std::max(t.zmax, p.z);
    }
    // A depth beyond the range of a float is drawn as its largest one, not as infinity.
    constexpr double most = std::numeric_limits<float>::max();
    t.zmin = std::clamp(t.zmin, -most, most), t.zmax = std::clamp(t.zmax, -most, most);
    // Pixel x has its centre at x + half: the first at or right of lo, the last at or left of hi.
    t.xmin = std::max(0, (lo[0] + half - 1) >> TriangleSetup::subpixel_bits);
    t.ymin = std::max(0, (lo[1] + half - 1) >> TriangleSetup::subpixel_bits);
    t.xmax = std::min(width - 1, (hi[0] - half) >> TriangleSetup::subpixel_bits);
    t.ymax = std::min(height - 1, (hi[1] - half) >> TriangleSetup::subpixel_bits);
    if (t.xmin > t.xmax || t.ymin > t.ymax) return Setup::between_samples;

    // Perspective without a division per corner (Olano and Greer, "Triangle scan conversion using 2D homogeneous
    // coordinates", 1997): with the corners as rows (x,y,w) of a matrix, the columns of its adjugate are linear functions
    // on the screen whose ratio is that of the barycentric coordinates on the face. They hold for the whole face, clipped or
    // not, corners behind the eye included. Coordinates relative to a pixel of the face keep the products small.
    // They are scaled again, so that no product leaves that range either.
    if (!(size > 0x1p-200 && size < 0x1p200))
        for (vec4& p : s)
            for (int i = 0; i < 4; i++) p[i] = std::scalbn(p[i], -std::ilogb(size));
    t.origin = {t.xmin + .5, t.ymin + .5};
    vec3 v[3];
    for (int i = 0; i < 3; i++) v[i] = {s[i].x - t.origin.x * s[i].w, s[i].y - t.origin.y * s[i].w, s[i].w};
    vec3 e[3] = {cross(v[1], v[2]), cross(v[2], v[0]), cross(v[0], v[1])};
    const double det = dot(v[0], e[0]);
    if (det != 0 && std::isfinite(det)) {
        const double sign = det < 0 ? -1 : 1;
        for (vec3& f : e) f = f * sign;
        t.ex = {e[0].x, e[1].x, e[2].x};
        t.ey = {e[0].y, e[1].y, e[2].y};
        t.e0 = {e[0].z, e[1].z, e[2].z};
        // depth = sum(z_i e_i) / sum(w_i e_i), and the denominator is |det| everywhere. Depths are taken relative to that
        // of the corner farthest in front of the eye, so that a small slope is not the difference of large numbers.
        const int r = s[0].w >= s[1].w ? (s[0].w >= s[2].w ? 0 : 2) : (s[1].w >= s[2].w ? 1 : 2);
        const double z0 = s[r].z / s[r].w;
        vec3 z{s[0].z - z0 * s[0].w, s[1].z - z0 * s[1].w, s[2].z - z0 * s[2].w};
        z[r] = 0;
        t.zx = dot(z, t.ex) / std::fabs(det);
        t.zy = dot(z, t.ey) / std::fabs(det);
        t.z0 = z0 + dot(z, t.e0) / std::fabs(det);
    } else {
        // Seen exactly edge-on, yet snapped to a sliver: its neighbours leave those samples to it. It shows corner 0.
        t.ex = t.ey = {};
        t.e0 = {1, 0, 0};
        t.zx = t.zy = 0;
        t.z0 = t.zmax;
    }
    return Setup::drawn;
}

void triangle(const TriangleSetup& t, int number, DepthBuffer& zbuffer, FaceBuffer* faces, const Share& share, Counters& count) {
    share.for_each_span(t, [&](int y, int x_begin, int x_end) {
        float* const depth = zbuffer.row(y);
        std::int32_t* const face = faces ? faces->row(y) : nullptr;
        count.covered += x_end - x_begin;
        for (int x = x_begin; x < x_end; x++) {
            const float z = static_cast<float>(t.depth(x, y));
            if (!(z > depth[x])) continue;
            depth[x] = z;
            if (face) face[x] = number;
            count.nearer++;
        }
    });
}

std::vector<char> numbers_seen(const FaceBuffer& faces, int count) {
    std::vector<char> seen(static_cast<std::size_t>(count));
    for (int y = 0; y < faces.height(); y++)
        for (int x = 0; x < faces.width(); x++)
            if (const std::int32_t number = faces.row(y)[x]; number >= 0) seen[static_cast<std::size_t>(number)] = 1;
    return seen;
}

LightGrid::LightGrid(const std::vector<Model>& models, const Camera& light, int cells) : cells_(cells) {
    const int faces = face_count(models);
    corners_.reserve(static_cast<std::size_t>(faces) * 3);
    const mat4 to_screen = light.object_to_screen();
    for (const Model& model : models)
        for (int corner = 0; corner < model.nfaces() * 3; corner++)
            corners_.push_back(project(to_screen * point(model.vert(corner / 3, corner % 3))));
    const auto cell_of = [&](double v) { return v > 0 ? static_cast<int>(std::min(v, cells_ - 1.)) : 0; };  // NaN: 0
    // A face in a soup of large ones may touch every cell. Where that would make the lists longer than most_entries a face,
    // the cells are made larger by powers of two, which changes no result: so memory is bounded by the number of faces.
    constexpr double most_entries = 64;
    const auto box_cells = [&] {
        double sum = 0;
        for (int f = 0; f < faces; f++) {
            const vec3* const p = &corners_[static_cast<std::size_t>(f) * 3];
            const auto [x0, x1] = std::minmax({p[0].x, p[1].x, p[2].x});
            const auto [y0, y1] = std::minmax({p[0].y, p[1].y, p[2].y});
            sum += ((x1 - x0) * scale_ + 1) * ((y1 - y0) * scale_ + 1);
        }
        return sum;
    };
    while (cells_ > 1 && box_cells() > most_entries * faces) cells_ = (cells_ + 1) / 2, scale_ /= 2;
    for (vec3& p : corners_) p.x *= scale_, p.y *= scale_;

    // The cells that a face touches: those of its box that lie on the inner side of its three edges, at least in part.
    // A face that the light sees edge-on casts no shadow.
    const auto for_each_cell = [&](int face, auto&& visit) {
        const vec3* const p = &corners_[static_cast<std::size_t>(face) * 3];
        const double area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
        if (!(std::fabs(area) > 0)) return;  // nor one beyond the range of a double
        const double side = area < 0 ? -1 : 1;
        const int x0 = cell_of(std::min({p[0].x, p[1].x, p[2].x})), x1 = cell_of(std::max({p[0].x, p[1].x, p[2].x}));
        const int y0 = cell_of(std::min({p[0].y, p[1].y, p[2].y})), y1 = cell_of(std::max({p[0].y, p[1].y, p[2].y}));
        for (int y = y0; y <= y1; y++) {
            for (int x = x0; x <= x1; x++) {
                bool outside = false;
                for (int i = 0; i < 3 && !outside; i++) {
                    const vec3 &a = p[i], &b = p[(i + 1) % 3];
                    // The cell's corner farthest inwards. Rounding of the products is below 2^-50 of their size.
                    const double nx = side * (a.y - b.y), ny = side * (b.x - a.x);
                    const double dx = (nx > 0 ? x + 1 : x) - a.x, dy = (ny > 0 ? y + 1 : y) - a.y;
                    outside = nx * dx + ny * dy < -(std::fabs(nx * dx) + std::fabs(ny * dy)) * 0x1p-48;
                }
                if (!outside) visit(static_cast<std::size_t>(y) * static_cast<std::size_t>(cells_) + static_cast<std::size_t>(x));
            }
        }
    };
    // Count, sum up, fill: a list for each cell in one array.
    const std::size_t count = static_cast<std::size_t>(cells_) * static_cast<std::size_t>(cells_);
    first_.assign(count + 2, 0);
    for (int f = 0; f < faces; f++) for_each_cell(f, [&](std::size_t c) { first_[c + 2]++; });
    for (std::size_t c = 2; c < first_.size(); c++) first_[c] += first_[c - 1];
    entries_.resize(first_.back());
    for (int f = 0; f < faces; f++) {
        const vec3* const p = &corners_[static_cast<std::size_t>(f) * 3];
        const float zmax = std::nextafter(static_cast<float>(std::max({p[0].z, p[1].z, p[2].z})), INFINITY);
        for_each_cell(f, [&](std::size_t c) { entries_[first_[c + 1]++] = {zmax, f}; });
    }
    first_.pop_back();
    for (std::size_t c = 0; c < count; c++)
        std::sort(entries_.begin() + first_[c], entries_.begin() + first_[c + 1], [](const Entry& a, const Entry& b) {
            return a.zmax != b.zmax ? a.zmax > b.zmax : a.face < b.face;
        });
    for (const vec3& p : corners_) zmax_ = std::max(zmax_, std::fabs(p.z));
}

std::size_t LightGrid::bytes() const {
    return corners_.size() * sizeof(vec3) + first_.size() * sizeof(first_[0]) + entries_.size() * sizeof(Entry);
}

bool LightGrid::shadows(const vec3& on_screen, int number) const {
    const vec3 p{on_screen.x * scale_, on_screen.y * scale_, on_screen.z};
    if (!(p.x >= 0 && p.y >= 0 && p.x < cells_ && p.y < cells_)) return false;  // beside all casters
    const std::size_t c = static_cast<std::size_t>(p.y) * static_cast<std::size_t>(cells_) + static_cast<std::size_t>(p.x);
    for (std::uint32_t i = first_[c]; i < first_[c + 1]; i++) {
        const Entry& e = entries_[i];
        if (static_cast<double>(e.zmax) <= p.z) return false;  // nor do those that follow reach higher
        if (e.face != number && covers(e.face, p)) return true;
    }
    return false;
}

// Is p under the face, seen from the light? With a, b, c the corners relative to p, the areas b x c, c x a, a x b are the
// barycentric coordinates of p; a shared edge gives its two faces exactly opposite values, so no light falls through.
bool LightGrid::covers(int face, const vec3& p) const {
    const vec3* const q = &corners_[static_cast<std::size_t>(face) * 3];
    const vec3 a = q[0] - p, b = q[1] - p, c = q[2] - p;
    const double u = b.x * c.y - b.y * c.x, v = c.x * a.y - c.y * a.x, w = a.x * b.y - a.y * b.x;
    const bool left = u >= 0 && v >= 0 && w >= 0, right = u <= 0 && v <= 0 && w <= 0;
    if (!left && !right) return false;
    const double above = (u * a.z + v * b.z + w * c.z) * (left ? 1 : -1);  // height over p times twice the area
    if (!(above > 0)) return false;
    // A face in the plane of p's own, its neighbour on a flat wall, is above p by rounding alone. Corners and p are known to
    // eps of their size (cells_ sideways, zmax_ in height): with r and h the largest of the differences sideways and in
    // height, an area is off by 4 r (cells_ + r) eps, and the sum by what follows.
    constexpr double eps = std::numeric_limits<double>::epsilon();
    double r = 0, h = 0;
    for (const vec3& d : {a, b, c}) r = std::max({r, std::fabs(d.x), std::fabs(d.y)}), h = std::max(h, std::fabs(d.z));
    return above > eps * (12 * r * (cells_ + r) * h + 4 * std::fabs(u + v + w) * (zmax_ + h));
}
