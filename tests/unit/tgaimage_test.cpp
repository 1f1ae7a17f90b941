// tgaimage_test.cpp: pictures in memory, and TGA files of every kind, whole, broken and hostile. The files are built
// byte by byte from the format's description, not by the code under test.
#include "tgaimage.h"

#include "../fuzz/peak.h"
#include "check.h"
#include "compare.h"
#include "files.h"

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace fs = std::filesystem;

namespace {

int any(std::mt19937& random, int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); }  // in [0,n)
std::uint8_t byte(int n) { return static_cast<std::uint8_t>(n & 255); }
Bytes first(const Bytes& bytes, std::size_t n) { return Bytes(bytes.begin(), bytes.begin() + n); }
void append(Bytes& to, const Bytes& what) { to.insert(to.end(), what.begin(), what.end()); }

const TemporaryFolder& folder() {
    static const TemporaryFolder it("tgaimage_test");
    return it;
}

TGAImage read(const Bytes& file) {
    write_bytes(folder() / "read.tga", file);
    return TGAImage::read_tga_file(folder() / "read.tga");
}

// ---- a TGA file, made by the book ----

enum { top = 0x20, right = 0x10 };

struct Kind {
    int type, depth;
    int attribute_bits = 0;
    int map_depth = 0, map_first = 0, map_length = 0;  // where map_depth is not 0 the file has a map, used or not

    bool mapped() const { return type % 8 == 1; }
    bool grey() const { return type % 8 == 3; }
    TGAImage::Format format() const {
        const int bits = mapped() ? map_depth : depth;
        const bool alpha = bits == 32 || (bits <= 16 && attribute_bits == 1);
        return grey() ? TGAImage::GRAYSCALE : alpha ? TGAImage::RGBA : TGAImage::RGB;
    }
};

struct Built {
    Bytes bytes;
    std::size_t pixels_at = 0, pixels_end = 0;
    TGAImage picture;  // what reading it must give
};

Bytes header(const Kind& kind, int w, int h, int origin = 0, int id_length = 0) {
    return {byte(id_length), byte(kind.map_depth != 0), byte(kind.type),
            byte(kind.map_first), byte(kind.map_first >> 8), byte(kind.map_length), byte(kind.map_length >> 8),
            byte(kind.map_depth),
            9, 9, 9, 9,  // where on a screen the picture belongs: of no interest
            byte(w), byte(w >> 8), byte(h), byte(h >> 8),
            byte(kind.depth), byte(origin | kind.attribute_bits)};
}

Bytes footer() {
    const std::string signature = "TRUEVISION-XFILE.";
    Bytes bytes(26);  // two offsets of four bytes, the signature, and a zero
    std::copy(signature.begin(), signature.end(), bytes.begin() + 8);
    return bytes;
}

// A colour of 15, 16, 24 or 32 bits. Five bits are scaled in real arithmetic here.
TGAColor color_of(const std::uint8_t* p, int depth) {
    if (depth > 16) return {{p[0], p[1], p[2], depth == 32 ? p[3] : byte(0)}};
    const int v = p[0] + 256 * p[1];
    const auto scaled = [](int five) { return byte(static_cast<int>(std::lround(five * 255. / 31.))); };
    return {{scaled(v % 32), scaled(v / 32 % 32), scaled(v / 1024 % 32), byte(v >= 32768 ? 255 : 0)}};
}

// Packets of random lengths for pixels of N bytes; they end where they like, not at the end of a row.
Bytes packets(const Bytes& pixels, int n, std::mt19937& random) {
    Bytes out;
    for (auto p = pixels.begin(); p < pixels.end();) {
        const int most = std::min(static_cast<int>(pixels.end() - p) / n, random() % 4 ? 1 + any(random, 8) : 128);
        int same = 1;
        while (same < most && std::equal(p, p + n, p + same * n)) same++;
        const bool run = random() % 8 ? same > 1 : true;
        const int length = run ? same : most;
        out.push_back(byte((length - 1) | (run ? 128 : 0)));
        out.insert(out.end(), p, p + (run ? 1 : length) * n);
        p += length * n;
    }
    return out;
}

