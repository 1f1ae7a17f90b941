// bench.cpp: how long the two passes take, against what else a user might take.
//
//     bench [--rounds N] [--rasterizer PROGRAM] [--raycaster PROGRAM] [-o DIR] [model.obj ...]
//
// Times differ by a half from minute to minute on a shared machine, so programs are run in turn, and what is compared
// are the medians of the ratios of neighbouring runs. With -o the table also becomes DIR/bench.csv. The opponents are
// not part of this project; where none is given, their columns are empty:
// - a rasterizer draws the same two passes, as PROGRAM --size N --frames N MODEL, on as many threads beside its own as
//   LP_NUM_THREADS in the environment says (Mesa's llvmpipe), and prints a line "frame_finish MILLISECONDS";
// - a ray caster builds its tree, casts eye and shadow rays, as PROGRAM MODEL SIZE FRAMES THREADS, and prints
//   "sum MILLISECONDS" in a line of names and values.
#include "run.h"

#include <cstdio>
#include <cstdlib>
#include <map>

namespace {

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}
// For the table: nothing where nothing was measured.
std::string column(const std::vector<double>& values) {
    char text[20] = "";
    if (!values.empty()) std::snprintf(text, sizeof text, "%.2f", median(values));
    return text;
}

std::string quotient(double a, double b, bool wanted) {
    return column(wanted ? std::vector{a / b} : std::vector<double>());
}

struct Case {
    std::string model;
    int size, threads;
};

struct Row {
    double triangles = 0;
    std::vector<double> map, exact, exact_to_map, map_to_rasterizer, exact_to_raycaster;
};

struct Bench {
    Folder folder;
    int rounds = 5;
    std::string rasterizer, raycaster;

    std::string said(const std::string& command) const {  // in one line; nothing where it fails
        const Outcome o = folder.run_command(command);
        return o.status == 0 ? std::regex_replace(o.out, std::regex("\n"), " ") : "";
    }

    // Each program draws as many frames as take half a second, but at least 7: in the first ones memory is fresh.
    Row measured(const Case& c) const {
        Row row;
        const std::string size = std::to_string(c.size), threads = std::to_string(c.threads), model = quoted(c.model);
        const std::string draw = umbra_command + " --size " + size + 'x' + size + " --shadow-size " + size +
                                 " --threads " + threads + " -o " + quoted(folder.path().string()) + ' ' + model;
        const auto passes = [&](const std::string& options) {
            const std::string line = said(draw + options);
            row.triangles = value(line, "triangles");
            return value(line, "depth_ms") + value(line, "shade_ms");
        };
        const std::string n = std::to_string(std::clamp(static_cast<int>(500 / passes("")), 7, 100));
        const std::string others = c.threads == 1 ? "0" : threads;  // threads beside the rasterizer's own
        const std::string rasterize = "LP_NUM_THREADS=" + others + ' ' + rasterizer + " --size " + size + " --frames " +
                                      n + " --out /dev/null " + model;
        const std::string cast_rays = raycaster + ' ' + model + ' ' + size + ' ' + n + ' ' + threads;
        for (int i = 0; i < rounds; i++) {
            const double map = passes(" --frames " + n), exact = passes(" --shadow exact --frames " + n);
            row.map.push_back(map), row.exact.push_back(exact), row.exact_to_map.push_back(exact / map);
            // An opponent that cannot read the model has no figure.
            if (const std::string line = rasterizer.empty() ? "" : said(rasterize); !line.empty())
                row.map_to_rasterizer.push_back(map / value(line, "frame_finish"));
            if (const std::string line = raycaster.empty() ? "" : said(cast_rays); !line.empty())
                row.exact_to_raycaster.push_back(exact / value(line, "sum"));
        }
        return row;
    }
};

}  // namespace

int main(int argc, char** argv) try {
    Bench bench;
    std::vector<std::string> models;
    std::FILE* csv = nullptr;
    for (int i = 1; i < argc; i++) {
        const std::string arg = argv[i], next = i + 1 < argc ? argv[i + 1] : "";
        if (arg == "--rounds") bench.rounds = std::max(1, std::atoi(argv[++i]));
        else if (arg == "--rasterizer") bench.rasterizer = quoted(next), i++;
        else if (arg == "--raycaster") bench.raycaster = quoted(next), i++;
        else if (arg == "-o") {
            csv = std::fopen((next + "/bench.csv").c_str(), "w"), i++;
            if (!csv) throw std::runtime_error(next + "/bench.csv: cannot be written");
        }
        else models.push_back(std::filesystem::absolute(arg).string());
    }
    if (models.empty()) models = {UMBRA_OBJ_DIR "/idol/idol.obj", UMBRA_OBJ_DIR "/knot/knot.obj"};
    const auto print = [&](const std::string& line) {
        std::puts(line.c_str());
        std::fflush(stdout);
        if (csv) std::fputs((line + '\n').c_str(), csv);
    };
    print("triangles,size,threads,map_ms,exact_ms,exact_to_map,map_to_rasterizer,exact_to_raycaster,"
          "to_one_thread,to_half_the_side");
    for (const std::string& model : models) {
        std::map<std::pair<int, int>, double> map_ms;  // by size and threads
        for (const int size : {800, 1600, 3200})
            for (const int threads : {1, 2}) {
                const Row row = bench.measured({model, size, threads});
                const double map = map_ms[{size, threads}] = median(row.map);
                std::string line = std::to_string(std::lround(row.triangles)) + ',' + std::to_string(size) + ',' +
                                   std::to_string(threads);
                for (const std::string& figure :
                     {column(row.map), column(row.exact), column(row.exact_to_map), column(row.map_to_rasterizer),
                      column(row.exact_to_raycaster), quotient(map, map_ms[{size, 1}], threads > 1),
                      quotient(map, map_ms[{size / 2, threads}], size > 800)})
                    line += ',' + figure;
                print(line);
            }
    }
    if (csv && std::fclose(csv)) throw std::runtime_error("bench.csv: cannot be written");
    return 0;
} catch (const std::exception& e) {
    std::fprintf(stderr, "bench: %s\n", e.what());
    return 1;
}
