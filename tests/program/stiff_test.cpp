// stiff_test.cpp: inputs at the edges of the arithmetic, and what must come out of each: pixels counted, bytes
// compared, shadows held against the ray caster. It knows nothing of how a picture should look otherwise.
#include "drawing.h"
#include "random.h"
#include "run.h"
#include "scenes.h"

namespace {

const std::string reporter = "\"" UMBRA_REPORT "\"";

struct Figures {  // what the ray caster says of a picture, in pixels
    double coverage, facing, falsely_dark, falsely_lit;
    bool operator==(const Figures&) const = default;
};

using Wide = long double;
const Strings methods{"--shadow map ", "--shadow exact ", "--bias 43.34 "};

// A model m.obj in a folder of its own. Every run draws it, small unless the options say otherwise. A pixel's blue is 0
// where nothing is drawn, and at least the ambient 20 where something is.
struct Scene : Folder {
    std::string always;  // an option of each run

    explicit Scene(const std::string& obj, const std::string& option = "") : always(option) { write("m.obj", obj); }

    // The run must succeed and say nothing on standard error.
    Outcome good(const std::string& options, const std::string& program = umbra_command) const {
        for (const std::string earlier : {"framebuffer.tga", "depth.tga"}) std::filesystem::remove(*this / earlier);
        const Outcome o = run("--quiet --size 60x60 --shadow-size 128 " + always + ' ' + options + " m.obj", program);
        if (!CHECK_EQ(o.err, std::string()) || !CHECK_EQ(o.status, 0)) std::cerr << "    umbra " << options << '\n';
        return o;
    }
    template <class Visit>
    long each_pixel(const std::string& options, const Visit& visit) const {
        good(options);
        return Folder::each_pixel([&](int x, int y, const std::uint8_t* bgr) { visit(x, y, int{*bgr}); });
    }
    Figures report(const std::string& options) const {
        const std::string out = good(options, reporter).out;
        return {value(out, "coverage"), value(out, "facing"), value(out, "falsely_dark"), value(out, "falsely_lit")};
    }

    // With each method, all of the options make the same pictures.
    void check_same(const Strings& options) const {
        for (const std::string& method : methods) {
            const Outcome first = good(method + options[0]);
            for (const std::string& other : options) CHECK(good(method + other).same_pictures(first));
        }
    }
    // With each method, so many pixels are drawn.
    void check_drawn(const std::string& options, long least, long most) const {
        for (const std::string& method : methods) {
            long n = 0;
            each_pixel(method + options, [&](int, int, int blue) { n += blue > 0; });
            if (!CHECK(n >= least && n <= most)) std::cerr << "    " << n << ": umbra " << method << options << '\n';
        }
    }
    // Not a pixel is dark that should be lit. If all is to be right, none is lit that should be dark either, and what
    // the ray caster sees is what is drawn.
    void check_shadows(const std::string& options, int least, bool all_right) const {
        const Figures is = report(options);
        const bool right = is.falsely_dark == 0 && (!all_right || (is.falsely_lit == 0 && is.coverage == 0));
        if (!CHECK(right) || !CHECK(is.facing >= least)) std::cerr << "    umbra " << options << '\n';
    }
    void check_exact(const Strings& options, int least) const {
        for (const std::string& o : options) check_shadows("--shadow exact " + o, least, true);
    }
    void check_lit(const std::string& options, int least) const {
        for (const std::string method : {"map ", "exact "}) check_shadows("--shadow " + method + options, least, false);
    }
};

std::string polygons(const std::vector<std::vector<vec3>>& all) {
    Obj obj;
    for (const std::vector<vec3>& corners : all) obj.polygon(corners);
    return obj.text();
}

// A net of n x n squares across the direction `normal`, 1.4 wide, its middle at `at`. A bend makes it a dome: convex,
// since its height is a function of u plus one of v, each of which is.
std::string net(const vec3& normal, const vec3& at, int n, double bend = 0, double scale = 1) {
    const vec3 k = normalized(normal), i = normalized(cross(k, vec3{.3, .5, -.8})), j = cross(k, i);
    const auto p = [&](int a, int b) {
        const double u = 1.4 * a / n - .7, v = 1.4 * b / n - .7;
        return (at + i * u + j * v - k * (bend * (u * u + v * v))) * scale;
    };
    Obj obj;
    for (int b = 0; b < n; b++)
        for (int a = 0; a < n; a++) obj.polygon({p(a, b), p(a + 1, b), p(a + 1, b + 1), p(a, b + 1)});
    return obj.text();
}

// Acne is a surface that shadows itself. Nothing else stands before a plane, before what is lit of a dome, or, in light
// from above or along x, before two floors side by side. A third, its back to the light, is below them.
void check_no_acne(const std::string& options, double s = 1) {
    for (const double bend : {0., .6}) Scene(net({1, 2, 3}, {}, 24, bend, s)).check_lit(options, 300);
    Obj floors;
    for (const vec3& v : {vec3{.7, .5, -.6}, vec3{.7, .13, .1}, vec3{-.7, -.4, .1}}) {
        const vec3 along = vec3{-2 * v.x, 0, 0} * s, across = vec3{0, 0, .5} * s;
        floors.polygon({v * s, v * s + along, v * s + along + across, v * s + across});
    }
    Scene(floors.text()).check_lit(options, 100);
}

// The pipeline itself, for what only clip space can say: three corners a face. The nearest face at each pixel, -1 where
// there is none, rows from the bottom up.
std::vector<int> faces(const std::vector<vec4>& clip, int size) {
    const Drawing d = drawing(clip, size, size);
    std::vector<int> all;
    for (int i = 0; i < size * size; i++) all.push_back(d.face(i % size, i / size));
    return all;
}

const Scene the_yard(yard(), "--no-fit");  // what most tests draw

}  // namespace

