// report.cpp: error against run time, for each way of computing the shadow. It runs the program that it judges, as a
// child: with --report for the errors, several times without for the times. It prints a table, what theory says, and how
// far stiff cases can be driven; it writes report.csv, stiffness.csv and report.svg.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "chart.h"
#include "model.h"
#include "prediction.h"
#include "program.h"
#include "stiffness.h"

namespace {

struct Options {
    std::vector<std::string> models;
    std::filesystem::path out = ".";
    std::string eye, light;  // as umbra takes them; empty: its defaults
    int rounds = 5, threads = 1;
};

constexpr const char* usage_text = R"(usage: report [options] [model.obj ...]

Prints acne, leak, error, RMSE, milliseconds and bytes of each shadow method at each size of its buffer, and what
theory says of the error; and the errors of stiff cases. Writes report.csv, stiffness.csv and report.svg. Several models share one scene. Without a model: the idol.

  -o DIR             folder of the three files (.)
  --rounds N         runs of each for the times, in turn; the median counts (5)
  --threads N        of the program that is measured (1)
  --eye X,Y,Z        the viewer (1,1,4)
  --light X,Y,Z      direction towards the light (1,1,0)
  --help
)";

constexpr int sizes[] = {200, 400, 800, 1600, 3200, 6400};
constexpr double bias = 43.34;              // the lesson's, of a depth of 2000 for two units of the scene
constexpr double scene_bias = bias / 1000;  // in the scene's unit
constexpr int picture_side = 800;           // pixels of what is timed
constexpr int fine_side =
    3 * picture_side;                // ... of what is held against theory: at 6400 few pixels of 800 x 800 are wrong
constexpr double tolerance = .10;    // how near theory should be ...
constexpr int tolerated_from = 800;  // ... from which size up

vec3 parse_vector(const std::string& option, const std::string& value) {
    vec3 v;
    char rest;
    if (std::sscanf(value.c_str(), "%lf,%lf,%lf%c", &v.x, &v.y, &v.z, &rest) != 3 || !std::isfinite(v.x) ||
        !std::isfinite(v.y) || !std::isfinite(v.z) || v == vec3{})
        throw std::invalid_argument(option + ": \"" + value + "\" is not a point X,Y,Z");
    return v;
}

Options parse(int argc, char** argv) {
    Options opt;
    for (int i = 1; i < argc; i++) {
        const std::string arg = argv[i];
        const auto value = [&]() -> std::string {
            if (++i == argc) throw std::invalid_argument(arg + ": a value is missing");
            return argv[i];
        };
        const auto number = [&](int most) {
            const std::string text = value();
            int n = 0;
            char rest;
            if (std::sscanf(text.c_str(), "%5d%c", &n, &rest) != 1 || n < 1 || n > most)
                throw std::invalid_argument(arg + ": \"" + text + "\" is not 1 to " + std::to_string(most));
            return n;
        };
        if (arg == "--help") std::exit(std::fputs(usage_text, stdout) < 0);
        else if (arg == "-o") opt.out = value();
        else if (arg == "--rounds") opt.rounds = number(1000);
        else if (arg == "--threads") opt.threads = number(256);
        else if (arg == "--eye") parse_vector(arg, opt.eye = value());
        else if (arg == "--light") parse_vector(arg, opt.light = value());
        else if (arg.size() > 1 && arg[0] == '-') throw std::invalid_argument("unknown option " + arg);
        else opt.models.push_back(arg);
    }
    if (opt.models.empty()) opt.models.push_back(UMBRA_OBJ_DIR "/idol/idol.obj");
    return opt;
}

// ---- the program that is judged ----

// The viewer, the light and the models, as arguments.
std::string scene_of(const Options& opt) {
    std::string arguments;
    if (!opt.eye.empty()) arguments.append(" --eye ").append(quoted(opt.eye));
    if (!opt.light.empty()) arguments.append(" --light ").append(quoted(opt.light));
    for (const std::string& model : opt.models) arguments.append(" ").append(quoted(model));
    return arguments;
}

struct Configuration {
    enum class Kind { map, constant, exact, off } kind;
    int size;  // texels a side, 0 without a buffer

    std::string name() const {
        switch (kind) {
            case Kind::map:
                return "shadow map";
            case Kind::constant:
                return "constant bias";
            case Kind::exact:
                return "exact";
            default:
                return "off";
        }
    }
    std::string arguments() const {
        switch (kind) {
            case Kind::map:
                return "--shadow map --shadow-size " + std::to_string(size);
            case Kind::constant:
                return "--bias 43.34 --shadow-size " + std::to_string(size);
            case Kind::exact:
                return "--shadow exact";
            default:
                return "--shadow off";
        }
    }
};

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const std::size_t half = values.size() / 2;
    return values.size() % 2 ? values[half] : (values[half - 1] + values[half]) / 2;
}

