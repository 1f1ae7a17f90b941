// scenes_test.cpp: many small pictures, each of one feature, and the default render; every one must be its reference in
// tests/reference. Geometry and command line stand together: `scenes_test NAME` runs one scene, and the target
// update_references makes all references anew. It knows nothing of what is right but that a person looked at them.
#include "check.h"
#include "compare.h"
#include "files.h"
#include "geometry.h"
#include "tgaimage.h"

#include <array>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace fs = std::filesystem;

namespace {

constexpr const char* palette = "newmtl white\nKd .8 .8 .8\n"
                                "newmtl grey\nKd .45 .45 .45\n"
                                "newmtl red\nKd .8 .2 .15\n"
                                "newmtl dark_red\nKd .45 .1 .08\n"
                                "newmtl green\nKd .2 .7 .25\n"
                                "newmtl blue\nKd .15 .35 .8\n"
                                "newmtl dark_blue\nKd .08 .18 .45\n"
                                "newmtl yellow\nKd .8 .7 .15\n"
                                "newmtl violet\nKd .6 .25 .7\n"
                                "newmtl cyan\nKd .15 .7 .7\n";

// A scene's files, and the program run among them.
struct Folder : TemporaryFolder {
    Folder() : TemporaryFolder("scenes_test") { write("palette.mtl", palette); }

    void write(const std::string& name, const std::string& text) const {
        write_bytes(path() / name, Bytes(text.begin(), text.end()));
    }
    void write(const std::string& name, const TGAImage& picture) const { picture.write_tga_file(path() / name); }

    // Runs the program with these arguments here, and returns the picture that it wrote.
    TGAImage run(const std::string& arguments, const std::string& picture) const {
        const std::string q = "\"";
        const std::string folder = q + path().string() + q, program = q + UMBRA_BINARY + q;
        const std::string go = "cd " + folder + " && " + program + " --quiet " + arguments;
        if (std::system((go + " >output.txt 2>&1").c_str()) != 0) {
            const Bytes output = read_bytes(path() / "output.txt");
            throw std::runtime_error("umbra " + arguments + ": " + std::string(output.begin(), output.end()));
        }
        return TGAImage::read_tga_file(path() / picture);
    }
    TGAImage frame(const std::string& arguments) const { return run(arguments, "framebuffer.tga"); }
    TGAImage depth(const std::string& arguments) const { return run(arguments, "depth.tga"); }
};

// A scene is a test that makes a picture, and the picture must be the reference of the same name.
#define SCENE(name)                                                                  \
    static TGAImage name(const Folder& folder);                                      \
    static const Registration registration_##name(#name, [] {                       \
        const Folder folder;                                                         \
        CHECK(check_reference(name(folder), #name));                                 \
    });                                                                              \
    static TGAImage name(const Folder& folder)

// Writes an .obj, piece by piece. Only + - * / and square roots make its coordinates: they are the same everywhere.
class Obj {
public:
    Obj() {
        text_.precision(12);
        text_ << "mtllib palette.mtl\n";
    }
    // What is added from now on is moved and made larger: p becomes p * size + to.
    void place(const vec3& to, double size) { to_ = to, size_ = size; }
    void use(const std::string& material) { text_ << "usemtl " << material << '\n'; }

    int vertex(const vec3& p) {
        const vec3 q = p * size_ + to_;
        text_ << "v " << q.x << ' ' << q.y << ' ' << q.z << '\n';
        return ++vertices_;
    }
    int uv(const vec2& t) {
        text_ << "vt " << t.x << ' ' << t.y << '\n';
        return ++uvs_;
    }
    int normal(const vec3& n) {
        text_ << "vn " << n.x << ' ' << n.y << ' ' << n.z << '\n';
        return ++normals_;
    }

