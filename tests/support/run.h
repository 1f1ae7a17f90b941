// run.h: runs the program in a folder of its own, as a shell does, and collects what it says and what it leaves there.
// For tests of the program from outside; it needs UMBRA_BINARY.
#pragma once
#include "check.h"
#include "files.h"
#include "tgaimage.h"

#include <algorithm>
#include <cstdlib>

using Strings = std::vector<std::string>;

// The text once for each value, which takes the place of every %.
inline Strings each(const std::string& text, const Strings& values) {
    Strings all;
    for (const std::string& value : values) {
        all.emplace_back();
        for (const char c : text) all.back() += c == '%' ? value : std::string(1, c);
    }
    return all;
}

inline const std::string umbra = "\"" UMBRA_BINARY "\"";

struct Outcome {
    int status;
    std::string out, err, frame, depth;  // what it printed, and the bytes of the two pictures, if they are there
    bool same_pictures(const Outcome& o) const { return frame == o.frame && depth == o.depth; }
};

struct Folder : TemporaryFolder {
    Folder() : TemporaryFolder("run") {}
    void write(const std::string& name, const std::string& text) const {
        write_bytes(*this / name, Bytes(text.begin(), text.end()));
    }
    std::string read(const std::string& name) const {
        std::ifstream in(*this / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    long files() const {
        using Files = std::filesystem::directory_iterator;
        return std::distance(Files(path()), Files());
    }

    // program: a command that its arguments may follow; they may send its output elsewhere.
    Outcome run(const std::string& arguments, const std::string& program = umbra) const {
        const std::string there = "cd \"" + path().string() + "\" && ", said = " >stdout.txt 2>stderr.txt ";
        const int raw = std::system((there + program + said + arguments).c_str());
        const Outcome o{raw > 255 ? raw >> 8 : raw, read("stdout.txt"), read("stderr.txt"), read("framebuffer.tga"),
                        read("depth.tga")};
        std::filesystem::remove(*this / "stdout.txt");
        std::filesystem::remove(*this / "stderr.txt");
        return o;
    }

    // Calls visit(x, y, bgr) for each pixel of framebuffer.tga and returns how many there are.
    template <class Visit>
    long each_pixel(const Visit& visit) const {
        const TGAImage image = TGAImage::read_tga_file(*this / "framebuffer.tga");
        for (int y = 0; y < image.height(); y++)
            for (int x = 0; x < image.width(); x++) visit(x, y, image.pixel(x, y));
        return long{image.width()} * image.height();
    }
};

inline long lines(const std::string& text) { return std::count(text.begin(), text.end(), '\n'); }

// The number after the name in a line of names and values.
inline long value(const std::string& line, const std::string& name) {
    const std::size_t at = (' ' + line).find(' ' + name + ' ');
    if (at == std::string::npos) throw std::runtime_error("no " + name + " in: " + line);
    return std::stol(line.substr(at + name.size() + 1));
}

// The program must end with the status and one line that begins with its name and holds the text, say nothing else, and
// leave the folder as it is.
inline void check_refused(const Folder& f, const std::string& arguments, int status, const std::string& text) {
    const long files = f.files();
    const std::string frame = f.read("framebuffer.tga"), depth = f.read("depth.tga");
    const Outcome o = f.run(arguments);
    const bool named = o.err.rfind("umbra: ", 0) == 0 && o.err.find(text) != std::string::npos;
    const bool ok = o.status == status && lines(o.err) == 1 && named && o.out.empty();
    const bool kept = f.files() == files && o.frame == frame && o.depth == depth;
    if (!CHECK(ok) || !CHECK(kept))
        std::cerr << "    umbra " << arguments << ": status " << o.status << ", " << o.out << o.err << '\n';
}
