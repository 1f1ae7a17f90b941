// fuzz_pipeline.cpp: any numbers through the pipeline: corners in clip space, matrices, sizes, cameras, lights.
// Whatever they are, no pixel outside of a buffer is touched, no buffer holds a NaN, the counters add up, and the
// number of threads changes nothing.
//
// The input is read from front to back by class Input; where it ends, zeros follow. The first byte says whether the
// faces go straight into the pipeline or as a model through the whole program, and whether there are enough
// of them for three threads: for that it must be 'T' or 'U', since such an input takes a hundred times as long as
// another.
#include "drawing.h"
#include "fuzz.h"

#include <array>
#include <bit>
#include <cmath>

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
    std::vector<Corners> faces(3 * 64);  // what three threads take
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

struct CheckingShader final : ClipShader {
    using ClipShader::ClipShader;
    Color fragment(const Fragment& f) const override {
        for (int i = 0; i < lanes; i++) {
            // Three quotients by a sum that is itself rounded twice: each is off by half a unit in the last place of 1
            // at most.
            const vec3 bar{f.bar.x[i], f.bar.y[i], f.bar.z[i]};
            REQUIRE(bar.x >= 0 && bar.y >= 0 && bar.z >= 0);
            REQUIRE(std::fabs(bar.x + bar.y + bar.z - 1) <= 4 * std::numeric_limits<double>::epsilon());
            REQUIRE(std::isfinite(f.screen.x[i]) && std::isfinite(f.screen.y[i]) && std::isfinite(f.screen.z[i]));
        }
        return ClipShader::fragment(f);
    }
};

void check(const Drawing& d, long faces) {
    for (int y = 0; y < d.height(); y++) {
        for (int x = 0; x < d.width(); x++) {
            REQUIRE(std::isfinite(d.z.row(y)[x]) || !d.drawn(x, y));
            REQUIRE(d.face(x, y) >= -1 && d.face(x, y) < faces && (d.face(x, y) >= 0) == d.drawn(x, y));
        }
    }
    for (const double aspect : {1., .3, 1e300}) depth_picture(d.z, aspect);
    const Counters& count = d.count;
    REQUIRE(count.triangles == faces);
    REQUIRE(count.outside >= 0 && count.between_samples >= 0 && count.outside + count.between_samples <= faces);
    REQUIRE(count.covered >= d.seen() && count.shaded == d.seen());
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
    const mat4 to_clip = camera.to_clip();
    for (vec4& v : clip) {
        const double x = in.number(), y = in.number(), z = in.number(), w = flags & 16 ? in.number() : 1;
        v = to_clip * vec4{x, y, z, w};
    }
    std::vector<vec4> corners;
    for (const Corners& f : read_faces(in, static_cast<int>(clip.size()), many))
        for (const int i : f.index) corners.push_back(clip[i]);

    use_threads(1);
    const Drawing one = drawing(CheckingShader(corners), width, height, camera.Viewport);
    check(one, static_cast<long>(corners.size() / 3));
    if (!many) return;
    use_threads(3);
    REQUIRE(same(one, drawing(CheckingShader(corners), width, height, camera.Viewport)));
}

// ---- the faces as a model, through the program ----

// Seventeen digits give the same double back.
void append(std::string& text, const char* word, std::initializer_list<double> numbers) {
    text += word;
    char digits[32];
    for (const double v : numbers) std::snprintf(digits, sizeof digits, " %.17g", v), text += digits;
    text += '\n';
}

std::string read_model(Input& in, bool many, bool with_uv, bool with_normals) {
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
    return text;
}

