// scenes_test.cpp: many small pictures, each of one feature; every one must be its reference in tests/reference.
// Geometry and command line stand together: `scenes_test NAME` runs one scene, and the target update_references makes
// all references anew. It knows nothing of what is right but that a person looked at them.
#include "compare.h"
#include "run.h"
#include "scenes.h"

#include <map>

namespace fs = std::filesystem;

namespace {

// A folder with models, their materials and textures, and the program run in it. Models are written piece by piece.
// Only + - * / and square roots make their coordinates: they are the same everywhere.
class Scene : public Folder {
public:
    std::string materials = "newmtl white\nKd .8 .8 .8\nnewmtl grey\nKd .45 .45 .45\n"
                            "newmtl red\nKd .8 .2 .15\nnewmtl dark_red\nKd .45 .1 .08\n"
                            "newmtl blue\nKd .15 .35 .8\nnewmtl dark_blue\nKd .08 .18 .45\n"
                            "newmtl green\nKd .2 .7 .25\nnewmtl yellow\nKd .8 .7 .15\n"
                            "newmtl violet\nKd .6 .25 .7\nnewmtl cyan\nKd .15 .7 .7\n";

    // What is added from now on is moved and made larger: p becomes p * size + offset.
    vec3 offset;
    double size = 1;

    explicit Scene(void (*build)(Scene&)) {
        text_.precision(12);
        build(*this);
        next_model();
        write("palette.mtl", materials);
    }

    // Runs the program with these arguments and all models, and returns a picture that it wrote.
    TGAImage draw(const std::string& arguments, const std::string& picture = "framebuffer.tga") const {
        const Outcome o = run("--quiet " + arguments + models_);
        if (o.status != 0) throw std::runtime_error("umbra " + arguments + ": " + o.err);
        return TGAImage::read_tga_file(*this / picture);
    }

    using Folder::write;
    void write(const std::string& name, const TGAImage& picture) const { picture.write_tga_file(*this / name); }

    // What is added from now on goes into a file of its own. The first is model.obj; its textures are model_....tga.
    void next_model() {
        if (vertices_ == 0) return;
        const std::string name = models_.empty() ? "model.obj" : "second.obj";
        write(name, "mtllib palette.mtl\n" + text_.str());
        models_ += " " + name;
        text_.str("");
        vertices_ = uvs_ = normals_ = 0;
    }

