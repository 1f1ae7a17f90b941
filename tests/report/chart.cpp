// chart.cpp: see chart.h. The picture is written by hand so that it holds nothing a reader of it does not need.
#include "chart.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "geometry.h"

namespace {

[[gnu::format(printf, 1, 2)]] std::string format(const char* how, ...) {
    char text[1024];
    va_list arguments;
    va_start(arguments, how);
    std::vsnprintf(text, sizeof text, how, arguments);
    va_end(arguments);
    return text;
}

std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text) out += std::strchr("&<>\"'", c) ? format("&#%d;", c ? c : ' ') : std::string(1, c);
    return out;
}

// ---- where things lie, in the picture's units ----

constexpr double width = 900, height = 600;
constexpr double left = 84, right = 868, top = 84, bottom = 520;  // of the plot
constexpr double floor_y = bottom - 56;                           // where the logarithmic part ends: below is zero
constexpr double zero_y = (floor_y + bottom) / 2 + 4;
constexpr double gap_y = (floor_y + zero_y) / 2;  // where the axis is broken

struct LogAxis {
    std::vector<double> ticks = {};  // round numbers, from the last below the values to the first above them
    double from, to;                 // places of the first and the last

    LogAxis(double smallest, double largest, double at_low, double at_high) : from(at_low), to(at_high) {
        constexpr double room = 1.05;  // for a mark and its ring
        const bool is_short = largest < 30 * smallest;
        for (double power = std::pow(10, std::floor(std::log10(smallest)) - 1);; power *= 10)
            for (const double digit : is_short ? std::vector{1., 1.5, 2., 3., 5., 7.} : std::vector{1., 2., 5.}) {
                if (digit * power * room < smallest) ticks.clear();
                ticks.push_back(digit * power);
                if (digit * power >= largest * room) return;
            }
    }
    double operator()(double value) const {
        return from + (to - from) * std::log(value / ticks.front()) / std::log(ticks.back() / ticks.front());
    }
};

// A method's look: told apart by shape and dashes as well, for print without colour and for every eye.
constexpr int looks = 4;
constexpr const char* dashes[looks] = {"none", "7 4", "2 3", "10 3 2 3"};
constexpr const char* outlines[looks] = {  // of marks, around (0,0)
    "M-5 0 a5 5 0 1 0 10 0 a5 5 0 1 0 -10 0", "M-4.5 -4.5 h9 v9 h-9 z", "M0 -7 L7 0 0 7 -7 0 z",
    "M0 -6.5 L6 4.5 -6 4.5 z"};

std::string text(const vec2& p, const std::string& kind, const std::string& what) {
    return format("<text x='%.1f' y='%.1f' class='%s'>", p.x, p.y, kind.c_str()) + escaped(what) + "</text>\n";
}
std::string path(const char* kind, const std::string& d) { return format("<path class='%s' d='", kind) + d + "'/>\n"; }
std::string coordinates(const vec2& p) { return format(" %.1f %.1f", p.x, p.y); }

// Dark on light, and light on dark where the reader's screen is dark; on paper always the former. No custom properties:
// not every converter knows them.
std::string style() {
    std::string out = R"(<style>
text { fill: currentColor; font-family: "Helvetica Neue", Arial, "DejaVu Sans", sans-serif; font-size: 13px }
.title { font-size: 18px; font-weight: bold } .name { font-size: 14px; font-weight: bold } .small { font-size: 11.5px }
.end { text-anchor: end } .middle { text-anchor: middle }
.axis, .ring { stroke: currentColor; stroke-width: 1.3; fill: none }
.pale { stroke-width: 13; stroke-linejoin: round; fill: none }
.line { stroke-width: 2; fill: none }
svg { color: #1b1f24 } .paper { fill: #fff } .grid { stroke: #dfe3e7 } .pale { stroke: #f5dd94 }
.quiet { fill: #57606a }
)";
    std::string dark =
        "svg { color: #e6edf3 } .paper { fill: #0d1117 } .grid { stroke: #2b3138 } .pale { stroke: #5e4b10 } "
        ".quiet { fill: #9aa4af }\n";
    constexpr const char* colors[2][looks] = {{"#0067a8", "#c24a00", "#007a5a", "#9a3f86"},
                                              {"#6cb8f5", "#f5a04c", "#3fcf9f", "#e291cf"}};
    for (int i = 0; i < looks; i++) {
        out += format(".line%d { stroke-dasharray: %s; stroke: %s } .mark%d { fill: %s }\n", i, dashes[i], colors[0][i],
                      i, colors[0][i]);
        dark += format(".line%d { stroke: %s } .mark%d { fill: %s }\n", i, colors[1][i], i, colors[1][i]);
    }
    return out + "@media screen and (prefers-color-scheme: dark) {\n" + dark + "}\n</style>\n";
}

}  // namespace

void mark_frontier(std::vector<Figures>& figures) {
    for (Figures& f : figures)
        f.frontier = f.rival && std::none_of(figures.begin(), figures.end(), [&](const Figures& g) {
                         return g.rival && g.error <= f.error && g.total_ms <= f.total_ms &&
                                (g.error < f.error || g.total_ms < f.total_ms);
                     });
}

