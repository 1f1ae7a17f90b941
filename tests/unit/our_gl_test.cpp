// our_gl_test.cpp: cameras, clipping, interpolation, the z-buffer, threads.
#include "check.h"
#include "our_gl.h"
#include "random.h"


namespace {

// The faces are given in clip space; a fragment shows its face, or its barycentric coordinates.
struct ClipShader final : IShader {
    const std::vector<vec4>& clip;
    explicit ClipShader(const std::vector<vec4>& c) : clip(c) {}
    int current = 0;
    vec4 vertex(int face, int corner) override {
        current = face;
        return clip[static_cast<std::size_t>(face * 3 + corner)];
    }
    TGAColor fragment(const Fragment& f) const override {
        CHECK(f.bar.x >= 0 && f.bar.y >= 0 && f.bar.z >= 0);
        CHECK_NEAR(f.bar.x + f.bar.y + f.bar.z, 1, 1e-15);
        return {{static_cast<std::uint8_t>(current + 1), static_cast<std::uint8_t>(f.bar.x * 255),
                 static_cast<std::uint8_t>(f.bar.y * 255), 255}};
    }
};

struct Drawing {
    DepthBuffer z;
    TGAImage picture;
    Counters count;
};

Drawing drawing(const std::vector<vec4>& clip, int w, int h, int threads = 1) {
    const int n = static_cast<int>(clip.size() / 3);
    Drawing d{DepthBuffer(w, h), TGAImage(w, h, TGAImage::RGB), {}};
    FaceBuffer faces(w, h);
    const mat4 Viewport = viewport(0, 0, w, h);
    d.count = draw_depth(n, ClipShader(clip), Viewport, d.z, &faces, 0, threads);
    d.count.shaded = draw_color(0, n, ClipShader(clip), Viewport, faces, numbers_seen(faces, n), 0, d.picture, threads);
    return d;
}

bool same(const Drawing& a, const Drawing& b) {
    for (int y = 0; y < a.z.height(); y++)
        for (int x = 0; x < a.z.width(); x++)
            if (a.z.row(y)[x] != b.z.row(y)[x] || std::memcmp(a.picture.pixel(x, y), b.picture.pixel(x, y), 3)) return false;
    return true;
}

}  // namespace

TEST("lookat takes center to the origin and eye to the +z axis") {
    Random r(1);
    for (int k = 0; k < 20000; k++) {
        const vec3 eye = r.point(10), center = r.point(10), up = r.point(1);
        const mat4 m = lookat(eye, center, up);
        CHECK_NEAR(norm((m * point(center)).xyz()), 0, 1e-13);
        const vec3 e = (m * point(eye)).xyz();
        CHECK_NEAR(norm(e - vec3{0, 0, norm(eye - center)}), 0, 1e-12);
        const vec3 u = (m * direction(up)).xyz();
        CHECK_NEAR(u.x, 0, 1e-13 / norm(cross(normalized(up), normalized(eye - center))));
        CHECK(u.y >= 0);
        const auto inverse = invert(m);  // a rigid motion: its inverse keeps lengths, it keeps orientation
        if (CHECK(inverse.has_value())) CHECK_NEAR(determinant(m), 1, 1e-13);
    }
}

TEST("lookat is defined where up is of no use") {
    for (const vec3& eye : {vec3{0, 1, 0}, vec3{0, -1, 0}, vec3{1, 0, 0}, vec3{0, 0, -1}, vec3{1, 1, 1}}) {
        for (const vec3& up : {eye, -eye, eye * 1e-300, vec3{}}) {
            const mat4 m = lookat(eye, {}, up);
            CHECK_NEAR(determinant(m), 1, 1e-14);
            CHECK_NEAR((m * point(eye)).z, norm(eye), 1e-14);
        }
    }
    CHECK(determinant(lookat({1, 2, 3}, {1, 2, 3}, {0, 1, 0})) == 1);
}

TEST("the projection divides by 1 - z/d") {
    const vec4 p = projection(-1 / 4.) * point(vec3{1, 2, 2});
    CHECK(project(p) == (vec3{2, 4, 4}));
    CHECK(projection(0) == mat4::identity());
}

