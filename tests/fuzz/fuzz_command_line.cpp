// fuzz_command_line.cpp: any arguments. They are refused with status 2, or the program goes on with them: to a file
// that does not exist, which is status 1, or through both passes on a small model. The input is the arguments with zero
// bytes between them or, where it has none, newlines.
#include "fuzz.h"

#include <set>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const TemporaryFolder folder("fuzz_command_line");
    static ScratchFile model(folder / "model.obj");
    model.assign("v -1 -1 0\nv 1 -1 .5\nv 0 1 -.5\nv 0 0 1\nf 1 2 3\nf 1 2 4\n");
    static MemoryBound bound(8192, 256);
    const std::string input(reinterpret_cast<const char*>(data), size);
    const char separator = input.find('\0') != input.npos ? '\0' : '\n';
    std::vector<std::string> words{"umbra"};
    for (std::size_t at = 0; at < input.size();) {
        const std::size_t end = std::min(input.find(separator, at), input.size());
        words.push_back(input.substr(at, end - at));
        at = end + 1;
    }
    for (std::size_t i = 1; i < words.size(); i++) {  // the folders that -o makes
        const bool joined = words[i].starts_with("-o=") || words[i].starts_with("--output=");
        if (!joined && ((words[i] != "-o" && words[i] != "--output") || ++i == words.size())) continue;
        const std::size_t at = joined ? words[i].find('=') + 1 : 0;
        if (at == words[i].size()) continue;
        std::replace(words[i].begin(), words[i].end(), '/', '_');
        words[i].insert(at, (folder / "").string());
    }
    // A missing file stands first, so that the words' own files are not read and their pictures not drawn ...
    std::vector<std::string> missing = words;
    missing.insert(missing.begin() + 1, (folder / "missing.obj").string());
    start_peak();
    const int status = run_umbra(missing);
    bound.check(peak_bytes(), size);
    REQUIRE(status >= 0 && status <= 2);
    if (status != 1) return 0;

    // ... and what is accepted draws the model: the last value of an option counts. After -- there are models alone.
    static const std::set<std::string> flags{"--tangent", "--no-fit", "--show", "--quiet", "-q"};
    std::vector<std::string> drawing;
    for (std::size_t i = 0; i < words.size() && words[i] != "--"; i++) {
        drawing.push_back(words[i]);
        const bool is_option = words[i].starts_with('-') && words[i].size() > 1;
        const bool takes_next = words[i].find('=') == std::string::npos && !flags.contains(words[i]);
        const bool is_model = (i > 0 && !is_option) || words[i] == "--sky";
        if (is_option && takes_next) drawing.push_back(words[++i]);
        if (is_model) drawing.back() = model.path().string();
        if (drawing.back().starts_with("--sky=")) drawing.back() = "--sky=" + model.path().string();
        if (i == 0) drawing.push_back(model.path().string());  // for --at and its like
    }
    for (const char* word : {"--size", "9x7", "--shadow-size", "5", "--frames", "1", "--threads", "2", "--quiet", "-o"})
        drawing.push_back(word);
    drawing.push_back(folder.path().string());
    drawing.push_back(model.path().string());
    REQUIRE(run_umbra(drawing) == 0);
    return 0;
}