// A picture of random pixels, many equal to their neighbours, as a file.
Built build(const Kind& kind, int w, int h, int origin, const std::string& id, bool with_footer, unsigned seed) {
    std::mt19937 random(seed);
    Built built;
    built.bytes = header(kind, w, h, origin, static_cast<int>(id.size()));
    built.bytes.insert(built.bytes.end(), id.begin(), id.end());
    const std::size_t map_at = built.bytes.size();
    const int entry = (kind.map_depth + 7) / 8, n = (kind.depth + 7) / 8;
    for (int i = kind.map_length * entry; i > 0; i--) built.bytes.push_back(byte(any(random, 256)));

    built.picture = TGAImage(w, h, kind.format());
    Bytes pixels;
    for (int row = 0; row < h; row++)
        for (int column = 0; column < w; column++) {
            const bool repeated = !pixels.empty() && random() % 3;
            int value = static_cast<int>(random());
            if (kind.mapped()) value = kind.map_first + any(random, kind.map_length);
            for (int i = 0; i < n; i++) pixels.push_back(repeated ? pixels[pixels.size() - n] : byte(value >> 8 * i));
            const std::uint8_t* p = pixels.data() + pixels.size() - n;
            const int index = p[0] + (n == 2 ? 256 * p[1] : 0);
            if (kind.mapped()) p = built.bytes.data() + map_at + (index - kind.map_first) * entry;
            TGAColor color{{p[0]}};
            if (!kind.grey()) color = color_of(p, kind.mapped() ? kind.map_depth : kind.depth);
            built.picture.set(origin & right ? w - 1 - column : column, origin & top ? h - 1 - row : row, color);
        }
    built.pixels_at = built.bytes.size();
    append(built.bytes, kind.type > 8 ? packets(pixels, n, random) : pixels);
    built.pixels_end = built.bytes.size();
    if (with_footer) append(built.bytes, footer());
    return built;
}

// Every type with every depth it may have, every kind of map included.
std::vector<Kind> all_kinds() {
    std::vector<Kind> kinds;
    for (const int rle : {0, 8}) {
        kinds.insert(kinds.end(), {{2 + rle, 24}, {2 + rle, 32}, {2 + rle, 32, 8}});
        kinds.insert(kinds.end(), {{3 + rle, 8}, {3 + rle, 16, 8}});
        kinds.insert(kinds.end(), {{2 + rle, 24, 0, 24, 0, 5}, {3 + rle, 8, 0, 16, 3, 7}});  // no pixel uses the map
        for (const int attribute : {0, 1}) {
            for (const int depth : {15, 16}) kinds.push_back({2 + rle, depth, attribute});
            for (const int map_depth : {15, 16, 24, 32}) {
                kinds.push_back({1 + rle, 8, attribute, map_depth, 200, 56});
                kinds.push_back({1 + rle, 8, attribute, map_depth, 0, 20});
                kinds.push_back({1 + rle, 16, attribute, map_depth, 0, 1});
                kinds.push_back({1 + rle, 16, attribute, map_depth, 1000, 60});
            }
        }
    }
    return kinds;
}

// A picture of h rows; value(x, y) says which of 256 colours a pixel has.
template <typename Value>
TGAImage picture_of(int w, int h, TGAImage::Format format, Value value) {
    TGAImage picture(w, h, format);
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            const int v = value(x, y);
            picture.set(x, y, {{byte(v), byte(v * 7), byte(v * 13), byte(v * 31)}});
        }
    return picture;
}

