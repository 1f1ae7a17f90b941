// lesson_test.cpp: nothing in README.md drifts from what the program does. `lesson_test README` is quick; the rest
// compiles the exercises. The target update_references draws the README's pictures anew.
#include "lesson.h"

#include <numbers>
#include <set>

namespace {

const References references{UMBRA_REFERENCE_DIR, fs::absolute("failed"), default_references().update};
const std::string readme = text_of("README.md");
const std::vector<Passage> passages = parsed(readme);

void report(const Strings& wrong) {
    for (const std::string& what : wrong) report_failure(__FILE__, __LINE__, what);
}

// Sentences of the README, and what is measured for them: said() is of the closing line of a run, error() what the
// judge finds, pixels_that_differ() compares two runs, csv() is a file of tests/reference.
std::vector<Figures> sentences() {
    const auto said = [](const char* name, const std::string& command = "build/umbra") {
        return value(desk().run(command).said.out, name);
    };
    const double hidden = said("hidden"), covered = hidden + said("fragments"), triangles = said("triangles");
    const double vertices = Model(UMBRA_OBJ_DIR "/idol/idol.obj").nverts();
    const std::vector<Strings> rows = csv("report.csv");
    const Strings bias = rows.at(8);  // with a buffer of 800
    const std::string fences = " --size 480x320 --shadow-size 1024 --eye -.3,1.6,1.6 --light 2,1,0"
                               " obj/fences/fences.obj";
    const std::string umbra = "build/umbra ", idol = " obj/idol/idol.obj", knot = " obj/knot/knot.obj";
    const std::string floor = umbra + "--size 400 obj/floor/floor.obj --light ";
    const auto dark = [&](const std::string& command) {
        const PictureError e = error(umbra + command);
        return e.percent(e.falsely_dark);
    };
    const auto lit = [&](const std::string& command) {
        const PictureError e = error(umbra + command);
        return e.percent(e.falsely_lit);
    };
    const double distance = std::sqrt(18.), nearer = 1 / (1 - 1 / distance), diagonal = std::sqrt(2.) * 2 / 600;
    const double tangent = pixels_that_differ(desk().run("build/umbra"), desk().run("build/umbra --tangent"), 8);
    const double steep = std::atan(.04334 / diagonal) * 180 / std::numbers::pi;
    return {
        {"Of the pixels that face the light {.1} % are lit here", {lit("--size 400 --shadow off")}},
        {"4.24 away, what is one unit nearer grows by 1 / (1 - 1/{.2}) = {.2}; three quarters of the picture times "
         "{.2} is {.2} of it", {distance, nearer, nearer, .75 * nearer}},
        {"At 800 x 800, {.1} % of what faces the light is falsely dark", {dark("--bias 0")}},
        {"at 200 texels a side it is {.1} %, at 3200 still {.1} %",
         {dark("--bias 0 --shadow-size 200"), dark("--bias 0 --shadow-size 3200")}},
        {"the diagonal of a texel is {.4} units long. A surface that rises by .04334 over that length is {} degrees "
         "steep", {diagonal, steep}},
        {"under the chin and along the collar: {.2} % falsely lit", {lit("--bias 43.34")}},
        {"On the bust {.2} % is falsely dark and {.2} % falsely lit now", {dark(""), lit("")}},
        {"{.2} % falsely dark instead of {.1} %, without any bias",
         {dark("--bias 0 --casters back"), dark("--bias 0")}},
        {"leak where their front and back lie in one texel: {.2} % are falsely lit", {lit("--bias 0 --casters back")}},
        {"derives the bias instead ({.2} % on the knot, {.2} % on the idol)",
         {error(umbra + knot).percent(), error(umbra).percent()}},
        {"off by more than 8 of 255 at {} of {} pixels ({.1} %)",
         {tangent, said("pixels"), 100 * tangent / said("pixels")}},
        {"On the idol {.2} % of what faces the light is falsely lit at 43.34, and {.2} % at 200",
         {lit("--bias 43.34"), lit("--bias 200")}},
        {"at 6400 a side it is still {.2} %", {stod(rows.at(11)[3])}},
        {"At 43.34 this light leaves {} % of the floor falsely dark; 200 cures it, and fails under `--light 1,.01,0` "
         "({} %)", {error(floor + "1,.02,0 --bias 43.34").percent(), error(floor + "1,.01,0 --bias 200").percent()}},
        {"From 43.34 to 200 the knot goes from {.2} to {.2} % falsely lit",
         {lit("--bias 43.34" + knot), lit("--bias 200" + knot)}},
        {"On the idol `--bias 0` makes {.1} % of what faces the light falsely dark, `--bias 0 --casters back` {.2} %. "
         "But now {.2} % are falsely lit",
         {dark("--bias 0"), dark("--bias 0 --casters back"), lit("--bias 0 --casters back")}},
        {"From behind, `--eye 1,1,-4`, it is {.1} %", {dark("--bias 0 --eye 1,1,-4")}},
        {"the idol's {} in the default view", {said("pixels")}},
        {"leaves out {} of {} calls of `fragment`", {hidden, covered}},
        {"others: {} of {}; {} vertices placed, not {} corners", {hidden, covered, vertices, 3 * triangles}},
        {"{} of {} faces, which cover no pixel", {said("between_samples", "build/umbra --size 100"), triangles}},
        {"the light's pass and its buffer of {.2} MB", {said("shadow_bytes") / 1e6}},
        {"is the bust above: {} triangles", {triangles}},
        {"{.2} % of what faces the light is falsely lit, {.2} % falsely dark", {stod(bias[3]), stod(bias[2])}},
        {"Of the pixels that face the light {.2} % are wrong on the left and {.1} % on the right",
         {error("build/umbra" + fences).percent(), error("build/umbra --bias 43.34" + fences).percent()}},
    };
}

// The rows of the table whose header begins so must end so, one after the other.
void check_rows(const std::string& header, const Strings& ends) {
    const Strings rows = table("tests/README.md", header);
    CHECK_EQ(rows.size(), ends.size());
    for (std::size_t i = 0; i < std::min(rows.size(), ends.size()); i++)
        CHECK_EQ(rows[i].substr(rows[i].size() - std::min(rows[i].size(), ends[i].size())), ends[i]);
}

// 4.6e-13, .0002, 58, 45 000: as the table of stiff cases has them.
std::string in_short(double x) {
    char text[32];
    std::snprintf(text, sizeof text, x > 0 && x < 1e-6 ? "%.1e" : "%.1g", x);
    if (x < 1) return *text == '0' && text[1] ? text + 1 : text;
    const double unit = std::pow(10, std::max(0., std::floor(std::log10(x)) - 1));
    return filled({"{}", {std::round(x / unit) * unit}});
}

}  // namespace

