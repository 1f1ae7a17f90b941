// lesson.h: reads README.md and says where it is not true: code that it quotes, commands, pictures and what makes them,
// figures in sentences, and exercises, which are changes to main.cpp. It knows Markdown as far as the README uses it:
// an image stands on one line, a fence begins at the left.
#pragma once
#include "compare.h"
#include "judge.h"
#include "our_gl.h"
#include "png.h"
#include "run.h"
#include "scenes.h"

#include <map>
#include <memory>

namespace fs = std::filesystem;

struct Passage {
    enum Kind { quote, exercise, output, fence, command, image } kind;
    int line;                  // of the README, from 1 on
    std::string text;          // the file quoted, a fence's first line, the command, the image's file
    int program = 0;           // umbra itself, or that of the exercise of this number, if its section has one
    Strings body = {};         // a fence's lines
    std::string made_by = {};  // an image's command, or an output's
    int to_one = 1;            // so many pixels a side of the picture are one of the image
    std::string file = {};     // where it stands
};

struct Wrong : std::runtime_error {
    Wrong(const Passage& p, const std::string& what, int line = 0)
        : runtime_error(p.file + ':' + std::to_string(line ? line : p.line) + ": " + what) {}
};

inline Strings split(const std::string& text, char at) {
    Strings parts;
    std::istringstream in(text);
    for (std::string part; std::getline(in, part, at);) parts.push_back(part);
    return parts;
}

inline std::string text_of(const fs::path& file) {  // of the repository
    const Bytes bytes = read_bytes(UMBRA_SOURCE_DIR / file);
    return {bytes.begin(), bytes.end()};
}

// The passages of a text; its exercises are counted on from a number.
inline std::vector<Passage> parsed(const std::string& markdown, const std::string& file = "README.md",
                                   int exercises = 0) {
    std::vector<Passage> all;
    int n = 0, fence = 0, program = 0;                 // fence: its first line, 0 outside of one ...
    std::size_t section = 0;                           // its first passage
    std::string before, last, begun, info;             // ... and what that says; begun: a command that goes on
    Strings body, header;                              // of a table: each column's command
    const auto add_command = [&](const std::string& text) {
        const std::string command = begun + std::regex_replace(text, std::regex("^ +|(^| +)#.*| +$"), "");
        begun = command.ends_with('\\') ? command.substr(0, command.size() - 1) : "";
        if (begun.empty() && !command.empty()) all.push_back({Passage::command, n, last = command, program});
    };
    const auto add_images = [&](const std::string& text, const std::string& made_by) {
        static const std::regex image(R"re(!\[[^\]]*\]\(([^ )]+)( "([1-9]\d*) to 1")?\))re");
        for (std::sregex_iterator it(text.begin(), text.end(), image), end; it != end; ++it)
            all.push_back({Passage::image, n, it->str(1), program, {}, made_by,
                           it->length(3) ? std::stoi(it->str(3)) : 1});
    };
    for (const std::string& line : split(markdown, '\n')) {
        n++;
        if (line.starts_with("```") && !fence) {
            fence = n, info = line.substr(3), body.clear();
            if (info == "diff main.cpp") program = ++exercises;
            if (info == "diff main.cpp") for (std::size_t i = section; i < all.size(); i++) all[i].program = program;
        } else if (line.starts_with("```")) {
            if (info.starts_with("cpp ")) all.push_back({Passage::quote, fence, info.substr(4), program, body});
            else if (info == "diff main.cpp") all.push_back({Passage::exercise, fence, info, program, body});
            else if (info == "output") all.push_back({Passage::output, fence, info, program, body, last});
            else all.push_back({Passage::fence, fence, info, program});
            fence = 0;
        } else if (fence) {
            body.push_back(line);
            if (info == "sh") add_command(line);
        } else if (line.starts_with("|")) {
            const Strings cells = split(line, '|');
            if (!before.starts_with("|")) header.clear();  // it is the header
            const bool is_header = header.empty();
            header.resize(std::max(header.size(), cells.size()));
            for (std::size_t i = 0; i < cells.size(); i++) {
                std::smatch m;
                if (!is_header) add_images(cells[i], header[i]);
                else if (std::regex_search(cells[i], m, std::regex("`(build/umbra[^`]*)`")))
                    all.push_back({Passage::command, n, header[i] = m[1], program});
            }
        } else if (line.starts_with("    ") && (before.empty() || before.starts_with("    "))) {
            add_command(line);
        } else {
            add_images(line, last);
            if (line.starts_with("#")) program = 0, section = all.size();
        }
        before = line;
    }
    for (Passage& p : all) p.file = file;
    return all;
}

