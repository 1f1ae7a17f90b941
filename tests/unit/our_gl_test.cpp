// our_gl_test.cpp: cameras, clipping, interpolation, the z-buffer, threads, texels, and the bias of the shadow buffer.
#include "check.h"
#include "drawing.h"
#include "random.h"

#include <atomic>
#include <numbers>

// A scene of one triangle for each three corners, each a model.
static std::vector<Model> triangles(const std::vector<vec3>& corners, double scale = 1) {
    std::vector<Model> scene;
    for (std::size_t i = 0; i < corners.size(); i += 3)
        scene.emplace_back(std::vector{corners[i] * scale, corners[i + 1] * scale, corners[i + 2] * scale},
                           std::vector<vec2>(), std::vector<vec3>(1, vec3{0, 0, 1}),
                           std::vector<Model::Corner>{{0, -1, 0}, {1, -1, 0}, {2, -1, 0}});
    return scene;
}

TEST("lookat takes center to the origin and eye to the +z axis") {
    Random r(1);
    for (int k = 0; k < 20000; k++) {
        const vec3 eye = r.point(10), center = r.point(10), up = r.point(1);
        const mat4 m = lookat(eye, center, up);
        CHECK_NEAR(norm((m * point(center)).xyz()), 0, 1e-13);
        CHECK_NEAR(norm((m * point(eye)).xyz() - vec3{0, 0, norm(eye - center)}), 0, 1e-12);
        const vec3 u = (m * direction(up)).xyz();
        CHECK_NEAR(u.x, 0, 1e-13 / norm(cross(normalized(up), normalized(eye - center))));
        CHECK(u.y >= 0);
        const vec3 x = m[0].xyz(), y = m[1].xyz(), z = m[2].xyz();  // a rotation, and no mirror
        CHECK_NEAR(norm(cross(x, y) - z) + norm(cross(y, z) - x), 0, 1e-13);
    }
}

TEST("lookat is defined where up is of no use") {
    for (const vec3& eye : {vec3{0, 1, 0}, vec3{0, -1, 0}, vec3{1, 0, 0}, vec3{0, 0, -1}, vec3{1, 1, 1}})
        for (const vec3& up : {eye, -eye, eye * 1e-300, vec3{}}) {
            const mat4 m = lookat(eye, {}, up);
            CHECK_NEAR(norm(cross(m[0].xyz(), m[1].xyz()) - m[2].xyz()), 0, 1e-14);
            CHECK_NEAR(norm(m[0].xyz()), 1, 1e-14);
            CHECK_NEAR((m * point(eye)).z, norm(eye), 1e-14);
        }
    CHECK(lookat({1, 2, 3}, {1, 2, 3}, {0, 1, 0}) == translation({-1, -2, -3}));
}

TEST("the projection divides by 1 - z/d") {
    CHECK(project(projection(-1 / 4.) * point(vec3{1, 2, 2})) == (vec3{2, 4, 4}));
    CHECK(projection(0) == mat4::identity());
}

TEST("a beam's border is where it says, at any depth, and the camera of a light is fitted within it") {
    for (const double angle : {1e-6, 5., 45., 89.})
        for (const double z : {-5., 0., 1.9}) {
            const double side = (2 - z) * std::tan(angle * std::numbers::pi / 180);
            const vec4 p = beam(2, angle) * point(vec3{side, -side, z});
            CHECK_NEAR(p.x / p.w, 1, 1e-12);
            CHECK_NEAR(p.y / p.w, -1, 1e-12);
        }
    Random r(3);
    std::size_t left_out = 0;
    for (int k = 0; k < 200; k++) {
        std::vector<vec3> corners;
        for (int i = 0; i < 10; i++)
            for (const vec3 middle = r.point(1); corners.size() < 3u * (i + 1);)
                corners.push_back(middle + r.point(.15));
        const std::vector<Model> scene = triangles(corners);
        const vec3 place = r.point(3);
        const Camera unfitted{lookat(place, {}, {0, 1, 0}), beam(norm(place), 40)};
        const Camera light = fitted(unfitted, scene, 100);
        double left = 100, right = 0;
        bool crosses = false;
        for (const vec3& v : corners) {
            const vec4 p = unfitted.to_clip() * point(v);
            crosses = crosses || p.w < .01;
            if (p.w < .01 || std::max(std::fabs(p.x), std::fabs(p.y)) > p.w) continue;
            const vec3 s = project(light.to_screen() * point(v));
            for (const double c : {s.x, s.y}) left = std::min(left, c), right = std::max(right, c);
            CHECK(s.z > -1e-9);
        }
        CHECK(left > -1e-9 && right < 100 + 1e-9);
        const Camera narrow{unfitted.ModelView, beam(norm(place), 8)};
        const Models lit = casters(scene, scene, narrow);
        CHECK(casters(scene, {}, narrow).empty());
        for (const Model& model : scene)
            for (const vec3& v : model.verts()) {
                const vec4 p = narrow.to_clip() * point(v);
                const bool is_reached = p.w > 0 && std::max(std::fabs(p.x), std::fabs(p.y)) < p.w;
                CHECK(!is_reached || std::count(lit.begin(), lit.end(), &model) == 1);
            }
        left_out += scene.size() - lit.size();
        CHECK(crosses || right - left > 1);
    }
    CHECK(left_out > 200);
}

