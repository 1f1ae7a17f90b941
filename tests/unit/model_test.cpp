// model_test.cpp: what model.cpp promises about real .obj and .mtl files, polygons, normals and textures.
// Every file it reads it writes first, into a fresh folder that it removes at the end.
#include "model.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "check.h"
#include "files.h"
#include "random.h"

namespace fs = std::filesystem;

namespace {

// ---- what is looked at ----

// The faces as text: "0/4 1/5 2/-1, ...", vertex and texture index of each corner.
std::string faces(const Model& m) {
    std::string out;
    for (int i = 0; i < 3 * m.nfaces(); i++) {
        const Model::Corner& k = m.corner(i / 3, i % 3);
        out.append(i % 3 ? " " : i ? ", " : "").append(std::to_string(k.vert));
        if (k.uv >= 0) out.append("/").append(std::to_string(k.uv));
    }
    return out;
}
std::string text(const vec3& v) { return shown(v.x) + " " + shown(v.y) + " " + shown(v.z); }
std::string vertices(const std::vector<vec3>& list) {  // as an .obj has them
    std::string obj;
    for (const vec3& v : list) obj += "v " + text(v) + "\n";
    return obj;
}
std::string normals(const Model& m, int face = 0) {
    return text(m.normal(face, 0)) + ", " + text(m.normal(face, 1)) + ", " + text(m.normal(face, 2));
}
std::string notes(const Model& m) {
    std::string out;
    for (const std::string& note : m.notes()) out += note + "\n";
    return out;
}

// What holds for every model, whatever the file.
void check_invariants(const Model& m) {
    CHECK(m.nfaces() > 0);
    for (const vec3& v : m.verts()) CHECK(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z));
    for (int i = 0; i < 3 * m.nfaces(); i++) {
        const Model::Corner& k = m.corner(i / 3, i % 3);
        CHECK(k.vert >= 0 && k.vert < m.nverts() && k.uv >= -1 && k.normal >= 0);
        CHECK(std::isfinite(m.uv(i / 3, i % 3).x) && std::isfinite(m.uv(i / 3, i % 3).y));
        // Three squares, two sums, a root and a division, each off by half an epsilon at most.
        CHECK_NEAR(norm(m.normal(i / 3, i % 3)), 1, 4 * std::numeric_limits<double>::epsilon());
    }
    int face = 0, material = 0;
    for (const Model::Group& g : m.groups()) {
        CHECK_EQ(g.begin, face);
        CHECK(g.end > g.begin);
        CHECK_EQ(g.material, material++);
        face = g.end;
    }
    CHECK_EQ(face, m.nfaces());
    CHECK_EQ(m.groups().size(), m.materials().size());
    for (const Material& each : m.materials())
        for (const Map& map : {each.normal, each.tangent}) CHECK(!map || map->bytespp() >= 3);
}
std::string materials(const Model& m) {  // "name Kd; name Kd; notes"
    std::string out;
    for (const Material& each : m.materials()) out += each.name + " " + text(each.Kd) + "; ";
    return out + notes(m);
}

// ---- files ----

class Folder : public TemporaryFolder {
public:
    Folder() : TemporaryFolder("model_test") {}

    fs::path write(const std::string& name, const std::string& text) const {
        write_bytes(*this / name, Bytes(text.begin(), text.end()));
        return *this / name;
    }
    Model load(const std::string& obj, NormalMap wanted = NormalMap::object) const {
        Model m(write("m.obj", obj), wanted);
        m.load_textures();
        check_invariants(m);
        return m;
    }
    Model load(const std::string& obj, const std::string& mtl) const {
        write("m.mtl", mtl);
        return load("mtllib m.mtl\n" + obj);
    }
    // A picture of one colour: its first channel tells which file it came from.
    void picture(const std::string& name, int first, TGAImage::Format format = TGAImage::RGB, int side = 2) const {
        TGAImage image(side, side, format);
        TGAColor color;
        for (int i = 0; i < 4; i++) color[i] = static_cast<std::uint8_t>(first + i);
        for (int i = 0; i < side * side; i++) image.set(i % side, i / side, color);
        image.write_tga_file(*this / name);
    }
};

Model load(const std::string& text) { return Folder().load(text); }

const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
const std::string full_square = square + "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nvn 0 1 0\nvn 1 0 0\n";
const std::string upright = "0 0 1, 0 0 1, 0 0 1";  // normals of a face

struct Case {
    std::string obj, expected, normals = "";
};
// Each is an .obj, its faces and, where they matter, the normals of the first one.
void check_faces(const std::vector<Case>& cases) {
    for (const Case& c : cases) {
        const Model m = load(c.obj);
        CHECK_EQ(faces(m), c.expected);
        if (!c.normals.empty()) CHECK_EQ(normals(m), c.normals);
    }
}
// Each is an .obj and what is said of its first error.
void check_errors(const std::vector<Case>& cases) {
    for (const Case& c : cases) CHECK_THROWS(load(c.obj), ("m.obj:" + c.expected).c_str());
}

// ---- corners, lines and whole files ----

TEST("corners, indices that count back or look ahead, and polygons, that become triangles that wind alike") {
    check_faces({
        // A corner may be v, v/vt, v//vn or v/vt/vn, each by itself.
        {full_square + "f 1 2 3\n", "0 1 2"},
        {full_square + "f 1/3 2/2 3/1\n", "0/2 1/1 2/0"},
        {full_square + "f 1//1 2//2 3//3\n", "0 1 2", "0 0 1, 0 1 0, 1 0 0"},
        {full_square + "f 1/3/3 2/2/2 3/1/1\n", "0/2 1/1 2/0", "1 0 0, 0 1 0, 0 0 1"},
        {full_square + "f 1 2/2 3//3\nf 2/1/3 3/ 4//\n", "0 1/1 2, 1/0 2 3", "0 0 1, 0 0 1, 1 0 0"},
        {full_square + "f 2/1/3 3/ 4//\nf 1 2/2 3//3\n", "1/0 2 3, 0 1/1 2", "1 0 0, 0 0 1, 0 0 1"},
        {square + "f -4 -3 -2\nv 2 2 2\nf -1 -2 -5\n", "0 1 2, 4 3 0"},
        {full_square + "f -4/-1/-1 2/-3 -2\n", "0/2 1/0 2"},
        {"f 1/1 2/2 3/1\n" + full_square, "0/0 1/1 2/0"},
        {"f 1//1 2//2 3//3\n" + full_square, "0 1 2", "0 0 1, 0 1 0, 1 0 0"},
        {square + "f 1 2 3 4\n", "0 1 2, 0 2 3"},
        {square + "f 4 3 2 1\n", "3 2 1, 3 1 0"},
        {square + "v .5 1.5 0\nf 1 2 3 5 4\n", "0 1 2, 0 2 4, 0 4 3"},
        {full_square + "f 1/1 2/2 3/3 4/2\n", "0/0 1/1 2/2, 0/0 2/2 3/1"},
    });
    // A weight or colours after the coordinates are passed over.
    const Model m =
        load("v 0 0 0 1\nv 1 0 0 .5 .5 .5\nv 1 1 0 .1 .2 .3 1\nvt 1\nvt .5 .25 0\nvn 0 0 2 1\nf 1/1/1 2/2/1 3//1\n");
    CHECK_EQ(vertices(m.verts()), "v 0 0 0\nv 1 0 0\nv 1 1 0\n");
    CHECK(m.uv(0, 0) == (vec2{1, 0}));
    CHECK(m.uv(0, 1) == (vec2{.5, .25}));
    CHECK(m.uv(0, 2) == vec2{});  // none given
    CHECK_EQ(normals(m), upright);
}