// Exactly parallel, the picture is that of an `up` of zero: the axis least parallel to the view takes its place.
TEST("cameras: the view along up, both ways, exactly and nearly") {
    for (const std::string& options : each("--up %", {"1,1,4", "-1,-1,-4", "2e-300,2e-300,8e-300"}))
        CHECK(the_yard.good(options).frame == the_yard.good("--up 0,0,0").frame);
    the_yard.check_exact(each("--up %,1,4", {"1.0001", "1.0000001", "1.000000000001"}), 500);
    the_yard.check_exact(each("--up -%,-1,-4", {"1.0001", "1.0000001", "1.000000000001"}), 500);
}

TEST("cameras: the light along up, both ways, exactly and nearly") {
    const Strings x{"0", "1e-4", "-1e-4", "1e-7", "1e-12"};
    the_yard.check_exact(each("--light %,1,0", x), 500);
    the_yard.check_exact(each("--eye 1,-2,4 --light %,-1,0", x), 500);
    for (const std::string& options : each("--light %,1,0", x)) check_no_acne(options);
}

// Spot and point lights anywhere: above, among and below the boxes of the yard, whose floor many of them have behind.
TEST("lights: spot and point at forty places") {
    Random r(14);
    for (int k = 0; k < 40; k++) {
        const std::string place = triple(r.point(k % 4 ? 1.5 : 6));
        const std::string angle = std::array{",5", ",10", ",45", ",80", ",89"}[k % 5];
        const std::string kind = std::array{"--spot ", "--beam square --spot ", "--point "}[k % 3];
        the_yard.check_exact({kind + place + angle}, 0);
    }
    the_yard.check_exact({"--spot 1,2,1", "--point 1,2,1", "--spot 1,2,1 --beam square",
                          "--light 1,1,1 --spot 1,2,1,60"}, 300);
    for (const std::string& light : each("--% 1,2,1 ", {"light", "spot", "point"}))  // a second yard in the first
        the_yard.check_exact(each(light + "m.obj --at .5,%,.3 --turn 30 --scale .3", {"0", "-.35", "1e3"}), 300);
    const Scene plane(net({0, 1, 0}, {}, 8), "--no-fit");
    for (int k = 0; k < 12; k++) {  // a plane has no acne, wherever the light above it is
        const vec3 at = r.point(std::array{.05, .5, 3., 30.}[k % 4]);
        const vec3 place{at.x, std::fabs(at.y) * (k % 3 ? 1 : 1e-3), at.z};
        plane.check_lit("--shadow-size 999 --eye 0,4,1 --point " + triple(place) + (k % 2 ? ",89" : ",45"), 800);
    }
    for (const double n : {1., .1, .01, .001}) {
        plane.check_lit("--point 0," + std::to_string(n) + ",0,89 --eye 0,4,1", 800);
        plane.check_lit("--spot 1.5," + std::to_string(n) + ",0,60 --eye 0,4,1", 400);
    }
}

