// main.cpp: the lesson. The light's shader, the camera's shader, the two passes; the command line comes last.
// It reads top to bottom as the lesson does; what needs more than a sentence to explain lives in our_gl.
#include "geometry.h"
#include "model.h"
#include "our_gl.h"
#include "tgaimage.h"

#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

struct Options {  // the lesson's scene
    std::vector<std::filesystem::path> models;
    std::filesystem::path out = ".";
    int width = 800, height = 800, shadow_size = 800;  // pixels
    vec3 eye{1, 1, 4}, center{0, 0, 0}, up{0, 1, 0};
    vec3 light{1, 1, 0};  // towards the light
    double bias = 43.34;  // of screen_depth
    bool shadow = true, fit = true, tangent = false, quiet = false;
    int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
};

// ---- pass 1: what the light sees ----

// Only the depth is wanted, so there is no fragment().
struct DepthShader final : IShader {
    const Model& model;
    mat4 uniform_M;  // object to the light's clip space

    DepthShader(const Model& m, const Camera& light) : model(m), uniform_M(light.object_to_clip()) {}
    vec4 vertex(int face, int corner) override { return uniform_M * point(model.vert(face, corner)); }
};

// ---- pass 2: what the viewer sees ----

// Is a fragment lit? Find it in the shadow buffer: if the light saw something nearer there, it is not.
struct Shadow {
    const DepthBuffer* shadowbuffer;  // null: everything is lit
    mat4 uniform_Mshadow;             // the viewer's screen to the light's screen
    double bias;                      // in units of screen_depth

    bool lit(const vec3& screen) const {
        if (!shadowbuffer) return true;
        const vec3 p = project(uniform_Mshadow * point(screen));
        const int x = static_cast<int>(std::floor(p.x)), y = static_cast<int>(std::floor(p.y));
        return !shadowbuffer->inside(x, y) || static_cast<double>(shadowbuffer->row(y)[x]) <= p.z + bias;
    }
};

enum class Normals { vertex, object, tangent };  // where the shading normal comes from: the vertices or a map

// Phong's reflection model, shadowed. Everything is in eye coordinates. What the material has no map for is not computed.
template <Normals normals>
struct PhongShader final : IShader {
    const Model& model;
    const Material& material;
    Shadow shadow;
    mat4 uniform_M, uniform_P;  // object to eye, eye to clip
    mat4 uniform_MIT;           // carries normals where uniform_M carries points
    vec3 uniform_l;             // towards the light, unit

    vec2 varying_uv[3];
    vec3 varying_nrm[3];  // the vertices' normals
    vec3 varying_tri[3];  // the corners

    PhongShader(const Model& m, const Material& mat, const Camera& camera, const vec3& light, const Shadow& s)
        : model(m), material(mat), shadow(s), uniform_M(camera.ModelView), uniform_P(camera.Projection),
          uniform_MIT(invert_transpose(camera.ModelView).value()),
          uniform_l(normalized((camera.ModelView * direction(light)).xyz())) {}

    vec4 vertex(int face, int corner) override {
        const vec4 eye = uniform_M * point(model.vert(face, corner));
        varying_uv[corner] = model.uv(face, corner);
        if constexpr (normals != Normals::object)
            varying_nrm[corner] = (uniform_MIT * direction(model.normal(face, corner))).xyz();
        if constexpr (normals == Normals::tangent) varying_tri[corner] = eye.xyz();
        return uniform_P * eye;
    }

    template <class T>
    static T interpolated(const T (&varying)[3], const vec3& bar) {
        return varying[0] * bar.x + varying[1] * bar.y + varying[2] * bar.z;
    }

    static vec3 texel_to_vector(const std::uint8_t* bgr) {  // [0,255] to [-1,1]
        return vec3{bgr[2] * 2 / 255. - 1, bgr[1] * 2 / 255. - 1, bgr[0] * 2 / 255. - 1};
    }