std::string csv(const std::vector<Figures>& figures) {
    std::string out =
        "method,size,acne_percent,leak_percent,error_percent,rmse,depth_ms,shade_ms,total_ms,bytes,frontier,"
        "floor_percent,coefficient,texel,boundary_per_area,predicted_percent,measured_percent,noise_percent\n";
    for (const Figures& f : figures) {
        out += "\"" + f.method + "\"," + (f.size ? std::to_string(f.size) : "");
        out += format(",%.4f,%.4f,%.4f,%.4f,%.3f,%.3f,%.3f,%lld,%d", f.acne, f.leak, f.error, f.rmse, f.depth_ms,
                      f.shade_ms, f.total_ms, f.bytes, f.frontier);
        if (const auto& p = f.prediction)
            out += format(",%.4f,%.4f,%.6f,%.4f,%.4f,%.4f,%.4f\n", p->floor, p->coefficient, p->texel,
                          p->boundary_per_area, p->predicted, p->measured, p->noise);
        else out += ",,,,,,,\n";
    }
    return out;
}

std::string svg(std::vector<Figures> rivals, const std::string& title, const std::string& subtitle) {
    std::erase_if(rivals, [](const Figures& f) { return !f.rival; });
    if (rivals.empty()) throw std::invalid_argument("a chart needs at least one method");
    double fastest = INFINITY, slowest = 0, best = INFINITY, worst = 0;
    for (const Figures& f : rivals) {
        if (!(f.total_ms > 0) || !std::isfinite(f.total_ms) || !(f.error >= 0))
            throw std::invalid_argument("a chart needs positive times and errors that are not negative");
        fastest = std::min(fastest, f.total_ms), slowest = std::max(slowest, f.total_ms);
        if (f.error > 0) best = std::min(best, f.error), worst = std::max(worst, f.error);
    }
    if (worst == 0) best = worst = 1;  // nothing but zeros: any axis will do
    const LogAxis x(fastest, slowest, left, right), y(best, worst, floor_y, top);
    const auto place = [&](const Figures& f) { return vec2{x(f.total_ms), f.error > 0 ? y(f.error) : zero_y}; };

    std::string out =
        format("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %g %g' width='%g' height='%g' role='img'>\n",
               width, height, width, height);
    out += "<title>" + escaped(title) + "</title>\n" + style();
    out += format("<rect class='paper' width='%g' height='%g'/>\n", width, height);
    out += text({left, 34}, "title", title) + text({left, 57}, "quiet", subtitle);

    // Axes. The one of the error is broken above the band of zero, which has no place on a logarithmic scale.
    for (const double t : x.ticks)
        out += path("grid", format("M%.1f %g V%g", x(t), top, bottom)) +
               text({x(t), bottom + 20}, "middle", format("%g", t));
    const auto level = [&](double at, const std::string& label) {
        out += path("grid", format("M%g %.1f H%g", left, at, right)) + text({left - 10, at + 4.5}, "end", label);
    };
    for (const double t : y.ticks) level(y(t), format("%g", t));
    level(zero_y, "0");
    out += path("axis", format("M%g %g V%g M%g %g V%g H%g", left, top, gap_y - 4, left, gap_y + 4, bottom, right));
    out += path("axis", format("M%g %g l14 -6 M%g %g l14 -6", left - 7, gap_y - 1, left - 7, gap_y + 7));
    out += text({(left + right) / 2, bottom + 48}, "middle", "both passes, milliseconds (logarithmic)");
    out += format("<text transform='translate(26 %g) rotate(-90)' class='middle'>", (top + bottom) / 2) +
           "pixels wrong, % of those that face the light (logarithmic)</text>\n";

    // The efficient frontier: the least error that is to be had in a time, hence a staircase.
    std::vector<vec2> steps;
    for (const Figures& f : rivals)
        if (f.frontier) steps.push_back(place(f));
    std::sort(steps.begin(), steps.end(),
              [](const vec2& a, const vec2& b) { return a.x != b.x ? a.x < b.x : a.y > b.y; });
    if (!steps.empty()) {
        std::string stairs = "M" + coordinates(steps[0]);
        for (const vec2& p : steps) stairs += format(" H%.1f V%.1f", p.x, p.y);
        out += path("pale", stairs + format(" H%g", right));
        out += text({steps.back().x + 16, steps.back().y - 10}, "quiet small", "efficient frontier");
    }

    // The methods: their lines, then the marks over them, and last of all the words. Errors fall with time, so there is
    // room to the left and below of a line, and to the right and above: neighbours have their words on different sides.
    std::string marks, words, run;
    int look = 0;
    for (std::size_t i = 0; i < rivals.size(); i++) {
        const Figures& f = rivals[i];
        const vec2 p = place(f);
        const bool first = i == 0 || rivals[i - 1].method != f.method,
                   last = i + 1 == rivals.size() || rivals[i + 1].method != f.method;
        if (first) run = "M";
        run += coordinates(p);
        marks +=
            format("<path class='mark%d' transform='translate(%.1f %.1f)' d='%s'/>\n", look, p.x, p.y, outlines[look]);
        if (f.frontier) marks += format("<circle class='ring' cx='%.1f' cy='%.1f' r='9.5'/>\n", p.x, p.y);
        const bool below = look % 2 == 0;
        const std::string ink = format(" mark%d", look);
        if (f.size)
            words += text({p.x + (below ? -11 : 11), p.y + (below ? 12 : -4)}, (below ? "small end" : "small") + ink,
                          std::to_string(f.size));
        if (!last) continue;
        out += path(format("line line%d", look).c_str(), run);
        words +=
            text(first ? vec2{p.x - 14, p.y + 5} : vec2{p.x, p.y + (below ? 28 : -20)}, "name end" + ink, f.method);
        look = (look + 1) % looks;
    }
    out += marks + words;
    return out + "</svg>\n";
}
