// view_test.cpp: --view in a terminal of its own: keys go in, pictures come out, and the terminal is as it was however
// the program ends. POSIX.
#include "run.h"

#include <csignal>

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

namespace {

// A pseudo-terminal, and the program in it.
class PseudoTerminal {
public:
    explicit PseudoTerminal(Strings arguments) : master_(posix_openpt(O_RDWR | O_NOCTTY)) {
        if (master_ < 0 || grantpt(master_) || unlockpt(master_)) throw std::runtime_error("no pseudo-terminal");
        const std::string name = ptsname(master_);
        slave_ = open(name.c_str(), O_RDWR | O_NOCTTY);
        resize(60, 20);
        tcgetattr(slave_, &before_);
        arguments.insert(arguments.begin(), UMBRA_BINARY);
        std::vector<char*> words;
        for (std::string& word : arguments) words.push_back(word.data());
        words.push_back(nullptr);
        child_ = fork();
        if (child_ == 0) {
            setsid();
            const int terminal = open(name.c_str(), O_RDWR);  // becomes the controlling one
            for (int i = 0; i < 3; i++) dup2(terminal, i);
            close(master_), close(slave_);
            execv(words[0], words.data());
            _exit(127);
        }
    }
    ~PseudoTerminal() {
        if (child_ > 0) kill(child_, SIGKILL), waitpid(child_, nullptr, 0);
        close(master_), close(slave_);
    }
    PseudoTerminal(const PseudoTerminal&) = delete;

    void resize(int columns, int rows) {
        winsize size{};
        size.ws_col = static_cast<unsigned short>(columns), size.ws_row = static_cast<unsigned short>(rows);
        ioctl(master_, TIOCSWINSZ, &size);
    }
    void type(const std::string& keys) { CHECK_EQ(write(master_, keys.data(), keys.size()), ssize_t(keys.size())); }

    // What is printed up to the end of the next picture and of the line below it.
    std::string picture() {
        std::size_t end;
        while ((end = said_.find(end_of_picture)) == said_.npos)
            if (!more(60000)) return {};
        const std::string text = said_.substr(0, end);
        said_.erase(0, end + end_of_picture.size());
        return text;
    }
    // Lets it end, and says what it printed until then. Returns the status, as waitpid has it.
    int end(std::string& rest) {
        int status = 0;
        while (waitpid(child_, &status, WNOHANG) == 0) more(10);
        child_ = 0;
        while (more(0)) {}
        rest = said_;
        return status;
    }
    bool is_as_before() const {
        termios now;
        tcgetattr(slave_, &now);
        return now.c_lflag == before_.c_lflag && now.c_iflag == before_.c_iflag && now.c_oflag == before_.c_oflag &&
               std::equal(now.c_cc, now.c_cc + NCCS, before_.c_cc);
    }
    void signal(int number) const { kill(child_, number); }

private:
    static constexpr std::string_view end_of_picture = "\033[K";

    bool more(int milliseconds) {
        pollfd output{master_, POLLIN, 0};
        char bytes[4096];
        if (poll(&output, 1, milliseconds) <= 0) return false;
        const ssize_t n = read(master_, bytes, sizeof bytes);
        if (n > 0) said_.append(bytes, n);
        return n > 0;
    }

    int master_, slave_;
    std::string said_;
    pid_t child_ = 0;
    termios before_;
};

std::string blocks(const std::string& text) {  // the picture, without the line below it
    const std::size_t begin = text.find("\033[H"), end = text.rfind('\n');
    return begin < end && end != text.npos ? text.substr(begin, end - begin) : "";
}

constexpr const char* restored = "\033[?25h\033[?1049l";

}  // namespace

