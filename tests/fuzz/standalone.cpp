// standalone.cpp: runs a fuzzer over files, for compilers without libFuzzer and for CTest: each file named as an
// argument, and each file of each folder. It makes no inputs of its own. The status is 0 where there was an input and
// none failed.
#include "fuzz.h"

#include <vector>

int main(int argc, char** argv) {
    namespace fs = std::filesystem;
    std::vector<fs::path> files;
    for (int i = 1; i < argc; i++) {
        if (!fs::is_directory(argv[i])) {
            files.emplace_back(argv[i]);
            continue;
        }
        for (const fs::directory_entry& entry : fs::directory_iterator(argv[i])) files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    for (const fs::path& file : files) {
        std::printf("%s\n", file.filename().string().c_str());
        std::fflush(stdout);  // the last line names the input that failed
        const Bytes bytes = read_bytes(file);
        LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
    }
    std::printf("%zu inputs\n", files.size());
    return files.empty() ? 1 : 0;
}
