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
    void (*body)();
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
    Registration(const char* name, void (*body)()) { all_tests().push_back({name, body}); }
};

#define CHECK_JOIN2(a, b) a##b
#define CHECK_JOIN(a, b) CHECK_JOIN2(a, b)
#define TEST_NAMED(name, id)                                                              \
    static void CHECK_JOIN(test_, id)();                                                  \
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

template <typename A, typename B>
bool is_equal_or_report(const A& a, const B& b, const char* file, int line, const char* text) {
    return a == b || report_failure(file, line, text + (": " + shown(a)) + " is not " + shown(b));
}

inline bool is_near_or_report(double a, double b, double most, const char* file, int line, const char* text) {
    const double d = std::fabs(a - b);
    if (d <= most) return true;
    const std::string values = shown(a) + " and " + shown(b);
    return report_failure(file, line, text + (": " + values) + " differ by " + shown(d) + " > " + shown(most));
}

template <typename Body>
bool throws_or_report(const Body& body, const char* wanted, const char* file, int line, const char* text) {
    try {
        body();
    } catch (const std::exception& e) {
        const std::string what = e.what();
        return what.find(wanted) != what.npos || report_failure(file, line, "threw " + what + ", not " + wanted);
    }
    return report_failure(file, line, std::string("did not throw: ") + text);
}

#define CHECK(condition) ((condition) ? true : report_failure(__FILE__, __LINE__, "failed: " #condition))
#define CHECK_EQ(a, b) is_equal_or_report(a, b, __FILE__, __LINE__, #a " == " #b)
#define CHECK_NEAR(a, b, tolerance) is_near_or_report(a, b, tolerance, __FILE__, __LINE__, #a " near " #b)
// The statement must throw; the message must contain the text.
#define CHECK_THROWS(statement, text) throws_or_report([&] { statement; }, text, __FILE__, __LINE__, #statement)

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
