// check.h: the whole test framework. A test is a block with a name; a check prints both values when it fails.
//
//     TEST("a vector has a length") { CHECK_NEAR(norm(vec3{3, 4, 0}), 5, 1e-15); }
//     int main(int argc, char** argv) { return run_tests(argc, argv); }
//
// An executable runs all its tests, or only those whose name contains its first argument; its status is 0 when at least
// one test ran and every check of every test held.
#pragma once
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <functional>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

// Where the address sanitizer watches, some cases would need more time or memory than they are worth.
#if defined(__SANITIZE_ADDRESS__)
#define UMBRA_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define UMBRA_SANITIZED 1
#endif
#endif

struct Test {
    const char* name;
    std::function<void()> body;
};

inline std::vector<Test>& all_tests() {
    static std::vector<Test> tests;
    return tests;
}

inline int& failed_checks() {
    static int n = 0;
    return n;
}

struct Registration {
    Registration(const char* name, std::function<void()> body) { all_tests().push_back({name, std::move(body)}); }
};

#define CHECK_JOIN2(a, b) a##b
#define CHECK_JOIN(a, b) CHECK_JOIN2(a, b)
#define TEST_NAMED(name, id)                                          \
    static void CHECK_JOIN(test_, id)();                              \
    static const Registration CHECK_JOIN(registration_, id){name, CHECK_JOIN(test_, id)}; \
    static void CHECK_JOIN(test_, id)()
#define TEST(name) TEST_NAMED(name, __LINE__)

template <typename T>
std::string shown(const T& value) {
    std::ostringstream out;
    out.precision(17);
    out << value;
    return out.str();
}

inline bool report_failure(const char* file, int line, const std::string& what) {
    if (++failed_checks() <= 50) std::cerr << file << ':' << line << ": " << what << '\n';  // enough to see the pattern
    return false;
}

#define CHECK(condition) ((condition) ? true : report_failure(__FILE__, __LINE__, "failed: " #condition))
#define CHECK_EQ(a, b)                                                                                                  \
    [&](const auto& left_, const auto& right_) {                                                                        \
        return left_ == right_ ? true                                                                                   \
                               : report_failure(__FILE__, __LINE__, std::string(#a " == " #b ": ") + shown(left_) +     \
                                                                        " is not " + shown(right_));                    \
    }(a, b)
#define CHECK_NEAR(a, b, tolerance)                                                                                     \
    [&](double left_, double right_, double tolerance_) {                                                               \
        return std::fabs(left_ - right_) <= tolerance_                                                                  \
                   ? true                                                                                               \
                   : report_failure(__FILE__, __LINE__, std::string(#a " near " #b ": ") + shown(left_) + " and " +     \
                                                            shown(right_) + " differ by " +                             \
                                                            shown(std::fabs(left_ - right_)) + " > " + shown(tolerance_)); \
    }(a, b, tolerance)
// The statement must throw; the message must contain the text.
#define CHECK_THROWS(statement, text)                                                                                   \
    [&] {                                                                                                               \
        try {                                                                                                           \
            statement;                                                                                                  \
        } catch (const std::exception& e) {                                                                             \
            return std::strstr(e.what(), text) ? true                                                                   \
                                               : report_failure(__FILE__, __LINE__, std::string("threw \"") + e.what() + \
                                                                                        "\", not \"" + text + "\"");    \
        }                                                                                                               \
        return report_failure(__FILE__, __LINE__, "did not throw: " #statement);                                        \
    }()

inline int run_tests(int argc, char** argv) {
    const char* only = argc > 1 ? argv[1] : "";
    int ran = 0, failed = 0;
    for (const Test& test : all_tests()) {
        if (!std::strstr(test.name, only)) continue;
        ran++;
        const int before = failed_checks();
        try {
            test.body();
        } catch (const std::exception& e) {
            report_failure(test.name, 0, std::string("unexpected exception: ") + e.what());
        }
        const bool ok = failed_checks() == before;
        failed += !ok;
        std::printf("%s %s\n", ok ? "ok    " : "FAILED", test.name);
        std::fflush(stdout);
    }
    std::printf("%d tests, %d failed, %d checks failed\n", ran, failed, failed_checks());
    return ran > 0 && failed == 0 ? 0 : 1;
}