    // Every shape begins with the name of its material, "" for none.
    //
    // A polygon that shares no vertices, and so no normals either; counter-clockwise where its front is seen.
    void polygon(const std::string& material, const std::vector<vec3>& corners, const std::vector<vec2>& uvs = {},
                 const std::vector<vec3>& normals = {}) {
        Strings numbers;
        for (std::size_t i = 0; i < corners.size(); i++) {
            numbers.push_back(vertex(corners[i]));
            if (!uvs.empty()) numbers.back() += '/' + uv(uvs[i]);
            if (!normals.empty()) numbers.back() += "//" + normal(normals[i]);
        }
        face(material, numbers);
    }
    // A quadrangle whose texture coordinates run from LOW at its first corner to HIGH at its third, the opposite one.
    void quad(const std::string& material, const vec3& a, const vec3& b, const vec3& c, const vec3& d,
              const vec2& low = {0, 0}, const vec2& high = {1, 1}) {
        polygon(material, {a, b, c, d}, {low, {high.x, low.y}, high, {low.x, high.y}});
    }
    void box(const std::string& material, const vec3& low, const vec3& high) {
        for (const auto& [a, b, c, d] : box_sides(low, high)) quad(material, a, b, c, d);
    }
    // An octahedron whose faces are cut into n*n triangles and blown up; vertices are shared, and no normals are given.
    // Texture coordinates are those of a projection along z.
    void sphere(const std::string& material, const vec3& center, double radius, int n) {
        std::map<std::array<int, 3>, std::string> known;
        const auto corner = [&](int x, int y, int z) {
            std::string& it = known[{x, y, z}];
            const vec3 p = normalized(vec3{double(x), double(y), double(z)});
            if (it.empty()) it = vertex(center + p * radius) + "/" + uv({p.x / 2 + .5, p.y / 2 + .5});
            return it;
        };
        for (int octant = 0; octant < 8; octant++) {
            const int sx = octant & 1 ? -1 : 1, sy = octant & 2 ? -1 : 1, sz = octant & 4 ? -1 : 1;
            const auto at = [&](int i, int j) {
                if (sx * sy * sz < 0) std::swap(i, j);  // a mirrored octant winds the other way round
                return corner(sx * i, sy * j, sz * (n - i - j));
            };
            for (int i = 0; i < n; i++)
                for (int j = 0; i + j < n; j++) {
                    face(material, {at(i, j), at(i + 1, j), at(i, j + 1)});
                    if (i + j + 2 <= n) face(material, {at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
                }
        }
    }

private:
    void face(const std::string& material, const Strings& corners) {
        if (!material.empty()) text_ << "usemtl " << material << '\n';
        text_ << 'f';
        for (const std::string& corner : corners) text_ << ' ' << corner;
        text_ << '\n';
    }
    // Each writes a line and returns its number.
    std::string vertex(const vec3& p) { return line("v", p * size + offset, ++vertices_); }
    std::string normal(const vec3& n) { return line("vn", n, ++normals_); }
    std::string uv(const vec2& t) { return line("vt", {t.x, t.y, 0}, ++uvs_); }
    std::string line(const char* what, const vec3& v, int n) {
        text_ << what << ' ' << v.x << ' ' << v.y << ' ' << v.z << '\n';
        return std::to_string(n);
    }
    std::ostringstream text_;
    std::string models_;  // as arguments
    int vertices_ = 0, uvs_ = 0, normals_ = 0;
};

void check(const TGAImage& picture, const std::string& name) { CHECK_EQ(not_reference(picture, name), ""); }

// A scene is a function that adds the models; what is drawn with the arguments must be the reference of the same name.
#define SCENE(name, ...)             \
    static void name(Scene& s);      \
    PICTURE(name, name, __VA_ARGS__) \
    static void name(Scene& s)

// Another picture of a scene that there is.
#define PICTURE(name, scene, ...) \
    static const Registration registration_##name(#name, [] { check(Scene(scene).draw(__VA_ARGS__), #name); });

TGAColor rgb(int r, int g, int b) {
    return {{static_cast<std::uint8_t>(b), static_cast<std::uint8_t>(g), static_cast<std::uint8_t>(r), 255}};
}

// A square picture: colour(x, y) is that of the pixel.
template <class Colour>
TGAImage painted(int size, const Colour& colour) {
    TGAImage picture(size, size, TGAImage::RGB);
    for (int y = 0; y < size; y++)
        for (int x = 0; x < size; x++) picture.set(x, y, colour(x, y));
    return picture;
}

// n x n squares of so many pixels each, the bottom-left one dark.
TGAImage checkers(int n, int pixels, const TGAColor& dark = rgb(60, 70, 90),
                  const TGAColor& light = rgb(200, 200, 190)) {
    return painted(n * pixels, [&](int x, int y) { return (x / pixels + y / pixels) % 2 ? light : dark; });
}

// An F, which is like none of its mirror images and turns; each corner of the picture has its own colour:
// red at uv (0,0), green at (1,0), blue at (1,1), yellow at (0,1).
TGAImage letter(const TGAColor& ink = rgb(20, 20, 20), const TGAColor& paper = rgb(200, 200, 190)) {
    constexpr const char* rows[] = {"y......b",   // the top one
                                    "..FFFF..",
                                    "..F.....",
                                    "..FFF...",
                                    "..F.....",
                                    "..F.....",
                                    "..F.....",
                                    "r......g"};
    const std::map<char, TGAColor> colours{{'F', ink},              {'.', paper},           {'r', rgb(200, 30, 30)},
                                           {'g', rgb(30, 160, 30)}, {'b', rgb(30, 60, 200)}, {'y', rgb(200, 190, 30)}};
    return painted(8, [&](int x, int y) { return colours.at(rows[7 - y][x]); });
}

// A normal map of n x n domes, of so many texels each. I, J and K are where the texture's u, its v and its front point:
// those of the face for a map in object space, the axes themselves for one in tangent space.
TGAImage domes(int n, int texels, const vec3& i = {1, 0, 0}, const vec3& j = {0, 1, 0}, const vec3& k = {0, 0, 1}) {
    const auto encoded = [](double c) { return static_cast<int>((c + 1) * 127.5 + .5); };
    return painted(n * texels, [&](int x, int y) {
        // -1 to 1 over the cell; the dome's rim is at .8, where its slope is 60 degrees
        const double a = (2 * (x % texels) + 1. - texels) / texels, b = (2 * (y % texels) + 1. - texels) / texels;
        const double r = std::sqrt(a * a + b * b) / .8, lean = .87 / .8;
        const vec3 t = r < 1 ? vec3{a * lean, b * lean, std::sqrt(1 - .87 * .87 * r * r)} : vec3{0, 0, 1};
        const vec3 normal = i * t.x + j * t.y + k * t.z;
        return rgb(encoded(normal.x), encoded(normal.y), encoded(normal.z));
    });
}

// What most scenes about shadows show: a floor, a ball, a block, and a board that stands on edge. It fits in [-1,1]^3.
void add_yard(Scene& s) {
    s.box("white", {-1, -.6, -1}, {1, -.5, 1});
    s.sphere("red", {-.4, -.1, .35}, .4, 12);
    s.box("blue", {.15, -.5, -.65}, {.6, .6, -.35});
    s.box("yellow", {.45, -.5, .2}, {.52, .05, .8});
}

}  // namespace

// ---- which pixels ----

// Every edge and every diagonal runs through pixel centres: 36 pixels are one unit, and a square is 8 pixels. Each
// centre belongs to one square, so all are 8 x 8. The red ones are drawn first: were edges everybody's, they would be
// larger than the blue ones; were they nobody's, there would be black lines.
SCENE(edge_rule, "--size 96x96 --shadow off --no-fit --eye 0,0,4 --light 0,0,1") {
    for (const int colour : {0, 1})
        for (int half : {0, 1})
            for (int y = 0; y < 9; y++)
                for (int x = (y + colour) % 2; x < 9; x += 2) {
                    const auto at = [&](int i, int j) {
                        return vec3{(8 * (x + i) - 35.5) / 36, (8 * (y + j) - 35.5) / 36, 0};
                    };
                    if (half == 0) s.polygon(colour ? "blue" : "red", {at(0, 0), at(1, 0), at(1, 1)});
                    else s.polygon(colour ? "dark_blue" : "dark_red", {at(0, 0), at(1, 1), at(0, 1)});
                }
}

// One quad from far in front of the eye to far behind it, just below the eye: the lowest pixels show what is a tenth of
// the way to the centre.
SCENE(near_plane, "--size 128x96 --shadow off --no-fit --eye .3,-.36,2 --center 0,-.5,0 --light .3,1,.5") {
    s.quad("", {-8, -.5, 10}, {8, -.5, 10}, {8, -.5, -10}, {-8, -.5, -10}, {0, 0}, {32, 40});
    s.write("model_diffuse.tga", checkers(2, 4));
}

// Six triangles a million pixels large meet in the middle. In front of them is a small hexagon in lighter and darker
// colours, cut the same way: every line goes on straight through its rim.
SCENE(guard_band, "--size 96x96 --shadow off --no-fit --eye 0,0,4 --light 0,0,1") {
    const vec2 corners[] = {{1, .13}, {.41, .91}, {-.57, .83}, {-1, -.21}, {-.33, -.94}, {.62, -.79}};
    const auto fan = [&](double size, double z, const std::array<const char*, 6>& colours) {
        for (std::size_t i = 0; i < 6; i++) {
            const vec2 a = corners[i] * size, b = corners[(i + 1) % 6] * size;
            s.polygon(colours[i], {{0, 0, z}, {a.x, a.y, z}, {b.x, b.y, z}});
        }
    };
    fan(30000, 0, {"red", "dark_red", "blue", "dark_blue", "white", "grey"});
    fan(.7, 1e-3, {"dark_red", "red", "dark_blue", "blue", "grey", "white"});
}

// 80 000 triangles, most of which hit no pixel's centre: no holes.
SCENE(subpixel_triangles, "--size 64x64 --shadow off") { s.sphere("green", {0, 0, 0}, 1, 100); }

// Three bars, each in front of the next one and behind the one before, and a triangle that all three run through.
SCENE(depth_test, "--size 96x96 --shadow off --eye 0,0,4 --light 0,0,1") {
    const auto bar = [&](const char* colour, const vec3& from, const vec3& to) {
        const vec3 across = normalized(cross(to - from, vec3{0, 0, 1})) * .14;
        s.polygon(colour, {from - across, from + across, to + across, to - across});
    };
    bar("red", {-.9, -.5, -.5}, {.9, -.5, .5});
    bar("green", {.7, -.9, -.5}, {-.15, .9, .5});
    bar("blue", {.15, .9, -.5}, {-.7, -.9, .5});
    s.polygon("yellow", {{-.55, .25, .2}, {0, -.8, -.2}, {.55, .2, .1}});
}

// A box without a lid, seen into: the near walls show their fronts, the far ones and the bottom their backs. Its
// normals all point to the light, so that fronts and backs are equally bright.
SCENE(back_faces, "--size 96x96 --shadow off --eye 1.5,3,3 --light .3,1,.5") {
    const vec3 l{.3, 1, .5};
    const auto wall = [&](const char* colour, const std::vector<vec3>& corners) {
        s.polygon(colour, corners, {}, {l, l, l, l});
    };
    wall("red", {{-.8, -.5, .8}, {.8, -.5, .8}, {.8, .3, .8}, {-.8, .3, .8}});
    wall("cyan", {{.8, -.5, -.8}, {-.8, -.5, -.8}, {-.8, .3, -.8}, {.8, .3, -.8}});
    wall("blue", {{.8, -.5, .8}, {.8, -.5, -.8}, {.8, .3, -.8}, {.8, .3, .8}});
    wall("yellow", {{-.8, -.5, -.8}, {-.8, -.5, .8}, {-.8, .3, .8}, {-.8, .3, -.8}});
    wall("grey", {{-.8, -.5, -.8}, {.8, -.5, -.8}, {.8, -.5, .8}, {-.8, -.5, .8}});
}

// The eye is in a room: walls run past it on all sides.
SCENE(eye_inside, "--size 128x96 --shadow off --no-fit --eye .5,0,.7 --center -.1,-.2,-.5 --light .5,1,.8") {
    s.box("white", {1, 1, 1}, {-1, -1, -1});
    s.box("red", {-.6, -1, -.8}, {-.2, -.3, -.4});
    s.write("model_diffuse.tga", checkers(6, 4));
}

// Polygons for which a fan from the first corner would be wrong: a star, an arrow and a spiral, a face each.
SCENE(concave_polygons, "--size 96x96 --shadow off --eye 0,0,4 --light 0,0,1") {
    s.polygon("yellow", {{-.5, .95, 0}, {-.605804, .64562, 0}, {-.927995, .63905, 0}, {-.671198, .44438, 0},
                         {-.76451, .13595, 0}, {-.5, .32, 0}, {-.23549, .13595, 0},
                         {-.328802, .44438, 0}, {-.072005, .63905, 0}, {-.394196, .64562, 0}});
    s.polygon("red", {{.05, .1, 0}, {.5, .4, 0}, {.95, .1, 0}, {.5, .95, 0}});
    s.polygon("cyan", {{-.9, -.95, 0}, {.9, -.95, 0}, {.9, -.1, 0}, {-.6, -.1, 0}, {-.6, -.65, 0}, {.5, -.65, 0},
                       {.5, -.4, 0}, {-.3, -.4, 0}, {-.3, -.3, 0}, {.65, -.3, 0}, {.65, -.8, 0}, {-.75, -.8, 0},
                       {-.75, 0, 0}, {-.9, 0, 0}});
}

// ---- where the viewer is ----

// Five balls in a row, three in a column: a wide picture shows the row and a tall one the column, and balls are round.
SCENE(wide, "--size 192x48 --shadow off --no-fit --eye 0,0,12 --light 1,1,1") {
    for (const int i : {-2, -1, 0, 1, 2}) {
        s.sphere(i == 0 ? "white" : "red", {1.6 * i, 0, 0}, .7, 10);
        if (i != 0) s.sphere("blue", {0, 1.6 * i, 0}, .7, 10);
    }
}
PICTURE(tall, wide, "--size 48x192 --shadow off --no-fit --eye 0,0,12 --light 1,1,1")

// The yard from behind: the block is on the left now.
PICTURE(from_behind, add_yard, "--size 128x128 --shadow off --no-fit --eye -1,1,-4 --light .5,1,-.6")

// Not the origin but the card is looked at, and up is to the upper right: the card is in the middle and leans to the
// left.
SCENE(center_and_up, "--size 96x96 --shadow off --no-fit --eye 2,1,1 --center 2,1,-3 --up 1,2,0 --light 0,0,1") {
    const vec3 at{2, 1, -3};
    s.quad("", at + vec3{-.8, -.8, 0}, at + vec3{.8, -.8, 0}, at + vec3{.8, .8, 0}, at + vec3{-.8, .8, 0});
    s.write("model_diffuse.tga", letter());
}

// The yard, 40 times as large and far away from the origin: it is fitted.
SCENE(fitted, "--size 128x128 --shadow-size 512 --eye 1,1.8,5 --light 1,1,.6") {
    s.offset = {1000, -2000, 1500};
    s.size = 40;
    add_yard(s);
}

// ---- textures ----

// The F is upright and not mirrored; red is at the bottom left, green at the bottom right.
SCENE(texture_orientation, "--size 96x96 --shadow off --eye .8,.5,4 --light 0,0,1") {
    s.quad("", {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0});
    s.write("model_diffuse.tga", letter());
}

// Texture coordinates from -1 to 3: 4 x 4 copies, all upright.
SCENE(uv_wrap, "--size 128x128 --shadow off --eye 0,0,4 --light 0,0,1") {
    s.quad("", {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {-1, -1}, {3, 3});
    s.write("model_diffuse.tga", letter());
}

// A wall of two triangles, near on the left and far on the right. Its rows of squares run straight to one point; did
// the texture ignore the perspective, they would bend at the diagonal.
SCENE(perspective_uv, "--size 128x128 --shadow off --no-fit --eye 0,0,4 --light 1,.3,1") {
    s.quad("", {-.9, -1, 2}, {1.2, -1, -5}, {1.2, 1, -5}, {-.9, 1, 2}, {0, 0}, {4, 1});
    s.write("model_diffuse.tga", checkers(8, 4));
}

// From the bottom left: Kd alone, a texture alone, Kd times a texture, and a texture with a glow.
SCENE(materials, "--size 96x96 --shadow off --eye 0,0,4 --light 0,0,1") {
    s.materials += "newmtl plain\nKd .8 .3 .1\n"
                   "newmtl textured\nmap_Kd letter.tga\n"
                   "newmtl tinted\nKd .3 .8 .3\nmap_Kd letter.tga\n"
                   "newmtl glowing\nKd .3 .3 .3\nmap_Kd letter.tga\nmap_Ke glow.tga\n";
    s.write("letter.tga", letter());
    s.write("glow.tga", checkers(4, 4, rgb(0, 0, 0), rgb(130, 60, 0)));
    const char* const names[] = {"plain", "textured", "tinted", "glowing"};
    for (int i = 0; i < 4; i++) {
        const double x = i % 2 - .95, y = i / 2 - .95;
        s.quad(names[i], {x, y, 0}, {x + .9, y, 0}, {x + .9, y + .9, 0}, {x, y + .9, 0});
    }
}

// ---- normals ----

// A coarse ball without normals: its outline has corners, its shading has none.
SCENE(smooth_normals, "--size 96x96 --shadow off --light 1,1,1") { s.sphere("grey", {0, 0, 0}, 1, 3); }

// A flat square whose normals lean outwards: it looks like a cushion.
SCENE(given_normals, "--size 96x96 --shadow off --eye 0,0,4 --light 1,1,1") {
    s.polygon("grey", {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {},
              {{-1, -1, .7}, {1, -1, .7}, {1, 1, .7}, {-1, 1, .7}});
}

// Domes on a tilted card, lit from the upper left: bright there, dark at the lower right.
static constexpr const char* card_view = "--size 96x96 --shadow off --eye 0,0,4 --light -1,1,1";
SCENE(object_normal_map, card_view) {
    const vec3 u{.8, 0, -.6}, v{0, 1, 0}, front{.6, 0, .8};
    s.quad("white", -u - v, u - v, u + v, -u + v);
    s.write("model_nm.tga", domes(3, 32, u, v, front));
}

// The same domes in tangent space: up to the rounding of the map it is the same picture.
SCENE(tangent_normal_map, card_view) {
    object_normal_map(s);
    fs::remove(s / "model_nm.tga");
    s.write("model_nm_tangent.tga", domes(3, 32));
}

// Where a model has both maps, --tangent takes the other one: here it is flat.
SCENE(tangent_option, "--tangent --size 96x96 --shadow off --eye 0,0,4 --light -1,1,1") {
    object_normal_map(s);
    s.write("model_nm_tangent.tga", domes(1, 32));
}

// One map four times: as it is, mirrored in u, in v, and in both. A dome stays a dome: bright at the upper left.
SCENE(mirrored_uv, "--size 96x96 --shadow off --eye 0,0,4 --light -1,1,1") {
    for (int i = 0; i < 4; i++) {
        const double x = i % 2 - .96, y = i / 2 - .96, u = i % 2, v = i / 2;
        s.quad("", {x, y, 0}, {x + .92, y, 0}, {x + .92, y + .92, 0}, {x, y + .92, 0}, {u, v}, {1 - u, 1 - v});
    }
    s.write("model_nm_tangent.tga", domes(1, 64));
    s.write("model_diffuse.tga", letter(rgb(150, 150, 190), rgb(200, 200, 190)));
}

// From the upper left: exponents 0, 1, 4, 16, 64 and 255. At 0 the highlight ends where the light's mirror image points
// away from the viewer, and no ball shines on the side that is turned away from the light.
SCENE(specular_exponents, "--size 144x108 --shadow off --no-fit --eye 0,0,4 --light 1,.6,.3") {
    constexpr int exponents[] = {0, 1, 4, 16, 64, 255};
    for (int i = 0; i < 6; i++) {
        const std::string name = std::to_string(exponents[i]);
        s.write(name + ".tga", checkers(1, 1, rgb(exponents[i], exponents[i], exponents[i])));
        s.materials += "newmtl e" + name + "\nKd .45 .35 .2\nmap_Ns " + name + ".tga\n";
        s.sphere("e" + name, {(i % 3 - 1) * 1.15, i < 3 ? .62 : -.62, 0}, .53, 20);
    }
}

// A map of exponents that alternates between 0 and 60. There are squares where the light shines and its mirror image is
// on the viewer's side; where it is not (0^0 is no highlight) there are none.
SCENE(specular_dithered, "--size 96x96 --shadow off --eye 0,0,4 --light 1,.6,.1") {
    s.sphere("red", {0, 0, 0}, 1, 24);
    s.write("model_spec.tga", checkers(16, 4, rgb(0, 0, 0), rgb(60, 60, 60)));
}

// ---- shadows ----

// No textures at all: geometry, light and shadow.
PICTURE(no_textures, add_yard, "--size 128x128 --shadow-size 512 --no-fit --eye 1,1.8,5 --light 1,1,.6")

// The same without shadows.
PICTURE(shadow_off, add_yard, "--size 128x128 --shadow off --no-fit --eye 1,1.8,5 --light 1,1,.6")

// The lesson's test without a bias: what faces the light shadows itself. Its samples all lie to one side of what is
// looked up there: where that side is nearer to the light a surface is dark as a whole, as the floor is.
PICTURE(bias_zero, add_yard, "--size 128x128 --shadow-size 128 --bias 0 --no-fit --eye 1,1.8,5 --light 1,1,.6")

// The same with a shadow buffer of few texels: shadows have teeth as large as they.
PICTURE(coarse_map, add_yard, "--size 128x128 --shadow-size 24 --no-fit --eye 1,1.8,5 --light 1,1,.6")

// The same without a shadow buffer: exact.
PICTURE(exact_shadow, add_yard, "--size 128x128 --shadow exact --no-fit --eye 1,1.8,5 --light 1,1,.6")

// A spot light whose beam ends on the floor, round and square; a point light between the things, one of which is behind
// it as it looks at the center.
PICTURE(spot_round, add_yard, "--size 128x128 --shadow-size 512 --no-fit --eye 1,1.8,5 --spot 2,3,1.5,14")
PICTURE(spot_square, add_yard, "--size 128x128 --shadow exact --no-fit --eye 1,1.8,5 --spot 2,3,1.5,14 --beam square")
PICTURE(point_light, add_yard, "--size 128x128 --shadow-size 512 --no-fit --eye 1,1.8,5 --point .4,.5,.7")

// The light is right above, in the direction of up: the shadow of a table is under it.
SCENE(light_along_up, "--size 128x128 --shadow-size 512 --no-fit --eye .6,1.5,4 --light 0,1,0") {
    s.quad("grey", {-1, -.6, 1}, {1, -.6, 1}, {1, -.6, -1}, {-1, -.6, -1});
    s.box("blue", {-.6, .1, -.3}, {.6, .2, .5});
    s.box("blue", {-.6, -.6, .4}, {-.5, .1, .5});
    s.box("blue", {.5, -.6, .4}, {.6, .1, .5});
}

// Two models, light from the right and behind: the red one's tower shadows the blue floor, the blue one's board both.
SCENE(two_models, "--size 128x128 --shadow-size 512 --eye .5,3,4 --light .7,1,-.3") {
    s.quad("red", {0, -.7, .9}, {1, -.7, .9}, {1, -.7, -.9}, {0, -.7, -.9});
    s.box("red", {.2, -.7, .25}, {.45, .2, .5});
    s.next_model();
    s.quad("blue", {-1, -.7, .9}, {0, -.7, .9}, {0, -.7, -.9}, {-1, -.7, -.9});
    s.box("blue", {-.2, -.7, -.75}, {-.1, .1, -.65});
    s.box("blue", {-.3, .1, -.85}, {.9, .18, -.55});
}

// What the light sees of them: near is white.
PICTURE(two_models_depth, two_models, "--size 16x16 --shadow-size 128 --eye .5,3,4 --light .7,1,-.3", "depth.tga")

// A floor far larger than the cube [-1,1]^3, and a row of posts on it: all of them throw shadows ...
SCENE(large_floor, "--size 192x64 --shadow-size 512 --no-fit --eye 0,7,10 --light .5,1,.8") {
    s.quad("white", {-4, -.5, 1.2}, {4, -.5, 1.2}, {4, -.5, -1.2}, {-4, -.5, -1.2});
    for (int i = -3; i <= 3; i++) s.box("violet", {i - .1, -.5, -.1}, {i + .1, .4, .1});
}

// ... but the lesson's light sees only the middle of the floor. What it does not see is lit.
PICTURE(outside_of_the_map, large_floor,
        "--size 192x64 --shadow-size 512 --bias 43.34 --no-fit --eye 0,7,10 --light .5,1,.8")

// A wall shadows the right half of the floor's letter, which glows all the same.
SCENE(glow_in_shadow, "--size 128x128 --shadow-size 512 --no-fit --eye .3,3,3 --light 1,1,0") {
    s.quad("grey", {-1, -.6, 1}, {1, -.6, 1}, {1, -.6, -1}, {-1, -.6, -1});
    s.write("model_glow.tga", letter(rgb(130, 70, 0), rgb(0, 0, 0)));
    s.next_model();
    s.box("blue", {.9, -.6, -.9}, {1, .3, .9});
}

// ---- that wrong pictures are noticed ----

// The idol on its floor under the sky, and every kind of light: beside it, behind it, in its midst; beams that end on
// its nose and beams that pass the picture on all sides; and one low above the floor, half of which is behind the
// light.
TEST("the whole scene under every light") {
    const Scene folder([](Scene&) {});
    const std::string obj = UMBRA_OBJ_DIR, floor = ' ' + obj + "/floor/floor.obj";
    const std::string scene = " --sky " + obj + "/sky/sky.obj " + obj + "/idol/idol.obj" + floor;
    const std::string small = "--no-fit --size 96 --shadow-size 384 ";
    const std::pair<const char*, const char*> lights[] = {
        {"light", "--light 1,1,1"},
        {"spot_5", "--spot 2,3,2.5,5"},
        {"spot_25", "--spot 2,3,2.5"},
        {"spot_80", "--spot .8,1.2,1,80"},
        {"square_5", "--spot 2,3,2.5,5 --beam square"},
        {"square_25", "--spot 2,3,2.5 --beam square"},
        {"point", "--point 1.2,1.2,1.2"},
        {"behind", "--spot -1.5,2,-2.5,30"},
        {"half_floor", "--spot .2,-.3,1.3,80"}};
    for (const auto& [name, light] : lights)
        check(folder.draw(small + light + scene), std::string("idol_") + name);
    check(folder.draw(small + "--spot 2,3,2.5 " + obj + "/idol/idol.obj " + obj +
                      "/knot/knot.obj --scale .35 --at 1,-.6,.6" + floor), "idol_and_knot");
    for (const std::string what : {"object", "camera", "light"})
        for (const std::string frame : {"0", "7", "23"}) {
            const std::string range = frame + ":" + std::to_string(std::stoi(frame) + 1) + "/36";
            const std::string number = std::string(4 - frame.size(), '0') + frame;
            check(folder.draw(small + "--spot 2,3,2.5,60 --frames " + range + " --move " + what + scene,
                              "framebuffer_" + number + ".tga"), "move_" + what + "_" + number);
        }
}

TEST("a wrong bias or camera is another picture") {
    const Scene yard(add_yard);
    const TGAImage reference = TGAImage::read_tga_file(fs::path(UMBRA_REFERENCE_DIR) / "no_textures.tga");
    const auto same = [&](const std::string& arguments) {
        const std::string always = "--no-fit --size 128x128 --shadow-size 512 --light 1,1,.6 ";
        return compare(yard.draw(always + arguments), reference).same();
    };
    CHECK(same("--eye 1,1.8,5"));
    for (const auto* wrong : {"--eye 1,1.8,5 --bias 200", "--eye 1.01,1.8,5", "--eye 1,1.81,5"}) CHECK(!same(wrong));
}

// A component of a normal in a map is off by 1/255 at most, a normal by sqrt(3)/255, and two of them differ by twice
// that at most, .0137 once they are of length one again. Their colours differ by 255 * .8 * 1.2 * .0137 = 3.4, and by 4
// once they are whole numbers.
TEST("normal maps in object and in tangent space give the same picture") {
    const Difference difference =
        compare(Scene(object_normal_map).draw(card_view), Scene(tangent_normal_map).draw(card_view));
    CHECK(difference.same_size && difference.largest <= 4);
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