// How many lines of the quote the source has, in order and all by as much further in; "..." stands for any lines. All
// of them, or up to the first that is not there.
inline std::size_t found(const Strings& quote, const Strings& source) {
    const auto indent = [](const std::string& line) { return std::min(line.find_first_not_of(' '), line.size()); };
    const auto is_gap = [&](std::size_t i) { return quote[i].substr(indent(quote[i])) == "..."; };
    std::size_t best = 0;
    for (std::size_t start = 0; start < source.size() && best < quote.size(); start++) {
        if (indent(source[start]) < indent(quote[0])) continue;
        const std::string further(indent(source[start]) - indent(quote[0]), ' ');
        for (std::size_t at = start, done = 0; done < quote.size() && at < source.size();) {
            std::size_t n = 0;  // lines of this block, up to a gap
            while (done + n < quote.size() && at + n < source.size() && !is_gap(done + n) &&
                   source[at + n] == (quote[done + n].empty() ? "" : further + quote[done + n])) n++;
            best = std::max(best, done + n);
            if (done + n < quote.size() && is_gap(done + n)) at += n, best = std::max(best, done += n + 1);
            else if (done == 0 || best == quote.size()) break;
            else at++;  // further down
        }
    }
    return best;
}

// The source with an exercise's hunks applied; each must be there once.
inline std::string changed(const Passage& exercise, const std::string& source) {
    std::string text = '\n' + source, was = "\n", is = "\n";
    int hunk = 1, line = exercise.line, hunk_line = line + 1;
    for (const std::string& l : joined(exercise.body, {"@@"})) {
        line++;
        const char sign = l.empty() ? ' ' : l[0];
        if (sign != '@') {
            const std::string rest = l.substr(std::min<std::size_t>(1, l.size())) + '\n';
            if (sign != '+') was += rest;
            if (sign != '-') is += rest;
            continue;
        }
        const std::size_t at = text.find(was);
        if (at == text.npos || text.find(was, at + 1) != text.npos)
            throw Wrong(exercise, "exercise " + std::to_string(exercise.program) + ", hunk " + std::to_string(hunk) +
                        " stands in main.cpp " + (at == text.npos ? "nowhere" : "more than once") + ": " +
                        was.substr(1, was.find('\n', 1) - 1), hunk_line);
        text.replace(at, was.size(), is);
        was = is = "\n", hunk++, hunk_line = line + 1;
    }
    return text.substr(1);
}

struct Run {
    Outcome said;
    TGAImage framebuffer, depth;
};

// A folder in which build/umbra and obj/ are what the README means. It becomes the current one.
class Desk : public Folder {
public:
    std::map<int, std::string> programs{{0, UMBRA_BINARY}};  // and those of exercises, from 1 on

    Desk() {
        fs::create_directories(*this / "build/tests");
        link(UMBRA_OBJ_DIR, "obj");
        link(UMBRA_REPORT, "build/tests/report");
        link(UMBRA_WALK, "build/tests/walk");
        fs::current_path(path());
    }
    ~Desk() { fs::current_path(home_); }

    // The same command is run once.
    const Run& run(const std::string& command, int program = 0) {
        const auto [at, is_new] = runs_.try_emplace({program, command});
        Run& run = at->second;
        if (!is_new) return run;
        link(programs.at(program), "build/umbra");
        for (const std::string& word : split(command, ' '))  // models that the reader has
            if (word.ends_with(".obj") && word.find('/') == word.npos && !fs::exists(word)) write(word, yard());
        std::smatch option;
        std::regex_search(command, option, std::regex(" (?:-o|--output)[ =]([^ ]+)"));
        const fs::path out = option.str(1), frame = out / "framebuffer.tga", depth = out / "depth.tga";
        for (const fs::path& old : {frame, depth}) fs::remove(old);
        run.said = run_command(command);
        if (fs::exists(frame)) run.framebuffer = TGAImage::read_tga_file(frame);
        if (fs::exists(depth)) run.depth = TGAImage::read_tga_file(depth);
        return run;
    }

private:
    void link(const fs::path& target, const fs::path& name) const {
        std::error_code error;
        fs::remove(path() / name);
        fs::create_symlink(target, path() / name, error);
        if (error) fs::copy(target, path() / name, fs::copy_options::recursive);  // some systems have no links
    }
    const fs::path home_ = fs::current_path();
    std::map<std::pair<int, std::string>, Run> runs_;
};

