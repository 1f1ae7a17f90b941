// model_test.cpp: what model.cpp promises about real .obj and .mtl files, polygons, normals, textures and fitting.
// Every file it reads it writes first, into a fresh folder that it removes at the end.
#include "model.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "check.h"
#include "files.h"

namespace fs = std::filesystem;

namespace {

// ---- files ----

class Folder : public TemporaryFolder {
public:
    Folder() : TemporaryFolder("model_test") {}

    std::filesystem::path write(const std::string& name, const std::string& text) const {
        write_bytes(*this / name, Bytes(text.begin(), text.end()));
        return *this / name;
    }
    // A picture of one colour: its first channel tells which file it came from.
    void picture(const std::string& name, int first_channel, TGAImage::Format format = TGAImage::RGB,
                 int side = 2) const {
        TGAImage image(side, side, format);
        TGAColor color;
        for (int i = 0; i < 4; i++) color[i] = static_cast<std::uint8_t>(first_channel + i);
        for (int y = 0; y < side; y++)
            for (int x = 0; x < side; x++) image.set(x, y, color);
        image.write_tga_file(*this / name);
    }
};

Model load(const std::string& text) {
    const Folder folder;
    return Model(folder.write("model.obj", text));
}

// ---- what is looked at ----

// The faces as text: "0/4 1/5 2/-1, ...", vertex and texture index of each corner.
std::string faces(const Model& m) {
    std::string out;
    for (int f = 0; f < m.nfaces(); f++)
        for (int c = 0; c < 3; c++) {
            const Model::Corner& k = m.corner(f, c);
            out.append(c ? " " : f ? ", " : "").append(std::to_string(k.vert));
            if (k.uv >= 0) out.append("/").append(std::to_string(k.uv));
        }
    return out;
}
std::string faces(const std::string& text) { return faces(load(text)); }

std::string text(const vec3& v) { return shown(v.x) + " " + shown(v.y) + " " + shown(v.z); }
std::string normals(const Model& m, int face) {
    return text(m.normal(face, 0)) + ", " + text(m.normal(face, 1)) + ", " + text(m.normal(face, 2));
}
std::string notes(const Model& m) {
    std::string out;
    for (const std::string& note : m.notes()) out += note + "\n";
    return out;
}
int first(const Map& map) { return map ? map->get(0, 0)[0] : -1; }

bool finite(const vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

// What holds for every model, whatever the file.
void check_invariants(const Model& m) {
    CHECK(m.nfaces() > 0);
    bool indices = true, units = true, numbers = true;
    for (const vec3& v : m.verts()) numbers = numbers && finite(v);
    for (int f = 0; f < m.nfaces(); f++)
        for (int c = 0; c < 3; c++) {
            const Model::Corner& k = m.corner(f, c);
            indices = indices && k.vert >= 0 && k.vert < m.nverts() && k.uv >= -1 && k.normal >= 0;
            numbers = numbers && std::isfinite(m.uv(f, c).x) && std::isfinite(m.uv(f, c).y);
            // Three squares, two sums, a root and a division, each off by half an epsilon at most.
            units = units && std::fabs(norm(m.normal(f, c)) - 1) <= 4 * std::numeric_limits<double>::epsilon();
        }
    CHECK(indices);
    CHECK(numbers);
    CHECK(units);
    int face = 0, material = -1;
    for (const Model::Group& g : m.groups()) {
        CHECK_EQ(g.begin, face);
        CHECK(g.end > g.begin);
        CHECK(g.material > material);
        face = g.end;
        material = g.material;
    }
    CHECK_EQ(face, m.nfaces());
    CHECK_EQ(m.groups().size(), m.materials().size());
    for (const Material& each : m.materials())
        for (const Map& map : {each.normal, each.tangent}) CHECK(!map || map->bytespp() >= 3);
}

const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
const std::string extras = "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nvn 0 1 0\nvn 1 0 0\n";

struct Case {
    std::string obj, expected;
};
// Each is an .obj and its faces.
void check_faces(const std::vector<Case>& cases) {
    for (const Case& c : cases) CHECK_EQ(faces(c.obj), c.expected);
}
// Each is an .obj and what is said of its first error.
void check_errors(const std::vector<Case>& cases) {
    for (const Case& c : cases) CHECK_THROWS(load(c.obj), ("model.obj:" + c.expected).c_str());
}

}  // namespace

// ---- corners ----

TEST("a corner may be v, v/vt, v//vn or v/vt/vn, each by itself") {
    CHECK_EQ(faces(square + extras + "f 1 2 3\n"), "0 1 2");
    CHECK_EQ(faces(square + extras + "f 1/3 2/2 3/1\n"), "0/2 1/1 2/0");
    const Model normals_only = load(square + extras + "f 1//1 2//2 3//3\n");
    CHECK_EQ(faces(normals_only), "0 1 2");
    CHECK_EQ(normals(normals_only, 0), "0 0 1, 0 1 0, 1 0 0");
    const Model all = load(square + extras + "f 1/3/3 2/2/2 3/1/1\n");
    CHECK_EQ(faces(all), "0/2 1/1 2/0");
    CHECK_EQ(normals(all, 0), "1 0 0, 0 1 0, 0 0 1");
    const Model mixed = load(square + extras + "f 1 2/2 3//3\nf 2/1/3 3/ 4//\n");
    check_invariants(mixed);
    CHECK_EQ(faces(mixed), "0 1/1 2, 1/0 2 3");
    CHECK_EQ(text(mixed.normal(0, 2)), "1 0 0");
    CHECK_EQ(text(mixed.normal(0, 0)), "0 0 1");  // none given
    CHECK_EQ(text(mixed.normal(1, 0)), "1 0 0");
    CHECK_EQ(mixed.uv(0, 1).x, 1);
    CHECK(mixed.uv(0, 0) == vec2{});
}

TEST("indices may count back from what is defined so far, or look ahead") {
    check_faces({{square + "f -4 -3 -2\nv 2 2 2\nf -1 -2 -5\n", "0 1 2, 4 3 0"},
                 {square + extras + "f -4/-1/-1 2/-3 -2\n", "0/2 1/0 2"},
                 {"f 1/1 2/2 3/1\n" + square + extras, "0/0 1/1 2/0"}});
    CHECK_EQ(normals(load("f 1//1 2//2 3//3\n" + square + extras), 0), "0 0 1, 0 1 0, 1 0 0");
}

TEST("quads and polygons become triangles that wind alike") {
    check_faces({{square + "f 1 2 3 4\n", "0 1 2, 0 2 3"},
                 {square + "f 4 3 2 1\n", "3 2 1, 3 1 0"},
                 {square + "v .5 1.5 0\nf 1 2 3 5 4\n", "0 1 2, 0 2 4, 0 4 3"},
                 {square + extras + "f 1/1 2/2 3/3 4/2\n", "0/0 1/1 2/2, 0/0 2/2 3/1"}});
}

// ---- lines ----

TEST("line ends, tabs, blanks, comments and continued lines; the last line needs no newline") {
    check_faces({
        {"v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nvt 0 0\r\nf 1/1 2/1 \\\r\n3/1\r\n", "0/0 1/0 2/0"},
        {"\tv\t0 0\t\t0\n  v 1  0 0 \n \t v 1 1 0\t\n   f  1\t2   3  \n", "0 1 2"},
        {"# a head\nv 0 0 0 # origin\nv 1 0 0#near\n  # \\\nv 1 1 0\nf 1 2 3 # a face \\\nf 3 2 1#\n#", "0 1 2, 2 1 0"},
        {"v 0 \\\n0 0\nv\\\n1 0 0\nv 1 1\\\n 0\nf 1 \\\n\\\n 2\\  \n 3\n", "0 1 2"},
        {"o one \\\nf 1 1 1\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\\", "0 1 2"},
        {square + "f 1 2 3 \\", "0 1 2"},
        {square + "f 1 2 3 \\\n\\\n", "0 1 2"},
        {square + "f 1 2 3", "0 1 2"},
        {square + "f 1 2 3\r", "0 1 2"},
        {"\n\n\r\n \t\n" + square + "\n\n\nf 1 2 3\n\n", "0 1 2"},
    });
    check_errors({{"v 0 0 0\r\n\r\nf 1 1 2\r\n", "3:"},
                  {"v 0 0 \\\n 0\nv 1 0 0\nv x 1 1\n", "4: 'x' is no finite number"},
                  {"v 0 0 \\\n 0\nv 1 \\\n y 0\n", "4: 'y' is no finite number"},
                  {"o a \\\n b \\\n c\nf 1 2 0\n", "4: vertex index 0"},
                  {square + "f 1 \\\n 2\n", "6: a face needs three corners, this one has 2"},
                  {square + "f 1 \\2 3\n", "5:"}});
    CHECK_EQ(load("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 1 1 .5").verts()[2].z, .5);
    for (int size = 4093; size <= 4100; size++) {  // around a page's end: a mapped file may fill its pages
        std::string obj = square + "f 1 2 3\n#";
        obj += std::string(size - obj.size() - 8, '-') + "\nf 2 3 4";
        check_faces({{obj, "0 1 2, 1 2 3"}, {obj + "\n", "0 1 2, 1 2 3"}, {obj + "\\", "0 1 2, 1 2 3"}});
    }
}

TEST("lines of a megabyte") {
    const std::string blanks(1200000, ' ');
    CHECK_EQ(faces(square + "#" + std::string(1500000, 'x') + "\nf 1 2" + blanks + "3\n"), "0 1 2");
    CHECK_EQ(faces(square + "curv " + std::string(3000000, '1') + "\nf 1 2 3\n"), "0 1 2");
    std::string many = square + "f";
    for (int i = 0; i < 300000; i++) many += " 1 2 3";
    const Model m = load(many + "\nf 2 3 4");
    CHECK_EQ(m.nfaces(), 3 * 300000 - 2 + 1);
    CHECK_EQ(m.corner(m.nfaces() - 1, 0).vert, 1);
    CHECK_THROWS(load(square + "f 1 2" + blanks + "0\n"), "model.obj:5: vertex index 0");
    std::string continued = square + "f 1 2 3";
    for (int i = 0; i < 400000; i++) continued += "\\\n ";  // a line of a megabyte in many pieces
    CHECK_EQ(faces(continued + "4"), "0 1 2, 0 2 3");
    CHECK_THROWS(load(continued + "x"), "model.obj:400005: 'x' is no vertex index");
}

TEST("a byte order mark is skipped") {
    CHECK_EQ(load("\xEF\xBB\xBFv 5 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n").verts()[0].x, 5);
    CHECK_THROWS(load("\xEF\xBB\xBF\n\nf 0 1 1"), "model.obj:3:");
}

TEST("o, g, s, lines, curves and unknown words are passed over") {
    CHECK_EQ(faces("o head\ng a b c\ns 1\ns off\n" + square +
                   "vp 1 2 3\nl 1 2\np 1\ncstype bezier\nverse 1 2\nfoo\nV 1 2 3\nF 1 2 3\nvt\xC3\xA9 x\n\x01\x02\nf 1 "
                   "2 3\nend\n"),
             "0 1 2");
}

// ---- numbers ----

TEST("numbers are read as strtod reads them, to the last bit") {
    std::vector<std::string> numbers = {
        "0", "-0", "+1", ".5", "-.5", "+.5", "5.", "1e3", "1E3", "1e+3", "1.5e-3", "-2.5E-10", "00012.50",
        "999999999999999", "9999999999999999", "0.1", "123456789.123456", "1.23456789012345", "0.000000000000001",
        "9007199254740993",
        "2.2250738585072014e-308", "5e-324", "1e-310", "1.7976931348623157e308", "0.30000000000000004",
        "179769313486231570000000000000e279", "100000000000000000000000000000000000000",
        "0.00000000000000000000000000000000001", "1e-400", "-1e-400", "0e999", "0.0e-999", "1e-99999999999999999999",
        "1" + std::string(400, '0') + "e-400", "0." + std::string(400, '0') + "1",
        "0." + std::string(400, '0') + "1e402"};
    std::mt19937 random(2);
    for (int i = 0; i < 20000; i++) {
        std::string s = random() % 3 == 0 ? "-" : "";
        for (auto n = random() % 12; n-- > 0;) s += static_cast<char>('0' + random() % 10);
        s += '.';
        for (auto n = 1 + random() % 12; n-- > 0;) s += static_cast<char>('0' + random() % 10);
        if (random() % 4 == 0) s.append("e").append(std::to_string(static_cast<int>(random() % 560) - 280));
        numbers.push_back(s);
    }
    std::string obj;
    for (const std::string& s : numbers) obj += "v " + s + " 0 0\nf -1 -1 -1\n";
    const Model m = load(obj);
    int wrong = 0;
    for (std::size_t i = 0; i < numbers.size(); i++) {
        const double expected = std::strtod(numbers[i].c_str(), nullptr), got = m.verts()[i].x;
        if (expected == got && std::signbit(expected) == std::signbit(got)) continue;
        if (++wrong < 5) report_failure(__FILE__, __LINE__, numbers[i] + " was read as " + shown(got));
    }
    CHECK_EQ(wrong, 0);
}

TEST("a weight or colours after the coordinates are passed over") {
    const Model m =
        load("v 0 0 0 1\nv 1 0 0 .5 .5 .5\nv 1 1 0 .1 .2 .3 1\nvt 1\nvt .5 .25 0\nvn 0 0 2 1\nf 1/1/1 2/2/1 3/1/1\n");
    CHECK_EQ(text(m.verts()[1]), "1 0 0");
    CHECK(m.uv(0, 0) == (vec2{1, 0}));
    CHECK(m.uv(0, 1) == (vec2{.5, .25}));
    CHECK_EQ(text(m.normal(0, 0)), "0 0 1");
}

TEST("what is no finite number or no index is an error with its line") {
    const std::string long_number = "1" + std::string(400, '0');
    for (const std::string bad :
         {"nan", "-nan", "NaN", "inf", "+inf", "-Infinity", "1e999", "-1e309", "1e99999999999999999999", "nan(7)",
          "179769313486231570000000000000e280", "1x", "1.2.3", "1e", "1e+", "1-2", "0x10", "1,5", "1_0", "1/2", "1\\2",
          "x", ".", "-", "+", "+-1", "-+1", "--1", "e5", ",5", "one", "\\1", "/"})
        check_errors({{"\nv 0 " + bad + " 0\n", "2: '" + bad + "' is no finite number"},
                      {"\nvt " + bad + " 0\n", "2: '" + bad + "' is no finite number"},
                      {"\nvn 0 0 " + bad + "\n", "2: '" + bad + "' is no finite number"},
                      {"\nv 0 0 0 " + bad + "\n", "2: '" + bad + "' is no finite number"}});
    check_errors({{"v " + long_number + " 0 0\n", "1: '1" + std::string(59, '0') + "...' is no finite number"},
                  {"v 0 0 1\x02\n", "1: '1?' is no finite number"},
                  {"v 0 0 \x1B[2J\n", "1: '?[2J' is no finite number"}});  // nothing of it can steer a terminal
    for (const std::string bad : {"1x", "1/1x", "1//1x", "1/1/1/1", "1.0", "1/1/1x", "1e0"})
        check_errors({{square + extras + "f 1 2 " + bad + "\n", "11: garbage after a number: '"}});
    for (const std::string bad : {"x", "/1", "//1", "-", "+", "--1", "nan", "2147483648", "4294967297", "-2147483648",
                                  "99999999999999999999999999", "18446744073709551617"})
        check_errors({{square + extras + "f 1 2 " + bad + "\n", "11: '" + bad + "' is no vertex index"}});
    check_errors({{square + extras + "f 1 2/x 3\n", "11: 'x' is no texture index"},
                  {square + extras + "f 1 2/- 3\n", "11: '-' is no texture index"},
                  {square + extras + "f 1 2//x 3\n", "11: 'x' is no normal index"}});
}

TEST("too few numbers or corners, an index of zero or out of range are errors with their line") {
    check_errors({
        {"v 1 2\n", "1: a vertex needs three coordinates"},
        {"\nv\n", "2: a vertex needs three coordinates"},
        {"v 1 2 #3\n", "1: a vertex needs three coordinates"},
        {"vn 1 2\n", "1: a normal needs three coordinates"},
        {"vt\n", "1: a texture coordinate needs a number"},
        {square + "f\n", "5: a face needs three corners, this one has 0"},
        {square + "f 1 2\n", "5: a face needs three corners, this one has 2"},
        {square + "f 1 2 # 3\n", "5: a face needs three corners, this one has 2"},
        {square + "f 1 2 0\n", "5: vertex index 0 (indices count from 1)"},
        {square + extras + "f 1 2 3/0\n", "11: texture index 0 (indices count from 1)"},
        {square + extras + "f 1 2 3//-0\n", "11: normal index 0 (indices count from 1)"},
        {square + "vt 0 0\nvt 1 0\nvn 0 0 1\nf 1//2 2 3\n", "8: normal index 2, but the file has only 1"},
        {square + "vt 0 0\nvn 0 0 1\nvn 1 0 0\nf 1/2 2 3\n", "8: texture index 2, but the file has only 1"},
        {square + "f 1 2 5\n\nf 1 2 3\n", "5: vertex index 5, but the file has only 4"},
        {square + "f 1 2 3\nf 1/1 2 3\n", "6: texture index 1, but the file has only 0"},
        {square + extras + "f 1//4 2 3\n", "11: normal index 4, but the file has only 3"},
        {"f 1 2 3\n\nf 1 2 5\nf 9 9 9\n" + square, "3: vertex index 5, but the file has only 4"},
        {square + "f 1 2 -5\nv 0 0 0\n", "5: vertex index -5, but only 4 are defined so far"},
        {square + "f 1/-1 2 3\n", "5: texture index -1, but only 0 are defined so far"},
        {square + "f 1 2 2147483647\n", "5: vertex index 2147483647, but the file has only 4"},
    });
}

// ---- files as a whole ----

TEST("a file without a face is an error") {
    for (const std::string& obj : {std::string(), square, std::string("\\"), std::string("a letter,\nno model.\n")})
        CHECK_THROWS(load(obj), "model.obj: no faces");
}

TEST("a missing file, a folder and a binary file are errors") {
    const Folder folder;
    CHECK_THROWS(Model(folder / "none.obj"), "none.obj: cannot be opened: ");
    fs::create_directory(folder / "folder.obj");
    CHECK_THROWS(Model(folder / "folder.obj"), "folder.obj: is a directory");
    if (fs::is_other("/dev/null")) {  // a device or a pipe that a file names might never end
        const std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib /dev/null\nf 1 2 3\n";
        write_bytes(folder / "device.obj", Bytes(text.begin(), text.end()));
        CHECK_THROWS(Model(folder / "device.obj"), "/dev/null: is not a file");
    }
    CHECK_THROWS(load(square + "f 1 2 3\n" + std::string(1, '\0')), "model.obj: is a binary file, not text");
    std::string utf16;
    for (const char c : square) utf16 += {c, '\0'};
    CHECK_THROWS(load(utf16), "model.obj: is a binary file, not text");
}

TEST("no texture coordinates and no normals are no error") {
    const Model m = load(square + "f 1 2 3 4\n");
    check_invariants(m);
    CHECK(m.uv(1, 2) == vec2{});
    CHECK_EQ(m.corner(0, 0).uv, -1);
    CHECK_EQ(normals(m, 1), "0 0 1, 0 0 1, 0 0 1");
    CHECK_EQ(m.materials().size(), 1u);
    CHECK_EQ(m.materials()[0].name, "");
    CHECK(m.materials()[0].Kd == (vec3{1, 1, 1}));
    CHECK_EQ(m.groups().size(), 1u);
    CHECK_EQ(notes(m), "");
}

// ---- polygons ----

namespace {

using Polygon = std::vector<vec2>;

double below(std::mt19937& random, int n) { return static_cast<double>(random() % n); }  // a whole number in [0,n)

double area2(const vec2& a, const vec2& b, const vec2& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}
double area2(const Polygon& p) {
    double sum = 0;
    for (std::size_t i = 1; i + 1 < p.size(); i++) sum += area2(p[0], p[i], p[i + 1]);
    return sum;
}

// The polygon as an .obj: its point (x,y) is placed at x*right + y*up.
std::string in_plane(const Polygon& p, const vec3& right = {1, 0, 0}, const vec3& up = {0, 1, 0}, double scale = 1) {
    std::string obj;
    char line[200];
    for (const vec2& q : p) {
        const vec3 v = (right * q.x + up * q.y) * scale;
        std::snprintf(line, sizeof line, "v %.17g %.17g %.17g\n", v.x, v.y, v.z);
        obj += line;
    }
    obj += "f";
    for (std::size_t i = 1; i <= p.size(); i++) obj.append(" ").append(std::to_string(i));
    return obj + "\n";
}

struct Cut {
    int faces = 0, empty = 0, reversed = 0;  // triangles in all, without area, and wound the wrong way
    double area2 = 0;                        // their signed areas' sum
};
Cut cut(const Polygon& p, const Model& m) {
    Cut result;
    const double sign = area2(p) < 0 ? -1 : 1;
    result.faces = m.nfaces();
    for (int f = 0; f < m.nfaces(); f++) {
        vec2 t[3];
        for (int c = 0; c < 3; c++) t[c] = p[m.corner(f, c).vert];
        const double a = area2(t[0], t[1], t[2]);
        result.area2 += a;
        result.empty += a == 0;
        result.reversed += a * sign < 0;
    }
    return result;
}

// With whole numbers as coordinates every area is exact. Signed areas always add up to the polygon's; so where none is
// reversed the triangles cover the polygon, and each of its points once.
void check_cut(const Polygon& p, bool empty_allowed = false) {
    const std::pair<vec3, vec3> planes[] = {{{1, 0, 0}, {0, 1, 0}},  {{0, 1, 0}, {0, 0, 1}},  {{0, 0, 1}, {1, 0, 0}},
                                            {{2, 1, 0}, {-1, 3, 1}}, {{0, -1, 0}, {3, 0, 1}}, {{1, 0, 0}, {0, -1, 0}}};
    for (const auto& [right, up] : planes) {
        const Cut result = cut(p, load(in_plane(p, right, up)));
        CHECK_EQ(result.faces, static_cast<int>(p.size()) - 2);
        CHECK_EQ(result.area2, area2(p));
        CHECK_EQ(result.reversed, 0);
        if (!empty_allowed) CHECK_EQ(result.empty, 0);
    }
}
Polygon reversed(Polygon p) {
    std::reverse(p.begin(), p.end());
    return p;
}

// Points on rays in the order of their angle, at random distances: concave as a rule, and it crosses nowhere.
Polygon random_star(std::mt19937& random, int n) {
    Polygon p;
    for (int i = 0; i < n; i++) {
        const double angle = (i + below(random, 100) / 100) * 6.28 / n, r = 1000 + 100 * below(random, 1000);
        p.push_back({std::round(r * std::cos(angle)), std::round(r * std::sin(angle))});
    }
    return p;
}

}  // namespace

TEST("concave polygons are covered exactly once, in any plane, from any first corner") {
    const Polygon shapes[] = {
        {{0, 0}, {4, 0}, {1, 1}, {0, 4}},  // a dart
        {{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 6}, {0, 6}},  // an L
        {{0, 0}, {9, 0}, {9, 9}, {6, 9}, {6, 3}, {3, 3}, {3, 9}, {0, 9}},  // a U
        {{0, 0}, {2, 8}, {4, 1}, {6, 8}, {8, 1}, {10, 8}, {12, 0}, {12, -1}, {0, -1}},  // a comb
        {{0, 0}, {10, 0}, {10, 10}, {2, 10}, {2, 4}, {6, 4}, {6, 6}, {4, 6}, {4, 8}, {8, 8}, {8, 2},
         {0, 2}},  // a spiral
        {{0, 3}, {2, 2}, {3, 0}, {4, 2}, {6, 3}, {4, 4}, {3, 6}, {2, 4}},  // a star
        {{0, 0}, {1, 0}, {2, 0}, {2, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}},  // a square, its sides halved
        {{0, 0}, {1, 0}, {2, 0}, {3, 0}, {0, 3}},  // a triangle with five corners
    };
    for (Polygon p : shapes) {
        for (std::size_t i = 0; i < p.size(); i++) {
            check_cut(p);
            check_cut(reversed(p));
            std::rotate(p.begin(), p.begin() + 1, p.end());
        }
    }
}

TEST("random stars are covered exactly once") {
    std::mt19937 random(3);
    for (int i = 0; i < 300; i++) check_cut(random_star(random, 4 + i));
}

TEST("a hole that a bridge joins to the outline, spikes and repeated corners") {
    // The bridge from (0,0) to (3,3) is walked twice.
    check_cut({{0, 0}, {9, 0}, {9, 9}, {0, 9}, {0, 0}, {3, 3}, {3, 6}, {6, 6}, {6, 3}, {3, 3}}, true);
    check_cut({{0, 0}, {9, 0}, {9, 9}, {0, 9}, {0, 0}, {1, 1}, {1, 2}, {2, 2}, {5, 5}, {5, 7}, {7, 7}, {7, 5}, {5, 5},
               {2, 2}, {2, 1}, {1, 1}}, true);
    check_cut({{0, 0}, {4, 0}, {4, 4}, {7, 9}, {4, 4}, {0, 4}}, true);  // outward
    check_cut({{0, 0}, {4, 0}, {4, 4}, {2, 1}, {4, 4}, {0, 4}}, true);  // inward
    check_cut({{0, 0}, {4, 0}, {8, 0}, {4, 0}, {4, 4}, {0, 4}}, true);  // along an edge
    check_cut({{0, 0}, {0, 0}, {4, 0}, {4, 4}, {4, 4}, {4, 4}, {1, 1}, {0, 4}}, true);
}

TEST("a square with a cut along a random tree, walked around on both sides") {
    std::mt19937 random(11);
    constexpr int n = 6, directions[4][2] = {{1, 0}, {0, -1}, {-1, 0}, {0, 1}};  // clockwise
    for (int round = 0; round < 300; round++) {
        bool used[n][n] = {}, edge[n][n][4] = {};  // the lattice points of the tree and its edges
        std::vector<std::pair<int, int>> nodes{{0, 0}};
        used[0][0] = true;
        for (int i = 0; i < 60; i++) {
            const auto [x, y] = nodes[random() % nodes.size()];
            const unsigned d = random() % 4;
            const int nx = x + directions[d][0], ny = y + directions[d][1];
            if (nx < 0 || ny < 0 || nx >= n || ny >= n || used[nx][ny]) continue;
            used[nx][ny] = edge[x][y][d] = edge[nx][ny][(d + 2) % 4] = true;
            nodes.push_back({nx, ny});
        }
        // The walk keeps its left hand free: from each node on to the next edge clockwise from where it came.
        Polygon p = {{-1, -1}, {n, -1}, {n, n}, {-1, n}, {-1, -1}};
        int x = 0, y = 0;
        unsigned back = 2;  // from the corner, that is between -x and -y
        for (std::size_t steps = 0;; steps++) {
            p.push_back({1. * x, 1. * y});
            if (steps == 2 * (nodes.size() - 1)) break;
            unsigned d = (back + (steps ? 1u : 0u)) % 4;
            while (!edge[x][y][d]) d = (d + 1) % 4;
            x += directions[d][0];
            y += directions[d][1];
            back = (d + 2) % 4;
        }
        CHECK(x == 0 && y == 0);
        std::rotate(p.begin(), p.begin() + random() % p.size(), p.end());
        const Cut result = cut(p, load(in_plane(p, {2, 1, 0}, {-1, 3, 1})));
        CHECK_EQ(result.faces, static_cast<int>(p.size()) - 2);
        CHECK_EQ(result.area2, 2. * (n + 1) * (n + 1));
        CHECK_EQ(result.reversed, 0);
    }
}

TEST("polygons without area, or that cross themselves, have two triangles fewer than corners") {
    for (const Polygon& p : {Polygon{{0, 0}, {1, 1}, {2, 2}, {3, 3}, {1, 1}}, Polygon(7, vec2{1, 1}),
                             Polygon{{0, 0}, {2, 2}, {2, 0}, {0, 2}}, Polygon{{0, 0}, {2, 0}, {0, 0}, {2, 0}},
                             Polygon{{0, 3}, {2, -3}, {-3, 1}, {3, 1}, {-2, -3}}}) {
        const Model m = load(in_plane(p));
        check_invariants(m);
        CHECK_EQ(m.nfaces(), static_cast<int>(p.size()) - 2);
    }
    std::mt19937 random(4);
    for (int i = 0; i < 500; i++) {
        Polygon p;
        for (auto n = 4 + random() % 30; n-- > 0;)
            p.push_back({below(random, 6), below(random, 6)});
        const Model m = load(in_plane(p));
        CHECK_EQ(m.nfaces(), static_cast<int>(p.size()) - 2);
        CHECK_EQ(cut(p, m).area2, area2(p));
    }
    Polygon star;  // of 100 points, twice around
    for (int i = 0; i < 100; i++) star.push_back({std::cos(i * .13), std::sin(i * .13)});
    CHECK_EQ(notes(load(in_plane(star))), "polygons that cross themselves or have too many corners: 1\n");
}

TEST("a polygon is cut alike at every scale, to the ends of the double's range") {
    const Polygon p = {{0, 0}, {10, 0}, {10, 10}, {2, 10}, {2, 4}, {6, 4},
                       {6, 6}, {4, 6},  {4, 8},   {8, 8},  {8, 2}, {0, 2}};
    Polygon centred = p;  // so that differences overflow where coordinates do not
    for (vec2& q : centred) q = q - vec2{5, 5};
    for (const Polygon& shape : {p, centred}) {
        const std::string expected = faces(in_plane(shape, {2, 1, 0}, {-1, 3, 1}));
        for (const double scale :
             {1e-30, 1e38, 1e300, std::ldexp(1., 1017), std::ldexp(1., -1074), std::ldexp(1., -1040)})
            CHECK_EQ(faces(in_plane(shape, {2, 1, 0}, {-1, 3, 1}, scale)), expected);
    }
    CHECK_EQ(faces(in_plane(centred, {2, 1, 0}, {-1, 3, 1}, std::ldexp(1., 1019))),
             faces(in_plane(centred, {2, 1, 0}, {-1, 3, 1})));
    // A tiny one far from the origin, across the direction to it.
    std::string far = in_plane(p, {0, 1e-300, 0}, {0, 0, 1e-300});
    for (std::size_t at = 0; (at = far.find("v 0 ", at)) != far.npos;) far.replace(at, 4, "v 1 ");
    CHECK_EQ(faces(far), faces(in_plane(p)));
}

TEST("polygons of very many corners: concave ones are cut up to a thousand, convex ones always") {
    const auto comb = [](int n) {
        Polygon p;
        for (int i = 0; i < n / 2; i++) p.insert(p.end(), {{2. * i, 0}, {2. * i + 1, 1000}});
        p.back() = {1. * n, -1};
        p.push_back({0, -1});
        return p;
    };
    check_cut(comb(999));
    Polygon spiral, bow;
    for (int i = 0; i < 1000; i++) {
        const double angle = (i < 500 ? i : 999 - i) * .1, r = 1 + angle + (i < 500 ? 0 : 2);
        spiral.push_back({r * std::cos(angle), r * std::sin(angle)});
    }
    const Cut of_spiral = cut(spiral, load(in_plane(spiral)));
    CHECK_EQ(of_spiral.faces, 998);
    CHECK_EQ(of_spiral.reversed, 0);
    const int n = 100000;
    for (int i = 0; i < n; i++) bow.push_back({1. * i, 1e-5 * i * i});
    const Model convex = load(in_plane(bow));
    CHECK_EQ(cut(bow, convex).reversed, 0);
    CHECK_EQ(notes(convex), "");
    for (const int corners : {1001, n + 1}) {  // a fan, that covers more than the polygon
        const Model m = load(in_plane(comb(corners - 1)));
        CHECK_EQ(m.nfaces(), corners - 2);
        CHECK_EQ(notes(m), "polygons that cross themselves or have too many corners: 1\n");
    }
}

// ---- normals ----

namespace {

std::string cube(const char* scale_exponent = "") {
    std::string obj;
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 3; k++)
            obj += (k ? " " : "v ") + std::string(i >> k & 1 ? "1" : "-1") + scale_exponent + (k == 2 ? "\n" : "");
    return obj;
}
const std::string cube_quads = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

void check_near(const vec3& a, const vec3& b, double tolerance) {
    for (int i = 0; i < 3; i++) CHECK_NEAR(a[i], b[i], tolerance);
}

// Each result below is a handful of operations of half an epsilon, on numbers of at most 4.
constexpr double few_roundings = 16 * std::numeric_limits<double>::epsilon();

}  // namespace

