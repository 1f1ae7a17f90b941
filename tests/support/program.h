// program.h: runs the program that a report or a gate judges, and reads the values that it prints.
#pragma once
#include "files.h"

#include <cstdlib>
#include <map>
#include <sstream>

using Arguments = std::vector<std::string>;
using Values = std::map<std::string, double>;

inline double value_of(const Values& values, const std::string& name) {
    const auto v = values.find(name);
    if (v == values.end()) throw std::runtime_error("umbra does not say " + name);
    return v->second;
}

inline Arguments joined(Arguments a, const Arguments& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

// A run that failed: what the program wrote to standard error, and its status.
struct ProgramFailed : std::runtime_error {
    int status;
    ProgramFailed(const std::string& said, int s) : std::runtime_error(said), status(s) {}
};

class Program {
public:
    explicit Program(std::string binary) : binary_(std::move(binary)), folder_("program") {}

    // Its pictures and whatever else a run needs.
    const TemporaryFolder& folder() const { return folder_; }

    // Runs it and returns what it says, value by name. Throws ProgramFailed.
    Values run(const Arguments& arguments) const {
        const std::filesystem::path said = folder_ / "said", complained = folder_ / "complained";
        std::string command = quoted(binary_);
        for (const std::string& argument : joined(arguments, {"-o", folder_.path().string()}))
            command.append(" ").append(quoted(argument));
        const int raw =
            std::system((command + " >" + quoted(said.string()) + " 2>" + quoted(complained.string())).c_str());
        if (raw != 0)
            throw ProgramFailed(contents(complained), raw > 255 ? raw >> 8 : raw);  // POSIX keeps it in the high byte
        Values values;
        std::istringstream words(contents(said));
        for (std::string name, value; words >> name >> value;) {  // name value name value ...
            char* end = nullptr;
            const double number = std::strtod(value.c_str(), &end);
            if (*end == 0) values[name] = number;
        }
        return values;
    }

private:
    static std::string quoted(const std::string& argument) {  // for a POSIX shell
        std::string out = "'";
        for (const char c : argument) out += c == '\'' ? "'\\''" : std::string(1, c);
        return out + "'";
    }
    static std::string contents(const std::filesystem::path& path) {
        const Bytes bytes = read_bytes(path);
        return {bytes.begin(), bytes.end()};
    }
    std::string binary_;
    TemporaryFolder folder_;
};
