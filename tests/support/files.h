// files.h: what tests of files need: a folder of their own, and whole files as bytes.
#pragma once
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

using Bytes = std::vector<std::uint8_t>;

// A new, empty folder in the system's temporary one; it goes with the object, and everything in it.
class TemporaryFolder {
public:
    explicit TemporaryFolder(const std::string& name) {
        const std::filesystem::path base = std::filesystem::temp_directory_path();
        for (int i = 0;; i++) {
            path_ = base / ("umbra_" + name + "_" + std::to_string(i));
            if (std::filesystem::create_directory(path_)) return;  // false where another run's folder stands
        }
    }
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
    const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
};

inline Bytes read_bytes(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in) throw std::runtime_error(path.string() + ": cannot open");
    return Bytes(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
}

// The file is made anew: some file systems wait for the disk when an old one is cut and written again.
inline void write_bytes(const std::filesystem::path& path, const Bytes& bytes) {
    std::filesystem::remove(path);
    std::ofstream out(path, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    out.close();
    if (!out) throw std::runtime_error(path.string() + ": cannot write");
}
