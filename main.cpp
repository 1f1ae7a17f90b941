// main.cpp: the lesson. The light's shader, the camera's shader, the two passes; then the program around them.
// It reads from top to bottom as the lesson does; what needs more than a sentence to explain stands in our_gl.
#include "geometry.h"
#include "model.h"
#include "our_gl.h"
#include "tgaimage.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

struct Options {  // the lesson's scene; the command line can change each of these
    int width = 800, height = 800;  // of the picture, in pixels
    int shadow_size = 800;          // of the shadow buffer, in pixels a side
    enum class Light { far, spot, point } light = Light::far;
    vec3 light_dir{1, 1, 0};  // from center towards the light; a spot or point light stands at its end
    double half_angle = 0;    // of a spot light's beam, or of what a point light's shadow buffer sees; in degrees
    bool square_beam = false;
    vec3 eye{1, 1, 4}, center{0, 0, 0}, up{0, 1, 0};
    double zoom = 1;  // about the middle of the picture
    enum class Method { map, exact, off } method = Method::map;  // of shadows
    Faces caster_faces = Faces::all;  // those drawn into the shadow buffer
    std::optional<double> bias;  // the classic lesson's, in units of depth, of 2000; without it the bias is derived
    enum class Draw { color, shadow, normal } draw = Draw::color;
};

// ---- pass 1: what the light sees ----

// A light is a camera. One that is infinitely far off has no perspective; what another reaches comes to [-1,1]^2. The
// direction serves as a place, since center is the origin by now: arrange() has moved the scene.
static Camera light_camera(const Options& opt) {
    return {lookat(opt.light_dir, opt.center, opt.up),
            opt.light == Options::Light::far ? projection(0) : beam(norm(opt.light_dir), opt.half_angle)};
}

struct DepthShader final : IShader {  // only the z-buffer is wanted: there is no fragment()
    mat4 uniform_PM;  // Projection*ModelView

    DepthShader(const Model& m, const Camera& camera) : IShader(m), uniform_PM(camera.to_clip()) {}

    vec4 vertex(int vert) const override {
        // The vertex of the .obj, taken to clip space: draw() applies the Viewport and divides by w.
        return uniform_PM * point(model.vert(vert));
    }
};

struct Shadow {  // what the first pass leaves for the second
    Options::Method method = Options::Method::off;  // off, too, where nothing can throw a shadow onto what is seen
    mat4 M = mat4::identity();  // Viewport*Projection*ModelView of the light: from object space to its screen
    double aspect = 1;          // of a texel: how much wider it is than high
    DepthBuffer shadowbuffer;   // what is nearest to the light there ...
    LightGrid grid;             // ... or, for exact shadows, all faces
};

// ---- pass 2: what the viewer sees ----

// Phong's reflection model with the classic lesson's weights, in eye coordinates. What a material has no map for is not
// computed. fragment() is called for a few neighbouring pixels of a face at once: a coord says where each of them is, a
// real how bright, a mask yes or no; select() is the ?: of a mask.
struct PhongShader final : IShader {
    const Options& opt;
    const Shadow& shadow;
    mat4 uniform_M;            // ModelView
    mat4 uniform_PM;           // Projection*ModelView
    mat4 uniform_MIT;          // ModelView.invert_transpose(), carries normals where ModelView carries points
    mat4 uniform_Mshadow;      // from the viewer's screen to the shadow buffer's
    mat4 uniform_Mbeam;        // from the viewer's screen to the light's clip space
    vec3 uniform_light;        // light vector: towards the light, of length 1; or the place of a spot or point light
    int grid_face;             // the number of the model's first face in the grid of exact shadows
    const Material* material;  // the face's: written by varying(), read by fragment(), as what follows
    vec2 varying_uv[3];        // texture coordinates of a triangle
    vec3 varying_nrm[3];       // normals of the vertices
    vec3 varying_color[3];     // colours of the vertices, red first
    vec3 varying_eye[3];       // the triangle in eye coordinates
    vec4 varying_sb[3];        // the triangle on the light's screen, homogeneous: for the slope, and for exact shadows
    vec2 sb_slope;             // of its depth there, for the bias

    PhongShader(const Options& o, const Shadow& s, const Camera& camera, const Model& m)
        : IShader(m), opt(o), shadow(s), uniform_M(camera.ModelView), uniform_PM(camera.to_clip()),
          uniform_MIT(invert_transpose(uniform_M * m.turn).value()),
          uniform_Mshadow(shadow.M * camera.from_screen()),  // M*(Viewport*Projection*ModelView).invert()
          uniform_Mbeam(light_camera(o).to_clip() * camera.from_screen()),
          uniform_light(o.light == Options::Light::far
                            ? normalized((uniform_M * direction(normalized(o.light_dir))).xyz())
                            : (uniform_M * point(o.light_dir)).xyz()),
          grid_face(shadow.grid.first_face(m)) {}

    vec4 vertex(int vert) const override { return uniform_PM * point(model.vert(vert)); }

