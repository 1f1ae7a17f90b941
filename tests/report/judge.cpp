// judge.cpp: see judge.h.
#include "judge.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <thread>

#include "our_gl.h"
#include "scenes.h"

// The same faces in the same order.
static std::string copy_of(const Model& model, const Model& fitted, const LightSource& light) {
    Obj copy;
    std::string faces;
    for (int face = 0; face < model.nfaces(); face++) {
        std::string corners = "f";
        // The way to a light with a place turns from corner to corner; but every point of a face that faces the light
        // at all is on that side of its plane.
        const vec3 a = fitted.vert(face, 0), own = cross(fitted.vert(face, 1) - a, fitted.vert(face, 2) - a);
        const vec3 towards = normalized(light.kind == LightSource::far_off ? light.at : own);
        const vec3 n = (transpose(fitted.turn) * direction(towards)).xyz();  // the program will turn it
        faces += "vn " + number(n.x) + ' ' + number(n.y) + ' ' + number(n.z) + '\n';
        for (int c = 0; c < 3; c++) corners += ' ' + std::to_string(copy.vertex(model.vert(face, c))) + "//-1";
        faces += corners + '\n';
    }
    return copy.text() + faces;
}

Scene::Scene(const Strings& arguments, const Folder& folder)
    : threads(std::max(1, static_cast<int>(std::thread::hardware_concurrency()))) {
    std::map<std::string, std::string> values;  // of the options that have one: the last that is given, or nothing
    for (const char* option : {"-o", "--output", "--size", "--shadow-size", "--eye", "--center", "--up", "--zoom",
                               "--light", "--spot", "--point", "--beam", "--sky", "--shadow", "--casters", "--bias",
                               "--draw", "--only", "--threads", "--frames"})
        values[option];
    bool fits = true;
    std::string lamp;  // the last of three options that say which
    std::vector<Strings> places;  // the options that follow a model
    for (auto arg = arguments.begin(); arg != arguments.end(); ++arg) {
        if (*arg == "--at" || *arg == "--turn" || *arg == "--scale") {
            places.resize(paths.size());
            places.back().push_back(*arg);
            places.back().push_back(*++arg);
            continue;
        }
        const auto option = values.find(*arg);
        const bool is_path = option == values.end() && (arg->size() < 2 || arg->front() != '-');
        (is_path ? paths : towards_light).push_back(*arg);
        if (*arg == "--no-fit") fits = false;
        if (*arg == "--light" || *arg == "--spot" || *arg == "--point") lamp = *arg;
        if (option != values.end()) towards_light.push_back(option->second = *++arg);
    }
    if (std::sscanf(values["--size"].c_str(), "%d%*[xX]%d", &view.width, &view.height) == 1) view.height = view.width;
    std::sscanf(values["--zoom"].c_str(), "%lf", &view.zoom);
    std::sscanf(values["--threads"].c_str(), "%d", &threads);
    double degrees = lamp == "--spot" ? 25 : 80;
    std::sscanf(values[lamp].c_str(), "%lf,%lf,%lf,%lf", &light.at.x, &light.at.y, &light.at.z, &degrees);
    if (lamp == "--point") light = {LightSource::point, light.at, degrees};
    if (lamp == "--spot")
        light = {values["--beam"] == "square" ? LightSource::square_spot : LightSource::round_spot, light.at, degrees};
    for (const auto& [option, v] : {std::pair("--eye", &view.eye), {"--center", &view.center}, {"--up", &view.up}})
        std::sscanf(values[option].c_str(), "%lf,%lf,%lf", &v->x, &v->y, &v->z);
    if (paths.empty()) paths.push_back(UMBRA_OBJ_DIR "/idol/idol.obj");
    for (const std::string& path : paths) models.emplace_back(path);
    const std::vector<Model> as_loaded = models;
    places.resize(paths.size());
    for (std::size_t i = 0; i < models.size(); i++) {
        vec3 at;
        double turned = 0, scale = 1;
        for (std::size_t k = 0; k < places[i].size(); k += 2) {
            const char* const text = places[i][k + 1].c_str();
            if (places[i][k] == "--at") std::sscanf(text, "%lf,%lf,%lf", &at.x, &at.y, &at.z);
            else std::sscanf(text, "%lf", places[i][k] == "--turn" ? &turned : &scale);
        }
        models[i].turn = rotation(view.up, turned);
        const mat4 place = translation(at) * models[i].turn;
        models[i].move([&](const vec3& v) { return (place * point(v * scale)).xyz(); });
    }
    const View usual;
    const bool has_up = !(view.up == usual.up);
    if (fits && fit(models, has_up ? view.eye - view.center : usual.eye, view.up) && lamp.empty())
        light = vec3{1, 1, 1};
    for (std::size_t i = 0; i < models.size(); i++) {
        const std::string name = "copy" + std::to_string(i) + ".obj";
        towards_light.push_back(folder.write(name, copy_of(as_loaded[i], models[i], light)));
        towards_light.insert(towards_light.end(), places[i].begin(), places[i].end());
        models[i].move([&](const vec3& v) { return v - view.center; });
    }
    if (light.kind != LightSource::far_off) light.at = light.at - view.center;
    view.eye = view.eye - view.center;
    view.center = {};
}