TEST("the viewport's corners") {
    Random r(2);
    for (int k = 0; k < 8000; k++) {
        const double x = r.in(-100, 100), y = r.in(-100, 100), w = r.in(1, 1000), h = r.in(1, 1000);
        const int i = k & 1, j = k >> 1 & 1, l = k >> 2 & 1;
        const vec4 p = viewport(x, y, w, h) * point(vec3{i * 2. - 1, j * 2. - 1, l * 2. - 1});
        CHECK_NEAR(norm(p.xyz() - vec3{x + i * w, y + j * h, l * screen_depth}), 0, 1e-12);
    }
}

// Where the default eye sees a vertex: within the middle square, [-1,1]^2, at most 1.
static double seen_at(const vec3& v) {
    const vec4 p = projection(-1 / norm(vec3{1, 1, 4})) * lookat({1, 1, 4}, {}, {0, 1, 0}) * point(v);
    return std::max(std::fabs(p.x), std::fabs(p.y)) / p.w;
}

TEST("fit leaves alone what is seen as a whole, near the origin and not small") {
    const auto fits = [](const std::vector<vec3>& corners) {
        std::vector<Model> scene = triangles(corners);
        const bool fitted = fit(scene);
        CHECK(fitted || scene[0].verts() == std::vector(corners.begin(), corners.begin() + 3));
        return fitted;
    };
    CHECK(!fits({{-1, -1, -.5}, {1, 0, 0}, {0, .5, .5}}));
    CHECK(fits({{-1, -1, -1}, {1, 0, 0}, {0, .5, 1}, {-1, 1, 1}, {1, 1, 1}, {1, -1, 1}}));  // a cube's corners
    CHECK(!fits({{-.5, 0, 0}, {.5, 0, 0}, {0, .5, 0}}));
    CHECK(fits({{-.4999, 0, 0}, {.5, 0, 0}, {0, .5, 0}}));
    CHECK(!fits({{-.5, -.5, .49}, {.5, .5, .49}, {0, 0, .49}}));
    CHECK(fits({{-.5, -.5, .51}, {.5, .5, .51}, {0, 0, .51}}));
    CHECK(!fits({{}, {}, {}}));
    CHECK(fits({{0, 0, 8}, {1, 0, 0}, {-1, 0, -8}}));  // reaches behind the eye
    // Where the picture ends, 4/3 from the middle: a point on the line through the origin at a right angle to the view.
    const vec3 right = normalized(cross(vec3{0, 1, 0}, vec3{1, 1, 4}));
    for (const double reach : {1.333, 1.334}) CHECK_EQ(fits({right * reach, right * -.5, {}}), reach > 4. / 3);
}

TEST("fit sees a scene whose up is z from where its eye is") {
    const vec3 eye{1, -4, 1}, up{0, 0, 1};
    const std::vector<vec3> tall{{-.1, 0, 0}, {.1, 0, 0}, {0, 0, 3}};
    const mat4 to_clip = projection(-1 / norm(eye)) * lookat(eye, {}, up);
    const auto most = [&](const std::vector<Model>& scene) {
        double y = 0;
        for (const vec3& v : scene[0].verts()) y = std::max(y, std::fabs(project(to_clip * point(v)).y));
        return y;
    };
    std::vector<Model> seen = triangles(tall), lost = triangles(tall);
    CHECK(fit(seen, eye, up) && fit(lost));
    CHECK_NEAR(most(seen), 1, 1e-14);
    CHECK(most(lost) > 1.5);
}

