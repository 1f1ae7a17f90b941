// faults_test.cpp: the program on a full disk, in folders it may not write to, and killed at any moment. Whatever happens,
// a picture in the folder is a whole one, old or new. Not about what the pictures show.
#include "check.h"
#include "files.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <map>
#include <optional>
#include <thread>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#ifdef __linux__
#include <sched.h>
#include <sys/mount.h>
#endif

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

namespace {

// ---- the program as a child ----

[[noreturn]] void fail(const std::string& what) { throw std::runtime_error(what + ": " + std::strerror(errno)); }

class Child {
public:
    // Runs umbra in the folder. PREPARE is called in the child, before the program takes its place.
    template <typename Prepare>
    Child(const fs::path& folder, const std::vector<std::string>& arguments, const Prepare& prepare) {
        // Opened here: a child that gives up its rights may not reach the program by its path.
        static const int program = open(UMBRA_BINARY, O_RDONLY | O_CLOEXEC);
        if (program < 0) fail(UMBRA_BINARY);
        std::vector<std::string> words{UMBRA_BINARY, "--quiet"};
        words.insert(words.end(), arguments.begin(), arguments.end());
        std::vector<char*> argv;
        for (std::string& word : words) argv.push_back(word.data());
        argv.push_back(nullptr);
        int ends[2];
        if (pipe(ends)) fail("pipe");
        pid_ = fork();
        if (pid_ < 0) fail("fork");
        if (pid_ == 0) {
            alarm(120);  // nothing may wait for ever
            dup2(open("/dev/null", O_WRONLY), STDOUT_FILENO);
            dup2(ends[1], STDERR_FILENO);
            close(ends[0]);
            close(ends[1]);
            if (chdir(folder.c_str()) == 0 && prepare()) fexecve(program, argv.data(), environ);
            const std::string what = std::string("the child cannot start: ") + std::strerror(errno);
            _exit(write(STDERR_FILENO, what.data(), what.size()) < 0 ? 126 : 127);
        }
        close(ends[1]);
        errors_ = ends[0];
    }
    ~Child() {
        if (running()) {
            kill();
            waitpid(pid_, nullptr, 0);
        }
        close(errors_);
    }
    Child(const Child&) = delete;
    Child& operator=(const Child&) = delete;

    void kill() const { ::kill(pid_, SIGKILL); }
    bool running() {
        int status;
        if (!status_ && waitpid(pid_, &status, WNOHANG) == pid_) status_ = status;
        return !status_;
    }
    struct Outcome {
        int status;  // as waitpid has it
        std::string text;
        bool drawn() const { return status == 0 && text.empty(); }
        // It ended by itself with status 1 and one line, which begins with the file and ends with the reason.
        bool refused(const std::string& file, const std::string& reason) const {
            const std::string begin = "umbra: " + file, end = reason + '\n';
            const bool ok = WIFEXITED(status) && WEXITSTATUS(status) == 1 && text.rfind(begin, 0) == 0 &&
                            text.find('\n') + 1 == text.size() && text.size() >= end.size() &&
                            text.compare(text.size() - end.size(), end.size(), end) == 0;
            return ok || (std::cerr << "    status " << status << ", " << text << '\n', false);
        }
    };
    Outcome end() {
        int status = 0;
        if (!status_ && waitpid(pid_, &status, 0) != pid_) fail("waitpid");
        if (!status_) status_ = status;
        std::string text;
        char part[4096];
        for (ssize_t n; (n = read(errors_, part, sizeof part)) > 0;) text.append(part, static_cast<std::size_t>(n));
        return {*status_, text};
    }

private:
    pid_t pid_;
    int errors_;
    std::optional<int> status_;
};

bool as_it_is() { return true; }

// At most that many bytes in a file. A write beyond them fails, or ends the program with the signal.
auto file_size_limit(std::size_t bytes, bool deadly) {
    return [=] {
        const rlimit limit{bytes, bytes}, no_core{0, 0};
        return std::signal(SIGXFSZ, deadly ? SIG_DFL : SIG_IGN) != SIG_ERR && setrlimit(RLIMIT_CORE, &no_core) == 0 &&
               setrlimit(RLIMIT_FSIZE, &limit) == 0;
    };
}

// Root may write everywhere, so it becomes nobody.
bool without_rights() { return geteuid() != 0 || (setgid(65534) == 0 && setuid(65534) == 0); }

// ---- folders and pictures ----

using Contents = std::map<std::string, Bytes>;

Contents contents(const fs::path& folder) {  // what is no regular file has no bytes here
    Contents all;
    for (const auto& entry : fs::directory_iterator(folder)) {
        const bool regular = fs::is_regular_file(entry.symlink_status());
        all[entry.path().filename().string()] = regular ? read_bytes(entry.path()) : Bytes{};
    }
    return all;
}

std::string names(const Contents& all) {
    std::string text;
    for (const auto& [name, bytes] : all) text += name + ' ';
    return text;
}

// A sheet of waves: shades that no run-length code makes short, and depths too.
void write_model(const fs::path& path) {
    constexpr int n = 32;  // faces enough for seven threads
    std::ofstream out(path);
    for (int y = 0; y <= n; y++)
        for (int x = 0; x <= n; x++)
            out << "v " << 2. * x / n - 1 << ' ' << 2. * y / n - 1 << ' ' << .1 * ((x * x + 3 * y) % 5) << '\n';
    for (int y = 0; y < n; y++)
        for (int x = 0, v = y * (n + 1) + 1; x < n; x++, v++)
            out << "f " << v << ' ' << v + 1 << ' ' << v + n + 2 << ' ' << v + n + 1 << '\n';
    out.close();
    if (!out) throw std::runtime_error(path.string() + ": cannot write");
}

// A folder with a model and, in it, a folder for the pictures.
struct Stage : TemporaryFolder {
    const fs::path out = path() / "out";
    std::vector<std::string> size;  // the options that say it

