// judge.h: how far the program's pictures are from the truth. It runs the program, reads its pictures and holds them
// against the ray caster; it knows the program by its options and pictures alone.
#pragma once
#include "run.h"
#include "tgaimage.h"
#include "truth.h"

// What the program's arguments say of the scene, with the program's defaults; the models placed as it places them. So
// all coordinates are relative to --center.
struct Scene {
    View view;
    LightSource light{vec3{1, 1, 0}};
    int threads;
    Strings paths;
    std::vector<Model> models;
    Strings towards_light;  // the arguments once more, with copies of the models whose normals all point to the light

    // Of arguments that the program accepts; the copies are written into the folder. Throws what Model does.
    Scene(const Strings& arguments, const Folder& folder);
};

struct PictureError {
    long coverage = 0;  // pixels that only one of picture and truth covers: no shadow's doing, and left out of the rest
    long facing = 0;        // pixels whose surface faces the light: the whole that the percentages are of
    long falsely_dark = 0;  // of those lit in truth: acne, and half of what a ragged boundary costs
    long falsely_lit = 0;   // of those shadowed in truth: leaks, and the other half
    double rmse = 0;        // over the channels of the facing pixels, from the picture with exact shadows; of 255

    double percent(long wrong) const {
        return facing ? 100. * static_cast<double>(wrong) / static_cast<double>(facing) : 0;
    }
    double percent() const { return percent(falsely_dark + falsely_lit); }
    std::string line() const;  // name value name value ...
};

// Holds a picture against the truth. shadow: white where the picture says that the surface is lit. exact: the picture
// with exact shadows. Throws std::invalid_argument where the sizes differ.
PictureError compare(const TruthImage& truth, const TGAImage& picture, const TGAImage& shadow, const TGAImage& exact);

// Judges pictures of one scene that differ in their shadows.
class Judge {
public:
    Judge(const Program& program, const Strings& scene) : program_(program), arguments_(scene) {}

    // Runs the program with the scene's arguments and a method's. Throws ProgramFailed, and what Model, the ray caster
    // and the reader of pictures throw.
    PictureError error(const Strings& method = {});

private:
    TGAImage draw(const Strings& arguments, const Strings& more) const;

    const Program& program_;
    Strings arguments_;
    std::optional<Scene> scene_;  // this and the next two are made when the program has accepted the arguments
    TruthImage truth_;
    TGAImage exact_;
};