TEST("normals are weighted by angle, so it does not matter how a cube's sides are cut") {
    for (const std::string& sides :
         {cube_quads, std::string("f 1 3 4\nf 1 4 2\nf 6 8 7\nf 6 7 5\nf 1 2 6\nf 1 6 5\nf 3 7 8\nf 3 8 4\n"
                                  "f 1 5 7\nf 1 7 3\nf 2 4 8\nf 2 8 6\n")}) {
        const Model m = load(cube() + sides);
        check_invariants(m);
        CHECK_EQ(m.nfaces(), 12);
        for (int f = 0; f < m.nfaces(); f++)
            for (int c = 0; c < 3; c++) check_near(m.normal(f, c), m.vert(f, c) / std::sqrt(3.), few_roundings);
    }
    // Around (0,0,0): 90 degrees of the plane z = 0, 45 of the plane y = 0 seen from -y.
    const Model m = load("v 0 0 0\nv 1 0 0\nv 0 5 0\nv 7 0 7\nf 1 2 3\nf 1 2 4\n");
    check_near(m.normal(0, 0), normalized(vec3{0, -1, 2}), few_roundings);
}

TEST("made normals do not depend on the scale") {
    const Model unit = load(cube() + cube_quads);
    for (const char* scale : {"e-30", "e38", "e300", "e-300", "e308", "e-320"}) {
        const Model m = load(cube(scale) + cube_quads);
        check_invariants(m);
        for (int f = 0; f < m.nfaces(); f++)
            for (int c = 0; c < 3; c++) check_near(m.normal(f, c), unit.normal(f, c), few_roundings);
    }
    const Model flat = load("v -1.7e308 -1.7e308 1e308\nv 1.7e308 -1.7e308 1e308\nv 0 1.7e308 1e308\nf 1 2 3\n");
    CHECK_EQ(normals(flat, 0), "0 0 1, 0 0 1, 0 0 1");
    const Model needle = load("v 0 0 0\nv 1 0 0\nv 1 1e-200 0\nf 1 2 3\n");
    CHECK_EQ(normals(needle, 0), "0 0 1, 0 0 1, 0 0 1");
}