TEST("fit centres the box of all models, and the farthest vertex is on the middle square's border") {
    Random r(5);
    for (int k = 0; k < 300; k++) {
        std::vector<vec3> corners;
        const double size = std::exp(r.in(-20, 20));
        for (int i = 0; i < 9; i++) corners.push_back((r.point(1) + vec3{7, 0, -3} * (k % 2 + 1)) * size);
        std::vector<Model> scene = triangles(corners);
        CHECK(fit(scene));
        double most = 0;
        vec3 low{9, 9, 9}, high = -low;
        for (const Model& model : scene)
            for (const vec3& v : model.verts()) {
                most = std::max(most, seen_at(v));
                for (int i = 0; i < 3; i++) low[i] = std::min(low[i], v[i]), high[i] = std::max(high[i], v[i]);
            }
        CHECK_NEAR(most, 1, 1e-14);
        CHECK_NEAR(norm(low + high), 0, 1e-14);
        const vec3 before = corners[8] - corners[0], after = scene[2].vert(2) - scene[0].vert(0);
        CHECK_NEAR(norm(normalized(before) - normalized(after)), 0, 1e-12);  // one transform for all
    }
}

TEST("fit gives the same bits for a scene scaled by any power of two, and is defined to the ends of the range") {
    const std::vector<vec3> corners{{1.5, 2, .3}, {.7, -1, 2}, {3, 1e-5, 1}, {1, 1e-290, 2}, {2.5, 1, 1}, {1, 2, 3}};
    const auto fitted = [&](int exponent) {
        std::vector<Model> scene = triangles(corners, std::ldexp(1., exponent));
        CHECK(fit(scene));
        return std::pair(scene[0].verts(), scene[1].verts());
    };
    for (const int e : {-700, -100, -20, 1, 3, 20, 100, 500, 1000, 1021}) CHECK(fitted(e) == fitted(0));
    const double most = 1.7e308, least = 0x1p-1074;
    for (const std::vector<vec3>& extreme : std::vector<std::vector<vec3>>{
             {{-most, 0, 0}, {most, 0, most}, {0, most, 0}}, {{least, 0, 0}, {3 * least, 0, 0}, {least, least, 0}},
             {{5, 6e307, 7}, {5, 6e307, 7}, {5, 6e307, 7}}, {{1e10, 0, 0}, {1e10 + 2e-6, 0, 0}, {1e10, 2e-6, 0}}}) {
        std::vector<Model> scene = triangles(extreme);
        CHECK(fit(scene));
        double size = 0;
        for (const vec3& v : scene[0].verts()) size = std::max(size, seen_at(v));
        CHECK_NEAR(size, extreme[0].y > 6e306 ? 0 : 1, 1e-14);  // at one place: the origin
    }
}

TEST("Mshadow there and back") {
    Random r(3);
    for (int k = 0; k < 5000; k++) {
        const vec3 eye = normalized(r.point(1)) * r.in(2, 10), light = r.point(1), center = r.point(.5);
        const Camera a{lookat(eye + center, center, {0, 1, 0}), projection(-1 / norm(eye)),
                       viewport(100, 100, 600, 600)};
        const Camera b{lookat(center + light, center, {0, 1, 0}), projection(0), viewport(50, 50, 300, 300)};
        const mat4 to = b.to_screen() * a.from_screen(), back = a.to_screen() * b.from_screen();
        const vec3 p = center + r.point(.8), s = project(a.to_screen() * point(p));
        CHECK_NEAR(norm(project(to * point(s)) - project(b.to_screen() * point(p))), 0, 1e-9);
        CHECK_NEAR(norm(project(back * (to * point(s))) - s), 0, 1e-9);
    }
}