// The packets of each row, as in "run 128, raw 3, ", and checks that header and footer are as they must be and that no
// packet crosses a row's end.
std::vector<std::string> packets_written(const Bytes& file, int w, int h, int n) {
    Bytes expected = header({n == 1 ? 11 : 10, 8 * n, n == 4 ? 8 : 0}, w, h, top);
    std::fill(expected.begin() + 8, expected.begin() + 12, byte(0));
    CHECK(std::equal(expected.begin(), expected.end(), file.begin()));
    std::vector<std::string> rows(h);
    std::size_t at = 18;
    for (std::string& row : rows)
        for (int x = 0; x < w;) {
            if (!CHECK(at < file.size())) return rows;
            const int length = file[at] % 128 + 1, stored = file[at] < 128 ? length : 1;
            row += (file[at] < 128 ? "raw " : "run ") + std::to_string(length) + ", ";
            x += length;
            if (!CHECK(x <= w)) return rows;
            at += 1 + n * stored;
        }
    CHECK(Bytes(file.begin() + std::min(at, file.size()), file.end()) == footer());
    return rows;
}

constexpr TGAImage::Format all_formats[] = {TGAImage::GRAYSCALE, TGAImage::RGB, TGAImage::RGBA};

}  // namespace

TEST("a picture is black at first; outside it get() is zero and set() does nothing") {
    const TGAColor white{{255, 255, 255, 255}};
    const int outside[][2] = {{-1, 0}, {3, 0}, {0, -1}, {0, 2}, {-1, -1}, {3, 2}, {1 << 30, 0}, {0, -(1 << 30)}};
    for (const TGAImage::Format format : all_formats) {
        TGAImage picture(3, 2, format);
        CHECK(picture.width() == 3 && picture.height() == 2 && picture.bytespp() == format && !picture.empty());
        for (const auto& p : outside) {
            picture.set(p[0], p[1], white);
            for (int c = 0; c < 4; c++) CHECK_EQ(int{picture.get(p[0], p[1])[c]}, 0);
        }
        for (int i = 0; i < 6 * format; i++) CHECK_EQ(int{picture.pixel(0, 0)[i]}, 0);
        picture.set(2, 1, white);
        for (int c = 0; c < 4; c++) CHECK_EQ(int{picture.get(2, 1)[c]}, c < format ? 255 : 0);
        CHECK_EQ(picture.pixel(0, 1) - picture.pixel(0, 0), std::ptrdiff_t{3 * format});
    }
    CHECK(TGAImage().empty() && TGAImage().width() == 0);
    for (const int bad : {0, -1, 65536}) {
        CHECK_THROWS(TGAImage(bad, 1, TGAImage::RGB), "1 to 65535");
        CHECK_THROWS(TGAImage(1, bad, TGAImage::RGB), "1 to 65535");
    }
    CHECK(TGAImage(65535, 1, TGAImage::RGB).width() == 65535 && TGAImage(1, 65535, TGAImage::RGB).height() == 65535);
}

// Rows from shorter than a packet, so that packets go on for many of them, to longer than what is decoded at a time.
TEST("every type, depth, size, origin, image ID, colour map and footer is read") {
    const std::string ids[] = {"", "an ID", std::string(255, 'x')};
    const int sizes[][2] = {{23, 11}, {1, 1}, {2, 1}, {1, 300}, {300, 1}, {129, 4}, {1000, 3}, {9000, 2}};
    std::vector<Kind> kinds = all_kinds();
    kinds.insert(kinds.end(), {{1, 16, 0, 32, 0, 65535}, {2, 24, 0, 32, 0, 65535}});
    unsigned seed = 1;
    for (const Kind& kind : kinds)
        for (const auto& s : sizes)
            for (const int origin : {0, +top, +right, top | right})
                for (int i = 0; i < (s[0] == 23 ? 6 : 1); i++) {
                    const Built built = build(kind, s[0], s[1], origin, ids[seed % 3], seed % 2 == 0, seed);
                    if (!CHECK(compare(read(built.bytes), built.picture).same()))
                        std::cerr << "type " << kind.type << ", depth " << kind.depth << ", seed " << seed << '\n';
                    seed++;
                }
}

