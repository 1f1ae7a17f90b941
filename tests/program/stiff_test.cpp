// stiff_test.cpp: inputs at the edges of the arithmetic, and what must come out of each: pixels counted, bytes compared,
// shadows held against the ray caster. It knows nothing of how a picture should look otherwise.
#include "check.h"
#include "files.h"
#include "our_gl.h"
#include "random.h"
#include "scenes.h"
#include "tgaimage.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <sstream>
#include <string>

namespace fs = std::filesystem;

namespace {

// ---- the program ----

struct Folder : TemporaryFolder {
    Folder() : TemporaryFolder("stiff_test") {}
    void write(const std::string& name, const std::string& text) const {
        write_bytes(path() / name, Bytes(text.begin(), text.end()));
    }
    std::string read(const std::string& name) const {
        std::ifstream in(path() / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
};

struct Outcome {
    int status = -1;
    std::string out, err, frame, depth;  // what it printed, and the bytes of its two pictures
};

Outcome run(const Folder& f, const std::string& arguments) {
    const std::string q = "\"";
    fs::remove(f / "framebuffer.tga");
    fs::remove(f / "depth.tga");
    const int raw = std::system(("cd " + q + f.path().string() + q + " && " + q + UMBRA_BINARY + q + " --quiet " + arguments +
                                 " >stdout.txt 2>stderr.txt").c_str());
    return {raw > 255 ? raw >> 8 : raw, f.read("stdout.txt"), f.read("stderr.txt"), f.read("framebuffer.tga"), f.read("depth.tga")};
}

// The run must succeed and say nothing on standard error.
Outcome good(const Folder& f, const std::string& arguments) {
    const Outcome o = run(f, arguments);
    if (!CHECK_EQ(o.err, std::string()) || !CHECK_EQ(o.status, 0)) std::cerr << "    umbra " << arguments << '\n';
    return o;
}

// Pixels that are not black: what is lit by nothing at all still shows the ambient 20.
long drawn(const Folder& f) {
    const TGAImage picture = TGAImage::read_tga_file(f / "framebuffer.tga");
    long n = 0;
    for (int y = 0; y < picture.height(); y++)
        for (int x = 0; x < picture.width(); x++) {
            const std::uint8_t* const p = picture.pixel(x, y);
            n += p[0] != 0 || p[1] != 0 || p[2] != 0;
        }
    return n;
}

using Figures = std::map<std::string, double>;

Figures report(const Folder& f, const std::string& arguments) {
    std::istringstream in(good(f, "--report " + arguments).out);
    Figures figures;
    std::string name;
    for (double value; in >> name >> value;) figures[name] = value;
    CHECK(figures.count("facing") == 1);
    return figures;
}

// What the ray caster sees is what is drawn, and every shadow is right.
void check_exact(const Folder& f, const std::string& arguments, double least_facing = 1) {
    const Figures figures = report(f, "--shadow exact " + arguments);
    for (const char* name : {"coverage", "falsely_dark", "falsely_lit"})
        if (!CHECK_EQ(figures.count(name) ? figures.at(name) : -1, 0.)) std::cerr << "    umbra " << arguments << ' ' << name << '\n';
    CHECK(figures.count("facing") && figures.at("facing") >= least_facing);
}

// With a shadow buffer: no face shadows itself.
void check_no_acne(const Folder& f, const std::string& arguments) {
    const Figures figures = report(f, arguments);
    if (!CHECK_EQ(figures.count("self") ? figures.at("self") : -1, 0.)) std::cerr << "    umbra " << arguments << '\n';
}

// ---- scenes ----

// [-1,1]^2 at the height z.
std::string square(double side = 1, double z = 0) {
    Obj obj;
    obj.polygon({{-side, -side, z}, {side, -side, z}, {side, side, z}, {-side, side, z}});
    return obj.text();
}

// A square net of n x n quads across the direction `normal`, 1.4 wide, its middle at `at`.
std::string net(const vec3& normal, const vec3& at, int n) {
    const vec3 k = normalized(normal), i = normalized(cross(k, vec3{.3, .5, -.8})), j = cross(k, i);
    Obj obj;
    for (int b = 0; b < n; b++)
        for (int a = 0; a < n; a++) {
            const auto p = [&](int u, int v) { return at + i * (1.4 * u / n - .7) + j * (1.4 * v / n - .7); };
            obj.polygon({p(a, b), p(a + 1, b), p(a + 1, b + 1), p(a, b + 1)});
        }
    return obj.text();
}

const std::string small = "--size 60x60 --shadow-size 128 ";

// ---- the pipeline ----

template <class Corner>
struct DepthOf final : IShader {  // corner(face, i) in clip space
    Corner corner;
    explicit DepthOf(const Corner& c) : corner(c) {}
    vec4 vertex(int face, int i) override { return corner(face, i); }
};

struct Drawing {
    DepthBuffer z;
    FaceBuffer faces;
    Counters count;
};

template <class Corner>
Drawing drawing(int nfaces, int width, int height, const mat4& Viewport, const Corner& corner) {
    Drawing d{DepthBuffer(width, height), FaceBuffer(width, height), {}};
    d.count = draw_depth(nfaces, DepthOf<Corner>(corner), Viewport, d.z, &d.faces, 0, 1);
    return d;
}
Drawing drawing(const std::vector<vec4>& clip, int width, int height) {
    return drawing(static_cast<int>(clip.size() / 3), width, height, viewport(0, 0, width, height),
                   [&](int face, int i) { return clip[static_cast<std::size_t>(face * 3 + i)]; });
}

}  // namespace

// ---- cameras ----

// Exactly parallel, the picture is that of an `up` of zero: the axis least parallel to the view takes its place.
TEST("cameras: the view along up, both ways, exactly and nearly") {
    const Folder f;
    f.write("yard.obj", yard());
    const Outcome none = good(f, small + "--up 0,0,0 yard.obj");
    for (const char* up : {"1,1,4", "-1,-1,-4", "2e-300,2e-300,8e-300"})
        CHECK(good(f, small + "--up " + up + " yard.obj").frame == none.frame);
    for (const char* sign : {"", "-"})
        for (const char* off : {"1.0001", "1.0000001", "1.000000000001"})
            check_exact(f, small + "--eye 1,1,4 --up " + sign + off + "," + sign + "1," + sign + "4 yard.obj", 500);
}

TEST("cameras: the light along up, both ways, exactly and nearly") {
    const Folder f;
    f.write("yard.obj", yard());
    for (const char* x : {"0", "1e-4", "-1e-4", "1e-7", "1e-12"}) {
        check_exact(f, small + "--light " + x + ",1,0 yard.obj", 500);
        check_no_acne(f, small + "--light " + x + ",1,0 yard.obj");
        check_exact(f, small + "--eye 1,-2,4 --light " + x + ",-1,0 yard.obj", 500);
    }
}

// Only the direction counts: the same bytes at any length that a double has, denormal ones too.
TEST("cameras: tiny and huge up and light") {
    const Folder f;
    f.write("yard.obj", yard());
    for (const char* method : {"--shadow map ", "--shadow exact "}) {
        const std::string scene = small + method + "yard.obj ";
        const Outcome up = good(f, scene + "--up 0,1,0");
        for (const char* length : {"1e-300", "4.9406564584124654e-324", "1e300", "1e307"})
            CHECK(good(f, scene + "--up 0," + length + ",0").frame == up.frame);
        const Outcome light = good(f, scene + "--light 1,1,0");
        for (const char* c : {"1e-300", "4.9406564584124654e-324", "1e300", "7e306"}) {
            const Outcome o = good(f, scene + "--light " + c + "," + c + ",0");
            CHECK(o.frame == light.frame && o.depth == light.depth);
        }
    }
}

TEST("cameras: no direction, no number, or beyond the range of a double is a wrong command line") {
    const Folder f;
    f.write("yard.obj", yard());
    for (const char* wrong : {"--light 0,0,0", "--light nan,0,0", "--light inf,1,0", "--eye nan,0,0", "--up 0,inf,0", "--center 1e999,0,0",
                              "--eye 1,2,3 --center 1,2,3", "--up 1.7e308,1.7e308,-1.7e308", "--eye 1.7e308,0,0 --center -1.7e308,0,0"}) {
        const Outcome o = run(f, std::string(wrong) + " yard.obj");
        CHECK_EQ(o.status, 2);
        CHECK_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1);
        CHECK(o.frame.empty() && o.depth.empty());
    }
}

TEST("cameras: center off the origin") {
    const Folder f;
    f.write("yard.obj", yard());
    check_exact(f, small + "--center .5,.5,.5 yard.obj", 100);
    for (const char* c : {"1e2", "1e6", "1e18", "1e300"}) {  // there is nothing to see there
        good(f, small + "--center " + c + ",0,0 yard.obj");
        CHECK_EQ(drawn(f), 0);
    }
    // Far off and turned: normals are not moved by a translation, however large.
    good(f, small + "--center 8e16,0,-6e16 --eye 80000003e9,0,-59999996e9 yard.obj");
    CHECK_EQ(drawn(f), 0);
}

// From 1e10 on the perspective moves no corner by 2e-8 pixel, a thousandth of a sub-pixel: the picture no longer changes.
TEST("cameras: the eye at 1e4, 1e8 and farther") {
    const Folder f;
    f.write("yard.obj", yard());
    for (const char* d : {"1e4", "1e8"})
        check_exact(f, small + "--eye " + std::string(d) + "," + d + ",4" + (d + 1) + " yard.obj", 300);
    const Outcome far = good(f, small + "--eye 1e10,1e10,4e10 yard.obj");
    for (const char* d : {"1e16", "1e100", "1e300"}) {
        const Outcome farther = good(f, small + "--eye " + std::string(d) + "," + d + ",4" + (d + 1) + " yard.obj");
        CHECK(farther.frame == far.frame && farther.depth == far.depth);
    }
}

TEST("cameras: the eye inside the model and on a surface") {
    const Folder f;
    f.write("yard.obj", yard());
    check_exact(f, small + "--eye .01,.125,.02 yard.obj");                            // between wall and block
    check_exact(f, small + "--eye .375,-.5,.25 --center -.25,-.25,0 yard.obj");       // on the floor
    check_exact(f, small + "--eye 0,-.49999,0 --center -.5,-.375,-.25 yard.obj");     // just above it
    const Figures inside = report(f, small + "--eye .3125,.125,.25 --center .25,.125,.125 --shadow exact yard.obj");  // in the block
    CHECK_EQ(inside.at("coverage"), 0.);
    CHECK_EQ(drawn(f), 3600);
}

// The eye's distance from center is the field of view: the window at center is 8/3 wide. Down to 1e-6 of the scene's size.
TEST("cameras: near distances and fields of view") {
    const Folder f;
    f.write("yard.obj", yard());
    for (const double d : {1e-1, 1e-3, 1e-5, 1e-6})  // up to 179.9999 degrees
        check_exact(f, small + "--center 0,-.25,0 --eye " + triple({.25 * d, -.25 - .125 * d, d}) + " yard.obj", 300);
    for (const double d : {8., 1e2, 1e4, 1.5e4})  // down to .01 degree
        check_exact(f, small + "--eye " + triple(vec3{.25, .125, 1} * d) + " yard.obj", 300);
}

// ---- coordinates ----

TEST("coordinates: a fitted model scaled by a power of two, not one byte changes") {
    const Folder f;
    for (const char* method : {"--shadow map ", "--shadow exact ", "--bias 43.34 "}) {
        Outcome first;
        for (const int k : {1, 2, 10, 60, 127, 512, 1000, 1023, -14, -20, -127, -1000}) {
            f.write("yard.obj", yard(std::ldexp(1., k)));
            const Outcome o = good(f, small + method + "yard.obj");
            if (k == 1) first = o;
            CHECK(o.frame == first.frame && o.depth == first.depth);
        }
        CHECK(drawn(f) > 500);
    }
}

TEST("coordinates: a fitted model scaled by 1e6, 1e18, 1e38, 1e300") {
    const Folder f;
    for (const double s : {1e6, 1e18, 1e38, 1e300}) {
        f.write("yard.obj", yard(s));
        check_exact(f, small + "yard.obj", 500);
        check_no_acne(f, small + "yard.obj");
    }
}

TEST("coordinates: a fitted model scaled by 1e-6, 1e-30, 1e-300") {
    const Folder f;
    for (const double s : {1e-6, 1e-30, 1e-300}) {
        f.write("yard.obj", yard(s));
        check_exact(f, small + "yard.obj", 500);
        check_no_acne(f, small + "yard.obj");
    }
}

// Unfitted, it is smaller than a pixel and lies between two pixels' centres.
TEST("coordinates: unfitted and scaled by 1e-6, 1e-30, 1e-300 and to denormals") {
    const Folder f;
    for (const double s : {1e-6, 1e-30, 1e-300, 1e-310, 1e-320}) {
        f.write("yard.obj", yard(s));
        for (const char* method : {"--shadow map ", "--shadow exact ", "--bias 43.34 "}) {
            good(f, small + method + "--no-fit yard.obj");
            CHECK_EQ(drawn(f), 0);
            good(f, small + method + "yard.obj");
            CHECK(drawn(f) > 500);
        }
    }
}

// The window at center is 8/3 wide whatever the model's size: of a huge model it shows a detail. That of one triangle around
// the line of sight is the triangle, all over the picture.
TEST("coordinates: huge and unfitted") {
    const Folder f;
    for (const double s : {1e3, 1e6, 1e18, 1e38, 1e100, 1e200, 1e300}) {
        Obj obj;
        obj.polygon({{-s, -s, -s}, {s, -s, 0}, {0, s, s}});
        f.write("big.obj", obj.text());
        for (const char* method : {"--shadow map ", "--shadow exact ", "--bias 43.34 "}) {
            good(f, small + method + "--no-fit --light 1,1,4 --eye " + triple(vec3{1, 1, 4} * s) + " big.obj");
            CHECK_EQ(drawn(f), 3600);
            good(f, small + method + "--no-fit --light 1,1,4 --eye " + triple(vec3{-1, -1, -4} * s) + " big.obj");
            CHECK_EQ(drawn(f), 3600);
        }
    }
    // Where the sum of three products is beyond the range of a double, a face has no place on the screen.
    f.write("yard.obj", yard(1.7e308));
    for (const char* method : {"--shadow map ", "--shadow exact ", "--bias 43.34 "}) {
        good(f, small + method + "--no-fit yard.obj");
        CHECK_EQ(drawn(f), 0);
    }
}

TEST("coordinates: one axis scaled by 1e6 and 1e-6") {
    const Folder f;
    for (const double s : {1e6, 1e-6})
        for (int axis = 0; axis < 3; axis++) {
            vec3 scale{1, 1, 1};
            scale[axis] = s;
            f.write("yard.obj", yard(scale));
            const Figures figures = report(f, small + "--shadow exact --light 1,1,.5 yard.obj");
            CHECK_EQ(figures.at("coverage"), 0.);
            CHECK_EQ(figures.at("falsely_dark") + figures.at("falsely_lit"), 0.);
            if (s < 1) CHECK(figures.at("facing") > 50);
        }
}

// Moves by powers of two are exact as long as the corners' eighths are: then not one byte changes, since everything is
// computed relative to center. From 1e15 on the eighths are no doubles.
TEST("coordinates: model and camera moved together by 1e2 to 5e14") {
    const Folder f;
    for (const char* method : {"--shadow map ", "--shadow exact ", "--bias 43.34 "}) {
        const std::string scene = small + method + "--light 1,1,.5 --no-fit yard.obj ";
        f.write("yard.obj", yard());
        const Outcome home = good(f, scene + "--eye 1.125,1.25,4");
        CHECK(drawn(f) > 500);
        for (const double d : {1e2, 1e4, 1e6, 1e9, 1e12, 5e14}) {
            const vec3 by{d, d / 2, -d};
            f.write("yard.obj", yard({1, 1, 1}, by));
            const Outcome o = good(f, scene + "--center " + triple(by) + " --eye " + triple(by + vec3{1.125, 1.25, 4}));
            CHECK(o.frame == home.frame && o.depth == home.depth);
        }
    }
}

TEST("coordinates: vertices that are no numbers, or beyond the range of a double") {
    const Folder f;
    for (const char* v : {"nan", "inf", "-inf", "1e309", "-1e999"}) {
        f.write("bad.obj", std::string("v 0 0 0\nv 1 0 0\nv 0 ") + v + " 0\nf 1 2 3\n");
        const Outcome o = run(f, "bad.obj");
        CHECK_EQ(o.status, 1);
        CHECK(o.err.rfind("umbra: bad.obj:3: ", 0) == 0);
        CHECK_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1);
        CHECK(o.frame.empty());
    }
}