TEST("every visible pixel is shaded once, hidden faces not at all") {
    Random r(7);
    std::vector<vec4> clip;
    for (int corner = 0; corner < 900; corner++) clip.push_back(point(r.point(1)));
    for (const vec3& v : {vec3{-3, -3, -.9}, vec3{3, -3, -.9}, vec3{0, 5, -.9}})  // behind all
        clip.push_back(point(v));
    static std::vector<std::atomic<int>> calls(301);
    struct Counting final : ClipShader {
        using ClipShader::ClipShader;
        Color fragment(const Fragment& f) const override {
            calls[f.face]++;
            return ClipShader::fragment(f);
        }
    };
    const Drawing d = drawing(Counting(clip), 64, 64, viewport(0, 0, 64, 64));
    CHECK_EQ(d.count.shaded, d.seen());
    CHECK_EQ(d.count.triangles, 301);
    CHECK(d.count.covered > 2 * d.count.shaded);
    std::vector<int> visible(301);
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 64; x++)
            if (d.drawn(x, y)) visible[d.face(x, y)]++;
    for (int i = 0; i < 301; i++)  // as few batches as each strip of rows allows
        CHECK(calls[i] * lanes >= visible[i] && calls[i] <= visible[i] / lanes + 4 && calls[i] <= visible[i]);
}

TEST("what is not drawn is at minus infinity, every cell of it, and outside of the buffer too") {
    DepthBuffer z(7, 5);
    for (int y = 0; y < 5; y++) std::fill_n(z.row(y), 7, 3.F);
    draw(std::vector<ClipShader>{}, viewport(0, 0, 7, 5), z);
    for (int y = 0; y < 5; y++)
        for (int x = 0; x < 7; x++) CHECK(z.row(y)[x] == -INFINITY);
    z.row(0)[0] = 1;
    const auto at = [&](double x, double y) { return z.at(vec<3, coord>{x, y, 0})[0]; };
    CHECK(at(0, .9) == 1 && at(-.1, 0) == -INFINITY && at(7, 0) == -INFINITY && at(NAN, 0) == -INFINITY);
    CHECK_THROWS(DepthBuffer(0, 5), "16384");
    CHECK_THROWS(DepthBuffer(5, 16385), "16384");
}

TEST("the nearer face wins, the first drawn of equals") {
    std::vector<vec4> clip;
    for (const double z : {0., .5, .5})
        for (const vec4& v : {vec4{-1, -1, z, 1}, vec4{3, -1, z, 1}, vec4{-1, 3, z, 1}}) clip.push_back(v);
    const Drawing d = drawing(clip, 8, 8);
    for (int y = 0; y < 8; y++)
        for (int x = 0; x < 8; x++) CHECK_EQ(d.face(x, y), 1);
    CHECK_EQ(d.count.covered, 192);
    CHECK_EQ(d.count.shaded, 64);
}

TEST("depth and barycentric coordinates against long double, w from 1e-3 to 1e3") {
    static std::vector<std::pair<vec3, vec3>> seen;  // screen and barycentric coordinates of the fragments
    struct Recording final : ClipShader {
        using ClipShader::ClipShader;
        Color fragment(const Fragment& f) const override {
            for (int i = 0; i < lanes; i++)
                seen.push_back({{f.screen.x[i], f.screen.y[i], f.screen.z[i]}, {f.bar.x[i], f.bar.y[i], f.bar.z[i]}});
            return {};
        }
    };
    use_threads(1);
    Random r(4);
    for (int k = 0; k < 20000; k++) {
        const double range = k % 2 ? 1.6 : 6.9;  // w from .2 to 5, or from 1e-3 to 1e3
        std::vector<vec4> clip(3);
        for (vec4& c : clip) {
            const double w = std::exp(r.in(-range, range));
            c = {r.in(-1, 1) * w, r.in(-1, 1) * w, r.in(-1, 1) * w, w};
        }
        const int size = 64;
        seen.clear();
        drawing(Recording(clip), size, size, viewport(0, 0, size, size));
        // Screen-space barycentric coordinates, then the division by w of each corner, all in long double.
        using wide3 = vec<3, long double>;
        wide3 W, corner[3];  // on the screen
        for (int i = 0; i < 3; i++) {
            W[i] = clip[i].w;
            corner[i] = {(clip[i].x / W[i] + 1) * size / 2, (clip[i].y / W[i] + 1) * size / 2,
                         (clip[i].z / W[i] + 1) * screen_depth / 2};
        }
        const auto area = [](const wide3& a, const wide3& b, const wide3& c) { return cross(b - a, c - a).z; };
        const long double whole = area(corner[0], corner[1], corner[2]);
        if (std::fabs(whole) < 1) continue;  // needles have their own test
        for (const auto& [at, bar] : seen) {
            CHECK(bar.x >= 0 && bar.y >= 0 && bar.z >= 0);
            CHECK_NEAR(bar.x + bar.y + bar.z, 1, 1e-15);
            const wide3 p{at.x, at.y, at.z};
            const wide3 l = wide3{area(p, corner[1], corner[2]), area(corner[0], p, corner[2]),
                                  area(corner[0], corner[1], p)} / whole;
            if (!(std::min({l.x, l.y, l.z}) > 1e-3L)) continue;  // within the snapping of the corners
            const wide3 z{corner[0].z, corner[1].z, corner[2].z}, q{l.x / W.x, l.y / W.y, l.z / W.z};
            CHECK_NEAR(at.z, static_cast<double>(dot(l, z)), 1e-8);
            for (int i = 0; i < 3; i++) CHECK_NEAR(bar[i], static_cast<double>(q[i] / (q.x + q.y + q.z)), 1e-10);
        }
    }
}