TEST("line ends, tabs, blanks, comments, continued lines, a byte order mark, words that are passed over, megabytes") {
    const std::string blanks(1200000, ' ');
    std::string many = square + "f", continued = square + "f 1 2 3";
    for (int i = 0; i < 300000; i++) many += " 1 2 3";
    for (int i = 0; i < 400000; i++) continued += "\\\n ";  // a line of a megabyte in many pieces
    check_faces({
        {"v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nvt 0 0\r\nf 1/1 2/1 \\\r\n3/1\r\n", "0/0 1/0 2/0"},
        {"\tv\t0 0\t\t0\n  v 1  0 0 \n \t v 1 1 0\t\n   f  1\t2   3  \n", "0 1 2"},
        {"# a head\nv 0 0 0 # origin\nv 1 0 0#near\n  # \\\nv 1 1 0\nf 1 2 3 # a face \\\nf 3 2 1#\n#", "0 1 2, 2 1 0"},
        {"v 0 \\\n0 0\nv\\\n1 0 0\nv 1 1\\\n 0\nf 1 \\\n\\\n 2\\  \n 3\n", "0 1 2"},
        {"o one \\\nf 1 1 1\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\\", "0 1 2"},
        {square + "f 1 2 3 \\", "0 1 2"},
        {square + "f 1 2 3 \\\n\\\n", "0 1 2"},
        {square + "f 1 2 3\r", "0 1 2"},
        {"\n\n\r\n \t\n" + square + "\n\n\nf 1 2 3\n\n", "0 1 2"},
        {"o head\ng a b c\ns 1\ns off\n" + square + "vp 1 2 3\nl 1 2\np 1\ncstype bezier\nverse 1 2\nfoo\n"
         "vv 1 2 3\nff 1 2 3\nvt\xC3\xA9 x\n\x01\x02\nf 1 2 3\nend\n", "0 1 2"},
        {"V 0 0 0\nV 1 0 0\nv 1 1 0\nVT 0 0\nVn 0 0 1\nF 1/1 2//1 3\n", "0/0 1 2"},
        {"v 0 0 0\rv 1 0 0\r# a comment\rv 1 1 0\r\rf 1 2 \\\r3\rf 3 2 1", "0 1 2, 2 1 0"},
        {"# one line\nv 0 0 0\rv 1 0 0\r\nv 1 1 0\rf 1 2 3\n\n", "0 1 2"},
        {square + "#" + std::string(1500000, 'x') + "\nf 1 2" + blanks + "3\n", "0 1 2"},
        {square + "curv " + std::string(3000000, '1') + "\nf 1 2 3\n", "0 1 2"},
        {continued + "4", "0 1 2, 0 2 3"},
    });
    check_errors({
        {"v 0 0 0\r\n\r\nf 1 1 2\r\n", "3:"},
        {"v 0 0 \\\n 0\nv 1 0 0\nv x 1 1\n", "4: 'x' is no finite number"},
        {"v 0 0 \\\n 0\nv 1 \\\n y 0\n", "4: 'y' is no finite number"},
        {"o a \\\n b \\\n c\nf 1 2 0\n", "4: '0' is none"},
        {"v 0 0 0\rv 1 0\rf 1 1 1\r", "2: a vertex needs three coordinates"},
        {square + "f 1 \\2 3\n", "5:"},
        {"\xEF\xBB\xBF\n\nf 0 1 1", "3:"},
        {square + "f 1 2" + blanks + "0\n", "5: '0' is none"},
        {continued + "x", "400005: 'x' is no vertex index"},
    });
    const Model fans = load(many + "\nf 2 3 4");
    CHECK_EQ(fans.nfaces(), 3 * 300000 - 2 + 1);
    CHECK_EQ(fans.corner(fans.nfaces() - 1, 0).vert, 1);
    CHECK_EQ(load("\xEF\xBB\xBFv 5 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n").verts()[0].x, 5);
    CHECK_EQ(load("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 1 1 .5").verts()[2].z, .5);  // the last line needs no newline
    for (int size = 4093; size <= 4100; size++) {  // around a page's end: a mapped file may fill its pages
        std::string obj = square + "f 1 2 3\n#";
        obj += std::string(size - obj.size() - 8, '-') + "\nf 2 3 4";
        for (const char* end : {"", "\n", "\\"}) check_faces({{obj + end, "0 1 2, 1 2 3"}});
    }
    // Around a megabyte's end: lines are joined so many at a time, and what lies before them is not held.
    for (int size = (1 << 20) - 30; size <= 1 << 20; size++) {
        const std::string obj = square + "#" + std::string(size - square.size() - 2, '-') + "\n";
        check_faces({{obj + "f 1 \\\n2 3 # \\\nf 2 \\ \n\\\n 3 4", "0 1 2, 1 2 3"}});
        check_errors({{obj + "f 1 \\\n2 3\nf \\\n\\\n1 2 x", "10: 'x' is no vertex index"}});
    }
    const std::string far(1 << 21, '#');
    check_errors({{"v 0 0 0\r" + far + "\rv 1 0 0\r" + far + "\rf 1 1 x", "5: 'x' is no vertex index"},
                  {square + far + "\nf 1 2 3 \\\n4\n" + far + "\nf 1 2 9 ", "9: '9' is none"}});
}

TEST("a file without a face, a missing file, a folder, a device and a binary file are errors") {
    for (const std::string& obj : {std::string(), square, std::string("\\"), std::string("a letter,\nno model.\n")})
        check_errors({{obj, " no faces"}});
    std::string utf16;
    for (const char c : square) utf16 += {c, '\0'};
    CHECK_EQ(load(square + "f 1 2 3\n" + std::string(300, '\0')).nfaces(), 1);  // a last block, filled up
    for (const std::string& obj : {utf16, square + "f 1 2 3\n" + std::string(1, '\0') + "\n",
                                   square + std::string(1 << 21, '\n') + std::string(1, '\0') + "\nf 1 2 3\n"})
        check_errors({{obj, " is a binary file, not a text of vertices and faces"}});
    const std::string header(80, 'x'), face(50, '\1');
    for (const auto& [bytes, kind] : std::vector<std::pair<std::string, std::string>>{
             {"solid cube\nfacet normal 0 0 1\n", "STL"}, {header + std::string("\1\0\0\0", 4) + face, "STL"},
             {"ply\nformat ascii 1.0\n", "PLY"}, {"glTF\2", "glTF"}, {"{\"asset\": {}}", "glTF or JSON"},
             {"<!DOCTYPE html>", "HTML or XML"}, {"\x1F\x8B\x08", "gzip"}, {"PK\3\4", "ZIP"},
             {"\xFF\xFEv", "UTF-16"}, {"\xFE\xFF\1v", "UTF-16"}, {"Kaydara FBX Binary", "FBX"}, 
             {"BLENDER-v2", "Blender"},
             {"version https://git-lfs.github.com/spec/v1\n", "Git LFS pointer ('git lfs pull')"}})
        check_errors({{bytes, " is a " + kind + " file, not a text of vertices and faces"}});
    const Folder folder;
    CHECK_THROWS(Model(folder / "none.obj"), "none.obj: cannot be opened: ");
    fs::create_directory(folder / "folder.obj");
    CHECK_THROWS(Model(folder / "folder.obj"), "folder.obj: is a directory");
    if (fs::is_other("/dev/null"))  // a device or a pipe that a file names might never end
        CHECK_THROWS(load(square + "mtllib /dev/null\nf 1 2 3\n"), "/dev/null: is not a file");
}

// ---- numbers ----