TEST("README: quotes, commands and pictures") { report(wrong(passages, false, references)); }

TEST("README: every PNG file of tests/reference is shown") {
    std::set<fs::path> shown;
    for (const Passage& p : passages)
        if (p.kind == Passage::image) shown.insert(fs::path(UMBRA_SOURCE_DIR) / p.text);
    for (const auto& entry : fs::recursive_directory_iterator(UMBRA_REFERENCE_DIR))
        if (entry.path().extension() == ".png" && !shown.count(entry.path()))
            report({"README.md does not show " + entry.path().string()});
}

TEST("README: figures in sentences") {
    report(wrong_figures(readme, sentences()));
    double off_theory = 0;  // in percent of what it predicts for --shadow map
    const std::vector<Strings> rows = csv("report.csv");
    for (int i = 0; i < 6; i++)
        off_theory = std::max(off_theory, std::fabs(stod(rows[i][16]) / stod(rows[i][15]) - 1) * 100);
    report(wrong_figures(text_of("tests/README.md"), {
        {"theory says the error is {.4} times the texel's side", {stod(rows[0][12])}},
        {"the report finds that within {} % at every size", {std::ceil(off_theory)}}}));
}

TEST("README: the table of report.csv") {
    const std::map<std::string, std::string> names{
        {"shadow map", "map"}, {"constant bias", "--bias 43.34"}, {"exact", "exact"}};
    Strings rows;
    for (const Strings& r : csv("report.csv")) {
        if (r[0] == "off") continue;
        std::vector<double> values;
        for (const int i : {2, 3, 4, 5, 6, 7}) values.push_back(stod(r[i]));
        values.push_back(stod(r[9]) / 1e6);
        rows.push_back(filled({"| `" + names.at(r[0]) + "` | " + (r[1].empty() ? "-" : r[1]) +
                               " | {0.3} | {0.3} | {0.3} | {0.2} | {0.1} | {0.1} | {0.2} |", values}));
    }
    check_rows("| method | buffer |", rows);
    for (const std::string& row : table("README.md", "| method | buffer |"))  // some of them
        if (!CHECK(std::count(rows.begin(), rows.end(), row) == 1)) std::cerr << "    " << row << '\n';
}

