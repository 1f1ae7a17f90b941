// cli_test.cpp: the program as its user meets it: options, statuses, error lines, and what happens to earlier pictures.
#include "run.h"
#include "scenes.h"

#include <functional>
#include <map>
#include <regex>
#include <set>

namespace {

const std::string small = "--size 40x40 --shadow-size 30 --light 1,1,1 ",
                  triangle = "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n";

// Options with the names of their values, as "-o, --output DIR". They stand at the head of lines, after two blanks and
// before two, or in a table's first column; several in a line have commas between them.
std::set<std::string> options_in(const std::string& text) {
    static const std::regex option("(?:\n  |\n\\| `|`, `)(-[^ `\n]+(?: [^ `\n]+)*)");
    return {std::sregex_token_iterator(text.begin(), text.end(), option, 1), {}};
}

}  // namespace

TEST("the default model draws two pictures from any working directory") {
    const Folder f;
    const Outcome o = f.run("--size 200x160 --shadow-size 100");
    CHECK_EQ(o.status, 0);
    CHECK_EQ(o.err, std::string());
    CHECK_EQ(f.files(), 2);
    const TGAImage frame = TGAImage::read_tga_file(f / "framebuffer.tga");
    const TGAImage depth = TGAImage::read_tga_file(f / "depth.tga");
    CHECK(frame.width() == 200 && frame.height() == 160 && frame.bytespp() == 3);
    CHECK(depth.width() == 100 && depth.height() == 100 && depth.bytespp() == 1);
    CHECK_EQ(lines(o.out), 2);
    CHECK_EQ(o.out.substr(0, o.out.find('\n')), "wrote ./framebuffer.tga and ./depth.tga");
    for (const std::string name : {"triangles", "pixels", "fragments", "load_ms", "depth_ms", "shade_ms", "write_ms"})
        CHECK(value(o.out, name) >= 0);
    CHECK(o.out.find(" left_out ") != std::string::npos);
}

TEST("version, and help: it lists the options that README.md has in its table") {
    const Folder f;
    const Outcome help = f.run("--help"), version = f.run("--version");
    CHECK(help.status == 0 && help.err.empty() && version.status == 0 && version.err.empty());
    CHECK(version.out.rfind("umbra ", 0) == 0);
    std::string table = f.read(UMBRA_README);  // a whole path, so not within the folder
    table.erase(0, table.find("\n## Options\n") + 1);
    table.erase(table.find("\n## "));
    const std::set<std::string> listed = options_in(help.out), in_table = options_in(table);
    CHECK(listed.count("--size WxH") == 1 && listed.count("-h, --help") == 1 && listed.size() > 10);
    Strings in_one_of_them;
    std::set_symmetric_difference(listed.begin(), listed.end(), in_table.begin(), in_table.end(),
                                  std::back_inserter(in_one_of_them));
    for (const std::string& option : in_one_of_them) CHECK_EQ("in one of the two", option);
}