TEST("lights: half angles of 1e-6 and 89, on a surface, at a vertex, at the eye, at 1e6 and 1e-6, along up, at it") {
    for (const std::string& kind : each("--% ", {"spot", "point"})) {
        the_yard.check_exact(each(kind + "1,2,1,%", {"1e-6", "1e-3", "89"}), 0);
        the_yard.check_exact(each(kind + "%", {".3,-.5,.75", "-.25,.5,.5", "1,1,4", "1e6,1e6,1e6"}), 0);
        the_yard.check_exact(each(kind + "%", {"0,2,0", "0,-2,0,60"}), 0);
        the_yard.check_exact({"--center .25,.125,.25 " + kind + ".25,.125000001,.25"}, 0);
        the_yard.check_exact({kind + "1e-6,1e-6,1e-6"}, 0);
        for (const std::string& far : each(kind + "%,%,%,1e-4", {"1e18", "1e100", "1e300"})) the_yard.good(far);
        for (const std::string wrong : {"0,0,0", "1,2", "1,2,3,0", "1,2,3,-1", "1,2,3,90", "1,2,3,nan", "1,2,3,4,5",
                                        "nan,0,0", "1e308,1e308,0"})
            check_refused(the_yard, kind + wrong + " m.obj", 2, wrong == "0,0,0" ? "the light" : kind.substr(0, 6));
    }
}

// Only the direction counts: the same bytes at any length that a double has, denormal ones too.
TEST("cameras: tiny and huge up and light") {
    the_yard.check_same(each("--up 0,%,0", {"1", "1e-300", "4.9406564584124654e-324", "1e300", "1e307"}));
    the_yard.check_same(each("--light %,%,0", {"1", "1e-300", "4.9406564584124654e-324", "1e300", "7e306"}));
}

TEST("cameras: no direction, no number, or beyond the range of a double is a wrong command line") {
    for (const std::string wrong : {"--light 0,0,0", "--light nan,0,0", "--light inf,1,0", "--eye nan,0,0",
                                    "--up 0,inf,0", "--center 1e999,0,0", "--eye 1,2,3 --center 1,2,3",
                                    "--up 1.7e308,1.7e308,-1.7e308", "--eye 1.7e308,0,0 --center -1.7e308,0,0"})
        check_refused(the_yard, wrong + " m.obj", 2, wrong.substr(0, wrong.find(' ')));
}

TEST("cameras: center off the origin") {
    the_yard.check_exact({"--center .5,.5,.5"}, 100);
    for (const std::string x : {"1e2", "1e6", "1e18", "1e300"}) the_yard.check_drawn("--center " + x + ",0,0", 0, 0);
    // Far off and turned: normals are not moved by a translation, however large.
    the_yard.check_drawn("--center 8e16,0,-6e16 --eye 80000003e9,0,-59999996e9", 0, 0);
}

// From 1e10 on the perspective moves no corner by 2e-8 pixel, a thousandth of a sub-pixel: the picture stays as it is.
TEST("cameras: the eye at 1e4, 1e8 and farther") {
    the_yard.check_exact(each("--eye 1%,1%,4%", {"e4", "e8"}), 300);
    the_yard.check_same(each("--eye 1%,1%,4%", {"e10", "e16", "e100", "e300"}));
}

TEST("cameras: the eye inside the model and on a surface") {
    the_yard.check_exact({"--eye .01,.125,.02",                                // between wall and block
                          "--eye .375,-.5,.25 --center -.25,-.25,0",           // on the floor
                          "--eye 0,-.49999,0 --center -.5,-.375,-.25"}, 1);    // a hair above it
    const std::string in_the_block = "--eye .3125,.125,.25 --center .25,.125,.125";
    CHECK_EQ(the_yard.report("--shadow exact " + in_the_block).coverage, 0);
    the_yard.check_drawn(in_the_block, 3600, 3600);
}

// The eye's distance from center is the field of view: the window at center is 8/3 wide.
TEST("cameras: near distances and fields of view") {
    for (const double d : {1e-1, 1e-3, 1e-5, 1e-6})  // up to 179.9999 degrees
        the_yard.check_exact({"--center 0,-.25,0 --eye " + triple({.25 * d, -.25 - .125 * d, d})}, 300);
    for (const double d : {8., 1e2, 1e4, 1.5e4})  // down to .01 degrees
        the_yard.check_exact({"--eye " + triple(vec3{.25, .125, 1} * d)}, 300);
}

TEST("coordinates: a fitted model scaled by 1e6 to 1e300 and 1e-6 to 1e-300; by a power of two not one byte changes") {
    for (const double s : {1e6, 1e18, 1e38, 1e300, 1e-6, 1e-30, 1e-300}) {
        Scene(yard(s)).check_exact({""}, 500);
        check_no_acne("", s);
    }
    for (const std::string& method : methods) {
        const Outcome twice = Scene(yard(2)).good(method);
        for (const int k : {2, 10, 60, 127, 512, 1000, 1023, -14, -20, -127, -1000})
            CHECK(Scene(yard(std::ldexp(1., k))).good(method).same_pictures(twice));
    }
}

// Unfitted, it is smaller than a pixel and lies between two pixels' centres.
TEST("coordinates: unfitted and scaled by 1e-6, 1e-30, 1e-300 and to denormals") {
    for (const double s : {1e-6, 1e-30, 1e-300, 1e-310, 1e-320}) {
        Scene(yard(s)).check_drawn("--no-fit", 0, 0);
        Scene(yard(s)).check_drawn("", 501, 3600);
    }
}

