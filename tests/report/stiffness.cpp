// stiffness.cpp: the scenes and the matrices of the report's second table.
#include "stiffness.h"

#include <cmath>
#include <functional>
#include <iostream>

#include "judge.h"
#include "our_gl.h"
#include "random.h"
#include "scenes.h"

namespace {

// [-1,1]^2 at y = 0, seen from above, in n x n squares.
std::string floor_of(int n) {
    Obj scene;
    const auto at = [&](int a, int b) { return vec3{2. * a / n - 1, 0, 1 - 2. * b / n}; };
    for (int i = 0; i < n * n; i++)
        scene.polygon({at(i / n, i % n), at(i / n + 1, i % n), at(i / n + 1, i % n + 1), at(i / n, i % n + 1)});
    return scene.text();
}

// 60 needles around the middle, of a length of 1.6.
std::string needles(double length_to_width) {
    Obj scene;
    for (int i = 0; i < 60; i++) {
        const double angle = .1 + .05 * i;
        const vec3 along{.8 * std::cos(angle), .8 * std::sin(angle), 0},
            across = vec3{-along.y, along.x, 0} / length_to_width;
        const vec3 at{0, 0, .01 * i};
        scene.polygon({at - along, at + along - across, at + along + across});
    }
    return scene.text();
}

PictureError error(const Program& umbra, const Strings& arguments) {
    return Judge(umbra, joined({"--size", "400x400"}, arguments)).error();
}

long wrong(const PictureError& e) { return e.coverage + e.falsely_dark + e.falsely_lit; }

// The wrong pixels of exact shadows under so many spot and point lights: some of them inside of the model's hull, with
// casters behind them.
long wrong_under_lights(const Program& umbra, const Strings& scene, int lights) {
    Random r(11);
    long sum = 0;
    for (int k = 0; k < lights; k++) {
        const char* const angle = std::array{",5", ",10", ",45", ",80", ",89"}[k % 5];
        const Strings light{k % 2 ? "--point" : "--spot", triple(r.point(k % 4 ? 1.5 : 6)) + angle};
        sum += wrong(error(umbra, joined(joined({"--shadow", "exact", "--no-fit"}, light), scene)));
    }
    return sum;
}

// ---- matrices, in any arithmetic ----

template <class T>
mat<4, 4, T> in(const mat4& m) {
    mat<4, 4, T> out;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) out[i][j] = static_cast<T>(m[i][j]);
    return out;
}
template <class T>
vec<3, T> in(const vec3& v) {
    return {static_cast<T>(v.x), static_cast<T>(v.y), static_cast<T>(v.z)};
}

// The lookat of the lesson as it should be, for views that are not along the y axis.
template <class T>
mat<4, 4, T> view_matrix(const vec<3, T>& eye, const vec<3, T>& center) {
    const vec<3, T> z = normalized(eye - center), x = normalized(cross(vec<3, T>{0, 1, 0}, z)), y = cross(z, x);
    const mat<4, 4, T> rotation{{direction(x), direction(y), direction(z), {0, 0, 0, 1}}};
    mat<4, 4, T> move = mat<4, 4, T>::identity();
    for (int i = 0; i < 3; i++) move[i][3] = -center[i];
    return rotation * move;
}

constexpr int size = 800;
const vec3 to_light{1, 1, .5};

// Corners around center, and how far off they come out on the light's screen, in pixels. Exact is long double.
using real = long double;
struct Corners {
    vec3 center, eye;
    std::vector<vec3> at;
    std::vector<vec<3, real>> exact;  // as the light sees them, relative to center

    Corners(const vec3& center_, const vec3& from_center) : center(center_), eye(center_ + from_center) {
        for (int i = 0; i < 343; i++) {
            at.push_back(center + vec3{i % 7 / 4. - .75, i / 7 % 7 / 4. - .75, i / 49 / 4. - .75});
            exact.push_back((view_matrix(in<real>(to_light), {}) * point(in<real>(at[i]) - in<real>(center))).xyz());
        }
    }
    // place: of the corner i on the light's screen. The exact one: [low,high] taken to `side` pixels from `from` on.
    double worst(const auto& place, const vec<3, real>& low, const vec<3, real>& high, real from, real side) const {
        double worst = 0;
        for (std::size_t i = 0; i < at.size(); i++) {
            const auto off = [&](int k) {
                return place(i)[k] - (from + side * (exact[i][k] - low[k]) / (high[k] - low[k]));
            };
            const real distance = std::fmin(std::hypot(off(0), off(1)), real{size});  // size also where it is no number
            worst = std::max(worst, static_cast<double>(distance));
        }
        return worst;
    }

