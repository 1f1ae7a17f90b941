// tgaimage.cpp: files as a whole; reading and writing Truevision TGA files; a picture in the terminal. It decodes no
// other format, and does not know what a picture is for.
//
// A TGA file is a header of 18 bytes, an image ID, a colour map, the pixels row by row, and since version 2.0 a footer.
// Everything that a header claims is held against the bytes that the file has before memory is asked for.
#include "tgaimage.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#if __has_include(<termios.h>)
#include <csignal>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#endif
#if __has_include(<sys/mman.h>)
#include <sys/mman.h>
#endif
#if __has_include(<unistd.h>)
#include <unistd.h>
#endif

namespace fs = std::filesystem;
using Byte = std::uint8_t;

#if defined(MADV_HUGEPAGE) && !defined(UMBRA_SANITIZE)
// Large arrays in pages of 2 MB, as many as they fill to an eighth: to touch fresh memory in pages of 4 KB takes longer
// than to fill it, a quarter of a whole run on 2500 faces and a third on 2.5 million. Weak: a program may have others.
[[gnu::weak]] void* operator new(std::size_t n) {
    constexpr std::size_t page = 1 << 21;
    const std::size_t large = (n + page / 8) / page * page;
    void* const p = large ? std::aligned_alloc(page, (n + page - 1) / page * page) : std::malloc(n ? n : 1);
    if (!p) throw std::bad_alloc();
    if (large) madvise(p, large, MADV_HUGEPAGE);
    return p;
}
[[gnu::weak]] void operator delete(void* p) noexcept { std::free(p); }
[[gnu::weak]] void operator delete(void* p, std::size_t) noexcept { std::free(p); }
#endif

namespace {

using Stream = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

Stream open(const fs::path& path, const char* mode) {
    errno = 0;
    return Stream(std::fopen(path.string().c_str(), mode), &std::fclose);
}

// ENOSPC and its like in words; to be called before anything else can touch errno.
std::string reason() { return errno ? std::generic_category().message(errno) : "unknown error"; }

}  // namespace

FileBytes read_file(const fs::path& path, std::size_t beyond) {
    constexpr std::uintmax_t most = std::uintmax_t{1} << 32;
    const auto fail = [&](const std::string& what) { throw std::runtime_error(path.string() + ": " + what); };
    const bool is_input = path == "-";  // standard input, whatever file has that name
    std::error_code unknown;
    if (!is_input && fs::is_directory(path, unknown)) fail("is a directory");
    const Stream file = is_input ? Stream(stdin, [](std::FILE*) { return 0; }) : open(path, "rb");
    if (!file) fail("cannot be opened: " + reason());
#ifdef MAP_PRIVATE
    // A mapping costs neither a copy nor fresh memory: a quarter of the loading time. What lies beyond the file on its
    // last page can be used too.
    const std::uintmax_t size = is_input ? 0 : fs::file_size(path, unknown);
    const std::uintmax_t page = sysconf(_SC_PAGESIZE), rest = size % page;
    if (!unknown && size >= most) fail("is larger than 4 GiB");
    if (!unknown && rest > 0 && rest + beyond <= page) {
        void* const map = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE, fileno(file.get()), 0);
        char* const first = static_cast<char*>(map);
        if (map != MAP_FAILED) return {{map, [size](void* p) { munmap(p, size); }}, first, first + size, true};
    }
#endif
    const auto bytes = std::make_shared<std::string>();
    char piece[1 << 14];
    while (const std::size_t n = std::fread(piece, 1, sizeof piece, file.get()))
        if (bytes->append(piece, n).size() >= most) fail("is larger than 4 GiB");
    if (std::ferror(file.get())) fail("cannot be read: " + reason());
    bytes->resize(bytes->size() + beyond);
    return {bytes, bytes->data(), bytes->data() + bytes->size() - beyond};
}

std::string other_picture_kind(const fs::path& path) {
    static constexpr std::pair<std::string_view, const char*> kinds[] = {
        {"\x89PNG", "png:"}, {"\xFF\xD8\xFF", "jpeg:"}, {"GIF8", "gif:"}, {"BM", "bmp:"}, {"RIFF", "webp:"},
        {"DDS ", "dds:"}, {"II*", "tiff:"}, {"MM", "tiff:"}, {"8BPS", "psd:"}, {"v/1\1", "exr:"}, {"#?RA", "hdr:"}};
    char bytes[4] = {};
    std::ifstream(path, std::ios::binary).read(bytes, sizeof bytes);
    for (const auto& [first, kind] : kinds)
        if (std::string_view(bytes, sizeof bytes).starts_with(first)) return kind;
    return "";
}

