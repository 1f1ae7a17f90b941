// main.cpp: the lesson. The light's shader, the camera's shader, the two passes; the command line comes last.
// It reads top to bottom as the lesson does; what needs more than a sentence to explain lives in our_gl.
#include "geometry.h"
#include "model.h"
#include "our_gl.h"
#include "shadow_error.h"
#include "tgaimage.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <variant>
#include <vector>

struct Options {  // the lesson's scene
    std::vector<std::filesystem::path> models;
    std::filesystem::path out = ".";
    int width = 800, height = 800, shadow_size = 800;  // pixels
    vec3 eye{1, 1, 4}, center{0, 0, 0}, up{0, 1, 0};
    vec3 light{1, 1, 0};  // towards the light
    enum class Shadow { map, exact, off } shadow = Shadow::map;
    enum class Draw { color, shadow, normal } draw = Draw::color;
    std::optional<double> bias;  // the lesson's constant, a depth of screen_depth; without it the bias is derived
    bool fit = true, tangent = false, report = false, quiet = false;
    int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
};

// All coordinates are relative to opt.center: no matrix has to undo a large translation, which costs digits.
struct Scene {
    Options opt;
    std::vector<Model> models;
    Camera viewer;
};

// ---- pass 1: what the light sees ----

struct DepthShader final : IShader {  // only the depth is wanted, so there is no fragment()
    const Model& model;
    mat4 uniform_M;  // object to the camera's clip space

    DepthShader(const Model& m, const Camera& camera) : model(m), uniform_M(camera.object_to_clip()) {}
    vec4 vertex(int face, int corner) override { return uniform_M * point(model.vert(face, corner)); }
};

// ---- pass 2: what the viewer sees ----

// Is a fragment lit? Each method below is asked that. All of them know the fragment's face in the light's picture:
// the corners' places there are varyings like any other.
struct Receiver {
    mat4 uniform_Mshadow;        // object space to the light's screen
    vec3 varying_light[3] = {};  // the face's corners on the light's screen
    int number = 0;              // of the face among those of all models

    void vertex(int face_number, int corner, const vec3& v) {
        number = face_number;
        varying_light[corner] = project(uniform_Mshadow * point(v));
    }
    vec3 on_light_screen(const vec3& bar) const { return interpolated(varying_light, bar); }
    vec2 slope() const {  // of the depth, per texel along x and y
        const vec3 n = cross(varying_light[1] - varying_light[0], varying_light[2] - varying_light[0]);
        return {-n.x / n.z, -n.y / n.z};
    }
};

struct NoShadow {  // --shadow off
    void vertex(int, int, const vec3&) {}
    bool lit(const Fragment&) const { return true; }
};

// --bias N: the classic lesson's test. Its samples lie at the texels' corners (for that the viewport is shifted by half a
// texel) and the look-up is cut to an integer. What is nearer to the light by less than a constant casts no shadow.
struct ConstantBias : Receiver {
    static constexpr double shift = .5;
    const DepthBuffer* shadowbuffer;
    double bias;  // a depth, as in the buffer: of screen_depth

    bool lit(const Fragment& f) const {
        const vec3 p = on_light_screen(f.bar);
        return static_cast<double>(shadowbuffer->at(p.x - shift, p.y - shift)) <= p.z + bias;
    }
};

// --shadow map: the shadow buffer with a bias that follows from the slopes. The buffer knows depths at the centres of its
// texels only, so the fragment is compared with the texel whose centre is nearest; beside the buffer there is no caster.
struct ShadowMap : Receiver {
    static constexpr double shift = 0;
    const DepthBuffer* shadowbuffer;

    bool lit(const Fragment& f) const {
        const vec3 p = on_light_screen(f.bar);
        const auto depth = [&](int dx, int dy) { return static_cast<double>(shadowbuffer->at(p.x + dx, p.y + dy)); };
        // The receiver's own plane at the texel's centre: if nothing is above it there, the fragment is lit. So no face
        // shadows itself, at any angle. Rounding: depths are floats, and coverage is snapped by half a sub-texel.
        const double stored = depth(0, 0);
        const vec2 g = slope(), to_centre{std::floor(p.x) + .5 - p.x, std::floor(p.y) + .5 - p.y};
        const double rounding = depth_rounding + (std::fabs(g.x) + std::fabs(g.y)) / (2 << TriangleSetup::subpixel_bits);
        if (!(stored > p.z + dot(g, to_centre) + rounding)) return true;
        // Something is above it there; on its way here it may fall to the next texel's depth. Along each axis the neighbour
        // nearer in depth tells by how much (the other may be another surface); if both are lower, half of that.
        const auto fall = [&](double a, double b) {
            return std::min(std::fabs(stored - a), std::fabs(stored - b)) / (a < stored && b < stored ? 2 : 1);
        };
        return !(stored - fall(depth(-1, 0), depth(1, 0)) - fall(depth(0, -1), depth(0, 1)) > p.z + rounding);
    }
};

