// chart.cpp: see chart.h. The picture is written by hand so that it holds nothing a reader of it does not need.
#include "chart.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <iterator>
#include <stdexcept>

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
    for (const char c : text) {
        if (c == '&') out += "&amp;";
        else if (c == '<') out += "&lt;";
        else if (c == '>') out += "&gt;";
        else if (c == '"') out += "&quot;";
        else if (static_cast<unsigned char>(c) < ' ') out += ' ';
        else out += c;
    }
    return out;
}

// ---- where things lie, in the picture's units ----

constexpr double width = 900, height = 600;
constexpr double left = 84, right = 868, top = 84, bottom = 520;  // of the plot
constexpr double zero_band = 56;                                  // at its foot, for errors of zero
constexpr double floor_y = bottom - zero_band;                    // where the logarithmic part ends

// Ticks at round numbers, few of them or more where the axis is short.
double next_tick(double tick, bool more) {
    constexpr double few[] = {1, 2, 5, 10}, many[] = {1, 1.5, 2, 3, 5, 7, 10};
    const double power = std::pow(10, std::floor(std::log10(tick * 1.01)));
    const auto larger = [&](double digit) { return digit > tick / power * 1.01; };
    return power * (more ? *std::find_if(std::begin(many), std::end(many), larger)
                         : *std::find_if(std::begin(few), std::end(few), larger));
}

struct LogAxis {
    double low, high, from, to;  // values, and the places of the two
    bool more;

    LogAxis(double smallest, double largest, double at_low, double at_high)
        : from(at_low), to(at_high), more(largest < 30 * smallest) {
        constexpr double room = 1.05;  // for a mark and its ring
        low = std::pow(10, std::floor(std::log10(smallest)) - 1);
        while (next_tick(low, more) * room < smallest) low = next_tick(low, more);
        for (high = low; high < largest * room;) high = next_tick(high, more);
    }
    double operator()(double value) const {
        return from + (to - from) * (std::log(value) - std::log(low)) / (std::log(high) - std::log(low));
    }
    template <class Visit>
    void for_each_tick(Visit&& visit) const {
        for (double t = low; t <= high * 1.001; t = next_tick(t, more)) visit(t);
    }
};

struct Box {
    double x0, y0, x1, y1;
    double common_area(const Box& b) const {
        return std::max(0., std::min(x1, b.x1) - std::max(x0, b.x0)) *
               std::max(0., std::min(y1, b.y1) - std::max(y0, b.y0));
    }
};

struct Place {
    double x, y;
};

// Finds each label a place beside its mark that nothing else has, or the one that covers least.
class Labels {
public:
    void keep_clear(const Box& box) { taken_.push_back(box); }
    void keep_clear(const Place& a, const Place& b, double r) {  // a line, r to either side
        const double length = std::hypot(b.x - a.x, b.y - a.y);
        const int n = static_cast<int>(length / 3) + 1;
        for (int i = 0; i <= n; i++) {
            const double x = a.x + (b.x - a.x) * i / n, y = a.y + (b.y - a.y) * i / n;
            taken_.push_back({x - r, y - r, x + r, y + r});
        }
    }
    // The text's left end on its base line. side: -1 to prefer the left of the mark, 1 the right.
    Place place(const Place& mark, const std::string& text, double font, int side) {
        const double w = text_width(text, font), h = font;
        Place best{};
        double least = -1;
        for (const double away : {14., 19., 25., 32.}) {
            for (const double turn : {0., 30., -30., 60., -60., 90., -90., 180., 150., -150., 120., -120.}) {
                const double angle = turn * 3.14159265 / 180, dx = side * std::cos(angle), dy = -std::sin(angle);
                // The box's middle: as far from the mark as to leave it `away` of room.
                const double x = mark.x + dx * (away + w / 2), y = mark.y + dy * (away + h / 2);
                const Box box{x - w / 2, y - h / 2, x + w / 2, y + h / 2};
                if (box.x0 < left + 4 || box.x1 > right - 2 || box.y0 < top - 14 || box.y1 > bottom - 4) continue;
                const Box roomy{box.x0 - 2, box.y0 - 1, box.x1 + 2, box.y1 + 1};
                double covered = away / 100;  // of two free places the nearer
                for (const Box& other : taken_) covered += roomy.common_area(other);
                if (least < 0 || covered < least) least = covered, best = {box.x0, box.y1 - .22 * h}, chosen_ = box;
            }
        }
        taken_.push_back(chosen_);
        return best;
    }
    static double text_width(const std::string& text, double font) {  // of a wide sans-serif
        return .66 * font * static_cast<double>(text.size());
    }

private:
    std::vector<Box> taken_;
    Box chosen_{};
};