TEST("faces without area contribute nothing") {
    const std::string obj = "v 0 0 0\nv 3 0 0\nv 0 3 1\nv .1 .1 .1\nv .3 .3 .3\nv 9 9 9\nf 1 2 3\n";
    const std::string expected = normals(load(obj), 0);
    CHECK_EQ(normals(load(obj + "f 1 1 2\nf 2 2 2\nf 1 4 5\nf 3 1 3\n"), 0),
             expected);  // .1, .2, .3 are not on a line in binary
    // Rounding leaves the product of these edges, which are parallel, a component of 4e-17. It must not have a normal.
    CHECK_EQ(normals(load("v 0 0 0\nv .1 .1 .6\nv .3 .3 1.8\nf 1 2 3\n"), 0), "0 0 1, 0 0 1, 0 0 1");
    const Model m = load(obj + "f 4 5 6\nf 1 1 6\n");
    check_invariants(m);
    CHECK_EQ(normals(m, 0), expected);
    CHECK_EQ(text(m.normal(2, 0)), text(m.normal(0, 0)));  // the vertex has another face
    CHECK_EQ(text(m.normal(2, 2)), "0 0 1");               // it has none
    CHECK_EQ(text(m.normal(1, 0)), "0 0 1");
}

TEST("where faces cancel, each keeps its own normal") {
    const Model m = load("v 0 0 0\nv 1 .3 .2\nv .1 1 .7\nf 1 2 3\nf 1 3 2\n");
    check_invariants(m);
    const vec3 n = normalized(cross(m.verts()[1], m.verts()[2]));
    for (int c = 0; c < 3; c++) {
        check_near(m.normal(0, c), n, few_roundings);
        check_near(m.normal(1, c), -n, few_roundings);
    }
    // A sheet of many triangles and its other side.
    std::string obj;
    std::mt19937 random(6);
    for (int i = 0; i < 40; i++)
        obj += "v " + std::to_string(random() % 1000) + "e-3 " + std::to_string(random() % 1000) + "e-3 .123\n";
    for (int i = 1; i + 1 < 40; i++)
        for (const char* order : {"ab", "ba"}) {
            const std::string a = std::to_string(i), b = std::to_string(i + 1);
            obj += "f 40 " + (order[0] == 'a' ? a + " " + b : b + " " + a) + "\n";
        }
    const Model sheet = load(obj);
    check_invariants(sheet);
    for (int f = 0; f < sheet.nfaces(); f++)
        for (int c = 0; c < 3; c++) CHECK_EQ(std::fabs(sheet.normal(f, c).z), 1);
}