    void varying(int iface, int nthvert) override {
        const vec3& v = model.vert(iface, nthvert);
        material = &model.material(iface);
        varying_uv[nthvert] = model.uv(iface, nthvert);
        if (shadow.method != Options::Method::off) varying_sb[nthvert] = shadow.M * point(v);
        if (nthvert == 2 && shadow.method == Options::Method::map) sb_slope = depth_slope(varying_sb);
        if (!material->normal)
            varying_nrm[nthvert] = (uniform_MIT * direction(model.normal(iface, nthvert))).xyz();
        if (model.has_colors()) varying_color[nthvert] = model.color(iface, nthvert);
        if (material->tangent || opt.light != Options::Light::far)
            varying_eye[nthvert] = (uniform_M * point(v)).xyz();
    }

    Color fragment(const Fragment& f) const override {
        const UV uv = interpolated(varying_uv, f.bar);
        Color surface = material->diffuse ? Texels(material->diffuse, uv).bgr() : Color{255, 255, 255};
        if (model.has_colors()) surface = reflected(surface, bgr(to_real(interpolated(varying_color, f.bar))));
        surface = reflected(surface, bgr(material->Kd));
        const vec<3, real> n = normal(uv, f), l = light_vector(f);
        const real diff = select(in_beam(f), max(0, dot(n, l)), 0);
        const mask facing = diff > 0;  // what is turned away has no light to lose: no shadow, no highlight
        const mask lit = any(facing) ? in_light(f) : false;
        real spec = 0;
        if (any(facing) && material->specular) {
            const vec<3, real> r = n * (2 * dot(n, l)) - l;  // reflected light; the viewer is far off at +z
            spec = select(facing & (r.z > 0), power(r.z, Texels(material->specular, uv)[0]), 0);
        }
        const real shadow_factor = .3 + .7 * select(lit, 1, 0);
        const Color glow = material->glow ? Texels(material->glow, uv).bgr() : bgr(material->Ke * 255);
        Color c = Color{20, 20, 20} + surface * ((1.2 * diff + .6 * spec) * shadow_factor) + glow;

        // --draw: when something is wrong, these are the first two things to look at.
        if (opt.draw == Options::Draw::shadow) c = Color{1, 1, 1} * select(facing, select(lit, 255, 0), 128);
        if (opt.draw == Options::Draw::normal) c = bgr(n) * 127.5 + Color{128, 128, 128};
        return c;
    }

    vec<3, real> light_vector(const Fragment& f) const {  // towards the light, of length 1
        if (opt.light == Options::Light::far) return {uniform_light.x, uniform_light.y, uniform_light.z};
        return to_real(normalized(uniform_light - interpolated(varying_eye, f.bar)));
    }

    mask in_beam(const Fragment& f) const {  // of a spot light; the others have none
        if (opt.light != Options::Light::spot) return true;
        const vec<4, coord> p = uniform_Mbeam * point(f.screen);
        return (p.w > 0) & (opt.square_beam ? max(abs(p.x), abs(p.y)) < p.w : p.x * p.x + p.y * p.y < p.w * p.w);
    }

    mask in_light(const Fragment& f) const {
        if (shadow.method == Options::Method::off) return true;
        const bool exact = shadow.method == Options::Method::exact;
        const vec<4, coord> sb_h = exact ? interpolated(varying_sb, f.bar) : uniform_Mshadow * point(f.screen);
        const vec<3, coord> sb_p = project(sb_h);  // the point in the shadow buffer
        const mask is_behind = !(sb_h.w > 0);      // a point light: what its buffer does not see is lit
        if (exact) return is_behind | !shadow.grid.shadows(sb_p, grid_face + f.face);
        const coord stored = shadow.shadowbuffer.at(sb_p);
        // With --bias 0 surfaces shadow themselves here and there: z-fighting. The classic cure is --bias 43.34.
        const coord bias = opt.bias ? *opt.bias : derived_bias(shadow.shadowbuffer, sb_p, stored, sb_slope);
        return is_behind | !(stored > sb_p.z + bias);  // so written because nothing but a number shadows
    }

    vec<3, real> normal(const UV& uv, const Fragment& f) const {  // of length 1
        if (material->normal)
            return normalized((uniform_MIT * direction(Texels(material->normal, uv).normal())).xyz());
        vec<3, real> n = normalized(to_real(interpolated(varying_nrm, f.bar)));
        if (!f.front_facing && model.has_made_normals(f.face)) n = -n;  // faces may wind either way round
        if (!material->tangent) return n;
        // Darboux frame (i, j, n): i is the direction across n in which u grows, at a right angle to the one along the
        // face in which u stays the same; j that of v. Found one by one, because a mirrored texture turns one of them
        // round. No frame where uv do not span a plane. Half edges do: whole ones may be too long for a double.
        const vec3 e1 = varying_eye[1] * .5 - varying_eye[0] * .5, e2 = varying_eye[2] * .5 - varying_eye[0] * .5;
        const vec2 uv1 = varying_uv[1] - varying_uv[0], uv2 = varying_uv[2] - varying_uv[0];
        const vec2 du = normalized(vec2{uv1.x, uv2.x} * material->tangent.scale.x);
        const vec2 dv = normalized(vec2{uv1.y, uv2.y} * material->tangent.scale.y);
        const real side = select(dot(cross(normalized(e1), normalized(e2)), n) < 0, -1, 1);  // of the face that n is on
        const vec<3, real> i = normalized(cross(normalized(e2 * du.x - e1 * du.y), n)) * side;
        const vec<3, real> j = normalized(cross(normalized(e2 * dv.x - e1 * dv.y), n)) * side;
        const vec<3, real> t = Texels(material->tangent, uv).normal();
        return normalized(i * t.x + j * t.y + n * t.z);
    }
};