// The idol with its maps, moved and scaled before it is fitted. Rounding moves its corners by 1e-10 at most: not a pixel of
// these changes sides.
TEST("coordinates: shadow and shading errors of a model moved by 1e6 and scaled by 1e6 and 1e-6") {
    const Folder f;
    const fs::path obj = UMBRA_OBJ_DIR "/idol";
    for (const auto& entry : fs::directory_iterator(obj))
        if (entry.path().extension() != ".obj") fs::create_symlink(entry.path(), f / entry.path().filename().string());
    const auto idol = [&](double scale, double by) {
        std::ifstream in(obj / "idol.obj");
        std::string text;
        for (std::string line; std::getline(in, line);) {
            vec3 v;
            if (std::sscanf(line.c_str(), "v %lf %lf %lf", &v.x, &v.y, &v.z) == 3)
                line = "v " + number(v.x * scale + by) + ' ' + number(v.y * scale + by) + ' ' + number(v.z * scale - by);
            text += line + '\n';
        }
        f.write("idol.obj", text);
    };
    for (const char* method : {"--shadow map ", "--shadow exact "}) {
        const std::string scene = std::string(method) + "--size 200x200 --shadow-size 400 idol.obj";
        idol(2, 0);  // fitted, as those below are
        const Figures home = report(f, scene);
        CHECK(home.at("facing") > 5000);
        for (const auto& [scale, by] : {std::pair(1e6, 0.), std::pair(1e-6, 0.), std::pair(2., 1e6)}) {
            idol(scale, by);
            const Figures there = report(f, scene);
            for (const auto& [name, value] : home) CHECK_EQ(there.at(name), value);
        }
    }
}

