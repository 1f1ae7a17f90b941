// run.h: runs a program as a shell does, and collects what it says and the pictures that it leaves in a folder. For
// tests of umbra from outside, and for the report and the gate that judge it; it needs UMBRA_BINARY.
#pragma once
#include "check.h"
#include "files.h"
#include "tgaimage.h"

#include <algorithm>
#include <cstdlib>
#include <regex>

using Strings = std::vector<std::string>;

inline Strings joined(Strings a, const Strings& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

// The text once for each value, which takes the place of every %.
inline Strings each(const std::string& text, const Strings& values) {
    Strings all;
    for (const std::string& value : values) all.push_back(std::regex_replace(text, std::regex("%"), value));
    return all;
}

inline std::string quoted(const std::string& argument) {  // for a POSIX shell
    return '\'' + std::regex_replace(argument, std::regex("'"), "'\\''") + '\'';
}

inline auto lines(const std::string& text) { return std::count(text.begin(), text.end(), '\n'); }

// The last line of what a program prints, which is one of names and values: the number after the name.
inline double value(const std::string& out, const std::string& name) {
    const std::string line = '\n' + out.substr(0, out.find_last_not_of('\n') + 1);
    const std::string last = ' ' + line.substr(line.rfind('\n') + 1);
    const std::size_t at = last.find(' ' + name + ' ');
    if (at == std::string::npos) throw std::runtime_error("no " + name + " in: " + out);
    return std::stod(last.substr(at + name.size() + 2));
}

inline const std::string umbra_command = "\"" UMBRA_BINARY "\"";

struct Outcome {
    int status;
    std::string out, err, frame, depth;  // what it printed, and the bytes of the two pictures, if they are there
    bool same_pictures(const Outcome& o) const { return frame == o.frame && depth == o.depth; }
};

struct Folder : TemporaryFolder {
    Folder() : TemporaryFolder("run") {}
    std::string write(const std::string& name, const std::string& text) const {  // returns its path
        write_bytes(*this / name, Bytes(text.begin(), text.end()));
        return (*this / name).string();
    }
    std::string read(const std::string& name) const {
        std::ifstream in(*this / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    auto files() const {
        using Files = std::filesystem::directory_iterator;
        return std::distance(Files(path()), Files());
    }

    // Runs it in the caller's folder; it may send its output elsewhere.
    Outcome run_command(const std::string& command) const {
        const std::string said = '"' + (*this / "stdout.txt").string() + '"',
                          complained = '"' + (*this / "stderr.txt").string() + '"';
        const int raw = std::system(('(' + command + ") >" + said + " 2>" + complained).c_str());
        const Outcome o{raw > 255 ? raw >> 8 : raw,  // POSIX keeps it in the high byte
                        read("stdout.txt"), read("stderr.txt"), read("framebuffer.tga"), read("depth.tga")};
        for (const char* file : {"stdout.txt", "stderr.txt"}) std::filesystem::remove(*this / file);
        return o;
    }
    // Runs the program in this folder. program: a command that its arguments may follow.
    Outcome run(const std::string& arguments, const std::string& program = umbra_command) const {
        return run_command("cd \"" + path().string() + "\" && " + program + ' ' + arguments);
    }

    // Calls visit(x, y, bgr) for each pixel of the picture and returns how many there are.
    long each_pixel(const auto& visit, const std::string& picture = "framebuffer.tga") const {
        const TGAImage image = TGAImage::read_tga_file(*this / picture);
        for (int y = 0; y < image.height(); y++)
            for (int x = 0; x < image.width(); x++) visit(x, y, image.pixel(x, y));
        return long{image.width()} * image.height();
    }
};

// A run that failed: what the program wrote to standard error, and its status.
struct ProgramFailed : std::runtime_error {
    int status;
    explicit ProgramFailed(const Outcome& o) : std::runtime_error(o.err), status(o.status) {}
};

// A program that is judged, with a folder for its pictures and whatever else a run needs.
struct Program : Folder {
    std::string binary;
    explicit Program(const std::string& path) : binary(path) {}

    // Runs it in the caller's folder and returns what it says. Throws ProgramFailed.
    std::string run(const Strings& arguments) const {
        std::string command = quoted(binary);
        for (const std::string& argument : joined(arguments, {"-o", path().string()}))
            command += ' ' + quoted(argument);
        const Outcome o = run_command(command);
        return o.status == 0 ? o.out : throw ProgramFailed(o);
    }
};

// The program must end with the status and one line that begins with its name and holds the text, say nothing else, and
// leave the folder as it is.
inline void check_refused(const Folder& f, const std::string& arguments, int status, const std::string& text) {
    const auto files = f.files();
    const std::string frame = f.read("framebuffer.tga"), depth = f.read("depth.tga");
    const Outcome o = f.run(arguments);
    const bool named = o.err.rfind("umbra: ", 0) == 0 && o.err.find(text) != std::string::npos;
    const bool ok = o.status == status && lines(o.err) == 1 && named && o.out.empty();
    const bool kept = f.files() == files && o.frame == frame && o.depth == depth;
    if (!CHECK(ok) || !CHECK(kept))
        std::cerr << "    umbra " << arguments << ": status " << o.status << ", " << o.out << o.err << '\n';
}