TEST("README: the table of lights.csv") {
    Strings rows;
    for (const Strings& r : csv("lights.csv")) {
        std::vector<double> values;
        for (const int i : {2, 3, 4, 5, 6, 7}) values.push_back(stod(r[i]));
        values.push_back(stod(r[9]) / 1e6);
        const Strings light = split(r[0].substr(0, r[0].find(',')), ' ');
        const std::string how = r[1].empty() ? "`exact` | -" : "`map` | " + r[1];
        rows.push_back(filled({"| `--" + light[0] + "`, " + light[1] + " | " + how +
                               " | {0.3} | {0.3} | {0.3} | {0.2} | {0.1} | {0.1} | {0.2} |", values}));
    }
    check_rows("| light, half angle |", rows);
}

TEST("README: the table of left_out.csv") {
    const Strings rows = table("README.md", "| scene | what is left out |");
    for (const Strings& r : csv("left_out.csv")) {
        std::string options = r[0];  // which have commas, too
        for (std::size_t i = 1; i + 1 < r.size(); i++) options += ',' + r[i];
        CHECK(std::any_of(rows.begin(), rows.end(), [&](const std::string& row) {
            return row.find("`" + options + "`") != row.npos &&
                   row.ends_with(filled({" | {.2} |", {stod(r.back())}}));
        }));
    }
}

TEST("README: the table of bench.csv") {
    const std::map<std::string, std::string> names{
        {"8640", "the knot"}, {"16000", "the idol"}, {"2492", "a head of 2 492 triangles"},
        {"159488", "the same cut into 159 488"}, {"2551808", "into 2 551 808"}};
    const std::vector<Strings> lines = csv("bench.csv");  // in turn on one thread and on two
    Strings rows;
    for (std::size_t i = 0; i + 1 < lines.size(); i += 2) {
        std::string row = "| " + names.at(lines[i][0]) + " | " + lines[i][1];
        for (const auto& [column, holes] : {std::pair(3, "{0.1} / {0.1}"), {6, "{.2} / {.2}"}, {5, "{.2} / {.2}"},
                                            {7, "{.2} / {.2}"}}) {
            const std::string &one = lines[i][column], &two = lines[i + 1][column];
            row += " | " + (one.empty() ? "-" : filled({holes, {stod(one), stod(two)}}));
        }
        rows.push_back(row + " |");
    }
    check_rows("| model | N |", rows);
}

TEST("README: the table of stiffness.csv") {
    const std::vector<Strings> lines = csv("stiffness.csv");
    Strings rows;
    for (std::size_t i = 0; i < lines.size();) {
        std::string all, breaks = "-";
        std::set<std::string> values;
        double most = 0;
        for (const std::size_t first = i; i < lines.size() && lines[i][1] == lines[first][1] &&
                                          lines[i][0] == lines[first][0]; i++) {
            const double off = stod(lines[i][3]);
            const std::string value = off == 800 ? "all" : in_short(off);  // a picture's whole side
            all += (all.empty() ? "" : ", ") + value;
            values.insert(value), most = std::max(most, off);
            char step[32];
            std::snprintf(step, sizeof step, "at %.0e", stod(lines[i][2]));
            if (breaks == "-" && lines[i][4] == "no")
                breaks = std::regex_replace(step, std::regex("e\\+?(-?)0*"), "e$1");
        }
        if (values.size() == 1) all = *values.begin() + " at each";
        else if (most < 1e-6) all = in_short(most) + " at most";
        rows.push_back(" | " + all + " | " + breaks + " |");
    }
    check_rows("| what grows |", rows);
}