// ---- the two passes ----

static Camera viewer(const Options& opt) {
    return {lookat(opt.eye, opt.center, opt.up), projection(-1 / norm(opt.eye - opt.center)),
            middle_viewport(opt.width, opt.height, opt.zoom)};
}

// Rendering the shadow buffer: the camera stands at the light. It is fitted to the casters, so that no texel is wasted;
// but with a constant bias it is the classic one, which samples a texel at its corner instead of its centre.
static void first_pass(const Options& opt, const Models& casters, Shadow& shadow) {
    shadow.method = casters.empty() ? Options::Method::off : opt.method;
    if (shadow.method == Options::Method::off) return;
    const bool exact = opt.method == Options::Method::exact;
    const bool classic = opt.bias && opt.light == Options::Light::far;
    const int size = exact ? LightGrid::good_cells(casters) : opt.shadow_size;
    Camera light = light_camera(opt);
    light.Viewport = middle_viewport(size, size);
    if (!classic) light = fitted(light, casters, size);
    shadow.M = light.to_screen();
    shadow.aspect = light.Projection[1][1] / light.Projection[0][0];
    if (exact) {
        shadow.grid.build(casters, light, size);
        return;
    }
    if (classic) light.Viewport = translation({.5, .5, 0}) * light.Viewport;  // M stays: drawn aside, read in place
    std::vector<DepthShader> shaders;
    for (const Model* model : casters) shaders.emplace_back(*model, light);
    if (!shadow.shadowbuffer.width()) shadow.shadowbuffer = DepthBuffer(size, size);  // kept; draw() clears it
    draw(shaders, light.Viewport, shadow.shadowbuffer, opt.caster_faces);
}

// Rendering the frame buffer: the camera stands at the viewer, and each fragment asks whether the light sees it too.
static Counters second_pass(const Options& opt, const Models& seen, const Models& sky, const Shadow& shadow,
                            TGAImage& frame) {
    const Camera camera = viewer(opt);
    std::vector<SkyShader> sky_shaders;
    for (const Model* model : sky) sky_shaders.emplace_back(*model, camera);
    std::vector<PhongShader> shaders;
    for (const Model* model : seen) shaders.emplace_back(opt, shadow, camera, *model);
    return draw(shaders, sky_shaders, camera.Viewport, frame);
}

// ==== the program around the lesson: the command line and the files ====

struct Arguments : Options {  // what else the command line says
    struct Placed {
        std::filesystem::path path;
        vec3 at;
        double turn = 0, scale = 1;  // about up, in degrees
    };
    std::vector<Placed> models;
    std::filesystem::path sky;
    std::filesystem::path out = ".";
    enum class Only { both, framebuffer, depth } only = Only::both;  // of the pictures
    bool own_light = false, tangent = false, fit = true;
    bool show = false, view = false, quiet = false, help = false, version = false;
    int threads = 0;  // 0: all processors
    int frames = 1, first_frame = 0, end_frame = 1;
    enum class Move { nothing, object, camera, light } move = Move::nothing;  // goes round up once in so many frames
};

struct UsageError : std::runtime_error {  // a wrong command line: status 2
    using std::runtime_error::runtime_error;
};

// What follows an option, read as what the option takes.
struct Value {
    std::string option, text;

