// error_gate.cpp: the error figures that the shadow methods are held to, on the models of the project. It runs the program
// that its argument names, so that programs with a known fault can be shown to it: they must not pass.
#include "program.h"

#include <cstdio>

namespace {

bool open = true;

Values report(const Program& umbra, const std::string& arguments) {
    try {
        return umbra.run("--report --quiet " + arguments);
    } catch (const std::runtime_error& e) {
        std::printf("FAILED %s\n", e.what());
        open = false;
        return {};
    }
}

void hold(const std::string& what, const Values& figures, const char* name, double most) {
    const auto it = figures.find(name);
    const bool holds = it != figures.end() && it->second <= most;
    std::printf("%s %s: %s %g, at most %g\n", holds ? "ok    " : "FAILED", what.c_str(), name, it == figures.end() ? -1 : it->second, most);
    open &= holds;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) return std::printf("usage: error_gate PROGRAM\n"), 2;
    const Program umbra(argv[1]);
    const std::string obj = UMBRA_OBJ_DIR;

    // Measured figures and a twentieth. Their truth is in the report; here they only must not get worse.
    struct Figures {
        std::string model;
        double dark, lit;
    };
    for (const Figures& f : {Figures{"knot", .0716, .0847}, Figures{"idol", .2553, .3589}}) {
        const auto map = report(umbra, obj + "/" + f.model + "/" + f.model + ".obj");
        hold(f.model + ", map", map, "coverage", 5);
        hold(f.model + ", map", map, "self", 0);
        hold(f.model + ", map", map, "falsely_dark_percent", 1.05 * f.dark);
        hold(f.model + ", map", map, "falsely_lit_percent", 1.05 * f.lit);
        const auto exact = report(umbra, "--shadow exact " + obj + "/" + f.model + "/" + f.model + ".obj");
        hold(f.model + ", exact", exact, "falsely_dark", 0);
        hold(f.model + ", exact", exact, "falsely_lit", 0);
    }

    // A plane under grazing light: nothing shadows it.
    const std::filesystem::path plane = umbra.folder() / "plane.obj";
    std::ofstream(plane) << "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 4 3 2 1\n";
    for (const char* n_l : {".1", ".01", ".001", ".0001"})
        for (const char* method : {"map", "exact"})
            hold(std::string("plane at n.l = ") + n_l + ", " + method,
                 report(umbra, std::string("--light .8,") + n_l + ",.6 --shadow " + method + " " + quoted(plane.string())),
                 "falsely_dark", 0);

    std::puts(open ? "the gate is open" : "the gate is shut");
    return open ? 0 : 1;
}