// Of a huge model the window at center, 8/3 wide, shows a detail. Here it is a triangle, all over the picture.
TEST("coordinates: huge and unfitted") {
    for (const double s : {1e3, 1e6, 1e18, 1e38, 1e100, 1e200, 1e300})
        for (const double side : {s, -s})
            Scene(polygons({{{-s, -s, -s}, {s, -s, 0}, {0, s, s}}}))
                .check_drawn("--no-fit --light 1,1,4 --eye " + triple(vec3{1, 1, 4} * side), 3600, 3600);
    // Where the sum of three products is beyond the range of a double, a face has no place on the screen.
    Scene(yard(1.7e308)).check_drawn("--no-fit", 0, 0);
    // The ray caster's products of six coordinates need them below 1e40: to report on this one is an error.
    const Outcome o = Scene(yard(1e41)).run("--no-fit --eye 1e41,1e41,4e41 m.obj", reporter);
    CHECK(o.status == 1 && lines(o.err) == 1 && o.frame.empty() && o.depth.empty());
}

TEST("coordinates: one axis scaled by 1e6 and 1e-6") {
    for (const double s : {1e6, 1e-6})
        for (const vec3& scale : {vec3{s, 1, 1}, vec3{1, s, 1}, vec3{1, 1, s}})
            Scene(yard(scale)).check_exact({"--light 1,1,.5"}, s < 1 ? 51 : 0);
}

// Moves by powers of two are exact as long as the corners' eighths are: then not one byte changes, since everything is
// computed relative to center. From 1e15 on the eighths are no doubles.
TEST("coordinates: model and camera moved together by 1e2 to 5e14") {
    for (const std::string& method : methods) {
        const auto draw = [&](const vec3& by) {
            const std::string camera = " --center " + triple(by) + " --eye " + triple(by + vec3{1.125, 1.25, 4});
            return Scene(yard({1, 1, 1}, by)).good(method + "--light 1,1,.5 --no-fit" + camera);
        };
        for (const double d : {1e2, 1e4, 1e6, 1e9, 1e12, 5e14}) CHECK(draw({d, d / 2, -d}).same_pictures(draw({})));
    }
    the_yard.check_drawn("--light 1,1,.5 --eye 1.125,1.25,4", 501, 3600);
}

TEST("coordinates: vertices that are no numbers, or beyond the range of a double") {
    for (const std::string v : {"nan", "inf", "-inf", "1e309", "-1e999"})
        check_refused(Scene("v 0 0 0\nv 1 0 0\nv 0 " + v + " 0\nf 1 2 3\n"), "m.obj", 1, "umbra: m.obj:3: ");
}

// The idol with its maps, moved and scaled before it is fitted. Rounding moves its corners by 1e-10 at most: not one
// pixel changes sides, or its colour.
TEST("coordinates: shadow and shading errors of a model moved by 1e6 and scaled by 1e6 and 1e-6") {
    const std::string idol = UMBRA_OBJ_DIR "/idol/idol";
    for (const std::string& method : each("--size 200x200 --shadow-size 400 --shadow %", {"map", "exact"})) {
        const auto draw = [&](double scale, double by) {
            std::ifstream in(idol + ".obj");
            Obj vertices;
            std::string rest, line;
            for (vec3 v; std::getline(in, line);)
                if (std::sscanf(line.c_str(), "v %lf %lf %lf", &v.x, &v.y, &v.z) != 3) rest += line + '\n';
                else vertices.vertex(v * scale + vec3{by, by, -by});
            const Scene f(vertices.text() + rest);
            for (const std::string& map : each("_%.tga", {"diffuse", "glow", "nm", "nm_tangent", "spec"}))
                std::filesystem::copy_file(idol + map, f / ("m" + map));
            return std::pair(f.report(method), f.good(method).frame);
        };
        const auto home = draw(2, 0);  // fitted, as those below are
        CHECK(home.first.facing > 5000);
        for (const auto& [scale, by] : {std::pair(1e6, 0.), std::pair(1e-6, 0.), std::pair(2., 1e6)})
            CHECK(draw(scale, by) == home);
    }
}

TEST("coordinates: texture coordinates of any size") {
    const auto draw = [](const std::string& t) {
        const Scene f("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt " + t + ' ' + t + "\nf 1/1 2/1 3/1 4/1\n");
        TGAImage grey(2, 2, TGAImage::RGB);
        for (int i = 0; i < 4; i++) grey.set(i % 2, i / 2, {{90, 90, 90, 255}});
        grey.write_tga_file(f / "m_diffuse.tga");
        return f.good("--eye 0,0,4 --light 0,1,1").frame;
    };
    for (const std::string t : {"1e300", "-1.7976931348623157e308", "1.7976931348623157e308", "1e-320"})
        CHECK(draw(t) == draw(".25"));
}