    // A polygon with vertices of its own, hence with its own normal; counter-clockwise where its front is seen.
    void polygon(const std::vector<vec3>& corners) {
        std::string f = "f";
        for (const vec3& p : corners) f.append(" ").append(std::to_string(vertex(p)));
        text_ << f << '\n';
    }
    // A quadrangle whose texture coordinates run from LOW at its first corner to HIGH at its third, the opposite one.
    void quad(const vec3& a, const vec3& b, const vec3& c, const vec3& d, const vec2& low = {0, 0},
              const vec2& high = {1, 1}) {
        const vec3 corners[] = {a, b, c, d};
        const vec2 uvs[] = {low, {high.x, low.y}, high, {low.x, high.y}};
        std::string f = "f";
        for (int i = 0; i < 4; i++) {
            const int v = vertex(corners[i]), t = uv(uvs[i]);
            f.append(" ").append(std::to_string(v)).append("/").append(std::to_string(t));
        }
        text_ << f << '\n';
    }
    // The same with a normal for each corner.
    void quad(const std::array<vec3, 4>& corners, const std::array<vec3, 4>& normals) {
        std::string f = "f";
        for (std::size_t i = 0; i < 4; i++) {
            const int v = vertex(corners[i]), n = normal(normals[i]);
            f.append(" ").append(std::to_string(v)).append("//").append(std::to_string(n));
        }
        text_ << f << '\n';
    }
    // Six quads, seen from outside, or from inside where LOW and HIGH are exchanged.
    void box(const vec3& low, const vec3& high) {
        const auto at = [&](int x, int y, int z) {
            return vec3{x ? high.x : low.x, y ? high.y : low.y, z ? high.z : low.z};
        };
        quad(at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1));
        quad(at(1, 0, 0), at(0, 0, 0), at(0, 1, 0), at(1, 1, 0));
        quad(at(1, 0, 1), at(1, 0, 0), at(1, 1, 0), at(1, 1, 1));
        quad(at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0));
        quad(at(0, 1, 1), at(1, 1, 1), at(1, 1, 0), at(0, 1, 0));
        quad(at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1));
    }
    // An octahedron whose faces are cut into n*n triangles and blown up; vertices are shared, and no normals are given.
    // Texture coordinates are those of a projection along z.
    void sphere(const vec3& center, double radius, int n) {
        std::map<std::array<int, 3>, int> known;
        const auto corner = [&](int x, int y, int z) {
            int& index = known[{x, y, z}];
            if (index == 0) {
                const vec3 p = normalized(vec3{double(x), double(y), double(z)});
                index = vertex(center + p * radius);
                uv_of_[index] = uv({p.x / 2 + .5, p.y / 2 + .5});
            }
            return std::to_string(index) + "/" + std::to_string(uv_of_[index]);
        };
        for (int octant = 0; octant < 8; octant++) {
            const int sx = octant & 1 ? -1 : 1, sy = octant & 2 ? -1 : 1, sz = octant & 4 ? -1 : 1;
            const auto at = [&](int i, int j) { return corner(sx * i, sy * j, sz * (n - i - j)); };
            const auto face = [&](const std::string& a, const std::string& b, const std::string& c) {
                const bool turned = sx * sy * sz < 0;  // a mirrored octant winds the other way round
                text_ << "f " << a << ' ' << (turned ? c : b) << ' ' << (turned ? b : c) << '\n';
            };
            for (int i = 0; i < n; i++)
                for (int j = 0; i + j < n; j++) {
                    face(at(i, j), at(i + 1, j), at(i, j + 1));
                    if (i + j + 2 <= n) face(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                }
        }
    }

    std::string text() const { return text_.str(); }

private:
    std::ostringstream text_;
    int vertices_ = 0, uvs_ = 0, normals_ = 0;
    vec3 to_;
    double size_ = 1;
    std::map<int, int> uv_of_;  // of a sphere's vertices
};

TGAColor rgb(int r, int g, int b) {
    return {{static_cast<std::uint8_t>(b), static_cast<std::uint8_t>(g), static_cast<std::uint8_t>(r), 255}};
}

// n x n squares of so many pixels each, the bottom-left one dark.
TGAImage checkers(int n, int pixels, const TGAColor& dark = rgb(60, 70, 90),
                  const TGAColor& light = rgb(200, 200, 190)) {
    TGAImage picture(n * pixels, n * pixels, TGAImage::RGB);
    for (int y = 0; y < n * pixels; y++)
        for (int x = 0; x < n * pixels; x++) picture.set(x, y, (x / pixels + y / pixels) % 2 ? light : dark);
    return picture;
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
    TGAImage picture(8, 8, TGAImage::RGB);
    for (int y = 0; y < 8; y++)
        for (int x = 0; x < 8; x++) {
            const char c = rows[7 - y][x];
            picture.set(x, y, c == 'F' ? ink : c == 'r' ? rgb(200, 30, 30) : c == 'g' ? rgb(30, 160, 30)
                            : c == 'b' ? rgb(30, 60, 200) : c == 'y' ? rgb(200, 190, 30) : paper);
        }
    return picture;
}