// The ray caster's products of six coordinates need them below 1e40.
TEST("coordinates: a report on what is beyond 1e40 is an error, and earlier pictures stay") {
    const Folder f;
    f.write("yard.obj", yard(1e41));
    const Outcome o = run(f, small + "--report --no-fit --eye 1e41,1e41,4e41 yard.obj");
    CHECK_EQ(o.status, 1);
    CHECK_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1);
    CHECK(o.frame.empty() && o.depth.empty());
    CHECK_EQ(run(f, small + "--report yard.obj").status, 0);
}

TEST("coordinates: texture coordinates of any size") {
    const Folder f;
    TGAImage grey(2, 2, TGAImage::RGB);
    for (int i = 0; i < 4; i++) grey.set(i % 2, i / 2, {{90, 90, 90, 255}});
    grey.write_tga_file(f / "uv_diffuse.tga");
    const std::string faces = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n";
    f.write("uv.obj", faces + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n");
    const Outcome plain = good(f, small + "--eye 0,0,4 --light 0,1,1 uv.obj");
    for (const char* u : {"1e300", "-1.7976931348623157e308", "1.7976931348623157e308", "1e-320"}) {
        const std::string t = std::string("vt ") + u + " " + u + "\n";
        f.write("uv.obj", faces + t + t + t + t + "f 1/1 2/2 3/3 4/4\n");
        CHECK(good(f, small + "--eye 0,0,4 --light 0,1,1 uv.obj").frame == plain.frame);
    }
}

// ---- triangles ----

TEST("triangles: a repeated index and collinear corners draw nothing and change nothing") {
    const Folder f;
    const std::string more = "v -1 -.5 0\nv 0 0 0\nv 1 .5 0\n";
    for (const char* method : {"--shadow map ", "--bias 43.34 "}) {
        f.write("yard.obj", yard());
        const Outcome plain = good(f, small + method + "yard.obj");
        f.write("yard.obj", yard() + more + "f -3 -2 -1\nf -1 -1 -2\nf -2 -2 -2\nf -3 -1 -3\n");
        const Outcome o = good(f, small + method + "yard.obj");
        CHECK(o.frame == plain.frame && o.depth == plain.depth);
    }
    CHECK_EQ(good(f, small + "--shadow exact yard.obj").status, 0);
    check_exact(f, small + "yard.obj", 500);
}

// A square of 64 x 64 pixels cut into strips 64 high and 1.3e-4 wide, each into two triangles: what is left of a strip
// between the pixels' centres is nobody's, and each centre is somebody's.
TEST("triangles: needles of 1 to 500000") {
    constexpr int strips = 500000;
    const auto corner = [](int face, int i) {
        const int a = face / 2, right[2][3] = {{0, 1, 1}, {0, 1, 0}}, top[2][3] = {{0, 0, 1}, {0, 1, 1}};
        return vec4{2. * (a + right[face % 2][i]) / strips - 1, 2. * top[face % 2][i] - 1, 0, 1};
    };
    const Drawing d = drawing(2 * strips, 64, 64, viewport(0, 0, 64, 64), corner);
    CHECK_EQ(d.count.covered, 4096);
    CHECK_EQ(d.count.nearer, 4096);
}

TEST("triangles: needles of 1 to 1e6 are seen where they cover a centre") {
    // Along the diagonal, 2 sqrt(2) long and sqrt(2) w across, through the centres of its 64 pixels; w is 4 sub-pixels.
    constexpr double w = 2e-6;
    const vec4 a{-1 - w, -1, 0, 1}, b{-1 + w, -1, 0, 1}, c{1 + w, 1, 0, 1}, d{1 - w, 1, 0, 1};
    const Drawing needles = drawing({a, b, c, a, c, d}, 64, 64);
    CHECK_EQ(needles.count.covered, 64);
    for (int i = 0; i < 64; i++) CHECK(needles.faces.row(i)[i] >= 0);
}

// The model must not vanish, nor may a pixel be drawn twice.
TEST("triangles: a million that are smaller than a pixel") {
    constexpr int n = 708;  // 2 * 708^2 = 1 002 528 triangles, 12 to a pixel's side
    const auto corner = [](int face, int i) {
        const int cell = face / 2, right[2][3] = {{0, 1, 1}, {0, 1, 0}}, top[2][3] = {{0, 0, 1}, {0, 1, 1}};
        const double x = cell % n + right[face % 2][i], y = cell / n + top[face % 2][i];
        return vec4{2 * x / n - 1, 2 * y / n - 1, 0, 1};
    };
    const Drawing d = drawing(2 * n * n, 60, 60, viewport(0, 0, 60, 60), corner);
    CHECK_EQ(d.count.triangles, 2 * n * n);
    CHECK_EQ(d.count.covered, 3600);
    CHECK_EQ(d.count.nearer, 3600);
    CHECK_EQ(d.count.between_samples, d.count.triangles - 2 * 3600);  // a centre is in the boxes of both triangles of a cell
}

// An edge through the middle of the picture. It is 2^-52 of its length off at most: exact pixels up to 1e6 screens.
TEST("triangles: 30 and 1e6 times the screen") {
    for (const double s : {30., 1e3, 1e6}) {
        const Drawing d = drawing({{-3 * s, -s, 0, 1}, {3 * s, s, 0, 1}, {-s, 3 * s, 0, 1}}, 61, 61);
        long wrong = 0;
        for (int y = 0; y < 61; y++)
            for (int x = 0; x < 61; x++) {
                const int above = 3 * (y - 30) - (x - 30);  // three times the pixels above the edge
                if (above != 0) wrong += (d.faces.row(y)[x] >= 0) != (above > 0);
            }
        CHECK_EQ(wrong, 0);
    }
    for (const double s : {1e9, 1e18, 1e38, 1e100, 1e300}) {  // all around the screen: it is all of the screen
        const Drawing d = drawing({{-3 * s, -s, 0, 1}, {3 * s, -s, 0, 1}, {0, 3 * s, 0, 1}}, 61, 61);
        CHECK_EQ(d.count.covered, 61 * 61);
        for (int y = 0; y < 61; y++)
            for (int x = 0; x < 61; x++) CHECK(d.z.row(y)[x] == 1000);
    }
}

// Homogeneous coordinates (x,y,w) of a sample as a combination of the corners': it is on the face, in front of the eye,
// where all three weights are positive, whatever the signs of the corners' own w. In long double.
TEST("triangles: w at most zero at one, two and three corners") {
    Random r(11);
    long drawn_by[4] = {}, samples = 0;
    for (int k = 0; k < 4000; k++) {
        const int behind = k % 4;
        std::vector<vec4> clip;
        for (int i = 0; i < 3; i++) {
            const double w = i < behind ? (k % 8 < 4 ? -r.in(.1, 2) : 0) : r.in(.1, 2);
            clip.push_back({r.in(-2, 2), r.in(-2, 2), r.in(-1, 1) * w, w});
        }
        const Drawing d = drawing(clip, 16, 16);
        drawn_by[behind] += d.count.covered;
        using real = long double;
        for (int y = 0; y < 16; y++)
            for (int x = 0; x < 16; x++) {
                const real px = (x + real(.5)) / 8 - 1, py = (y + real(.5)) / 8 - 1;
                real e[3], det = 0;
                for (int i = 0; i < 3; i++) {
                    const vec4 &a = clip[static_cast<std::size_t>((i + 1) % 3)], &b = clip[static_cast<std::size_t>((i + 2) % 3)];
                    e[i] = (real(a.y) * b.w - real(a.w) * b.y) * px + (real(a.w) * b.x - real(a.x) * b.w) * py + (real(a.x) * b.y - real(a.y) * b.x);
                    det += e[i] * clip[static_cast<std::size_t>(i)].w;
                }
                bool inside = true, clear = std::fabs(det) > 1e-3L;  // clear: not within the snapping of an edge
                for (const real v : e) inside &= v * det > 0, clear &= std::fabs(v) > 1e-3L;
                if (!clear) continue;
                samples++;
                CHECK_EQ(d.faces.row(y)[x] >= 0, inside);
            }
    }
    CHECK(drawn_by[0] > 1000 && drawn_by[1] > 1000 && drawn_by[2] > 1000);
    CHECK_EQ(drawn_by[3], 0);
    CHECK(samples > 500000);
}

TEST("triangles: corners exactly on the near plane") {
    constexpr double near = 1. / (1 << 22);
    for (const double z : {-near, 0., near}) {
        const auto all = [&](double w) {
            return drawing({{-w, -w, z, w}, {3 * w, -w, z, w}, {-w, 3 * w, z, w}}, 32, 32).count.covered;
        };
        CHECK_EQ(all(near), 1024);
        CHECK_EQ(all(std::nextafter(near, 0)), 0);
        CHECK_EQ(all(std::nextafter(near, 1)), 1024);
    }
    // One corner on it, straight above the picture: the same pixels as from a corner that is there with w = 1.
    const Drawing on = drawing({{-1, -1, 0, 1}, {1, -1, 0, 1}, {0, 3 * near, 0, near}}, 32, 32);
    const Drawing flat = drawing({{-1, -1, 0, 1}, {1, -1, 0, 1}, {0, 3, 0, 1}}, 32, 32);
    CHECK_EQ(on.count.covered, flat.count.covered);
}

// A square between pixels' centres: those on its left and top edges are its own, those on the others are not.
TEST("triangles: corners exactly on pixels' centres") {
    const auto at = [](int x, int y) { return vec4{(x + .5) / 16 - 1, (y + .5) / 16 - 1, 0, 1}; };
    const Drawing d = drawing({at(10, 10), at(20, 10), at(20, 20), at(10, 10), at(20, 20), at(10, 20)}, 32, 32);
    CHECK_EQ(d.count.covered, 100);
    for (int y = 0; y < 32; y++)
        for (int x = 0; x < 32; x++) CHECK_EQ(d.faces.row(y)[x] >= 0, x >= 10 && x < 20 && y > 10 && y <= 20);
    CHECK_EQ(drawing({at(5, 5), at(5, 5), at(5, 5)}, 32, 32).count.covered, 0);
}

// 4096 pixels around the picture are the guard band; with 64 pixels they are at -129 and 129.
TEST("triangles: corners exactly on the guard band, a hair and far beyond it") {
    const Drawing on = drawing({{-129, -129, .5, 1}, {129, -129, -.5, 1}, {0, 129, 0, 1}}, 64, 64);
    CHECK_EQ(on.count.covered, 4096);
    for (const double far : {std::nextafter(129., 200.), 130., 1e4, 1e8}) {
        const double s = far / 129;
        const Drawing beyond = drawing({{-far, -far, .5 * s, 1}, {far, -far, -.5 * s, 1}, {0, far, 0, 1}}, 64, 64);
        CHECK_EQ(beyond.count.covered, 4096);
        for (int y = 0; y < 64; y++)
            for (int x = 0; x < 64; x++) CHECK_NEAR(static_cast<double>(beyond.z.row(y)[x]), static_cast<double>(on.z.row(y)[x]), 2 * depth_rounding);
    }
    // An edge of the triangle on the band's very border: nothing of the picture.
    CHECK_EQ(drawing({{-129, -129, 0, 1}, {-129, 129, 0, 1}, {-130, 0, 0, 1}}, 64, 64).count.covered, 0);
}

// ---- depth ----

// A float in [1024,2048] has steps of 2^-13, which is 2^-13/1000 of the z range [-1,1]: layers farther apart are told apart.
// Nearer ones may fall together, and then the first drawn wins; never is the farther one drawn over the nearer.
TEST("depth: two layers 1e-2 to 1e-9 apart, in either order") {
    const double limit = 0x1p-13 / (screen_depth / 2);
    CHECK(limit < 1.3e-7);
    for (const double slope : {0., .37})
        for (const double z : {0., .111, .577, -.83})
            for (const double gap : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1.3e-7, 1e-7, 1e-8, 1e-9})
                for (const bool nearer_first : {false, true}) {
                    std::vector<vec4> clip;
                    for (const bool first : {true, false}) {
                        const double at = z + (first == nearer_first ? gap : 0);
                        const auto p = [&](double x, double y) { return vec4{x, y, at + slope * .1 * (x + y), 1}; };
                        for (const vec4& c : {p(-1, -1), p(3, -1), p(-1, 3)}) clip.push_back(c);
                    }
                    const Drawing d = drawing(clip, 16, 16);
                    long nearer = 0;
                    for (int y = 0; y < 16; y++)
                        for (int x = 0; x < 16; x++) nearer += d.faces.row(y)[x] == (nearer_first ? 0 : 1);
                    if (gap > limit || nearer_first) CHECK_EQ(nearer, 256);
                }
}