TEST("--view: every key changes the picture, and nothing else draws it again") {
    const Folder f;
    PseudoTerminal t({"--view", "--size", "50x30", "--shadow-size", "100", "-o", f.path().string()});
    const std::string first = t.picture();
    CHECK(first.starts_with("\033[?1049h\033[?25l\033[H"));
    CHECK_EQ(lines(first), 19);
    CHECK(!t.is_as_before());
    std::string last = blocks(first);
    const auto changed = [&](const std::string& keys) {
        t.type(keys);
        const std::string now = blocks(t.picture());
        const bool is_new = !now.empty() && now != last;
        last = now;
        return is_new;
    };
    for (const std::string key : {"\033[A", "\033[B", "\033[C", "\033[D", "w", "a", "s", "d", "m", "m", "m"})
        if (!CHECK(changed(key))) std::cerr << "    key " << key << '\n';
    CHECK(changed("xyzb"));  // one picture: the bias is 0 now, and the other keys mean nothing
    const auto says = [&](const std::string& keys, const std::string& words) {
        t.type(keys);
        return t.picture().find(words) != std::string::npos;
    };
    CHECK(says("b", "bias 10") && says("b", "bias 43.34") && says("b", "bias 100") && says("b", "bias derived"));
    CHECK(says("l", "spot light") && says("l", "point light") && says("l", "light, shadow map"));
    t.resize(30, 10);
    CHECK_EQ(lines(t.picture()), 9);
    t.resize(20000, 2);  // wider than the largest picture
    const std::string wide = blocks(t.picture());
    int columns = 0;
    for (std::size_t at = 0; (at = wide.find("\u2580", at)) != wide.npos; at++) columns++;
    CHECK_EQ(columns, 16384);
    t.resize(30, 10);
    last = blocks(t.picture());
    CHECK(changed(" "));
    CHECK(blocks(t.picture()) != last);  // it turns by itself
    t.type(" ");
    t.type("pq");
    std::string rest;
    CHECK_EQ(t.end(rest), 0);
    CHECK(rest.ends_with(restored));
    CHECK(t.is_as_before());
    const TGAImage written = TGAImage::read_tga_file(f / "framebuffer.tga");
    CHECK(written.width() == 50 && written.height() == 30);
    CHECK_EQ(TGAImage::read_tga_file(f / "depth.tga").width(), 100);
}

TEST("--view: b means nothing to exact shadows; w moves a light that stands above") {
    const Folder f;
    f.write("m.obj", "v -4 -1 4\nv 4 -1 4\nv 4 -1 -4\nv -4 -1 -4\nf 1 2 3 4\n"  // a floor, and a roof beside what the
                     "v 2 0 1\nv 3 0 1\nv 3 0 0\nf 5 6 7\n");                    // unfitted light sees
    f.run("--no-fit --size 50x30 --zoom .3 --light 1,2,0 --shadow exact -o exact m.obj");
    PseudoTerminal t({"--view", "--no-fit", "--size", "50x30", "--zoom", ".3", "--light", "1,2,0", "-o",
                      f.path().string(), (f / "m.obj").string()});
    t.type("mbpq");
    std::string rest;
    CHECK_EQ(t.end(rest), 0);
    CHECK(!f.read("exact/framebuffer.tga").empty() && f.read("framebuffer.tga") == f.read("exact/framebuffer.tga"));
    PseudoTerminal above({"--view", "--light", "0,1,0", "--shadow-size", "100", "-o", f.path().string()});
    const std::string first = blocks(above.picture());
    above.type("w");
    CHECK(blocks(above.picture()) != first);
}

TEST("--view: signals leave the terminal as it was") {
    const Folder f;
    for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) {
        PseudoTerminal t({"--view", "--shadow-size", "100", "-o", f.path().string()});
        t.picture();
        if (number == SIGINT) t.type("\003");
        else t.signal(number);
        std::string rest;
        const int status = t.end(rest);
        CHECK(WIFSIGNALED(status) && WTERMSIG(status) == number);
        CHECK(rest.find(restored) != rest.npos);
        CHECK(t.is_as_before());
    }
}

TEST("--view: an error ends it, too; without a terminal it is one") {
    const Folder f;
    const Outcome o = f.run("--view </dev/null");
    CHECK_EQ(o.status, 1);
    CHECK_EQ(o.err, "umbra: standard input and output are no terminal\n");
    PseudoTerminal t({"--view", "--shadow-size", "100", "-o", f.path().string()});
    t.picture();
    std::filesystem::create_directory(f / "framebuffer.tga");
    t.type("p");
    std::string rest;
    CHECK_EQ(WEXITSTATUS(t.end(rest)), 1);
    CHECK(rest.find("framebuffer.tga: cannot write") > rest.find(restored));
    CHECK(t.is_as_before());
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