TEST("what is written is read again, in every format, with and without packets") {
    std::mt19937 random(1);
    for (const TGAImage::Format format : all_formats)
        for (const bool rle : {false, true})
            for (const int w : {1, 2, 3, 127, 128, 129, 130, 255, 256, 257, 1000})
                for (const int length : {1, 2, 5, 50, 1000}) {  // of a run, on average
                    int v = 0;
                    const auto value = [&](int, int) { return any(random, length) == 0 ? v = any(random, 256) : v; };
                    const TGAImage picture = picture_of(w, 5, format, value);
                    picture.write_tga_file(folder() / "written.tga", rle);
                    const Bytes file = read_bytes(folder() / "written.tga");
                    CHECK(compare(TGAImage::read_tga_file(folder() / "written.tga"), picture).same());
                    if (rle) packets_written(file, w, 5, format);
                    CHECK(file.size() <= 18u + 5 * (w * format + (rle ? (w + 127) / 128 : 0)) + 26);
                    CHECK(Bytes(file.end() - 26, file.end()) == footer());
                }
    CHECK(!fs::exists(folder() / "written.tga.part"));
}

// A run of 129 is one of 128 and a pixel that goes with the raw ones. Two grey pixels alike are shorter raw.
TEST("packets are as few and as short as they can be") {
    const auto check = [](int w, TGAImage::Format format, const std::string& expected, auto value) {
        picture_of(w, 2, format, [&](int x, int) { return value(x); }).write_tga_file(folder() / "run.tga");
        for (const auto& row : packets_written(read_bytes(folder() / "run.tga"), w, 2, format)) CHECK_EQ(row, expected);
    };
    std::string many_runs;
    for (int i = 0; i < 128; i++) many_runs += "run 2, ";
    for (const TGAImage::Format format : all_formats) {
        const bool grey = format == TGAImage::GRAYSCALE;
        const auto one_colour = [](int) { return 77; };
        check(1, format, "raw 1, ", one_colour);
        check(2, format, grey ? "raw 2, " : "run 2, ", one_colour);
        check(3, format, "run 3, ", one_colour);
        check(129, format, "run 128, raw 1, ", one_colour);
        check(130, format, grey ? "run 128, raw 2, " : "run 128, run 2, ", one_colour);
        check(259, format, "run 128, run 128, run 3, ", one_colour);
        check(300, format, "raw 128, raw 128, raw 44, ", [](int x) { return x % 2; });
        check(256, format, grey ? "raw 128, raw 128, " : many_runs, [](int x) { return x / 2; });
        const auto between = [&](int run, const std::string& expected) {  // five pixels before and behind
            check(run + 10, format, expected, [run](int x) { return x < 5 ? x : x < 5 + run ? 100 : x - run + 100; });
        };
        between(3, "raw 5, run 3, raw 5, ");
        between(127, "raw 5, run 127, raw 5, ");
        between(128, "raw 5, run 128, raw 5, ");
        between(129, "raw 5, run 128, raw 6, ");
        between(259, "raw 5, run 128, run 128, run 3, raw 5, ");
    }
}

TEST("a file that ends before its last pixel is refused at every byte") {
    unsigned seed = 1;
    for (const Kind& kind : all_kinds()) {
        const Built built = build(kind, 7, 3, 0, "ID", true, seed++);
        const auto what = [&](std::size_t n) {
            return n < 18 ? "header" : n < 20 ? "image ID" : n < built.pixels_at ? "colour map" : "pixel data";
        };
        for (std::size_t n = 0; n < built.pixels_end; n++) {
            const std::string message = "byte " + std::to_string(n) + ": the " + (n ? what(n) : "file") + " is ";
            CHECK_THROWS(read(first(built.bytes, n)), message.c_str());
        }
        CHECK(compare(read(first(built.bytes, built.pixels_end)), built.picture).same());
    }
    const Bytes cut = first(build({1, 8, 0, 24, 0, 100}, 50, 50, 0, "ID", false, 1).bytes, 322);
    CHECK_THROWS(read(cut), "byte 322: the pixel data is truncated: 50 x 50 pixels cannot come from 2 bytes");
}