TEST("a floor through the eye's plane is cut, not wrapped round") {
    // The plane y = -1 from far ahead to behind the eye at (0,0,1): on the screen it fills what is below the horizon.
    const auto at = [](double x, double z) { return projection(-1) * point(vec3{x, -1, z}); };
    const vec4 a = at(-1e4, 50), b = at(1e4, 50), c = at(1e4, -1e4), e = at(-1e4, -1e4);
    const Drawing d = drawing({a, b, c, a, c, e}, 64, 64);
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 64; x++) CHECK_EQ(d.drawn(x, y), y < 32);
}

TEST("nothing behind the eye is drawn, nothing outside is touched") {
    const Drawing behind = drawing({{-1, -1, 0, -1}, {1, -1, 0, -1}, {0, 1, 0, -1}}, 16, 16);
    CHECK_EQ(behind.count.outside, 1);
    CHECK_EQ(behind.count.covered, 0);
    Random r(5);
    for (int k = 0; k < 20000; k++) {  // the sanitizers watch the buffers
        std::vector<vec4> clip;
        const double size = std::exp(r.in(-3, 12));
        for (int i = 0; i < 3; i++) {
            const vec3 p = r.point(size);
            clip.push_back({p.x, p.y, p.z, r.in(-2, 2)});
        }
        const Drawing d = drawing(clip, 1 + k % 9, 1 + k % 7);
        for (int y = 0; y < d.height(); y++)
            for (int x = 0; x < d.width(); x++) CHECK(!std::isnan(d.z.row(y)[x]));
    }
}

TEST("corners that are not numbers are left out") {
    for (const vec4& corner : {vec4{NAN, 0, 0, 1}, vec4{INFINITY, 0, 0, 1}})
        CHECK_EQ(drawing({corner, {1, 0, 0, 1}, {0, 1, 0, 1}}, 8, 8).count.outside, 1);
    CHECK_EQ(drawing({{0, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}}, 8, 8).count.outside, 1);
}

TEST("the same bytes from 1, 2 and 7 threads, with a picture and without") {
    Random r(6);
    std::vector<vec4> clip;
    for (int k = 0; k < 9000; k++) {
        const vec3 c = r.point(1.2);
        for (int i = 0; i < 3; i++) clip.push_back(point(c + r.point(.2)));
    }
    use_threads(1);
    const Drawing one = drawing(clip, 200, 150);
    for (const int threads : {2, 7, 1}) {
        use_threads(threads);
        CHECK(same(one, drawing(clip, 200, 150)));
        DepthBuffer z(200, 150);
        draw(std::vector{ClipShader(clip)}, viewport(0, 0, 200, 150), z);
        for (int y = 0; y < 150; y++) CHECK(std::memcmp(z.row(y), one.z.row(y), 200 * sizeof(float)) == 0);
    }
}

TEST("parallel_for calls each number once, and throws what a call throws") {
    for (const int threads : {1, 2, 7}) {
        use_threads(threads);
        std::vector<std::atomic<int>> calls(1000);
        std::atomic<bool> in_range = true;
        parallel_for(1000, [&](int i, int thread) {
            calls[i]++;
            if (thread < 0 || thread >= threads) in_range = false;
        });
        for (const std::atomic<int>& n : calls) CHECK_EQ(n.load(), 1);
        CHECK(in_range);
        parallel_for(0, [&](int, int) { in_range = false; });
        CHECK(in_range);
        const auto throwing = [](int i, int) {
            if (i == 31) throw std::runtime_error("thirty-one");
        };
        CHECK_THROWS(parallel_for(50, throwing), "thirty-one");
    }
}

