// report.cpp: what a picture's shadows are off by, and error against run time for each way of computing them. It runs
// the program that it judges, as a child.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>

#include "chart.h"
#include "judge.h"
#include "prediction.h"
#include "stiffness.h"

namespace {

constexpr const char* usage_text = R"(usage: report [umbra's options and models]
       report [-o DIR] [--rounds N] [--threads N] [umbra's options and models]

The first prints what umbra's picture is off by: pixels that only one of picture and truth covers; the pixels that face
the light; those of them that are falsely dark and falsely lit, as counts and in percent; and the RMSE of their colours.

The second, with -o or --rounds, takes minutes. It prints these figures, milliseconds and bytes of each shadow method at
each size of its buffer, and what theory says of the error; the errors of stiff cases; and the figures of spot and point
lights. It writes report.csv, stiffness.csv, lights.csv, left_out.csv (how long a run takes that leaves
things out, as a share of a whole one) and report.svg into the folder DIR (.). The milliseconds are medians of N rounds
(5) of N threads (1).
)";

constexpr const char* bias = "43.34";           // the lesson's, of a depth of 2000 for two units of the scene ...
constexpr double scene_bias = .04334;           // ... and in the scene's unit
constexpr const char* side = "800x800";         // pixels of what is timed
constexpr const char* fine_side = "2400x2400";  // ... of what is held against theory: at 6400 few of 800x800 are wrong
constexpr double tolerance = .10;               // how near theory should be ...
constexpr int tolerated_from = 800;             // ... from which size up

std::vector<Figures> methods() {
    std::vector<Figures> all;
    for (const auto& [name, arguments] : {std::pair<const char*, Strings>{"shadow map", {"--shadow", "map"}},
                                          {"constant bias", {"--bias", bias}}})
        for (const int size : {200, 400, 800, 1600, 3200, 6400})
            all.push_back({name, size, joined(arguments, {"--shadow-size", std::to_string(size)})});
    all.push_back({"exact", 0, {"--shadow", "exact"}});
    all.push_back({.method = "off", .arguments = {"--shadow", "off"}, .rival = false});
    return all;
}

void set_errors(Figures& f, const PictureError& e) {
    f.acne = e.percent(e.falsely_dark), f.leak = e.percent(e.falsely_lit), f.error = e.percent(), f.rmse = e.rmse;
}

// Of lights with a place: kinds, half angles, and sizes of the buffer.
std::vector<Figures> lights(const Program& umbra, const Strings& scene) {
    std::vector<Figures> all;
    for (const std::string kind : {"spot", "point"})
        for (const std::string& place : each(".8,.6,1,%", {"10", "45", "80"})) {
            const Strings light{"--" + kind, place};
            Judge judge(umbra, joined(scene, light));
            for (const std::string size : {"512", "1024", "2048", "4096", "exact"}) {
                const Strings how = size == "exact" ? Strings{"--shadow", size} : Strings{"--shadow-size", size};
                Figures& f = all.emplace_back();
                f.method = kind + " " + place.substr(place.rfind(',') + 1) + (size == "exact" ? " exact" : "");
                f.size = size == "exact" ? 0 : std::stoi(size), f.arguments = joined(light, how);
                std::cerr << "report: errors of " << f.method << ' ' << size << '\n';
                set_errors(f, judge.error(how));
            }
        }
    return all;
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return (values[(values.size() - 1) / 2] + values[values.size() / 2]) / 2;
}

// All methods in turn, round after round: what slows the machine down for a while slows all of them.
void measure_times(const Program& umbra, const Strings& scene, int rounds, std::vector<Figures>& figures) {
    std::vector<std::vector<double>> depth(figures.size()), shade = depth, total = depth;
    for (int round = 1; round <= rounds; round++) {
        std::cerr << "report: times, round " << round << " of " << rounds << '\n';
        for (std::size_t i = 0; i < figures.size(); i++) {
            Figures& f = figures[i];
            const std::string said = umbra.run(joined(scene, f.arguments));
            depth[i].push_back(value(said, "depth_ms")), shade[i].push_back(value(said, "shade_ms"));
            total[i].push_back(depth[i].back() + shade[i].back());
            f.depth_ms = median(depth[i]), f.shade_ms = median(shade[i]), f.total_ms = median(total[i]);
            f.bytes = std::llround(value(said, "shadow_bytes"));
        }
    }
}

// What is left out saves: the time of all stages, as a share of that of the default picture. In turn.
std::string left_out(const Program& umbra, int rounds) {
    const std::vector<Strings> all{{}, {"--shadow", "off"}, {"--only", "framebuffer"}, {"--only", "depth"},
                                   {"--center", "9,0,0", "--eye", "9,0,4"}};
    std::vector<std::vector<double>> shares(all.size());
    for (int round = 0; round < rounds; round++) {
        double whole = 0;
        for (std::size_t i = 0; i < all.size(); i++) {
            double took = 0;
            for (int n = 0; n < 5; n++) {
                const std::string said = umbra.run(all[i]);
                for (const char* stage : {"load_ms", "depth_ms", "shade_ms", "write_ms"}) took += value(said, stage);
            }
            if (i == 0) whole = took;
            shares[i].push_back(took / whole);
        }
    }
    std::ostringstream out;
    out << "options,share\n";
    for (std::size_t i = 1; i < all.size(); i++) {
        for (std::size_t k = 0; k < all[i].size(); k++) out << (k ? " " : "\"") << all[i][k];
        out << "\"," << median(shares[i]) << '\n';
    }
    return out.str();
}

void predict_errors(const Program& umbra, const Strings& arguments, std::vector<Figures>& figures) {
    const Scene scene(arguments, umbra);
    const Theorist theorist(RayCaster(scene.models), scene.view, scene.light.at, scene.threads);
    // The needles of the constant bias, up to sqrt(2)/25 of it long, are safe on surfaces of a slope up to 17.
    constexpr double short_texel = scene_bias / 25;
    const Theory constant = theorist.constant_bias(scene_bias, {short_texel, short_texel});
    Judge judge(umbra, arguments);
    for (Figures& f : figures) {
        if (!f.size) continue;
        std::cerr << "report: theory for " << f.method << ' ' << f.size << '\n';
        const int at_corner = f.method == "constant bias";
        const Theory t = at_corner
                             ? constant.with_texels(2 / (.75 * f.size) / short_texel)  // [-1,1] on 3/4 of the buffer
                             : theorist.derived_bias(theorist.fitted_texel(f.size));
        const PictureError e = judge.error(f.arguments);
        // The texel: the side of the square that has the mean distance of this one. The noise: if pixels were wrong
        // independently.
        f.prediction = {.floor = 100 * t.floor, .coefficient = (1 + at_corner) * nearest_texel_error,
                        .texel = t.mean_needle / mean_distance({1, 1}) / (1 + at_corner),
                        .boundary_per_area = t.boundary_per_area, .predicted = 100 * t.wrong(), .measured = e.percent(),
                        .noise = e.percent(1) * std::sqrt(static_cast<double>(e.falsely_dark + e.falsely_lit))};
    }
}

// A table of commas in columns: the first two, and those from `begin` up to `end`.
void print_columns(std::string csv, std::size_t begin, std::size_t end) {
    std::erase(csv, '"');
    std::istringstream lines(csv);
    std::vector<Strings> rows;
    std::vector<int> widths(end);
    for (std::string line, cell; std::getline(lines, line);) {
        std::istringstream cells(line);
        Strings& row = rows.emplace_back();
        while (row.size() < end && std::getline(cells, cell, ',')) {
            widths[row.size()] = std::max(widths[row.size()], static_cast<int>(cell.size()));
            row.push_back(cell);
        }
    }
    for (const Strings& row : rows) {
        for (std::size_t i = 0; i < row.size(); i++)
            if (i < 2 || i >= begin) std::printf(i < 1 ? "%-*s" : "  %*s", widths[i], row[i].c_str());
        std::puts("");
    }
}

void print(const std::vector<Figures>& figures, const std::vector<StiffRow>& stiff) {
    print_columns(csv(figures), 2, 11);
    std::printf("frontier: no other method is as fast and as good, and better in one of the two\n\n"
                "Theory: error = floor + coefficient * h * L/A, h the texel's side, L/A the shadow boundary's length\n"
                "per area. Measured on %s pixels, with one standard deviation of its noise.\n", fine_side);
    print_columns(csv(figures), 11, 18);
    int within = 0, of = 0;
    for (const Figures& f : figures)
        if (const auto& p = f.prediction; p && f.size >= tolerated_from)
            of++, within += std::fabs(p->measured - p->predicted) <= tolerance * p->predicted;
    std::printf("%d of %d within %.0f %% of theory from size %d up\n\n"
                "Stiff and extreme cases: the error as each grows, and from where it is more than is bearable.\n",
                within, of, 100 * tolerance, tolerated_from);
    print_columns(csv(stiff), 2, 5);
}

void make_table(const Program& umbra, Strings scene) {
    const auto taken = [&](const std::string& option, const std::string& otherwise) {  // out of the arguments
        const auto at = std::find(scene.begin(), scene.end(), option);
        if (at == scene.end()) return otherwise;
        if (at + 1 == scene.end()) throw std::invalid_argument(option + ": a value is missing");
        const std::string value = at[1];
        scene.erase(at, at + 2);
        return value;
    };
    const std::filesystem::path out = taken("-o", ".");
    const std::string threads = taken("--threads", "1"), rounds = taken("--rounds", "5");
    int n = 0;
    char rest;
    if (std::sscanf(rounds.c_str(), "%5d%c", &n, &rest) != 1 || n < 1 || n > 1000)
        throw std::invalid_argument("--rounds: \"" + rounds + "\" is not 1 to 1000");
    std::filesystem::create_directories(out);

    std::vector<Figures> figures = methods();
    Judge judge(umbra, joined(scene, {"--size", side}));
    for (Figures& f : figures) {
        std::cerr << "report: errors of " << f.method << ' ' << f.size << '\n';
        set_errors(f, judge.error(f.arguments));
    }
    const Strings timed = joined(scene, {"--size", side, "--threads", threads});
    measure_times(umbra, timed, n, figures);
    std::vector<Figures> of_lights = lights(umbra, joined(scene, {"--size", side}));
    measure_times(umbra, timed, n, of_lights);
    predict_errors(umbra, joined(scene, {"--size", fine_side}), figures);
    mark_frontier(figures);
    const std::vector<StiffRow> stiff = measure_stiffness(umbra);
    print(figures, stiff);
    std::puts("\nLights with a place, their half angle.");
    print_columns(csv(of_lights), 2, 10);

    std::string title = "Shadow error against time:";
    for (const std::string& path : Scene(scene, umbra).paths)
        title.append(title.back() == ':' ? " " : ", ").append(std::filesystem::path(path).stem().string());
    const std::string subtitle = side + (" pixels, threads: " + threads) + ", median of " + rounds +
                                 " runs. Numbers at the marks: texels a side of the shadow buffer.";
    for (const auto& [name, text] : {std::pair<const char*, std::string>{"report.csv", csv(figures)},
                                     {"lights.csv", csv(of_lights)}, {"stiffness.csv", csv(stiff)},
                                     {"left_out.csv", left_out(umbra, n)},
                                     {"report.svg", svg(figures, title, subtitle)}})
        write_bytes(out / name, Bytes(text.begin(), text.end()));
}

}  // namespace

int main(int argc, char** argv) try {
    Strings arguments;
    for (const std::string& argument : Strings(argv + 1, argv + argc)) {  // --name=value as two
        const std::size_t equals = argument.starts_with("--") ? argument.find('=') : argument.npos;
        arguments.push_back(argument.substr(0, equals));
        if (equals != argument.npos) arguments.push_back(argument.substr(equals + 1));
    }
    const auto given = [&](const char* option) {
        return std::find(arguments.begin(), arguments.end(), option) != arguments.end();
    };
    if (given("--help")) return std::fputs(usage_text, stdout) < 0;
    const Program umbra(UMBRA_BINARY);
    if (given("-o") || given("--rounds")) make_table(umbra, arguments);
    else std::puts(Judge(umbra, arguments).error().line().c_str());
    return std::fflush(stdout) != 0;
} catch (const ProgramFailed& e) {
    std::cerr << e.what();
    return e.status;
} catch (const std::exception& e) {
    const bool usage = dynamic_cast<const std::invalid_argument*>(&e);
    std::cerr << "report: " << e.what() << (usage ? " (report --help lists the options)" : "") << '\n';
    return usage ? 2 : 1;
}