TEST("numbers are read as strtod reads them, to the last bit") {
    const std::string zeros(400, '0');
    std::vector<std::string> numbers = {
        "0", "-0", "+1", ".5", "-.5", "+.5", "5.", "1e3", "1E3", "1e+3", "1.5e-3", "-2.5E-10", "00012.50",
        "999999999999999", "9999999999999999", "0.1", "123456789.123456", "1.23456789012345", "0.000000000000001",
        "9007199254740993", "2.2250738585072014e-308", "5e-324", "1e-310", "1.7976931348623157e308",
        "0.30000000000000004", "179769313486231570000000000000e279", "100000000000000000000000000000000000000",
        "0.00000000000000000000000000000000001", "1e-400", "-1e-400", "0e999", "0.0e-999", "1e-99999999999999999999",
        "1" + zeros + "e-400", "0." + zeros + "1", "0." + zeros + "1e402"};
    Random random(2);
    for (int i = 0; i < 20000; i++) {
        std::string s = random.below(3) == 0 ? "-" : "";
        for (int n = random.below(12); n-- > 0;) s += static_cast<char>('0' + random.below(10));
        s += '.';
        for (int n = 1 + random.below(12); n-- > 0;) s += static_cast<char>('0' + random.below(10));
        if (random.below(4) == 0) s.append("e").append(std::to_string(random.below(560) - 280));
        numbers.push_back(s);
    }
    std::string obj;
    for (const std::string& s : numbers) obj += "v " + s + " 0 0\nf -1 -1 -1\n";
    const Model m = load(obj + "f 1 2 3\n");
    for (std::size_t i = 0; i < numbers.size(); i++)  // 17 digits and the sign tell all doubles apart
        CHECK_EQ(shown(m.verts()[i].x), shown(std::strtod(numbers[i].c_str(), nullptr)));
}

TEST("what is no finite number or no index, is missing or out of range is an error with its line") {
    for (const std::string bad :
         {"nan", "-nan", "NaN", "inf", "+inf", "-Infinity", "1e999", "-1e309", "1e99999999999999999999", "nan(7)",
          "179769313486231570000000000000e280", "1x", "1.2.3", "1e", "1e+", "1-2", "0x10", "1,5", "1_0", "1/2", "1\\2",
          "x", ".", "-", "+", "+-1", "-+1", "--1", "e5", ",5", "one", "\\1", "/"})
        check_errors({{"\nv 0 " + bad + " 0\n", "2: '" + bad + "' is no finite number"}});
    for (const std::string bad : {"1x", "1/1x", "1//1x", "1/1/1/1", "1.0", "1/1/1x", "1e0"})
        check_errors({{full_square + "f 1 2 " + bad + "\n", "11: garbage after a number: '"}});
    for (const std::string bad : {"x", "/1", "//1", "-", "+", "--1", "nan", "2147483648", "4294967297", "-2147483649",
                                  "99999999999999999999999999", "18446744073709551617"})
        check_errors({{full_square + "f 1 2 " + bad + "\n", "11: '" + bad + "' is no vertex index"}});
    for (const std::string few : {"v", "v 1 2", "v 1 2 #3"})
        check_errors({{"\n" + few + "\n", "2: a vertex needs three coordinates"}});
    check_errors({
        {"v 1" + std::string(400, '0') + " 0 0\n", "1: '1" + std::string(59, '0') + "...' is no finite number"},
        {"v 0 0 1\x02\n", "1: '1?' is no finite number"},
        {"v 0 0 \x1B[2J\n", "1: '?[2J' is no finite number"},  // nothing of it can steer a terminal
        {full_square + "f 1 2/x 3\n", "11: 'x' is no texture index"},
        {full_square + "f 1 2/- 3\n", "11: '-' is no texture index"},
        {full_square + "f 1 2//x 3\n", "11: 'x' is no normal index"},
        {square + "f 1 2 0\n", "5: '0' is none of the 4 vertices, counted from 1"},
        {square + "f 1 2 5\n\nf 1 2 3\n", "5: '5' is none of the 4 vertices, counted from 1"},
        {"f 1 2 3\n\nf 1/1 2 5/7\nf 9 9 9\n" + square, "3: '5/7' is none of the 4 vertices, counted from 1"},
        {square + "f 1 2 -5//2\nv 0 0 0\n", "5: '-5//2' is none of the 4 vertices, counted from 1"},
        {square + "f 1 2 2147483647\n", "5: '2147483647' is none of the 4 vertices, counted from 1"},
    });
}

TEST("what costs no geometry is a note: corners too few, indices of no normal or texture, words that are no numbers") {
    const std::string number = "a normal or texture coordinate that is no number, left out: m.obj:",
                      color = "a colour that is no number, left out: m.obj:",
                      index = "an index of a normal or texture coordinate that is not there, left out: face ",
                      corners = "a face of fewer than three corners, left out: m.obj:";
    struct Noted {
        std::string obj, expected, note;
    };
    for (const auto& [obj, expected, noted] : std::vector<Noted>{
             {square + "f\nf 1 2 # 3\nf 1 2 3\nf 4\n", "0 1 2", corners + "5 and 2 more"},
             {square + "f 1 \\\n 2\nf 1 2 3", "0 1 2", corners + "6"},
             {square + "f 1//1 2 3\n", "0 1 2", index + "1"},
             {square + "f 1 2 3\nf 1/1 2/-1 3/1\n", "0 1 2, 0 1 2", index + "2 and 2 more"},
             {full_square + "f 1/4 2/-4 3/3\nf 1/0 2//-0 3//4\n", "0 1 2/2, 0 1 2", index + "1 and 4 more"},
             {square + "f 1/2 2/1 3\nvt 0 0\nf 1//2 2//1 3\nvn 0 0 1\n", "0 1/0 2, 0 1 2", index + "1 and 1 more"},
             {square + "vn 1 2\nvt\nvn 0 nan 1\nvt 1e999\nf 1/1/1 2//2 3/2\n", "0/0 1 2/1", number + "5 and 3 more"},
             {"v 0 0 0 1 x\nv 1 0 0 nan\nv 1 1 0\nf 1 2 3\n", "0 1 2", color + "1 and 1 more"}}) {
        const Model m = load(obj);
        CHECK_EQ(faces(m), expected);
        CHECK_EQ(notes(m), noted + "\n");
        CHECK_EQ(normals(m), upright);
    }
}

TEST("colours of vertices, with alpha or not, up to 1 or to 255; whoever has none is white; a weight is no colour") {
    const Model m = load("v 0 0 0\nv 1 0 0 .5 .25 0\nv 1 1 0 1 1 1 9\nv 0 1 0 1 .5 -1\nf 1 2 3\nf 1 2 4\n");
    const Model bytes = load("v 0 0 0 255 0 51\nv 1 0 0 1 1 1\nv 1 1 0 900 0 0\nf 1 2 3\n");
    CHECK(bytes.color(0, 0) == (vec3{1, 0, .2}) && bytes.color(0, 2) == (vec3{1, 0, 0}));
    CHECK(m.has_colors());
    CHECK_EQ(vertices({m.color(0, 0), m.color(0, 1), m.color(0, 2), m.color(1, 2)}),
             "v 1 1 1\nv 0.5 0.25 0\nv 1 1 1\nv 1 0.5 0\n");
    CHECK(!load(square + "v 1 2 3 4\nv 1 2 3 4 5\nf 1 2 3\n").has_colors());
}

// ---- polygons ----

using Polygon = std::vector<vec2>;

double area2(const Polygon& p) {  // twice the signed area
    double sum = 0;
    for (std::size_t i = 1; i + 1 < p.size(); i++) {
        const vec2 a = p[i] - p[0], b = p[i + 1] - p[0];
        sum += a.x * b.y - a.y * b.x;
    }
    return sum;
}

// The polygon as an .obj: its point (x,y) is placed at x*right + y*up.
std::string in_plane(const Polygon& p, const vec3& right = {1, 0, 0}, const vec3& up = {0, 1, 0}, double scale = 1) {
    std::vector<vec3> points;
    std::string face = "f";
    for (const vec2& q : p) {
        points.push_back((right * q.x + up * q.y) * scale);
        face.append(" ").append(std::to_string(points.size()));
    }
    return vertices(points) + face + "\n";
}