TEST("a wrong command line ends with status 2 and one line") {
    const Folder f;
    const auto check = [&](const std::string& text, const Strings& wrong) {
        for (const std::string& arguments : wrong) check_refused(f, arguments, 2, text);
    };
    const Strings no_vectors{"1,2", "1,2,3,4", "1,2,x", "nan,0,0", "inf,0,0", "1,,2", "''", "1e999,0,0"};
    f.write("letter", "hi");
    const Strings files{"''", "letter", "x.tga", "new/x.png"};
    const std::map<std::string, Strings> wrong_values{
        {"--only", {"''", "frame", "depth.tga"}}, {"-o", files}, {"--output", files},
        {"--size", {"0", "5x", "x5", "5X", "5xx5", "5x5x5", "axb", "1e3x5", "99999999999x5", "5.5x5"}},
        {"--shadow-size", {"0", "-1", "16385", "x", "1.5"}}, {"--eye", no_vectors}, {"--center", no_vectors},
        {"--up", no_vectors}, {"--light", joined(no_vectors, {"0,0,0"})}, {"--bias", {"x", "1x", "nan", "inf"}},
        {"--casters", {"front", "''"}},
        {"--shadow", {"soft", "Map", "maps", "''"}}, {"--draw", {"depth", "colour", "Normal", "''"}},
        {"--zoom", {"0", "-1", "9e-7", "1.1e6", "nan", "x", "''"}}, {"--threads", {"-1", "257", "all"}}};
    for (const auto& [option, values] : wrong_values) {
        check(option + ": a value is missing", {option, option + " --quiet"});
        check(option, joined(each(option + " %", values), each(option + "=%", values)));
    }
    for (const std::string option : {"--eye", "--center", "--up", "--light"})
        check(option + ": \"1\" is not three numbers X,Y,Z joined by commas, as in 1,1,0", {option + " 1 1 0"});
    check("is not a folder", each("-o %", files));
    check("--casters back belongs to --shadow map", each("--casters back --shadow %", {"exact", "off"}));
    check("--bias belongs to --shadow map", each("--bias 1 --shadow %", {"exact", "off"}));
    check("takes no value", {"--quiet=yes", "-q=", "--help=x"});
    check("unknown option --frobnicate (", {"--frobnicate", "--size 5x5 --frobnicate 3", "--frobnicate=3"});
    check("same point", {"--eye 1,1,1 --center 1,1,1"});
    check("--two?lines", {"'--two\nlines'"});
    check("\"5x5?\"", {"--size '5x5\n'"});
}

TEST("the command line as people type it") {
    const Folder f;
    for (const std::string name : {"m.obj", "-m.obj"}) f.write(name, triangle);
    for (const auto& [typed, meant] : std::map<std::string, std::string>{
             {"--eye=2,1,4 m.obj", "--eye 2,1,4 m.obj"}, {"--size 40 m.obj", "--size 40x40 m.obj"},
             {"--size 40X30 m.obj", "--size=40x30 m.obj"}, {"--threads 0 m.obj", "m.obj"}, {"-- -m.obj", "m.obj"},
             {"--up 0,0,0 --eye 4,1,4 --shadow off m.obj", "--up 0,1,0 --eye 4,1,4 --shadow off m.obj"},
             {"--up 0,0,0 --eye 4,4,1 --shadow off m.obj", "--up 0,0,1 --eye 4,4,1 --shadow off m.obj"}}) {
        const Outcome a = f.run(small + typed), b = f.run(small + meant);
        if (!CHECK(a.status == 0 && a.err == b.err && !a.frame.empty() && a.same_pictures(b)))
            std::cerr << "    umbra " << typed << ": " << a.err << '\n';
    }
    for (const auto& [brief, name] : std::map<std::string, std::string>{{"-h", "--help"}, {"-V", "--version"}})
        CHECK(f.run(brief).out == f.run(name).out);
    CHECK(f.run(small + "-q m.obj").out.empty());
    CHECK(f.run(small + "- <m.obj").same_pictures(f.run(small + "m.obj")));
    CHECK_EQ(f.run(small + "- </dev/null").err, "umbra: -: no faces\n");
    CHECK(f.run("-- --help").err.rfind("umbra: --help: ", 0) == 0);  // a model
}

TEST("the folder of the pictures is made") {
    const Folder f;
    const Outcome here = f.run(small);
    CHECK_EQ(f.run(small + "-o new/one.tga/").status, 0);
    CHECK(here.depth == f.read("new/one.tga/depth.tga") && here.frame == f.read("new/one.tga/framebuffer.tga"));
    CHECK_EQ(f.run(small + "-o new/one.tga").status, 0);  // now that it is there
}

