// faults_test.cpp: the program on a full disk, in folders it may not write to, and killed at any moment. Whatever
// happens, a picture in the folder is a whole one, old or new. Not about what the pictures show.
#include "check.h"
#include "files.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <map>
#include <thread>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#ifdef __linux__
#include <sched.h>
#include <sys/mount.h>
#endif

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

namespace {

constexpr const char *depth_tga = "depth.tga", *frame_tga = "framebuffer.tga";

using Prepare = std::function<bool()>;  // is called in a child before the program takes its place
bool nothing() { return true; }

// Root may write everywhere, so it becomes nobody.
bool give_up_rights() { return geteuid() != 0 || (setgid(65534) == 0 && setuid(65534) == 0); }

// At most that many bytes in a file. A write beyond them fails, or ends the program with the signal.
Prepare limit_file_size(std::size_t bytes, bool deadly) {
    return [=] {
        const rlimit limit{bytes, bytes}, no_core{0, 0};
        return std::signal(SIGXFSZ, deadly ? SIG_DFL : SIG_IGN) != SIG_ERR && setrlimit(RLIMIT_CORE, &no_core) == 0 &&
               setrlimit(RLIMIT_FSIZE, &limit) == 0;
    };
}

using Contents = std::map<std::string, Bytes>;

Contents contents(const fs::path& folder) {  // what is no regular file has no bytes here
    Contents all;
    for (const auto& e : fs::directory_iterator(folder))
        all[e.path().filename().string()] = fs::is_regular_file(e.symlink_status()) ? read_bytes(e.path()) : Bytes{};
    return all;
}

struct Outcome {
    int status;  // as waitpid has it
    std::string text;
    bool drawn() const { return status == 0 && text.empty(); }
    bool killed_by(int signal) const { return WIFSIGNALED(status) && WTERMSIG(status) == signal; }
    // It ended by itself with status 1 and this line.
    bool refused(const std::string& line) const {
        const bool ok = WIFEXITED(status) && WEXITSTATUS(status) == 1 && text == "umbra: " + line + '\n';
        return ok || (std::cerr << "    status " << status << ", " << text << '\n', false);
    }
};

// A folder with a model and a folder "out" with the two pictures of an earlier run. Later runs have another light.
struct Stage : TemporaryFolder {
    const fs::path out = *this / "out";
    const std::string side;
    Contents before, after;  // the pictures of the earlier run; those of the next one if nothing stops it

    explicit Stage(int size) : TemporaryFolder("faults_test"), side(std::to_string(size)) {
        // Waves: smooth shades that no run-length code makes short, and depths too; faces enough for seven threads.
        std::ofstream obj(*this / "waves.obj");
        for (int i = 0; i < 33 * 33; i++)
            obj << "v " << i % 33 << ' ' << i / 33 << ' ' << 1.6 * (((i % 33) * (i % 33) + 3 * (i / 33)) % 5) << '\n';
        for (int v = 1; v <= 33 * 32; v++)
            if (v % 33 > 0) obj << "f " << v << ' ' << v + 1 << ' ' << v + 34 << ' ' << v + 33 << '\n';
        obj.close();
        fs::create_directory(out);
        for (const fs::path& p : {path(), *this / "waves.obj"}) fs::permissions(p, fs::perms(0755));
        CHECK(run(nothing, {"--light", "1,1,2"}).drawn());
        before = contents(out);
        CHECK(run().drawn());
        after = contents(out);
        for (const char* file : {depth_tga, frame_tga}) CHECK(before.at(file) != after.at(file));
        CHECK(before.size() == 2 && after.size() == 2);
        put(before);
    }

    void put(const Contents& pictures) const {  // and nothing else
        for (const auto& entry : fs::directory_iterator(out)) fs::remove(entry.path());
        for (const auto& [name, bytes] : pictures) write_bytes(out / name, bytes);
    }