    [[noreturn]] void fail(const std::string& wanted) const {
        throw UsageError(option + ": \"" + text + "\" is not " + wanted);
    }
    // Whether it has this form, as scanf writes it, with nothing behind.
    bool is(const std::string& format, auto*... parts) const {
        char rest;
        return std::sscanf(text.c_str(), (format + "%c").c_str(), parts..., &rest) == int{sizeof...(parts)};
    }
    void read(double& n) const {
        if (!is("%lf", &n) || !std::isfinite(n)) fail("a number");
    }
    void read_factor(double& n) const {
        read(n);
        if (n < 1e-6 || n > 1e6) fail("1e-6 to 1e6");
    }
    void read(int& n, int most, int least = 1) const {
        if (!is("%5d", &n) || n < least || n > most) fail(std::to_string(least) + " to " + std::to_string(most));
    }
    void read_frames(int& n, int& first, int& end) const {
        if (!is("%5d:%5d/%5d", &first, &end, &n)) read(n, 9999), first = 0, end = n;
        if (first < 0 || first >= end || end > n || n > 9999) fail("N or A:B/N, 0 <= A < B <= N <= 9999");
    }
    void read_size(int& w, int& h) const {
        if (is("%5d", &w)) h = w;
        else if (!is("%5dx%5d", &w, &h) && !is("%5dX%5d", &w, &h)) w = 0;
        if (std::min(w, h) < 1 || std::max(w, h) > max_size) fail("N or WxH, each 1 to " + std::to_string(max_size));
    }
    void read(std::filesystem::path& folder) const {
        folder = text;
        std::error_code ignored;
        const auto status = std::filesystem::status(folder, ignored);
        const std::filesystem::path ending = folder.extension();
        if (!is_directory(status) &&
            (text.empty() || exists(status) || ending == ".tga" || ending == ".png" || ending == ".jpg"))
            fail("a folder: framebuffer.tga and depth.tga are written into it");
    }
    void read(vec3& v) const {
        if (!is("%lf,%lf,%lf", &v.x, &v.y, &v.z)) fail("three numbers X,Y,Z joined by commas, as in 1,1,0");
        if (!(norm(v) <= 1e307)) fail("of a length up to 1e307");
    }
    Arguments::Placed& last_model(Arguments& o) const {
        if (o.models.empty()) throw UsageError(option + ": there is no model before it");
        return o.models.back();
    }
    void read_light(Arguments& o, Options::Light kind, double half_angle) const {
        vec3& v = o.light_dir;
        if (kind == Options::Light::far || !is("%lf,%lf,%lf,%lf", &v.x, &v.y, &v.z, &half_angle)) read(v);
        else if (!(half_angle > 0 && half_angle <= 89)) fail("X,Y,Z or X,Y,Z,DEG, DEG up to 89");
        else if (!(norm(v) <= 1e307)) fail("of a length up to 1e307");
        o.light = kind, o.half_angle = half_angle, o.own_light = true;
    }
    int one_of(const std::vector<std::string>& names) const {  // which
        const auto found = std::find(names.begin(), names.end(), text);
        if (found == names.end()) {
            std::string list = names[0];
            for (std::size_t i = 1; i < names.size(); i++) list += (i + 1 < names.size() ? ", " : " or ") + names[i];
            fail(list);
        }
        return static_cast<int>(found - names.begin());
    }
};

struct Option {
    const char *name, *takes, *help;
    void (*set)(Arguments&, const Value&);
    const char* short_name = "";
};

static const Option options[] = {
    {"--output", "DIR", "folder of the two pictures, made where it is missing (.)",
     [](Arguments& o, const Value& v) { v.read(o.out); }, "-o"},
    {"--size", "WxH", "the picture's pixels; N is NxN (800x800)",
     [](Arguments& o, const Value& v) { v.read_size(o.width, o.height); }},
    {"--shadow-size", "N", "the shadow buffer's pixels a side (800)",
     [](Arguments& o, const Value& v) { v.read(o.shadow_size, max_size); }},
    {"--eye", "X,Y,Z", "the viewer (1,1,4)", [](Arguments& o, const Value& v) { v.read(o.eye); }},
    {"--center", "X,Y,Z", "what the viewer looks at (0,0,0)", [](Arguments& o, const Value& v) { v.read(o.center); }},
    {"--up", "X,Y,Z", "what appears upwards; 0,0,0: the axis that the view is least along (0,1,0)",
     [](Arguments& o, const Value& v) { v.read(o.up); }},
    {"--zoom", "F", "magnifies about the middle, which a nearer eye does not (1)",
     [](Arguments& o, const Value& v) { v.read_factor(o.zoom); }},
    {"--at", "X,Y,Z", "where the model before it stands (0,0,0)",
     [](Arguments& o, const Value& v) { v.read(v.last_model(o).at); }},
    {"--turn", "DEG", "how far the model before it is turned about up (0)",
     [](Arguments& o, const Value& v) { v.read(v.last_model(o).turn); }},
    {"--scale", "F", "how much larger the model before it is made (1)",
     [](Arguments& o, const Value& v) { v.read_factor(v.last_model(o).scale); }},
    {"--sky", "FILE", "a dome that is drawn behind everything, unlit: obj/sky/sky.obj, or another (none)",
     [](Arguments& o, const Value& v) { o.sky = v.text; }},
    {"--light", "X,Y,Z", "direction towards the light (1,1,0; 1,1,1 where a scene is fitted)",
     [](Arguments& o, const Value& v) { v.read_light(o, Options::Light::far, 0); }},
    {"--spot", "X,Y,Z[,DEG]", "a spot light's place and the half angle of its beam, which goes to the center (25)",
     [](Arguments& o, const Value& v) { v.read_light(o, Options::Light::spot, 25); }},
    {"--point", "X,Y,Z[,DEG]", "a point light's place, and how far around it has shadows, from the center on (80)",
     [](Arguments& o, const Value& v) { v.read_light(o, Options::Light::point, 80); }},
    {"--beam", "SHAPE", "a spot light's: round or square (round)",
     [](Arguments& o, const Value& v) { o.square_beam = v.one_of({"round", "square"}) == 1; }},
    {"--shadow", "HOW", "map: a shadow buffer, drawn as depth.tga; exact: the faces themselves; off (map)",
     [](Arguments& o, const Value& v) { o.method = Options::Method(v.one_of({"map", "exact", "off"})); }},
    {"--bias", "N", "with map: the classic lesson's buffer and camera, a constant bias of N of 2000 (there 43.34)",
     [](Arguments& o, const Value& v) { v.read(o.bias.emplace()); }},
    {"--casters", "FACES", "of closed bodies the back ones are enough in the shadow buffer: all or back (all)",
     [](Arguments& o, const Value& v) { o.caster_faces = Faces(v.one_of({"all", "back"})); }},
    {"--draw", "WHAT", "color; shadow: white lit, black in shadow, grey turned away from the light; normal (color)",
     [](Arguments& o, const Value& v) { o.draw = Options::Draw(v.one_of({"color", "shadow", "normal"})); }},
    {"--only", "WHAT", "framebuffer, or depth: one of the two pictures, without what it does not need (both)",
     [](Arguments& o, const Value& v) { o.only = Arguments::Only(v.one_of({"both", "framebuffer", "depth"})); }},
    {"--tangent", "", "prefer a tangent-space normal map to an object-space one",
     [](Arguments& o, const Value&) { o.tangent = true; }},
    {"--no-fit", "", "keep the scene's own coordinates (default: fit it where it is cut off, off the centre or small)",
     [](Arguments& o, const Value&) { o.fit = false; }},
    {"--threads", "N", "the pictures are the same at any number (0, all processors)",
     [](Arguments& o, const Value& v) { v.read(o.threads, 256, 0); }},
    {"--frames", "N", "draw N times and tell the median time of each pass; or A:B/N, from A up to B of N (1)",
     [](Arguments& o, const Value& v) { v.read_frames(o.frames, o.first_frame, o.end_frame); }},
    {"--move", "WHAT", "a picture for each frame: object (the first one), camera or light goes round up (nothing)",
     [](Arguments& o, const Value& v) {
         o.move = Arguments::Move(v.one_of({"nothing", "object", "camera", "light"}));
     }},
    {"--show", "", "print the picture in the terminal, too", [](Arguments& o, const Value&) { o.show = true; }},
    {"--view", "", "show the scene in the terminal, where keys move it",
     [](Arguments& o, const Value&) { o.view = true; }},
    {"--quiet", "", "print errors only", [](Arguments& o, const Value&) { o.quiet = true; }, "-q"},
    {"--help", "", "print this", [](Arguments& o, const Value&) { o.help = true; }, "-h"},
    {"--version", "", "print the version", [](Arguments& o, const Value&) { o.version = true; }, "-V"},
};