TEST("a header that cannot be right is refused, and the message names the byte") {
    struct Case { int at, value; const char* message; };
    const auto refused = [](const Kind& kind, const std::vector<Case>& cases) {
        const Built good = build(kind, 5, 4, 0, "", true, 1);
        CHECK(compare(read(good.bytes), good.picture).same());
        for (const Case& c : cases) {
            Bytes bad = good.bytes;
            bad[c.at] = byte(c.value);
            CHECK_THROWS(read(bad), ("read.tga: byte " + std::string(c.message)).c_str());
        }
    };
    refused({2, 24}, {{1, 2, "1: colour map type 2 is not 0 or 1"},
                      {2, 0, "2: image type 0 is not 1, 2, 3, 9, 10 or 11"},
                      {2, 4, "2: image type 4 is not"}, {2, 8, "2: image type 8"}, {2, 32, "2: image type 32 is not"},
                      {2, 1, "1: a colour-mapped picture without a colour map"},
                      {12, 0, "12: the picture is 0 pixels wide"},
                      {14, 0, "14: the picture is 0 pixels high"},
                      {16, 8, "16: colour depth 8 is not 15, 16, 24 or 32"},
                      {16, 0, "16: colour depth 0 is not"}, {16, 23, "16: colour depth 23 is not"},
                      {17, 0x40, "17: interleaved rows are not supported"}, {17, 0x80, "17: interleaved rows are"},
                      {12, 255, "104: the pixel data is truncated"}, {15, 255, "104: the pixel data is truncated"}});
    refused({11, 8}, {{16, 24, "16: grey depth 24 is not 8 or 16"}, {16, 15, "16: grey depth 15 is not 8 or 16"}});
    refused({1, 8, 0, 24, 0, 9}, {{16, 24, "16: index depth 24 is not 8 or 16"},
                                  {7, 8, "7: colour map depth 8 is not 15, 16, 24 or 32"},
                                  {5, 0, "5: the colour map has no entries"},
                                  {6, 255, "91: the colour map is truncated"}});
}

TEST("an index outside the colour map and a packet beyond the last pixel are refused, and the message names the byte") {
    const auto check = [](const Kind& kind, int h, const Bytes& pixels, const std::string& message) {
        Bytes file = header(kind, 3, h);
        file.resize(18 + kind.map_length * kind.map_depth / 8);
        append(file, pixels);
        CHECK_THROWS(read(file), message.c_str());
    };
    for (const int index : {9, 30, 255}) {
        const std::string message = ": colour index " + std::to_string(index) + " is outside the map, 10 to 29";
        check({1, 8, 0, 24, 10, 20}, 1, {10, 29, byte(index)}, "byte 80" + message);
        check({9, 8, 0, 24, 10, 20}, 1, {2, 10, 29, byte(index)}, "byte 81" + message);
        check({9, 8, 0, 24, 10, 20}, 1, {0x80, 10, 0x81, byte(index)}, "byte 81" + message);
    }
    for (const int index : {999, 1600, 65535})
        check({9, 16, 0, 16, 1000, 600}, 1, {0x82, byte(index), byte(index >> 8)},
              "byte 1219: colour index " + std::to_string(index) + " is outside");
    for (const int run : {0, 0x80})
        check({11, 8}, 3, {0x80 | 6, 7, byte(run | 2), 1, 2, 3, 4, 5}, "byte 20: a packet goes beyond the last pixel");
}

TEST("text, other formats and what is no file are refused with a clear word") {
    const auto text = [](const std::string& s) { return Bytes(s.begin(), s.end()); };
    for (const char* const s : {"v 0.1 0.2 0.3\nv 0.4 0.5 0.6\n", "a\n\n", "\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n"})
        CHECK_THROWS(read(text(s)), "byte 0: the file is text, not a TGA picture");
    CHECK_THROWS(read(text("\x89PNG\r\n\x1A\n and so on, a good deal of it")), "byte 1: colour map type 80");
    CHECK_THROWS(TGAImage::read_tga_file(folder() / "none.tga"), "none.tga: cannot be opened: No such file");
    CHECK_THROWS(TGAImage::read_tga_file(folder().path()), ": cannot be read: it is not a regular file");
}