TEST("given normals are normalised; one without length is made") {
    const Model m =
        load(square + "vn 0 0 5\nvn 3e300 0 4e300\nvn 0 1e-310 0\nvn 0 0 0\nf 1//1 2//2 3//3\nf 1//4 3//-1 4\n");
    check_invariants(m);
    CHECK_EQ(text(m.normal(0, 0)), "0 0 1");
    check_near(m.normal(0, 1), {.6, 0, .8}, few_roundings);
    CHECK_EQ(text(m.normal(0, 2)), "0 1 0");
    CHECK_EQ(normals(m, 1), "0 0 1, 0 0 1, 0 0 1");
    CHECK_EQ(normals(load(square + "vn 0 0 0\nf 1//1 3//1 2//1\n"), 0), "0 0 -1, 0 0 -1, 0 0 -1");
}

// ---- materials ----

TEST("faces are grouped by material, in the order of their first faces") {
    const Folder folder;
    folder.write("m.mtl", "newmtl red\nKd 1 0 0\nnewmtl unused\nnewmtl blue\nKd 0 0 1\n");
    const Model m(folder.write(
        "m.obj",
        square +
            "mtllib m.mtl\nusemtl blue\nf 1 2 3\nusemtl red\nf 2 3 4\nusemtl blue\nf 3 4 1\nf 4 1 2\nusemtl red\n"));
    check_invariants(m);
    CHECK_EQ(faces(m), "0 1 2, 2 3 0, 3 0 1, 1 2 3");
    CHECK_EQ(m.materials().size(), 2u);
    CHECK_EQ(m.materials()[0].name, "blue");
    CHECK_EQ(m.materials()[1].name, "red");
    CHECK_EQ(text(m.materials()[0].Kd), "0 0 1");
    CHECK_EQ(m.groups()[0].end, 3);
    CHECK_EQ(notes(m), "");

    std::string many = square + "mtllib m.mtl\n", blue, red;
    for (int i = 0; i < 100; i++) {
        many += "v 0 0 0\n" + std::string(i % 2 ? "usemtl red" : "usemtl blue") + "\nf 1 2 -1\n";
        (i % 2 ? red : blue) += (blue.empty() ? "0 1 " : ", 0 1 ") + std::to_string(4 + i);
    }
    CHECK_EQ(faces(Model(folder.write("m.obj", many))), blue + red);  // stably
}