Figures measure_error(const Program& umbra, const Options& opt, const Configuration& c) {
    const Values said = umbra.run("--report " + c.arguments() + scene_of(opt));
    Figures f;
    f.method = c.name();
    f.size = c.size;
    f.rival = c.kind != Configuration::Kind::off;
    f.acne = value_of(said, "falsely_dark_percent");
    const double facing = value_of(said, "facing");
    f.self = facing > 0 ? 100 * value_of(said, "self") / facing : 0;
    f.leak = value_of(said, "falsely_lit_percent");
    f.error = value_of(said, "error_percent");
    f.rmse = value_of(said, "rmse");
    f.bytes = std::llround(value_of(said, "shadow_bytes"));
    return f;
}

// All configurations in turn, round after round: what slows the machine down for a while slows all of them.
void measure_times(const Program& umbra, const Options& opt, const std::vector<Configuration>& configurations,
                   std::vector<Figures>& figures) {
    struct Times {
        std::vector<double> depth, shade, total;
    };
    std::vector<Times> times(configurations.size());
    for (int round = 0; round < opt.rounds; round++) {
        std::cerr << "report: times, round " << round + 1 << " of " << opt.rounds << '\n';
        for (std::size_t i = 0; i < configurations.size(); i++) {
            const std::string threads = " --threads " + std::to_string(opt.threads);
            const Values said = umbra.run(configurations[i].arguments() + threads + scene_of(opt));
            const double depth = value_of(said, "depth_ms"), shade = value_of(said, "shade_ms");
            times[i].depth.push_back(depth), times[i].shade.push_back(shade), times[i].total.push_back(depth + shade);
        }
    }
    for (std::size_t i = 0; i < times.size(); i++)
        figures[i].depth_ms = median(times[i].depth), figures[i].shade_ms = median(times[i].shade),
        figures[i].total_ms = median(times[i].total);
}

// ---- theory ----

void predict_errors(const Program& umbra, const Options& opt, const std::vector<Configuration>& configurations,
                    std::vector<Figures>& figures) {
    std::vector<Model> models;
    for (const std::string& path : opt.models) models.emplace_back(path), models.back().fit();
    const RayCaster caster(models);
    View view;  // umbra's defaults
    view.width = view.height = fine_side;
    if (!opt.eye.empty()) view.eye = parse_vector("--eye", opt.eye);
    const vec3 to_light = opt.light.empty() ? vec3{1, 1, 0} : parse_vector("--light", opt.light);
    constexpr int needles = 3;
    const int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    const double unit = mean_distance({1, 1});

    // The needles of the constant bias, up to sqrt(2)/25 of it long, are safe on surfaces of a slope up to 17.
    constexpr double short_texel = scene_bias / 25;
    std::cerr << "report: needles for the constant bias\n";
    const Theory constant =
        theory_of_constant_bias(caster, view, to_light, scene_bias, {short_texel, short_texel}, needles, threads);

    for (std::size_t i = 0; i < configurations.size(); i++) {
        const Configuration& c = configurations[i];
        if (c.kind != Configuration::Kind::map && c.kind != Configuration::Kind::constant) continue;
        std::cerr << "report: theory for " << c.name() << ' ' << c.size << '\n';
        const bool at_corner = c.kind == Configuration::Kind::constant;
        const Theory t = at_corner
                             ? constant.with_texels(2 / (.75 * c.size) / short_texel)  // [-1,1] on 3/4 of the buffer
                             : theory_of_derived_bias(caster, view, to_light,
                                                      fitted_texel(caster, to_light, view.up, c.size), needles, threads);
        const std::string fine = "--size " + std::to_string(fine_side) + "x" + std::to_string(fine_side) +
                                 " --threads " + std::to_string(threads);
        const Values said = umbra.run("--report " + fine + " " + c.arguments() + scene_of(opt));
        const double wrong = value_of(said, "falsely_dark") + value_of(said, "falsely_lit");
        const double facing = std::max(1., value_of(said, "facing"));
        Figures::Prediction p;
        p.floor = 100 * t.floor;
        p.coefficient = (at_corner ? 2 : 1) * nearest_texel_error;
        p.texel = t.mean_needle / unit /
                  (at_corner ? 2 : 1);  // the side of the square that has the mean distance of this one
        p.boundary_per_area = t.boundary_per_area;
        p.predicted = 100 * t.wrong();
        p.measured = 100 * wrong / facing;
        p.noise = 100 * std::sqrt(wrong) / facing;  // if pixels were wrong independently
        figures[i].prediction = p;
    }
}

// ---- what is printed ----

