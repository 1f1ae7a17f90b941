// stiffness.cpp: the scenes and the matrices of the report's second table.
#include "stiffness.h"

#include <cmath>
#include <functional>
#include <iostream>

#include "our_gl.h"
#include "scenes.h"

namespace {

std::string file(const Program& umbra, const std::string& text) {
    const std::filesystem::path path = umbra.folder() / "scene.obj";
    write_bytes(path, Bytes(text.begin(), text.end()));
    return path.string();
}

// [-1,1]^2 at y = 0, seen from above, in n x n squares.
std::string floor_of(int n) {
    Obj scene;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            const auto at = [&](int a, int b) { return vec3{2. * a / n - 1, 0, 1 - 2. * b / n}; };
            scene.polygon({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    return scene.text();
}

// 60 needles around the middle, of a length of 1.6.
std::string needles(double length_to_width) {
    Obj scene;
    for (int i = 0; i < 60; i++) {
        const double angle = .1 + .05 * i, z = .01 * i;
        const vec3 along{.8 * std::cos(angle), .8 * std::sin(angle), 0}, across{-along.y, along.x, 0};
        const vec3 at{0, 0, z};
        scene.polygon({at - along, at + along - across / length_to_width, at + along + across / length_to_width});
    }
    return scene.text();
}

constexpr const char* picture = "--report --size 400x400 ";

// Pixels that are wrong with exact shadows: by what is covered or by what is shadowed.
double wrong_pixels(const Program& umbra, const std::string& arguments) {
    const Values v = umbra.run(picture + ("--shadow exact " + arguments));
    return value_of(v, "coverage") + value_of(v, "falsely_dark") + value_of(v, "falsely_lit");
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

// A scene of corners around center, and how far off they come out on the light's screen, in pixels.
struct Corners {
    vec3 center, eye;
    std::vector<vec3> at;

    Corners(const vec3& center_, const vec3& from_center) : center(center_), eye(center_ + from_center) {
        for (int i = 0; i < 343; i++)
            at.push_back(center + vec3{i % 7 / 4. - .75, i / 7 % 7 / 4. - .75, i / 49 / 4. - .75});
    }

    using real = long double;
    std::vector<vec<3, real>> seen_by_light() const {
        const mat<4, 4, real> rotation = view_matrix(in<real>(to_light), {});
        std::vector<vec<3, real>> seen;
        for (const vec3& corner : at) seen.push_back((rotation * point(in<real>(corner) - in<real>(center))).xyz());
        return seen;
    }
    static double off(const vec3& p, real x, real y) {
        const double d = static_cast<double>(std::hypot(real{p.x} - x, real{p.y} - y));
        return std::isfinite(d) ? std::min(d, double{size}) : size;
    }

    // The lesson's way: from the viewer's screen back through the inverse of its matrices, to the light's, all in float.
    double classic() const {
        const auto viewport = in<float>(middle_viewport(size, size));
        const auto viewer = viewport * in<float>(projection(-1 / norm(eye - center))) * view_matrix(in<float>(eye), in<float>(center));
        const auto light = viewport * view_matrix(in<float>(center) + in<float>(to_light), in<float>(center));
        const auto back = invert(viewer);
        if (!back) return size;
        const auto Mshadow = light * *back;
        const auto exact = seen_by_light();
        double worst = 0;
        for (std::size_t i = 0; i < at.size(); i++) {
            const auto p = project(Mshadow * point(project(viewer * point(in<float>(at[i])))));
            worst = std::max(worst, off({double{p.x}, double{p.y}, 0}, size / 2 + .375L * size * exact[i].x, size / 2 + .375L * size * exact[i].y));
        }
        return worst;
    }
    // The program's way: the model moved, the light's camera fitted to it.
    double here(const Program& umbra) const {
        Obj scene;
        for (std::size_t i = 0; i < at.size(); i++) scene.polygon({at[i], at[(i + 1) % at.size()], at[(i + 57) % at.size()]});
        std::vector<Model> models(1, Model(file(umbra, scene.text())));
        models[0].move(-center);
        const mat4 uniform_Mshadow = fitted_camera(models, to_light, {0, 1, 0}, size).object_to_screen();
        const auto exact = seen_by_light();
        auto low = exact[0], high = low;  // all of them fill the light's screen
        for (const auto& p : exact)
            for (int i = 0; i < 2; i++) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
        if (models[0].nfaces() != static_cast<int>(at.size())) throw std::logic_error("a corner is lost");
        double worst = 0;
        for (int i = 0; i < models[0].nfaces(); i++) {
            const auto& q = exact[static_cast<std::size_t>(i)];
            worst = std::max(worst, off(project(uniform_Mshadow * point(models[0].vert(i, 0))), size * (q.x - low.x) / (high.x - low.x),
                                        size * (q.y - low.y) / (high.y - low.y)));
        }
        return worst;
    }
};

}  // namespace

const StiffRow::Step* StiffRow::breaks() const {
    for (const Step& s : steps)
        if (!(s.error <= bearable)) return &s;
    return nullptr;
}

std::vector<StiffRow> measure_stiffness(const Program& umbra) {
    std::vector<StiffRow> rows;
    const auto family = [&](const std::string& name, const std::string& measure, double bearable,
                            const std::vector<double>& steps, const std::function<double(double)>& error) {
        std::cerr << "report: " << name << ": " << measure << '\n';
        rows.push_back({name, measure, bearable});
        for (const double s : steps) rows.back().steps.push_back({s, error(s)});
    };

    constexpr double sub_pixel = 1. / 256;  // the step of 8 sub-pixel bits, the least that a rasterizer has
    const std::vector<double> distances{1, 1e3, 1e6, 1e9, 1e12, 1e15};
    const auto moved = [](double d) { return Corners({d, -d / 2, d}, {1, 1, 4}); };
    family("scene moved away by", "classic Mshadow in float, pixels", sub_pixel, distances, [&](double d) { return moved(d).classic(); });
    family("scene moved away by", "Mshadow, pixels", sub_pixel, distances, [&](double d) { return moved(d).here(umbra); });

    const std::vector<double> eyes{1.2, 1e2, 1e4, 1e6, 1e8};
    const auto seen_from = [](double d) { return Corners({}, normalized(vec3{1, 1, 4}) * d); };
    family("eye's distance (1/c)", "classic Mshadow in float, pixels", sub_pixel, eyes, [&](double d) { return seen_from(d).classic(); });

    const std::vector<double> grazing{.1, 1e-2, 1e-3, 1e-4, 1e-6};
    const std::string plane = file(umbra, floor_of(1));
    const auto on_plane = [&](const std::string& method, const std::string& arguments) {
        family("light over a plane at n.l", method + ", falsely dark %", 0, grazing, [&](double n_l) {
            return value_of(umbra.run(picture + arguments + " --light .8," + number(n_l) + ",.6 " + quoted(plane)), "falsely_dark_percent");
        });
    };
    on_plane("--bias 43.34", "--bias 43.34");
    on_plane("map", "--shadow map");
    on_plane("exact", "--shadow exact");

    family("two layers apart by", "the rear one seen, %", 0, {1e-2, 1e-4, 1e-6, 1.3e-7, 1e-8, 1e-9}, [&](double gap) {
        struct Layers final : IShader {
            double gap;
            vec4 vertex(int face, int corner) override {
                const double x = corner == 1 ? 3 : -1, y = corner == 2 ? 3 : -1;
                return {x, y, .577 + .037 * (x + y) + (face ? gap : 0), 1};
            }
        };
        Layers layers;
        layers.gap = gap;
        DepthBuffer zbuffer(100, 100);
        FaceBuffer faces(100, 100);
        draw_depth(2, layers, viewport(0, 0, 100, 100), zbuffer, &faces, 0, 1);
        int rear = 0;
        for (int i = 0; i < 10000; i++) rear += faces.row(i / 100)[i % 100] == 0;
        return rear / 100.;
    });

    family("model scaled by", "exact, wrong pixels", 0, {1e-300, 1e-30, 1e-6, 1, 1e6, 1e30, 1e300}, [&](double s) {
        return wrong_pixels(umbra, quoted(file(umbra, yard(s))));
    });
    family("one axis scaled by", "exact, wrong pixels", 0, {1e-9, 1e-6, 1e-3, 1, 1e3, 1e6, 1e9}, [&](double s) {
        return wrong_pixels(umbra, quoted(file(umbra, yard(vec3{1, 1, s}))));
    });
    family("eye this near to center", "exact, wrong pixels", 0, {1e-1, 1e-3, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9}, [&](double d) {
        const vec3 center{0, -.25, 0};
        return wrong_pixels(umbra, "--center " + triple(center) + " --eye " + triple(center + vec3{.25, .125, 1} * d) + " " + quoted(file(umbra, yard(1))));
    });
    // Coverage is snapped by up to 2^-17 pixel: 120 long edges of 240 pixels sweep over 120 * 240 * 2^-17 = .22 pixels'
    // centres. More than 3 would be a fault (Poisson: one time in 10 000).
    family("needles, length to width", "exact, wrong pixels", 3, {1e1, 1e3, 1e5, 1e7, 1e9}, [&](double ratio) {
        return wrong_pixels(umbra, "--light .3,.2,1 " + quoted(file(umbra, needles(ratio))));
    });
    family("faces a pixel", "exact, wrong pixels", 0, {.02, 2, 10, 50}, [&](double faces) {  // the floor is 300 x 300 pixels
        const int n = static_cast<int>(std::lround(std::sqrt(faces * 90000 / 2)));
        return wrong_pixels(umbra, "--eye 0,4,.001 --light .3,1,.2 " + quoted(file(umbra, floor_of(n))));
    });
    return rows;
}

std::string csv(const std::vector<StiffRow>& rows) {
    std::ostringstream out;
    out << "family,measure,stiffness,error\n";
    for (const StiffRow& row : rows)
        for (const StiffRow::Step& s : row.steps) out << '"' << row.family << "\",\"" << row.measure << "\"," << s.stiffness << ',' << s.error << '\n';
    return out.str();
}