// A method's look: told apart by shape and dashes as well, for print without colour and for every eye.
constexpr int looks = 4;
constexpr const char* dashes[looks] = {"none", "7 4", "2 3", "10 3 2 3"};

std::string mark(int look, const Place& p, double r) {
    const auto at = [&](double x, double y) { return format("%.1f,%.1f ", p.x + x * r, p.y + y * r); };
    switch (look) {
        case 0:
            return format("<circle cx='%.1f' cy='%.1f' r='%.1f'/>", p.x, p.y, r);
        case 1:
            return format("<rect x='%.1f' y='%.1f' width='%.1f' height='%.1f'/>", p.x - .9 * r, p.y - .9 * r, 1.8 * r,
                          1.8 * r);
        case 2:
            return "<polygon points='" + at(0, -1.4) + at(1.4, 0) + at(0, 1.4) + at(-1.4, 0) + "'/>";
        default:
            return "<polygon points='" + at(0, -1.3) + at(1.2, .9) + at(-1.2, .9) + "'/>";
    }
}

std::string text(const Place& p, const char* kind, const std::string& what) {
    return format("<text x='%.1f' y='%.1f' class='%s'>", p.x, p.y, kind) + escaped(what) + "</text>\n";
}

// Dark on light, and light on dark where the reader's screen is dark; on paper always the former. No custom properties:
// not every converter knows them.
struct Theme {
    const char *ink, *paper, *faint, *pale, *quiet, *look[looks];
};
constexpr Theme light_theme{"#1b1f24", "#ffffff", "#dfe3e7",
                            "#f5dd94", "#57606a", {"#0067a8", "#c24a00", "#007a5a", "#9a3f86"}};
constexpr Theme dark_theme{"#e6edf3", "#0d1117", "#2b3138",
                           "#5e4b10", "#9aa4af", {"#6cb8f5", "#f5a04c", "#3fcf9f", "#e291cf"}};

std::string colours(const Theme& t) {
    std::string out =
        format("svg { color: %s } .paper { fill: %s } .grid { stroke: %s } .pale { stroke: %s } .quiet { fill: %s }\n",
               t.ink, t.paper, t.faint, t.pale, t.quiet);
    for (int i = 0; i < looks; i++)
        out += format(".line%d { stroke: %s } .mark%d { fill: %s }\n", i, t.look[i], i, t.look[i]);
    return out;
}

std::string style() {
    std::string out = R"(<style>
text { fill: currentColor; font-family: "Helvetica Neue", Arial, "DejaVu Sans", sans-serif; font-size: 13px }
.title { font-size: 18px; font-weight: bold } .name { font-size: 14px; font-weight: bold } .small { font-size: 11.5px }
.end { text-anchor: end } .middle { text-anchor: middle }
.axis, .ring { stroke: currentColor; stroke-width: 1.3; fill: none }
.pale { stroke-width: 13; stroke-linejoin: round; fill: none }
.line { stroke-width: 2; fill: none }
)";
    for (int i = 0; i < looks; i++) out += format(".line%d { stroke-dasharray: %s }\n", i, dashes[i]);
    return out + colours(light_theme) + "@media screen and (prefers-color-scheme: dark) {\n" + colours(dark_theme) +
           "}\n</style>\n";
}

}  // namespace

