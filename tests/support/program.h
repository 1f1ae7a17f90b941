// program.h: runs the program that a report or a gate judges, and reads the values that it prints.
#pragma once
#include "files.h"

#include <cstdlib>
#include <map>
#include <sstream>

using Values = std::map<std::string, double>;

inline double value_of(const Values& values, const std::string& name) {
    const auto v = values.find(name);
    if (v == values.end()) throw std::runtime_error("umbra does not say " + name);
    return v->second;
}

inline std::string quoted(const std::string& argument) {  // for a POSIX shell
    std::string out = "'";
    for (const char c : argument) out += c == '\'' ? "'\\''" : std::string(1, c);
    return out + "'";
}

class Program {
public:
    explicit Program(std::string binary) : binary_(std::move(binary)), folder_("program") {}

    // Its pictures and whatever else a run needs.
    const TemporaryFolder& folder() const { return folder_; }

    // Runs it and returns what it says, value by name. Throws std::runtime_error where it fails.
    Values run(const std::string& arguments) const {
        const std::filesystem::path said = folder_ / "said", complained = folder_ / "complained";
        const std::string command = quoted(binary_) + " -o " + quoted(folder_.path().string()) + " " + arguments;
        if (std::system((command + " >" + quoted(said.string()) + " 2>" + quoted(complained.string())).c_str()) != 0)
            throw std::runtime_error("failed: " + command + "\n" + contents(complained));
        Values values;
        std::istringstream lines(contents(said));
        for (std::string line; std::getline(lines, line);) {  // name value name value ...
            std::istringstream words(line);
            for (std::string name, value; words >> name >> value;) {
                char* end = nullptr;
                const double number = std::strtod(value.c_str(), &end);
                if (*end == 0) values[name] = number;
            }
        }
        return values;
    }

private:
    static std::string contents(const std::filesystem::path& path) {
        const Bytes bytes = read_bytes(path);
        return {bytes.begin(), bytes.end()};
    }
    std::string binary_;
    TemporaryFolder folder_;
};