// Its corners' differences are beyond the range of a double; the frame needs their directions alone.
TEST("coordinates: a tangent-space normal map on a face of 1e308") {
    const auto draw = [](const std::string& exponent) {  // all over the picture
        const std::string low = "-.5e" + exponent, high = "1.5e" + exponent;
        const Scene f("v " + low + ' ' + low + " 0\nv " + high + ' ' + low + " 0\nv " + low + ' ' + high +
                      " 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n");
        TGAImage slanted(1, 1, TGAImage::RGB);
        slanted.set(0, 0, {{200, 128, 230, 255}});  // to the right and towards the viewer
        slanted.write_tga_file(f / "m_nm_tangent.tga");
        return f.good("--no-fit --size 2x2 --eye 0,0,4 --light 0,0,1 --draw normal").frame;
    };
    CHECK(draw("308") == draw("6"));
}

TEST("triangles: a repeated index and collinear corners draw nothing and change nothing") {
    const std::string line = "v -1 -.5 0\nv 0 0 0\nv 1 .5 0\n";
    const Scene more(yard() + line + "f -3 -2 -1\nf -1 -1 -2\nf -2 -2 -2\nf -3 -1 -3\n", the_yard.always);
    for (const std::string& method : methods) CHECK(more.good(method).same_pictures(the_yard.good(method)));
    more.check_exact({""}, 500);
}

// A square cut into columns x rows cells, each of two triangles; fitted, it has 56 x 56 pixels. They are all there, and
// none was drawn twice: of all samples inside of a face not one is hidden by another.
std::string check_cells(int columns, int rows) {
    std::string text;
    for (int cell = 0; cell < columns * rows; cell++) {
        for (const int corner : {0, 1, 3, 2})
            text += "v " + std::to_string((cell % columns + corner % 2) * rows) + ' ' +
                    std::to_string((cell / columns + corner / 2) * columns) + " 0\n";
        text += "f -4 -3 -2 -1\n";
    }
    const std::string out = Scene(text).run("--size 80x80 --shadow off --eye 0,0,4 m.obj").out;
    CHECK_EQ(value(out, "triangles"), 2. * columns * rows);
    CHECK_EQ(value(out, "pixels"), 56 * 56);
    CHECK_EQ(value(out, "hidden"), 0);
    return out;
}

// The model must not vanish. All triangles are left out but one for each pixel's centre, two
// where that is on their common edge: on the diagonal.
TEST("triangles: a million that are smaller than a pixel") {
    CHECK_EQ(value(check_cells(708, 708), "between_samples"), 2. * 708 * 708 - 56 * 56 - 56);
}

TEST("triangles: needles of 1 to 500000 side by side, and of 1 to 1e6 where they cover a centre") {
    check_cells(500000, 1);  // 1.2e-4 pixel wide
    // Along the diagonal, w across, through the centres of the 64 pixels on it; 24 w pixels are 4 sub-pixels.
    constexpr double w = 4. / 65536 / 24, s = 4. / 3;
    const Scene f(polygons({{{-s - w, -s, 0}, {-s + w, -s, 0}, {s + w, s, 0}, {s - w, s, 0}}}));
    f.each_pixel("--no-fit --size 64x64 --eye 0,0,4", [](int x, int y, int blue) { CHECK_EQ(blue > 0, x == y); });
}

// An edge through the middle of the picture. It is 2^-52 of its length off at most: exact pixels up to 1e6 screens.
TEST("triangles: 30 and 1e6 times the screen") {
    for (const double s : {30., 1e3, 1e6}) {
        const Scene f(polygons({{{-3 * s, -s, 0}, {3 * s, s, 0}, {-s, 3 * s, 0}}}));
        f.each_pixel("--no-fit --size 61x61 --eye 0,0,4", [](int x, int y, int blue) {
            const int above = 3 * (y - 30) - (x - 30);  // three times the pixels above the edge
            if (above != 0) CHECK_EQ(blue > 0, above > 0);
        });
    }
    // All around the screen it is all of the screen, lit and at z = 0, but for a sheet whose back is to the light, a
    // little behind it or before it. A float below 1000 has steps of 6e-8 of z.
    for (const double s : {1e9, 1e18, 1e38, 1e100, 1e300})
        for (const double z : {-2e-7, 2e-7}) {
            const std::vector<vec3> sheet{{-2, -2, z}, {-2, 2, z}, {2, 2, z}, {2, -2, z}};
            std::string obj = polygons({sheet, {{-3 * s, -s, 0}, {3 * s, -s, 0}, {0, 3 * s, 0}}}) + "vn 0 0 -1\n";
            const Scene f(obj.replace(obj.find("f 1 2 3 4"), 9, "f 1//1 2//1 3//1 4//1"));
            const auto check = [&](int, int, int blue) { CHECK_EQ(blue, z > 0 ? 20 : 255); };
            f.each_pixel("--no-fit --shadow off --eye 0,0,4 --light 0,0,1", check);
        }
}