TEST("depth: of coplanar duplicates the first drawn wins, always") {
    Random r(3);
    for (int k = 0; k < 500; k++) {
        std::vector<vec4> clip;
        for (int i = 0; i < 3; i++) {
            const double w = r.in(.3, 3);
            clip.push_back({r.in(-2, 2) * w, r.in(-2, 2) * w, r.in(-1, 1) * w, w});
        }
        for (int i = 0; i < 6; i++) clip.push_back(clip[static_cast<std::size_t>(i % 3)]);
        const Drawing d = drawing(clip, 16, 16);
        for (int y = 0; y < 16; y++)
            for (int x = 0; x < 16; x++) CHECK(d.faces.row(y)[x] <= 0);
        CHECK_EQ(d.count.nearer * 3, d.count.covered);
    }
}

// ---- shadow ----

TEST("shadow: grazing light, 1e-1 to 1e-6 over a floor") {
    const Folder f;
    f.write("net.obj", net({0, 1, 0}, {}, 8));
    for (const char* n_l : {"1e-1", "1e-2", "1e-3", "1e-4", "1e-6"})
        for (const char* method : {"map", "exact"}) {
            const Figures figures = report(f, small + "--light .8," + n_l + ",.6 --shadow " + method + " net.obj");
            CHECK(figures.at("facing") > 100);
            CHECK_EQ(figures.at("falsely_dark"), 0.);
        }
}