void FileBytes::forget_before([[maybe_unused]] const char* place) const {
#ifdef MAP_PRIVATE
    const std::size_t page = sysconf(_SC_PAGESIZE), start = reinterpret_cast<std::size_t>(owner.get());
    if (is_mapped) madvise(owner.get(), (reinterpret_cast<std::size_t>(place) - start) / page * page, MADV_DONTNEED);
#endif
}

namespace {

constexpr int header_size = 18;
constexpr int longest_packet = 128;  // pixels
constexpr int rle_bit = 8;           // of the image type
constexpr int top_bit = 0x20, right_bit = 0x10, interleaving_bits = 0xC0, attribute_bits = 0x0F;  // of the descriptor
constexpr int overshoot = 32;        // bytes behind a packet's that copy() and repeat() may read and write

std::string size_in_words(int w, int h) { return std::to_string(w) + " x " + std::to_string(h) + " pixels"; }

// ---- reading ----

struct File : FileBytes {
    std::string name;
    const Byte* bytes;
    std::size_t size;

    explicit File(const fs::path& path) : name(path.string()) {
        std::error_code ignored;
        const fs::file_status status = fs::status(path, ignored);
        if (fs::exists(status) && !fs::is_regular_file(status))  // opening a pipe would wait for ever
            throw std::runtime_error(name + ": cannot be read: it is not a regular file");
        static_cast<FileBytes&>(*this) = read_file(path, overshoot);
        bytes = reinterpret_cast<const Byte*>(begin);
        size = end - begin;
    }
    [[noreturn]] void fail(std::size_t byte, const std::string& what) const {
        throw std::runtime_error(name + ": byte " + std::to_string(byte) + ": " + what);
    }
};

struct Header {
    int id_length, map_type, type, map_first, map_length, map_depth, width, height, depth, descriptor;

    bool rle() const { return type & rle_bit; }
    int kind() const { return type & ~rle_bit; }  // 1 colour-mapped, 2 true colour, 3 grey
    int pixel_bytes() const { return (depth + 7) / 8; }
    std::size_t pixels() const { return std::size_t{1} * width * height; }
    int entry_bytes() const { return (map_depth + 7) / 8; }  // of the colour map