    // Runs the program; meanwhile(its process) is called here.
    Outcome run(const Prepare& prepare = nothing, const std::vector<std::string>& more = {},
                const std::function<void(pid_t)>& meanwhile = [](pid_t) {}) const {
        // Opened here: a child that gives up its rights may not reach the program by its path.
        static const int program = open(UMBRA_BINARY, O_RDONLY | O_CLOEXEC);
        std::vector<std::string> words{UMBRA_BINARY, "--quiet", "-o", "out", "--light", "-1,2,1", "--threads", "2",
                                       "--size", side + 'x' + side, "--shadow-size", side, "waves.obj"};
        words.insert(words.end(), more.begin(), more.end());
        std::vector<char*> argv;
        for (std::string& word : words) argv.push_back(word.data());
        argv.push_back(nullptr);
        int ends[2];  // the child's go with exec
        const pid_t pid = program < 0 || pipe2(ends, O_CLOEXEC) ? -1 : fork();
        if (pid < 0) throw std::runtime_error("umbra cannot be started");
        if (pid == 0) {
            alarm(120);  // nothing may wait for ever
            dup2(open("/dev/null", O_WRONLY), STDOUT_FILENO);
            dup2(ends[1], STDERR_FILENO);
            if (chdir(path().c_str()) == 0 && prepare()) fexecve(program, argv.data(), environ);
            std::perror("the child cannot start");
            _exit(127);
        }
        close(ends[1]);
        meanwhile(pid);
        Outcome o{-1, {}};
        char part[4096];
        for (ssize_t n; (n = read(ends[0], part, sizeof part)) > 0;) o.text.append(part, n);
        close(ends[0]);
        waitpid(pid, &o.status, 0);
        return o;
    }
    void check_drawn(const Prepare& prepare = nothing, const std::vector<std::string>& more = {}) const {
        CHECK(run(prepare, more).drawn());
        CHECK(contents(out) == after);
    }
    // It cannot write the file in the folder, and leaves all that is there.
    void check_refused(const std::string& file, const std::string& reason, const Prepare& prepare = nothing) const {
        const Contents there = contents(out);
        CHECK(run(prepare).refused("out/" + file + ": cannot write: " + reason));
        CHECK(contents(out) == there);
    }
    // Each picture is the old one or the new one; nothing else is there, but what a killed run may leave.
    bool whole(Contents now) const {
        std::erase_if(now, [](const auto& file) { return fs::path(file.first).extension() == ".part"; });
        for (const char* file : {depth_tga, frame_tga})
            if (now[file] != before.at(file) && now[file] != after.at(file)) return false;
        return now.size() == 2;
    }
};

}  // namespace

TEST("a file that cannot grow is one error line; a run that ends there leaves whole pictures, and the next one draws") {
    const Stage stage(150);
    const std::size_t depth = stage.after.at(depth_tga).size(), frame = stage.after.at(frame_tga).size();
    CHECK(depth > 1000 && frame > depth + 1000);
    const std::vector<std::size_t> limits{0, 1, 17, depth / 2, depth - 1, depth, (depth + frame) / 2, frame - 1};
    for (const std::size_t limit : limits)
        stage.check_refused(limit < depth ? depth_tga : frame_tga, "File too large", limit_file_size(limit, false));
    stage.check_drawn(limit_file_size(frame, false));
    stage.put({});
    stage.check_refused(depth_tga, "File too large", limit_file_size(100, false));  // an empty folder stays empty
    for (int i = 0; i < 32; i++) {
        stage.put(stage.before);
        const std::size_t limit = frame * i / 32;
        CHECK(stage.run(limit_file_size(limit, true)).killed_by(SIGXFSZ));  // at that very byte
        const Contents now = contents(stage.out);
        CHECK(stage.whole(now));
        std::size_t parts = 0;  // they are written side by side: one may not have been begun
        for (const auto& [name, bytes] : now)
            if (fs::path(name).extension() == ".part") CHECK(bytes.size() <= limit), parts++;
        CHECK(parts > 0);
        stage.check_drawn();
    }
}

#ifdef __linux__
// A disk of 1 MiB that only this process and its children see. Not everyone may mount one.
static bool mount_small_disk(const fs::path& at) {
    const std::string user = "0 " + std::to_string(geteuid()) + " 1", group = "0 " + std::to_string(getegid()) + " 1";
    const bool apart = unshare(CLONE_NEWNS) == 0 ||
                       (unshare(CLONE_NEWUSER | CLONE_NEWNS) == 0 &&
                        std::ofstream("/proc/self/setgroups") << "deny" << std::flush &&
                        std::ofstream("/proc/self/uid_map") << user << std::flush &&
                        std::ofstream("/proc/self/gid_map") << group << std::flush);
    return apart && mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
           mount("tmpfs", at.c_str(), "tmpfs", 0, "size=1048576") == 0;
}

// From no free page to enough for both pictures. Whichever of them does not fit, the earlier ones are there.
static void check_full_disk(const Stage& stage) noexcept {
    constexpr std::size_t page = 4096;  // what tmpfs gives out
    std::size_t refusals = 0;
    for (bool drawn = false; !drawn && refusals < 1000; refusals += !drawn) {
        stage.put(stage.before);
        write_bytes(stage.out / "filler", Bytes(fs::space(stage.out).available - refusals * page, 1));
        CHECK_EQ(fs::space(stage.out).available, refusals * page);
        const Outcome o = stage.run();
        fs::remove(stage.out / "filler");
        drawn = o.drawn();
        const std::string reason = ".tga: cannot write: No space left on device";
        CHECK(drawn || o.refused((o.text.find("depth") < o.text.size() ? "out/depth" : "out/framebuffer") + reason));
        CHECK(contents(stage.out) == (drawn ? stage.after : stage.before));
    }
    CHECK(refusals > 2 && refusals < 1000);
}

TEST("a full disk is one error line") {
    const Stage stage(100);
    const pid_t pid = fork();  // the mount ends with this child
    if (pid == 0) {
        const int failed_before = failed_checks();
        if (!mount_small_disk(stage.out)) _exit(2);
        check_full_disk(stage);
        _exit(failed_checks() > failed_before);
    }
    int status = -1;
    waitpid(pid, &status, 0);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 2) std::cout << "skipped: mounting a disk is not permitted here\n";
    else CHECK_EQ(status, 0);
}
#endif