// Nothing shadows a plane, whatever its position. Seen by the light its depth is rounding alone.
TEST("shadow: light straight on a plane") {
    const Folder f;
    for (const vec3& n : {vec3{0, 1, 0}, vec3{1, 2, 3}, vec3{.3, 1, .2}, vec3{1, 1, 1}, vec3{0, 1, .1}})
        for (const vec3& at : {vec3{}, vec3{.31, .17, .23}, vec3{1e3, -2e3, 5e2}, vec3{1e6, 1e6, 1e6}, vec3{0, 1e9, 0}}) {
            f.write("net.obj", net(n, at, 8));
            for (const char* method : {"map", "exact"}) {
                const Figures figures = report(f, small + "--no-fit --center " + triple(at) + " --eye " + triple(at + vec3{1, 1, 4}) + " --light " +
                                                      triple(n) + " --shadow " + method + " net.obj");
                CHECK(figures.at("facing") > 100);
                CHECK_EQ(figures.at("falsely_dark"), 0.);
            }
        }
}

TEST("shadow: light edge-on and from behind leaves a single-sided floor at the ambient 20") {
    const Folder f;
    f.write("net.obj", net({0, 1, 0}, {}, 4));
    for (const char* light : {"1,0,0", "0,0,-1", "1,-1e-9,0", "0,-1,0", "1,-1,.3"})
        for (const char* method : {"--shadow map ", "--shadow exact ", "--bias 43.34 "}) {
            good(f, small + method + "--light " + light + " net.obj");
            const TGAImage picture = TGAImage::read_tga_file(f / "framebuffer.tga");
            long bright = 0;
            for (int y = 0; y < 60; y++)
                for (int x = 0; x < 60; x++) bright += *picture.pixel(x, y) > 20;
            CHECK_EQ(bright, 0);
            CHECK(drawn(f) > 100);
        }
}