    // The lesson's way: from the viewer's screen through the inverse of its matrices to the light's, all in float.
    double classic() const {
        const auto viewport = in<float>(middle_viewport(size, size));
        const auto viewer =
            viewport * in<float>(projection(-1 / norm(eye - center))) * view_matrix(in<float>(eye), in<float>(center));
        const auto light = viewport * view_matrix(in<float>(center) + in<float>(to_light), in<float>(center));
        const auto back = invert(viewer);
        if (!back) return size;
        const auto place = [&](std::size_t i) {
            return project(light * *back * point(project(viewer * point(in<float>(at[i])))));
        };
        return worst(place, {-1, -1, 0}, {1, 1, 0}, size / 8.L, .75L * size);
    }
    // The program's way: the same in double, the model moved, the light's camera fitted to it. All corners fill the
    // light's screen.
    double here(const Program& umbra) const {
        Obj scene;
        for (std::size_t i = 0; i < at.size(); i++)
            scene.polygon({at[i], at[(i + 1) % at.size()], at[(i + 57) % at.size()]});
        std::vector<Model> models(1, Model(umbra.write("scene.obj", scene.text())));
        models[0].move([&](const vec3& v) { return v - center; });
        if (models[0].nfaces() != static_cast<int>(at.size())) throw std::logic_error("a corner is lost");
        const Camera viewer{lookat(eye - center, {}, {0, 1, 0}), projection(-1 / norm(eye - center)),
                            middle_viewport(size, size)};
        const Camera light = fitted({lookat(to_light, {}, {0, 1, 0})}, models, size);
        const mat4 uniform_Mshadow = light.to_screen() * viewer.from_screen();
        auto low = exact[0], high = low;
        for (const auto& p : exact)
            for (int i = 0; i < 2; i++) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
        const auto place = [&](std::size_t i) {
            const vec3 screen = project(viewer.to_screen() * point(models[0].vert(static_cast<int>(i), 0)));
            return project(uniform_Mshadow * point(screen));
        };
        return worst(place, low, high, 0, size);
    }
};

}  // namespace