// Homogeneous coordinates (x,y,w) of a sample as a combination of the corners': it is on the face, in front of the eye,
// where all three weights are positive, whatever the signs of the corners' own w. Edges are snapped: none is near here.
TEST("triangles: w at most zero at one, two and three corners") {
    Random r(11);
    long drawn_by[4] = {}, samples = 0;
    for (int k = 0; k < 4000; k++) {
        const int behind = k % 4;
        std::vector<vec4> clip;
        mat<3, 3, Wide> corners;
        for (int i = 0; i < 3; i++) {
            const double w = i < behind ? (k % 8 < 4 ? -r.in(.1, 2) : 0) : r.in(.1, 2);
            clip.push_back({r.in(-2, 2), r.in(-2, 2), r.in(-1, 1) * w, w});
            for (int row = 0; row < 3; row++) corners[row][i] = clip[i][row < 2 ? row : 3];
        }
        const std::vector<int> drawn = faces(clip, 16);
        drawn_by[behind] += std::count(drawn.begin(), drawn.end(), 0);
        const Wide area = std::fabs(dot(corners[0], cross(corners[1], corners[2])));
        const auto inverse = invert(corners);
        for (int pixel = 0; pixel < 256 && inverse; pixel++) {
            const auto e = *inverse * vec<3, Wide>{(pixel % 16 + Wide(.5)) / 8 - 1, (pixel / 16 + Wide(.5)) / 8 - 1, 1};
            if (std::min({std::fabs(e.x), std::fabs(e.y), std::fabs(e.z), Wide(1)}) * area < 1e-3L) continue;
            samples++;
            CHECK_EQ(drawn[pixel] >= 0, e.x > 0 && e.y > 0 && e.z > 0);
        }
    }
    CHECK(drawn_by[0] > 1000 && drawn_by[1] > 1000 && drawn_by[2] > 1000 && drawn_by[3] == 0);
    CHECK(samples > 500000);
}

TEST("triangles: corners exactly on the near plane") {
    constexpr double near = 1. / (1 << 22);
    for (const double z : {-near, 0., near})
        for (const double w : {near, std::nextafter(near, 0), std::nextafter(near, 1)})
            CHECK(faces({{-w, -w, z, w}, {3 * w, -w, z, w}, {-w, 3 * w, z, w}}, 32) ==
                  std::vector<int>(1024, w < near ? -1 : 0));
    // One corner on it, straight above the picture: the same pixels as from a corner that is there with w = 1.
    CHECK(faces({{-1, -1, 0, 1}, {1, -1, 0, 1}, {0, 3 * near, 0, near}}, 32) ==
          faces({{-1, -1, 0, 1}, {1, -1, 0, 1}, {0, 3, 0, 1}}, 32));
}

// A square between pixels' centres: those on its left and top edges are its own, those on the others are not.
TEST("triangles: corners exactly on pixels' centres") {
    const double a = (10.5 - 16) / 12, b = (20.5 - 16) / 12;  // [-1,1] is the middle 24 of 32 pixels
    const Scene f(polygons({{{a, a, 0}, {b, a, 0}, {b, b, 0}, {a, b, 0}}}));
    f.each_pixel("--no-fit --size 32x32 --eye 0,0,4", [](int x, int y, int blue) {
        CHECK_EQ(blue > 0, x >= 10 && x < 20 && y > 10 && y <= 20);
    });
}

// 4096 pixels around the picture are the guard band; with 64 pixels they are at -129 and 129.
TEST("triangles: corners exactly on the guard band, a hair and far beyond it") {
    const auto around = [](double far) {
        return drawing({{-far, -far, far / 258, 1}, {far, -far, -far / 258, 1}, {0, far, 0, 1}}, 64, 64);
    };
    const Drawing on = around(129);
    for (const double far : {129., std::nextafter(129., 200.), 130., 1e4, 1e8}) {
        const Drawing beyond = around(far);
        for (int x = 0; x < 64; x++)
            for (int y = 0; y < 64; y++) {
                CHECK_EQ(beyond.face(x, y), 0);
                CHECK_NEAR(beyond.z.row(y)[x], on.z.row(y)[x], 0x1p-13);  // one step of a float
            }
    }
    // An edge of the triangle on the band's very border: nothing of the picture.
    CHECK(faces({{-129, -129, 0, 1}, {-129, 129, 0, 1}, {-130, 0, 0, 1}}, 64) == std::vector<int>(4096, -1));
}

