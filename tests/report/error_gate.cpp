// error_gate.cpp: the error figures that the shadow methods are held to, on the models of the project. It runs the
// program that its argument names, so that programs with a known fault can be shown to it: they must not pass.
#include <cstdio>

#include "judge.h"

namespace {

bool open = true;

void hold(const std::string& what, const char* name, auto measured, double most) {
    const auto figure = static_cast<double>(measured);
    std::printf("%s %s: %s %g, at most %g\n", figure <= most ? "ok    " : "FAILED", what.c_str(), name, figure, most);
    open &= figure <= most;
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc != 2) return std::printf("usage: error_gate PROGRAM\n"), 2;
    const Program umbra(argv[1]);

    // Measured figures and a twentieth. Their truth is in the report; here they only must not get worse.
    struct Measured {
        std::string model;
        double dark, lit;
    };
    for (const auto& [model, dark, lit] : {Measured{"knot", .0716, .0847}, Measured{"idol", .2553, .3589}}) {
        Judge judge(umbra, {std::string(UMBRA_OBJ_DIR "/").append(model).append("/").append(model).append(".obj")});
        const PictureError map = judge.error(), exact = judge.error({"--shadow", "exact"});
        hold(model + ", map", "coverage", map.coverage, 5);
        hold(model + ", map", "falsely_dark_percent", map.percent(map.falsely_dark), 1.05 * dark);
        hold(model + ", map", "falsely_lit_percent", map.percent(map.falsely_lit), 1.05 * lit);
        hold(model + ", exact", "falsely_dark", exact.falsely_dark, 0);
        hold(model + ", exact", "falsely_lit", exact.falsely_lit, 0);
    }

    // A plane under grazing light: nothing shadows it.
    const std::filesystem::path plane = umbra / "plane.obj";
    std::ofstream(plane) << "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 4 3 2 1\n";
    for (const std::string n_l : {".1", ".01", ".001", ".0001"}) {
        Judge judge(umbra, {"--light", ".8," + n_l + ",.6", plane.string()});
        for (const char* method : {"map", "exact"})
            hold("plane at n.l = " + n_l + ", " + method, "falsely_dark",
                 judge.error({"--shadow", method}).falsely_dark, 0);
    }
    std::puts(open ? "the gate is open" : "the gate is shut");
    return open ? 0 : 1;
} catch (const std::exception& e) {
    std::printf("FAILED %s\n", e.what());
    return 1;
}