// A picture of 20 x 16 pixels, in pixels: the guard band around it is 4096 wide.
TEST("faces beside the picture are counted as outside, small ones that cover no centre as that") {
    constexpr struct { double x, y; long outside, between; } cases[] = {
        {-8.6, 5.4, 1, 0}, {25.4, 5.4, 1, 0}, {5.4, -8.6, 1, 0}, {5.4, 25.4, 1, 0}, {-9000, 5, 1, 0}, {5, 9000, 1, 0},
        {5.6, 5.6, 0, 1}, {19.1, 15.1, 0, 1}, {5.3, 5.3, 0, 1}, {5.4, 5.4, 0, 0}};
    for (const auto& [x, y, outside, between] : cases) {
        std::vector<vec4> clip;
        for (const auto& [dx, dy] : {std::pair(0., 0.), std::pair(.3, 0.), std::pair(0., .3)})
            clip.push_back({(x + dx) / 10 - 1, (y + dy) / 8 - 1, 0, 1});
        const Counters c = drawing(clip, 20, 16).count;
        CHECK_EQ(c.outside, outside);
        CHECK_EQ(c.between_samples, between);
        CHECK_EQ(c.covered, 1 - outside - between);
    }
}

// Of any size, from a speck to far beyond a double's precision on the screen, in front of the eye, beside and behind.
TEST("what is not seen by its box covers no pixel, and what covers one is seen") {
    Random r(21);
    long unseen = 0, covering = 0;
    for (int k = 0; k < 4000; k++) {
        const double size = std::pow(10, r.in(-3, k % 9 ? 3 : 300));
        const vec3 away = r.point(k % 2 ? size : 2);
        std::vector<vec3> corners;
        for (int i = 0; i < 3; i++) corners.push_back(r.point(size) + away);
        const std::vector<Model> models{Model(corners, {}, {{0, 0, 1}}, {{0, -1, 0}, {1, -1, 0}, {2, -1, 0}})};
        const vec3 eye = r.point(4);
        const Camera camera{lookat(eye, {}, {0, 1, 0}), projection(-1 / norm(eye)), middle_viewport(20, 16)};
        std::vector<vec4> clip;
        for (const vec3& v : corners) clip.push_back(camera.to_clip() * point(v));
        const Drawing d = drawing(ClipShader(clip), 20, 16, camera.Viewport);
        const bool seen = !seen_by(camera, models, 20, 16).empty();
        CHECK(seen || d.count.covered == 0);
        unseen += !seen, covering += d.count.covered > 0;
    }
CHECK(unseen > 900 && covering > 900);
}

TEST("texels: nearest, wrapped, v upwards; grey is grey in all channels") {
    TGAImage picture(4, 2, TGAImage::GRAYSCALE);
    for (int i = 0; i < 8; i++) *picture.pixel(i % 4, i / 4) = static_cast<std::uint8_t>(i);
    Map map;
    map.picture = std::make_shared<TGAImage>(picture);
    const auto texel = [&](double u, double v) {
        const Color c = Texels(map, UV({u, v})).bgr();
        CHECK(c[0][0] == c[1][0] && c[0][0] == c[2][0]);
        return static_cast<int>(c[0][lanes - 1]);
    };
    constexpr struct { double u, v; int texel; } cases[] = {
        {0, 0, 0}, {.26, .2, 1}, {.99, .99, 7}, {1, 1, 0}, {-.01, -.01, 7}, {-1e-20, 5.6, 7}, {1e300, -1e300, 0}};
    for (const auto& [u, v, expected] : cases) CHECK_EQ(texel(u, v), expected);
    map.scale = {.5, 2}, map.offset = {.25, -.5}, map.is_moved = true;
    for (const auto& [u, v, expected] : cases)  // wrapped after that, not before
        if (u < 1e9 && u != -1e-20) CHECK_EQ(texel((u - .25) * 2, (v + .5) / 2), expected);
}