// A float in [1024,2048] has steps of 2^-13, which is 1.22e-7 of z: layers farther apart are told apart. Nearer ones
// may fall together, and then the first drawn wins; never is the farther one drawn over the nearer.
TEST("depth: two layers 1e-2 to 1e-9 apart, in either order") {
    for (const double slope : {0., .37})
        for (const double z : {0., .111, .577, -.83})
            for (const double gap : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1.3e-7, 1e-7, 1e-8, 1e-9})
                for (const int nearer : {0, 1}) {  // the face that is
                    std::vector<vec4> clip;
                    for (const int face : {0, 1})
                        for (const vec2& p : {vec2{-1, -1}, vec2{3, -1}, vec2{-1, 3}})
                            clip.push_back({p.x, p.y, z + (face == nearer ? gap : 0) + slope * .1 * (p.x + p.y), 1});
                    if (gap >= 1.3e-7 || nearer == 0) CHECK(faces(clip, 16) == std::vector<int>(256, nearer));
                }
}

// Many black triangles across each other; then all of them twice more, in white.
TEST("depth: of coplanar duplicates the first drawn wins, always") {
    Random r(3);
    std::vector<std::vector<vec3>> triangles;
    for (int k = 0; k < 1000; k++) {
        const vec3 a = r.point(.9), b = a + r.point(.3), c = a + r.point(.3);
        triangles.push_back({a, b, c});
    }
    const std::string text = polygons(triangles);  // a copy of it has the first one's corners
    const Scene f("mtllib m.mtl\nusemtl black\n" + text + "usemtl white\n" + text + text);
    f.write("m.mtl", "newmtl black\nKd 0 0 0\nnewmtl white\nKd 1 1 1\n");
    long black = 0;
    f.each_pixel("--size 400x400 --shadow off --no-fit --eye 0,0,1.3 --light 0,0,1", [&](int, int, int blue) {
        CHECK(blue <= 20);
        black += blue == 20;
    });
    CHECK(black > 40000);
}

TEST("shadow: grazing light, 1e-1 to 1e-6 over a floor") {
    const Scene f(net({0, 1, 0}, {}, 8));
    for (const std::string y : {"1e-1", "1e-2", "1e-3", "1e-4", "1e-6"}) f.check_lit("--light .8," + y + ",.6", 101);
    CHECK(f.report("--light .8,.1,.6 --bias 0").falsely_dark > 0);  // there is acne to be seen
}

// Nothing shadows a plane, whatever its position. Seen by the light its depth is rounding alone.
TEST("shadow: light straight on a plane") {
    for (const vec3& n : {vec3{0, 1, 0}, {1, 2, 3}, {.3, 1, .2}, {1, 1, 1}, {0, 1, .1}})
        for (const vec3& at : {vec3{}, {.31, .17, .23}, {1e3, -2e3, 5e2}, {1e6, 1e6, 1e6}, {0, 1e9, 0}}) {
            const std::string camera = " --center " + triple(at) + " --eye " + triple(at + vec3{1, 1, 4});
            Scene(net(n, at, 8)).check_lit("--no-fit --light " + triple(n) + camera, 101);
        }
}

TEST("shadow: light edge-on and from behind leaves a single-sided floor at the ambient 20") {
    const Scene f(net({0, 1, 0}, {}, 4));
    for (const std::string& light : each("--light %", {"1,0,0", "0,0,-1", "1,-1e-9,0", "0,-1,0", "1,-1,.3"})) {
        f.check_drawn(light, 101, 3600);
        for (const std::string& method : methods)
            f.each_pixel(method + light, [](int, int, int blue) { CHECK(blue == 0 || blue == 20); });
    }
}

// A light is a direction: where on its ray one takes it to be, even within a wall, is the same.
TEST("shadow: the light inside the model") {
    the_yard.check_same(each("--light %", {"1.5,.5,1", ".375,.125,.25", ".1875,.0625,.125"}));
    CHECK(the_yard.good("--light 1.5,.5,1").frame != the_yard.good("--light -0.0000015,-0.0000005,-0.000001").frame);
}

TEST("shadow: casters outside of the camera's view") {
    // A floor, and a board 100 above it that shadows all of it.
    const Scene f(polygons({{{-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}},
                            {{-2, 100, 2}, {2, 100, 2}, {2, 100, -2}, {-2, 100, -2}}}));
    for (const std::string& options : each("--shadow % --no-fit --light 0,1,0", {"map", "exact"}))
        f.check_shadows(options, 301, true);
}