    Stage(int side, int shadow_side)
        : TemporaryFolder("faults_test"),
          size{"--size", std::to_string(side) + 'x' + std::to_string(side), "--shadow-size", std::to_string(shadow_side)} {
        fs::create_directory(out);
        write_model(path() / "waves.obj");
        const fs::perms all_read = fs::perms::owner_all | fs::perms::group_read | fs::perms::group_exec |
                                   fs::perms::others_read | fs::perms::others_exec;
        fs::permissions(path(), all_read);
        fs::permissions(path() / "waves.obj", all_read);
    }
    ~Stage() { fs::permissions(out, fs::perms::owner_all); }

    std::vector<std::string> arguments(const char* light, const std::string& folder = "out") const {
        std::vector<std::string> words{"-o", folder, "--light", light, "--threads", "2", "waves.obj"};
        words.insert(words.end(), size.begin(), size.end());
        return words;
    }
    Contents draw(const char* light) const {
        CHECK(Child(path(), arguments(light), as_it_is).end().drawn());
        return contents(out);
    }
    void put(const Contents& pictures) const {  // and nothing else
        for (const auto& entry : fs::directory_iterator(out)) fs::remove(entry.path());
        for (const auto& [name, bytes] : pictures) write_bytes(out / name, bytes);
    }
};

constexpr const char *old_light = "1,1,2", *new_light = "-1,2,1";

struct Pair {
    Contents before, after;
    explicit Pair(const Stage& stage) : before(stage.draw(old_light)), after(stage.draw(new_light)) {
        CHECK_EQ(before.size(), 2u);
        CHECK_EQ(after.size(), 2u);
        CHECK(before.count("depth.tga") && before.count("framebuffer.tga"));
        CHECK(before.at("depth.tga") != after.at("depth.tga"));
        CHECK(before.at("framebuffer.tga") != after.at("framebuffer.tga"));
        stage.put(before);
    }
    // Each picture is the old one or the new one; nothing else is there, but PARTs where a killed run may leave them.
    bool whole(const Contents& now, bool parts_allowed = false) const {
        bool ok = true;
        for (const auto& [name, bytes] : now)
            ok = ok && (before.count(name) ? bytes == before.at(name) || bytes == after.at(name)
                                           : parts_allowed && fs::path(name).extension() == ".part");
        for (const auto& [name, bytes] : before) ok = ok && now.count(name);
        return ok || (std::cerr << "    in the folder: " << names(now) << '\n', false);
    }
};

// Among earlier pictures, a run that cannot write FILE.
template <typename Prepare>
void check_refused(const Stage& stage, const Pair& pair, const std::string& file, const std::string& reason,
                   const Prepare& prepare) {
    CHECK(Child(stage.path(), stage.arguments(new_light), prepare).end().refused("out/" + file + ": cannot write: ", reason));
    const Contents now = contents(stage.out);
    CHECK_EQ(names(now), names(pair.before));
    CHECK(now == pair.before);
}

}  // namespace