inline Desk& desk() {
    static Desk it;
    return it;
}

// What a command draws is off by.
inline PictureError error(const std::string& command, int program = 0) {
    Strings arguments = split(command, ' ');
    arguments.erase(arguments.begin());  // build/umbra
    std::erase(arguments, "");
    const Program umbra(desk().programs.at(program));
    return Judge(umbra, arguments).error();
}

// In how many pixels two runs differ by more than so many of 255 in a channel.
inline double pixels_that_differ(const Run& a, const Run& b, int by = 0) {
    const TGAImage &p = a.framebuffer, &q = b.framebuffer;
    if (p.width() != q.width() || p.height() != q.height()) throw std::invalid_argument("two sizes");
    int n = 0;
    for (int y = 0; y < p.height(); y++)
        for (int x = 0; x < p.width(); x++) {
            int most = 0;
            for (int c = 0; c < 3; c++) most = std::max(most, std::abs(p.pixel(x, y)[c] - q.pixel(x, y)[c]));
            n += most > by;
        }
    return n;
}

// n x n pixels to one: their mean, a half rounded up.
inline TGAImage shrunk(const TGAImage& picture, int n) {
    if (picture.width() % n || picture.height() % n) throw std::invalid_argument("n to 1 leaves a rest");
    const int channels = picture.bytespp();
    TGAImage out(picture.width() / n, picture.height() / n, channels == 1 ? TGAImage::GRAYSCALE : TGAImage::RGB);
    for (int y = 0; y < out.height(); y++)
        for (int x = 0; x < out.width(); x++)
            for (int c = 0; c < channels; c++) {
                int sum = 0;
                for (int i = 0; i < n * n; i++) sum += picture.pixel(n * x + i % n, n * y + i / n)[c];
                out.pixel(x, y)[c] = static_cast<std::uint8_t>((2 * sum + n * n) / (2 * n * n));
            }
    return out;
}

inline void check_command(const Passage& p) {
    // What needs more than the project or takes long. A command of a new kind is to be looked at, so it is refused.
    for (const std::string left_out : {"cmake ", "ctest ", "convert ", "ffmpeg ", "parallel ", "umbra [options]",
                                       "build/tests/bench ", "build/tests/report --rounds ", "build/tests/stiff_test "})
        if (p.text.starts_with(left_out)) return;
    if (p.text.find("$SLURM") != p.text.npos) return;
    const std::string first = p.text.substr(0, p.text.find(' '));
    if (first == "seq" && desk().run_command("command -v seq && command -v xargs").status != 0) {
        std::printf("skipped: %s\n", p.text.c_str());
        return;
    }
    const Strings known{"build/umbra", "build/tests/report", "build/tests/walk", "printf", "seq"};
    if (std::find(known.begin(), known.end(), first) == known.end())
        throw Wrong(p, "neither run nor known to be left out: " + p.text);
    const Outcome& said = desk().run(p.text, p.program).said;
    if (said.status != 0) throw Wrong(p, p.text + ": status " + std::to_string(said.status) + ": " + said.err);
}

inline void check_image(const Passage& p, const References& references) {
    const std::string folder = "tests/reference/";
    if (!p.text.ends_with(".png") && fs::exists(UMBRA_SOURCE_DIR / fs::path(p.text))) return;
    if (!p.text.starts_with(folder) || !p.text.ends_with(".png"))
        throw Wrong(p, p.text + " is not there, or not in " + folder);
    if (!p.made_by.starts_with("build/umbra")) throw Wrong(p, "no command makes " + p.text);
    const fs::path file = references.folder / p.text.substr(folder.size());
    const Run& run = desk().run(p.made_by, p.program);
    const bool is_depth = file.filename().string().find("depth") != std::string::npos;
    const TGAImage& picture = is_depth ? run.depth : run.framebuffer;
    if (picture.empty()) throw Wrong(p, p.made_by + " draws no picture for " + p.text);
    const Bytes png = png_file(shrunk(picture, p.to_one));
    if (!references.update && fs::exists(file) && read_bytes(file) == png) return;
    const fs::path out = references.update ? file : references.failed / file.filename();
    fs::create_directories(out.parent_path());
    write_bytes(out, png);
    if (!references.update) throw Wrong(p, p.text + " is not what is drawn by " + p.made_by + ": " + out.string());
}