// --shadow exact: no buffer to resolve. The faces that may stand in the way are looked up and tested one by one.
struct ExactShadow : Receiver {
    const LightGrid* grid;
    bool lit(const Fragment& f) const { return !grid->shadows(on_light_screen(f.bar), number); }
};

enum class Normals { vertex, object, tangent };  // where the shading normal comes from: the vertices or a map

// Phong's reflection model, the lesson's weights, in eye coordinates. What the material has no map for is not computed.
template <Normals normals, class Shadow>
struct PhongShader final : IShader {
    const Model& model;
    const Material& material;
    Shadow shadow;
    int first_number;            // of the model's faces
    mat4 uniform_M, uniform_PM;  // object to eye, object to clip
    mat4 uniform_MIT;            // carries normals where uniform_M carries points
    vec3 uniform_l;              // towards the light, unit
    Options::Draw draw;

    vec2 varying_uv[3];
    vec3 varying_nrm[3];  // the vertices' normals
    vec3 varying_tri[3];  // the corners

    PhongShader(const Scene& scene, const Model& m, const Material& mat, const Shadow& s, int first)
        : model(m), material(mat), shadow(s), first_number(first), uniform_M(scene.viewer.ModelView),
          uniform_PM(scene.viewer.object_to_clip()), uniform_MIT(invert_transpose(linear_part(uniform_M)).value()),
          uniform_l(normalized((uniform_M * direction(normalized(scene.opt.light))).xyz())), draw(scene.opt.draw) {}

    vec4 vertex(int face, int corner) override {
        const vec3& v = model.vert(face, corner);
        shadow.vertex(first_number + face, corner, v);
        varying_uv[corner] = model.uv(face, corner);
        if constexpr (normals != Normals::object)
            varying_nrm[corner] = (uniform_MIT * direction(model.normal(face, corner))).xyz();
        if constexpr (normals == Normals::tangent) varying_tri[corner] = (uniform_M * point(v)).xyz();
        return uniform_PM * point(v);  // as in the depth pass, bit for bit: else a pixel on an edge may be left out
    }

    vec3 normal(const vec3& bar, const vec2& uv) const {  // unit, at this fragment
        if constexpr (normals == Normals::object)
            return normalized((uniform_MIT * direction(sample_normal(material.normal, uv))).xyz());
        const vec3 n = normalized(interpolated(varying_nrm, bar));
        if constexpr (normals == Normals::vertex) return n;
        // Darboux frame (i, j, n): i is the direction across n in which u grows, j that in which v grows. A mirrored
        // texture turns one of them round, so they are found one by one. No frame where uv do not span a plane.
        const vec3 e1 = varying_tri[1] - varying_tri[0], e2 = varying_tri[2] - varying_tri[0];
        const vec2 d1 = varying_uv[1] - varying_uv[0], d2 = varying_uv[2] - varying_uv[0];
        const vec3 a = cross(e2, n), b = cross(n, e1);
        const double side = dot(e1, a) < 0 ? -1 : 1;
        const vec3 i = normalized((a * d1.x + b * d2.x) * side), j = normalized((a * d1.y + b * d2.y) * side);
        const vec3 t = sample_normal(material.tangent, uv);
        return normalized(i * t.x + j * t.y + n * t.z);
    }