void mark_frontier(std::vector<Figures>& figures) {
    for (Figures& f : figures) {
        f.frontier = f.rival && std::none_of(figures.begin(), figures.end(), [&](const Figures& g) {
                         return g.rival && g.error <= f.error && g.total_ms <= f.total_ms &&
                                (g.error < f.error || g.total_ms < f.total_ms);
                     });
    }
}

std::string csv(const std::vector<Figures>& figures) {
    std::string out =
        "method,size,acne_percent,self_percent,leak_percent,error_percent,rmse,depth_ms,shade_ms,total_ms,bytes,"
        "frontier,floor_percent,coefficient,texel,boundary_per_area,predicted_percent,measured_percent,"
        "noise_percent\n";
    for (const Figures& f : figures) {
        std::string name = "\"";
        for (const char c : f.method) name += c == '"' ? "\"\"" : std::string(1, c);
        out += name + "\"," + (f.size ? std::to_string(f.size) : "");
        out += format(",%.4f,%.4f,%.4f,%.4f,%.4f,%.3f,%.3f,%.3f,%lld,%d", f.acne, f.self, f.leak, f.error, f.rmse,
                      f.depth_ms, f.shade_ms, f.total_ms, f.bytes, f.frontier);
        if (const auto& p = f.prediction)
            out += format(",%.4f,%.4f,%.6f,%.4f,%.4f,%.4f,%.4f\n", p->floor, p->coefficient, p->texel,
                          p->boundary_per_area, p->predicted, p->measured, p->noise);
        else out += ",,,,,,,\n";
    }
    return out;
}