TEST("an unknown material is the default one, with a note") {
    const Folder folder;
    folder.write("m.mtl", "newmtl red\nKd .5\n");
    const Model m(folder.write("m.obj", square + "f 1 2 3\nusemtl green\nf 2 3 4\nusemtl red\nf 3 4 1\nusemtl pink\nf "
                                                 "4 1 2\nusemtl green\nf 1 2 4\nmtllib m.mtl\n"));
    check_invariants(m);
    CHECK_EQ(faces(m), "0 1 2, 1 2 3, 3 0 1, 0 1 3, 2 3 0");
    CHECK_EQ(m.materials().size(), 2u);
    CHECK_EQ(m.materials()[0].name, "");
    CHECK_EQ(text(m.materials()[1].Kd), "0.5 0.5 0.5");
    CHECK_EQ(notes(m), "there is no material 'green'\nthere is no material 'pink'\n");
}

TEST("a missing .mtl is a note, a bad one an error") {
    const Folder folder;
    CHECK_EQ(notes(Model(folder.write("m.obj", "mtllib none.mtl\n" + square + "f 1 2 3\n"))),
             "there is no material file 'none.mtl'\n");
    const std::string obj = "mtllib m.mtl\n" + square + "f 1 2 3\n";
    folder.write("m.obj", obj);
    for (const char* bad : {"Kd 1 x 0", "Kd nan", "Kd 1 2", "Kd", "Kd 1e999 0 0", "Kd 1 1 1y", "Kd spectre"}) {
        folder.write("m.mtl", "# a comment\r\nnewmtl a\r\n\r\n" + std::string(bad) + "\r\n");
        CHECK_THROWS(Model(folder / "m.obj"), "m.mtl:4: ");
    }
    folder.write("m.mtl", std::string("newmtl a\0", 9));
    CHECK_THROWS(Model(folder / "m.obj"), "m.mtl: is a binary file, not text");
    folder.write("m.mtl",
                 "\xEF\xBB\xBF"
                 "Kd 1 1 1\nnewmtl a\nKd xyz 1 1 1\nNs 10\nillum 2");
    folder.write("m.obj", "mtllib m.mtl\nusemtl a\n" + square + "f 1 2 3\n");
    CHECK_EQ(notes(Model(folder / "m.obj")), "m.mtl:3: Kd xyz is not known, white is used\n");
}