static Arguments parse(int argc, char** argv) {
    Arguments opt;
    bool only_models = false;  // after --
    for (int i = 1; i < argc && !opt.help && !opt.version; i++) {
        const std::string arg = argv[i];
        if (only_models || arg[0] != '-' || arg == "-") {
            opt.models.push_back({arg, {}});
            continue;
        }
        if ((only_models = arg == "--")) continue;
        const std::size_t equals = arg.find('=');
        const bool joined = equals != arg.npos;  // --name=value
        Value value{arg.substr(0, equals), joined ? arg.substr(equals + 1) : ""};
        const auto is_named = [&](const Option& o) { return value.option == o.name || value.option == o.short_name; };
        const auto option = std::find_if(std::begin(options), std::end(options), is_named);
        if (option == std::end(options)) throw UsageError("unknown option " + value.option);
        if (!*option->takes && joined) throw UsageError(value.option + " takes no value");
        if (*option->takes && !joined) {
            // What looks like the next option is no value: -o --quiet is not to make a folder of that name.
            if (++i == argc || std::string(argv[i]).starts_with("--"))
                throw UsageError(value.option + ": a value is missing");
            value.text = argv[i];
        }
        option->set(opt, value);
    }
    const bool has_map = opt.method == Options::Method::map, is_far = opt.light == Options::Light::far;
    if (!std::isfinite(1 / norm(opt.eye - opt.center))) throw UsageError("--eye and --center are the same point");
    if (opt.bias && !has_map) throw UsageError("--bias belongs to --shadow map");
    if (opt.caster_faces == Faces::back && !has_map) throw UsageError("--casters back belongs to --shadow map");
    if (is_far && opt.light_dir == vec3{}) throw UsageError("--light has no direction");
    if (!is_far && !std::isfinite(1 / norm(opt.light_dir - opt.center)))
        throw UsageError("the light and --center are at the same point");
    if (opt.only == Arguments::Only::depth && !has_map)
        throw UsageError("--only depth: there is no shadow buffer without --shadow map");
    if (opt.models.empty()) opt.models.push_back({UMBRA_OBJ_DIR "/idol/idol.obj", {}});
    return opt;
}

static void print_help() {
    std::puts("usage: umbra [options] [model.obj ...]\n\n"
              "Draws the models, lit and with hard shadows, into framebuffer.tga, and what the light sees into\n"
              "depth.tga. Several models share one scene; - is one on standard input. Without a model: the idol.\n");
    for (const Option& o : options) {
        const std::string names = std::string(o.short_name) + (*o.short_name ? ", " : "") + o.name;
        std::printf("  %-20s %s\n", (names + ' ' + o.takes).c_str(), o.help);
    }
}

// One line on standard error, whatever a name on the command line is made of; returns the status.
static int complain(std::string what, int status) {
    std::replace_if(what.begin(), what.end(), [](unsigned char c) { return c < ' ' || c == 127; }, '?');
    std::fprintf(stderr, "umbra: %s\n", what.c_str());
    return status;
}

static void note(const Arguments& opt, const std::string& what) {
    if (!opt.quiet) complain(what, 0);
}