    TGAColor fragment(const Fragment& f) const override {
        const vec2 uv = interpolated(varying_uv, f.bar);
        const vec3 n = normal(f.bar, uv), l = uniform_l;
        const double n_l = dot(n, l);
        if (draw == Options::Draw::shadow) {  // grey: turned away from the light
            const std::uint8_t v = n_l > 0 ? shadow.lit(f) ? 255 : 0 : 128;
            return {{v, v, v, 255}};
        }
        if (draw == Options::Draw::normal) {  // [-1,1] to [0,255]; red is to the right, green up, blue towards the viewer
            TGAColor color{{0, 0, 0, 255}};
            for (int c = 0; c < 3; c++) color[2 - c] = static_cast<std::uint8_t>((n[c] * .5 + .5) * 255 + .5);
            return color;
        }
        double light = 0;
        if (n_l > 0) {  // else it has no light to lose, and no shadow is looked up
            light = 1.2 * n_l;
            if (!material.specular.empty()) {
                const vec3 r = n * (2 * n_l) - l;  // the light's mirror image; the viewer is far off at +z
                if (r.z > 0) light += .6 * power(r.z, *sample2D(material.specular, uv));
            }
            if (!shadow.lit(f)) light *= .3;
        }
        const std::uint8_t* const diffuse = material.diffuse.empty() ? nullptr : sample2D(material.diffuse, uv);
        const std::uint8_t* const glow = material.glow.empty() ? nullptr : sample2D(material.glow, uv);
        TGAColor color{{0, 0, 0, 255}};
        for (int c = 0; c < 3; c++) {
            const double albedo = (diffuse ? diffuse[c] : 255) * material.Kd[2 - c];
            color[c] = static_cast<std::uint8_t>(std::min(255., 20 + albedo * light + (glow ? glow[c] : 0)));
        }
        return color;
    }
};

// ---- the two passes ----

struct Picture {
    DepthBuffer shadowbuffer, zbuffer;
    FaceBuffer casters, faces;  // the nearest face in each of them (casters: only for a report)
    LightGrid grid;             // in place of the shadow buffer
    TGAImage framebuffer;
    Counters count;  // of pass 2
};

using AnyShadow = std::variant<NoShadow, ConstantBias, ShadowMap, ExactShadow>;

// The depth of all models as a camera sees them and, if asked for, the faces.
static Counters draw_depths(const Scene& scene, const Camera& camera, DepthBuffer& zbuffer, FaceBuffer* faces) {
    Counters count;
    for_each_model(scene.models, [&](const Model& model, int first) {
        count += draw_depth(model.nfaces(), DepthShader(model, camera), camera.Viewport, zbuffer, faces, first, scene.opt.threads);
    });
    return count;
}

// Pass 1: what the light sees. Its camera is fitted to the models; a constant bias needs the lesson's own camera.
static AnyShadow first_pass(const Scene& scene, Picture& picture) {
    const Options& opt = scene.opt;
    if (opt.shadow == Options::Shadow::off) return NoShadow{};
    const bool exact = opt.shadow == Options::Shadow::exact;
    const int size = exact ? LightGrid::good_cells(face_count(scene.models)) : opt.shadow_size;
    Camera light = fitted_camera(scene.models, opt.light, opt.up, size);
    if (opt.bias && !exact)
        light = {lookat(opt.light, {}, opt.up), projection(0), translation({.5, .5, 0}) * middle_viewport(size, size)};
    const Receiver receiver{light.object_to_screen()};
    if (exact) {
        picture.grid = LightGrid(scene.models, light, size);
        return ExactShadow{receiver, &picture.grid};
    }
    picture.shadowbuffer = DepthBuffer(size, size);
    if (opt.report) picture.casters = FaceBuffer(size, size);
    draw_depths(scene, light, picture.shadowbuffer, opt.report ? &picture.casters : nullptr);
    if (opt.bias) return ConstantBias{receiver, &picture.shadowbuffer, *opt.bias};
    return ShadowMap{receiver, &picture.shadowbuffer};
}

// The colours of what the viewer sees, each material of each model with the shader that it asks for.
template <class Shadow>
static long draw_colors(const Scene& scene, const Shadow& shadow, const FaceBuffer& faces, TGAImage& framebuffer) {
    long shaded = 0;
    const std::vector<char> seen = numbers_seen(faces, face_count(scene.models));
    for_each_model(scene.models, [&](const Model& model, int first) {
        for (const Model::Group& group : model.groups()) {
            const Material& material = model.materials()[static_cast<std::size_t>(group.material)];
            const auto draw = [&]<Normals normals>() {
                const PhongShader<normals, Shadow> shader(scene, model, material, shadow, first);
                shaded += draw_color(group.begin, group.end, shader, scene.viewer.Viewport, faces, seen, first,
                                     framebuffer, scene.opt.threads);
            };
            if (!material.normal.empty()) draw.template operator()<Normals::object>();
            else if (!material.tangent.empty()) draw.template operator()<Normals::tangent>();
            else draw.template operator()<Normals::vertex>();
        }
    });
    return shaded;
}