TEST("integer powers") {
    CHECK(power(0, 0)[0] == 1 && power(2, 10)[0] == 1024 && power(.5, 3)[0] == .125);
    // A product is off by 2^-24 of itself, and squaring doubles what its factor is off by: base^e by e - 1 of those.
    for (int e = 0; e < 256; e++) {
        const double exact = std::pow(double{.97F}, e);
        CHECK_NEAR(power(.97, e)[0], exact, exact * e * 0x1p-24);
    }
}

TEST("the middle viewport: three quarters of the shorter side, times zoom, about the middle") {
    const vec4 corner{1, -1, 1, 1};
    CHECK(middle_viewport(800, 400) * corner == (vec4{550, 50, screen_depth, 1}));
    CHECK(middle_viewport(400, 800, .5) * corner == (vec4{275, 325, screen_depth, 1}));
}

TEST("depth as a picture: nearest white, nothing black") {
    DepthBuffer z(3, 1);
    z.row(0)[0] = 500, z.row(0)[1] = 1000, z.row(0)[2] = -INFINITY;
    const TGAImage p = depth_picture(z);
    CHECK_EQ(int{p.get(1, 0)[0]}, 255);
    CHECK_EQ(int{p.get(0, 0)[0]}, 32);
    CHECK_EQ(int{p.get(2, 0)[0]}, 0);
    z.row(0)[0] = 1000;
    CHECK_EQ(int{depth_picture(z).get(0, 0)[0]}, 255);
}

// Cells of all depths from 0 to 63, so that a pixel tells whose it is.
TEST("depth as a picture: cells that are not square come out square, in the middle") {
    DepthBuffer z(8, 8);
    for (int i = 0; i < 64; i++) z.row(i / 8)[i % 8] = static_cast<float>(i);
    const auto pixel = [&](const TGAImage& p, int x, int y) {
        const int grey = *p.pixel(x, y);
        return grey ? static_cast<int>(std::lround((grey - 32) * 63 / 223.)) : -1;
    };
    const TGAImage narrow = depth_picture(z, .5), flat = depth_picture(z, 4);
    for (int i = 0; i < 64; i++) {
        const int x = i % 8, y = i / 8;
        CHECK_EQ(pixel(narrow, x, y), x < 2 || x > 5 ? -1 : 8 * y + 2 * (x - 2) + 1);
        CHECK_EQ(pixel(flat, x, y), y < 3 || y > 4 ? -1 : 8 * (4 * (y - 3) + 2) + x);
    }
    for (const double aspect : {0., 1e-300, 1e300, std::numeric_limits<double>::infinity()}) {
        const TGAImage line = depth_picture(z, aspect);
        int drawn = 0;
        for (int i = 0; i < 64; i++) drawn += *line.pixel(i % 8, i / 8) > 0;
        CHECK_EQ(drawn, 8);
    }
}

// Acne is a face that shadows itself. A face alone in the buffer is looked up at random points of it, at all its
// slopes.
TEST("with the derived bias no face shadows itself, with a half of it some do") {
    Random r(8);
    long acne = 0, halved = 0;
    for (int k = 0; k < 2000; k++) {
        const double size = std::exp(r.in(-2, 4)), depth = std::exp(r.in(-2, 7));
        vec3 face[3];
        std::vector<vec4> clip;
        for (vec3& v : face) {
            v = {8 + r.in(-size, size), 8 + r.in(-size, size), 1000 + r.in(-depth, depth)};
            clip.push_back(point(vec3{v.x / 8 - 1, v.y / 8 - 1, v.z / 1000 - 1}));
        }
        const Drawing d = drawing(clip, 16, 16);
        const vec2 slope = depth_slope({point(face[0]), point(face[1]), point(face[2])});
        for (int i = 0; i < 50; i++) {
            double a = r.in(0, 1), b = r.in(0, 1);
            if (a + b > 1) a = 1 - a, b = 1 - b;
            const vec3 p = face[0] * (1 - a - b) + face[1] * a + face[2] * b;
            const vec<3, coord> sb_p{p.x, p.y, p.z};
            const coord stored = d.z.at(sb_p), bias = derived_bias(d.z, sb_p, stored, slope), height = stored - sb_p.z;
            acne += any(height > bias);
            halved += any(height > bias * .5);
        }
    }
    CHECK_EQ(acne, 0);
    CHECK(halved > 1000);
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