std::vector<StiffRow> measure_stiffness(const Program& umbra) {
    std::vector<StiffRow> rows;
    const auto family = [&](const std::string& name, const std::string& measure, double bearable,
                            const std::vector<double>& steps, const std::function<double(double)>& how_far_off) {
        std::cerr << "report: " << name << ": " << measure << '\n';
        for (const double s : steps) rows.push_back({name, measure, bearable, s, how_far_off(s)});
    };

    constexpr double sub_pixel = 1. / 256;  // the step of 8 sub-pixel bits, the least that a rasterizer has
    const auto both_ways = [&](const std::string& name, const std::vector<double>& steps, auto corners) {
        family(name, "classic Mshadow in float: pixels", sub_pixel, steps,
               [&](double d) { return corners(d).classic(); });
        family(name, "Mshadow: pixels", sub_pixel, steps, [&](double d) { return corners(d).here(umbra); });
    };
    both_ways("scene moved away by", {1, 1e3, 1e6, 1e9, 1e12, 1e15},
              [](double d) { return Corners({d, -d / 2, d}, {1, 1, 4}); });
    both_ways("eye's distance (1/c)", {1.2, 1e2, 1e4, 1e6, 1e8},
              [](double d) { return Corners({}, normalized(vec3{1, 1, 4}) * d); });

    const std::string plane = umbra.write("scene.obj", floor_of(1));
    for (const Strings& method : {Strings{"--bias", "43.34"}, {"--shadow", "map"}, {"--shadow", "exact"}})
        family("light over a plane at n.l", method[0] + " " + method[1] + ": falsely dark %", 0,
               {.1, 1e-2, 1e-3, 1e-4, 1e-6}, [&](double n_l) {
                   const std::string light = ".8," + number(n_l) + ",.6";
                   const PictureError e = error(umbra, joined(method, {"--no-fit", "--light", light, plane}));
                   return e.percent(e.falsely_dark);
               });

    family("two layers apart by", "the rear one seen: %", 0, {1e-2, 1e-4, 1e-6, 1.3e-7, 1e-8, 1e-9}, [&](double gap) {
        Obj scene;
        for (const double z : {0., gap})
            for (const vec2& at : {vec2{-2, -2}, {6, -2}, {-2, 6}})
                scene.vertex({at.x, at.y, .077 + .037 * (at.x + at.y) + z});
        const std::string faces = "vn 0 0 1\nvn 1 0 0\nf 1//1 2//1 3//1\nf 4//2 5//2 6//2\n";  // to different sides
        const std::string path = umbra.write("scene.obj", scene.text() + faces);
        umbra.run({"--size", "100x100", "--no-fit", "--eye", "0,0,4", "--draw", "normal", path});
        int rear = 0;
        umbra.each_pixel([&](int, int, const std::uint8_t* bgr) { rear += bgr[0] == 255; });  // towards the viewer
        return rear / 100.;
    });

    // Pixels that are wrong with exact shadows: by what is covered or by what is shadowed.
    const auto wrong_pixels = [&](const std::string& name, double bearable, const std::vector<double>& steps,
                                  const Strings& view, const std::function<std::string(double)>& scene) {
        family(name, "exact: wrong pixels", bearable, steps, [&](double s) {
            const std::string path = umbra.write("scene.obj", scene(s));
            return static_cast<double>(wrong(error(umbra, joined(view, {"--shadow", "exact", path}))));
        });
    };
    wrong_pixels("model scaled by", 0, {1e-300, 1e-30, 1e-6, 1, 1e6, 1e30, 1e300}, {},
                 [](double s) { return yard(s); });
    wrong_pixels("one axis scaled by", 0, {1e-9, 1e-6, 1e-3, 1, 1e3, 1e6, 1e9}, {}, [](double s) {
        return yard(vec3{1, 1, s});
    });
    for (const double d : {1e-1, 1e-3, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9}) {
        const vec3 center{0, -.25, 0};
        wrong_pixels("eye this near to center", 0, {d},
                     {"--no-fit", "--center", triple(center), "--eye", triple(center + vec3{.25, .125, 1} * d)},
                     [](double) { return yard(1); });
    }
    for (const double degrees : {1e-6, 1e-3, 1., 45., 89.})
        wrong_pixels("spot light: half angle", 0, {degrees}, {"--spot", "1,2,1," + number(degrees)},
                     [](double) { return yard(1); });
    for (const double d : {1e-6, 1e-3, 1., 1e3, 1e6})
        wrong_pixels("point light: distance from center", 0, {d},
                     {"--center", "0,.3,0", "--point", triple(vec3{0, .3, 0} + vec3{1, 2, 1} * d)},
                     [](double) { return yard(1); });
    for (const std::string name : {"idol", "knot"})
        family("lights among the " + name + "'s faces", "exact: wrong pixels", 0, {40}, [&](double lights) {
            const Strings scene{UMBRA_OBJ_DIR "/" + name + "/" + name + ".obj", UMBRA_OBJ_DIR "/floor/floor.obj"};
            return static_cast<double>(wrong_under_lights(umbra, scene, static_cast<int>(lights)));
        });
    // Coverage is snapped by up to 2^-17 pixel: 120 long edges of 240 pixels sweep over 120 * 240 * 2^-17 = .22 pixels'
    // centres. More than 3 would be a fault (Poisson: one time in 10 000).
    wrong_pixels("needles: length to width", 3, {1e1, 1e3, 1e5, 1e7, 1e9}, {"--no-fit", "--light", ".3,.2,1"},
                 needles);
    wrong_pixels("faces a pixel", 0, {.02, 2, 10, 50}, {"--no-fit", "--eye", "0,4,.001", "--light", ".3,1,.2"},
                 [](double faces) {  // the floor is 300 x 300 pixels
                     return floor_of(static_cast<int>(std::lround(std::sqrt(faces * 90000 / 2))));
                 });
    return rows;
}

std::string csv(const std::vector<StiffRow>& rows) {
    std::ostringstream out;
    out << "family,measure,stiffness,error,bearable\n";
    for (const StiffRow& row : rows)
        out << '"' << row.family << "\",\"" << row.measure << "\"," << row.stiffness << ',' << row.error << ','
            << (row.error <= row.bearable ? "yes" : "no") << '\n';
    return out.str();
}