// ---- a full disk ----

TEST("a file that cannot grow is one error line") {
    const Stage stage(150, 100);
    const Pair pair(stage);
    const std::size_t depth = pair.after.at("depth.tga").size(), frame = pair.after.at("framebuffer.tga").size();
    CHECK(depth > 1000 && frame > depth + 1000);
    const auto check = [&](const char* file, std::size_t limit) {
        stage.put(pair.before);
        check_refused(stage, pair, file, "File too large", file_size_limit(limit, false));
    };
    for (const std::size_t limit : {std::size_t{0}, std::size_t{1}, std::size_t{17}, depth / 2, depth - 1}) check("depth.tga", limit);
    for (const std::size_t limit : {depth, (depth + frame) / 2, frame - 1}) check("framebuffer.tga", limit);
    CHECK(Child(stage.path(), stage.arguments(new_light), file_size_limit(frame, false)).end().drawn());
    CHECK(contents(stage.out) == pair.after);
}

TEST("an empty folder stays empty") {
    const Stage stage(150, 100);
    CHECK(Child(stage.path(), stage.arguments(new_light), file_size_limit(100, false)).end().refused("out/depth.tga: ", "File too large"));
    CHECK(fs::is_empty(stage.out));
}

#ifdef __linux__
namespace {

bool write_text(const char* path, const std::string& text) {
    std::ofstream out(path);
    out << text << std::flush;
    return static_cast<bool>(out);
}

// A disk of that many bytes that only this process and its children see. Not everyone may mount one.
bool mount_small_disk(const fs::path& at, int bytes) {
    const std::string uid = std::to_string(geteuid()), gid = std::to_string(getegid());
    const bool apart = unshare(CLONE_NEWNS) == 0 ||
                       (unshare(CLONE_NEWUSER | CLONE_NEWNS) == 0 && write_text("/proc/self/setgroups", "deny") &&
                        write_text("/proc/self/uid_map", "0 " + uid + " 1") &&
                        write_text("/proc/self/gid_map", "0 " + gid + " 1"));
    return apart && mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
           mount("tmpfs", at.c_str(), "tmpfs", 0, ("size=" + std::to_string(bytes)).c_str()) == 0;
}

// Fills the disk but for that many bytes.
void fill(const fs::path& file, std::size_t free_bytes) {
    const std::size_t there = fs::space(file.parent_path()).available;
    if (there > free_bytes) write_bytes(file, Bytes(there - free_bytes, 1));
}

// From no free page to enough for both pictures. Whichever of them does not fit, the earlier ones are there.
void check_full_disk(const Stage& stage, const Pair& pair) {
    constexpr std::size_t page = 4096;  // what tmpfs gives out
    std::size_t refusals = 0, free_pages = 0;
    for (bool drawn = false; !drawn && free_pages < 1000; free_pages++) {
        stage.put(pair.before);
        fill(stage.out / "filler", free_pages * page);
        CHECK_EQ(fs::space(stage.out).available, free_pages * page);
        const Child::Outcome outcome = Child(stage.path(), stage.arguments(new_light), as_it_is).end();
        fs::remove(stage.out / "filler");
        const Contents now = contents(stage.out);
        drawn = outcome.drawn();
        if (drawn) CHECK(now == pair.after);
        else CHECK(outcome.refused("out/", ".tga: cannot write: No space left on device") && now == pair.before);
        refusals += !drawn;
    }
    CHECK(refusals > 2 && free_pages == refusals + 1);
}

}  // namespace
#endif

TEST("a full disk is one error line") {
#ifdef __linux__
    const Stage stage(100, 80);
    const Pair pair(stage);
    const pid_t pid = fork();  // the mount ends with this child
    if (pid < 0) fail("fork");
    if (pid == 0) {
        if (!mount_small_disk(stage.out, 1 << 20)) _exit(2);
        try {
            check_full_disk(stage, pair);
        } catch (const std::exception& e) {
            CHECK_EQ(e.what(), std::string());
        }
        _exit(failed_checks() ? 1 : 0);
    }
    int status = 0;
    if (waitpid(pid, &status, 0) != pid) fail("waitpid");
    if (WIFEXITED(status) && WEXITSTATUS(status) == 2) std::cout << "skipped: a full disk: mounting one is not permitted here\n";
    else CHECK_EQ(status, 0);
#else
    std::cout << "skipped: a full disk: it is mounted in a namespace, which Linux alone has\n";
#endif
}

