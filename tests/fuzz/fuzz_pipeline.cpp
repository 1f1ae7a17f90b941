// fuzz_pipeline.cpp: any numbers through the pipeline: corners in clip space, matrices, sizes, cameras, lights.
// Whatever they are, no pixel outside of a buffer is touched, no buffer holds a NaN, the counters add up, and the
// number of threads changes nothing.
//
// The input is read from front to back by class Input; where it ends, zeros follow. The first byte says whether the
// faces go straight into the pipeline or as a model through the two passes of the lesson, and whether there are enough
// of them for three threads: for that it must be 'T' or 'U', since such an input takes a hundred times as long as
// another.
#include "lesson.h"
#include "fuzz.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstring>

namespace {

class Input {
public:
    Input(const std::uint8_t* data, std::size_t size) : at_(data), end_(data + size) {}

    unsigned byte() { return at_ < end_ ? *at_++ : 0; }
    int upto(unsigned n) { return static_cast<int>(byte() % n); }  // 0 to n-1

    // Mostly small multiples of a fraction, which meet and line up; also numbers at the ends of the range, powers of
    // two, and any eight bytes.
    double number() {
        constexpr double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
        static constexpr double special[] = {0.,     -0.,    1,      -1,      .5,      1e-5,    1e5,     1e15,
                                             1e-15,  1e38,   -1e38,  3.5e38,  1e150,   -1e150,  1e300,   1.7e308,
                                             -1.7e308, 5e-324, 1e-310, 0x1p-22, -0x1p-22, 0x1p-200, 0x1p200, 4096,
                                             -4096,  16384,  0x1p31, 0x1p53,  inf,     -inf,    nan,     1 + 0x1p-52};
        const unsigned kind = byte();
        switch (kind >> 5) {
            case 4: return static_cast<double>(static_cast<std::int16_t>(byte() << 8 | (kind & 31) << 3)) / 256;
            case 5: return special[kind & 31];
            case 6: {
                const int exponent = static_cast<int>(kind & 31) * 68 - 1074;
                return std::ldexp(static_cast<double>(static_cast<std::int8_t>(byte())), exponent);
            }
            case 7: {
                std::uint64_t bits = 0;
                for (int i = 0; i < 8; i++) bits = bits << 8 | byte();
                return std::bit_cast<double>(bits);
            }
            default: return static_cast<double>(static_cast<std::int8_t>(byte())) / 64;
        }
    }
    // Within what the command line and the readers let through.
    double finite(double most) {
        const double v = number();
        return std::fabs(v) <= most ? v : 0;
    }
    vec3 vector(double most) {
        const double x = finite(most), y = finite(most), z = finite(most);
        return {x, y, z};
    }

private:
    const std::uint8_t *at_, *end_;
};

struct Corners {
    std::array<int, 3> index;
};

// Faces over a few shared vertices, corners repeated or not. A thread is not started for so few faces, so there may
// also be some that follow from them: the same ones with their indices shifted.
std::vector<Corners> read_faces(Input& in, int vertices, bool many) {
    std::vector<Corners> few(static_cast<std::size_t>(1 + in.upto(32)));
    for (Corners& f : few)
        for (int& i : f.index) i = in.upto(static_cast<unsigned>(vertices));
    if (!many) return few;
    std::vector<Corners> faces(3 * 256);  // what three threads take
    for (std::size_t i = 0; i < faces.size(); i++)
        for (std::size_t c = 0; c < 3; c++)
            faces[i].index[c] = (few[i % few.size()].index[c] + static_cast<int>(i / few.size() * c)) % vertices;
    return faces;
}

// Pixels: few, since a fuzzer lives by the number of its inputs; sometimes more, or a long row or column.
int read_side(Input& in) {
    const int n = in.upto(256);
    return n < 192 ? 1 + n % 16 : n < 250 ? 1 + n % 64 : n < 253 ? 4096 : 1;
}

// ---- faces straight into the pipeline ----

struct ClipShader final : IShader {
    const std::vector<vec4>& clip;
    const std::vector<Corners>& faces;
    int current = 0;
    ClipShader(const std::vector<vec4>& c, const std::vector<Corners>& f) : clip(c), faces(f) {}