TEST("an mtllib line is one name with blanks, or several names") {
    const Folder folder;
    fs::create_directory(folder / "sub");
    folder.write("my own.mtl", "newmtl my own # colour\nKd .25\n");
    folder.write("sub/b.mtl", "newmtl b\nKd 2 -1 .5\n");
    const Model m(folder.write("m.obj", square + "mtllib \\\n my own.mtl \\\r\n \\\n\r\nmtllib sub\\b.mtl "
                                                 "c.mtl\nusemtl my own # colour \nf 1 2 3\nusemtl b\nf 1 2 3\n"));
    CHECK_EQ(m.materials().size(), 2u);
    CHECK_EQ(text(m.materials()[0].Kd), "0.25 0.25 0.25");
    CHECK_EQ(text(m.materials()[1].Kd), "1 0 0.5");  // a reflectance is in [0,1]
    CHECK_EQ(notes(m), "there is no material file 'c.mtl'\n");
}

TEST("notes are limited in number and length, and fit on a line each") {
    std::string obj = square;
    for (int i = 0; i < 100; i++)
        obj += "usemtl " + std::string(1000, 'x') + "\x1B\n" + "usemtl \x1B" + std::to_string(i) + "\nf 1 2 3\n";
    const Model m = load(obj);
    CHECK_EQ(m.notes().size(), 21u);
    CHECK_EQ(m.notes()[0], "there is no material '?0'");
    CHECK_EQ(m.notes().back(), "and 80 more like these");
    const Model long_name = load(square + "usemtl " + std::string(100000, 'x') + "\nf 1 2 3\n");
    CHECK(long_name.notes()[0].size() < 100);
}

// ---- textures ----

namespace {

const std::string textured = square + extras + "f 1/1 2/2 3/3\n";

void all_suffixes(const Folder& folder) {
    folder.picture("m_diffuse.tga", 10);
    folder.picture("m_nm.tga", 20);
    folder.picture("m_nm_tangent.tga", 30);
    folder.picture("m_spec.tga", 40, TGAImage::GRAYSCALE);
    folder.picture("m_glow.tga", 50);
}
std::string maps(const Material& m) {  // the first channels, -1 where there is no map
    return shown(first(m.diffuse)) + " " + shown(first(m.normal)) + " " + shown(first(m.tangent)) + " " +
           shown(first(m.specular)) + " " + shown(first(m.glow));
}
std::string maps(const Model& m) {
    std::string out;
    for (const Material& each : m.materials()) out += (out.empty() ? "" : ", ") + maps(each);
    return out;
}

}  // namespace

TEST("textures beside the model are found by their suffix, and may be absent; one normal map is decoded") {
    const Folder folder;
    const fs::path obj = folder.write("m.obj", textured);
    CHECK_EQ(maps(Model(obj)), "-1 -1 -1 -1 -1");
    all_suffixes(folder);
    const Model m(obj);
    check_invariants(m);
    CHECK_EQ(maps(m), "10 20 -1 40 50");
    CHECK_EQ(notes(m), "");
    CHECK_EQ(m.materials()[0].diffuse->get(1, 1)[2], 12);
    CHECK_EQ(m.materials()[0].specular->bytespp(), 1);
    CHECK_EQ(maps(Model(obj, NormalMap::tangent)), "10 -1 30 40 50");
    folder.write("m_nm.tga", "no picture");
    CHECK_EQ(maps(Model(obj, NormalMap::tangent)), "10 -1 30 40 50");
    CHECK_THROWS(Model(obj, NormalMap::object), "m_nm.tga: ");
    fs::remove(folder / "m_nm.tga");
    CHECK_EQ(maps(Model(obj)), "10 -1 30 40 50");
    folder.picture("m_nm.tga", 20);
    fs::remove(folder / "m_nm_tangent.tga");
    CHECK_EQ(maps(Model(obj, NormalMap::tangent)), "10 20 -1 40 50");
    folder.picture("m.b_glow.tga", 60);
    CHECK_EQ(maps(Model(folder.write("m.b.obj", textured))), "-1 -1 -1 -1 60");
}