// Pass 2: what the viewer sees: first which face, then its colour; each fragment asks whether the light sees it too.
static void second_pass(const Scene& scene, const AnyShadow& any, Picture& p) {
    p.zbuffer = DepthBuffer(scene.opt.width, scene.opt.height);
    p.faces = FaceBuffer(scene.opt.width, scene.opt.height);
    p.framebuffer = TGAImage(scene.opt.width, scene.opt.height, TGAImage::RGB);
    p.count = draw_depths(scene, scene.viewer, p.zbuffer, &p.faces);
    const auto draw = [&](const auto& shadow) { return draw_colors(scene, shadow, p.faces, p.framebuffer); };
    p.count.shaded = std::visit(draw, any);
}

// How far the picture is from the truth: from the same pass with the shadows that a ray caster finds.
static std::string report(const Scene& scene, const AnyShadow& any, const Picture& p) {
    const View view{scene.opt.eye - scene.opt.center, {}, scene.opt.up, scene.opt.width, scene.opt.height};
    const TruthImage truth = cast(RayCaster(scene.models), view, scene.opt.light, scene.opt.threads);
    TGAImage exact(view.width, view.height, TGAImage::RGB);
    draw_colors(scene, TrueShadow{truth}, p.faces, exact);
    const auto ask = [&](const auto& shadow) { return verdicts_of(scene.models, scene.viewer, shadow, p.faces, p.casters); };
    return report_line(truth, p.faces, std::visit(ask, any), p.framebuffer, exact);
}

// ---- the command line ----

static constexpr const char* usage_text = R"(usage: umbra [options] [model.obj ...]

Draws the models, lit and with hard shadows, into framebuffer.tga, and what the light sees into depth.tga.
Several models share one scene. Without a model: the idol.

  -o DIR             folder of the two pictures (.)
  --size WxH         the picture's pixels (800x800)
  --shadow-size N    the shadow buffer's pixels a side (800)
  --eye X,Y,Z        the viewer (1,1,4)
  --center X,Y,Z     what the viewer looks at (0,0,0)
  --up X,Y,Z         what appears upwards (0,1,0)
  --light X,Y,Z      direction towards the light (1,1,0)
  --shadow HOW       map: a shadow buffer, drawn as depth.tga; exact: the faces themselves; off (map)
  --bias N           with map: the lesson's buffer, its camera, a constant bias of N of 2000 (there 43.34)
  --draw WHAT        color; shadow: white lit, black in shadow, grey turned away from the light; normal (color)
  --tangent          prefer a tangent-space normal map to an object-space one
  --no-fit           keep a model's own coordinates (default: fit what is beyond [-1,1]^3 or too small to see)
  --threads N        (all processors)
  --report           print how far the shadows and the picture are from the truth
  --quiet            print errors only, and a report that is asked for
  --help, --version
)";

static Options parse(int argc, char** argv) {
    Options opt;
    char rest;  // what follows the last number, which nothing should
    for (int i = 1; i < argc; i++) {
        const std::string arg = argv[i];
        const auto fail = [&](const std::string& wanted) { throw std::invalid_argument(arg + ": \"" + argv[i] + "\" is not " + wanted); };
        const auto value = [&] {
            if (++i == argc) throw std::invalid_argument(arg + ": a value is missing");
            return argv[i];
        };
        const auto integer = [&](int& n, int most) {
            if (std::sscanf(value(), "%5d%c", &n, &rest) != 1 || n < 1 || n > most) fail("1 to " + std::to_string(most));
        };
        const auto vector = [&](vec3& v) {
            if (std::sscanf(value(), "%lf,%lf,%lf%c", &v.x, &v.y, &v.z, &rest) != 3 || !(norm(v) <= 1e307))
                fail("three numbers X,Y,Z, a length of at most 1e307");
        };
        if (arg == "--help") std::exit(std::fputs(usage_text, stdout) < 0 || std::fflush(stdout));
        else if (arg == "--version") std::exit(std::puts("umbra " UMBRA_VERSION) < 0 || std::fflush(stdout));
        else if (arg == "-o") opt.out = value();
        else if (arg == "--size") {
            int &w = opt.width, &h = opt.height;
            if (std::sscanf(value(), "%5dx%5d%c", &w, &h, &rest) != 2 || w < 1 || w > max_size || h < 1 || h > max_size)
                fail("WxH, each 1 to " + std::to_string(max_size));
        } else if (arg == "--shadow-size") integer(opt.shadow_size, max_size);
        else if (arg == "--eye") vector(opt.eye);
        else if (arg == "--center") vector(opt.center);
        else if (arg == "--up") vector(opt.up);
        else if (arg == "--light") vector(opt.light);
        else if (arg == "--bias") {
            if (std::sscanf(value(), "%lf%c", &opt.bias.emplace(), &rest) != 1 || !std::isfinite(*opt.bias)) fail("a number");
        } else if (arg == "--shadow") {
            const std::string how = value();
            if (how == "map") opt.shadow = Options::Shadow::map;
            else if (how == "exact") opt.shadow = Options::Shadow::exact;
            else if (how == "off") opt.shadow = Options::Shadow::off;
            else fail("map, exact or off");
        } else if (arg == "--draw") {
            const std::string what = value();
            if (what == "color") opt.draw = Options::Draw::color;
            else if (what == "shadow") opt.draw = Options::Draw::shadow;
            else if (what == "normal") opt.draw = Options::Draw::normal;
            else fail("color, shadow or normal");
        } else if (arg == "--no-fit") opt.fit = false;
        else if (arg == "--tangent") opt.tangent = true;
        else if (arg == "--threads") integer(opt.threads, 256);
        else if (arg == "--report") opt.report = true;
        else if (arg == "--quiet") opt.quiet = true;
        else if (arg.size() > 1 && arg[0] == '-') throw std::invalid_argument("unknown option " + arg);
        else opt.models.push_back(arg);
    }
    if (opt.eye == opt.center) throw std::invalid_argument("--eye and --center are the same point");
    if (opt.light == vec3{}) throw std::invalid_argument("--light has no direction");
    if (opt.models.empty()) opt.models.push_back(UMBRA_OBJ_DIR "/idol/idol.obj");
    return opt;
}

