// report_test.cpp: what the report makes of pictures and figures: the errors, the frontier, the table of commas, the
// chart; and the theory it holds them against. The measuring itself is not tested here.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <regex>
#include <tuple>

#include "chart.h"
#include "check.h"
#include "judge.h"
#include "our_gl.h"
#include "prediction.h"
#include "random.h"

namespace {

constexpr double pi = std::numbers::pi;

Figures figures(const std::string& method, int size, double error, double ms) {
    return {.method = method, .size = size, .error = error, .total_ms = ms};
}

std::vector<Figures> example() {
    std::vector<Figures> all = {
        figures("map", 200, 2, 10), figures("map", 800, .5, 14),   figures("map", 6400, .06, 80),
        figures("flat", 200, 3, 9), figures("flat", 800, 1.5, 13), figures("flat", 6400, 1.2, 60),
        figures("exact", 0, 0, 20), figures("exact", 0, 0, 20),    figures("off", 0, 20, 5)};
    all.back().rival = false;
    mark_frontier(all);
    return all;
}

// The places of a text that a pattern matches, with what stands in its brackets there.
std::vector<std::smatch> matches(const std::string& text, const std::string& pattern) {
    const std::regex wanted(pattern);
    return {std::sregex_iterator(text.begin(), text.end(), wanted), {}};
}

const vec3 light{.3, 1, .2};

void quad(std::vector<Triangle>& mesh, const vec3& a, const vec3& b, const vec3& c, const vec3& d) {
    mesh.push_back({a, b, c});
    mesh.push_back({a, c, d});
}

// A floor of n x n squares seen from above; crease is the height of every second row of its corners.
std::vector<Triangle> floor_mesh(int n, double crease) {
    std::vector<Triangle> mesh;
    const auto at = [&](int i, int j) { return vec3{6. * i / n - 3, i % 2 ? crease : 0, 3 - 6. * j / n}; };
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) quad(mesh, at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
    return mesh;
}

// ... under a disk that faces the light, out of sight, so that the shadow is a circle for the light.
constexpr double radius = .8;
RayCaster disk_over(std::vector<Triangle> mesh) {
    const vec3 l = normalized(light), x = normalized(cross(vec3{0, 0, 1}, l)), y = cross(l, x), middle = l * 20;
    const auto at = [&](int i) { return middle + (x * std::cos(pi * i / 32) + y * std::sin(pi * i / 32)) * radius; };
    for (int i = 0; i < 64; i++) mesh.push_back({middle, at(i), at(i + 1)});
    return RayCaster(mesh);
}

const View from_above{{0, 8, 0}, {}, {0, 0, -1}, 200, 200};
const double circle_per_area = 2 * pi * radius / ((2 / .75) * (2 / .75) * normalized(light).y);

}  // namespace