struct Scene {
    std::vector<Model> models, sky;  // at most one sky, if it is to be seen
    Models seen;                     // by the viewer: only these are shaded, and have textures
    Models casters;                  // may throw a shadow onto what is seen
    Model object;                    // the first model at rest, if it goes round ...
    vec3 axis;                       // ... this, where its own origin is
};

static Scene load(const Arguments& opt) {
    Scene scene;
    std::map<std::filesystem::path, std::size_t> first;  // a file is read once, however often it is placed
    for (const Arguments::Placed& placed : opt.models) {
        const auto [known, is_new] = first.emplace(placed.path, scene.models.size());
        if (!is_new) scene.models.push_back(scene.models[known->second]);
        else scene.models.emplace_back(placed.path, opt.tangent ? NormalMap::tangent : NormalMap::object);
    }
    if (!opt.sky.empty() && opt.draw == Options::Draw::color && opt.only != Arguments::Only::depth) {
        scene.sky.emplace_back(opt.sky).load_textures();
        for (const std::string& what : scene.sky[0].notes()) note(opt, opt.sky.string() + ": " + what);
    }
    for (std::size_t i = 0; i < scene.models.size(); i++) {
        const Arguments::Placed& placed = opt.models[i];
        Model& model = scene.models[i];
        model.turn = rotation(opt.up, placed.turn);
        const mat4 M_o = translation(placed.at) * model.turn;
        if (M_o != mat4::identity() || placed.scale != 1)
            model.move([&](const vec3& v) { return (M_o * point(v * placed.scale)).xyz(); });
    }
    return scene;
}

// What a frame does not need is left out.
static void leave_out(const Arguments& opt, Scene& scene) {
    scene.seen = seen_by(viewer(opt), scene.models, opt.width, opt.height);
    if (opt.method != Options::Method::off) scene.casters = casters(scene.models, scene.seen, light_camera(opt));
    if (opt.only == Arguments::Only::depth) scene.seen.clear();
}

static void load_textures(const Arguments& opt, Scene& scene) {
    Model::Pictures pictures;
    std::set<std::string> said;  // of a file that is placed twice only once
    // What moves may be seen later.
    const bool all = (opt.view || opt.move != Arguments::Move::nothing) && opt.only != Arguments::Only::depth;
    for (std::size_t i = 0; i < scene.models.size(); i++) {
        Model& model = scene.models[i];
        if (all || std::count(scene.seen.begin(), scene.seen.end(), &model)) model.load_textures(pictures);
        for (const std::string& what : model.notes()) {
            const std::string line = opt.models[i].path.string() + ": " + what;
            if (said.insert(line).second) note(opt, line);
        }
    }
}

// Before anything is drawn: makes the folder, and tries whether the pictures can be written there.
static void prepare_folder(const Arguments& opt) {
    std::error_code error;
    std::filesystem::create_directories(opt.out, error);
    if (error) throw std::runtime_error(opt.out.string() + ": cannot be made: " + error.message());
    const auto try_file = [&](const char* name) {  // what is written goes again, since nothing commits it
        TGAFile(TGAImage(1, 1, TGAImage::GRAYSCALE), opt.out / name);
    };
    if (opt.method == Options::Method::map && opt.only != Arguments::Only::framebuffer) try_file("depth.tga");
    if (opt.only != Arguments::Only::depth) try_file("framebuffer.tga");
}

// Writes both pictures or, where one does not fit on the disk, none. Returns where they are.
static std::string write(const Arguments& opt, const Shadow& shadow, const TGAImage& frame, const std::string& number) {
    const std::filesystem::path paths[] = {opt.out / ("depth" + number + ".tga"),
                                           opt.out / ("framebuffer" + number + ".tga")};
    std::optional<TGAFile> files[2];
    parallel_for(2, [&](int i, int) {
        if (i == 0 && shadow.method == Options::Method::map && opt.only != Arguments::Only::framebuffer)
            files[i].emplace(depth_picture(shadow.shadowbuffer, shadow.aspect), paths[i]);
        if (i == 1 && opt.only != Arguments::Only::depth) files[i].emplace(frame, paths[i]);
    });
    std::string written;
    for (int i = 0; i < 2; i++) {
        if (files[i]) {
            files[i]->commit();
            written = paths[i].string() + (written.empty() ? "" : " and " + written);
        } else if (exists(paths[i])) {
            note(opt, paths[i].string() + " is from an earlier run: this one draws none");
        }
    }
    return written;
}

// A black picture, or one without light, leaves its user with a riddle.
static void note_darkness(const Arguments& opt, const TGAImage& frame, bool is_seen) {
    const auto is_dark = [](int channel) { return channel <= 20; };  // the ambient light
    if (!is_seen) note(opt, "nothing of the scene is seen: see --eye, --center and --zoom");
    else if (opt.draw == Options::Draw::color && opt.only != Arguments::Only::depth &&
             std::all_of(frame.pixel(0, 0), frame.pixel(0, frame.height()), is_dark))
        note(opt, "nothing that is seen is lit: see --light");
}