TEST("random bytes are refused or read, within the memory that is stated") {
    std::mt19937 random(20);
    const std::vector<Kind> kinds = all_kinds();
    for (const Kind& kind : kinds) {  // a short file that claims a large picture
        Bytes file = header(kind, 65535, 65535);
        file.resize(18 + kind.map_length * 4);
        write_bytes(folder() / "large.tga", file);
        start_peak();
        CHECK_THROWS(TGAImage::read_tga_file(folder() / "large.tga"), "truncated");
        CHECK(peak_bytes() <= file.size() + 4096);
    }
    int was_read = 0;
    for (int i = 0; i < 20000; i++) {
        Bytes file;
        if (i == 0) {  // the worst that can be: 2 bytes make 128 pixels of 4
            file = header({9, 8, 1, 16, 0, 1}, 128, 1000);
            file.resize(18 + 2);
            for (int k = 0; k < 1000; k++) append(file, {0xFF, 0});
        } else {  // a good file with some bytes changed, or cut
            const int w = 1 + any(random, 40), h = 1 + any(random, 10), origin = any(random, 4) * 16;
            file = build(kinds[random() % kinds.size()], w, h, origin, "ID", true, i).bytes;
            for (unsigned k = random() % 8; k > 0; k--)
                file[random() % 3 ? random() % file.size() : random() % 18] = byte(any(random, 256));
            if (random() % 4 == 0) file.resize(random() % file.size());
        }
        write_bytes(folder() / "random.tga", file);
        start_peak();
        try {
            const TGAImage picture = TGAImage::read_tga_file(folder() / "random.tga");
            CHECK(picture.width() > 0 && picture.height() > 0);
            was_read++;
        } catch (const std::runtime_error& e) {
            CHECK(i > 0 && std::strstr(e.what(), "random.tga: byte "));
        }
        CHECK(peak_bytes() <= 257 * file.size() + 4096);
    }
    CHECK(was_read > 1000 && was_read < 19000);  // both kinds were thrown
}

TEST("where writing fails the old picture stays and nothing else is left") {
    const TemporaryFolder own("tgaimage_atomic");
    const fs::path target = own / "picture.tga", part = own / "picture.tga.part";
    std::mt19937 random(1);
    const TGAImage old = picture_of(20, 10, TGAImage::RGB, [](int x, int y) { return x * y; });
    const TGAImage large = picture_of(500, 500, TGAImage::RGB, [&](int, int) { return any(random, 256); });
    old.write_tga_file(target);
    const Bytes before = read_bytes(target);
    const auto refused = [&](const TGAImage& picture, const fs::path& path, const char* message) {
        CHECK_THROWS(picture.write_tga_file(path), message);
        CHECK(read_bytes(target) == before);
        for (const auto& entry : fs::directory_iterator(own.path()))
            CHECK(entry.path() == target || !entry.is_regular_file());
    };
    refused(TGAImage(), own / "empty.tga", "empty.tga: a picture of 0 x 0 pixels cannot be written");
    refused(large, own / "missing/picture.tga", "missing/picture.tga: cannot write: No such file or directory");
    refused(large, target / "picture.tga", "cannot write: Not a directory");
    refused(large, own.path(), "cannot write: it is not a regular file");
    refused(large, own / std::string(300, 'x'), "cannot write: File name too long");
    fs::create_directory(part);  // the temporary file cannot be opened
    refused(large, target, "picture.tga: cannot write: Is a directory");
    CHECK(fs::is_directory(part));
    fs::remove(part);
    if (fs::is_character_file("/dev/full")) {  // a device on which every write fails for want of space
        for (const TGAImage* const picture : {&old, &large}) {  // on closing, and before
            fs::create_symlink("/dev/full", part);
            refused(*picture, target, "picture.tga: cannot write: No space left on device");
            CHECK(!fs::is_symlink(part));
        }
        fs::create_symlink("/dev/full", own / "device.tga");
        refused(large, own / "device.tga", "device.tga: cannot write: it is not a regular file");
        CHECK(fs::is_symlink(own / "device.tga"));
    } else {
        std::cout << "no /dev/full here: a full disk is not tested\n";
    }
    large.write_tga_file(target);  // and now nothing is in the way
    CHECK(compare(TGAImage::read_tga_file(target), large).same());
    CHECK(!fs::exists(part));
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