TEST("the viewport's corners") {
    Random r(2);
    for (int k = 0; k < 1000; k++) {
        const double x = r.in(-100, 100), y = r.in(-100, 100), w = r.in(1, 1000), h = r.in(1, 1000);
        const mat4 m = viewport(x, y, w, h);
        for (int corner = 0; corner < 8; corner++) {
            const int i = corner & 1, j = corner >> 1 & 1, l = corner >> 2;
            const vec3 p = (m * point(vec3{i * 2. - 1, j * 2. - 1, l * 2. - 1})).xyz();
            CHECK_NEAR(p.x, x + i * w, 1e-12);
            CHECK_NEAR(p.y, y + j * h, 1e-12);
            CHECK_NEAR(p.z, l * screen_depth, 0);
        }
    }
}

TEST("Mshadow there and back") {
    Random r(3);
    for (int k = 0; k < 5000; k++) {
        const vec3 eye = normalized(r.point(1)) * r.in(2, 10), light = r.point(1), center = r.point(.5);
        const Camera a{lookat(eye + center, center, {0, 1, 0}), projection(-1 / norm(eye)), viewport(100, 100, 600, 600)};
        const Camera b{lookat(center + light, center, {0, 1, 0}), projection(0), viewport(50, 50, 300, 300)};
        const mat4 to = b.object_to_screen() * invert(a.object_to_screen()).value();
        const mat4 back = a.object_to_screen() * invert(b.object_to_screen()).value();
        const vec3 p = center + r.point(.8), s = project(a.object_to_screen() * point(p));
        CHECK_NEAR(norm(project(to * point(s)) - project(b.object_to_screen() * point(p))), 0, 1e-9);
        CHECK_NEAR(norm(project(back * (to * point(s))) - s), 0, 1e-9);
    }
}

TEST("every visible pixel is shaded once, a face out of sight is not set up again")  {
    Random r(7);
    std::vector<vec4> clip;
    for (int k = 0; k < 300; k++)
        for (int i = 0; i < 3; i++) clip.push_back(point(r.point(1)));
    for (const vec3& v : {vec3{-3, -3, -.9}, vec3{3, -3, -.9}, vec3{0, 5, -.9}}) clip.push_back(point(v));  // behind all
    FaceBuffer faces(64, 64);
    DepthBuffer z(64, 64);
    const mat4 Viewport = viewport(0, 0, 64, 64);
    draw_depth(301, ClipShader(clip), Viewport, z, &faces, 5, 1);
    const std::vector<char> seen = numbers_seen(faces, 306);
    long visible = 0;
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 64; x++) visible += faces.row(y)[x] >= 0;
    TGAImage picture(64, 64, TGAImage::RGB);
    CHECK_EQ(draw_color(0, 301, ClipShader(clip), Viewport, faces, seen, 5, picture, 1), visible);
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 64; x++)
            CHECK_EQ(int{picture.pixel(x, y)[0]}, faces.row(y)[x] < 0 ? 0 : (faces.row(y)[x] - 5 + 1) & 255);
    for (int n = 0; n < 5; n++) CHECK(!seen[static_cast<std::size_t>(n)]);
}

TEST("a buffer starts at minus infinity, every cell of it") {
    const DepthBuffer z(7, 5);
    for (int y = 0; y < 5; y++)
        for (int x = 0; x < 7; x++) CHECK(z.row(y)[x] == -INFINITY);
    CHECK_THROWS(DepthBuffer(0, 5), "16384");
    CHECK_THROWS(DepthBuffer(5, 16385), "16384");
}

TEST("the nearer face wins, the first drawn of equals") {
    const std::vector<vec4> a = {{-1, -1, 0, 1}, {3, -1, 0, 1}, {-1, 3, 0, 1}, {-1, -1, .5, 1}, {3, -1, .5, 1}, {-1, 3, .5, 1},
                                 {-1, -1, .5, 1}, {3, -1, .5, 1}, {-1, 3, .5, 1}};
    const Drawing d = drawing(a, 8, 8);
    for (int y = 0; y < 8; y++)
        for (int x = 0; x < 8; x++) CHECK_EQ(int{d.picture.get(x, y)[0]}, 2);
    CHECK_EQ(d.count.covered, 192);
    CHECK_EQ(d.count.nearer, 128);
    CHECK_EQ(d.count.shaded, 64);
}