void check_grid(Input& in, const std::vector<Model>& models, const vec3& to_light, const vec3& up) {
    const int faces = models[0].nfaces(), cells = 1 + in.upto(64);
    const Camera light = fitted({lookat(to_light, {}, up)}, models, cells);
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
        const bool dark = grid.shadows({x, y, z}, in.upto(static_cast<unsigned>(faces)))[0];
        REQUIRE(!dark || (x >= low && y >= low && x <= high && y <= high));
    }
    // 9 places in lists for each face, 64 more for large ones, and its three indices; a band of so few cells is a row
    // of them.
    const auto n = static_cast<std::size_t>(faces), verts = static_cast<std::size_t>(models[0].nverts());
    const auto lists = static_cast<std::size_t>(cells * (cells + 1));
    REQUIRE(grid.bytes() <= n * (3 * sizeof(int) + 73 * 8) + verts * sizeof(vec3) + lists * 4);
}

// Numbers that give the same doubles back.
std::string exactly(const char* format, const vec3& v) {
    char text[120];
    std::snprintf(text, sizeof text, format, v.x, v.y, v.z);
    return text;
}

void draw_lesson(Input& in, bool many) {
    static const TemporaryFolder folder("fuzz_pipeline");
    static ScratchFile file(folder / "faces.obj");
    const unsigned flags = in.byte(), more = in.byte();
    const int width = 1 + in.upto(many ? 8 : 16), height = 1 + in.upto(many ? 48 : 16);
    std::vector<std::string> words{"umbra", "--quiet", "-o", folder.path().string()};
    const auto option = [&](const char* name, const std::string& value) { words.insert(words.end(), {name, value}); };
    option("--size", std::to_string(width) + "x" + std::to_string(height));
    option("--shadow-size", std::to_string(1 + in.upto(16)));
    vec3 eye{1, 1, 4}, center, up{0, 1, 0}, light{1, 1, 0};
    if (flags & 1) eye = in.vector(1e307), center = in.vector(1e307);
    if (flags & 2) up = in.vector(1e307);
    if (flags & 4) light = in.vector(1e307);
    for (const auto& [name, v] : {std::pair("--eye", eye), {"--center", center}, {"--up", up}}) {
        if (!(norm(v) <= 1e307)) return;  // the command line refuses it
        option(name, exactly("%.17g,%.17g,%.17g", v));
    }
    if (!(norm(light) <= 1e307)) return;
    const int lamp = flags >> 5 & 3;  // twice a far one
    const char* const angle = std::array{"", ",1e-6", ",45", ",89"}[more >> 5 & 3];
    option(std::array{"--light", "--spot", "--point", "--light"}[lamp],
           exactly("%.17g,%.17g,%.17g", light) + (lamp % 3 ? angle : ""));
    if (more & 128) option("--beam", "square");
    const int shadow = (flags >> 3 & 3) % 3;
    option("--shadow", std::array{"map", "exact", "off"}[shadow]);
    if (more & 1 && shadow == 0)
        option("--bias", exactly("%.17g", {in.finite(std::numeric_limits<double>::max()), 0, 0}));
    file.assign(read_model(in, many, more & 2, more & 4));
    if (more & 8) words.push_back("--no-fit");
    if (more & 16 && !(light == vec3{})) {
        std::vector<Model> models;
        models.emplace_back(file.path());
        if (!(more & 8)) fit(models);
        models[0].move([&](const vec3& v) { return v - center; });
        check_grid(in, models, light, up);
    }
    words.push_back(file.path().string());
    const bool refused = !std::isfinite(1 / norm(eye - center)) ||
                         (lamp % 3 ? !std::isfinite(1 / norm(light - center)) : light == vec3{});
    Bytes pictures[2];
    for (const int threads : {1, 3}) {
        option("--threads", std::to_string(threads));
        REQUIRE(run_umbra(words) == (refused ? 2 : 0));
        if (refused) return;
        Bytes& bytes = pictures[threads == 3];
        for (const char* name : {"framebuffer.tga", "depth.tga"}) {
            if (!std::filesystem::exists(folder / name)) continue;
            const Bytes part = read_bytes(folder / name);
            bytes.insert(bytes.end(), part.begin(), part.end());
        }
        if (!many) return;
    }
    REQUIRE(pictures[0] == pictures[1]);
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