    // The format that the picture comes out in: the file's, or its colour map's. 32 bits have alpha even where the
    // header declares no attribute bits: many programs write it so.
    TGAImage::Format format() const {
        if (kind() == 3) return TGAImage::GRAYSCALE;
        const int bits = kind() == 1 ? map_depth : depth;
        return bits == 32 || (bits <= 16 && (descriptor & attribute_bits) == 1) ? TGAImage::RGBA : TGAImage::RGB;
    }
};

Header read_header(const File& file) {
    const Byte* const b = file.bytes;
    const Byte* const end = b + std::min<std::size_t>(file.size, header_size);
    if (b == end) file.fail(0, "the file is empty");
    // Blanks, printable ASCII and anything that UTF-8 may hold. No header looks so: its second byte is 0 or 1.
    if (std::all_of(b, end, [](Byte c) { return (c >= ' ' && c != 0x7F) || (c >= '\t' && c <= '\r'); }))
        file.fail(0, "the file is text, not a TGA picture");
    if (file.size < header_size) file.fail(file.size, "the header is truncated");

    const auto u16 = [b](int i) { return b[i] | b[i + 1] << 8; };
    const Header h{b[0], b[1], b[2], u16(3), u16(5), b[7], u16(12), u16(14), b[16], b[17]};
    const auto demand = [&](std::initializer_list<int> valid, int value, int byte, const char* what, const char* list) {
        if (std::find(valid.begin(), valid.end(), value) == valid.end())
            file.fail(byte, std::string(what) + " " + std::to_string(value) + " is not " + list);
    };
    demand({0, 1}, h.map_type, 1, "colour map type", "0 or 1");
    demand({1, 2, 3, 9, 10, 11}, h.type, 2, "image type", "1, 2, 3, 9, 10 or 11");
    if (h.kind() == 1) {
        if (h.map_type == 0) file.fail(1, "a colour-mapped picture without a colour map");
        if (h.map_length == 0) file.fail(5, "the colour map has no entries");
        demand({15, 16, 24, 32}, h.map_depth, 7, "colour map depth", "15, 16, 24 or 32");
    }
    if (h.kind() == 2) demand({15, 16, 24, 32}, h.depth, 16, "colour depth", "15, 16, 24 or 32");
    else demand({8, 16}, h.depth, 16, h.kind() == 1 ? "index depth" : "grey depth", "8 or 16");
    if (h.width == 0) file.fail(12, "the picture is 0 pixels wide");
    if (h.height == 0) file.fail(14, "the picture is 0 pixels high");
    if (h.descriptor & interleaving_bits) file.fail(17, "interleaved rows are not supported");
    return h;
}

// A colour of 2, 3 or 4 bytes. Two are five bits a channel, blue lowest, and an attribute bit that stands for alpha.
TGAColor color_of(const Byte* p, int bytes) {
    if (bytes > 2) return {{p[0], p[1], p[2], bytes == 4 ? p[3] : Byte{0}}};
    const int v = p[0] | p[1] << 8;
    // To the nearest; 31 is odd, so nothing lies halfway.
    const auto eight = [v](int shift) { return static_cast<Byte>(((v >> shift & 31) * 255 + 15) / 31); };
    return {{eight(0), eight(5), eight(10), static_cast<Byte>(v & 0x8000 ? 255 : 0)}};
}

// Copies n pixels to dst, or one n times. Packets average a few pixels in real textures: decoding them is a matter of
// mispredicted branches, not of bytes. Blocks of fixed size, which may overshoot, make it 1.2 to 2.1 times as fast.
template <int bytes>
void copy(Byte* dst, const Byte* src, int n) {
    for (int i = 0; i < n * bytes; i += overshoot) std::memcpy(dst + i, src + i, overshoot);
}
template <int bytes>
void repeat(Byte* dst, const Byte* src, int n) {
    constexpr int together = bytes == 1 ? overshoot : 8;  // pixels
    for (int i = 0; i < n; i += together, dst += together * bytes)
        if constexpr (bytes == 1) std::memset(dst, *src, together);
        else for (int k = 0; k < together; k++) std::memcpy(dst + k * bytes, src, 4);
}

// Where the picture's i-th pixel is in the file, whose pixels begin at byte AT. Of a run only the first is asked for.
std::size_t byte_of(const File& file, std::size_t at, const Header& h, std::size_t i) {
    if (!h.rle()) return at + i * h.pixel_bytes();
    for (;; at++) {
        const std::size_t n = (file.bytes[at] & 0x7F) + 1, in_file = file.bytes[at] & 0x80 ? 1 : n;
        if (i < n) return at + 1 + i * h.pixel_bytes();
        i -= n;
        at += in_file * h.pixel_bytes();
    }
}

// Decodes the pixels, of so many bytes each, from the file's byte BEGIN on into the picture, whose size is set.
template <int bytes>
void decode(const File& file, std::size_t begin, const Header& h, const std::vector<TGAColor>& map, TGAImage& image) {
    const auto color_at = [&](const Byte* p, int x, int row) -> TGAColor {
        if (h.kind() == 3) return {{p[0]}};  // and no alpha: a grey picture has no room for it
        if (h.kind() == 2) return color_of(p, 2);
        const int index = bytes == 1 ? p[0] : p[0] | p[1] << 8, last = h.map_first + h.map_length - 1;
        if (index < h.map_first || index > last)
            file.fail(byte_of(file, begin, h, std::size_t{1} * row * h.width + x),
                      "colour index " + std::to_string(index) + " is outside the map, " +
                          std::to_string(h.map_first) + " to " + std::to_string(last));
        return map[index - h.map_first];
    };
    const int out = image.bytespp();
    constexpr int most = 4096;  // pixels at a time: they stay in the cache
    Byte block[(most + longest_packet) * bytes + overshoot];
    int have = 0;  // unpacked pixels in the block; a packet may go on in the next row
    std::int64_t missing = h.pixels();
    const Byte *src = &file.bytes[begin], *const end = &file.bytes[file.size];
    for (int row = 0; row < h.height; row++)
        for (int x = 0, n; x < h.width; x += n) {
            n = std::min(h.width - x, most);
            const Byte* p = h.rle() ? block : std::exchange(src, src + n * bytes);
            while (h.rle() && have < n) {
                if (src == end) file.fail(file.size, "the pixel data is truncated");
                const int length = (*src & 0x7F) + 1, in_file = *src & 0x80 ? 1 : length;
                if (length > missing) file.fail(src - &file.bytes[0], "a packet goes beyond the last pixel");
                if (end - ++src < in_file * bytes) file.fail(file.size, "the pixel data is truncated");
                Byte* const dst = block + have * bytes;
                if (in_file == length) copy<bytes>(dst, src, length);
                else repeat<bytes>(dst, src, length);
                src += in_file * bytes;
                have += length;
                missing -= length;
            }
            Byte* dst = image.pixel(x, h.descriptor & top_bit ? h.height - 1 - row : row);
            if (h.kind() != 1 && bytes == out) std::memcpy(dst, p, n * bytes);
            else for (int i = 0; i < n; i++, p += bytes, dst += out) {
                const TGAColor color = color_at(p, x + i, row);
                for (int c = 0; c < out; c++) dst[c] = color[c];
            }
            have = std::max(have - n, 0);
            std::memmove(block, block + n * bytes, have * bytes);  // what belongs to the next row
        }
}

}  // namespace

