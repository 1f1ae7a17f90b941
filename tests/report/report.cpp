// report.cpp: what a picture's shadows are off by, and error against run time for each way of computing them. It runs the
// program that it judges, as a child.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>

#include "chart.h"
#include "judge.h"
#include "prediction.h"
#include "stiffness.h"

namespace {

constexpr const char* usage_text = R"(usage: report UMBRA'S OPTIONS AND MODELS
       report [-o DIR] [--rounds N] [--threads N] [umbra's options and models]

The first prints what umbra's picture is off by: pixels that only one of picture and truth covers; the pixels that face the
light; those of them that are falsely dark and falsely lit, as counts and in percent; and the RMSE of their colours.

The second, also without any argument, prints these figures, milliseconds and bytes of each shadow method at each size of
its buffer, and what theory says of the error; and the errors of stiff cases. It writes report.csv, stiffness.csv and
report.svg.

  -o DIR             folder of the three files (.)
  --rounds N         runs of each for the times, in turn; the median counts (5)
  --threads N        of the program where it is timed (1)
)";

constexpr double bias = 43.34;       // the lesson's, of a depth of 2000 for two units of the scene
constexpr int picture_side = 800;    // pixels of what is timed
constexpr int fine_side = 3 * 800;   // ... of what is held against theory: at 6400 few pixels of 800 x 800 are wrong
constexpr double tolerance = .10;    // how near theory should be ...
constexpr int tolerated_from = 800;  // ... from which size up

struct Options {
    std::filesystem::path out;
    int rounds, threads;
    Arguments scene;  // umbra's
};

Options parse(Arguments arguments) {
    const auto taken = [&](const std::string& option, const std::string& otherwise) {
        const auto at = std::find(arguments.begin(), arguments.end(), option);
        if (at == arguments.end()) return otherwise;
        if (at + 1 == arguments.end()) throw std::invalid_argument(option + ": a value is missing");
        const std::string value = at[1];
        arguments.erase(at, at + 2);
        return value;
    };
    const auto number_taken = [&](const std::string& option, const std::string& otherwise, int most) {
        const std::string text = taken(option, otherwise);
        int n = 0;
        char rest;
        if (std::sscanf(text.c_str(), "%5d%c", &n, &rest) != 1 || n < 1 || n > most)
            throw std::invalid_argument(option + ": \"" + text + "\" is not 1 to " + std::to_string(most));
        return n;
    };
    const std::string out = taken("-o", ".");
    const int rounds = number_taken("--rounds", "5", 1000), threads = number_taken("--threads", "1", 256);
    return {out, rounds, threads, arguments};
}

Arguments size_of(int side) { return {"--size", std::to_string(side) + "x" + std::to_string(side)}; }

std::vector<Figures> methods() {
    std::vector<Figures> all;
    for (const auto& [name, arguments] : {std::pair<const char*, Arguments>{"shadow map", {"--shadow", "map"}},
                                          {"constant bias", {"--bias", "43.34"}}})
        for (const int size : {200, 400, 800, 1600, 3200, 6400})
            all.push_back({name, size, joined(arguments, {"--shadow-size", std::to_string(size)})});
    all.push_back({"exact", 0, {"--shadow", "exact"}});
    all.push_back({"off", 0, {"--shadow", "off"}});
    all.back().rival = false;
    return all;
}

void measure_errors(const Program& umbra, const Options& opt, std::vector<Figures>& figures) {
    Judge judge(umbra, joined(opt.scene, size_of(picture_side)));
    for (Figures& f : figures) {
        std::cerr << "report: errors of " << f.method << ' ' << f.size << '\n';
        const PictureError e = judge.error(f.arguments);
        f.acne = e.percent(e.falsely_dark), f.leak = e.percent(e.falsely_lit), f.error = e.percent(), f.rmse = e.rmse;
    }
}

// All methods in turn, round after round: what slows the machine down for a while slows all of them.
void measure_times(const Program& umbra, const Options& opt, std::vector<Figures>& figures) {
    std::vector<std::vector<double>> depth(figures.size()), shade = depth, total = depth;
    const Arguments scene = joined(joined(opt.scene, size_of(picture_side)), {"--threads", std::to_string(opt.threads)});
    for (int round = 0; round < opt.rounds; round++) {
        std::cerr << "report: times, round " << round + 1 << " of " << opt.rounds << '\n';
        for (std::size_t i = 0; i < figures.size(); i++) {
            const Values said = umbra.run(joined(scene, figures[i].arguments));
            depth[i].push_back(value_of(said, "depth_ms")), shade[i].push_back(value_of(said, "shade_ms"));
            total[i].push_back(depth[i].back() + shade[i].back());
            figures[i].bytes = std::llround(value_of(said, "shadow_bytes"));
        }
    }
    const auto median = [](std::vector<double>& values) {
        std::sort(values.begin(), values.end());
        return (values[(values.size() - 1) / 2] + values[values.size() / 2]) / 2;
    };
    for (std::size_t i = 0; i < figures.size(); i++)
        figures[i].depth_ms = median(depth[i]), figures[i].shade_ms = median(shade[i]), figures[i].total_ms = median(total[i]);
}

void predict_errors(const Program& umbra, const Options& opt, std::vector<Figures>& figures) {
    const Arguments fine = joined(opt.scene, size_of(fine_side));
    const Scene scene(fine, umbra.folder());
    const Theorist theorist(RayCaster(scene.models), scene.view, scene.light, scene.threads);
    // The needles of the constant bias, up to sqrt(2)/25 of it long, are safe on surfaces of a slope up to 17.
    constexpr double scene_bias = bias / 1000, short_texel = scene_bias / 25;
    const Theory constant = theorist.constant_bias(scene_bias, {short_texel, short_texel});
    Judge judge(umbra, fine);
    for (Figures& f : figures) {
        if (!f.size) continue;
        std::cerr << "report: theory for " << f.method << ' ' << f.size << '\n';
        const int at_corner = f.method == "constant bias";
        const Theory t = at_corner ? constant.with_texels(2 / (.75 * f.size) / short_texel)  // [-1,1] on 3/4 of the buffer
                                   : theorist.derived_bias(theorist.fitted_texel(f.size));
        const PictureError e = judge.error(f.arguments);
        const double wrong = static_cast<double>(e.falsely_dark + e.falsely_lit);
        // The texel: the side of the square that has the mean distance of this one. The noise: if pixels were wrong
        // independently.
        f.prediction = {.floor = 100 * t.floor, .coefficient = (1 + at_corner) * nearest_texel_error,
                        .texel = t.mean_needle / mean_distance({1, 1}) / (1 + at_corner),
                        .boundary_per_area = t.boundary_per_area, .predicted = 100 * t.wrong(), .measured = e.percent(),
                        .noise = e.percent(1) * std::sqrt(wrong)};
    }
}

// A table of commas in columns: the first two, and those from `begin` up to `end`.
void print_columns(const std::string& csv, int begin, int end) {
    std::istringstream lines(csv);
    std::vector<std::vector<std::string>> rows;
    std::vector<int> widths;
    for (std::string line, cell; std::getline(lines, line);) {
        std::istringstream cells(line);
        rows.emplace_back();
        for (int column = 0; std::getline(cells, cell, ','); column++) {
            if (column >= 2 && (column < begin || column >= end)) continue;
            std::erase(cell, '"');
            rows.back().push_back(cell);
            widths.resize(std::max(widths.size(), rows.back().size()));
            int& width = widths[rows.back().size() - 1];
            width = std::max(width, static_cast<int>(cell.size()));
        }
    }
    for (const auto& row : rows) {
        for (std::size_t i = 0; i < row.size(); i++)
            std::printf(i < 1 ? "%-*s" : "  %*s", widths[i], row[i].c_str());
        std::puts("");
    }
}

void print(const std::vector<Figures>& figures, const std::vector<StiffRow>& stiff) {
    print_columns(csv(figures), 2, 11);
    std::puts("frontier: no other method is as fast and as good, and better in one of the two\n\n"
              "Theory: error = floor + coefficient * h * L/A, h the texel's side, L/A the shadow boundary's length per area.");
    std::printf("Measured on %d x %d pixels, with one standard deviation of its noise.\n", fine_side, fine_side);
    print_columns(csv(figures), 11, 18);
    int within = 0, of = 0;
    for (const Figures& f : figures) {
        if (!f.prediction || f.size < tolerated_from) continue;
        of++, within += std::fabs(f.prediction->measured - f.prediction->predicted) <= tolerance * f.prediction->predicted;
    }
    std::printf("%d of %d within %.0f %% of theory from size %d up\n", within, of, 100 * tolerance, tolerated_from);
    std::puts("\nStiff and extreme cases: the error as each grows, and from where it is more than is bearable.");
    print_columns(csv(stiff), 2, 5);
}

void make_table(const Program& umbra, const Options& opt) {
    std::filesystem::create_directories(opt.out);
    std::vector<Figures> figures = methods();
    measure_errors(umbra, opt, figures);
    measure_times(umbra, opt, figures);
    predict_errors(umbra, opt, figures);
    mark_frontier(figures);
    const std::vector<StiffRow> stiff = measure_stiffness(umbra);
    print(figures, stiff);

    std::string title = "Shadow error against time:";
    for (const std::string& path : Scene(opt.scene, umbra.folder()).paths)
        title.append(title.back() == ':' ? " " : ", ").append(std::filesystem::path(path).stem().string());
    const std::string side = std::to_string(picture_side),
                      subtitle = side + " x " + side + " pixels, threads: " + std::to_string(opt.threads) + ", median of " +
                                 std::to_string(opt.rounds) + " runs. Numbers at the marks: texels a side of the shadow buffer.";
    const auto write = [&](const char* name, const std::string& text) {
        write_bytes(opt.out / name, Bytes(text.begin(), text.end()));
    };
    write("report.csv", csv(figures));
    write("stiffness.csv", csv(stiff));
    write("report.svg", svg(figures, title, subtitle));
}

}  // namespace

int main(int argc, char** argv) try {
    const Arguments arguments(argv + 1, argv + argc);
    const auto given = [&](const char* option) { return std::find(arguments.begin(), arguments.end(), option) != arguments.end(); };
    if (given("--help")) return std::fputs(usage_text, stdout) < 0;
    const Program umbra(UMBRA_BINARY);
    if (arguments.empty() || given("-o") || given("--rounds")) make_table(umbra, parse(arguments));
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