// The lesson's light sees [-4/3,4/3]^2: what is beside it is lit.
TEST("shadow: receivers outside of the light's view are lit") {
    const Scene floor(polygons({{{-50, 0, 50}, {50, 0, 50}, {50, 0, -50}, {-50, 0, -50}}}));
    floor.check_shadows("--no-fit --eye 0,20,1 --light .1,1,0 --bias 43.34", 3600, false);
}

// A buffer of one texel knows one depth: it shadows nothing that it should not. One of 16384 x 16384 takes 1 GiB.
TEST("shadow: a buffer of 1x1, 2x2, 3x3 and 16384x16384") {
    for (const int size : {1, 2, 3}) {
        const std::string option = "--shadow-size " + std::to_string(size);
        const std::string depth = the_yard.good(option).depth;
        CHECK(depth.at(12) == size && depth.at(14) == size);  // a TGA's width and height
        check_no_acne(option);
    }
    the_yard.check_lit("--shadow-size 1", 500);
#ifndef UMBRA_SANITIZED
    CHECK(the_yard.good("--shadow-size 16384").frame == the_yard.good("--shadow exact").frame);
#endif
}

// The picture and its file are 3 bytes a pixel each at most, 1548 MiB; nothing else grows with the picture.
#if !defined(UMBRA_SANITIZED) && defined(__linux__)
TEST("pictures: 16384x16384 within its memory") {
    const std::string limit = "ulimit -v " + std::to_string((1548 + 128) * 1024);  // KiB; 128 MiB for all else
    CHECK(the_yard.good("--threads 2 --size 16384x16384", limit + " && " + umbra_command).frame.size() > 1000000);
}
#endif

// [-1,1]^2 is the middle three quarters of the shorter side, so a square stays a square.
TEST("pictures: from 1x1 to long ones, not stretched") {
    const Scene f(polygons({{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}}));
    for (const auto& [width, height] :
         {std::pair(1, 1), {2, 2}, {7, 5}, {1600, 200}, {200, 1600}, {16383, 1}, {1, 16383}}) {
        const double w = width, h = height, half = .375 * std::min(w, h);
        const auto check = [&](int x, int y, int blue) {
            CHECK_EQ(blue > 0, std::fabs(x + .5 - w / 2) < half && std::fabs(y + .5 - h / 2) < half);
        };
        const std::string size = std::to_string(width) + 'x' + std::to_string(height);
        CHECK_EQ(f.each_pixel("--eye 0,0,4 --light 0,0,1 --size " + size, check), width * height);
    }
}

TEST("pictures: no size, a negative one and one beyond 16384 are errors") {
    for (const std::string size : {"0x0", "0x5", "5x0", "-1x5", "5x-1", "16385x1", "1x16385"})
        check_refused(the_yard, "--size " + size + " m.obj", 2, "--size");
}

// Relative to center a scene that was moved is the one that was not: the light's camera is the same, bit for bit.
TEST("matrices: the light's camera as the scene moves away by 1 to 1e12") {
    const auto light_matrix = [](const vec3& by) {
        const Scene f(yard({1, 1, 1}, by));
        std::vector<Model> models(1, Model(f / "m.obj"));
        models[0].move([&](const vec3& v) { return v - by; });
        return fitted({lookat({1, 1, .5}, {}, {0, 1, 0})}, models, 800).to_screen();
    };
    for (const double d : {1., 1e2, 1e4, 1e6, 1e9, 1e12}) CHECK(light_matrix({d, -2 * d, d}) == light_matrix({}));
}

TEST("matrices: the viewer's camera from c = 1/1.2 to 1e-8 against long double") {
    const vec<3, Wide> z = normalized(vec<3, Wide>{1, 1, 4}), x = normalized(vec<3, Wide>{4, 0, -1}), y = cross(z, x);
    for (const double d : {1.2, 3., 1e2, 1e4, 1e6, 1e8}) {
        const vec3 eye = vec3{1, 1, 4} / std::sqrt(18.) * d;
        const mat4 m = middle_viewport(800, 800) * (projection(-1 / norm(eye)) * lookat(eye, {}, {0, 1, 0}));
        Random r(5);
        for (int k = 0; k < 1000; k++) {
            const vec3 p = r.point(.6), s = project(m * point(p));
            const vec<3, Wide> q{p.x, p.y, p.z};
            const Wide w = 1 - dot(q, z) / Wide(norm(eye));
            // Some twenty roundings of numbers up to 800: 20 * 800 * 2^-53 = 2e-12.
            for (const int i : {0, 1}) CHECK_NEAR(s[i], static_cast<double>(400 + 300 * dot(q, i ? y : x) / w), 1e-11);
        }
    }
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