TEST("faces without texture coordinates have no textures, and none is decoded") {
    const Folder folder;
    folder.write("m_diffuse.tga", "no picture");
    const fs::path obj = folder.write("m.obj", square + extras + "f 1 2 3\n");
    const Model m(obj);
    CHECK_EQ(maps(m), "-1 -1 -1 -1 -1");
    CHECK_EQ(notes(m), "no texture coordinates, so no textures\n");
    folder.picture("m_diffuse.tga", 10);
    folder.write("m.mtl", "newmtl a\nnewmtl b\nmap_Kd m_diffuse.tga\n");
    const Model two(
        folder.write("m.obj", "mtllib m.mtl\n" + square + extras + "usemtl a\nf 1 2 3/1\nusemtl b\nf 1 2 3\n"));
    CHECK_EQ(maps(two), "10 -1 -1 -1 -1, -1 -1 -1 -1 -1");
    CHECK_EQ(notes(two), "material 'b': no texture coordinates, so no textures\n");
}

TEST("the maps of an .mtl, relative to it, before those by suffix") {
    const Folder folder;
    fs::create_directory(folder / "lib");
    fs::create_directory(folder / "lib/my maps");
    for (const auto& [name, first_channel] : {std::pair("lib/my maps/a b.tga", 100), std::pair("lib/s.TGA", 110),
                                              std::pair("lib/n.tga", 120), std::pair("lib/e.tga", 130),
                                              std::pair("lib/bump.tga", 140)})
        folder.picture(name, first_channel);
    folder.write("lib/m.mtl",
                 "newmtl full\nmap_Kd -s 1 1 1 -o .5 -clamp on my maps\\a b.tga\nmap_Ks s.TGA\nnorm -bm 0.5 n.tga\n"
                 "map_Bump -bm 1 bump.tga\nmap_Ke -mm 0 1 -blendu off -type sphere -imfchan l e.tga \r\n"
                 "newmtl part\n  map_Kd\tmy maps/a b.tga\nnewmtl none\nmap_Kd gone.tga\nnewmtl none\nKa 0 0 0\nnewmtl "
                 "bumpy\nbump bump.tga\n");
    const std::string obj = "mtllib lib/m.mtl\n" + square + extras;
    std::string each;
    for (const char* name : {"full", "part", "none", "bumpy"})
        each += "usemtl " + std::string(name) + "\nf 1/1 2/2 3/3\n";
    folder.write("m.obj", obj + each);
    Model m(folder / "m.obj");
    CHECK_EQ(maps(m), "100 -1 120 110 130, 100 -1 -1 -1 -1, -1 -1 -1 -1 -1, -1 -1 140 -1 -1");
    CHECK_EQ(notes(m), "");
    all_suffixes(folder);
    CHECK_EQ(maps(Model(folder / "m.obj", NormalMap::tangent)),
             "100 -1 120 110 130, 100 -1 30 40 50, 10 -1 30 40 50, 10 -1 140 40 50");
    CHECK_EQ(maps(Model(folder / "m.obj", NormalMap::object)),
             "100 20 -1 110 130, 100 20 -1 40 50, 10 20 -1 40 50, 10 20 -1 40 50");
}

TEST("a map that is no .tga, or is missing, is a note; one that is corrupt is an error") {
    const Folder folder;
    folder.write(
        "m.mtl",
        "newmtl a\n\nmap_Kd texture.png\nmap_Ks gone.tga\nnewmtl unused\nmap_Kd bad.tga\nmap_Ke -bm x y.jpg\n");
    folder.write("m.obj", "mtllib m.mtl\n" + textured + "usemtl a\nf 1/1 2/2 3/3\nusemtl unused\n");
    folder.write("bad.tga", "no picture");
    const Model m(folder / "m.obj");
    CHECK_EQ(maps(m), "-1 -1 -1 -1 -1, -1 -1 -1 -1 -1");
    CHECK_EQ(notes(m),
             "m.mtl:3: 'texture.png' is not a TGA file, left out\nm.mtl:4: 'gone.tga' does not exist, left out\n");
    folder.picture("m_diffuse.tga", 10);
    CHECK_EQ(maps(Model(folder / "m.obj")), "10 -1 -1 -1 -1, 10 -1 -1 -1 -1");  // instead
    folder.write("m.obj", "mtllib m.mtl\nusemtl unused\n" + textured);
    CHECK_THROWS(Model(folder / "m.obj"), "bad.tga: ");
}

TEST("errors come in a fixed order: the .obj, the .mtl, then the textures by their names") {
    const Folder folder;
    folder.write("m.mtl", "Kd x\n");
    for (const char* name : {"m_spec.tga", "m_diffuse.tga", "m_nm.tga", "m_glow.tga"}) folder.write(name, "no picture");
    folder.write("m.obj", "mtllib m.mtl\n" + textured + "f 0 0 0\n");
    CHECK_THROWS(Model(folder / "m.obj"), "m.obj:13: vertex index 0");
    folder.write("m.obj", "mtllib m.mtl\n" + textured);
    CHECK_THROWS(Model(folder / "m.obj"), "m.mtl:1: 'x' is no finite number");
    folder.write("m.mtl", "");
    for (int i = 0; i < 50; i++) CHECK_THROWS(Model(folder / "m.obj"), "m_diffuse.tga: ");
    fs::remove(folder / "m_diffuse.tga");
    for (int i = 0; i < 50; i++) CHECK_THROWS(Model(folder / "m.obj"), "m_glow.tga: ");
}

TEST("grey pictures stay as they are, and are no normal maps") {
    const Folder folder;
    for (const char* name : {"m_diffuse.tga", "m_nm.tga", "m_glow.tga", "m_spec.tga"})
        folder.picture(name, 77, TGAImage::GRAYSCALE);
    const Model m(folder.write("m.obj", textured));
    check_invariants(m);
    CHECK_EQ(maps(m), "77 -1 -1 77 77");
    CHECK_EQ(m.materials()[0].diffuse->bytespp(), 1);
    CHECK_EQ(notes(m), "m_nm.tga is grey, so no normal map: left out\n");
}

TEST("a picture that materials share is decoded once") {
    const Folder folder;
    folder.picture("m_diffuse.tga", 5);
    folder.write("m.mtl", "newmtl a\nnewmtl b\n");
    folder.write("m.obj", "mtllib m.mtl\n" + textured + "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\n");
    const Model m(folder / "m.obj");
    CHECK_EQ(maps(m), "5 -1 -1 -1 -1, 5 -1 -1 -1 -1, 5 -1 -1 -1 -1");
    CHECK(m.materials()[0].diffuse == m.materials()[2].diffuse);
}

// ---- fitting ----

namespace {

std::string points(const std::vector<vec3>& list) {
    std::string obj;
    char line[100];
    for (const vec3& v : list) {
        std::snprintf(line, sizeof line, "v %.17g %.17g %.17g\n", v.x, v.y, v.z);
        obj += line;
    }
    return obj;
}

}  // namespace

TEST("fit leaves a model within [-1,1]^3 as it is") {
    Model m = load("v -1 -1 -1\nv 1 0 0\nv 0 .5 1\nv 99 0 0\nf 1 2 3\n");
    CHECK(!m.fit());
    CHECK_EQ(text(m.verts()[0]), "-1 -1 -1");
    CHECK_EQ(text(m.verts()[3]), "-1 -1 -1");  // no face uses it: it is put where another is
    Model small = load("v .9 .9 0\nv .9002 .9 0\nv .9 .9001 0\nf 1 2 3\n");
    CHECK(!small.fit());
    Model spot = load("v .9 .9 0\nf 1 1 1\n");  // no size could make it larger
    CHECK(!spot.fit());
    Model none;
    CHECK(!none.fit());
    CHECK(none.notes().empty());
}