// A light is a direction: where on its ray one takes it to be, even within a wall, is the same.
TEST("shadow: the light inside the model") {
    const Folder f;
    f.write("yard.obj", yard());
    for (const char* method : {"--shadow map ", "--shadow exact ", "--bias 43.34 "}) {
        const Outcome far = good(f, small + method + "--light 1.5,.5,1 yard.obj");
        for (const char* inside : {".375,.125,.25", ".1875,.0625,.125", "-0.0000015,-0.0000005,-0.000001"}) {
            const Outcome o = good(f, small + method + "--light " + inside + " yard.obj");
            CHECK((o.frame == far.frame && o.depth == far.depth) == (*inside != '-'));
        }
    }
}

TEST("shadow: casters outside of the camera's view") {
    const Folder f;
    Obj obj;  // a floor, and a board 100 above it that shadows all of it
    obj.polygon({{-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}});
    obj.polygon({{-2, 100, 2}, {2, 100, 2}, {2, 100, -2}, {-2, 100, -2}});
    f.write("far.obj", obj.text());
    for (const char* method : {"map", "exact"}) {
        const Figures figures = report(f, small + "--no-fit --light 0,1,0 --shadow " + method + " far.obj");
        CHECK(figures.at("facing") > 300);
        CHECK_EQ(figures.at("falsely_lit") + figures.at("falsely_dark"), 0.);
    }
}