// A normal map of n x n domes, of so many texels each. I, J and K are where the texture's u, its v and its front point:
// those of the face for a map in object space, the axes themselves for one in tangent space.
TGAImage domes(int n, int texels, const vec3& i = {1, 0, 0}, const vec3& j = {0, 1, 0}, const vec3& k = {0, 0, 1}) {
    TGAImage map(n * texels, n * texels, TGAImage::RGB);
    const auto encoded = [](double c) { return static_cast<int>((c + 1) * 127.5 + .5); };
    for (int y = 0; y < n * texels; y++)
        for (int x = 0; x < n * texels; x++) {
            // -1 to 1 over the cell; the dome's rim is at .8, where its slope is 60 degrees
            const double a = (2 * (x % texels) + 1. - texels) / texels, b = (2 * (y % texels) + 1. - texels) / texels;
            const double r = std::sqrt(a * a + b * b) / .8, lean = .87 / .8;
            const vec3 t = r < 1 ? vec3{a * lean, b * lean, std::sqrt(1 - .87 * .87 * r * r)} : vec3{0, 0, 1};
            const vec3 normal = i * t.x + j * t.y + k * t.z;
            map.set(x, y, rgb(encoded(normal.x), encoded(normal.y), encoded(normal.z)));
        }
    return map;
}

TGAImage grey(int value) {
    TGAImage picture(1, 1, TGAImage::GRAYSCALE);
    picture.set(0, 0, {{static_cast<std::uint8_t>(value)}});
    return picture;
}

// What most scenes about shadows show: a floor, a ball, a block, and a board that stands on edge. It fits in [-1,1]^3.
void add_yard(Obj& obj) {
    obj.use("white");
    obj.box({-1, -.6, -1}, {1, -.5, 1});
    obj.use("red");
    obj.sphere({-.4, -.1, .35}, .4, 12);
    obj.use("blue");
    obj.box({.15, -.5, -.65}, {.6, .6, -.35});
    obj.use("yellow");
    obj.box({.45, -.5, .2}, {.52, .05, .8});
}

std::string yard() {
    Obj obj;
    add_yard(obj);
    return obj.text();
}

}  // namespace

// ---- which pixels ----

// Every edge and every diagonal runs through pixel centres: 36 pixels are one unit, and a square is 8 pixels. Each
// centre belongs to one square, so all are 8 x 8. The red ones are drawn first: were edges everybody's, they would be
// larger than the blue ones; were they nobody's, there would be black lines.
SCENE(edge_rule) {
    Obj obj;
    for (const int colour : {0, 1})
        for (int half : {0, 1})
            for (int y = 0; y < 9; y++)
                for (int x = 0; x < 9; x++) {
                    if ((x + y) % 2 != colour) continue;
                    const auto at = [&](int i, int j) {
                        return vec3{(8 * (x + i) - 35.5) / 36, (8 * (y + j) - 35.5) / 36, 0};
                    };
                    obj.use(colour == 0 ? (half == 0 ? "red" : "dark_red") : (half == 0 ? "blue" : "dark_blue"));
                    if (half == 0) obj.polygon({at(0, 0), at(1, 0), at(1, 1)});
                    else obj.polygon({at(0, 0), at(1, 1), at(0, 1)});
                }
    folder.write("grid.obj", obj.text());
    return folder.frame("--size 96x96 --shadow off --no-fit --eye 0,0,4 --light 0,0,1 grid.obj");
}

// One quad from far in front of the eye to far behind it, just below the eye: the lowest pixels show what is a tenth of
// the way to the centre.
SCENE(near_plane) {
    Obj obj;
    obj.quad({-8, -.5, 10}, {8, -.5, 10}, {8, -.5, -10}, {-8, -.5, -10}, {0, 0}, {32, 40});
    folder.write("floor.obj", obj.text());
    folder.write("floor_diffuse.tga", checkers(2, 4));
    return folder.frame("--size 128x96 --shadow off --no-fit --eye .3,-.36,2 --center 0,-.5,0 "
                        "--light .3,1,.5 floor.obj");
}

// Six triangles a million pixels large meet in the middle. In front of them is a small hexagon in lighter and darker
// colours, cut the same way: every line goes on straight through its rim.
SCENE(guard_band) {
    Obj obj;
    const vec2 corners[] = {{1, .13}, {.41, .91}, {-.57, .83}, {-1, -.21}, {-.33, -.94}, {.62, -.79}};
    const auto fan = [&](double size, double z, const std::array<const char*, 6>& colours) {
        for (std::size_t i = 0; i < 6; i++) {
            obj.use(colours[i]);
            const vec2 a = corners[i] * size, b = corners[(i + 1) % 6] * size;
            obj.polygon({{0, 0, z}, {a.x, a.y, z}, {b.x, b.y, z}});
        }
    };
    fan(30000, 0, {"red", "dark_red", "blue", "dark_blue", "white", "grey"});
    fan(.7, 1e-3, {"dark_red", "red", "dark_blue", "blue", "grey", "white"});
    folder.write("fan.obj", obj.text());
    return folder.frame("--size 96x96 --shadow off --no-fit --eye 0,0,4 --light 0,0,1 fan.obj");
}