// One line on standard error, whatever a name on the command line is made of; returns the status.
static int complain(std::string what, int status) {
    std::replace_if(what.begin(), what.end(), [](unsigned char c) { return c < ' ' || c == 127; }, '?');
    std::fprintf(stderr, "umbra: %s\n", what.c_str());
    return status;
}

static std::vector<Model> load(const Options& opt) {
    std::vector<Model> models;
    for (const auto& path : opt.models) {
        Model& model = models.emplace_back(path, opt.tangent ? NormalMap::tangent : NormalMap::object);
        if (opt.fit) model.fit();
        model.move(-opt.center);
        for (const std::string& note : model.notes())
            if (!opt.quiet) complain(path.string() + ": " + note, 0);
    }
    return models;
}

static double milliseconds() {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int main(int argc, char** argv) try {
    const Options opt = parse(argc, argv);
    const double start = milliseconds();
    const vec3 eye = opt.eye - opt.center;
    const Scene scene{opt, load(opt), {lookat(eye, {}, opt.up), projection(-1 / norm(eye)), middle_viewport(opt.width, opt.height)}};
    const double loaded = milliseconds();
    Picture picture;
    const AnyShadow shadow = first_pass(scene, picture);
    const double lit = milliseconds();
    second_pass(scene, shadow, picture);
    const double shaded = milliseconds();
    if (opt.report) std::puts(report(scene, shadow, picture).c_str());
    const double reported = milliseconds();
    std::vector<TGAFile> files;  // both or, where one does not fit on the disk, none
    if (picture.shadowbuffer.width()) files.emplace_back(depth_picture(picture.shadowbuffer), opt.out / "depth.tga");
    files.emplace_back(picture.framebuffer, opt.out / "framebuffer.tga");
    for (TGAFile& file : files) file.commit();
    const double written = milliseconds();
    std::string left_out = missing_maps(scene.models);
    if (opt.shadow == Options::Shadow::off) left_out += left_out.empty() ? "shadow" : ",shadow";
    const Counters& c = picture.count;  // a visible pixel is shaded exactly once
    if (!opt.quiet)
        std::printf("triangles %ld pixels %ld fragments %ld load_ms %.3f depth_ms %.3f shade_ms %.3f write_ms %.3f shadow_bytes %zu "
                    "outside %ld between_samples %ld hidden %ld left_out %s\n", c.triangles, c.shaded, c.shaded, loaded - start,
                    lit - loaded, shaded - lit, written - reported, picture.shadowbuffer.bytes() + picture.grid.bytes(), c.outside,
                    c.between_samples, c.covered - c.shaded, left_out.empty() ? "-" : left_out.c_str());
    if (std::fflush(stdout) || std::ferror(stdout)) throw std::runtime_error("standard output: cannot write");
} catch (const std::exception& e) {
    const bool usage = dynamic_cast<const std::invalid_argument*>(&e);
    return complain(std::string(e.what()) + (usage ? " (umbra --help lists the options)" : ""), usage ? 2 : 1);
}