TEST("a temporary file on a full device is one error line") {
    const Stage stage(60, 50);
    const Pair pair(stage);
    for (const char* file : {"depth.tga", "framebuffer.tga"}) {
        if (!fs::is_character_file("/dev/full")) {
            std::cout << "skipped: " << file << " on a full device: there is no /dev/full\n";
            continue;
        }
        stage.put(pair.before);
        fs::create_symlink("/dev/full", stage.out / (std::string(file) + ".part"));
        CHECK(Child(stage.path(), stage.arguments(new_light), as_it_is)
                  .end()
                  .refused("out/" + std::string(file) + ": cannot write: ", "No space left on device"));
        CHECK(contents(stage.out) == pair.before);
    }
}

// ---- folders ----

TEST("a folder that is not there or a file is one error line") {
    const Stage stage(60, 50);
    const Pair pair(stage);
    const auto refused = [&](const std::string& folder, const char* reason) {
        return Child(stage.path(), stage.arguments(new_light, folder), as_it_is)
            .end()
            .refused(folder + "/depth.tga: cannot write: ", reason);
    };
    CHECK(refused("nowhere", "No such file or directory"));
    CHECK(refused("waves.obj", "Not a directory"));
    CHECK(refused("out/depth.tga", "Not a directory"));
    CHECK(contents(stage.out) == pair.before);
    CHECK_EQ(contents(stage.path()).size(), 2u);
}

TEST("a folder without the right to write is one error line") {
    const Stage stage(60, 50);
    const Pair pair(stage);
    fs::permissions(stage.out, fs::perms::owner_read | fs::perms::owner_exec | fs::perms::others_read | fs::perms::others_exec);
    check_refused(stage, pair, "depth.tga", "Permission denied", without_rights);
    fs::permissions(stage.out, fs::perms::none);
    CHECK(Child(stage.path(), stage.arguments(new_light), without_rights).end().refused("out/depth.tga: cannot write: ", "Permission denied"));
    fs::permissions(stage.out, fs::perms::owner_all);
    CHECK(contents(stage.out) == pair.before);
}

TEST("what stands in a picture's place and is no file stays there") {
    const Stage stage(60, 50);
    const Pair pair(stage);
    for (const char* file : {"depth.tga", "framebuffer.tga"}) {
        const fs::path place = stage.out / file;
        const auto check = [&](const auto& make, bool (*still_there)(const fs::path&)) {
            stage.put(pair.before);
            fs::remove(place);
            make();
            const Contents before = contents(stage.out);
            const Child::Outcome outcome = Child(stage.path(), stage.arguments(new_light), as_it_is).end();
            CHECK(outcome.refused("out/" + std::string(file) + ": cannot write: ", "it is not a regular file"));
            CHECK(still_there(place));
            CHECK(contents(stage.out) == before);
        };
        check([&] { fs::create_directory(place); }, [](const fs::path& p) { return fs::is_directory(p); });
        check([&] { CHECK_EQ(mkfifo(place.c_str(), 0600), 0); }, [](const fs::path& p) { return fs::is_fifo(p); });
        check([&] { fs::create_symlink("/dev/null", place); }, [](const fs::path& p) { return fs::is_symlink(p); });
    }
}

TEST("a link in a picture's place becomes the picture, and what it led to stays") {
    const Stage stage(60, 50);
    const Pair pair(stage);
    const Bytes letter{'a', ' ', 'l', 'e', 't', 't', 'e', 'r'};
    write_bytes(stage / "letter", letter);
    fs::remove(stage.out / "framebuffer.tga");
    fs::create_symlink("../letter", stage.out / "framebuffer.tga");
    CHECK(stage.draw(new_light) == pair.after);
    CHECK(read_bytes(stage / "letter") == letter);
}

// ---- too few threads ----