// The lesson's light sees [-4/3,4/3]^2: what is beside it is lit.
TEST("shadow: receivers outside of the light's view are lit") {
    const Folder f;
    f.write("floor.obj", "v -50 0 50\nv 50 0 50\nv 50 0 -50\nv -50 0 -50\nf 1 2 3 4\n");
    const Figures figures = report(f, small + "--no-fit --eye 0,20,1 --light .1,1,0 --bias 43.34 floor.obj");
    CHECK_EQ(figures.at("falsely_dark"), 0.);
    CHECK_EQ(figures.at("facing"), 3600.);
}

// A buffer of one texel knows one depth: it shadows nothing that it should not. A light's map is square, so 1 x 4096 is
// a matter of the pipeline alone.
TEST("shadow: a buffer of 1x1, 2x2 and 3x3") {
    const Folder f;
    f.write("yard.obj", yard());
    for (const char* size : {"1", "2", "3"}) {
        good(f, "--size 60x60 --shadow-size " + std::string(size) + " yard.obj");
        check_no_acne(f, "--size 60x60 --shadow-size " + std::string(size) + " yard.obj");
        const TGAImage depth = TGAImage::read_tga_file(f / "depth.tga");
        CHECK_EQ(std::to_string(depth.width()), std::string(size));
    }
    const Figures one = report(f, "--size 60x60 --shadow-size 1 yard.obj");
    CHECK_EQ(one.at("falsely_dark"), 0.);
    for (const auto& [w, h] : {std::pair(1, 4096), std::pair(4096, 1)})
        CHECK_EQ(drawing({{-1, -1, 0, 1}, {3, -1, 0, 1}, {-1, 3, 0, 1}}, w, h).count.nearer, 4096);
}

#ifndef UMBRA_SANITIZED
TEST("shadow: a buffer of 16384x16384") {  // 1 GiB
    const Folder f;
    f.write("yard.obj", yard());
    const std::string exact = good(f, "--size 60x60 --shadow exact yard.obj").frame;
    CHECK(drawn(f) > 500);
    CHECK(good(f, "--size 60x60 --shadow-size 16384 yard.obj").frame == exact);
}
#endif

// The z-buffer, the faces' numbers and the picture are 11 bytes a pixel, 2816 MiB; nothing else grows with the picture.
#if !defined(UMBRA_SANITIZED) && defined(__linux__)
TEST("pictures: 16384x16384 within its memory") {
    const Folder f;
    f.write("yard.obj", yard());
    const std::string limit = "ulimit -v " + std::to_string(2816 * 1024 + 128 * 1024) + " && ";  // KiB; 128 MiB for all else
    const auto limited = [&](const std::string& arguments) {
        return std::system((limit + "\"" UMBRA_BINARY "\" --quiet --threads 2 --shadow-size 256 -o \"" + f.path().string() + "\" " + arguments +
                            " \"" + (f / "yard.obj").string() + "\"").c_str());
    };
    CHECK_EQ(limited("--size 16384x16384"), 0);
    CHECK_EQ(fs::file_size(f / "framebuffer.tga") > 1000000, true);
    fs::remove(f / "framebuffer.tga");
}
#endif