void print_table(const std::vector<Figures>& figures) {
    std::printf("%-14s %5s %8s %8s %8s %8s %7s %8s %8s %8s %11s\n", "method", "size", "acne %", "of self", "leak %",
                "error %", "RMSE", "depth ms", "shade ms", "both ms", "bytes");
    for (const Figures& f : figures)
        std::printf("%-14s %5s %8.4f %8.4f %8.4f %8.4f %7.3f %8.2f %8.2f %8.2f %11lld%s\n", f.method.c_str(),
                    f.size ? std::to_string(f.size).c_str() : "-", f.acne, f.self, f.leak, f.error, f.rmse, f.depth_ms,
                    f.shade_ms, f.total_ms, f.bytes, f.frontier ? "  *" : "");
    std::puts("* on the efficient frontier: no other method is as fast and as good, and better in one of the two");
}

void print_predictions(const std::vector<Figures>& figures) {
    std::printf(
        "\nTheory: error = floor + coefficient * h * L/A, h the texel's side, L/A the shadow boundary's length per "
        "area.\n"
        "Measured on %d x %d pixels, with one standard deviation of its noise.\n"
        "%-14s %5s %8s %7s %9s %7s %9s %9s %8s %6s\n",
        fine_side, fine_side, "method", "size", "floor %", "coeff.", "h", "L/A", "theory %", "measured", "+-", "ratio");
    int within = 0, of = 0;
    for (const Figures& f : figures) {
        if (!f.prediction) continue;
        const auto& p = *f.prediction;
        const double ratio = p.predicted > 0 ? p.measured / p.predicted : 1;
        if (f.size >= tolerated_from) of++, within += std::fabs(ratio - 1) <= tolerance;
        std::printf("%-14s %5d %8.4f %7.4f %9.6f %7.3f %9.4f %9.4f %8.4f %6.3f%s\n", f.method.c_str(), f.size, p.floor,
                    p.coefficient, p.texel, p.boundary_per_area, p.predicted, p.measured, p.noise, ratio,
                    f.size >= tolerated_from && std::fabs(ratio - 1) > tolerance ? "  off" : "");
    }
    std::printf("%d of %d within %.0f %% of theory from size %d up\n", within, of, 100 * tolerance, tolerated_from);
}

void print_stiffness(const std::vector<StiffRow>& rows) {
    std::puts("\nStiff and extreme cases: the error as each grows, and the step where it is more than it may be.");
    std::string family;
    for (const StiffRow& row : rows) {
        if (row.family != family) {
            std::printf("\n%-34s", (family = row.family).c_str());
            for (const StiffRow::Step& s : row.steps) std::printf(" %8.3g", s.stiffness);
            std::puts("");
        }
        std::printf("  %-32s", row.measure.c_str());
        for (const StiffRow::Step& s : row.steps) std::printf(" %8.2g", s.error);
        if (row.breaks()) std::printf("  breaks at %g", row.breaks()->stiffness);
        std::puts("");
    }
}

void write(const std::filesystem::path& path, const std::string& text) {
    write_bytes(path, Bytes(text.begin(), text.end()));
}

std::string joined_names(const std::vector<std::string>& models) {
    std::string names;
    for (const std::string& model : models)
        names += (names.empty() ? "" : ", ") + std::filesystem::path(model).stem().string();
    return names;
}

}  // namespace

int main(int argc, char** argv) try {
    const Options opt = parse(argc, argv);
    std::filesystem::create_directories(opt.out);
    const Program umbra(UMBRA_BINARY);
    using Kind = Configuration::Kind;
    std::vector<Configuration> configurations;
    for (const Kind kind : {Kind::map, Kind::constant})
        for (const int size : sizes) configurations.push_back({kind, size});
    configurations.push_back({Kind::exact, 0});
    configurations.push_back({Kind::off, 0});

    std::vector<Figures> figures;
    for (const Configuration& c : configurations) {
        std::cerr << "report: errors of " << c.name() << ' ' << (c.size ? std::to_string(c.size) : "") << '\n';
        figures.push_back(measure_error(umbra, opt, c));
    }
    measure_times(umbra, opt, configurations, figures);
    predict_errors(umbra, opt, configurations, figures);
    mark_frontier(figures);

    const std::vector<StiffRow> stiff = measure_stiffness(umbra);

    print_table(figures);
    print_predictions(figures);
    print_stiffness(stiff);
    const std::string title = "Shadow error against time: " + joined_names(opt.models);
    const std::string subtitle = std::to_string(picture_side) + " x " + std::to_string(picture_side) + " pixels, " +
                                 std::to_string(opt.threads) + (opt.threads == 1 ? " thread" : " threads") +
                                 ", median of " + std::to_string(opt.rounds) +
                                 " runs. Numbers at the marks: texels a side of the shadow buffer.";
    write(opt.out / "report.csv", csv(figures));
    write(opt.out / "stiffness.csv", csv(stiff));
    write(opt.out / "report.svg", svg(figures, title, subtitle));
    return 0;
} catch (const std::invalid_argument& e) {
    std::cerr << "report: " << e.what() << " (report --help lists the options)\n";
    return 2;
} catch (const std::exception& e) {
    std::cerr << "report: " << e.what() << '\n';
    return 1;
}