// With whole numbers as coordinates every area is exact. Signed areas always add up to the polygon's; so where none is
// reversed the triangles cover the polygon, and each of its points once. LEAST is how large twice the area of each must
// be: 0 where some may be empty, and minus infinity where the polygon may cross itself.
void check_cut(const Polygon& p, double least = 1) {
    const std::pair<vec3, vec3> planes[] = {{{1, 0, 0}, {0, 1, 0}},  {{0, 1, 0}, {0, 0, 1}},  {{0, 0, 1}, {1, 0, 0}},
                                            {{2, 1, 0}, {-1, 3, 1}}, {{0, -1, 0}, {3, 0, 1}}, {{1, 0, 0}, {0, -1, 0}}};
    const double whole = area2(p);
    for (const auto& [right, up] : planes) {
        const Model m = load(in_plane(p, right, up));
        CHECK_EQ(m.nfaces(), static_cast<int>(p.size()) - 2);
        if (least >= 0) CHECK_EQ(notes(m), "");
        double sum = 0;
        for (int f = 0; f < m.nfaces(); f++) {
            const double part = area2({p[m.corner(f, 0).vert], p[m.corner(f, 1).vert], p[m.corner(f, 2).vert]});
            CHECK((whole < 0 ? -part : part) >= least);
            sum += part;
        }
        CHECK_EQ(sum, whole);
    }
}

const Polygon spiral = {{0, 0}, {10, 0}, {10, 10}, {2, 10}, {2, 4}, {6, 4},
                        {6, 6}, {4, 6},  {4, 8},   {8, 8},  {8, 2}, {0, 2}};

TEST("concave polygons are covered exactly once, in any plane, from any first corner") {
    const Polygon shapes[] = {
        spiral,
        {{0, 0}, {4, 0}, {1, 1}, {0, 4}},                                               // a dart
        {{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 6}, {0, 6}},                               // an L
        {{0, 0}, {9, 0}, {9, 9}, {6, 9}, {6, 3}, {3, 3}, {3, 9}, {0, 9}},               // a U
        {{0, 0}, {2, 8}, {4, 1}, {6, 8}, {8, 1}, {10, 8}, {12, 0}, {12, -1}, {0, -1}},  // a comb
        {{0, 3}, {2, 2}, {3, 0}, {4, 2}, {6, 3}, {4, 4}, {3, 6}, {2, 4}},               // a star
        {{0, 0}, {1, 0}, {2, 0}, {2, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}},               // a square, its sides halved
        {{0, 0}, {1, 0}, {2, 0}, {3, 0}, {0, 3}},                                       // a triangle with five corners
    };
    for (Polygon p : shapes)
        for (std::size_t i = 0; i < p.size(); i++) {
            check_cut(p);
            check_cut(Polygon(p.rbegin(), p.rend()));
            std::rotate(p.begin(), p.begin() + 1, p.end());
        }
    // Points on rays in the order of their angle, at random distances: concave as a rule, and it crosses nowhere.
    Random random(3);
    for (int n = 4; n < 304; n++) {
        Polygon star;
        for (int i = 0; i < n; i++) {
            const double angle = (i + random.in(0, .99)) * 6.28 / n, r = random.in(1000, 100000);
            star.push_back({std::round(r * std::cos(angle)), std::round(r * std::sin(angle))});
        }
        check_cut(star);
    }
    // Holes that a bridge joins to the outline, spikes and repeated corners.
    const Polygon touching[] = {
        {{0, 0}, {9, 0}, {9, 9}, {0, 9}, {0, 0}, {3, 3}, {3, 6}, {6, 6}, {6, 3}, {3, 3}},  // the bridge is walked twice
        {{0, 0}, {9, 0}, {9, 9}, {0, 9}, {0, 0}, {1, 1}, {1, 2}, {2, 2},
         {5, 5}, {5, 7}, {7, 7}, {7, 5}, {5, 5}, {2, 2}, {2, 1}, {1, 1}},
        {{0, 0}, {4, 0}, {4, 4}, {7, 9}, {4, 4}, {0, 4}},  // outward
        {{0, 0}, {4, 0}, {4, 4}, {2, 1}, {4, 4}, {0, 4}},  // inward
        {{0, 0}, {4, 0}, {8, 0}, {4, 0}, {4, 4}, {0, 4}},  // along an edge
        {{0, 0}, {0, 0}, {4, 0}, {4, 4}, {4, 4}, {4, 4}, {1, 1}, {0, 4}},
    };
    for (const Polygon& p : touching) check_cut(p, 0);
    // A square with a cut along a random tree, walked around on both sides.
    constexpr int n = 6, directions[4][2] = {{1, 0}, {0, -1}, {-1, 0}, {0, 1}};  // clockwise
    for (int round = 0; round < 300; round++) {
        Polygon p = {{-1, -1}, {n, -1}, {n, n}, {-1, n}, {-1, -1}};
        bool used[n][n] = {};  // the lattice points of the tree
        // The tree grows while it is walked around. The left hand is kept free: from each point edges go on clockwise
        // from the one the walk came by.
        const auto walk = [&](const auto& self, int x, int y, int back) -> void {
            used[x][y] = true;
            p.push_back({1. * x, 1. * y});
            for (int d = back + 1; d < back + 4; d++) {
                const int nx = x + directions[d % 4][0], ny = y + directions[d % 4][1];
                if (nx < 0 || ny < 0 || nx >= n || ny >= n || used[nx][ny] || random.below(6) < round % 4) continue;
                self(self, nx, ny, d + 2);
                p.push_back({1. * x, 1. * y});
            }
        };
        walk(walk, 0, 0, 2);  // from the corner, that is between -x and -y
        CHECK_EQ(area2(p), 2. * (n + 1) * (n + 1));
        std::rotate(p.begin(), p.begin() + random.below(static_cast<int>(p.size())), p.end());
        check_cut(p, 0);
    }
}

TEST("polygons without area, that cross themselves or have many corners have two triangles fewer than corners") {
    std::vector<Polygon> polygons = {
        {{0, 0}, {1, 1}, {2, 2}, {3, 3}, {1, 1}}, Polygon(7, vec2{1, 1}), {{0, 0}, {2, 2}, {2, 0}, {0, 2}},
        {{0, 0}, {2, 0}, {0, 0}, {2, 0}}, {{0, 3}, {2, -3}, {-3, 1}, {3, 1}, {-2, -3}}};
    Random random(4);
    for (int i = 0; i < 500; i++) {
        Polygon p(4 + random.below(30));
        for (vec2& q : p) q = {1. * random.below(6), 1. * random.below(6)};
        polygons.push_back(p);
    }
    for (const Polygon& p : polygons) check_cut(p, -HUGE_VAL);

    // Concave ones are cut up to a thousand corners, and convex ones always.
    const auto comb = [](int n) {
        Polygon p;
        for (int i = 0; i < n / 2; i++) p.insert(p.end(), {{2. * i, 0}, {2. * i + 1, 1000}});
        p.back() = {1. * n, -1};
        p.push_back({0, -1});
        return p;
    };
    Polygon band, bow, star;
    for (int i = 0; i < 1000; i++) {  // a band along a spiral
        const double angle = (i < 500 ? i : 999 - i) * .1, r = 1 + angle + (i < 500 ? 0 : 2);
        band.push_back({std::round(1e4 * r * std::cos(angle)), std::round(1e4 * r * std::sin(angle))});
    }
    for (double i = 0; i < 100000; i++) bow.push_back({i, i * i});
    for (const Polygon& p : {comb(999), band, bow}) check_cut(p);
    for (int i = 0; i < 100; i++) star.push_back({std::cos(i * .13), std::sin(i * .13)});  // twice around
    for (const Polygon& p : {star, comb(1000), comb(100000)}) {  // the combs become fans, that cover more than them
        const Model m = load(in_plane(p));
        CHECK_EQ(m.nfaces(), static_cast<int>(p.size()) - 2);
        CHECK_EQ(notes(m).substr(0, 51), "a polygon that crosses itself or has very many corn");
    }
}