TEST("README: what is not true of it is reported") {
    const Folder folder;
    const auto check = [&](const std::string& text, const std::string& begin, bool update = false) {
        const Strings all = wrong(parsed(text), false, {folder / "reference", folder / "failed", update});
        CHECK_EQ(all.size(), begin.empty() ? 0u : 1u);
        for (const std::string& what : all) CHECK_EQ(what.substr(0, begin.size()), begin);
    };
    const std::string quote = "```cpp main.cpp\nvec4 vertex(int vert) const override {\n...\n    return uniform_PM";
    check(quote + " * point(model.vert(vert));\n}\n```\n", "");
    check(quote + ";\n}\n```\n", "README.md:4: main.cpp does not hold:     return uniform_PM;");
    check("```cpp\nint i;\n```\n", "README.md:1: a fence of an unknown kind: cpp");

    check("    build/umbra --size 9 model.obj\n\n"
          "```sh\ncmake -B build  # and so on\nbuild/umbra --size \\\n  9\n```\n", "");
    check("\n    build/umbra --sise 9\n", "README.md:2: build/umbra --sise 9: status 2: umbra: unknown option");
    check("```sh\nmake umbra\n```\n", "README.md:2: neither run nor known to be left out: make umbra");

    const std::string image = "![a bust](tests/reference/new/a.png \"3 to 1\")\n", small = "    build/umbra --size ";
    const std::string in_table = "| `make`: | `build/umbra --size 9` |\n|---|---|\n| | " + image;
    check(image, "README.md:1: no command makes tests/reference/new/a.png");
    check(small + "10\n\n" + image, "n to 1 leaves a rest");
    check(small + "9 -o out --only depth\n\n" + image, "README.md:3: build/umbra --size 9 -o out --only depth draws");
    check(in_table, "README.md:3: tests/reference/new/a.png is not what is drawn by build/umbra --size 9");
    check(in_table, "", true);
    check(small + "9 -o out\n" + small + "9 -o out\n\n" + image, "");
    check(small + "9 --bias 0 --light 0,0,1\n\n" + image, "README.md:3: tests/reference/new/a.png is not what");
    check("![a chart](tests/reference/none.svg)\n", "README.md:1: tests/reference/none.svg is not there");

    const std::vector<Figures> figures{{"{} of {} calls, {.1} or {0.1} %", {1234, 1234567, .25, .25}}};
    CHECK_EQ(wrong_figures("so 1 234 of 1 234 567\n  calls, .2 or 0.2 %\n", figures).size(), 0u);
    CHECK_EQ(wrong_figures("so 1 235 of 1 234 567 calls, .2 or 0.2 %\n", figures).size(), 1u);
}

TEST("README: what walk says of a pixel is what is drawn") {
    const TGAImage& drawn = desk().run("build/umbra --draw shadow").framebuffer;
    for (const auto& [x, words] : {std::pair(470, "in shadow\n"), {440, "lit\n"}}) {
        CHECK(desk().run("build/tests/walk " + std::to_string(x) + ",439").said.out.ends_with(words));
        CHECK_EQ(int{drawn.get(x, 439)[0]}, x == 470 ? 0 : 255);
    }
}

TEST("README: pixels are averaged, and counted where runs differ") {
    TGAImage picture(4, 2, TGAImage::GRAYSCALE);
    for (const int i : {0, 1, 2}) picture.pixel(i, 0)[0] = 1;  // 2 of 4, and 1 of 4
    const TGAImage half = shrunk(picture, 2);
    CHECK(half.width() == 2 && half.height() == 1 && *half.pixel(0, 0) == 1 && *half.pixel(1, 0) == 0);
    const Run &a = desk().run("build/umbra --size 9"), &b = desk().run("build/umbra --size 9 --shadow off");
    CHECK(pixels_that_differ(a, a) == 0 && pixels_that_differ(a, b) > 0);
}

TEST("README: an exercise whose hunks are not there once is reported") {
    const auto exercise = [](const std::string& diff) { return parsed("```diff main.cpp\n" + diff + "```\n")[0]; };
    const std::string source = "one\n\ntwo\n  three\none\nfour\n";
    CHECK_EQ(changed(exercise(" one\n\n-two\n+2\n@@\n-four\n"), source), "one\n\n2\n  three\none\n");
    CHECK_THROWS(changed(exercise("-two\n@@\n   three\n-four\n"), source),
                 "README.md:4: exercise 1, hunk 2 stands in main.cpp nowhere:   three");
    CHECK_THROWS(changed(exercise("-one\n"), source),
                 "README.md:2: exercise 1, hunk 1 stands in main.cpp more than once: one");
}

