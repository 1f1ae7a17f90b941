// fuzz_command_line.cpp: any arguments. They are refused with a word, or what comes out is within the ranges that the
// rest of the program relies on. The input is the arguments with zero bytes between them or, where it has none,
// newlines.
#include "lesson.h"
#include "fuzz.h"

#include <cmath>
#include <vector>

static bool is_finite(const vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }
static bool is_size(int n) { return n >= 1 && n <= 16384; }

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static MemoryBound bound(8192, 256);
    const std::string input(reinterpret_cast<const char*>(data), size);
    const char separator = input.find('\0') != input.npos ? '\0' : '\n';
    std::vector<std::string> words{"umbra"};
    for (std::size_t at = 0; at < input.size();) {
        const std::size_t end = std::min(input.find(separator, at), input.size());
        words.push_back(input.substr(at, end - at));
        if (words.back() == "--help" || words.back() == "--version") words.pop_back();  // they end the process
        at = end + 1;
    }
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);

    start_peak();
    try {
        const Options opt = parse(static_cast<int>(words.size()), arguments.data());
        REQUIRE(is_size(opt.width) && is_size(opt.height) && is_size(opt.shadow_size));
        REQUIRE(opt.threads >= 1 && opt.threads <= 256);
        REQUIRE(is_finite(opt.eye) && is_finite(opt.center) && is_finite(opt.up) && is_finite(opt.light));
        REQUIRE(!(opt.eye == opt.center) && !(opt.light == vec3{}));
        REQUIRE(!opt.bias || std::isfinite(*opt.bias));
        REQUIRE(!opt.models.empty());
        // What the two cameras are made of: no distance may overflow, no matrix hold anything but numbers.
        REQUIRE(std::isfinite(norm(opt.eye - opt.center)) && norm(opt.eye - opt.center) > 0);
        for (const mat4& m : {lookat(opt.eye, opt.center, opt.up), lookat(opt.light, {}, opt.up)})
            for (int i = 0; i < 16; i++) REQUIRE(std::isfinite(m[i / 4][i % 4]));
    } catch (const std::invalid_argument& e) {
        REQUIRE(*e.what());  // main() prints it as one line, whatever is in it
    }
    bound.check(peak_bytes(), size);
    return 0;
}