TEST("a file that is missing or no model is one line that names it, status 1, and earlier pictures as they were") {
    const Folder f;
    f.write("good.obj", triangle);
    f.write("few.obj", "v 0 0 0\nf 1 1 2\n");
    f.write("bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
    f.write("map.obj", triangle + "vt 0 0\nf 1/1 2/1 3/1\n");
    f.write("map_diffuse.tga", "this is a text where a picture should be, long enough for a header");
    for (int round = 0; round < 2; round++) {  // without earlier pictures, then with them
        for (const auto& [arguments, named] : std::map<std::string, std::string>{
                 {"missing.obj", "missing.obj:"}, {".", ".:"}, {"''", ":"}, {"'no\nsuch.obj'", "no?such.obj:"},
                 {"bad.obj", "bad.obj:4:"}, {"few.obj", "few.obj:2:"}, {"good.obj few.obj", "few.obj:2:"},
                 {"map.obj", "map_diffuse.tga:"}})
            check_refused(f, arguments, 1, "umbra: " + named);
        check_refused(f, "--size 0x1 good.obj", 2, "--size");
        const Outcome o = f.run(small + "good.obj");
        CHECK(o.status == 0 && !o.depth.empty() && !o.frame.empty());
    }
}

TEST("a standard output that takes nothing is one error line") {
    if (!std::filesystem::is_character_file("/dev/full")) return;  // every write to it fails for want of space
    const Folder f;
    f.write("good.obj", triangle);
    const Outcome o = f.run(small + "good.obj >/dev/full");
    CHECK_EQ(o.status, 1);
    CHECK_EQ(o.err, "umbra: standard output: cannot write\n");
    for (const std::string option : {"--help", "--version"}) CHECK(f.run(option + " >/dev/full").status != 0);
}

TEST("one line says that a scene was fitted and how it is lit, none with --no-fit") {
    const Folder f;
    f.write("big.obj", "v -10 -10 0\nv 10 -10 0\nv 0 10 0\nf 1 2 3\n");
    const Outcome fitted = f.run(small + "big.obj"), kept = f.run(small + "--no-fit big.obj");
    CHECK_EQ(fitted.err, "umbra: the scene is fitted to the picture (--no-fit)\n");
    const Outcome lit = f.run("--size 40x40 --shadow-size 30 big.obj");  // small has a light
    CHECK_EQ(lit.err, "umbra: the scene is fitted to the picture and lit from 1,1,1 (--no-fit, --light X,Y,Z)\n");
    CHECK(lit.same_pictures(fitted));
    CHECK(kept.status == 0 && kept.err.empty() && kept.frame != fitted.frame);
    const Outcome quiet = f.run(small + "--quiet big.obj");
    CHECK(quiet.err.empty() && quiet.out.empty() && quiet.frame == fitted.frame);
}

TEST("--at, --turn and --scale place the model before them; a file is read once, however often it is placed") {
    const Folder f;
    const auto prism = [](const std::function<vec3(vec3)>& to) {
        Obj obj;
        for (const auto& side : box_sides({-.5, -.4, -.25}, {.5, .4, .25})) {
            std::vector<vec3> corners;
            for (const vec3& v : side) corners.push_back(to(v));
            obj.polygon(corners);
        }
        return obj.text();
    };
    const auto turned = [](const vec3& v) { return vec3{-v.z, v.y, v.x} * .5 + vec3{.3, .2, -.1}; };
    f.write("box.obj", prism([](const vec3& v) { return v; }));
    f.write("placed.obj", prism(turned));
    const std::string view = "--no-fit --quiet --size 64 --shadow-size 99 ";
    const std::string place = " --at .3,.2,-.1 --scale .5 --turn -90";
    CHECK(f.run(view + "box.obj" + place).same_pictures(f.run(view + "placed.obj")));
    CHECK(f.run(view + "box.obj box.obj" + place).same_pictures(f.run(view + "box.obj placed.obj")));
    CHECK(!f.run(view + "box.obj box.obj" + place).same_pictures(f.run(view + "box.obj")));
    CHECK(f.run(view + "--up 0,-2,0 box.obj --turn 90").same_pictures(f.run(view + "--up 0,-1,0 box.obj --turn -270")));
    const Outcome twice = f.run(view + "- -" + place + " <box.obj");  // standard input can be read only once
    CHECK(twice.status == 0 && twice.same_pictures(f.run(view + "box.obj placed.obj")));
    f.write("-", std::string(99999, ' '));  // a file of that name is another
    CHECK(f.run(view + "- <box.obj").same_pictures(f.run(view + "box.obj")));
    f.write("note.obj", prism([](const vec3& v) { return v; }) + "f 1 2\n");
    CHECK_EQ(lines(f.run("--no-fit --light 1,1,1 --size 9 note.obj note.obj --at 1,0,0").err), 1);
    for (const std::string wrong : {"--at 1,2,3 box.obj", "box.obj --turn x", "box.obj --scale 0", "box.obj --at 1"})
        check_refused(f, wrong, 2, "--");
}

TEST("a sequence: a frame has the same bytes whoever draws it; where the camera moves the light's pass is spared") {
    const Folder f;
    f.write("yard.obj", yard());
    f.write("box.obj", "v -.2 0 0\nv .2 0 0\nv 0 .6 .3\nf 1 2 3\n");
    const std::string view = "--no-fit --size 48x40 --shadow-size 60 --light 1,2,1 ";
    const std::string scene = " yard.obj --at .1,0,0 box.obj";
    const auto frame = [&](const std::string& folder, const std::string& number) {
        const std::string picture = f.read(folder + "/framebuffer" + number);
        const std::string depth = f.read(folder + "/depth" + number);
        CHECK(!picture.empty() && !depth.empty());
        return picture + depth;
    };
    for (const std::string move : {"object", "camera", "light"}) {
        const Outcome all = f.run(view + "-o all --frames 8 --move " + move + scene);
        CHECK(all.status == 0 && all.err.empty());
        CHECK_EQ(value(all.out, "spared"), move == "camera" ? 7 : 0);
        CHECK(all.out.starts_with("wrote all/framebuffer_0000.tga and all/depth_0000.tga to all/framebuffer_0007.tga"));
        // Three calls side by side, as make, xargs or a job array would start them.
        const std::string parts = "printf '0:3/8 3:4/8 4:8/8' | xargs -n 1 -P 3 " + umbra_command + " -q " + view +
                                  "-o parts --move " + move + scene + " --frames";
        CHECK_EQ(f.run_command("cd \"" + f.path().string() + "\" && " + parts).status, 0);
        for (int i = 0; i < 8; i++) {
            const std::string number = "_000" + std::to_string(i) + ".tga";
            CHECK(frame("all", number) == frame("parts", number));
            CHECK_EQ(frame("all", number) == frame("all", "_0000.tga"), i == 0);
        }
        f.run(view + "-o still" + scene);
        CHECK(frame("still", ".tga") == frame("all", "_0000.tga"));
    }
    const Outcome quarter = f.run(view + "--light 2,2,1 --eye 4,1,-1" + scene);  // (1,1,4) turned by 90 degrees
    f.run(view + "--light 2,2,1 -o all --frames 4 --move camera" + scene);
    CHECK(quarter.frame == f.read("all/framebuffer_0001.tga"));
    for (const std::string wrong : {"3:3/8", "3:9/8", "-1:2/8", "0:2/10000", "0:2", "2/8", "0", "1:2/8x"})
        check_refused(f, "--frames " + wrong + " yard.obj", 2, "--frames");
}

TEST("a sky is behind everything, wherever the eye is, and changes nothing else") {
    const Folder f;
    f.write("yard.obj", yard());
    Obj sky;
    for (const auto& side : box_sides({.01, .01, .01}, {-.01, -.01, -.01}))
        sky.polygon({side[0], side[1], side[2], side[3]});
    f.write("sky.obj", "mtllib sky.mtl\nusemtl s\n" + sky.text());
    f.write("sky.mtl", "newmtl s\nKd .2 .4 .6\n");
    for (const std::string options : {"", "--eye 0,0,1e9 ", "--eye .1,.1,.2 ", "--up 0,0,1 --zoom .3 "}) {
        const std::string view = "--no-fit -q --size 40 --shadow-size 50 " + options;
        const Outcome without = f.run(view + "yard.obj");
        std::vector<Bytes> pixels;
        f.each_pixel([&](int, int, const std::uint8_t* bgr) { pixels.emplace_back(bgr, bgr + 3); });
        CHECK(f.run(view + "--sky sky.obj yard.obj").depth == without.depth);
        f.each_pixel([&](int x, int y, const std::uint8_t* bgr) {
            const Bytes& before = pixels[y * 40 + x];
            CHECK(Bytes(bgr, bgr + 3) == (before == Bytes(3) ? Bytes{153, 102, 51} : before));
        });
        for (const std::string other : {"--draw shadow", "--draw normal", "--only depth"})
            CHECK(f.run(view + other + " --sky sky.obj yard.obj").same_pictures(f.run(view + other + " yard.obj")));
    }
    check_refused(f, "--sky none.obj yard.obj", 1, "none.obj: cannot be opened");
}

TEST("what is not needed is left out, and said") {
    const Folder f;
    f.write("plain.obj", triangle);
    const Outcome off = f.run("--shadow off --size 40x40 plain.obj");
    CHECK(off.status == 0 && off.depth.empty());
    for (const std::string name : {"diffuse", "normal_map", "specular", "glow", "shadow"})
        CHECK(off.out.find(name, off.out.find(" left_out ")) != std::string::npos);
    CHECK_EQ(value(off.out, "shadow_bytes"), 0);
}

TEST("a note says what is missing: nothing seen, nothing lit, an earlier picture that is not replaced") {
    const Folder f;
    f.write("m.obj", triangle);
    const std::string lit = small + "--eye 0,0,4 --light 0,0,1 ", unseen = "nothing of the scene is seen",
                      unlit = "nothing that is seen is lit", away = "--center 9,9,9 --eye 9,9,19 ";
    const auto notes = [&](const std::string& options, const Strings& expected) {
        const Outcome o = f.run(lit + options + "m.obj");
        bool ok = o.status == 0 && lines(o.err) == static_cast<long>(expected.size());
        for (const std::string& note : expected) ok &= o.err.find("umbra: " + note) != std::string::npos;
        if (!CHECK(ok)) std::cerr << "    umbra " << options << ": " << o.err << '\n';
        CHECK(f.run(lit + options + "--quiet m.obj").err.empty());
    };
    notes("--only depth ", {});
    notes("--only framebuffer ", {"./depth.tga is from an earlier run"});
    notes("--shadow off ", {"./depth.tga is from an earlier run"});
    notes("", {});
    notes("--only depth ", {"./framebuffer.tga is from an earlier run"});
    notes("--light 0,0,-1 ", {unlit});
    notes("--light 0,0,-1 --draw shadow ", {});
    notes(away, {unseen, "./depth.tga is from an earlier run"});
    for (const char* file : {"depth.tga", "framebuffer.tga"}) std::filesystem::remove(f / file);
    notes(away + "--only depth ", {unseen});
}

// A wall, a board behind the viewer that shadows a half of it, and something far away whose texture is no picture.
TEST("a model that is not seen is not shaded, nor are its textures read; it throws a shadow where it can") {
    const Folder f;
    const std::string square = "v -1 -1 %\nv 1 -1 %\nv 1 1 %\nv -1 1 %\nvt 0 0\nf 1/1 2/1 3/1 4/1\n";
    f.write("wall.obj", each(square, {"0"})[0]);
    f.write("board.obj", "v 0 -9 10\nv 9 -9 10\nv 9 9 10\nv 0 9 10\nf 1 2 3 4\n");
    f.write("far.obj", "v 99 0 0\nv 100 0 0\nv 99 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
    f.write("far_diffuse.tga", "no picture");
    for (const std::string shadow : {"exact", "map"}) {
        const std::string options = small + "--no-fit --eye 0,0,4 --light 0,0,1 --shadow " + shadow + " ";
        const Outcome all = f.run(options + "far.obj wall.obj board.obj"), some = f.run(options + "wall.obj board.obj");
        CHECK(all.status == 0 && all.err.empty() && all.same_pictures(some));
        CHECK(value(all.out, "models") == 3 && value(all.out, "seen") == 1 && value(all.out, "casters") == 2);
        CHECK_EQ(value(all.out, "triangles"), 2);
        const Outcome lit = f.run(options + "wall.obj far.obj");
        CHECK(value(lit.out, "casters") == 1 && lit.frame != all.frame);
        CHECK_EQ(f.run(options + "--center 99,0,0 --eye 99,0,4 wall.obj far.obj").status, 1);  // now it is seen
    }
    const Outcome none = f.run(small + "--no-fit --eye 0,0,4 --center 0,0,8 far.obj");
    CHECK(none.status == 0 && value(none.out, "seen") == 0 && value(none.out, "shadow_bytes") == 0);
}

TEST("--only: one of the two pictures, without what it does not need") {
    const Outcome both = Folder().run(small), frame = Folder().run(small + "--only framebuffer"),
                  depth = Folder().run(small + "--only depth");
    CHECK(frame.frame == both.frame && frame.depth.empty());
    CHECK(depth.depth == both.depth && depth.frame.empty() && value(depth.out, "fragments") == 0);
    CHECK_EQ(Folder().run(small + "--only depth --shadow exact").status, 2);
}

TEST("--zoom: the middle of a picture twice as large, and the same light") {
    const Folder near, far;
    const Outcome zoomed = near.run("--size 100x80 --zoom 2"), whole = far.run("--size 200x160");
    const TGAImage large = TGAImage::read_tga_file(far / "framebuffer.tga");
    near.each_pixel([&](int x, int y, const std::uint8_t* bgr) {
        for (int c = 0; c < 3; c++) CHECK_EQ(int{bgr[c]}, int{large.pixel(x + 50, y + 40)[c]});
    });
    CHECK(zoomed.depth == whole.depth && near.run("--size 200x160 --zoom=1").frame == whole.frame);
    for (const std::string zoom : {"1e6", "1e-6"}) CHECK_EQ(near.run("--size 9 --zoom " + zoom).status, 0);
}

// Boards that face the light: the one of half the height fills the middle half of the rows.
TEST("depth.tga shows the scene unstretched; what is all but a line to the light is a row or column of it") {
    const Folder f;
    for (const auto& [height, rows] : {std::pair(".5", 15), {"1", 30}, {"1e-3", 1}, {"1e-300", 1}}) {
        f.write("m.obj", each("v -1 -% 0\nv 1 -% 0\nv 1 % 0\nv -1 % 0\nf 1 2 3 4\n", {height})[0]);
        for (const std::string up : {"0,1,0", "1,0,0"}) {
            CHECK_EQ(f.run(small + "--no-fit --light 0,0,1 --up " + up + " m.obj").status, 0);
            int drawn = 0;
            f.each_pixel([&, n = rows](int x, int y, const std::uint8_t* grey) {
                const int from_middle = std::abs(2 * (up == "0,1,0" ? y : x) - 29);  // in half pixels
                CHECK(*grey == 0 || from_middle <= n);
                drawn += *grey > 0;
            }, "depth.tga");
            CHECK_EQ(drawn, 30 * rows);
        }
    }
}

// Two boards that fill a picture of 4 x 3: one turned away from the light, and below it one that faces it.
TEST("--show: two pixels in a character, averaged down to the terminal's width") {
    const Folder f;
    f.write("m.obj", "v -9 0 0\nv 9 0 0\nv 9 9 0\nv -9 9 0\nv 9 -9 0\nv -9 -9 0\nvn 1 0 0\nvn 0 0 1\n"
                     "f 1//1 2//1 3//1 4//1\nf 6//2 5//2 2//2 1//2\n");
    const std::string options = "--no-fit --eye 0,0,4 --light 0,0,1 --show --only framebuffer m.obj ";
    const auto shown = [&](const std::string& columns, const std::string& more) {
        const std::string out = f.run(options + more, "COLUMNS=" + columns + ' ' + umbra_command).out;
        return std::regex_replace(out.substr(0, out.find("wrote")), std::regex("\033\\["), "<");
    };
    const auto times = [](int n, const std::string& text) {
        std::string all;
        for (int i = 0; i < n; i++) all += text;
        return all;
    };
    const std::string dark = "20;20;20m", light = "255;255;255m", block = "\u2580";
    const std::string two = "<38;2;" + dark + "<48;2;" + light + block;
    CHECK_EQ(shown("80", "--size 4x2"), two + times(3, block) + "<0m\n");  // a colour is said where it changes
    CHECK_EQ(shown("3", "--size 6x4"), two + times(2, block) + "<0m\n");
    CHECK_EQ(shown("2", "--size 4"), two + block + "<0m\n");
    CHECK_EQ(shown("1", "--size 4"), "<38;2;137;137;137m" + block + "<0m\n");  // of 20 and 255
    CHECK_EQ(lines(shown("x", "--size 200")), 40);
    CHECK_EQ(lines(f.run(options + "--size 8 --quiet").out), 4);
    CHECK_EQ(lines(f.run(small + "--show --only depth").out), 15 + 2);
}

// A wall that faces viewer and light, in one colour: 20 + 1.2 * 255 times what its surface reflects, and its glow.
TEST("a wall's colour: vertices' times Kd times the map's, and Ke; without normals also from behind") {
    const Folder f;
    TGAImage halves(2, 1, TGAImage::RGB);
    halves.set(0, 0, {{100, 100, 100, 0}});
    halves.write_tga_file(f / "halves.tga");  // the right one is black
    f.write("m.mtl", "newmtl plain\nnewmtl red\nKd 1 .5 0\nKe 0 .1 .2\nnewmtl left\nmap_Kd -s .5 1 halves.tga\n"
                     "newmtl shifted\nmap_Kd -s .5 1 -o .5 0 halves.tga\n");
    const std::string front = "f 1/1 2/2 3/3 4/4\n", normal = "vn 0 0 -1\n";
    const auto check = [&](const std::string& colors, const std::string& rest, const Bytes& bgr) {
        std::string obj = "mtllib m.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
        for (const std::string corner : {"-1 -1", "1 -1", "1 1", "-1 1"}) obj += "v " + corner + " 0" + colors + '\n';
        f.write("m.obj", obj + rest);
        f.run("--no-fit --size 8x8 --eye 0,0,4 --light 0,0,1 m.obj");
        f.each_pixel([&](int x, int y, const std::uint8_t* pixel) {
            if (std::min({x, y, 7 - x, 7 - y}) > 0) CHECK(Bytes(pixel, pixel + 3) == bgr);
        });
    };
    check("", "usemtl plain\n" + front, {255, 255, 255});
    check(" .1 .5 .25", "usemtl plain\n" + front, {96, 173, 50});
    check(" .5 .5 .25", "usemtl red\n" + front, {71, 122, 173});
    check("", "usemtl left\n" + front, {140, 140, 140});
    check("", "usemtl shifted\n" + front, {20, 20, 20});
    check(" .1 .5 .25", "usemtl plain\nf 4 3 2 1\n", {96, 173, 50});
    check("", normal + "usemtl plain\nf 1//1 2//1 3//1 4//1\n", {20, 20, 20});
}

// A wall at z = 0 that faces viewer and light, a board before it that shadows a part of it, and a strip that turns its
// back to both. The light comes from the right at 45 degrees.
TEST("--draw shadow: lit is white, in shadow black, turned away from the light grey") {
    const Folder f;
    f.write("wall.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n"
                        "v -.25 -.26 .25\nv .25 -.26 .25\nv .25 .26 .25\nv -.25 .26 .25\nf 5 6 7 8\n"
                        "v -1.24 -1 0\nv -1.1 -1 0\nv -1.1 1 0\nv -1.24 1 0\nvn 0 0 -1\nf 12//1 11//1 10//1 9//1\n");
    for (const std::string shadow : {"exact", "off"}) {
        f.run("--size 80x80 --no-fit --eye 0,0,4 --light 1,0,1 --draw shadow wall.obj --shadow " + shadow);
        const long pixels = f.each_pixel([&](int px, int py, const std::uint8_t* bgr) {
            const double x = (px - 39.5) / 30, y = std::fabs(py - 39.5) / 30, w = 1 - .25 / 4;  // w of the board
            const bool board = std::fabs(x) < .25 / w && y < .26 / w;
            const bool black = shadow != "off" && !board && x > -.5 && x < 0 && y < .26;
            const bool grey = x > -1.24 && x < -1.1 && y < 1, white = std::fabs(x) < 1 && y < 1;
            for (int c = 0; c < 3; c++) CHECK_EQ(int{bgr[c]}, black ? 0 : grey ? 128 : white ? 255 : 0);
        });
        CHECK_EQ(pixels, 6400);
    }
}

// A shelf of one layer over a wall, which the light sees from the front. Back faces alone leave it out, and what is
// under it is lit; a copy that faces the other way, a little farther from the light, is the remedy. Of a closed body
// they throw the same shadow as all of its faces.
TEST("--casters back: leaks through a single layer, not with a flipped copy under it; enough of closed bodies") {
    const Folder f;
    const std::string wall = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n";
    const std::string shelf = "v -.3 -.3 .5\nv .3 -.3 .5\nv .3 .3 .5\nv -.3 .3 .5\nf 5 6 7 8\n";
    const std::string copy = "v -.3 -.3 .48\nv .3 -.3 .48\nv .3 .3 .48\nv -.3 .3 .48\nf 12 11 10 9\n";
    const std::string sides = "f 5 9 10 6\nf 6 10 11 7\nf 7 11 12 8\nf 8 12 9 5\n";
    const auto dark = [&](const std::string& model, const std::string& options) {
        f.write("m.obj", model);
        f.run("--size 80x80 --no-fit --eye 0,0,4 --light 1,0,1 --draw shadow m.obj " + options);
        long n = 0;
        f.each_pixel([&](int x, int y, const std::uint8_t* bgr) {
            n += std::max(std::abs(x - 39.5), std::abs(y - 39.5)) < 29 && bgr[0] == 0;  // on the wall
        });
        return n;
    };
    const long shadow = dark(wall + shelf, "");
    CHECK(shadow > 200);
    CHECK_EQ(dark(wall + shelf, "--casters back"), 0);
    for (const std::string& closed : {shelf + copy, shelf + copy + sides}) {
        const long all = dark(wall + closed, ""), back = dark(wall + closed, "--casters back");
        CHECK(std::abs(back - all) < all / 10);
    }
}

TEST("--draw normal: red is to the right, green up, blue towards the viewer") {
    const std::string cross = "v -9 0 0\nv 9 0 0\nv 0 9 0\nv 0 -9 0\nv 0 0 -9\nv 0 0 9\n";  // seen along z and along x
    const auto check = [&](const std::string& normal, const std::string& eye, const Bytes& bgr) {
        const Folder f;
        f.write("cross.obj", cross + "vn " + normal + "\nf 1//1 4//1 2//1 3//1\nf 5//1 4//1 6//1 3//1\n");
        f.run("--no-fit --draw normal --size 9x9 cross.obj --eye " + eye);
        const auto is_right = [&](int, int, const std::uint8_t* pixel) { CHECK(Bytes(pixel, pixel + 3) == bgr); };
        CHECK_EQ(f.each_pixel(is_right), 81);
    };
    check("1 0 0", "0,0,4", {128, 128, 255});
    check("0 -2 0", "0,0,4", {128, 0, 128});
    check("0 0 1", "0,0,4", {255, 128, 128});
    check("1 0 0", "4,0,0", {255, 128, 128});  // the viewer's right, not the model's
    check("0 0 1", "4,0,0", {128, 128, 0});
}

TEST("the same bytes at any number of threads") {
    const Folder f;
    const std::string options = "--size 300x200 --shadow-size 256 --threads ";
    const Outcome one = f.run(options + "1");
    CHECK_EQ(one.status, 0);
    for (const std::string threads : {"2", "7"}) CHECK(f.run(options + threads).same_pictures(one));
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