    vec4 vertex(int face, int corner) override {
        current = face;
        const Corners& f = faces[static_cast<std::size_t>(face)];
        return clip[static_cast<std::size_t>(f.index[static_cast<std::size_t>(corner)])];
    }
    TGAColor fragment(const Fragment& f) const override {
        // Three quotients by a sum that is itself rounded twice: each off by half a unit in the last place of 1 at
        // most.
        REQUIRE(f.bar.x >= 0 && f.bar.y >= 0 && f.bar.z >= 0);
        REQUIRE(std::fabs(f.bar.x + f.bar.y + f.bar.z - 1) <= 4 * std::numeric_limits<double>::epsilon());
        REQUIRE(std::isfinite(f.screen.x) && std::isfinite(f.screen.y) && std::isfinite(f.screen.z));
        return {{static_cast<std::uint8_t>(current), static_cast<std::uint8_t>(f.bar.x * 255),
                 static_cast<std::uint8_t>(f.bar.y * 255), 255}};
    }
};

struct Drawn {
    DepthBuffer depths;
    FaceBuffer faces;
    TGAImage picture;
    Counters count;
};

Drawn draw(const ClipShader& shader, const mat4& Viewport, int width, int height, int threads) {
    const int n = static_cast<int>(shader.faces.size());
    Drawn d{DepthBuffer(width, height), FaceBuffer(width, height), TGAImage(width, height, TGAImage::RGBA), {}};
    d.count = draw_depth(n, shader, Viewport, d.depths, &d.faces, 0, threads);
    d.count.shaded = draw_color(0, n, shader, Viewport, d.faces, numbers_seen(d.faces, n), 0, d.picture, threads);
    return d;
}

bool same(const Counters& a, const Counters& b) {
    return a.triangles == b.triangles && a.outside == b.outside && a.between_samples == b.between_samples &&
           a.covered == b.covered && a.nearer == b.nearer && a.shaded == b.shaded;
}

template <class T>
bool same(const Buffer<T>& a, const Buffer<T>& b) {
    return a.bytes() == b.bytes() && (a.bytes() == 0 || std::memcmp(a.row(0), b.row(0), a.bytes()) == 0);
}

bool same(const TGAImage& a, const TGAImage& b) {
    const auto bytes = static_cast<std::size_t>(a.width() * a.bytespp()) * static_cast<std::size_t>(a.height());
    return a.width() == b.width() && a.height() == b.height() && std::memcmp(a.pixel(0, 0), b.pixel(0, 0), bytes) == 0;
}

// Depth and face of each pixel belong together; returns how many show a face.
long check_buffers(const DepthBuffer& depths, const FaceBuffer& faces, int face_count) {
    long seen = 0;
    for (int y = 0; y < depths.height(); y++) {
        for (int x = 0; x < depths.width(); x++) {
            const float depth = depths.row(y)[x];
            const std::int32_t face = faces.row(y)[x];
            REQUIRE(std::isfinite(depth) || depth == -std::numeric_limits<float>::infinity());
            REQUIRE(face >= -1 && face < face_count);
            REQUIRE((face == -1) == !std::isfinite(depth));
            seen += face >= 0;
        }
    }
    return seen;
}

void check_counters(const Counters& count, long faces, long seen) {
    REQUIRE(count.triangles == faces);
    REQUIRE(count.outside >= 0 && count.between_samples >= 0 && count.outside + count.between_samples <= faces);
    REQUIRE(count.covered >= count.nearer && count.nearer >= seen);
    REQUIRE(count.shaded == seen);
}

void draw_faces(Input& in, bool many) {
    const unsigned flags = in.byte();
    const int width = many ? 1 + in.upto(8) : read_side(in);
    const int height = many ? 1 + in.upto(64) : width > 64 ? 1 : read_side(in);
    Camera camera;
    if (flags & 1) {
        const vec3 eye = in.vector(1e307), center = in.vector(1e307), up = in.vector(1e307);
        camera.ModelView = lookat(eye, center, up);
        camera.Projection = projection(flags & 2 ? in.number() : -1 / norm(eye - center));
    } else if (flags & 2) {
        for (int i = 0; i < 16; i++) camera.Projection[i / 4][i % 4] = in.number();
    }
    switch (flags >> 2 & 3) {
        case 0: camera.Viewport = middle_viewport(width, height); break;
        case 1: camera.Viewport = viewport(0, 0, width, height); break;
        case 2: {
            const double x = in.number(), y = in.number(), w = in.number(), h = in.number();
            camera.Viewport = viewport(x, y, w, h);
            break;
        }
        default: for (int i = 0; i < 16; i++) camera.Viewport[i / 4][i % 4] = in.number();
    }
    std::vector<vec4> clip(static_cast<std::size_t>(3 + in.upto(30)));
    const mat4 to_clip = camera.object_to_clip();
    for (vec4& v : clip) {
        const double x = in.number(), y = in.number(), z = in.number(), w = flags & 16 ? in.number() : 1;
        v = to_clip * vec4{x, y, z, w};
    }
    const std::vector<Corners> faces = read_faces(in, static_cast<int>(clip.size()), many);
    const ClipShader shader(clip, faces);

    const Drawn one = draw(shader, camera.Viewport, width, height, 1);
    const int n = static_cast<int>(faces.size());
    check_counters(one.count, n, check_buffers(one.depths, one.faces, n));
    if (!many) return;
    const Drawn three = draw(shader, camera.Viewport, width, height, 3);
    REQUIRE(same(one.depths, three.depths) && same(one.faces, three.faces) && same(one.picture, three.picture));
    REQUIRE(same(one.count, three.count));
}

// ---- the faces as a model, through the lesson ----

// Seventeen digits give the same double back.
void append(std::string& text, const char* word, std::initializer_list<double> numbers) {
    text += word;
    char digits[32];
    for (const double v : numbers) std::snprintf(digits, sizeof digits, " %.17g", v), text += digits;
    text += '\n';
}

Model read_model(Input& in, bool many, bool with_uv, bool with_normals) {
    static const TemporaryFolder folder("fuzz_pipeline");
    static ScratchFile file(folder / "faces.obj");
    constexpr double most = std::numeric_limits<double>::max();
    std::string text;
    const int vertices = 3 + in.upto(30);
    for (int i = 0; i < vertices; i++) {
        const vec3 v = in.vector(most);
        append(text, "v", {v.x, v.y, v.z});
    }
    for (int i = 0; i < vertices && with_uv; i++) {
        const double u = in.finite(most), v = in.finite(most);
        append(text, "vt", {u, v});
    }
    for (int i = 0; i < vertices && with_normals; i++) {
        const vec3 n = in.vector(most);
        append(text, "vn", {n.x, n.y, n.z});
    }
    for (const Corners& f : read_faces(in, vertices, many)) {
        text += 'f';
        for (const int i : f.index) {
            const std::string number = std::to_string(i + 1);
            text += ' ' + number;
            if (with_uv) text += '/' + number;
            if (with_normals) text += (with_uv ? "/" : "//") + number;
        }
        text += '\n';
    }
    file.assign(text);
    return Model(file.path());
}

void check_grid(Input& in, const std::vector<Model>& models, const Options& opt) {
    const int faces = face_count(models), cells = 1 + in.upto(64);
    const Camera light = fitted_camera(models, opt.light, opt.up, cells);
    double largest = 0;
    for (const vec3& v : models[0].verts())
        largest = std::max({largest, std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)});
    if (largest <= 1e307)  // farther out a rotation may leave the range of a double: then there is no shadow
        for (const mat4& m : {light.ModelView, light.Projection, light.Viewport})
            for (int i = 0; i < 16; i++) REQUIRE(std::isfinite(m[i / 4][i % 4]));
    const LightGrid grid(models, light, cells);
    for (int i = 0; i < 8; i++) {
        const double x = in.number(), y = in.number(), z = in.number();
        // All casters are on the light's screen, but for what a few roundings move a corner; a NaN is beside them all.
        const double rounding = 8 * cells * std::numeric_limits<double>::epsilon();
        const double low = -rounding, high = cells + rounding;
        const bool dark = grid.shadows({x, y, z}, in.upto(static_cast<unsigned>(faces)));
        REQUIRE(!dark || (x >= low && y >= low && x <= high && y <= high));
    }
    // 64 places in lists for each face and its three corners; a box of the mean size touches up to 81 cells, not 64.
    const auto n = static_cast<std::size_t>(faces), lists = static_cast<std::size_t>(cells * cells + 2);
    REQUIRE(grid.bytes() <= n * (3 * sizeof(vec3) + 81 * 8) + lists * 4);
}