TEST("a temporary file on a full device is one error line") {
    if (!fs::is_character_file("/dev/full")) return;
    const Stage stage(60);
    for (const std::string file : {depth_tga, frame_tga})
        stage.check_refused(file, "No space left on device", [place = "out/" + file + ".part"] {
            return symlink("/dev/full", place.c_str()) == 0;  // the run takes it away
        });
}

TEST("a model of 4 GiB is refused unread") {
    const Stage stage(60);
    std::ofstream(stage / "large.obj").close();
    fs::resize_file(stage / "large.obj", std::uintmax_t{1} << 32);  // takes no place on the disk
    CHECK(stage.run(nothing, {"large.obj"}).refused("large.obj: is larger than 4 GiB"));
}

TEST("a folder that cannot be made or may not be written to is one error line, before anything is read") {
    const Stage stage(60);
    const auto check = [&](const std::string& folder, const std::string& line) {  // before the models are missed
        CHECK(stage.run(give_up_rights, {"-o", folder, "missing.obj"}).refused(line));
    };
    check("waves.obj/new", "waves.obj/new: cannot be made: Not a directory");
    CHECK_EQ(contents(stage.path()).size(), 2u);
    for (const int rights : {0505, 0}) {
        fs::permissions(stage.out, fs::perms(rights));
        check("out", "out/depth.tga: cannot write: Permission denied");
        check("out/new", "out/new: cannot be made: Permission denied");
        fs::permissions(stage.out, fs::perms::owner_all);
        CHECK(contents(stage.out) == stage.before);
    }
}

TEST("what stands in a picture's place and is no file stays there; a link to one becomes the picture") {
    const Stage stage(60);
    for (const char* file : {depth_tga, frame_tga})
        for (const std::string make : {"mkdir ", "mkfifo ", "ln -s /dev/null "}) {
            const std::string place = (stage.out / file).string();
            stage.put(stage.before);
            CHECK_EQ(std::system(("rm " + place + " && " + make + place).c_str()), 0);
            const fs::file_type type = fs::symlink_status(place).type();
            stage.check_refused(file, "it is not a regular file");
            CHECK(fs::symlink_status(place).type() == type);
        }
    stage.put(stage.before);
    write_bytes(stage / "letter", {'h', 'i'});
    fs::remove(stage.out / frame_tga);
    fs::create_symlink("../letter", stage.out / frame_tga);
    stage.check_drawn();
    CHECK(read_bytes(stage / "letter") == Bytes({'h', 'i'}));
}

// Where other processes of this user fill the limit, no thread at all can be started.
TEST("fewer threads than asked for draw the same pictures") {
    const Stage stage(60);
    fs::permissions(stage.out, fs::perms::all);
    for (rlim_t limit = 1; limit <= 9; limit++) {
        stage.put(stage.before);
        const auto limit_threads = [most = rlimit{limit, limit}] {
            setenv("ASAN_OPTIONS", "detect_leaks=0", 1);  // the search for leaks needs a process of its own
            return give_up_rights() && setrlimit(RLIMIT_NPROC, &most) == 0;
        };
        stage.check_drawn(limit_threads, {"--threads", "7"});
    }
}

TEST("a run killed at any moment leaves whole pictures, and the next one draws") {
#ifdef UMBRA_SANITIZED
    const Stage stage(200);
#else
    const Stage stage(400);
#endif
    auto length = Clock::duration::max();  // of a run that nothing disturbs
    for (int i = 0; i < 3; i++) {
        const auto start = Clock::now();
        stage.check_drawn();
        length = std::min(length, Clock::now() - start);
    }
    int kills = 0, parts = 0;
    // Kills a run after a part of its length, counted from its start or from when the awaited file is there.
    const auto kill_run = [&](const std::string& awaited, double after) {
        stage.put(stage.before);
        const Outcome o = stage.run(nothing, {}, [&](pid_t pid) {
            const fs::path file = stage.out / awaited;
            const auto is_there = [&] {  // with more in it than the trial before the run
                std::error_code error;
                const auto size = fs::file_size(file, error);
                return awaited.empty() || (!error && size > 100);
            };
            for (siginfo_t ended{}; !is_there() && ended.si_pid == 0;)
                waitid(P_PID, static_cast<id_t>(pid), &ended, WEXITED | WNOHANG | WNOWAIT);
            std::this_thread::sleep_for(length * after);
            kill(pid, SIGKILL);
        });
        const Contents now = contents(stage.out);
        CHECK(stage.whole(now));
        if (now.size() > 2) stage.check_drawn();
        parts += now.size() > 2;
        kills += !o.drawn();
        CHECK(o.drawn() || o.killed_by(SIGKILL));
    };
    for (int i = 0; kills < 60 && failed_checks() == 0; i++) kill_run("", i % 24 / 20.);
    for (int i = 0; i < 40 || (parts == 0 && i < 400); i++)
        kill_run(std::string(i % 2 ? frame_tga : depth_tga) + ".part", i % 10 / 100.);
    std::cout << kills << " killed, a temporary file left by " << parts << '\n';
    CHECK(parts > 0);
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