    vec3 normal(const vec3& bar, const vec2& uv) const {  // unit, at this fragment
        if constexpr (normals == Normals::object)
            return normalized((uniform_MIT * direction(texel_to_vector(sample2D(material.normal, uv)))).xyz());
        const vec3 n = normalized(interpolated(varying_nrm, bar));
        if constexpr (normals == Normals::vertex) return n;
        // Darboux frame (i, j, n): i is the direction across n in which u grows, j that in which v grows. A mirrored
        // texture turns one of them round, so they are found one by one. No frame where uv do not span a plane.
        const vec3 e1 = varying_tri[1] - varying_tri[0], e2 = varying_tri[2] - varying_tri[0];
        const vec2 d1 = varying_uv[1] - varying_uv[0], d2 = varying_uv[2] - varying_uv[0];
        const vec3 a = cross(e2, n), b = cross(n, e1);
        const double side = dot(e1, a) < 0 ? -1 : 1;
        const vec3 i = normalized((a * d1.x + b * d2.x) * side), j = normalized((a * d1.y + b * d2.y) * side);
        const vec3 t = texel_to_vector(sample2D(material.tangent, uv));
        return normalized(i * t.x + j * t.y + n * t.z);
    }

    TGAColor fragment(const Fragment& f) const override {
        const vec2 uv = interpolated(varying_uv, f.bar);
        const vec3 n = normal(f.bar, uv), l = uniform_l;
        const double n_l = dot(n, l);
        double light = 0;
        if (n_l > 0) {  // else it has no light to lose, and no shadow is looked up
            light = 1.2 * n_l;
            if (!material.specular.empty()) {
                const vec3 r = n * (2 * n_l) - l;  // the light's mirror image; the viewer is at +z
                if (r.z > 0) light += .6 * power(r.z, *sample2D(material.specular, uv));
            }
            if (!shadow.lit(f.screen)) light *= .3;
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
    TGAImage framebuffer;
    Counters depth_pass, shading_pass;
    double depth_ms = 0, shade_ms = 0;
};

static double milliseconds() {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Calls visit(model, number of its first face) for one model after the other.
template <class Visit>
static void for_each_model(const std::vector<Model>& models, Visit&& visit) {
    int first = 0;
    for (const Model& model : models) visit(model, first), first += model.nfaces();
}

// What is nearest to a camera: the depth and, if wanted, the number of the face.
static Counters draw_depths(const std::vector<Model>& models, const Camera& camera, DepthBuffer& zbuffer, FaceBuffer* faces, int threads) {
    Counters count;
    for_each_model(models, [&](const Model& model, int first) {
        count += draw_depth(model.nfaces(), DepthShader(model, camera), camera.Viewport, zbuffer, faces, first, threads);
    });
    return count;
}

// The colour of what the viewer sees, with the shader that each material asks for. Returns the fragments shaded.
static long draw_colors(const std::vector<Model>& models, const Camera& viewer, const vec3& light, const Shadow& shadow,
                        const FaceBuffer& faces, TGAImage& framebuffer, int threads) {
    long shaded = 0;
    const std::vector<char> seen = numbers_seen(faces, face_count(models));
    for_each_model(models, [&](const Model& model, int first) {
        for (const Model::Group& group : model.groups()) {
            const Material& material = model.materials()[static_cast<std::size_t>(group.material)];
            const auto draw = [&]<Normals normals>() {
                const PhongShader<normals> shader(model, material, viewer, light, shadow);
                shaded += draw_color(group.begin, group.end, shader, viewer.Viewport, faces, seen, first, framebuffer, threads);
            };
            if (!material.normal.empty()) draw.template operator()<Normals::object>();
            else if (!material.tangent.empty()) draw.template operator()<Normals::tangent>();
            else draw.template operator()<Normals::vertex>();
        }
    });
    return shaded;
}

static Picture render(const std::vector<Model>& models, const Options& opt) {
    Picture picture;
    const Camera light{lookat(opt.center + opt.light, opt.center, opt.up), projection(0),
                       middle_viewport(opt.shadow_size, opt.shadow_size)};
    const Camera viewer{lookat(opt.eye, opt.center, opt.up), projection(-1 / norm(opt.eye - opt.center)),
                        middle_viewport(opt.width, opt.height)};

    // Pass 1: the depth of the models as the light sees them.
    const double start = milliseconds();
    if (opt.shadow) {
        picture.shadowbuffer = DepthBuffer(opt.shadow_size, opt.shadow_size);
        picture.depth_pass = draw_depths(models, light, picture.shadowbuffer, nullptr, opt.threads);
    }
    const double middle = milliseconds();

    // Pass 2: the models as the viewer sees them. First what is nearest, then the colour of that alone, each fragment
    // looked up in the light's picture.
    const mat4 Mshadow = light.object_to_screen() * invert(viewer.object_to_screen()).value();
    const Shadow shadow{opt.shadow ? &picture.shadowbuffer : nullptr, Mshadow, opt.bias};
    picture.zbuffer = DepthBuffer(opt.width, opt.height);
    picture.framebuffer = TGAImage(opt.width, opt.height, TGAImage::RGB);
    FaceBuffer faces(opt.width, opt.height);
    picture.shading_pass = draw_depths(models, viewer, picture.zbuffer, &faces, opt.threads);
    picture.shading_pass.shaded = draw_colors(models, viewer, opt.light, shadow, faces, picture.framebuffer, opt.threads);
    picture.depth_ms = middle - start;
    picture.shade_ms = milliseconds() - middle;
    return picture;
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
  --shadow map|off   how shadows are found (map)
  --bias N           shadow bias in units of the depth range 2000 (43.34)
  --tangent          prefer a tangent-space normal map to an object-space one
  --no-fit           keep a model's own coordinates (default: fit what exceeds [-1,1]^3)
  --threads N        (all processors)
  --quiet            print nothing but errors
  --help, --version
)";

struct UsageError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// The whole of text as a number; what says which option it belongs to.
template <class T>
static T number(std::string_view text, const std::string& what) {
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(static_cast<double>(value)))
        throw UsageError(what + ": \"" + std::string(text) + "\" is not a number");
    return value;
}

static int size_within(std::string_view text, const std::string& what, int most) {
    const int value = number<int>(text, what);
    if (value < 1 || value > most) throw UsageError(what + ": " + std::string(text) + " is not in 1 to " + std::to_string(most));
    return value;
}

static vec3 vector(std::string_view text, const std::string& what) {
    vec3 v;
    for (int i = 0; i < 3; i++) {
        const std::size_t comma = text.find(',');
        if ((comma == text.npos) != (i == 2)) throw UsageError(what + ": three numbers x,y,z");
        v[i] = number<double>(text.substr(0, comma), what);
        text.remove_prefix(comma == text.npos ? text.size() : comma + 1);
    }
    return v;
}

static Options parse(int argc, char** argv) {
    Options opt;
    for (int i = 1; i < argc; i++) {
        const std::string arg = argv[i];
        const auto value = [&]() -> std::string {
            if (++i == argc) throw UsageError(arg + ": a value is missing");
            return argv[i];
        };
        if (arg == "-o") opt.out = value();
        else if (arg == "--size") {
            const std::string size = value();
            const std::size_t x = size.find('x');
            if (x == size.npos) throw UsageError(arg + ": \"" + size + "\" is not WxH");
            opt.width = size_within(size.substr(0, x), arg, max_size);
            opt.height = size_within(size.substr(x + 1), arg, max_size);
        } else if (arg == "--shadow-size") opt.shadow_size = size_within(value(), arg, max_size);
        else if (arg == "--eye") opt.eye = vector(value(), arg);
        else if (arg == "--center") opt.center = vector(value(), arg);
        else if (arg == "--up") opt.up = vector(value(), arg);
        else if (arg == "--light") opt.light = vector(value(), arg);
        else if (arg == "--bias") opt.bias = number<double>(value(), arg);
        else if (arg == "--shadow") {
            const std::string how = value();
            if (how != "map" && how != "off") throw UsageError(arg + ": \"" + how + "\" is neither map nor off");
            opt.shadow = how == "map";
        } else if (arg == "--no-fit") opt.fit = false;
        else if (arg == "--tangent") opt.tangent = true;
        else if (arg == "--threads") opt.threads = size_within(value(), arg, 256);
        else if (arg == "--quiet") opt.quiet = true;
        else if (arg.size() > 1 && arg[0] == '-') throw UsageError("unknown option " + arg);
        else opt.models.push_back(arg);
    }
    if (opt.eye == opt.center) throw UsageError("--eye and --center are the same point");
    if (opt.light == vec3{}) throw UsageError("--light: a direction of length zero");
    if (opt.models.empty()) opt.models.push_back(UMBRA_OBJ_DIR "/idol/idol.obj");
    return opt;
}

static std::vector<Model> load(const Options& opt) {
    std::vector<Model> models;
    for (const auto& path : opt.models) {
        models.emplace_back(path, opt.tangent ? NormalMap::tangent : NormalMap::object);
        std::vector<std::string> notes = models.back().notes();
        if (opt.fit && models.back().fit()) notes.push_back("fitted to [-1,1]^3");
        if (!opt.quiet)
            for (const std::string& note : notes) std::cerr << "umbra: " << path.string() << ": " << note << '\n';
    }
    return models;
}

// One line of name value pairs.
static void summarize(const std::vector<Model>& models, const Options& opt, const Picture& p, double load_ms, double write_ms) {
    std::set<std::string> left_out{"diffuse", "normal_map", "specular", "glow"};
    for (const Model& model : models) {
        for (const Material& m : model.materials()) {
            if (!m.diffuse.empty()) left_out.erase("diffuse");
            if (!m.normal.empty() || !m.tangent.empty()) left_out.erase("normal_map");
            if (!m.specular.empty()) left_out.erase("specular");
            if (!m.glow.empty()) left_out.erase("glow");
        }
    }
    if (!opt.shadow) left_out.insert("shadow");
    std::string names;
    for (const std::string& name : left_out) names += (names.empty() ? "" : ",") + name;

    long pixels = 0;
    for (int y = 0; y < p.zbuffer.height(); y++)
        pixels += std::count_if(p.zbuffer.row(y), p.zbuffer.row(y) + p.zbuffer.width(), [](float z) { return std::isfinite(z); });
    const Counters& c = p.shading_pass;
    std::printf("triangles %ld pixels %ld fragments %ld load_ms %.3f depth_ms %.3f shade_ms %.3f write_ms %.3f "
                "outside %ld between_samples %ld hidden %ld left_out %s\n",
                c.triangles, pixels, c.shaded, load_ms, p.depth_ms, p.shade_ms, write_ms, c.outside, c.between_samples,
                c.covered - c.shaded, names.empty() ? "-" : names.c_str());
}

int main(int argc, char** argv) try {
    for (int i = 1; i < argc; i++) {
        if (!std::strcmp(argv[i], "--help")) return std::fputs(usage_text, stdout) < 0;
        if (!std::strcmp(argv[i], "--version")) return std::puts("umbra " UMBRA_VERSION) < 0;
    }
    const Options opt = parse(argc, argv);

    const double start = milliseconds();
    const std::vector<Model> models = load(opt);
    const double loaded = milliseconds();
    const Picture picture = render(models, opt);
    const double rendered = milliseconds();
    if (opt.shadow) depth_picture(picture.shadowbuffer).write_tga_file(opt.out / "depth.tga");
    picture.framebuffer.write_tga_file(opt.out / "framebuffer.tga");
    if (!opt.quiet) summarize(models, opt, picture, loaded - start, milliseconds() - rendered);
    return 0;
} catch (const UsageError& e) {
    std::cerr << "umbra: " << e.what() << " (umbra --help lists the options)\n";
    return 2;
} catch (const std::exception& e) {
    std::cerr << "umbra: " << e.what() << '\n';
    return 1;
}