// Where other processes of this user fill the limit, no thread at all can be started.
TEST("fewer threads than asked for draw the same pictures") {
    const Stage stage(60, 50);
    const Pair pair(stage);
    for (rlim_t limit = 1; limit <= 9; limit++) {
        stage.put(pair.before);
        fs::permissions(stage.out, fs::perms::all);
        std::vector<std::string> arguments = stage.arguments(new_light);
        arguments.insert(arguments.end(), {"--threads", "7", "--report"});
        const auto few_threads = [limit] {
            const rlimit most{limit, limit};
            setenv("ASAN_OPTIONS", "detect_leaks=0", 1);  // the search for leaks needs a process of its own
            return without_rights() && setrlimit(RLIMIT_NPROC, &most) == 0;
        };
        const Child::Outcome outcome = Child(stage.path(), arguments, few_threads).end();
        CHECK_EQ(outcome.status, 0);
        CHECK_EQ(outcome.text, "");
        CHECK(contents(stage.out) == pair.after);
    }
}

// ---- a killed run ----

TEST("a run that ends while it writes leaves whole pictures, and the next one draws") {
    const Stage stage(150, 100);
    const Pair pair(stage);
    const std::size_t depth = pair.after.at("depth.tga").size(), frame = pair.after.at("framebuffer.tga").size();
    for (int i = 0; i < 32; i++) {
        stage.put(pair.before);
        const std::size_t limit = frame * static_cast<std::size_t>(i) / 32;
        const int status = Child(stage.path(), stage.arguments(new_light), file_size_limit(limit, true)).end().status;
        CHECK(WIFSIGNALED(status) && WTERMSIG(status) == SIGXFSZ);  // at that very byte
        const Contents now = contents(stage.out);
        CHECK(pair.whole(now, true));
        const char* const part = limit < depth ? "depth.tga.part" : "framebuffer.tga.part";
        CHECK(now.count(part) && now.at(part).size() <= limit);
        CHECK(stage.draw(new_light) == pair.after);
    }
}

TEST("a run killed at any moment leaves whole pictures, and the next one draws") {
#ifdef UMBRA_SANITIZED
    constexpr int side = 200;
#else
    constexpr int side = 400;
#endif
    const Stage stage(side, side);
    const Pair pair(stage);
    auto length = Clock::duration::max();  // of a run that nothing disturbs
    for (int i = 0; i < 3; i++) {
        const auto start = Clock::now();
        CHECK(stage.draw(new_light) == pair.after);
        length = std::min(length, Clock::now() - start);
    }
    const int failed_before = failed_checks();
    int kills = 0, old_pairs = 0, new_pairs = 0, parts = 0;
    const auto kill = [&](Child& child) {
        child.kill();
        const int status = child.end().status;
        if (!WIFSIGNALED(status)) return (void)CHECK_EQ(status, 0);  // it had ended
        CHECK_EQ(WTERMSIG(status), SIGKILL);
        const Contents now = contents(stage.out);
        if (!CHECK(pair.whole(now, true))) return;
        kills++;
        old_pairs += now.at("depth.tga") == pair.before.at("depth.tga");
        new_pairs += now.at("framebuffer.tga") == pair.after.at("framebuffer.tga");
        if (now.size() > 2) {
            parts++;
            CHECK(stage.draw(new_light) == pair.after);
        }
    };
    for (int i = 0; kills < 60 && failed_checks() == failed_before; i++) {  // again and again over its whole run
        stage.put(pair.before);
        Child child(stage.path(), stage.arguments(new_light), as_it_is);
        std::this_thread::sleep_for(length * (i % 24) / 20);
        kill(child);
    }
    const int spread_kills = kills;
    for (int i = 0; i < 40 || (parts == 0 && i < 400); i++) {  // while a temporary file is there
        stage.put(pair.before);
        Child child(stage.path(), stage.arguments(new_light), as_it_is);
        const fs::path awaited = stage.out / (i % 2 ? "framebuffer.tga.part" : "depth.tga.part");
        while (!fs::exists(awaited) && child.running()) {}
        std::this_thread::sleep_for(length * (i % 10) / 100);
        kill(child);
    }
    std::cout << "killed: " << spread_kills << " times over the whole run, " << kills - spread_kills
              << " times while it wrote; both pictures old: " << old_pairs << ", both new: " << new_pairs
              << ", a temporary file left: " << parts << '\n';
    CHECK(parts > 0);
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