TGAImage::TGAImage(int width, int height, Format format) : w_(width), h_(height), bpp_(format) {
    if (width < 1 || width > 65535 || height < 1 || height > 65535)
        throw std::invalid_argument("a picture of " + size_in_words(width, height) + ": a side has 1 to 65535");
    data_.resize(std::size_t{1} * w_ * h_ * bpp_ + 3);
}

bool TGAImage::is_grey() const {
    for (const Byte* p = data_.data(); bpp_ > 1 && p < data_.data() + std::size_t{1} * w_ * h_ * bpp_; p += bpp_)
        if (p[0] != p[1] || p[1] != p[2]) return false;
    return true;
}

TGAImage TGAImage::read_tga_file(const fs::path& path) {
    const File file(path);
    const Header h = read_header(file);
    const std::size_t map_at = std::size_t{header_size} + h.id_length;
    if (map_at > file.size) file.fail(file.size, "the image ID is truncated");
    const std::size_t pixels_at = map_at + (h.map_type ? h.map_length * h.entry_bytes() : 0);
    if (pixels_at > file.size) file.fail(file.size, "the colour map is truncated");

    // Can the picture come from the bytes that are there? A packet of 1 + pixel_bytes gives at most 128 pixels.
    const std::size_t there = file.size - pixels_at, in = h.pixel_bytes();
    if ((h.rle() ? there / (1 + in) * longest_packet : there / in) < h.pixels())
        file.fail(file.size, "the pixel data is truncated: " + size_in_words(h.width, h.height) +
                                 " cannot come from " + std::to_string(there) + " bytes");

    std::vector<TGAColor> map(h.kind() == 1 ? h.map_length : 0);
    for (std::size_t i = 0; i < map.size(); i++)
        map[i] = color_of(file.bytes + map_at + i * h.entry_bytes(), h.entry_bytes());

    TGAImage image(h.width, h.height, h.format());
    constexpr decltype(&decode<1>) decoders[] = {decode<1>, decode<2>, decode<3>, decode<4>};
    decoders[in - 1](file, pixels_at, h, map, image);
    for (int y = 0; h.descriptor & right_bit && y < h.height; y++)
        for (int left = 0, right = h.width - 1; left < right; left++, right--)
            std::swap_ranges(image.pixel(left, y), image.pixel(left, y) + image.bytespp(), image.pixel(right, y));
    return image;
}

// ---- writing ----

namespace {

// Writes the row as packets, none of which the next row shares, and returns the end of what was written.
template <int bytes>
Byte* encode_row(const Byte* row, int width, Byte* dst) {
    // A run takes 1 + BYTES and, amid raw pixels, another header for those behind it: two grey pixels are cheaper raw.
    constexpr int shortest_run = bytes == 1 ? 3 : 2;
    const Byte* const end = row + width * bytes;
    const auto same = [](const Byte* p, int n) { return std::memcmp(p, p + bytes, n * bytes) == 0; };  // as the next
    for (const Byte *p = row, *raw = row; p < end; raw = p) {
        while (p < end && (end - p < shortest_run * bytes || !same(p, shortest_run - 1))) p += bytes;
        for (int n; raw < p; raw += n * bytes) {
            n = static_cast<int>(std::min<std::ptrdiff_t>((p - raw) / bytes, longest_packet));
            *dst++ = static_cast<Byte>(n - 1);
            dst = std::copy_n(raw, n * bytes, dst);
        }
        if (p == end) break;
        int run = shortest_run;
        for (p += run * bytes; run < longest_packet && p < end && same(p - bytes, 1); p += bytes) run++;
        *dst++ = static_cast<Byte>(0x80 | (run - 1));
        dst = std::copy_n(p - bytes, bytes, dst);
    }
    return dst;
}

[[noreturn]] void fail(const fs::path& path, const std::string& why) {
    throw std::runtime_error(path.string() + ": cannot write: " + why);
}

}  // namespace