void draw_lesson(Input& in, bool many) {
    const unsigned flags = in.byte(), more = in.byte();
    Options opt;
    opt.threads = 1;
    opt.width = 1 + in.upto(many ? 8 : 16);
    opt.height = 1 + in.upto(many ? 48 : 16);
    opt.shadow_size = 1 + in.upto(16);
    if (flags & 1) opt.eye = in.vector(1e307), opt.center = in.vector(1e307);
    if (flags & 2) opt.up = in.vector(1e307);
    if (flags & 4) opt.light = in.vector(1e307);
    opt.shadow = static_cast<Options::Shadow>((flags >> 3 & 3) % 3);
    if (more & 1) opt.bias = in.finite(std::numeric_limits<double>::max());
    if (opt.eye == opt.center || opt.light == vec3{}) return;  // the command line refuses them

    std::vector<Model> models;
    models.push_back(read_model(in, many, more & 2, more & 4));
    if (!(more & 8)) models.back().fit();
    models.back().move(-opt.center);
    if (more & 16) check_grid(in, models, opt);

    const vec3 eye = opt.eye - opt.center;
    const Camera viewer{lookat(eye, {}, opt.up), projection(-1 / norm(eye)), middle_viewport(opt.width, opt.height)};
    Scene scene{opt, std::move(models), viewer};
    Picture one;
    const AnyShadow shadow = first_pass(scene, one);
    second_pass(scene, shadow, one);
    const int faces = face_count(scene.models);
    check_counters(one.count, faces, check_buffers(one.zbuffer, one.faces, faces));
    for (int y = 0; y < one.shadowbuffer.height(); y++)
        for (int x = 0; x < one.shadowbuffer.width(); x++) {
            const float depth = one.shadowbuffer.row(y)[x];
            REQUIRE(std::isfinite(depth) || depth == -std::numeric_limits<float>::infinity());
        }
    if (one.shadowbuffer.width()) depth_picture(one.shadowbuffer);
    depth_picture(one.zbuffer);
    if (!many) return;
    scene.opt.threads = 3;
    Picture three;
    const AnyShadow again = first_pass(scene, three);
    second_pass(scene, again, three);
    REQUIRE(same(one.shadowbuffer, three.shadowbuffer));
    REQUIRE(same(one.zbuffer, three.zbuffer) && same(one.faces, three.faces));
    REQUIRE(same(one.framebuffer, three.framebuffer) && same(one.count, three.count));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input in(data, size);
    const unsigned first = in.byte();
    const bool many = (first & ~1u) == 'T';
    if (first & 1) draw_lesson(in, many);
    else draw_faces(in, many);
    return 0;
}
