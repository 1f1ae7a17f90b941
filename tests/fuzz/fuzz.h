// fuzz.h: what the fuzzers share: a check that ends the process, files that are rewritten for each input, and messages.
// A fuzzer is one function, LLVMFuzzerTestOneInput; libFuzzer or standalone.cpp calls it with one input after the
// other.
#pragma once
#include "files.h"
#include "peak.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

// A fault ends the process at once: that is how libFuzzer learns of it and keeps the input.
#define REQUIRE(condition)                                                                             \
    do {                                                                                               \
        if (!(condition)) {                                                                            \
            std::fprintf(stderr, "%s:%d: required: %s\n", __FILE__, __LINE__, #condition);             \
            std::abort();                                                                              \
        }                                                                                              \
    } while (false)

[[noreturn]] inline void refuse(const std::string& what) {
    std::fprintf(stderr, "%s\n", what.c_str());
    std::abort();
}

int umbra_main(int argc, char** argv);  // main.cpp, compiled under this name: the whole program in this process

inline int run_umbra(std::vector<std::string> words) {
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    return umbra_main(static_cast<int>(words.size()), arguments.data());
}

// A message for the user is one line: not empty, and nothing in it that moves the cursor.
inline bool is_one_line(const std::string& message) {
    return !message.empty() && std::none_of(message.begin(), message.end(), [](char c) {
        return static_cast<unsigned char>(c) < ' ' || c == 127;
    });
}

// A file that is kept open and rewritten for each input, which is quicker than making it anew.
class ScratchFile {
public:
    explicit ScratchFile(std::filesystem::path path)
        : path_(std::move(path)), file_(std::fopen(path_.string().c_str(), "w+b")) {
        if (!file_) refuse(path_.string() + ": cannot be made");
        std::setvbuf(file_, nullptr, _IONBF, 0);
    }
    ~ScratchFile() {
        std::fclose(file_);
        std::error_code ignored;
        std::filesystem::remove(path_, ignored);
    }
    ScratchFile(const ScratchFile&) = delete;
    ScratchFile& operator=(const ScratchFile&) = delete;

    void assign(const std::uint8_t* data, std::size_t size) {
        std::rewind(file_);
        if (size > 0 && std::fwrite(data, 1, size, file_) != size) refuse(path_.string() + ": cannot be written");
        if (size < size_) std::filesystem::resize_file(path_, size);
        size_ = size;
    }
    void assign(const std::string& text) { assign(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()); }
    const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
    std::FILE* file_;
    std::size_t size_ = 0;
};

// Holds what one call takes to fixed + factor * size bytes, and says at the end what the worst input needed of it.
class MemoryBound {
public:
    MemoryBound(std::size_t fixed, std::size_t factor) : fixed_(fixed), factor_(factor) {}
    ~MemoryBound() {
        std::fprintf(stderr, "memory: at most %zu bytes; beyond %zu at most %.1f times the input\n", most_, fixed_,
                     worst_);
    }
    MemoryBound(const MemoryBound&) = delete;
    MemoryBound& operator=(const MemoryBound&) = delete;

    void check(std::size_t taken, std::size_t size) {
        most_ = std::max(most_, taken);
        if (taken > fixed_ && size > 0)
            worst_ = std::max(worst_, static_cast<double>(taken - fixed_) / static_cast<double>(size));
        if (taken > fixed_ + factor_ * size)
            refuse("an input of " + std::to_string(size) + " bytes took " + std::to_string(taken) + " bytes of memory");
    }

private:
    std::size_t fixed_, factor_, most_ = 0;
    double worst_ = 0;
};