TEST("fit enlarges what would be smaller than a pixel of the largest picture") {
    for (const char* s : {"e-5", "e-30", "e-300", "e-320"}) {
        const std::string e = s;
        Model m = load("v 1" + e + " 0 0\nv 3" + e + " 0 0\nv 1" + e + " 1" + e + " 0\nf 1 2 3\n");
        CHECK(m.fit());
        CHECK_NEAR(norm(m.verts()[0] - vec3{-1, -.5, 0}), 0, e == "e-320" ? 1e-3 : 1e-15);  // denormals have few digits
        CHECK_NEAR(norm(m.verts()[1] - vec3{1, -.5, 0}), 0, e == "e-320" ? 1e-3 : 1e-15);
        CHECK_EQ(m.notes().back(), std::string("fitted to [-1,1]^3"));
        check_invariants(m);
    }
    Model speck = load("v .9 .9 0\nv .9001 .9 0\nv .9 .9001 0\nf 1 2 3\n");
    CHECK(speck.fit());
}

TEST("move adds to every vertex") {
    Model m = load("v 1 2 3\nv 4 5 6\nv 7 8 10\nf 1 2 3\n");
    m.move({-1, -2, 1e6});
    CHECK_EQ(text(m.verts()[0]), "0 0 1000003");
    CHECK_EQ(text(m.verts()[2]), "6 6 1000010");
}

TEST("fit centres the box of the used vertices, and its largest half-side becomes 1") {
    Model m = load("v 10 0 0\nv 14 2 0\nv 12 1 1\nv 1e308 -1e308 1e308\nf 1 2 3\n");
    CHECK(m.fit());
    CHECK_EQ(text(m.verts()[0]), "-1 -0.5 -0.25");
    CHECK_EQ(text(m.verts()[1]), "1 0.5 -0.25");
    CHECK_EQ(text(m.verts()[2]), "0 0 0.25");
    check_invariants(m);
    CHECK(!m.fit());
    Model just = load("v 0 0 0\nv 1.0000000000000002 0 0\nv 0 1 0\nf 1 2 3\n");
    CHECK(just.fit());
    CHECK_EQ(just.verts()[0].x, -1);
    CHECK_EQ(just.verts()[1].x, 1);
}

TEST("fit gives the same bits for a model scaled by any power of two") {
    std::mt19937 random(8);
    std::uniform_real_distribution<double> in(-1, 1);
    std::vector<vec3> verts;
    for (int i = 0; i < 300; i++) verts.push_back({1.5 + in(random), 3 * in(random) + 5e-9, in(random)*1e-5});
    verts[7].y = 1e-290;
    std::string faces_text;
    for (int i = 1; i < 298; i++)
        faces_text += "f " + std::to_string(i) + " " + std::to_string(i + 1) + " " + std::to_string(i + 2) + "\n";
    Model unscaled = load(points(verts) + faces_text);
    CHECK(unscaled.fit());
    double largest = 0;
    for (const vec3& v : unscaled.verts())
        for (int k = 0; k < 3; k++) largest = std::max(largest, std::fabs(v[k]));
    CHECK_EQ(largest, 1);
    CHECK(!unscaled.fit());
    for (const int exponent : {-700, -100, -20, 1, 3, 20, 100, 500, 1000, 1021}) {
        std::vector<vec3> scaled = verts;
        for (vec3& v : scaled) v = v * std::ldexp(1., exponent);
        Model m = load(points(scaled) + faces_text);
        CHECK(m.fit());
        int different = 0;
        for (std::size_t i = 0; i < verts.size(); i++) different += !(m.verts()[i] == unscaled.verts()[i]);
        CHECK_EQ(different, 0);
    }
}

TEST("fit at the ends of the arithmetic") {
    Model huge = load("v -1.7e308 0 0\nv 1.7e308 0 1e308\nv 0 1e308 0\nf 1 2 3\n");
    CHECK(huge.fit());
    check_invariants(huge);
    CHECK_EQ(huge.verts()[0].x, -1);
    CHECK_EQ(huge.verts()[1].x, 1);
    Model far_point = load("v 5 6e307 7\nf 1 1 1\n");
    CHECK(far_point.fit());
    CHECK_EQ(text(far_point.verts()[0]), "0 0 0");
    Model far_speck = load(
        "v 1e10 1e10 1e10\nv 10000000000.000002 1e10 1e10\nv 1e10 10000000000.000002 1e10\nv -1e308 0 0\nf 1 2 3\n");
    CHECK(far_speck.fit());
    check_invariants(far_speck);
    CHECK_EQ(text(far_speck.verts()[1]), "1 -1 0");
}

// ---- anything at all ----

namespace {

// Loads whatever is in the folder: a model that keeps its promises, or a runtime_error; anything else fails.
bool survives(const fs::path& obj) {
    try {
        Model m(obj);
        check_invariants(m);
        m.fit();
        check_invariants(m);
        return true;
    } catch (const std::runtime_error& e) {
        CHECK(std::string(e.what()).find('\n') == std::string::npos);
        return false;
    }
}

std::string mutated(std::string s, std::mt19937& random) {
    const std::string alphabet = "vtnfumKd /-.#\\\r\n\t0123456789e\x80";
    for (auto n = 1 + random() % 4; n-- > 0 && !s.empty();) {
        const std::size_t at = random() % s.size();
        if (random() % 3 == 0) s.erase(at, random() % 12);
        else if (random() % 2) s.insert(at, s.substr(random() % s.size(), random() % 40));
        else s[at] = alphabet[random() % alphabet.size()];
    }
    return s;
}

}  // namespace

TEST("mutated files give a model or an error, never a crash") {
    const Folder folder;
    all_suffixes(folder);
    folder.picture("a b.tga", 9);
    const std::string mtl =
        "newmtl a\nKd .5 .5 .5\nmap_Kd -s 1 1 1 a b.tga\nmap_Bump m_nm.tga\nnewmtl b\nmap_Ks m_spec.tga\nKd 1\n";
    const std::string obj = "# head\nmtllib m.mtl\n" + cube() + extras +
                            "usemtl a\nf 1/1/1 3/2/2 4/3/3 2/1\ng x\nusemtl b\nf -8//1 -7 -6 -5 6\nf 1 2 \\\n 6 5\nf 3 "
                            "7 8\nusemtl a\nf 1 5 7\n";
    folder.write("m.mtl", mtl);
    folder.write("m.obj", obj);
    CHECK(survives(folder / "m.obj"));
    std::mt19937 random(9);
    int loaded = 0;
    const int n = 3000;
    for (int i = 0; i < n; i++) {
        folder.write("m.obj", mutated(obj, random));
        if (i % 4 == 0) folder.write("m.mtl", mutated(mtl, random));
        loaded += survives(folder / "m.obj");
    }
    CHECK(loaded > n / 20);  // so both outcomes have been seen
    CHECK(loaded < n - n / 20);
}

TEST("faces of random corners among random points, some of them at the ends of the range, give a model") {
    const Folder folder;
    std::mt19937 random(10);
    int loaded = 0;
    for (int i = 0; i < 1000; i++) {
        std::string obj;
        for (int k = 0; k < 12; k++)
            for (int c = 0; c < 3; c++) {
                const char* const exponents[] = {"", "", "e-320", "e307", "e-160", "e-8"};
                obj += (c ? " " : "v ") + std::to_string(static_cast<int>(random() % 7) - 3) +
                       exponents[random() % std::size(exponents)] + (c == 2 ? "\n" : "");
            }
        for (int k = 0; k < 8; k++) {
            obj += "f";
            for (auto corners = 3 + random() % 8; corners-- > 0;)
                obj.append(" ").append(std::to_string(1 + random() % 12));
            obj += "\n";
        }
        loaded += survives(folder.write("m.obj", obj));
    }
    CHECK_EQ(loaded, 1000);
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