TEST("depth and barycentric coordinates against long double, w from 1e-3 to 1e3") {
    Random r(4);
    for (int k = 0; k < 20000; k++) {
        const double range = k % 2 ? 1.6 : 6.9;  // w from .2 to 5, or from 1e-3 to 1e3
        vec4 clip[3];
        for (vec4& c : clip) {
            const double w = std::exp(r.in(-range, range));
            c = {r.in(-1, 1) * w, r.in(-1, 1) * w, r.in(-1, 1) * w, w};
        }
        const int size = 64;
        const mat4 Viewport = viewport(0, 0, size, size);
        TriangleSetup t;
        if (setup_triangle(clip, Viewport, size, size, t) != Setup::drawn) continue;
        // Screen-space barycentric coordinates, then the division by w of each corner, all in long double.
        using real = long double;
        real X[3], Y[3], Z[3], W[3];
        for (int i = 0; i < 3; i++) {
            W[i] = clip[i].w;
            X[i] = (clip[i].x / W[i] + 1) * size / 2, Y[i] = (clip[i].y / W[i] + 1) * size / 2;
            Z[i] = (clip[i].z / W[i] + 1) * real(screen_depth) / 2;
        }
        const real area = (X[1] - X[0]) * (Y[2] - Y[0]) - (X[2] - X[0]) * (Y[1] - Y[0]);
        if (std::fabs(area) < 1) continue;  // needles have their own test
        for_each_span(t, 0, size, [&](int y, int x0, int x1) {
            for (int x = x0; x < x1; x++) {
                const real px = x + real(.5), py = y + real(.5);
                real l[3], z = 0, sum = 0;
                bool well_inside = true;  // by more than the snapping of the corners
                for (int i = 0; i < 3; i++) {
                    const int j = (i + 1) % 3, m = (i + 2) % 3;
                    l[i] = ((X[j] - px) * (Y[m] - py) - (X[m] - px) * (Y[j] - py)) / area;
                    z += l[i] * Z[i];
                    sum += l[i] / W[i];
                    well_inside &= l[i] > 1e-3L;
                }
                if (!well_inside) continue;
                const double dx = x + .5 - t.origin.x, dy = y + .5 - t.origin.y;
                CHECK_NEAR(t.zx * dx + t.zy * dy + t.z0, static_cast<double>(z), 1e-8);
                const vec3 e = t.ex * dx + t.ey * dy + t.e0;
                for (int i = 0; i < 3; i++)
                    CHECK_NEAR(e[i] / (e.x + e.y + e.z), static_cast<double>(l[i] / W[i] / sum), 1e-10);
            }
        });
    }
}

TEST("a floor through the eye's plane is cut, not wrapped round") {
    // The plane y = -1 from far ahead to behind the eye at (0,0,1): on the screen it fills what is below the horizon.
    const mat4 P = projection(-1);
    const auto at = [&](double x, double z) { return P * point(vec3{x, -1, z}); };
    const std::vector<vec4> clip = {at(-1e4, 50), at(1e4, 50), at(1e4, -1e4), at(-1e4, 50), at(1e4, -1e4), at(-1e4, -1e4)};
    const Drawing d = drawing(clip, 64, 64);
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 64; x++) CHECK_EQ(std::isfinite(d.z.row(y)[x]), y < 32);
}

TEST("nothing behind the eye is drawn, nothing outside is touched") {
    const Drawing behind = drawing({{-1, -1, 0, -1}, {1, -1, 0, -1}, {0, 1, 0, -1}}, 16, 16);
    CHECK_EQ(behind.count.outside, 1);
    CHECK_EQ(behind.count.covered, 0);
    Random r(5);
    for (int k = 0; k < 20000; k++) {  // the sanitizers watch the buffers
        std::vector<vec4> clip;
        const double size = std::exp(r.in(-3, 12));
        for (int i = 0; i < 3; i++) clip.push_back({r.in(-size, size), r.in(-size, size), r.in(-size, size), r.in(-2, 2)});
        const Drawing d = drawing(clip, 1 + k % 9, 1 + k % 7);
        for (int y = 0; y < d.z.height(); y++)
            for (int x = 0; x < d.z.width(); x++) CHECK(!std::isnan(d.z.row(y)[x]));
    }
}

