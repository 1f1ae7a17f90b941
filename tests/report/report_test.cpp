// report_test.cpp: what the report makes of its figures: the frontier, the table of commas, the picture; and the theory
// it holds them against. The measuring itself is not tested here.
#include <algorithm>
#include <numbers>
#include <random>

#include "chart.h"
#include "check.h"
#include "prediction.h"

namespace {

constexpr double pi = std::numbers::pi;

Figures figures(const std::string& method, int size, double error, double ms) {
    Figures f;
    f.method = method, f.size = size, f.error = error, f.total_ms = ms;
    return f;
}

std::vector<Figures> example() {
    std::vector<Figures> all = {figures("map", 200, 2, 10),    figures("map", 800, .5, 14),
                                figures("map", 6400, .06, 80), figures("flat", 200, 3, 9),
                                figures("flat", 800, 1.5, 13), figures("flat", 6400, 1.2, 60),
                                figures("exact", 0, 0, 20)};
    all.push_back(figures("off", 0, 20, 5));
    all.back().rival = false;
    mark_frontier(all);
    return all;
}

int occurrences(const std::string& text, const std::string& of) {
    int n = 0;
    for (std::size_t at = text.find(of); at != std::string::npos; at = text.find(of, at + of.size())) n++;
    return n;
}

// The number that follows the first `name='` after `from`.
double attribute(const std::string& text, const std::string& name, std::size_t from) {
    const std::size_t at = text.find(name + "='", from);
    return at == std::string::npos ? NAN : std::stod(text.substr(at + name.size() + 2));
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
std::vector<Triangle> disk_over(std::vector<Triangle> mesh) {
    const vec3 l = normalized(light), x = normalized(cross({0, 0, 1}, l)), y = cross(l, x), middle = l * 20;
    constexpr int sides = 64;
    const auto at = [&](int i) {
        return middle + (x * std::cos(2 * pi * i / sides) + y * std::sin(2 * pi * i / sides)) * radius;
    };
    for (int i = 0; i < sides; i++) mesh.push_back({middle, at(i), at(i + 1)});
    return mesh;
}

const View from_above{{0, 8, 0}, {}, {0, 0, -1}, 200, 200};
const double circle_per_area = 2 * pi * radius / ((2 / .75) * (2 / .75) * normalized(light).y);

}  // namespace

TEST("the frontier is what no other method beats") {
    std::vector<int> on;
    const auto all = example();
    for (std::size_t i = 0; i < all.size(); i++)
        if (all[i].frontier) on.push_back(static_cast<int>(i));
    CHECK(on == (std::vector<int>{0, 1, 3, 4, 6}));
}
TEST("of equals both are on the frontier, of the equally fast the better") {
    std::vector<Figures> f = {figures("a", 1, 1, 5), figures("b", 1, 1, 5), figures("c", 1, 2, 5),
                              figures("d", 1, 1, 6)};
    mark_frontier(f);
    CHECK(f[0].frontier && f[1].frontier && !f[2].frontier && !f[3].frontier);
}
TEST("a table of commas has the same number of fields in every line") {
    auto all = example();
    all[0].method = "with \"quotes\"";
    all[1].prediction = Figures::Prediction{.1, .2436, .0025, 5, .4, .41, .01};
    const std::string text = csv(all);
    const std::size_t head = text.find('\n');
    const int commas = occurrences(text.substr(0, head), ",");
    CHECK_EQ(occurrences(text, "\n"), static_cast<int>(all.size()) + 1);
    CHECK_EQ(occurrences(text, ","), commas * (static_cast<int>(all.size()) + 1));
    CHECK(text.find("\"with \"\"quotes\"\"\",200,") != std::string::npos);
    CHECK(text.find(",0.1000,0.2436,0.002500,5.0000,0.4000,0.4100,0.0100\n") != std::string::npos);
    CHECK(text.find("\"exact\",,0.0000,") != std::string::npos);
}
TEST("the chart shows every rival, names every line, and rings the frontier") {
    const std::string text = svg(example(), "a < b & \"c\"", "under it");
    CHECK_EQ(occurrences(text, "<g class='mark"), 7);
    CHECK_EQ(occurrences(text, "class='ring'"), 5);
    CHECK_EQ(occurrences(text, "class='line "), 3);
    for (const char* const label : {">map<", ">flat<", ">exact<", ">efficient frontier<"})
        CHECK_EQ(occurrences(text, label), 1);
    CHECK_EQ(occurrences(text, ">6400<"), 2);
    CHECK_EQ(occurrences(text, ">off<"), 0);
    CHECK_EQ(occurrences(text, "a &lt; b &amp; &quot;c&quot;"), 2);
    CHECK_EQ(occurrences(text, "nan"), 0);
    CHECK_EQ(occurrences(text, "inf"), 0);
    CHECK_EQ(occurrences(text, "prefers-color-scheme: dark"), 1);
}
TEST("ten times the error is as far at one end of the axis as at the other, and zero is below it") {
    std::vector<Figures> f;
    for (const double error : {10., 1., .1, 0.}) f.push_back(figures("m", 0, error, 10));
    const std::string text = svg(f, "", "");
    std::vector<double> y;
    for (std::size_t at = text.find("<g class='mark"); at != std::string::npos;
         at = text.find("<g class='mark", at + 1))
        y.push_back(attribute(text, "cy", at));
    CHECK_EQ(y.size(), std::size_t{4});
    if (y.size() != 4) return;
    CHECK_NEAR(y[1] - y[0], y[2] - y[1], .11);  // written with one decimal
    CHECK(y[1] > y[0] && y[3] > y[2]);
}
TEST("labels do not cover each other where methods are close in time") {
    std::vector<Figures> f;
    const int sizes[] = {200, 400, 800, 1600, 3200, 6400};
    const double ms[] = {20, 20.4, 22, 30, 70, 260};
    for (int i = 0; i < 6; i++) f.push_back(figures("shadow map", sizes[i], .8 / (1 << i), ms[i]));
    for (int i = 0; i < 6; i++) f.push_back(figures("constant bias", sizes[i], .25 + 1.7 / (1 << i), ms[i] * .95));
    f.push_back(figures("exact", 0, 0, 21));
    mark_frontier(f);
    const std::string text = svg(f, "", "");
    struct Label {
        double x, y, width;
    };
    std::vector<Label> labels;
    for (const Figures& one : f) {
        if (!one.size) continue;
        const std::string wanted = std::string(">").append(std::to_string(one.size)).append("</text>");
        std::size_t at = text.find(wanted);
        if (&one >= &f[6]) at = text.find(wanted, at + 1);  // of the second line
        CHECK(at != std::string::npos);
        const std::size_t start = text.rfind("<text", at);
        labels.push_back(
            {attribute(text, "x", start), attribute(text, "y", start), 6.4 * static_cast<double>(wanted.size() - 8)});
    }
    for (std::size_t i = 0; i < labels.size(); i++)
        for (std::size_t j = 0; j < i; j++) {
            const Label &a = labels[i], &b = labels[j];
            CHECK(a.x + a.width <= b.x || b.x + b.width <= a.x || std::fabs(a.y - b.y) >= 9);  // digits are 9 high
        }
}
TEST("a chart without methods, or with a time of zero, is refused") {
    CHECK_THROWS(svg({}, "", ""), "at least one");
    CHECK_THROWS(svg({figures("m", 1, 1, 0)}, "", ""), "positive");
    CHECK_THROWS(svg({figures("m", 1, -1, 1)}, "", ""), "positive");
    CHECK_THROWS(svg({figures("m", 1, 1, NAN)}, "", ""), "positive");
    CHECK(!svg({figures("m", 1, 0, 3)}, "", "").empty());  // nothing but zeros
}
TEST("the error of the nearest texel") {
    // The mean of |x . n| over the square and all directions, by the midpoint rule.
    double sum = 0;
    const int n = 200, directions = 90;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            for (int k = 0; k < directions; k++) {
                const double angle = pi * (k + .5) / directions;
                sum += std::fabs(((i + .5) / n - .5) * std::cos(angle) + ((j + .5) / n - .5) * std::sin(angle));
            }
    CHECK_NEAR(sum / (n * n * directions), nearest_texel_error, 5e-5);
    CHECK_NEAR((std::sqrt(2.) + std::log(1 + std::sqrt(2.))) / (3 * pi), nearest_texel_error, 1e-16);
}
TEST("the mean distance in a square is the one that the error of the nearest texel comes from") {
    CHECK_NEAR(2 / pi * mean_distance({1, 1}), nearest_texel_error, 1e-15);
    CHECK_NEAR(mean_distance({3, 3}), 3 * mean_distance({1, 1}), 1e-14);
}
TEST("the mean distance in a rectangle is its integral") {
    for (const Texel t : {Texel{1, 2}, Texel{2, 1}, Texel{.3, 5}}) {
        double sum = 0;
        constexpr int n = 1000;
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++)
                sum += std::hypot(((i + .5) / n - .5) * t.width, ((j + .5) / n - .5) * t.height);
        CHECK_NEAR(sum / (n * n), mean_distance(t), 1e-5 * mean_distance(t));
    }
}
TEST("a fitted texel is a share of what the light sees") {
    const RayCaster caster(std::vector<Triangle>{{vec3{0, 0, 0}, vec3{2, 0, 0}, vec3{0, 4, 0}}});
    const Texel t = fitted_texel(caster, {0, 0, 1}, {0, 1, 0}, 10);
    CHECK_NEAR(t.width, .2, 1e-15);
    CHECK_NEAR(t.height, .4, 1e-15);
}
TEST("needles measure the boundary of a round shadow, on a flat floor cut into few squares or many") {
    for (const int n : {1, 60}) {
        const RayCaster caster(disk_over(floor_mesh(n, 0)));
        const Theory t = theory_of_derived_bias(caster, from_above, light, {.03, .03}, 8, 2);
        CHECK_EQ(t.floor, 0);
        CHECK(t.deviation < .03 * circle_per_area);
        CHECK_NEAR(t.boundary_per_area, circle_per_area, 4 * t.deviation);
        CHECK_NEAR(t.wrong(), nearest_texel_error * .03 * t.boundary_per_area, 1e-15);
    }
}
TEST("needles that are longer one way see the same round shadow") {
    const RayCaster caster(disk_over(floor_mesh(1, 0)));
    const Theory t = theory_of_derived_bias(caster, from_above, light, {.01, .05}, 16, 2);
    CHECK_NEAR(t.boundary_per_area, circle_per_area, 4 * t.deviation);
}
TEST("creases that cast no shadow have no boundary") {  // slopes of 1/3 at most: the light comes in steeper
    const Theory t = theory_of_derived_bias(RayCaster(floor_mesh(60, .033)), from_above, light, {.2, .2}, 8, 2);
    CHECK_EQ(t.boundary_per_area, 0);
}
TEST("a constant bias has the same boundary, and needles twice as long for samples at the corners") {
    const RayCaster caster(disk_over(floor_mesh(1, 0)));
    const Theory t = theory_of_constant_bias(caster, from_above, light, .1, {.015, .015}, 16, 2);
    CHECK_EQ(t.floor, 0);
    CHECK_NEAR(t.boundary_per_area, circle_per_area, 4 * t.deviation);
    CHECK_NEAR(t.wrong(), 2 * nearest_texel_error * .015 * t.boundary_per_area, 1e-15);
    CHECK_NEAR(t.with_texels(2).wrong(), 2 * t.wrong(), 1e-15);
}
TEST("a constant bias larger than every gap leaks the whole shadow and leaves no boundary") {
    const RayCaster caster(disk_over(floor_mesh(1, 0)));
    const Theory t = theory_of_constant_bias(caster, from_above, light, 100, {.015, .015}, 4, 2);
    const double disk_per_area = circle_per_area * radius / 2;
    CHECK_NEAR(t.floor, disk_per_area, .01 * disk_per_area);
    CHECK_EQ(t.boundary_per_area, 0);
    CHECK_EQ(t.with_texels(10).wrong(), t.floor);
}
TEST("the predicted error is the one that a buffer makes") {
    const RayCaster caster(disk_over(floor_mesh(1, 0)));
    const Theory t = theory_of_constant_bias(caster, from_above, light, .1, {.015, .015}, 16, 2);
    const TruthImage truth = cast(caster, from_above, light, 2);
    const vec3 l = normalized(light), x = normalized(cross(l, vec3{0, 0, 1})), y = cross(l, x);
    constexpr double h = .15;  // 34 texels along the shadow's boundary
    std::mt19937 random(71);
    const auto in = [&](double most) { return most * static_cast<double>(random()) / 4294967296.; };
    std::vector<vec3> points;
    for (int py = 0; py < from_above.height; py++)
        for (int px = 0; px < from_above.width; px++)
            points.push_back(caster.first_hit(from_above.eye, from_above.direction(px, py))->point);
    double percent = 0;
    constexpr int buffers = 20;
    for (int i = 0; i < buffers; i++) {  // each with its texels elsewhere, turned otherwise
        const double angle = in(pi), u0 = in(1), v0 = in(1);
        const vec3 u = x * std::cos(angle) + y * std::sin(angle), v = cross(l, u);
        std::vector<std::uint8_t> lit;
        for (const vec3& point : points) {
            const double s = dot(point, u) / h + u0, r = dot(point, v) / h + v0;
            const vec3 texel = point + u * ((std::floor(s) + .5 - s) * h) + v * ((std::floor(r) + .5 - r) * h);
            lit.push_back(!caster.occluded(texel, l, .1));
        }
        percent += compare(truth, lit).percent() / buffers;
    }
    CHECK_NEAR(percent / (100 * nearest_texel_error * h * t.boundary_per_area), 1, .04);
}
TEST("a bias derived from the slopes makes the foot of a shadow thinner than a texel") {
    // A board that leans from a floor over its own shadow: seen by the light it rises to its upper edge with slope 1.
    std::vector<Triangle> mesh = floor_mesh(3, 0);
    quad(mesh, {0, 0, -1}, {0, 0, 1}, {-1, 1, 1}, {-1, 1, -1});
    const RayCaster caster(mesh);
    const vec3 overhead{.001, 1, .002};
    double last = 1;
    for (const double h : {.08, .04, .02}) {
        const View under_it{{-6, 1, .3}, {-.5, .3, 0}, {0, 1, 0}, 300, 300};
        const Theory t = theory_of_derived_bias(caster, under_it, overhead, {h, h}, 1, 2);
        CHECK(t.floor > 0 && t.floor < last);
        last = .6 * t.floor;  // half, if pixels were points
    }
}
TEST("theory does not depend on the number of threads") {
    const RayCaster caster(disk_over(floor_mesh(7, .1)));
    const Theory a = theory_of_derived_bias(caster, from_above, light, {.03, .03}, 2, 1);
    const Theory b = theory_of_derived_bias(caster, from_above, light, {.03, .03}, 2, 3);
    CHECK_EQ(a.boundary_per_area, b.boundary_per_area);
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
