// fuzz_obj.cpp: any bytes as an .obj with materials and pictures beside it. They are refused in one line or become a
// model that keeps what model.h promises, within a memory that is a constant times the input.
//
// The input is model.obj; a line "=== NAME" in it ends one file and begins another of the names below.
#include "fuzz.h"
#include "our_gl.h"

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace {

constexpr std::array<std::string_view, 9> names = {
    "model.obj",           "model.mtl",      "model_diffuse.tga", "model_nm.tga",
    "model_nm_tangent.tga", "model_spec.tga", "model_glow.tga",    "a.tga", "B.png"};

// Writes the input's files; those that it does not hold do not exist.
class Files {
public:
    void write(std::string_view input) {
        std::array<std::string_view, names.size()> parts;
        std::array<bool, names.size()> there{true};
        for (std::size_t file = 0;;) {
            const std::size_t newline_before = input.find("\n=== ");  // it belongs to the file that ends
            const std::size_t end = input.starts_with("=== ")         ? 0
                                    : newline_before == input.npos ? input.size()
                                                                   : newline_before + 1;
            if (end > 0) parts[file] = input.substr(0, end);
            if (end == input.size()) break;
            input.remove_prefix(end + 4);
            const std::size_t newline = std::min(input.find('\n'), input.size());
            const auto name = std::find(names.begin() + 1, names.end(), input.substr(0, newline));
            file = name == names.end() ? 1 : static_cast<std::size_t>(name - names.begin());
            there[file] = true;
            input.remove_prefix(std::min(newline + 1, input.size()));
        }
        for (std::size_t i = 0; i < names.size(); i++) {
            if (!there[i]) {
                files_[i].reset();
                continue;
            }
            if (!files_[i]) files_[i] = std::make_unique<ScratchFile>(folder_ / std::string(names[i]));
            files_[i]->assign(reinterpret_cast<const std::uint8_t*>(parts[i].data()), parts[i].size());
        }
    }
    std::filesystem::path obj() const { return folder_ / std::string(names[0]); }

private:
    TemporaryFolder folder_{"fuzz_obj"};
    std::array<std::unique_ptr<ScratchFile>, names.size()> files_;
};

bool is_finite(const vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

void check(const Model& model) {
    REQUIRE(model.nfaces() >= 1 && model.nverts() >= 1);
    for (const vec3& v : model.verts()) REQUIRE(is_finite(v));
    for (int face = 0; face < model.nfaces(); face++) {
        for (int c = 0; c < 3; c++) {
            const Model::Corner& corner = model.corner(face, c);
            REQUIRE(corner.vert >= 0 && corner.vert < model.nverts());
            REQUIRE(corner.normal >= 0 && corner.uv >= -1);
            // Three squares, their sum, a root and a quotient are each off by half a unit: the length by less than 4.
            const vec3 n = model.normal(face, c);
            REQUIRE(std::fabs(norm(n) - 1) <= 4 * std::numeric_limits<double>::epsilon());
            const vec2 uv = model.uv(face, c);
            REQUIRE(std::isfinite(uv.x) && std::isfinite(uv.y));
        }
    }
    // The groups are a partition of the faces, one for each material.
    int end = 0;
    std::vector<char> used(model.materials().size());
    for (const Model::Group& g : model.groups()) {
        REQUIRE(g.begin == end && g.end > g.begin);
        end = g.end;
        REQUIRE(g.material >= 0 && g.material < std::ssize(used));
        REQUIRE(!used[g.material]++);
    }
    REQUIRE(end == model.nfaces());
    REQUIRE(std::all_of(used.begin(), used.end(), [](char u) { return u == 1; }));
    for (const Material& m : model.materials()) {
        for (int i = 0; i < 3; i++) REQUIRE(m.Kd[i] >= 0 && m.Kd[i] <= 1 && m.Ke[i] >= 0 && m.Ke[i] <= 1);
        REQUIRE(!m.normal || !m.tangent);
        for (const Map& map : {m.normal, m.tangent}) REQUIRE(!map || !map->is_grey());
        for (const Map* map : {&m.diffuse, &m.normal, &m.tangent, &m.specular, &m.glow}) {
            const vec2 a = map->scale, b = map->offset;
            REQUIRE(is_finite({a.x, a.y, 0}) && is_finite({b.x, b.y, 0}));
            REQUIRE(map->is_moved || (a == vec2{1, 1} && b == vec2{}));
        }
    }
    for (int i = 0; i < 3 * model.nfaces() && model.has_colors(); i++)
        for (int k = 0; k < 3; k++) REQUIRE(model.color(i / 3, i % 3)[k] >= 0 && model.color(i / 3, i % 3)[k] <= 1);
    REQUIRE(model.notes().size() <= 11);  // kinds
    for (const std::string& note : model.notes()) REQUIRE(is_one_line(note));
}

// After fit() every vertex is seen within [-1,1]^2, and some on its border unless all are at one place.
void check_fit(const Model& model) {
    std::vector<Model> scene(1, model);
    if (!fit(scene)) return;
    const vec3 eye{1, 1, 4};
    const mat4 ModelView = lookat(eye, {}, {0, 1, 0});
    double most = 0;
    bool is_point = true;
    for (const vec3& v : scene[0].verts()) {
        REQUIRE(is_finite(v));
        is_point = is_point && v == scene[0].vert(0);
        const vec4 p = ModelView * point(v);  // in the square where max(|x|,|y|) is at most w = 1 - z/|eye|
        most = std::max(most, std::max(std::fabs(p.x), std::fabs(p.y)) + p.z / norm(eye));
    }
    REQUIRE(most <= 1 + 1e-14 && (is_point || most >= 1 - 1e-14));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static Files files;
    // The fixed part is what a thread, a piece of a file and the messages take, the factor more than twice what was
    // measured: paths of many folders take most.
    static MemoryBound bound(160 << 10, 256);
    files.write({reinterpret_cast<const char*>(data), size});

    Model model;
    start_peak();
    try {
        model = Model(files.obj(), size % 2 ? NormalMap::object : NormalMap::tangent);
        model.load_textures();
    } catch (const std::runtime_error& e) {  // of a file by its whole path, and nothing of the library's own
        const std::string what = e.what();
        if (!is_one_line(what) || what[0] != '/' || what.find(": ") == what.npos) refuse(what);
    }
    bound.check(peak_bytes(), size);
    if (model.nfaces() == 0) return 0;
    check(model);
    check_fit(model);
    return 0;
}