#ifdef UMBRA_COMPILER
TEST("exercises: they compile, and their commands, pictures and figures are right") {
    std::vector<Passage> all = passages;
    Passage own = *std::find_if(all.begin(), all.end(), [](const Passage& p) { return p.kind == Passage::exercise; });
    for (const int constant : {15, 70}) {  // other ones in the first exercise
        all.push_back(own);
        all.back().program = 200 + constant;
        for (std::string& line : all.back().body)
            line = std::regex_replace(line, std::regex("\\b40\\b"), std::to_string(constant));
    }
    report(build(all));
    report(wrong(passages, true, references));
    const auto rmse = [](const std::string& options, int program) {
        return error("build/umbra " + options, program).rmse;
    };
    const auto percent = [](const std::string& options, int program = 0) {
        const PictureError e = error("build/umbra " + options, program);
        return e.percent(e.falsely_lit);
    };
    enum { umbra, own_bias, halo, soft_edges, second_light, closed_bodies };
    const std::string sail = "--size 400 --light 1,1,.5 obj/idol/idol.obj build/sail.obj";
    const std::string back = "--casters back " + sail;
    report(wrong_figures(readme, {
        {"40 leaves {.2} % wrong on the knot", {error("build/umbra obj/knot/knot.obj", own_bias).percent()}},
        {"70 is the best there with {.2} %", {error("build/umbra obj/knot/knot.obj", 270).percent()}},
        {"On the idol 15 is the best, with {.2} %, and 40 has {.2} %",
         {error("build/umbra", 215).percent(), error("build/umbra", own_bias).percent()}},
        {"from an RMSE of {.2} to {.2} with a buffer of 200, from {.2} to {.2} with one of 800",
         {rmse("--shadow-size 200", umbra), rmse("--shadow-size 200", soft_edges), rmse("", umbra),
          rmse("", soft_edges)}},
        {"{.1} % of what faces the light is falsely lit, and {.2} % after the change; with all faces in the buffer it "
         "is {.2} %", {percent(back), percent(back, closed_bodies), percent(sail)}}}));
}

TEST("exercises: what the classic lesson's ways come to") {
    report(build(parsed(text_of("tests/lesson/departures.md"), "departures.md", 100)));
    enum { normals = 101, uv, corners, whole_numbers, lookat };
    const auto off = [](int program) {
        return pixels_that_differ(desk().run("build/umbra", program), desk().run("build/umbra"), 8);
    };
    const auto dark = [](int program) {
        const PictureError e = error("build/umbra", program);
        return e.percent(e.falsely_dark);
    };
    const auto pixels = [](const char* command) { return value(desk().run(command).said.out, "pixels"); };
    const char *const idol = "build/umbra", *const aside = "build/umbra --center .3,.2,.1";
    const TGAImage &here = desk().run(idol).framebuffer, &there = desk().run(idol, corners).framebuffer;
    int outline = 0;
    for (int y = 0; y < here.height(); y++)
        for (int x = 0; x < here.width(); x++) outline += (here.get(x, y)[0] == 0) != (there.get(x, y)[0] == 0);
    const double moved = pixels_that_differ(desk().run(aside, lookat), desk().run(aside), 8);
    report(wrong_figures(readme, {
        {"the projection leaks into them: {.1} % of the pixels", {100 * off(normals) / pixels(idol)}},
        {"textures swim: {.2} % of the pixels", {100 * off(uv) / pixels(idol)}},
        {"{.1} % of the pixels, {} along the outline", {100 * off(corners) / pixels(idol), double(outline)}},
        {"{.2} % of what faces the light goes dark, not {.2} %", {dark(whole_numbers), dark(0)}},
        {"with the centre at (.3, .2, .1): {.1} % of the pixels", {100 * moved / pixels(aside)}}}));
}
#endif

int main(int argc, char** argv) { return run_tests(argc, argv); }