std::string svg(const std::vector<Figures>& figures, const std::string& title, const std::string& subtitle) {
    std::vector<std::vector<Figures>> lines;  // of each method
    double fastest = INFINITY, slowest = 0, best = INFINITY, worst = 0;
    for (const Figures& f : figures) {
        if (!f.rival) continue;
        if (!(f.total_ms > 0) || !std::isfinite(f.total_ms) || !(f.error >= 0))
            throw std::invalid_argument("a chart needs positive times and errors that are not negative");
        fastest = std::min(fastest, f.total_ms), slowest = std::max(slowest, f.total_ms);
        if (f.error > 0) best = std::min(best, f.error), worst = std::max(worst, f.error);
        const auto same = [&](const std::vector<Figures>& line) { return line[0].method == f.method; };
        const auto line = std::find_if(lines.begin(), lines.end(), same);
        if (line == lines.end()) lines.push_back({f});
        else line->push_back(f);
    }
    if (lines.empty()) throw std::invalid_argument("a chart needs at least one method");
    if (worst == 0) best = worst = 1;  // nothing but zeros: any axis will do
    const LogAxis x(fastest, slowest, left, right), y(best, worst, floor_y, top);
    const double zero_y = (floor_y + bottom) / 2 + 4;
    const auto place = [&](const Figures& f) { return Place{x(f.total_ms), f.error > 0 ? y(f.error) : zero_y}; };

    std::string out =
        format("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %g %g' width='%g' height='%g' role='img'>\n",
               width, height, width, height);
    out += "<title>" + escaped(title) + "</title>\n" + style();
    out += format("<rect class='paper' width='%g' height='%g'/>\n", width, height);
    out += text({left, 34}, "title", title) + text({left, 57}, "quiet", subtitle);

    // Axes. The one of the error is broken above the band of zero, which has no place on a logarithmic scale.
    x.for_each_tick([&](double t) {
        out += format("<path class='grid' d='M%.1f %g V%g'/>\n", x(t), top, bottom);
        out += text({x(t), bottom + 20}, "middle", format("%g", t));
    });
    y.for_each_tick([&](double t) {
        out += format("<path class='grid' d='M%g %.1f H%g'/>\n", left, y(t), right);
        out += text({left - 10, y(t) + 4.5}, "end", format("%g", t));
    });
    out += format("<path class='grid' d='M%g %.1f H%g'/>\n", left, zero_y, right);
    out += text({left - 10, zero_y + 4.5}, "end", "0");
    const double gap = (floor_y + zero_y) / 2;
    out += format("<path class='axis' d='M%g %g V%.1f M%g %.1f V%g H%g'/>\n", left, top, gap - 4, left, gap + 4, bottom,
                  right);
    out += format("<path class='axis' d='M%g %.1f l14 -6 M%g %.1f l14 -6'/>\n", left - 7, gap - 1, left - 7, gap + 7);
    out += text({(left + right) / 2, bottom + 48}, "middle", "both passes, milliseconds (logarithmic)");
    out += format(
        "<text transform='translate(%g %g) rotate(-90)' class='middle'>pixels wrong, %% of those that face the light "
        "(logarithmic)</text>\n",
        26., (top + bottom) / 2);

    // The efficient frontier: the least error that is to be had in a time, hence a staircase.
    std::vector<Place> steps;
    for (const Figures& f : figures)
        if (f.frontier) steps.push_back(place(f));
    std::sort(steps.begin(), steps.end(),
              [](const Place& a, const Place& b) { return a.x != b.x ? a.x < b.x : a.y > b.y; });
    if (!steps.empty()) {
        out += format("<path class='pale' d='M%.1f %.1f", steps[0].x, steps[0].y);
        for (std::size_t i = 1; i < steps.size(); i++) out += format(" H%.1f V%.1f", steps[i].x, steps[i].y);
        out += format(" H%.1f'/>\n", right);
    }

    Labels labels;
    for (std::size_t i = 1; i < steps.size(); i++) {
        labels.keep_clear(steps[i - 1], {steps[i].x, steps[i - 1].y}, 7);
        labels.keep_clear({steps[i].x, steps[i - 1].y}, steps[i], 7);
    }
    if (!steps.empty()) labels.keep_clear(steps.back(), {right, steps.back().y}, 7);
    for (const auto& line : lines)
        for (std::size_t i = 0; i < line.size(); i++) {
            const Place p = place(line[i]);
            labels.keep_clear({p.x - 9, p.y - 9, p.x + 9, p.y + 9});
            if (i > 0) labels.keep_clear(place(line[i - 1]), p, 1.5);
        }
    std::string marks_and_rings, names, sizes;
    for (std::size_t l = 0; l < lines.size(); l++) {
        const int look = static_cast<int>(l) % looks;
        out += format("<path class='line line%d' d='", look);
        for (std::size_t i = 0; i < lines[l].size(); i++)
            out += format("%s%.1f %.1f", i ? " L" : "M", place(lines[l][i]).x, place(lines[l][i]).y);
        out += "'/>\n";
        for (const Figures& f : lines[l]) {
            const Place p = place(f);
            marks_and_rings += format("<g class='mark%d'>", look) + mark(look, p, 5) + "</g>\n";
            if (f.frontier) marks_and_rings += format("<circle class='ring' cx='%.1f' cy='%.1f' r='9.5'/>\n", p.x, p.y);
        }
        // The name at the line's slow end, where lines are apart.
        const Figures& last = lines[l].back();
        names += text(labels.place(place(last), lines[l][0].method, 14, place(last).x > (left + right) / 2 ? -1 : 1),
                      format("name mark%d", look).c_str(), lines[l][0].method);
    }
    if (!steps.empty()) {
        const Place foot{right - 70, steps.back().y};
        names += text(labels.place(foot, "efficient frontier", 11.5, -1), "quiet small", "efficient frontier");
    }
    for (std::size_t l = 0; l < lines.size(); l++)
        for (const Figures& f : lines[l])
            if (f.size) {
                const std::string size = std::to_string(f.size);
                sizes += text(labels.place(place(f), size, 11.5, l % 2 ? 1 : -1),
                              format("small mark%d", static_cast<int>(l) % looks).c_str(), size);
            }
    return out + marks_and_rings + names + sizes + "</svg>\n";
}