TEST("a polygon is cut alike at every scale, to the ends of the double's range") {
    Polygon centred = spiral;  // so that differences overflow where coordinates do not
    for (vec2& q : centred) q = q - vec2{5, 5};
    const std::string expected = faces(load(in_plane(spiral, {2, 1, 0}, {-1, 3, 1})));
    for (const double scale : {1., 1e-30, 1e38, 1e300, 0x1p1017, 0x1p1019, 0x1p-1074, 0x1p-1040}) {
        check_faces({{in_plane(centred, {2, 1, 0}, {-1, 3, 1}, scale), expected}});
        if (scale < 0x1p1019) check_faces({{in_plane(spiral, {2, 1, 0}, {-1, 3, 1}, scale), expected}});
    }
    // A tiny one far from the origin, across the direction to it.
    std::string far = in_plane(spiral, {0, 1e-300, 0}, {0, 0, 1e-300});
    for (std::size_t at = 0; (at = far.find("v 0 ", at)) != far.npos;) far.replace(at, 4, "v 1 ");
    check_faces({{far, faces(load(in_plane(spiral)))}});
}

// ---- normals ----

std::string cube(double scale = 1) {
    std::vector<vec3> corners;
    for (int i = 0; i < 8; i++) corners.push_back(vec3{i % 2 - .5, i / 2 % 2 - .5, i / 4 - .5} * 2 * scale);
    return vertices(corners);
}

// Each result below is a handful of operations of half an epsilon, on numbers of at most 4.
constexpr double few_roundings = 16 * std::numeric_limits<double>::epsilon();

TEST("made normals are weighted by angle, so they depend neither on how a cube's sides are cut nor on the scale") {
    const std::string sides = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    std::vector<std::string> cubes = {cube() + "s 1\nf 1 3 4\nf 1 4 2\nf 6 8 7\nf 6 7 5\nf 1 2 6\nf 1 6 5\nf 3 7 8\n"
                                               "f 3 8 4\nf 1 5 7\nf 1 7 3\nf 2 4 8\nf 2 8 6\n"};
    for (const double scale : {1., 1e-30, 1e38, 1e300, 1e-300, 1e308, 1e-320})
        cubes.push_back(cube(scale) + "s 1\n" + sides);
    for (const std::string& obj : cubes) {
        const Model m = load(obj);
        for (int i = 0; i < 3 * 12; i++) {
            const vec3 v = m.vert(i / 3, i % 3), outward = v / std::fabs(v.x) / std::sqrt(3.);
            CHECK_NEAR(norm(m.normal(i / 3, i % 3) - outward), 0, few_roundings);
        }
    }
    // Around (0,0,0): 90 degrees of the plane z = 0, 45 of the plane y = 0 seen from -y.
    const vec3 slanted = load("v 0 0 0\nv 1 0 0\nv 0 5 0\nv 7 0 7\ns 1\nf 1 2 3\nf 1 2 4\n").normal(0, 0);
    CHECK_NEAR(norm(slanted - normalized(vec3{0, -1, 2})), 0, few_roundings);
    CHECK_EQ(normals(load("v -1.7e308 -1.7e308 1e308\nv 1.7e308 -1.7e308 1e308\nv 0 1.7e308 1e308\nf 1 2 3")), upright);
    CHECK_EQ(normals(load("v 0 0 0\nv 1 0 0\nv 1 1e-200 0\nf 1 2 3\n")), upright);
}

// The sides of a column: four corners each. Bottom and top are left open.
std::string column(int n, const std::string& line = "") {
    std::string obj;
    for (int i = 0; i < n; i++) {
        const double a = 2 * 3.14159265 / n * i;
        obj += vertices({{std::cos(a), std::sin(a), 0}, {std::cos(a), std::sin(a), 1}});
    }
    for (int i = 0; i < n; i++) {
        const std::string a = std::to_string(2 * i + 1), b = std::to_string(2 * i + 2),
                          c = std::to_string(2 * ((i + 1) % n) + 1), d = std::to_string(2 * ((i + 1) % n) + 2);
        obj += (i % 2 ? "" : line) + "f " + a + " " + c + " " + d + " " + b + "\n";
    }
    return obj;
}
bool is_smooth(const Model& m, int face = 0) {  // at the face's first corner
    return norm(m.normal(face, 0) - normalized(cross(m.vert(face, 1) - m.vert(face, 0),
                                                      m.vert(face, 2) - m.vert(face, 0)))) > .1;
}

TEST("without normals edges of up to 60 degrees are smooth; groups say it themselves; off, 0 and null are facets") {
    for (const int n : {3, 4, 5, 6, 7, 20}) {
        CHECK_EQ(is_smooth(load(column(n))), n >= 6);
        CHECK(is_smooth(load(column(n, "s 1\n"))));
        CHECK(is_smooth(load("S 7 \\\n # group\n" + column(n))));
        for (const std::string off : {"s off\n", "s 0\n", "s null\n", "s\n"}) CHECK(!is_smooth(load(off + column(n))));
    }
    // Groups of two sides each: at the first corner of an even face another group ends.
    std::string pairs = column(8);
    for (std::size_t at = 0, i = 0; (at = pairs.find("f ", at)) != pairs.npos; at += 6, i++)
        pairs.insert(at, "s " + std::to_string(i / 2 + 1) + "\n");
    for (int face = 0; face < 16; face++) CHECK_EQ(is_smooth(load(pairs), face), face / 2 % 2 == 1);
    // Where faces touch at a vertex alone each has its own normal.
    const std::string roofs = "v 0 0 0\nv 1 0 .5\nv 0 1 .5\nv -1 0 .5\nv 0 -1 .5\n";
    const Model touching = load(roofs + "f 1 2 3\nf 1 4 5\n");
    CHECK(!is_smooth(touching, 0) && !is_smooth(touching, 1));
    CHECK(is_smooth(load(roofs + "f 1 2 3\nf 1 3 4\n")));
    // The two sides of a sheet are smooth each for itself.
    const Model sheet = load(roofs + "f 1 2 3\nf 3 2 1\nf 1 3 4\nf 4 3 1\n");
    CHECK(is_smooth(sheet, 0) && is_smooth(sheet, 2) && dot(sheet.normal(0, 0), sheet.normal(1, 2)) < -.99);
    // A face without area between two others separates nothing.
    CHECK_EQ(normals(load(roofs + "f 1 2 3\nf 1 3 3\nf 1 3 4\n")), normals(load(roofs + "f 1 2 3\nf 1 3 4\n")));
}