// 80 000 triangles, most of which hit no pixel's centre: no holes.
SCENE(subpixel_triangles) {
    Obj obj;
    obj.use("green");
    obj.sphere({0, 0, 0}, 1, 100);
    folder.write("ball.obj", obj.text());
    return folder.frame("--size 64x64 --shadow off ball.obj");
}

// Three bars, each in front of the next one and behind the one before, and a triangle that all three run through.
SCENE(depth_test) {
    Obj obj;
    const auto bar = [&](const char* colour, const vec3& from, const vec3& to) {
        obj.use(colour);
        const vec3 across = normalized(cross(to - from, vec3{0, 0, 1})) * .14;
        obj.polygon({from - across, from + across, to + across, to - across});
    };
    bar("red", {-.9, -.5, -.5}, {.9, -.5, .5});
    bar("green", {.7, -.9, -.5}, {-.15, .9, .5});
    bar("blue", {.15, .9, -.5}, {-.7, -.9, .5});
    obj.use("yellow");
    obj.polygon({{-.55, .25, .2}, {0, -.8, -.2}, {.55, .2, .1}});
    folder.write("bars.obj", obj.text());
    return folder.frame("--size 96x96 --shadow off --eye 0,0,4 --light 0,0,1 bars.obj");
}

// A box without a lid, seen into: the near walls show their fronts, the far ones and the bottom their backs. Its
// normals all point to the light, so that fronts and backs are equally bright.
SCENE(back_faces) {
    Obj obj;
    const vec3 l{.3, 1, .5};
    const auto wall = [&](const char* colour, const std::array<vec3, 4>& corners) {
        obj.use(colour);
        obj.quad(corners, {l, l, l, l});
    };
    wall("red", {{{-.8, -.5, .8}, {.8, -.5, .8}, {.8, .3, .8}, {-.8, .3, .8}}});
    wall("cyan", {{{.8, -.5, -.8}, {-.8, -.5, -.8}, {-.8, .3, -.8}, {.8, .3, -.8}}});
    wall("blue", {{{.8, -.5, .8}, {.8, -.5, -.8}, {.8, .3, -.8}, {.8, .3, .8}}});
    wall("yellow", {{{-.8, -.5, -.8}, {-.8, -.5, .8}, {-.8, .3, .8}, {-.8, .3, -.8}}});
    wall("grey", {{{-.8, -.5, -.8}, {.8, -.5, -.8}, {.8, -.5, .8}, {-.8, -.5, .8}}});
    folder.write("box.obj", obj.text());
    return folder.frame("--size 96x96 --shadow off --eye 1.5,3,3 --light .3,1,.5 box.obj");
}

// The eye is in a room: walls run past it on all sides.
SCENE(eye_inside) {
    Obj obj;
    obj.use("white");
    obj.box({1, 1, 1}, {-1, -1, -1});
    obj.use("red");
    obj.box({-.6, -1, -.8}, {-.2, -.3, -.4});
    folder.write("room.obj", obj.text());
    folder.write("room_diffuse.tga", checkers(6, 4));
    return folder.frame("--size 128x96 --shadow off --eye .5,0,.7 --center -.1,-.2,-.5 --light .5,1,.8 room.obj");
}

// Polygons for which a fan from the first corner would be wrong: a star, an arrow and a spiral, a face each.
SCENE(concave_polygons) {
    Obj obj;
    obj.use("yellow");
    std::vector<vec3> star;
    constexpr double x[] = {0, .5878, .9511}, y[] = {1, .8090, .3090};  // sine and cosine of 0, 36 and 72 degrees
    const vec2 turns[] = {{x[0], y[0]}, {-x[1], y[1]}, {-x[2], y[2]}, {-x[2], -y[2]}, {-x[1], -y[1]},
                          {x[0], -y[0]}, {x[1], -y[1]}, {x[2], -y[2]}, {x[2], y[2]}, {x[1], y[1]}};
    for (int i = 0; i < 10; i++)
        star.push_back(vec3{turns[i].x, turns[i].y, 0} * (i % 2 ? .18 : .45) + vec3{-.5, .5, 0});
    obj.polygon(star);
    obj.use("red");
    obj.polygon({{.05, .1, 0}, {.5, .4, 0}, {.95, .1, 0}, {.5, .95, 0}});
    obj.use("cyan");
    obj.polygon({{-.9, -.95, 0}, {.9, -.95, 0}, {.9, -.1, 0}, {-.6, -.1, 0}, {-.6, -.65, 0}, {.5, -.65, 0},
                 {.5, -.4, 0}, {-.3, -.4, 0}, {-.3, -.3, 0}, {.65, -.3, 0}, {.65, -.8, 0}, {-.75, -.8, 0},
                 {-.75, 0, 0}, {-.9, 0, 0}});
    folder.write("polygons.obj", obj.text());
    return folder.frame("--size 96x96 --shadow off --eye 0,0,4 --light 0,0,1 polygons.obj");
}