TEST("corners that are not numbers are left out") {
    const double inf = INFINITY;
    CHECK_EQ(drawing({{NAN, 0, 0, 1}, {1, 0, 0, 1}, {0, 1, 0, 1}}, 8, 8).count.outside, 1);
    CHECK_EQ(drawing({{inf, 0, 0, 1}, {1, 0, 0, 1}, {0, 1, 0, 1}}, 8, 8).count.outside, 1);
    CHECK_EQ(drawing({{0, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}}, 8, 8).count.outside, 1);
}

TEST("the same bytes from 1, 2 and 7 threads") {
    Random r(6);
    std::vector<vec4> clip;
    for (int k = 0; k < 9000; k++) {  // more than two blocks of faces
        const vec3 c = r.point(1.2);
        for (int i = 0; i < 3; i++) clip.push_back(point(c + r.point(.2)));
    }
    const Drawing one = drawing(clip, 200, 150, 1);
    for (const int threads : {2, 7}) {
        const Drawing many = drawing(clip, 200, 150, threads);
        CHECK(same(one, many));
        CHECK_EQ(many.count.covered, one.count.covered);
        CHECK_EQ(many.count.nearer, one.count.nearer);
        CHECK_EQ(many.count.shaded, one.count.shaded);
        CHECK_EQ(many.count.outside, one.count.outside);
        CHECK_EQ(many.count.between_samples, one.count.between_samples);
    }
}

TEST("a pass without face numbers draws the same depth") {
    const std::vector<vec4> clip = {{-1, -1, 0, 1}, {1, -1, .3, 1}, {0, 1, -.2, 1}};
    const Drawing d = drawing(clip, 32, 32);
    DepthBuffer z(32, 32);
    draw_depth(1, ClipShader(clip), viewport(0, 0, 32, 32), z, nullptr, 0, 1);
    for (int y = 0; y < 32; y++)
        for (int x = 0; x < 32; x++) CHECK(z.row(y)[x] == d.z.row(y)[x]);
}

TEST("texels: nearest, wrapped, v upwards") {
    TGAImage map(4, 2, TGAImage::GRAYSCALE);
    for (int i = 0; i < 8; i++) *map.pixel(i % 4, i / 4) = static_cast<std::uint8_t>(i);
    CHECK_EQ(int{*sample2D(map, {0, 0})}, 0);
    CHECK_EQ(int{*sample2D(map, {.26, .2})}, 1);
    CHECK_EQ(int{*sample2D(map, {.99, .99})}, 7);
    CHECK_EQ(int{*sample2D(map, {1, 1})}, 0);
    CHECK_EQ(int{*sample2D(map, {-.01, -.01})}, 7);
    CHECK_EQ(int{*sample2D(map, {-1e-20, 5.6})}, 7);
    CHECK_EQ(int{*sample2D(map, {1e300, -1e300})}, 0);
}

TEST("integer powers") {
    CHECK(power(0, 0) == 1 && power(2, 10) == 1024 && power(.5, 3) == .125);
    for (unsigned e = 0; e < 256; e++) CHECK_NEAR(power(.97, e), std::pow(.97, e), 1e-14);
}

TEST("depth as a picture: nearest white, nothing black") {
    DepthBuffer z(3, 1);
    z.row(0)[0] = 500, z.row(0)[1] = 1000;
    const TGAImage p = depth_picture(z);
    CHECK_EQ(int{p.get(1, 0)[0]}, 255);
    CHECK_EQ(int{p.get(0, 0)[0]}, 32);
    CHECK_EQ(int{p.get(2, 0)[0]}, 0);
    z.row(0)[0] = 1000;
    CHECK_EQ(int{depth_picture(z).get(0, 0)[0]}, 255);
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