TEST("normals of faces without area, of faces that cancel each other, and given ones") {
    const std::string obj = "v 0 0 0\nv 3 0 0\nv 0 3 1\nv .1 .1 .1\nv .3 .3 .3\nv 9 9 9\nf 1 2 3\n";
    const std::string expected = normals(load(obj));
    const Model m = load(obj + "f 4 5 6\nf 1 1 6\n");  // .1, .3 and 9 are not on a line in binary
    CHECK_EQ(normals(m), expected);
    CHECK_EQ(normals(m, 1), upright);
    const std::string first = text(m.normal(0, 0));
    CHECK_EQ(normals(m, 2), first + ", " + first + ", 0 0 1");  // the first vertex has another face, the last none
    CHECK_EQ(normals(load(obj + "f 1 1 2\nf 2 2 2\nf 1 4 5\nf 3 1 3\n")), expected);
    // Rounding leaves the product of these edges, which are parallel, a component of 4e-17. It must not have a normal.
    CHECK_EQ(normals(load("v 0 0 0\nv .1 .1 .6\nv .3 .3 1.8\nf 1 2 3\n")), upright);

    const Model two = load("v 0 0 0\nv 1 .3 .2\nv .1 1 .7\nf 1 2 3\nf 1 3 2\n");
    const vec3 n = normalized(cross(two.verts()[1], two.verts()[2]));
    for (int c = 0; c < 3; c++) {
        CHECK_NEAR(norm(two.normal(0, c) - n), 0, few_roundings);
        CHECK_NEAR(norm(two.normal(1, c) + n), 0, few_roundings);
    }
    // A sheet of many triangles and its other side.
    std::string sides;
    Random random(6);
    for (int i = 0; i < 40; i++) sides += vertices({{random.in(0, 1), random.in(0, 1), .123}});
    for (int i = 1; i + 1 < 40; i++) {
        const std::string a = std::to_string(i) + " ", b = std::to_string(i + 1) + " ";
        sides += "f 40 " + a + b + "\nf 40 " + b + a + "\n";
    }
    const Model sheet = load(sides);
    for (int i = 0; i < 3 * sheet.nfaces(); i++) CHECK_EQ(std::fabs(sheet.normal(i / 3, i % 3).z), 1);

    // Given normals are normalised, and one without length is made.
    const Model given =
        load(square + "vn 0 0 5\nvn 3e300 0 4e300\nvn 0 1e-310 0\nvn 0 0 0\nf 1//1 2//2 3//3\nf 1//4 3//-1 4\n");
    CHECK_EQ(text(given.normal(0, 0)), "0 0 1");
    CHECK_NEAR(norm(given.normal(0, 1) - vec3{.6, 0, .8}), 0, few_roundings);
    CHECK_EQ(text(given.normal(0, 2)), "0 1 0");
    CHECK_EQ(normals(given, 1), upright);
    CHECK_EQ(normals(load(square + "vn 0 0 0\nf 1//1 3//1 2//1\n")), "0 0 -1, 0 0 -1, 0 0 -1");
}

// ---- materials ----

TEST("faces are grouped by material, in the order of their first faces; an unknown one is the default, with a note") {
    const Folder folder;
    const std::string mtl = "newmtl red\nKd 1 0 0\nnewmtl unused\nnewmtl blue\nKd 0 0 1\n";
    const Model m = folder.load(
        square + "usemtl blue\nf 1 2 3\nusemtl red\nf 2 3 4\nusemtl blue\nf 3 4 1\nf 4 1 2\nusemtl red\n", mtl);
    CHECK_EQ(faces(m), "0 1 2, 2 3 0, 3 0 1, 1 2 3");
    CHECK_EQ(materials(m), "blue 0 0 1; red 1 0 0; ");
    CHECK_EQ(m.groups()[0].end, 3);

    std::string many = square, blue, red;
    for (int i = 0; i < 100; i++) {
        many += "v 0 0 0\n" + std::string(i % 2 ? "usemtl red" : "usemtl blue") + "\nf 1 2 -1\n";
        (i % 2 ? red : blue) += (blue.empty() ? "0 1 " : ", 0 1 ") + std::to_string(4 + i);
    }
    CHECK_EQ(faces(folder.load(many, mtl)), blue + red);  // stably

    folder.write("m.mtl", "newmtl red\nKd .5\n");
    const Model mixed = folder.load(square + "f 1 2 3\nusemtl green\nf 2 3 4\nusemtl red\nf 3 4 1\nusemtl pink\n"
                                             "f 4 1 2\nusemtl green\nf 1 2 4\nmtllib m.mtl\n");
    CHECK_EQ(faces(mixed), "0 1 2, 1 2 3, 3 0 1, 0 1 3, 2 3 0");
    CHECK_EQ(materials(mixed), " 1 1 1; red 0.5 0.5 0.5; a material that no file has: 'green' and 1 more\n");
}

TEST("a missing .mtl and a colour that is none are notes; mtllib lines have a name with blanks, or several names") {
    const Folder folder;
    const std::string face = square + "f 1 2 3\n";
    CHECK_EQ(materials(load("mtllib none.mtl\nmtllib gone.mtl lost.mtl\n" + face)),
             " 1 1 1; a material file that is not there: 'none.mtl' and 2 more\n");
    for (const std::string bad : {"Kd 1 x 0", "Kd nan", "Kd 1 2", "Kd", "Kd 1e999 0 0", "Kd 1 1 1y",
                                  "Kd spectral a.rfl", "Kd xyz 1 1 1", "Ke 1 1 x"})
        CHECK_EQ(materials(folder.load("usemtl a\n" + face, "# a comment\r\nnewmtl a\r\n\r\n" + bad + "\r\n")),
                 "a 1 1 1; a colour that is no number, left out: m.mtl:4\n");
    CHECK_THROWS(folder.load(face, std::string("newmtl a\0b", 10)), "m.mtl: is a binary file");
    CHECK_THROWS(folder.load(face, "<html>"), "m.mtl: is a HTML or XML file");
    const std::string mtl = "\xEF\xBB\xBF" "Kd 1 1 1\nNEWMTL a\nKE .25 2 0\nkD 1\nKD .5\nNs 10\nillum 2";
    const Model glowing = folder.load("usemtl a\n" + face, mtl);
    CHECK_EQ(materials(glowing), "a 0.5 0.5 0.5; ");
    CHECK(glowing.materials()[0].Ke == (vec3{.25, 1, 0}));

    fs::create_directory(folder / "sub");
    folder.write("my own.mtl", "newmtl my own # colour\nKd .25\n");
    folder.write("sub/b.mtl", "newmtl b\nKd 2 -1 .5\n");  // a reflectance is in [0,1]
    for (const std::string own : {"my own.mtl", "my\\ own.mtl", "C:\\models\\My Own.MTL", "/no/such/folder/my own.mtl"})
        CHECK_EQ(materials(folder.load(square + "mtllib \\\n " + own + " \\\r\n \\\n\r\nmtllib sub\\b.mtl c.mtl\n"
                                                "usemtl my own # colour \nf 1 2 3\nusemtl b\nf 1 2 3\n")),
                 "my own # colour 0.25 0.25 0.25; b 1 0 0.5; a material file that is not there: 'c.mtl'\n");

    // A note has a line, whatever a name is made of, and there is one for each kind of thing.
    std::string obj = square;
    for (int i = 0; i < 100; i++)
        obj += "usemtl " + std::string(1000, 'x') + "\x1B\n" + "usemtl \x1B" + std::to_string(i) + "\nf 1 2 3\n";
    CHECK_EQ(notes(load(obj)), "a material that no file has: '?0' and 99 more\n");
    CHECK(notes(load(square + "usemtl " + std::string(100000, 'x') + "\nf 1 2 3\n")).size() < 100);
}

// ---- textures ----

const std::string textured = full_square + "f 1/1 2/2 3/3\n";

const char* const suffixes[] = {"m_diffuse.tga", "m_nm.tga", "m_nm_tangent.tga", "m_spec.tga", "m_glow.tga"};
void all_suffixes(const Folder& folder) {
    for (int i = 0; i < 5; i++) folder.picture(suffixes[i], 10 * i + 10, i == 3 ? TGAImage::GRAYSCALE : TGAImage::RGB);
}
std::string maps(const Model& m) {  // of each material the first channels, -1 where there is no map, and the notes
    std::string out;
    for (const Material& each : m.materials())
        for (const Map* map : {&each.diffuse, &each.normal, &each.tangent, &each.specular, &each.glow})
            out += shown(*map ? (*map)->get(0, 0)[0] : -1) + (map == &each.glow ? "; " : " ");
    return out + notes(m);
}