// The names of the kinds of map that no material of any model has, each after a comma.
static std::string missing_maps(const std::vector<Model>& models) {
    bool diffuse = false, normal = false, specular = false, glow = false;
    for (const Model& model : models)
        for (const Material& m : model.materials()) {
            diffuse = diffuse || m.diffuse, normal = normal || m.normal || m.tangent;
            specular = specular || m.specular, glow = glow || m.glow;
        }
    return std::string(diffuse ? "" : ",diffuse") + (normal ? "" : ",normal_map") + (specular ? "" : ",specular") +
           (glow ? "" : ",glow");
}

static double milliseconds() {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

static double median(std::vector<double>& values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

// Brings the scene to where it is drawn: fitted to the picture, and then with center, which matrices would have to undo
// at the cost of digits if it were far off, at the origin.
static void arrange(Arguments& opt, Scene& scene) {
    const Model& first = scene.models[0];
    const vec3 low = first.low(), side = first.high() - low;
    // As the default eye sees it, so that a scene does not change its size when the eye moves; but whoever says what is
    // up has another view in mind.
    const bool has_up = opt.up != Options().up;
    if (opt.fit && fit(scene.models, has_up ? opt.eye - opt.center : Options().eye, opt.up)) {
        if (!opt.own_light) opt.light_dir = {1, 1, 1};  // the default one leaves dark what faces the viewer
        note(opt, opt.own_light ? "the scene is fitted to the picture (--no-fit)"
                                : "the scene is fitted to the picture and lit from 1,1,1 (--no-fit, --light X,Y,Z)");
    }
    for (Model& model : scene.models) model.move([&](const vec3& v) { return v - opt.center; });
    if (opt.light != Options::Light::far) opt.light_dir = opt.light_dir - opt.center;
    opt.eye = opt.eye - opt.center, opt.center = {0, 0, 0};
    const double size = norm(side), scale = size > 0 ? norm(first.high() - first.low()) / size : 1;
    scene.axis = first.low() + (opt.models[0].at - low) * scale;
}

// A frame of a sequence: what moves has gone round up by its share of a turn.
static void turn(const Arguments& at_rest, int frame, Arguments& opt, Scene& scene) {
    const mat4 rotated = rotation(opt.up, 360. * frame / opt.frames);
    const auto turned = [&](const vec3& v) { return (rotated * direction(v)).xyz(); };
    if (opt.move == Arguments::Move::camera) opt.eye = turned(at_rest.eye);
    if (opt.move == Arguments::Move::light) opt.light_dir = turned(at_rest.light_dir);
    if (opt.move != Arguments::Move::object) return;
    scene.models[0] = scene.object;
    scene.models[0].turn = rotated * scene.object.turn;
    scene.models[0].move([&](const vec3& v) { return turned(v - scene.axis) + scene.axis; });
}

// What a key does to the camera, the light and the shadows; false for one that means nothing. Angles go in steps of 5
// degrees.
static bool obey(char key, Arguments& o) {
    const auto about = [](const vec3& axis, double degrees, vec3& v) {
        v = (rotation(axis, degrees) * direction(v)).xyz();
    };
    const auto lift = [&](double degrees, vec3& v) {  // not over the top, where left and right change places
        const auto off_top = [&](const vec3& at) { return norm(cross(normalized(at), normalized(o.up))); };
        vec3 lifted = v;
        about(lookat(v, o.center, o.up)[0].xyz(), -degrees, lifted);  // where v is along up, too
        if (off_top(lifted) >= std::min(.1, off_top(v))) v = lifted;
    };
    constexpr double biases[] = {0, 10, 43.34, 100};
    switch (key) {
        case '<': return about(o.up, -5, o.eye), true;
        case '>': return about(o.up, 5, o.eye), true;
        case '^': return lift(5, o.eye), true;
        case 'v': return lift(-5, o.eye), true;
        case 'a': return about(o.up, -5, o.light_dir), true;
        case 'd': return about(o.up, 5, o.light_dir), true;
        case 'w': return lift(5, o.light_dir), true;
        case 's': return lift(-5, o.light_dir), true;
        case 'l':  // a direction becomes a place as far off as the viewer
            if (o.light == Options::Light::far) o.light_dir = normalized(o.light_dir) * norm(o.eye);
            o.light = Options::Light((int(o.light) + 1) % 3);
            o.half_angle = o.light == Options::Light::spot ? 25 : 80;
            return true;
        case 'm': return o.method = Options::Method((int(o.method) + 1) % 3), o.bias.reset(), true;
        case 'b': {
            if (o.method != Options::Method::map) return false;
            const double* const next = std::upper_bound(std::begin(biases), std::end(biases), o.bias.value_or(-1));
            o.bias = next == std::end(biases) ? std::nullopt : std::optional(*next);
            return true;
        }
        default: return false;
    }
}

// The scene in the terminal, until q: drawn again whenever a key changes it, or in turns of 180 pictures.
static void view(Arguments at_rest, Scene& scene) {
    Terminal terminal;
    if (at_rest.move == Arguments::Move::nothing) at_rest.move = Arguments::Move::object;
    at_rest.frames = 180;
    scene.object = scene.models[0];
    Shadow shadow;
    bool turns = false;
    int i = 0;
    double began = 0;
    for (char key = 0; key != 'q';  // 0: the window has changed; when it turns, 50 pictures a second
         key = terminal.key(turns ? std::max(0, static_cast<int>(20 + began - milliseconds())) : -1)) {
        if (key == ' ') turns = !turns;
        if (turns) i = (i + 1) % at_rest.frames;
        if (!obey(key, at_rest) && !turns && key != 0 && key != 'p') continue;
        began = milliseconds();
        Arguments opt = at_rest;
        turn(at_rest, i, opt, scene);
        const auto drawn = [&](int width, int height) {
            opt.width = width, opt.height = height;
            leave_out(opt, scene);
            first_pass(opt, scene.casters, shadow);
            TGAImage picture(width, height, TGAImage::RGB);
            second_pass(opt, scene.seen, scene.sky, shadow, picture);
            return picture;
        };
        std::string line = std::array{"light", "spot light", "point light"}[int(opt.light)];
        line += std::array{", shadow map, bias ", ", exact shadows", ", no shadows"}[int(opt.method)];
        if (opt.method == Options::Method::map) line += opt.bias ? std::to_string(*opt.bias).substr(0, 5) : "derived";
        line += "   q: quit  arrows: camera  wasd: light  space: turn  l: light  m: shadows  b: bias  p: write";
        if (key == 'p') line = "wrote " + write(opt, shadow, drawn(opt.width, opt.height), "");
        const int columns = std::min(terminal.columns(), max_size);
        terminal.show(drawn(columns, std::min(2 * (terminal.rows() - 1), max_size)), line);
    }
}

static void run(Arguments opt) {
    const double start = milliseconds();
    prepare_folder(opt);
    Scene scene = load(opt);
    arrange(opt, scene);
    leave_out(opt, scene);
    load_textures(opt, scene);
    if (opt.view) return view(opt, scene);
    const double loaded = milliseconds();
    const bool moves = opt.move != Arguments::Move::nothing;
    const Arguments at_rest = opt;
    if (opt.move == Arguments::Move::object) scene.object = scene.models[0];
    Shadow shadow;
    TGAImage picture(opt.width, opt.height, TGAImage::RGB);
    Counters c;
    std::string pictures, first_pictures;
    std::vector<double> depth_ms, shade_ms, write_ms;
    int spared = 0;  // passes of the light that would not have changed its buffer
    for (int i = opt.first_frame; i < opt.end_frame; i++) {
        const Models casters_before = scene.casters;
        if (moves) {
            turn(at_rest, i, opt, scene);
            leave_out(opt, scene);
        }
        const double began = milliseconds();
        if (opt.move == Arguments::Move::camera && i > opt.first_frame && scene.casters == casters_before) spared++;
        else first_pass(opt, scene.casters, shadow);
        const double first = milliseconds();
        if (opt.only != Arguments::Only::depth) c = second_pass(opt, scene.seen, scene.sky, shadow, picture);
        const double drawn = milliseconds();
        const std::string number = moves ? std::to_string(10000 + i).replace(0, 1, "_") : "";  // 12: _0012
        if (moves || i + 1 == opt.end_frame) pictures = write(opt, shadow, picture, number);
        if (moves && first_pictures.empty()) first_pictures = pictures + " to ";
        depth_ms.push_back(first - began), shade_ms.push_back(drawn - first);
        write_ms.push_back(milliseconds() - drawn);
        if (moves && !opt.quiet) Terminal::progress(i + 1 - opt.first_frame, opt.end_frame - opt.first_frame);
    }
    const bool only_depth = opt.only == Arguments::Only::depth;
    const bool is_seen = only_depth ? !scene.casters.empty() : c.shaded > 0;
    if (opt.show && is_seen) (only_depth ? depth_picture(shadow.shadowbuffer, shadow.aspect) : picture).print();
    note_darkness(opt, picture, is_seen);
    if (opt.quiet) return;
    const std::string left_out = missing_maps(scene.models) + (scene.casters.empty() ? ",shadow" : "");
    if (!pictures.empty()) std::printf("wrote %s\n", (first_pictures + pictures).c_str());
    std::printf("triangles %ld pixels %ld fragments %ld load_ms %.3f depth_ms %.3f shade_ms %.3f write_ms %.3f "
                "shadow_bytes %zu outside %ld between_samples %ld hidden %ld models %zu seen %zu casters %zu "
                "spared %d left_out %s\n",
                c.triangles, c.shaded, c.shaded, loaded - start, median(depth_ms), median(shade_ms), write_ms.back(),
                shadow.shadowbuffer.bytes() + shadow.grid.bytes(), c.outside, c.between_samples, c.covered - c.shaded,
                scene.models.size(), scene.seen.size(), scene.casters.size(), spared,
                left_out.empty() ? "-" : left_out.c_str() + 1);
}

int main(int argc, char** argv) try {
    const Arguments opt = parse(argc, argv);
    if (opt.threads) use_threads(opt.threads);
    if (opt.help) print_help();
    else if (opt.version) std::puts("umbra " UMBRA_VERSION);
    else run(opt);
    if (std::fflush(stdout) || std::ferror(stdout)) throw std::runtime_error("standard output: cannot write");
    return 0;
} catch (const UsageError& e) {
    return complain(e.what() + std::string(" (umbra --help lists the options)"), 2);
} catch (const std::exception& e) {
    return complain(e.what(), 1);
}