// What is wrong with the passages that umbra itself makes true, or with those that the exercises' programs do.
inline Strings wrong(const std::vector<Passage>& passages, bool of_exercises, const References& references) {
    Strings all;
    for (const Passage& p : passages) try {
        if (p.kind == Passage::quote && !of_exercises) {
            const std::size_t n = found(p.body, split(text_of(p.text), '\n'));
            if (n < p.body.size())
                throw Wrong(p, p.text + " does not hold: " + p.body[n], p.line + 1 + static_cast<int>(n));
        }
        if (p.kind == Passage::fence && !p.text.empty() && p.text != "sh" && p.text != "text" && !of_exercises)
            throw Wrong(p, "a fence of an unknown kind: " + p.text);
        if ((p.program > 0) != of_exercises || !desk().programs.count(p.program)) continue;
        if (p.kind == Passage::command) check_command(p);
        if (p.kind == Passage::output && split(desk().run(p.made_by, p.program).said.out, '\n') != p.body)
            throw Wrong(p, "is not what is printed by " + p.made_by);
        if (p.kind == Passage::image) check_image(p, references);
    } catch (const std::exception& e) {
        all.push_back(e.what());
    }
    return all;
}

#ifdef UMBRA_COMPILER
// Builds the exercises' programs, several at a time; says what is wrong with the others.
inline Strings build(const std::vector<Passage>& passages) {
    static std::vector<std::unique_ptr<Folder>> folders;  // as long as the programs may be run
    std::vector<Passage> exercises;
    for (const Passage& p : passages)
        if (p.kind == Passage::exercise) exercises.push_back(p);
    const std::size_t first = folders.size();
    for (std::size_t i = 0; i < exercises.size(); i++) folders.push_back(std::make_unique<Folder>());
    Strings why(exercises.size());
    parallel_for(static_cast<int>(exercises.size()), [&](int i, int) {
        const Folder& folder = *folders[first + i];
        try {
            folder.write("main.cpp", changed(exercises[i], text_of("main.cpp")));
            const Outcome o = folder.run(quoted("@" UMBRA_FLAGS) + " main.cpp " + quoted(UMBRA_LIBRARY) + " -o umbra",
                                         quoted(UMBRA_COMPILER));
            if (o.status != 0) throw Wrong(exercises[i], "the exercise does not compile: " + o.err);
        } catch (const std::exception& e) {
            why[i] = e.what();
        }
    });
    for (std::size_t i = 0; i < why.size(); i++)
        if (why[i].empty()) desk().programs[exercises[i].program] = (*folders[first + i] / "umbra").string();
    std::erase(why, "");
    return why;
}
#endif

// ---- figures ----

struct Figures {
    std::string text;  // of the README, with holes: {} for a whole number, {.2} for two decimals, {0.2} for 0.13
    std::vector<double> values;
};

// The README has no zero before the point and sets the thousands of whole numbers apart.
inline std::string filled(const Figures& f) {
    std::string text = f.text;
    for (const double value : f.values) {
        const std::size_t open = text.find('{'), close = text.find('}', open);
        const std::string hole = text.substr(open + 1, close - open - 1);
        char digits[400];
        std::snprintf(digits, sizeof digits, "%.*f", hole.empty() ? 0 : hole.back() - '0', value);
        std::string number = digits;
        if (hole.empty()) for (std::size_t i = number.size(); i > 3;) number.insert(i -= 3, 1, ' ');
        if (hole.starts_with('.') && number.starts_with("0.")) number.erase(0, 1);
        text.replace(open, close + 1 - open, number);
    }
    return text;
}

inline Strings wrong_figures(const std::string& readme, const std::vector<Figures>& figures) {
    Strings all;
    const std::string text = std::regex_replace(readme, std::regex("\\s+"), " ");
    for (const Figures& f : figures)
        if (text.find(filled(f)) == text.npos) all.push_back("README.md does not hold: " + filled(f));
    return all;
}

// The rows of a text's table whose header begins so.
inline Strings table(const std::string& file, const std::string& header) {
    Strings rows;
    for (const std::string& line : split(text_of(file), '\n'))
        if (line.starts_with(header) || (!rows.empty() && line.starts_with("|"))) rows.push_back(line);
        else if (!rows.empty()) break;
    if (rows.size() > 2) return {rows.begin() + 2, rows.end()};
    throw std::runtime_error("no table of " + file + " begins with " + header);
}

// The rows of a file of tests/reference, without its header.
inline std::vector<Strings> csv(const std::string& name) {
    std::vector<Strings> rows;
    for (const std::string& line : split(text_of("tests/reference/" + name), '\n')) {
        rows.push_back(split(line, ','));
        for (std::string& cell : rows.back()) std::erase(cell, '"');
    }
    rows.erase(rows.begin());
    return rows;
}