TEST("textures beside the model are found by their suffix, and may be absent; one normal map is decoded") {
    const Folder folder;
    all_suffixes(folder);
    const Model m = folder.load(textured);
    CHECK_EQ(maps(m), "10 20 -1 40 50; ");
    CHECK_EQ(m.materials()[0].diffuse->get(1, 1)[2], 12);
    folder.write("m_nm.tga", "no picture");
    CHECK_EQ(maps(folder.load(textured, NormalMap::tangent)), "10 -1 30 40 50; ");
    CHECK_THROWS(folder.load(textured), "m_nm.tga: ");
    fs::remove(folder / "m_nm.tga");
    CHECK_EQ(maps(folder.load(textured)), "10 -1 30 40 50; ");
    folder.picture("m_nm.tga", 20);
    fs::remove(folder / "m_nm_tangent.tga");
    CHECK_EQ(maps(folder.load(textured, NormalMap::tangent)), "10 20 -1 40 50; ");
    folder.picture("m.b_glow.tga", 60);
    Model dotted(folder.write("m.b.obj", textured));
    CHECK_EQ(maps(dotted), "-1 -1 -1 -1 -1; ");
    dotted.load_textures();
    CHECK_EQ(maps(dotted), "-1 -1 -1 -1 60; ");
}

TEST("faces without texture coordinates have no textures; grey pictures are no normal maps") {
    const Folder folder;
    folder.write("m_diffuse.tga", "no picture");  // is not even decoded
    CHECK_EQ(maps(folder.load(full_square + "f 1 2 3\n")), 
             "-1 -1 -1 -1 -1; no texture coordinates, so no textures: ''\n");
    for (const char* name : suffixes) folder.picture(name, 77, TGAImage::GRAYSCALE);
    const Model m = folder.load(full_square + "usemtl a\nf 1 2 3/1\nusemtl b\nf 1 2 3\n",
                                "newmtl a\nnewmtl b\nmap_Kd m_diffuse.tga\n");
    CHECK_EQ(maps(m), "77 -1 -1 77 77; -1 -1 -1 -1 -1; a grey picture, heights and no normals, left out: m_nm.tga\n"
                      "no texture coordinates, so no textures: 'b'\n");
    CHECK_EQ(m.materials()[0].diffuse->bytespp(), 1);
    // Heights are often stored in three channels.
    TGAImage heights(2, 2, TGAImage::RGB);
    for (const int blue : {5, 6}) {
        for (int i = 0; i < 4; i++) heights.set(i % 2, i / 2, {{static_cast<std::uint8_t>(i < 3 ? 5 : blue), 5, 5, 0}});
        heights.write_tga_file(folder / "h.tga");
        const std::string grey = "77 -1 -1 77 77; a grey picture, heights and no normals, left out: h.tga\n";
        fs::remove(folder / "m_nm.tga"), fs::remove(folder / "m_nm_tangent.tga");
        CHECK_EQ(maps(folder.load("usemtl a\n" + textured, "newmtl a\nmap_Bump h.tga\n")),
                 blue == 5 ? grey : "77 -1 5 77 77; ");
    }
}

TEST("the maps of an .mtl, relative to it, before those by suffix") {
    const Folder folder;
    fs::create_directories(folder / "lib/my maps");
    folder.picture("lib/my maps/a b.tga", 100);
    folder.picture("lib/s.TGA", 110);
    folder.picture("lib/n.tga", 120);
    folder.picture("lib/e.tga", 130);
    folder.picture("lib/bump.tga", 140);
    folder.write("lib/m.mtl",
                 "newmtl full\nmap_Kd -s 1 1 1 -o .5 -clamp on my maps\\a b.tga\nmap_Ns s.TGA\nnorm -bm 0.5 n.tga\n"
                 "map_Bump -bm 1 bump.tga\nmap_Ke -mm 0 1 -blendu off -type sphere -imfchan l e.tga \r\n"
                 "newmtl part\n  map_Kd\tmy maps/a b.tga\nnewmtl none\nmap_Kd gone.tga\nnewmtl none\nKa 0 0 0\n"
                 "newmtl bumpy\nBUMP bump.tga\n");
    std::string obj = "mtllib lib/m.mtl\n" + full_square;
    for (const std::string name : {"full", "part", "none", "bumpy"}) obj += "usemtl " + name + "\nf 1/1 2/2 3/3\n";
    CHECK_EQ(maps(folder.load(obj)), "100 -1 120 110 130; 100 -1 -1 -1 -1; -1 -1 -1 -1 -1; -1 -1 140 -1 -1; ");
    all_suffixes(folder);
    CHECK_EQ(maps(folder.load(obj)), "100 20 -1 110 130; 100 20 -1 40 50; 10 20 -1 40 50; 10 20 -1 40 50; ");
    CHECK_EQ(maps(folder.load(obj, NormalMap::tangent)),
             "100 -1 120 110 130; 100 -1 30 40 50; 10 -1 30 40 50; 10 -1 140 40 50; ");
}

TEST("-s and -o of a map scale and shift it") {
    const Folder folder;
    folder.picture("a.tga", 1);
    const Model m = folder.load("usemtl a\n" + textured,
                                "newmtl a\nmap_Kd -s 2 -o .5 .25 1 a.tga\nmap_Ns -o -1 -s 3 4 a.tga\n"
                                "map_Ke -bm 7 -s x -o nan 1 a.tga\nmap_Bump a.tga\n");
    const Material& a = m.materials()[0];
    CHECK_EQ(maps(m), "1 -1 1 1 1; ");
    CHECK(a.diffuse.is_moved && a.diffuse.scale == (vec2{2, 1}) && a.diffuse.offset == (vec2{.5, .25}));
    CHECK(a.specular.is_moved && a.specular.scale == (vec2{3, 4}) && a.specular.offset == (vec2{-1, 0}));
    CHECK(a.glow.scale == (vec2{1, 1}) && a.glow.offset == (vec2{0, 1}));
    CHECK(!a.tangent.is_moved);
}

