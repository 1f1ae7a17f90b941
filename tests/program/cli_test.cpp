// cli_test.cpp: the program as its user meets it: options, statuses, error lines, and what happens to earlier pictures.
#include "check.h"
#include "files.h"
#include "tgaimage.h"

#include <algorithm>
#include <cstdlib>
#include <string>

namespace fs = std::filesystem;

namespace {

struct Folder : TemporaryFolder {
    Folder() : TemporaryFolder("cli_test") {}
    fs::path write(const std::string& name, const std::string& bytes) const {
        std::ofstream(path() / name, std::ios::binary) << bytes;
        return path() / name;
    }
    std::string read(const std::string& name) const {
        std::ifstream in(path() / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    int files() const { return static_cast<int>(std::distance(fs::directory_iterator(path()), fs::directory_iterator())); }
};

struct Outcome {
    int status;
    std::string out, err;
};

Outcome run(const Folder& f, const std::string& arguments) {
    const std::string q = "\"";
    const int raw = std::system(("cd " + q + f.path().string() + q + " && " + q + UMBRA_BINARY + q + " " + arguments +
                                 " >stdout.txt 2>stderr.txt").c_str());
    Outcome o{raw > 255 ? raw >> 8 : raw, f.read("stdout.txt"), f.read("stderr.txt")};
    fs::remove(f.path() / "stdout.txt");
    fs::remove(f.path() / "stderr.txt");
    return o;
}

int lines(const std::string& text) { return static_cast<int>(std::count(text.begin(), text.end(), '\n')); }

// One line on standard error that contains the text, the given status, and no picture written.
void check_error(const std::string& arguments, int status, const std::string& text) {
    const Folder f;
    const Outcome o = run(f, arguments);
    CHECK_EQ(o.status, status);
    CHECK_EQ(lines(o.err), 1);
    CHECK(o.err.rfind("umbra: ", 0) == 0);
    if (o.err.find(text) == std::string::npos) CHECK_EQ(o.err, text);
    CHECK_EQ(o.out, std::string());
    CHECK_EQ(f.files(), 0);
}

const std::string triangle_obj = "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n";

}  // namespace

TEST("the default model draws two pictures from any working directory") {
    const Folder f;
    const Outcome o = run(f, "--size 200x160 --shadow-size 100");
    CHECK_EQ(o.status, 0);
    CHECK_EQ(o.err, std::string());
    const TGAImage depth = TGAImage::read_tga_file(f.path() / "depth.tga"), frame = TGAImage::read_tga_file(f.path() / "framebuffer.tga");
    CHECK(frame.width() == 200 && frame.height() == 160 && frame.bytespp() == 3);
    CHECK(depth.width() == 100 && depth.height() == 100 && depth.bytespp() == 1);
    CHECK_EQ(f.files(), 2);
    CHECK_EQ(lines(o.out), 1);
    for (const char* name : {"triangles ", "pixels ", "fragments ", "load_ms ", "depth_ms ", "shade_ms ", "write_ms ", "left_out "})
        if (o.out.find(name) == std::string::npos) CHECK_EQ(o.out, std::string(name));
}

TEST("help and version") {
    const Folder f;
    const Outcome help = run(f, "--help"), version = run(f, "--version");
    CHECK_EQ(help.status, 0);
    for (const char* option : {"-o", "--size", "--shadow-size", "--eye", "--center", "--up", "--light", "--bias", "--shadow",
                               "--no-fit", "--tangent", "--threads", "--quiet", "--help", "--version"})
        if (help.out.find(option) == std::string::npos) CHECK_EQ(help.out, std::string(option));
    CHECK_EQ(version.status, 0);
    CHECK(version.out.rfind("umbra ", 0) == 0);
}

TEST("a wrong command line ends with status 2 and one line") {
    check_error("--frobnicate", 2, "--frobnicate");
    check_error("--size", 2, "--size");
    for (const char* size : {"0x0", "-5x5", "5", "5x", "x5", "5x5x5", "axb", "16385x1", "1e3x5", "99999999999x5", "5.5x5"})
        check_error("--size " + std::string(size), 2, "--size");
    for (const char* size : {"0", "-1", "16385", "x", "1.5"}) check_error("--shadow-size " + std::string(size), 2, "--shadow-size");
    for (const char* v : {"1,2", "1,2,3,4", "1,2,x", "nan,0,0", "inf,0,0", "1,,2", "''", "1e999,0,0"})
        for (const char* option : {"--eye", "--center", "--up", "--light"})
            check_error(option + std::string(" ") + v, 2, option);
    check_error("--eye 1,1,1 --center 1,1,1", 2, "same point");
    check_error("--light 0,0,0", 2, "--light");
    check_error("--bias x", 2, "--bias");
    check_error("--shadow soft", 2, "--shadow");
    check_error("--threads 0", 2, "--threads");
    check_error("-o", 2, "-o");
    check_error("'--two\nlines'", 2, "--two?lines");
    check_error("--size '5x5\n'", 2, "\"5x5?\"");
}

TEST("a file that is missing or no model ends with status 1 and one line that names it") {
    check_error("missing.obj", 1, "missing.obj");
    check_error(".", 1, ".");
    check_error("''", 1, "");
    check_error("'no\nsuch.obj'", 1, "no?such.obj");
    const Folder f;
    f.write("bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
    const Outcome o = run(f, "bad.obj");
    CHECK_EQ(o.status, 1);
    CHECK_EQ(lines(o.err), 1);
    CHECK(o.err.rfind("umbra: bad.obj:4: ", 0) == 0);
    f.write("good.obj", triangle_obj + "vt 0 0\nf 1/1 2/1 3/1\n");
    f.write("good_diffuse.tga", "this is a text where a picture should be, long enough for a header");
    const Outcome picture = run(f, "good.obj");
    CHECK_EQ(picture.status, 1);
    CHECK_EQ(lines(picture.err), 1);
    CHECK(picture.err.rfind("umbra: good_diffuse.tga: ", 0) == 0);
    CHECK_EQ(f.files(), 3);
}

TEST("an error leaves earlier pictures as they were") {
    const Folder f;
    f.write("good.obj", triangle_obj);
    CHECK_EQ(run(f, "--size 40x40 --shadow-size 30 good.obj").status, 0);
    const std::string depth = f.read("depth.tga"), frame = f.read("framebuffer.tga");
    CHECK(!depth.empty() && !frame.empty());
    f.write("bad.obj", "v 0 0 0\nf 1 1\n");
    CHECK_EQ(run(f, "bad.obj").status, 1);
    CHECK_EQ(run(f, "good.obj bad.obj").status, 1);
    CHECK_EQ(run(f, "--size 0x1 good.obj").status, 2);
    CHECK(f.read("depth.tga") == depth && f.read("framebuffer.tga") == frame);
    CHECK_EQ(f.files(), 4);
}

TEST("an output folder that cannot be written is one error line") {
    const Folder f;
    f.write("good.obj", triangle_obj);
    const Outcome o = run(f, "-o nowhere --size 40x40 --shadow-size 30 good.obj");
    CHECK_EQ(o.status, 1);
    CHECK_EQ(lines(o.err), 1);
    CHECK(o.err.find("nowhere") != std::string::npos);
    CHECK_EQ(f.files(), 1);
}

TEST("a standard output that takes nothing is one error line") {
    if (!fs::is_character_file("/dev/full")) return;  // a device on which every write fails for want of space
    const Folder f;
    f.write("good.obj", triangle_obj);
    const std::string inside = "cd \"" + f.path().string() + "\" && \"" UMBRA_BINARY "\" ";
    for (const char* arguments : {"--size 40x40 --shadow-size 30 good.obj", "--quiet --report --size 40x40 --shadow-size 30 good.obj"}) {
        const int raw = std::system((inside + arguments + " >/dev/full 2>stderr.txt").c_str());
        CHECK_EQ(raw > 255 ? raw >> 8 : raw, 1);
        CHECK_EQ(f.read("stderr.txt"), std::string("umbra: standard output: cannot write\n"));
    }
    CHECK(std::system((inside + "--help >/dev/full").c_str()) != 0);
    CHECK(std::system((inside + "--version >/dev/full").c_str()) != 0);
}

TEST("one line says that a model was fitted, none with --no-fit") {
    const Folder f;
    f.write("big.obj", "v -10 -10 0\nv 10 -10 0\nv 0 10 0\nf 1 2 3\n");
    const Outcome fitted = run(f, "--size 40x40 --shadow-size 30 big.obj");
    CHECK_EQ(fitted.status, 0);
    CHECK_EQ(lines(fitted.err), 1);
    CHECK(fitted.err.find("fitted") != std::string::npos);
    CHECK_EQ(run(f, "--size 40x40 --shadow-size 30 --no-fit big.obj").err, std::string());
    const Outcome quiet = run(f, "--quiet --size 40x40 --shadow-size 30 big.obj");
    CHECK_EQ(quiet.err + quiet.out, std::string());
}

TEST("what is not needed is left out, and said") {
    const Folder f;
    f.write("plain.obj", triangle_obj);
    const Outcome off = run(f, "--shadow off --size 40x40 plain.obj");
    CHECK_EQ(off.status, 0);
    CHECK(!fs::exists(f.path() / "depth.tga"));
    for (const char* name : {"diffuse", "normal_map", "specular", "glow", "shadow"})
        CHECK(off.out.substr(off.out.find("left_out")).find(name) != std::string::npos);
    CHECK(off.out.find("shadow_bytes 0 ") != std::string::npos);
}

TEST("the same bytes at any number of threads") {
    const Folder f;
    std::string frame, depth;
    for (const char* threads : {"1", "2", "7"}) {
        CHECK_EQ(run(f, "--size 300x200 --shadow-size 256 --threads " + std::string(threads)).status, 0);
        if (frame.empty()) frame = f.read("framebuffer.tga"), depth = f.read("depth.tga");
        CHECK(frame == f.read("framebuffer.tga") && depth == f.read("depth.tga"));
    }
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