void TGAImage::write_tga_file(const fs::path& path, bool rle) const {
    TGAFile(*this, path, rle).commit();
}

static std::pair<int, int> terminal_size() {  // columns and rows, 0 where there is none
#ifdef TIOCGWINSZ
    if (winsize size{}; ioctl(1, TIOCGWINSZ, &size) == 0) return {size.ws_col, size.ws_row};
#endif
    return {0, 0};
}

std::string TGAImage::half_blocks(int columns) const {
    const int w = std::min(columns, w_), h = std::max(1, w * h_ / w_);
    const auto average = [&](int x, int y) {  // 0xRRGGBB of the pixels that come together there
        const int left = x * w_ / w, right = (x + 1) * w_ / w;
        const int low = y * h_ / h, high = (y + 1) * h_ / h;
        int rgb = 0;
        for (const int c : {2, 1, 0}) {
            long long sum = 0;
            for (int i = low; i < high; i++)
                for (int j = left; j < right; j++) sum += pixel(j, i)[bpp_ == 1 ? 0 : c];
            rgb = rgb * 256 + static_cast<int>(sum / ((right - left) * (high - low)));
        }
        return rgb;
    };
    std::string text;
    const auto set_color = [&text](int& now, int rgb, const char* what) {
        if (rgb == now) return;
        char code[32];
        std::snprintf(code, sizeof code, "\033[%s;2;%d;%d;%dm", what, rgb >> 16, rgb >> 8 & 255, rgb & 255);
        text += code, now = rgb;
    };
    for (int y = h - 1; y >= 0; y -= 2) {
        int front = -1, back = -1;
        for (int x = 0; x < w; x++) {
            set_color(front, average(x, y), "38");
            if (y > 0) set_color(back, average(x, y - 1), "48");
            text += "\u2580";  // the upper half of a block, over the background's colour
        }
        text += "\033[0m\n";
    }
    return text;
}

void TGAImage::print() const {
    const char* const wide = std::getenv("COLUMNS");
    int columns = wide ? std::atoi(wide) : 0;
    if (const int own = terminal_size().first; own > 0) columns = own;
    std::fputs(half_blocks(columns > 0 ? columns : 80).c_str(), stdout);
}

#if __has_include(<termios.h>)
static termios before;  // how the terminal was: here, for the handler of a signal
static int resized[2];  // a pipe: what a handler writes wakes key(), even if it comes before that waits

// What a handler may call: no more than that.
static void restore() {
    constexpr char show_cursor_and_old_screen[] = "\033[0m\033[?25h\033[?1049l";
    [[maybe_unused]] const auto written = ::write(1, show_cursor_and_old_screen, sizeof show_cursor_and_old_screen - 1);
    tcsetattr(0, TCSANOW, &before);
}

Terminal::Terminal() {
    if (!isatty(1) || tcgetattr(0, &before)) throw std::runtime_error("standard input and output are no terminal");
    if (pipe(resized)) throw std::runtime_error("no pipe: " + reason());
    for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT})
        std::signal(number, [](int n) {
            restore();
            std::signal(n, SIG_DFL);
            std::raise(n);
        });
    std::signal(SIGWINCH, [](int) { [[maybe_unused]] const auto written = ::write(resized[1], "", 1); });
    termios raw = before;
    raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    raw.c_cc[VSUSP] = _POSIX_VDISABLE;  // nothing would restore it
    tcsetattr(0, TCSANOW, &raw);
    std::fputs("\033[?1049h\033[?25l", stdout);  // a screen of its own, no cursor
}

Terminal::~Terminal() {
    std::fflush(stdout);
    restore();
    for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGWINCH}) std::signal(number, SIG_DFL);
    for (const int end : resized) ::close(end);
}