TEST("a map is found by its last part in any case, beside a link's target, as .tga of the same stem; else a note") {
    const Folder folder;
    fs::create_directories(folder / "maps");
    folder.picture("maps/Wood.tga", 10);
    folder.picture("metal.TGA", 20);
    const std::string obj = "usemtl a\n" + textured;
    const auto drawn = [&](const std::string& name) {
        return maps(folder.load(obj, "newmtl a\nmap_Kd " + name + "\n"));
    };
    for (const std::string name : {"maps/Wood.tga", "maps\\wood.TGA", "maps/WOOD.png", "maps//wood"})
        CHECK_EQ(drawn(name), "10 -1 -1 -1 -1; ");
    for (const std::string name : {"metal.TGA", "C:\\art\\Metal.tga", "/usr/none/METAL.tga", "maps/metal.png",
                                   "-s 1 metal"})
        CHECK_EQ(drawn(name), "20 -1 -1 -1 -1; ");
    folder.picture("METAL.tga", 30);  // where several are the same in small letters, one is always the one
    CHECK_EQ(drawn("metal.tga"), "30 -1 -1 -1 -1; ");

    for (const auto& [bytes, kind] : std::vector<std::pair<std::string, std::string>>{
             {"\x89PNG\r\n", "png:"}, {"\xFF\xD8\xFF\xE0", "jpeg:"}, {"GIF89a", "gif:"}, {"BM12", "bmp:"}, {"???", ""}})
        for (const std::string name : {"t.png", "t.TGA", "t"}) {
            if (kind.empty() && name == "t.TGA") continue;  // then it is a bad TGA file
            folder.write(name, bytes);
            CHECK_EQ(drawn(name), "-1 -1 -1 -1 -1; a picture that is not TGA, left out until it is converted: "
                                  "convert '" + kind + (folder / name).string() + "' '" + (folder / "t.tga").string() +
                                      "'\n");
            fs::remove(folder / name);
        }
    CHECK_EQ(drawn("gone.tga"), "-1 -1 -1 -1 -1; a picture that is not there, left out: 'gone.tga'\n");
    CHECK_EQ(drawn(""), "-1 -1 -1 -1 -1; ");
    for (const std::string folder_name : {".", "Maps"})
        CHECK_EQ(drawn(folder_name),
                 "-1 -1 -1 -1 -1; a picture that is not there, left out: '" + folder_name + "'\n");
    CHECK_EQ(drawn("-s 1 \"maps/Wood.tga\""), "10 -1 -1 -1 -1; ");
    folder.write("t.png", "\x89PNG");
    folder.picture("t.tga", 40);
    CHECK_EQ(drawn("t.png"), "40 -1 -1 -1 -1; ");
    folder.picture("m_diffuse.tga", 50);  // by its suffix, instead of what is left out
    CHECK_EQ(drawn("gone.tga").substr(0, 17), "50 -1 -1 -1 -1; a");
    folder.write("m_diffuse.tga", "\x89PNG");
    CHECK_EQ(maps(folder.load(textured)).substr(0, 42), "-1 -1 -1 -1 -1; a picture that is not TGA,");
    folder.write("maps/m.mtl", "newmtl a\nmap_Kd metal.TGA\nKd 0 0 0\n");  // that picture is beside the .obj
    const Model far = folder.load("mtllib \"maps/m.mtl\"\n" + obj);
    CHECK_EQ(maps(far), "20 -1 -1 -1 -1; ");
    CHECK(far.materials()[0].Kd == (vec3{1, 1, 1}));  // black would leave nothing of the map

    std::error_code no_links;
    fs::create_directories(folder / "real");
    folder.write("real/x.obj", "mtllib x.mtl\nusemtl a\n" + textured);
    folder.write("real/x.mtl", "newmtl a\nmap_Ns s.tga\n");
    folder.picture("real/s.tga", 60);
    folder.picture("real/x_glow.tga", 70);
    fs::create_symlink(folder / "real/x.obj", folder / "link.obj", no_links);
    if (no_links) return;
    Model linked(folder / "link.obj");
    linked.load_textures();
    CHECK_EQ(maps(linked), "-1 -1 -1 60 70; ");
}

TEST("a corrupt picture is an error, in a fixed order; what no face uses is not even noted") {
    const Folder folder;
    const std::string mtl = "newmtl a\nmap_Ns gone.tga\nmap_Kd lost.tga\nnewmtl unused\nmap_Kd bad.tga\nmap_Ke x.jpg\n";
    const std::string obj = textured + "usemtl a\nf 1/1 2/2 3/3\nusemtl unused\n";
    folder.write("bad.tga", "no picture");
    CHECK_EQ(maps(folder.load(obj, mtl)),
             "-1 -1 -1 -1 -1; -1 -1 -1 -1 -1; a picture that is not there, left out: 'gone.tga' and 1 more\n");
    CHECK_THROWS(folder.load("usemtl unused\n" + textured, mtl), "bad.tga: ");

    // The errors of the .obj, then of the textures by their names.
    for (const char* name : suffixes) folder.write(name, "no picture");
    CHECK_THROWS(folder.load(textured + "f 0 0 0\n", "Kd x\n"), "m.obj:13: '0' is none");
    for (int i = 0; i < 50; i++) CHECK_THROWS(folder.load(textured, ""), "m_diffuse.tga: ");
    fs::remove(folder / "m_diffuse.tga");
    for (int i = 0; i < 50; i++) CHECK_THROWS(folder.load(textured, ""), "m_glow.tga: ");
}

TEST("a picture that materials share is decoded once") {
    const Folder folder;
    folder.picture("m_diffuse.tga", 5);
    const std::string two = "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\n";
    const Model m = folder.load(full_square + two, "newmtl a\nnewmtl b\n");
    CHECK_EQ(maps(m), "5 -1 -1 -1 -1; 5 -1 -1 -1 -1; ");
    CHECK(m.materials()[0].diffuse.picture == m.materials()[1].diffuse.picture);
}

TEST("a vertex that no face uses is put where another is; move puts each where it is told, and the box follows") {
    Model m = load("v -1 -1 -1\nv 1 0 0\nv 0 .5 1\nv 99 0 0\nf 1 2 3\n");
    CHECK_EQ(vertices(m.verts()), "v -1 -1 -1\nv 1 0 0\nv 0 0.5 1\nv -1 -1 -1\n");
    m.move([](const vec3& v) { return v * 2 + vec3{0, 0, 1e6}; });
    CHECK_EQ(vertices(m.verts()), "v -2 -2 999998\nv 2 0 1000000\nv 0 1 1000002\nv -2 -2 999998\n");
    CHECK_EQ(vertices({m.low(), m.high()}), "v -2 -2 999998\nv 2 1 1000002\n");
}

// ---- anything at all ----

// Loads whatever is in the folder: a model that keeps its promises, or a runtime_error; anything else fails.
bool survives(const Folder& folder, const std::string& obj) {
    try {
        folder.load(obj);
        return true;
    } catch (const std::runtime_error& e) {
        CHECK(std::string(e.what()).find('\n') == std::string::npos);
        return false;
    }
}

std::string mutated(std::string s, Random& random) {
    const std::string alphabet = "vtnfumKd /-.#\\\r\n\t0123456789e\x80";
    for (int n = 1 + random.below(4); n-- > 0 && !s.empty();) {
        const std::size_t at = random.rng() % s.size();
        if (random.below(3) == 0) s.erase(at, random.below(12));
        else if (random.below(2)) s.insert(at, s.substr(random.rng() % s.size(), random.below(40)));
        else s[at] = alphabet[random.rng() % alphabet.size()];
    }
    return s;
}

TEST("mutated files give a model or an error, never a crash; faces of random corners give a model") {
    const Folder folder;
    all_suffixes(folder);
    folder.picture("a b.tga", 9);
    const std::string mtl =
        "newmtl a\nKd .5 .5 .5\nmap_Kd -s 1 1 1 a b.tga\nmap_Bump m_nm.tga\nnewmtl b\nmap_Ns m_spec.tga\nKd 1\n";
    const std::string obj = "# head\nmtllib m.mtl\n" + cube() + full_square +
                            "usemtl a\nf 1/1/1 3/2/2 4/3/3 2/1\ng x\nusemtl b\nf -8//1 -7 -6 -5 6\nf 1 2 \\\n 6 5\n"
                            "f 3 7 8\nusemtl a\nf 1 5 7\n";
    folder.write("m.mtl", mtl);
    CHECK(survives(folder, obj));
    Random random(9);
    int loaded = 0;
    const int n = 3000;
    for (int i = 0; i < n; i++) {
        const std::string text = mutated(obj, random);
        if (i % 4 == 0) folder.write("m.mtl", mutated(mtl, random));
        loaded += survives(folder, text);
    }
    CHECK(loaded > n / 20);  // so both outcomes have been seen
    CHECK(loaded < n - n / 20);

    // Faces of random corners among random points, some of them at the ends of the range, give a model.
    const char* const exponents[] = {"", "", "e-320", "e307", "e-160", "e-8"};
    for (int i = 0; i < 1000; i++) {
        std::string points;
        for (int k = 0; k < 36; k++)
            points += (k % 3 ? " " : "\nv ") + std::to_string(random.below(7) - 3) + exponents[random.below(6)];
        for (int k = 0; k < 8; k++) {
            points += "\nf";
            for (int corners = 3 + random.below(8); corners-- > 0;)
                points.append(" ").append(std::to_string(1 + random.below(12)));
        }
        CHECK(survives(folder, points));
    }
}

}  // namespace

int main(int argc, char** argv) { return run_tests(argc, argv); }