// As many as the faces are the cells, and each face here touches all of them: their lists must stay in proportion.
TEST("shadow: many faces, each as large as the scene") {
    const Folder f;
    std::string many = "v -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\n";
    for (int i = 0; i < 1000; i++) many += "f 1 2 3 4\n";
    f.write("many.obj", many);
    const std::vector<Model> models(1, Model(f / "many.obj"));
    const int cells = LightGrid::good_cells(face_count(models));
    const LightGrid grid(models, fitted_camera(models, {0, 1, .1}, {0, 1, 0}, cells), cells);
    CHECK(grid.bytes() <= 720 * 2000u + 4u * static_cast<unsigned>(cells * cells + 2));
    const Figures figures = report(f, "--size 20x20 --shadow exact --light 0,1,.1 many.obj");
    CHECK_EQ(figures.at("falsely_dark"), 0.);
    CHECK(figures.at("facing") > 10);
}

// ---- pictures ----

// [-1,1]^2 is the middle three quarters of the shorter side, so a square stays a square.
TEST("pictures: from 1x1 to long ones, not stretched") {
    const Folder f;
    f.write("square.obj", square());
    for (const auto& [w, h] : {std::pair(1, 1), std::pair(2, 2), std::pair(7, 5), std::pair(1600, 200), std::pair(200, 1600), std::pair(16383, 1), std::pair(1, 16383)}) {
        good(f, "--shadow-size 8 --eye 0,0,4 --light 0,0,1 --size " + std::to_string(w) + "x" + std::to_string(h) + " square.obj");
        const TGAImage picture = TGAImage::read_tga_file(f / "framebuffer.tga");
        CHECK_EQ(picture.width(), w);
        CHECK_EQ(picture.height(), h);
        const double half = .375 * std::min(w, h);
        long wrong = 0;
        for (int y = 0; y < h; y++)
            for (int x = 0; x < w; x++) {
                const bool inside = std::fabs(x + .5 - w / 2.) < half && std::fabs(y + .5 - h / 2.) < half;
                wrong += (*picture.pixel(x, y) > 0) != inside;
            }
        CHECK_EQ(wrong, 0);
    }
}

TEST("pictures: no size, a negative one and one beyond 16384 are errors") {
    const Folder f;
    f.write("square.obj", square());
    for (const char* size : {"0x0", "0x5", "5x0", "-1x5", "5x-1", "16385x1", "1x16385"}) {
        const Outcome o = run(f, std::string("--size ") + size + " square.obj");
        CHECK_EQ(o.status, 2);
        CHECK_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1);
        CHECK(o.frame.empty() && o.depth.empty());
    }
}

// ---- matrices ----

// Relative to center a scene that was moved is the one that was not: the light's camera is the same, bit for bit. What
// rounding makes of it is in the report, against long double.
TEST("matrices: the light's camera as the scene moves away by 1 to 1e12") {
    const Folder f;
    f.write("home.obj", yard());
    const std::vector<Model> home(1, Model(f / "home.obj"));
    const vec3 light{1, 1, .5};
    const mat4 at_home = fitted_camera(home, light, {0, 1, 0}, 800).object_to_screen();
    for (const double d : {1., 1e2, 1e4, 1e6, 1e9, 1e12}) {
        const vec3 by{d, -2 * d, d};
        f.write("moved.obj", yard({1, 1, 1}, by));
        std::vector<Model> moved(1, Model(f / "moved.obj"));
        moved[0].move(-by);
        for (std::size_t i = 0; i < home[0].verts().size(); i++) CHECK(moved[0].verts()[i] == home[0].verts()[i]);
        CHECK(fitted_camera(moved, light, {0, 1, 0}, 800).object_to_screen() == at_home);
    }
}

TEST("matrices: the viewer's camera from c = 1/1.2 to 1e-8 against long double") {
    for (const double d : {1.2, 3., 1e2, 1e4, 1e6, 1e8}) {
        const vec3 eye = vec3{1, 1, 4} / std::sqrt(18.) * d;
        const Camera camera{lookat(eye, {}, {0, 1, 0}), projection(-1 / norm(eye)), middle_viewport(800, 800)};
        const mat4 m = camera.object_to_screen();
        using real = long double;
        vec<3, real> z{1, 1, 4}, x{4, 0, -1};
        z = z / std::sqrt(dot(z, z)), x = x / std::sqrt(dot(x, x));
        const vec<3, real> y = cross(z, x);
        Random r(5);
        for (int k = 0; k < 1000; k++) {
            const vec3 p{r.in(-.6, .6), r.in(-.6, .6), r.in(-.6, .6)};
            const vec<3, real> q{p.x, p.y, p.z};
            const real w = 1 - dot(q, z) / real(norm(eye));
            const vec3 s = project(m * point(p));
            // Some twenty roundings of numbers up to 800: 20 * 800 * 2^-53 = 2e-12.
            CHECK_NEAR(s.x, static_cast<double>(400 + 300 * dot(q, x) / w), 1e-11);
            CHECK_NEAR(s.y, static_cast<double>(400 + 300 * dot(q, y) / w), 1e-11);
        }
    }
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