std::string PictureError::line() const {
    char text[300];
    std::snprintf(text, sizeof text,
                  "coverage %ld facing %ld falsely_dark %ld falsely_dark_percent %.4f falsely_lit %ld "
                  "falsely_lit_percent %.4f error_percent %.4f rmse %.4f", coverage, facing, falsely_dark,
                  percent(falsely_dark), falsely_lit, percent(falsely_lit), percent(), rmse);
    return text;
}

PictureError compare(const TruthImage& truth, const TGAImage& picture, const TGAImage& shadow, const TGAImage& exact) {
    for (const TGAImage* image : {&picture, &shadow, &exact})
        if (image->width() != truth.width || image->height() != truth.height)
            throw std::invalid_argument("picture and truth differ in size");
    PictureError error;
    double squares = 0;
    for (int y = 0; y < truth.height; y++)
        for (int x = 0; x < truth.width; x++) {
            const Truth t = truth.pixel[y * truth.width + x];
            const std::uint8_t *const p = picture.pixel(x, y), *const e = exact.pixel(x, y);
            const bool covered = p[0] || p[1] || p[2];  // every surface has an ambient 20
            if ((t != Truth::background) != covered) error.coverage++;
            else if (t == Truth::lit || t == Truth::shadowed) {
                const bool lit = *shadow.pixel(x, y) == 255;
                error.facing++;
                error.falsely_dark += t == Truth::lit && !lit;
                error.falsely_lit += t == Truth::shadowed && lit;
                for (int c = 0; c < 3; c++) squares += (p[c] - e[c]) * (p[c] - e[c]);
            }
        }
    if (error.facing) error.rmse = std::sqrt(squares / (3. * static_cast<double>(error.facing)));
    return error;
}

TGAImage Judge::draw(const Strings& arguments, const Strings& more) const {
    program_.run(joined(joined(arguments, more), {"--quiet"}));
    return TGAImage::read_tga_file(program_ / "framebuffer.tga");
}

PictureError Judge::error(const Strings& method) {
    const TGAImage picture = draw(joined(arguments_, method), {"--draw", "color"});
    if (!scene_) {
        scene_.emplace(arguments_, program_);
        truth_ = cast(RayCaster(scene_->models), scene_->view, scene_->light, scene_->threads);
        Strings exact = arguments_;
        for (const char* of_map : {"--bias", "--casters"})
            for (auto at = exact.end(); (at = std::find(exact.begin(), exact.end(), of_map)) != exact.end();)
                exact.erase(at, at + 2);
        exact_ = draw(exact, {"--shadow", "exact", "--draw", "color"});
    }
    // What shadows what does not depend on the normals. Where they all point to the light, no pixel is grey.
    return compare(truth_, picture, draw(joined(scene_->towards_light, method), {"--draw", "shadow"}), exact_);
}