// ---- where the viewer is ----

// Five balls in a row, three in a column: a wide picture shows the row and a tall one the column, and balls are round.
static void add_cross(const Folder& folder) {
    Obj obj;
    for (const int i : {-2, -1, 0, 1, 2}) {
        obj.use(i == 0 ? "white" : "red");
        obj.sphere({1.6 * i, 0, 0}, .7, 10);
        obj.use("blue");
        if (i != 0) obj.sphere({0, 1.6 * i, 0}, .7, 10);
    }
    folder.write("cross.obj", obj.text());
}
SCENE(wide) {
    add_cross(folder);
    return folder.frame("--size 192x48 --shadow off --no-fit --eye 0,0,12 --light 1,1,1 cross.obj");
}
SCENE(tall) {
    add_cross(folder);
    return folder.frame("--size 48x192 --shadow off --no-fit --eye 0,0,12 --light 1,1,1 cross.obj");
}

// The yard from behind: the block is on the left now.
SCENE(from_behind) {
    folder.write("yard.obj", yard());
    return folder.frame("--size 128x128 --shadow off --eye -1,1,-4 --light .5,1,-.6 yard.obj");
}

// Not the origin but the card is looked at, and up is to the upper right: the card is in the middle and leans to the
// left.
SCENE(center_and_up) {
    Obj obj;
    const vec3 at{2, 1, -3};
    obj.quad(at + vec3{-.8, -.8, 0}, at + vec3{.8, -.8, 0}, at + vec3{.8, .8, 0}, at + vec3{-.8, .8, 0});
    folder.write("card.obj", obj.text());
    folder.write("card_diffuse.tga", letter());
    return folder.frame("--size 96x96 --shadow off --no-fit --eye 2,1,1 --center 2,1,-3 --up 1,2,0 --light 0,0,1 "
                        "card.obj");
}

// The yard, 40 times as large and far away from the origin: it is fitted, and looks like no_textures.
SCENE(fitted) {
    Obj obj;
    obj.place({1000, -2000, 1500}, 40);
    add_yard(obj);
    folder.write("yard.obj", obj.text());
    return folder.frame("--size 128x128 --shadow-size 512 --eye 1,1.8,5 --light 1,1,.6 yard.obj");
}

// ---- textures ----

// The F is upright and not mirrored; red is at the bottom left, green at the bottom right.
SCENE(texture_orientation) {
    Obj obj;
    obj.quad({-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0});
    folder.write("card.obj", obj.text());
    folder.write("card_diffuse.tga", letter());
    return folder.frame("--size 96x96 --shadow off --eye .8,.5,4 --light 0,0,1 card.obj");
}