TEST("the share of wrong pixels is counted over those that face the light and are drawn") {
    constexpr auto ground = Truth::background, away = Truth::away, lit = Truth::lit, shadowed = Truth::shadowed;
    const TruthImage truth{
        5, 2, {ground, ground, away, lit, lit, lit, lit, lit, shadowed, shadowed}, std::vector<int>(10)};
    const auto image = [](const std::vector<int>& values) {
        TGAImage out(5, 2, TGAImage::RGB);
        for (int i = 0; i < 10; i++)
            for (int c = 0; c < 3; c++) out.pixel(i % 5, i / 5)[c] = static_cast<std::uint8_t>(values[i]);
        return out;
    };
    const TGAImage picture = image({0, 20, 20, 0, 90, 50, 50, 50, 30, 70});
    const TGAImage exact = image({9, 90, 90, 90, 90, 50, 53, 50, 34, 70});
    const PictureError found = compare(truth, picture, image({255, 0, 0, 0, 255, 255, 0, 255, 0, 255}), exact);
    CHECK_NEAR(found.percent(), 100 / 3., 1e-12);
    CHECK_NEAR(found.rmse, std::sqrt(25 / 6.), 1e-12);
    CHECK_EQ(found.line(), std::string("coverage 2 facing 6 falsely_dark 1 falsely_dark_percent 16.6667 falsely_lit 1 "
                                   "falsely_lit_percent 16.6667 error_percent 33.3333 rmse 2.0412"));
    const TGAImage black(1, 1, TGAImage::RGB);
    CHECK_EQ(compare(TruthImage{1, 1, {away}, {0}}, black, black, black).percent(), 0);
    CHECK_THROWS(compare(truth, picture, TGAImage(5, 3, TGAImage::RGB), exact), "size");
}
TEST("the scene is read from umbra's arguments, and a copy of each model turns its normals to the light") {
    const Folder folder;
    const std::string path = folder.write("far.obj", "v 6 0 0\nv 10 0 0\nv 6 2 .1\nvn 0 0 -1\nf 1//1 2//1 3//1\n");
    const Strings given{"--size", "30x20", "--light",  "0,3,4", "--shadow", "map",
                          "--eye",  "1,2,3", "--center", "0,0,1", "--zoom", "2"};
    const Scene scene(joined(given, {path, "--quiet"}), folder);
    CHECK(scene.view.width == 30 && scene.view.height == 20 && scene.light.at == (vec3{0, 3, 4}));
    CHECK(scene.view.eye == (vec3{1, 2, 2}) && scene.view.center == vec3{} && scene.view.up == (vec3{0, 1, 0}));
    CHECK(scene.paths == Strings{path});
    std::vector<Model> fitted(1, Model(path));
    CHECK(fit(fitted));
    CHECK(scene.models.at(0).vert(0, 1) == (fitted[0].vert(0, 1) - vec3{0, 0, 1}));
    CHECK_EQ(scene.towards_light.size(), given.size() + 2);
    const Model copy(scene.towards_light.back()), original(path);
    for (int c = 0; c < 3; c++) CHECK(copy.vert(0, c) == original.vert(0, c) && copy.normal(0, c) == (vec3{0, .6, .8}));
    CHECK(scene.view.zoom == 2 && Scene({"--size", "7", path}, folder).view.height == 7);
    CHECK(Scene({path}, folder).light.at == (vec3{1, 1, 1}));
    CHECK(Scene({"--no-fit", path}, folder).models.at(0).vert(0, 1) == (vec3{10, 0, 0}));
}
TEST("the frontier is what no other method beats, and of equals both") {
    std::vector<bool> on;
    for (const Figures& f : example()) on.push_back(f.frontier);
    CHECK(on == (std::vector<bool>{true, true, false, true, true, false, true, true, false}));
    std::vector<Figures> f = {figures("a", 1, 1, 5), figures("b", 1, 2, 5), figures("c", 1, 1, 6)};
    mark_frontier(f);
    CHECK(f[0].frontier && !f[1].frontier && !f[2].frontier);
}
TEST("a table of commas has the same number of fields in every line") {
    auto all = example();
    all[1].prediction = Figures::Prediction{.1, .2436, .0025, 5, .4, .41, .01};
    const std::string text = csv(all);
    const std::size_t commas = matches(text.substr(0, text.find('\n')), ",").size();
    CHECK_EQ(matches(text, "\n").size(), all.size() + 1);
    CHECK_EQ(matches(text, ",").size(), commas * (all.size() + 1));
    CHECK(text.find("\"map\",200,0.0000,0.0000,2.0000,") != std::string::npos);
    CHECK(text.find(",0.1000,0.2436,0.002500,5.0000,0.4000,0.4100,0.0100\n") != std::string::npos);
    CHECK(text.find("\"exact\",,0.0000,") != std::string::npos);
}
TEST("the chart shows every rival, names every line, and rings the frontier") {
    const std::string text = svg(example(), "a < b & \"c\"", "under it");
    for (const auto& [times, what] : {std::pair(8, "<path class='mark"), {6, "class='ring'"}, {3, "class='line "},
                                      {1, ">map<"}, {1, ">flat<"}, {1, ">exact<"}, {1, ">efficient frontier<"},
                                      {2, ">6400<"}, {0, ">off<"}, {2, "a &#60; b &#38; &#34;c&#34;"}, {0, "nan"},
                                      {0, "inf"}, {1, "prefers-color-scheme: dark"}})
        if (!CHECK_EQ(matches(text, what).size(), static_cast<std::size_t>(times)))
            std::cerr << "    " << what << '\n';
}
TEST("ten times the error is as far at one end of the axis as at the other, and zero is below it") {
    std::vector<Figures> f;
    for (const double error : {10., 1., .1, 0.}) f.push_back(figures("m", 0, error, 10));
    const std::string text = svg(f, "", "");
    std::vector<double> y;
    for (const std::smatch& mark : matches(text, "<path class='mark.*translate\\(.* (.*)\\)"))
        y.push_back(std::stod(mark[1]));
    if (!CHECK_EQ(y.size(), std::size_t{4})) return;
    CHECK_NEAR(y[1] - y[0], y[2] - y[1], .11);  // written with one decimal
    CHECK(y[1] > y[0] && y[3] > y[2]);
}
TEST("labels do not cover each other where methods are close in time") {
    std::vector<Figures> f;
    const double ms[] = {20, 20.4, 22, 30, 70, 260};
    for (int i = 0; i < 6; i++) f.push_back(figures("shadow map", 200 << i, .8 / (1 << i), ms[i]));
    for (int i = 0; i < 6; i++) f.push_back(figures("constant bias", 200 << i, .25 + 1.7 / (1 << i), ms[i] * .95));
    f.push_back(figures("exact", 0, 0, 21));
    mark_frontier(f);
    const std::string text = svg(f, "", "");
    struct Label {
        double x, y, width;
    };
    std::vector<Label> labels;
    for (const std::smatch& label : matches(text, "x='(.*)' y='(.*)' class='small( end)?.*>(.*)</text>")) {
        const double width = 6.4 * static_cast<double>(label[4].length()), x = std::stod(label[1]);
        labels.push_back({label[3].matched ? x - width : x, std::stod(label[2]), width});
    }
    CHECK_EQ(labels.size(), std::size_t{12});
    for (const Label& a : labels)
        for (const Label& b : labels)  // digits are 9 high
            CHECK(&a == &b || a.x + a.width <= b.x || b.x + b.width <= a.x || std::fabs(a.y - b.y) >= 9);
}
TEST("a chart without methods, or with a time of zero, is refused") {
    CHECK_THROWS(svg({}, "", ""), "at least one");
    for (const Figures& wrong : {figures("m", 1, 1, 0), figures("m", 1, -1, 1), figures("m", 1, 1, NAN)})
        CHECK_THROWS(svg({wrong}, "", ""), "positive");
    CHECK(!svg({figures("m", 1, 0, 3)}, "", "").empty());  // nothing but zeros
}
TEST("the mean distance in a rectangle is its integral; the error of the nearest texel is that of a square") {
    CHECK_NEAR(2 / pi * mean_distance({1, 1}), nearest_texel_error, 1e-15);
    CHECK_NEAR((std::sqrt(2.) + std::log(1 + std::sqrt(2.))) / (3 * pi), nearest_texel_error, 1e-16);
    for (const Texel t : {Texel{1, 1}, Texel{3, 3}, Texel{1, 2}, Texel{2, 1}, Texel{.3, 5}}) {
        double sum = 0;
        constexpr int n = 1000;
        for (int i = 0; i < n * n; i++)
            sum += std::hypot(((i % n + .5) / n - .5) * t.width, ((i / n + .5) / n - .5) * t.height);
        CHECK_NEAR(sum / (n * n), mean_distance(t), 1e-5 * mean_distance(t));
    }
}
TEST("a fitted texel is a share of what the light sees") {
    const RayCaster caster(std::vector<Triangle>{{vec3{0, 0, 0}, vec3{2, 0, 0}, vec3{0, 4, 0}}});
    const Texel t = Theorist(caster, {}, {0, 0, 1}, 1).fitted_texel(10);
    CHECK_NEAR(t.width, .2, 1e-15);
    CHECK_NEAR(t.height, .4, 1e-15);
}
TEST("needles of any shape measure the boundary of a round shadow, on a flat floor cut into few squares or many") {
    for (const auto& [n, needles, texel] :
         {std::tuple(1, 8, Texel{.03, .03}), {60, 8, {.03, .03}}, {1, 16, {.01, .05}}}) {
        const Theory t = Theorist(disk_over(floor_mesh(n, 0)), from_above, light, 2).derived_bias(texel, needles);
        CHECK_EQ(t.floor, 0);
        CHECK(t.deviation < .03 * circle_per_area);
        CHECK_NEAR(t.boundary_per_area, circle_per_area, 4 * t.deviation);
        CHECK_NEAR(t.wrong(), 2 / pi * mean_distance(texel) * t.boundary_per_area, 1e-15);
    }
}
TEST("creases that cast no shadow have no boundary") {  // slopes of 1/3 at most: the light comes in steeper
    const Theorist theorist(RayCaster(floor_mesh(60, .033)), from_above, light, 2);
    CHECK_EQ(theorist.derived_bias({.2, .2}, 8).boundary_per_area, 0);
}
TEST("a constant bias: the same boundary, needles twice as long, and the error that a buffer makes") {
    const RayCaster caster = disk_over(floor_mesh(1, 0));
    const Theory t = Theorist(caster, from_above, light, 2).constant_bias(.1, {.015, .015}, 16);
    CHECK_EQ(t.floor, 0);
    CHECK_NEAR(t.boundary_per_area, circle_per_area, 4 * t.deviation);
    CHECK_NEAR(t.wrong(), 2 * nearest_texel_error * .015 * t.boundary_per_area, 1e-15);
    CHECK_NEAR(t.with_texels(2).wrong(), 2 * t.wrong(), 1e-15);

    const TruthImage truth = cast(caster, from_above, light, 2);
    const vec3 l = normalized(light), x = normalized(cross(l, vec3{0, 0, 1})), y = cross(l, x);
    constexpr double h = .15;  // 34 texels along the shadow's boundary
    Random random(71);
    double wrong = 0, facing = 0;
    for (int i = 0; i < 20; i++) {  // buffers, each with its texels elsewhere, turned otherwise
        const double angle = random.in(0, pi), u0 = random.in(0, 1), v0 = random.in(0, 1);
        const vec3 u = x * std::cos(angle) + y * std::sin(angle), v = cross(l, u);
        for (int k = 0; k < 200 * 200; k++) {  // the picture's pixels: the floor is all over it
            const vec3 point = caster.first_hit(from_above.eye, from_above.direction(k % 200, k / 200))->point;
            const double s = dot(point, u) / h + u0, r = dot(point, v) / h + v0;
            const vec3 texel = point + u * ((std::floor(s) + .5 - s) * h) + v * ((std::floor(r) + .5 - r) * h);
            facing++, wrong += caster.occluded(texel, l, .1) != (truth.pixel[k] == Truth::shadowed);
        }
    }
    CHECK_NEAR(wrong / facing / (nearest_texel_error * h * t.boundary_per_area), 1, .04);
}
TEST("a constant bias larger than every gap leaks the whole shadow and leaves no boundary") {
    const Theory t = Theorist(disk_over(floor_mesh(1, 0)), from_above, light, 2).constant_bias(100, {.015, .015}, 4);
    const double disk_per_area = circle_per_area * radius / 2;
    CHECK_NEAR(t.floor, disk_per_area, .01 * disk_per_area);
    CHECK_EQ(t.boundary_per_area, 0);
    CHECK_EQ(t.with_texels(10).wrong(), t.floor);
}
TEST("a bias derived from the slopes makes the foot of a shadow thinner than a texel") {
    // A board that leans from a floor over its own shadow: seen by the light it rises to its upper edge with slope 1.
    std::vector<Triangle> mesh = floor_mesh(3, 0);
    quad(mesh, {0, 0, -1}, {0, 0, 1}, {-1, 1, 1}, {-1, 1, -1});
    const Theorist theorist(RayCaster(mesh), {{-6, 1, .3}, {-.5, .3, 0}, {0, 1, 0}, 300, 300}, {.001, 1, .002}, 2);
    double last = 1;
    for (const double h : {.08, .04, .02}) {
        const Theory t = theorist.derived_bias({h, h}, 1);
        CHECK(t.floor > 0 && t.floor < last);
        last = .6 * t.floor;  // half, if pixels were points
    }
}
TEST("theory does not depend on the number of threads") {
    const RayCaster caster = disk_over(floor_mesh(7, .1));
    const Theory a = Theorist(caster, from_above, light, 1).derived_bias({.03, .03}, 2);
    CHECK_EQ(a.boundary_per_area, Theorist(caster, from_above, light, 3).derived_bias({.03, .03}, 2).boundary_per_area);
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