char Terminal::key(int milliseconds) const {
    pollfd inputs[] = {{0, POLLIN, 0}, {resized[0], POLLIN, 0}}, &input = inputs[0];
    while (poll(inputs, 2, milliseconds) < 0 && errno == EINTR) {}
    char bytes[3] = {};
    if (char all[64]; inputs[1].revents && ::read(resized[0], all, sizeof all) > 0) return 0;
    if (!input.revents) return 0;
    if (::read(0, bytes, 1) <= 0) return 'q';
    if (bytes[0] != '\033') return bytes[0];
    if (poll(&input, 1, 0) <= 0 || ::read(0, bytes + 1, 2) < 2 || bytes[2] < 'A' || bytes[2] > 'D') return 0;
    return "^v><"[bytes[2] - 'A'];
}
#else
Terminal::Terminal() { throw std::runtime_error("a terminal can be drawn on with POSIX alone"); }
Terminal::~Terminal() = default;
char Terminal::key(int) const { return 'q'; }
#endif

void Terminal::progress([[maybe_unused]] int done, [[maybe_unused]] int all) {
#ifdef STDERR_FILENO
    if (isatty(STDERR_FILENO)) std::fprintf(stderr, done < all ? "\rframe %d of %d" : "\r\033[K", done, all);
#endif
}

int Terminal::columns() const { return std::max(1, terminal_size().first); }
int Terminal::rows() const { return std::max(2, terminal_size().second); }

void Terminal::show(const TGAImage& picture, std::string line) const {
    line.resize(std::min<std::size_t>(line.size(), columns()));
    std::fputs(("\033[H" + picture.half_blocks(columns()) + line + "\033[K").c_str(), stdout);
    std::fflush(stdout);
}

TGAFile::TGAFile(const TGAImage& image, const fs::path& path, bool rle) : TGAFile(path) {
    if (image.empty()) throw std::invalid_argument(path.string() + ": a picture of 0 x 0 pixels cannot be written");
    const int w = image.width(), h = image.height(), bpp = image.bytespp();
    const int type = (bpp == TGAImage::GRAYSCALE ? 3 : 2) | (rle ? rle_bit : 0);
    const int descriptor = top_bit | (bpp == TGAImage::RGBA ? 8 : 0);  // eight bits of alpha
    const auto byte = [](int v) { return static_cast<Byte>(v & 255); };
    const Byte header[header_size] = {0, 0, byte(type), 0, 0, 0, 0, 0, 0, 0, 0, 0,  // no image ID, no colour map
                                      byte(w), byte(w >> 8), byte(h), byte(h >> 8), byte(bpp * 8), byte(descriptor)};
    // Extension area and developer directory at 0, that is none, then the signature and a zero byte, the literal's own.
    constexpr char footer[] = "\0\0\0\0\0\0\0\0TRUEVISION-XFILE.";
    std::error_code error;
    const fs::file_status status = fs::status(path_, error);
    // Renaming would put the picture in the place of a device.
    if (fs::exists(status) && !fs::is_regular_file(status)) fail(path_, "it is not a regular file");
    fs::path temporary = path_;
    temporary += ".part";
    Stream stream = open(temporary, "wb");
    if (!stream) fail(path_, reason());
    temporary_ = temporary;
    errno = 0;
    // A run saves at least the header of the raw packet before it, so that a row takes at most its own bytes and a
    // header for each 128 pixels. Some rows at a time: fresh memory for all would take longer than to encode them.
    const std::size_t most_of_row = w * bpp + (w + longest_packet - 1) / longest_packet;
    const std::size_t piece = std::min<std::size_t>(h * most_of_row, 1 << 16);
    const auto bytes = std::make_unique_for_overwrite<Byte[]>(sizeof header + piece + most_of_row + sizeof footer);
    constexpr decltype(&encode_row<1>) encoders[] = {nullptr, encode_row<1>, nullptr, encode_row<3>, encode_row<4>};
    Byte* end = std::copy_n(header, sizeof header, bytes.get());
    const auto put = [&] {
        if (std::fwrite(bytes.get(), end - bytes.get(), 1, stream.get()) != 1) fail(path_, reason());
        end = bytes.get();
    };
    for (int y = h - 1; y >= 0; y--) {
        end = rle ? encoders[bpp](image.pixel(0, y), w, end) : std::copy_n(image.pixel(0, y), w * bpp, end);
        if (end >= bytes.get() + piece) put();
    }
    end = std::copy_n(footer, sizeof footer, end);
    put();
    if (std::fclose(stream.release())) fail(path_, reason());  // flushes what is left
}

void TGAFile::commit() {
    std::error_code error;
    fs::rename(temporary_, path_, error);
    if (error) fail(path_, error.message());
    temporary_.clear();
}

TGAFile::~TGAFile() {
    std::error_code ignored;
    if (!temporary_.empty()) fs::remove(temporary_, ignored);
}