// Texture coordinates from -1 to 3: 4 x 4 copies, all upright.
SCENE(uv_wrap) {
    Obj obj;
    obj.quad({-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {-1, -1}, {3, 3});
    folder.write("card.obj", obj.text());
    folder.write("card_diffuse.tga", letter());
    return folder.frame("--size 128x128 --shadow off --eye 0,0,4 --light 0,0,1 card.obj");
}

// A wall of two triangles, near on the left and far on the right. Its rows of squares run straight to one point; did
// the texture ignore the perspective, they would bend at the diagonal.
SCENE(perspective_uv) {
    Obj obj;
    obj.quad({-.9, -1, 2}, {1.2, -1, -5}, {1.2, 1, -5}, {-.9, 1, 2}, {0, 0}, {4, 1});
    folder.write("wall.obj", obj.text());
    folder.write("wall_diffuse.tga", checkers(8, 4));
    return folder.frame("--size 128x128 --shadow off --no-fit --eye 0,0,4 --light 1,.3,1 wall.obj");
}

// From the bottom left: Kd alone, a texture alone, Kd times a texture, and a texture with a glow.
SCENE(materials) {
    folder.write("own.mtl", "newmtl plain\nKd .8 .3 .1\n"
                            "newmtl textured\nmap_Kd letter.tga\n"
                            "newmtl tinted\nKd .3 .8 .3\nmap_Kd letter.tga\n"
                            "newmtl glowing\nKd .3 .3 .3\nmap_Kd letter.tga\nmap_Ke glow.tga\n");
    folder.write("letter.tga", letter());
    folder.write("glow.tga", checkers(4, 4, rgb(0, 0, 0), rgb(130, 60, 0)));
    Obj obj;
    const char* const names[] = {"plain", "textured", "tinted", "glowing"};
    for (int i = 0; i < 4; i++) {
        const double x = i % 2 - .95, y = i / 2 - .95;
        obj.use(names[i]);
        obj.quad({x, y, 0}, {x + .9, y, 0}, {x + .9, y + .9, 0}, {x, y + .9, 0});
    }
    folder.write("quads.obj", "mtllib own.mtl\n" + obj.text());
    return folder.frame("--size 96x96 --shadow off --eye 0,0,4 --light 0,0,1 quads.obj");
}

// ---- normals ----

// A coarse ball without normals: its outline has corners, its shading has none.
SCENE(smooth_normals) {
    Obj obj;
    obj.use("grey");
    obj.sphere({0, 0, 0}, 1, 3);
    folder.write("ball.obj", obj.text());
    return folder.frame("--size 96x96 --shadow off --light 1,1,1 ball.obj");
}

// A flat square whose normals lean outwards: it looks like a cushion.
SCENE(given_normals) {
    Obj obj;
    obj.use("grey");
    obj.quad({{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}},
             {{{-1, -1, .7}, {1, -1, .7}, {1, 1, .7}, {-1, 1, .7}}});
    folder.write("cushion.obj", obj.text());
    return folder.frame("--size 96x96 --shadow off --eye 0,0,4 --light 1,1,1 cushion.obj");
}

// Where a tilted card's texture and its front point.
static constexpr vec3 card_u{.8, 0, -.6}, card_v{0, 1, 0}, card_front{.6, 0, .8};
static std::string tilted_card() {
    Obj obj;
    obj.use("white");
    obj.quad((-card_u - card_v), (card_u - card_v), (card_u + card_v), (-card_u + card_v));
    return obj.text();
}

// Domes on a tilted card, lit from the upper left: bright there, dark at the lower right.
SCENE(object_normal_map) {
    folder.write("card.obj", tilted_card());
    folder.write("card_nm.tga", domes(3, 32, card_u, card_v, card_front));
    return folder.frame("--size 96x96 --shadow off --eye 0,0,4 --light -1,1,1 card.obj");
}

// The same domes in tangent space: up to the rounding of the map it is the same picture.
SCENE(tangent_normal_map) {
    folder.write("card.obj", tilted_card());
    folder.write("card_nm_tangent.tga", domes(3, 32));
    return folder.frame("--size 96x96 --shadow off --eye 0,0,4 --light -1,1,1 card.obj");
}

// Where a model has both maps, --tangent takes the other one: here it is flat.
SCENE(tangent_option) {
    folder.write("card.obj", tilted_card());
    folder.write("card_nm.tga", domes(3, 32, card_u, card_v, card_front));
    folder.write("card_nm_tangent.tga", domes(1, 32));
    return folder.frame("--tangent --size 96x96 --shadow off --eye 0,0,4 --light -1,1,1 card.obj");
}

// One map four times: as it is, mirrored in u, in v, and in both. A dome stays a dome: bright at the upper left.
SCENE(mirrored_uv) {
    Obj obj;
    for (int i = 0; i < 4; i++) {
        const double x = i % 2 - .96, y = i / 2 - .96, u = i % 2, v = i / 2;
        obj.quad({x, y, 0}, {x + .92, y, 0}, {x + .92, y + .92, 0}, {x, y + .92, 0}, {u, v}, {1 - u, 1 - v});
    }
    folder.write("quads.obj", obj.text());
    folder.write("quads_nm_tangent.tga", domes(1, 64));
    folder.write("quads_diffuse.tga", letter(rgb(150, 150, 190), rgb(200, 200, 190)));
    return folder.frame("--size 96x96 --shadow off --eye 0,0,4 --light -1,1,1 quads.obj");
}

// From the upper left: exponents 0, 1, 4, 16, 64 and 255. At 0 the highlight ends where the light's mirror image points
// away from the viewer, and no ball shines on the side that is turned away from the light.
SCENE(specular_exponents) {
    Obj obj;
    std::string materials;
    constexpr int exponents[] = {0, 1, 4, 16, 64, 255};
    for (int i = 0; i < 6; i++) {
        const std::string name = std::to_string(exponents[i]);
        folder.write(name + ".tga", grey(exponents[i]));
        materials += "newmtl e" + name + "\nKd .45 .35 .2\nmap_Ks " + name + ".tga\n";
        obj.use("e" + name);
        obj.sphere({(i % 3 - 1) * 1.15, i < 3 ? .62 : -.62, 0}, .53, 20);
    }
    folder.write("exponents.mtl", materials);
    folder.write("balls.obj", "mtllib exponents.mtl\n" + obj.text());
    return folder.frame("--size 144x108 --shadow off --no-fit --eye 0,0,4 --light 1,.6,.3 balls.obj");
}

// A map of exponents that alternates between 0 and 60. There are squares where the light shines and its mirror image is
// on the viewer's side; where it is not (0^0 is no highlight) there are none.
SCENE(specular_dithered) {
    Obj obj;
    obj.use("red");
    obj.sphere({0, 0, 0}, 1, 24);
    folder.write("ball.obj", obj.text());
    folder.write("ball_spec.tga", checkers(16, 4, rgb(0, 0, 0), rgb(60, 60, 60)));
    return folder.frame("--size 96x96 --shadow off --eye 0,0,4 --light 1,.6,.1 ball.obj");
}

// ---- shadows ----

// No textures at all: geometry, light and shadow.
SCENE(no_textures) {
    folder.write("yard.obj", yard());
    return folder.frame("--size 128x128 --shadow-size 512 --eye 1,1.8,5 --light 1,1,.6 yard.obj");
}

// The same without shadows.
SCENE(shadow_off) {
    folder.write("yard.obj", yard());
    return folder.frame("--size 128x128 --shadow off --eye 1,1.8,5 --light 1,1,.6 yard.obj");
}

// The lesson's test without a bias: what faces the light shadows itself. Its samples all lie to one side of what is
// looked up there: where that side is nearer to the light a surface is dark as a whole, as the floor is.
SCENE(bias_zero) {
    folder.write("yard.obj", yard());
    return folder.frame("--size 128x128 --shadow-size 128 --bias 0 --eye 1,1.8,5 --light 1,1,.6 yard.obj");
}

// The same with a shadow buffer of few texels: shadows have teeth as large as they.
SCENE(coarse_map) {
    folder.write("yard.obj", yard());
    return folder.frame("--size 128x128 --shadow-size 24 --eye 1,1.8,5 --light 1,1,.6 yard.obj");
}

// The same without a shadow buffer: exact.
SCENE(exact_shadow) {
    folder.write("yard.obj", yard());
    return folder.frame("--size 128x128 --shadow exact --eye 1,1.8,5 --light 1,1,.6 yard.obj");
}

// Four fences, each twice as high as the one before it. Each throws a shadow twice as long as it is high ...
static void add_fences(const Folder& folder) {
    Obj obj;
    obj.use("white");
    obj.quad({-1, 0, .8}, {1, 0, .8}, {1, 0, -.8}, {-1, 0, -.8});
    constexpr double x[] = {-.85, -.55, -.1, .75}, height[] = {.015, .03, .06, .12};
    obj.use("green");
    for (int i = 0; i < 4; i++) obj.box({x[i], 0, -.7}, {x[i] + .015, height[i], .7});
    folder.write("fences.obj", obj.text());
}
SCENE(fences) {
    add_fences(folder);
    return folder.frame("--size 480x320 --shadow-size 1024 --eye -.3,1.6,1.6 --light 2,1,0 fences.obj");
}

// ... but with the lesson's constant as the bias the lowest one does not, and the others not at their foot.
SCENE(fences_lesson_bias) {
    add_fences(folder);
    return folder.frame("--size 480x320 --shadow-size 1024 --bias 43.34 --eye -.3,1.6,1.6 --light 2,1,0 fences.obj");
}

// The light is right above, in the direction of up: the shadow of a table is under it.
SCENE(light_along_up) {
    Obj obj;
    obj.use("grey");
    obj.quad({-1, -.6, 1}, {1, -.6, 1}, {1, -.6, -1}, {-1, -.6, -1});
    obj.use("blue");
    obj.box({-.6, .1, -.3}, {.6, .2, .5});
    obj.box({-.6, -.6, .4}, {-.5, .1, .5});
    obj.box({.5, -.6, .4}, {.6, .1, .5});
    folder.write("table.obj", obj.text());
    return folder.frame("--size 128x128 --shadow-size 512 --eye .6,1.5,4 --light 0,1,0 table.obj");
}

// Two models, light from the right and behind: the red one's tower shadows the blue floor, the blue one's board both.
static void add_two_models(const Folder& folder) {
    Obj red, blue;
    red.use("red");
    red.quad({0, -.7, .9}, {1, -.7, .9}, {1, -.7, -.9}, {0, -.7, -.9});
    red.box({.2, -.7, .25}, {.45, .2, .5});
    folder.write("red.obj", red.text());
    blue.use("blue");
    blue.quad({-1, -.7, .9}, {0, -.7, .9}, {0, -.7, -.9}, {-1, -.7, -.9});
    blue.box({-.2, -.7, -.75}, {-.1, .1, -.65});
    blue.box({-.3, .1, -.85}, {.9, .18, -.55});
    folder.write("blue.obj", blue.text());
}
SCENE(two_models) {
    add_two_models(folder);
    return folder.frame("--size 128x128 --shadow-size 512 --eye .5,3,4 --light .7,1,-.3 red.obj blue.obj");
}

// What the light sees of them: near is white.
SCENE(two_models_depth) {
    add_two_models(folder);
    return folder.depth("--size 16x16 --shadow-size 128 --eye .5,3,4 --light .7,1,-.3 red.obj blue.obj");
}

// A floor far larger than the cube [-1,1]^3, and a row of posts on it: all of them throw shadows ...
static void add_posts(const Folder& folder) {
    Obj obj;
    obj.use("white");
    obj.quad({-4, -.5, 1.2}, {4, -.5, 1.2}, {4, -.5, -1.2}, {-4, -.5, -1.2});
    obj.use("violet");
    for (int i = -3; i <= 3; i++) obj.box({i - .1, -.5, -.1}, {i + .1, .4, .1});
    folder.write("posts.obj", obj.text());
}
SCENE(large_floor) {
    add_posts(folder);
    return folder.frame("--size 192x64 --shadow-size 512 --no-fit --eye 0,7,10 --light .5,1,.8 posts.obj");
}

// ... but the lesson's light sees only the middle of the floor. What it does not see is lit.
SCENE(outside_of_the_map) {
    add_posts(folder);
    return folder.frame("--size 192x64 --shadow-size 512 --bias 43.34 --no-fit --eye 0,7,10 --light .5,1,.8 posts.obj");
}

// A wall shadows the right half of the floor's letter, which glows all the same.
SCENE(glow_in_shadow) {
    Obj floor, wall;
    floor.use("grey");
    floor.quad({-1, -.6, 1}, {1, -.6, 1}, {1, -.6, -1}, {-1, -.6, -1});
    folder.write("floor.obj", floor.text());
    folder.write("floor_glow.tga", letter(rgb(130, 70, 0), rgb(0, 0, 0)));
    wall.use("blue");
    wall.box({.9, -.6, -.9}, {1, .3, .9});
    folder.write("wall.obj", wall.text());
    return folder.frame("--size 128x128 --shadow-size 512 --eye .3,3,3 --light 1,1,0 floor.obj wall.obj");
}

// ---- that wrong pictures are noticed ----

TEST("a wrong bias or camera is no tolerable difference") {
    const Folder folder;
    folder.write("yard.obj", yard());
    const TGAImage reference = read_picture(fs::path(UMBRA_REFERENCE_DIR) / "no_textures.png");
    const auto tolerable = [&](const std::string& bias, const std::string& eye) {
        const std::string scene = "--size 128x128 --shadow-size 512 --light 1,1,.6 yard.obj ";
        return compare(folder.frame(scene + bias + "--eye " + eye), reference).tolerable();
    };
    CHECK(tolerable("", "1,1.8,5"));
    CHECK(!tolerable("--bias 200 ", "1,1.8,5"));
    CHECK(!tolerable("", "1.01,1.8,5"));
    CHECK(!tolerable("", "1,1.81,5"));
}

// A component of a normal in a map is off by 1/255 at most, a normal by sqrt(3)/255, and two of them differ by twice
// that at most, .0137 once they are of length one again. Their colours differ by 255 * .8 * 1.2 * .0137 = 3.4, and by 4
// once they are whole numbers.
TEST("normal maps in object and in tangent space give the same picture") {
    const TGAImage object = object_normal_map(Folder()), tangent = tangent_normal_map(Folder());
    const Difference difference = compare(object, tangent);
    CHECK(difference.same_size);
    CHECK(difference.largest <= 4);
}

// ---- the default render ----

// The idol at 800 x 800, and what the light sees of it: also the README's pictures.
TEST("default render") {
    const Folder folder;
    CHECK(check_reference(folder.frame(""), "framebuffer"));
    CHECK(check_reference(TGAImage::read_tga_file(folder / "depth.tga"), "depth"));
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
