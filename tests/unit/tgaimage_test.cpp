// tgaimage_test.cpp: pictures in memory, and TGA files of every kind, whole, broken and hostile. The files are built
// byte by byte from the format's description, not by the code under test.
#include "tgaimage.h"

#include "check.h"
#include "files.h"
#include "memory.h"

#include <algorithm>
#include <array>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace fs = std::filesystem;

namespace {

int any(std::mt19937& random, int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); }  // in [0,n)
std::size_t size(int n) { return static_cast<std::size_t>(n); }
std::uint8_t byte(int n) { return static_cast<std::uint8_t>(n & 255); }
Bytes first(const Bytes& bytes, std::size_t n) { return Bytes(bytes.begin(), bytes.begin() + static_cast<int>(n)); }
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
};

struct Built {
    Bytes bytes;
    std::size_t pixels_at = 0, pixels_end = 0;
    TGAImage picture;  // what reading it must give
};

Bytes header(const Kind& kind, int w, int h, int origin, int id_length) {
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
TGAColor color_of(const Bytes& b, std::size_t at, int depth) {
    if (depth > 16) return {{b[at], b[at + 1], b[at + 2], depth == 32 ? b[at + 3] : byte(0)}};
    const int v = b[at] + 256 * b[at + 1];
    const auto scaled = [](int five) { return byte(static_cast<int>(std::lround(five * 255. / 31.))); };
    return {{scaled(v % 32), scaled(v / 32 % 32), scaled(v / 1024 % 32), byte(v >= 32768 ? 255 : 0)}};
}

TGAImage::Format format_of(const Kind& kind) {
    if (kind.type == 3 || kind.type == 11) return TGAImage::GRAYSCALE;
    const int depth = kind.type == 1 || kind.type == 9 ? kind.map_depth : kind.depth;
    return depth == 32 || (depth <= 16 && kind.attribute_bits == 1) ? TGAImage::RGBA : TGAImage::RGB;
}

// Packets of random lengths for pixels of N bytes; they end where they like, not at the end of a row.
Bytes packets(const Bytes& pixels, std::size_t n, std::mt19937& random) {
    Bytes out;
    const std::size_t count = pixels.size() / n;
    const auto pixel = [&](std::size_t i) { return pixels.begin() + static_cast<std::ptrdiff_t>(i * n); };
    for (std::size_t i = 0; i < count;) {
        const std::size_t most = std::min<std::size_t>(count - i, random() % 4 ? 1 + random() % 8 : 128);
        std::size_t same = 1;
        while (same < most && std::equal(pixel(i), pixel(i + 1), pixel(i + same))) same++;
        const bool run = random() % 8 ? same > 1 : true;
        const std::size_t length = run ? same : most;
        out.push_back(byte(static_cast<int>(length - 1) | (run ? 128 : 0)));
        out.insert(out.end(), pixel(i), run ? pixel(i + 1) : pixel(i + length));
        i += length;
    }
    return out;
}

// A picture of random pixels, many equal to their neighbours, as a file.
Built build(const Kind& kind, int w, int h, int origin, const std::string& id, bool with_footer, unsigned seed) {
    std::mt19937 random(seed);
    const bool mapped = kind.type == 1 || kind.type == 9, grey = kind.type == 3 || kind.type == 11;
    Built built;
    built.bytes = header(kind, w, h, origin, static_cast<int>(id.size()));
    built.bytes.insert(built.bytes.end(), id.begin(), id.end());
    const std::size_t map_at = built.bytes.size(), entry = size((kind.map_depth + 7) / 8);
    for (std::size_t i = size(kind.map_length) * entry; i > 0; i--) built.bytes.push_back(byte(any(random, 256)));

    built.picture = TGAImage(w, h, format_of(kind));
    Bytes pixels;
    const std::size_t n = size((kind.depth + 7) / 8);
    for (int row = 0; row < h; row++)
        for (int column = 0; column < w; column++) {
            const std::size_t at = pixels.size();
            if (at > 0 && random() % 3) {
                const Bytes last(pixels.end() - static_cast<std::ptrdiff_t>(n), pixels.end());
                append(pixels, last);
            } else if (mapped) {
                const int index = kind.map_first + any(random, kind.map_length);
                pixels.push_back(byte(index));
                if (n == 2) pixels.push_back(byte(index >> 8));
            } else {
                for (std::size_t i = 0; i < n; i++) pixels.push_back(byte(any(random, 256)));
            }
            TGAColor color;
            if (mapped) {
                const int index = pixels[at] + (n == 2 ? 256 * pixels[at + 1] : 0);
                color = color_of(built.bytes, map_at + size(index - kind.map_first) * entry, kind.map_depth);
            } else {
                color = grey ? TGAColor{{pixels[at], 0, 0, 0}} : color_of(pixels, at, kind.depth);
            }
            const int x = origin & right ? w - 1 - column : column, y = origin & top ? h - 1 - row : row;
            built.picture.set(x, y, color);
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
        for (const int attribute : {0, 1})
            for (const int depth : {15, 16}) kinds.push_back({2 + rle, depth, attribute});
        kinds.push_back({2 + rle, 24});
        kinds.push_back({2 + rle, 32});
        kinds.push_back({2 + rle, 32, 8});
        kinds.push_back({2 + rle, 24, 0, 24, 0, 5});  // the map is there, but no pixel uses it
        kinds.push_back({3 + rle, 8});
        kinds.push_back({3 + rle, 8, 0, 16, 3, 7});
        kinds.push_back({3 + rle, 16, 8});
        for (const int attribute : {0, 1})
            for (const int map_depth : {15, 16, 24, 32}) {
                kinds.push_back({1 + rle, 8, attribute, map_depth, 200, 56});
                kinds.push_back({1 + rle, 8, attribute, map_depth, 0, 20});
                kinds.push_back({1 + rle, 16, attribute, map_depth, 0, 1});
                kinds.push_back({1 + rle, 16, attribute, map_depth, 1000, 60});
            }
    }
    return kinds;
}

std::string name_of(const Kind& k) {
    std::ostringstream out;
    out << "type " << k.type << ", " << k.depth << " bits, " << k.attribute_bits << " attribute bits, map of "
        << k.map_length << " x " << k.map_depth << " bits from " << k.map_first;
    return out.str();
}

// Where two pictures differ first, in words; empty where they do not.
std::string difference(const TGAImage& a, const TGAImage& b) {
    std::ostringstream out;
    if (a.width() != b.width() || a.height() != b.height() || a.bytespp() != b.bytespp()) {
        for (const TGAImage& p : {a, b}) out << p.width() << " x " << p.height() << " x " << p.bytespp() << "; ";
        return out.str();
    }
    for (int y = 0; y < a.height(); y++)
        for (int x = 0; x < a.width(); x++)
            for (int c = 0; c < a.bytespp(); c++)
                if (a.pixel(x, y)[c] != b.pixel(x, y)[c]) {
                    const int of_a = a.pixel(x, y)[c], of_b = b.pixel(x, y)[c];
                    out << "pixel " << x << "," << y << " channel " << c << ": " << of_a << " and " << of_b;
                    return out.str();
                }
    return "";
}

// "" where reading the bytes throws a message with the text in it.
std::string unless_refused(const Bytes& bytes, const std::string& text) {
    try {
        read(bytes);
    } catch (const std::runtime_error& e) {
        return std::string(e.what()).find(text) != std::string::npos ? "" : e.what();
    }
    return "was read";
}

// ---- what the writer writes ----

struct Packet {
    bool run;
    int length;
};

// The packets of each row, and checks that header and footer are as they must be and that no packet crosses a row's
// end.
std::vector<std::vector<Packet>> packets_written(const Bytes& file, int w, int h, int n) {
    const Kind kind{n == 1 ? 11 : 10, 8 * n, n == 4 ? 8 : 0};
    Bytes expected = header(kind, w, h, top, 0);
    std::fill(expected.begin() + 8, expected.begin() + 12, byte(0));
    CHECK(std::equal(expected.begin(), expected.end(), file.begin()));
    std::vector<std::vector<Packet>> rows(size(h));
    std::size_t at = 18;
    for (std::vector<Packet>& row : rows)
        for (int x = 0; x < w;) {
            if (!CHECK(at < file.size())) return rows;
            const Packet packet{file[at] >= 128, file[at] % 128 + 1};
            row.push_back(packet);
            x += packet.length;
            if (!CHECK(x <= w)) return rows;
            at += 1 + size(n) * (packet.run ? 1 : size(packet.length));
        }
    CHECK_EQ(file.size() - at, footer().size());
    CHECK(Bytes(file.begin() + static_cast<std::ptrdiff_t>(std::min(at, file.size())), file.end()) == footer());
    return rows;
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

constexpr TGAImage::Format all_formats[] = {TGAImage::GRAYSCALE, TGAImage::RGB, TGAImage::RGBA};

}  // namespace

TEST("a picture has the size and format it was made with, and is black") {
    for (const TGAImage::Format format : all_formats) {
        const TGAImage picture(3, 2, format);
        CHECK_EQ(picture.width(), 3);
        CHECK_EQ(picture.height(), 2);
        CHECK_EQ(picture.bytespp(), static_cast<int>(format));
        CHECK(!picture.empty());
        for (int y = 0; y < 2; y++)
            for (int x = 0; x < 3; x++)
                for (int c = 0; c < 4; c++) CHECK_EQ(int{picture.get(x, y)[c]}, 0);
    }
    CHECK(TGAImage().empty());
    CHECK_EQ(TGAImage().width(), 0);
}

TEST("a side has 1 to 65535 pixels") {
    for (const int bad : {0, -1, 65536}) {
        CHECK_THROWS(TGAImage(bad, 1, TGAImage::RGB), "1 to 65535");
        CHECK_THROWS(TGAImage(1, bad, TGAImage::RGB), "1 to 65535");
    }
    CHECK_EQ(TGAImage(65535, 1, TGAImage::RGB).width(), 65535);
    CHECK_EQ(TGAImage(1, 65535, TGAImage::RGB).height(), 65535);
}

TEST("outside the picture get() is zero and set() does nothing") {
    const TGAColor white{{255, 255, 255, 255}};
    for (const TGAImage::Format format : all_formats) {
        TGAImage picture(3, 2, format);
        const int outside[][2] = {{-1, 0}, {3, 0}, {0, -1}, {0, 2}, {-1, -1}, {3, 2}, {1 << 30, 0}, {0, -(1 << 30)}};
        for (const auto& p : outside) {
            picture.set(p[0], p[1], white);
            for (int c = 0; c < 4; c++) CHECK_EQ(int{picture.get(p[0], p[1])[c]}, 0);
        }
        CHECK_EQ(difference(picture, TGAImage(3, 2, format)), "");
        picture.set(2, 1, white);
        for (int c = 0; c < 4; c++) CHECK_EQ(int{picture.get(2, 1)[c]}, c < format ? 255 : 0);
        CHECK_EQ(picture.pixel(0, 1) - picture.pixel(0, 0), std::ptrdiff_t{3 * format});
    }
}

TEST("every type, depth, origin, image ID, colour map and footer is read") {
    unsigned seed = 1;
    for (const Kind& kind : all_kinds())
        for (const int origin : {0, +top, +right, top | right})
            for (const std::string& id : {std::string(), std::string("an ID"), std::string(255, 'x')})
                for (const bool with_footer : {false, true}) {
                    const Built built = build(kind, 23, 11, origin, id, with_footer, seed++);
                    const std::string wrong = difference(read(built.bytes), built.picture);
                    if (!CHECK_EQ(wrong, "")) std::cerr << name_of(kind) << ", origin " << origin << '\n';
                }
}

TEST("pictures of one pixel, one row, one column and of rows longer than packets are read") {
    unsigned seed = 1;
    const int sizes[][2] = {{1, 1}, {2, 1}, {1, 300}, {300, 1}, {129, 4}, {1000, 3}};
    for (const Kind& kind : all_kinds())
        for (const auto& s : sizes)
            for (const int origin : {0, top | right}) {
                const Built built = build(kind, s[0], s[1], origin, "", seed % 2 == 0, seed);
                seed++;
                const std::string wrong = difference(read(built.bytes), built.picture);
                if (!CHECK_EQ(wrong, "")) std::cerr << name_of(kind) << ", " << s[0] << " x " << s[1] << '\n';
            }
}

// The reader sees the file through a window of 64 KiB: pixels, indices and packets of every size fall on its edge.
TEST("files larger than the reader's window are read") {
    const Kind kinds[] = {{3, 8}, {3, 16}, {2, 24}, {2, 32}, {1, 8, 0, 24, 0, 200}, {1, 16, 0, 16, 1000, 60}};
    for (Kind kind : kinds)
        for (const bool rle : {false, true}) {
            kind.type = kind.type % 8 + 8 * rle;
            const Built built = build(kind, 91, 150000 / 91 / ((kind.depth + 7) / 8), top, "x", true, 7);
            CHECK(built.pixels_end > 70000);
            const std::string wrong = difference(read(built.bytes), built.picture);
            if (!CHECK_EQ(wrong, "")) std::cerr << name_of(kind) << '\n';
        }
    Kind map_larger_than_window{1, 16, 0, 32, 0, 65535};
    const Built built = build(map_larger_than_window, 50, 50, 0, "", true, 1);
    CHECK_EQ(difference(read(built.bytes), built.picture), "");
    map_larger_than_window = {2, 24, 0, 32, 0, 65535};
    const Built unused = build(map_larger_than_window, 50, 50, 0, "", true, 1);
    CHECK_EQ(difference(read(unused.bytes), unused.picture), "");
}

TEST("five bits are scaled to eight exactly") {
    for (int five = 0; five < 32; five++) {
        const int v = five | five << 5 | five << 10 | 0x8000;
        Bytes file = header({2, 16, 1}, 1, 1, 0, 0);
        append(file, {byte(v), byte(v >> 8)});
        const TGAColor color = read(file).get(0, 0);
        for (int c = 0; c < 3; c++) CHECK_EQ(int{color[c]}, static_cast<int>(std::lround(five * 255. / 31.)));
        CHECK_EQ(int{color[3]}, 255);
    }
}

TEST("a packet may go on in the next row, and in the one after it") {
    Bytes file = header({10, 24}, 3, 4, 0, 0);
    append(file, {0x87, 1, 2, 3});                      // a run of eight
    append(file, {2, 4, 5, 6, 7, 8, 9, 10, 11, 12});    // three raw pixels
    append(file, {0x80, 13, 14, 15});                   // a run of one
    const TGAImage picture = read(file);
    for (int i = 0; i < 12; i++) {
        const int first = i < 8 ? 1 : 1 + 3 * (i - 7);
        for (int c = 0; c < 3; c++) CHECK_EQ(int{picture.get(i % 3, i / 3)[c]}, first + c);
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
                    CHECK_EQ(difference(TGAImage::read_tga_file(folder() / "written.tga"), picture), "");
                    const std::size_t row = size(w) * size(format);
                    if (rle) {
                        packets_written(file, w, 5, format);
                        CHECK(file.size() <= 18 + 5 * (row + size(w + 127) / 128) + 26);
                    } else {
                        CHECK_EQ(file.size(), 18 + 5 * row + 26);
                        CHECK_EQ(int{file[2]}, format == TGAImage::GRAYSCALE ? 3 : 2);
                        auto in_file = file.begin() + 18;
                        for (int y = 4; y >= 0; y--, in_file += w * format)
                            CHECK(std::equal(picture.pixel(0, y), picture.pixel(0, y) + row, in_file));
                        CHECK(Bytes(file.end() - 26, file.end()) == footer());
                    }
                }
    CHECK(!fs::exists(folder() / "written.tga.part"));
}

TEST("a row of one colour is as few packets as there can be") {
    for (const TGAImage::Format format : all_formats)
        for (const int w : {1, 2, 3, 127, 128, 129, 130, 256, 257, 1024}) {
            picture_of(w, 3, format, [](int, int) { return 77; }).write_tga_file(folder() / "run.tga");
            for (const std::vector<Packet>& row : packets_written(read_bytes(folder() / "run.tga"), w, 3, format)) {
                CHECK_EQ(row.size(), size(w + 127) / 128);
                CHECK_EQ(row.front().length, std::min(w, 128));
                if (w > 2) CHECK(row.front().run);
            }
        }
}

TEST("alternating colours are raw packets, pairs of colours are runs only where that is shorter") {
    for (const TGAImage::Format format : all_formats) {
        picture_of(300, 2, format, [](int x, int) { return x % 2; }).write_tga_file(folder() / "run.tga");
        for (const std::vector<Packet>& row : packets_written(read_bytes(folder() / "run.tga"), 300, 2, format)) {
            CHECK_EQ(row.size(), std::size_t{3});
            for (const Packet& packet : row) CHECK(!packet.run);
        }
        picture_of(256, 2, format, [](int x, int) { return x / 2; }).write_tga_file(folder() / "run.tga");
        for (const std::vector<Packet>& row : packets_written(read_bytes(folder() / "run.tga"), 256, 2, format)) {
            CHECK_EQ(row.size(), size(format == TGAImage::GRAYSCALE ? 2 : 128));
            for (const Packet& packet : row) CHECK_EQ(packet.run, format != TGAImage::GRAYSCALE);
        }
    }
}

TEST("a run between raw pixels is a packet of its own") {
    for (const int run : {3, 127, 128, 129, 130, 256, 259}) {
        const auto value = [run](int x, int) { return x < 5 ? x : x < 5 + run ? 100 : x - run + 100; };
        picture_of(run + 10, 1, TGAImage::RGB, value).write_tga_file(folder() / "run.tga");
        const std::vector<Packet> row = packets_written(read_bytes(folder() / "run.tga"), run + 10, 1, 3).front();
        std::vector<Packet> expected{{false, 5}};
        for (int left = run; left > 0; left -= 128) expected.push_back({left > 1, std::min(left, 128)});
        if (expected.back().run) expected.push_back({false, 5});
        else expected.back().length += 5;  // a run of 129 is one of 128 and a pixel that goes with the raw ones
        CHECK_EQ(row.size(), expected.size());
        for (std::size_t i = 0; i < std::min(row.size(), expected.size()); i++) {
            CHECK_EQ(row[i].run, expected[i].run);
            CHECK_EQ(row[i].length, expected[i].length);
        }
    }
}

TEST("a file that ends before its last pixel is refused at every byte") {
    unsigned seed = 1;
    for (const Kind& kind : all_kinds()) {
        const Built built = build(kind, 7, 3, 0, "ID", true, seed++);
        for (std::size_t n = 0; n < built.pixels_end; n++) {
            const std::string message = n == 0 ? "byte 0: the file is empty" : "byte " + std::to_string(n) + ": the ";
            const std::string wrong = unless_refused(first(built.bytes, n), message);
            if (!CHECK_EQ(wrong, "")) std::cerr << name_of(kind) << ", " << n << " bytes\n";
        }
        CHECK_EQ(difference(read(first(built.bytes, built.pixels_end)), built.picture), "");
    }
}

TEST("what is cut off is named") {
    const Built built = build({9, 8, 0, 24, 0, 100}, 50, 50, 0, "ID", false, 1);
    const auto cut = [&](std::size_t n) { return first(built.bytes, n); };
    CHECK_EQ(unless_refused(cut(17), "byte 17: the header is truncated"), "");
    CHECK_EQ(unless_refused(cut(19), "byte 19: the image ID is truncated"), "");
    CHECK_EQ(unless_refused(cut(built.pixels_at - 1), "byte 319: the colour map is truncated"), "");
    CHECK_EQ(unless_refused(cut(built.pixels_at + 2),
                            "byte 322: the pixel data is truncated: 50 x 50 pixels cannot come from 2 bytes"), "");
    CHECK_EQ(unless_refused(cut(built.pixels_end - 1), ": the pixel data is truncated"), "");
}

TEST("a header that cannot be right is refused, and the message names the byte") {
    struct Case {
        std::size_t at;
        int value;
        const char* message;
    };
    const auto refused = [](const Kind& kind, const std::vector<Case>& cases) {
        const Bytes good = build(kind, 5, 4, 0, "", true, 1).bytes;
        CHECK_EQ(difference(read(good), build(kind, 5, 4, 0, "", true, 1).picture), "");
        for (const Case& c : cases) {
            Bytes bad = good;
            bad[c.at] = byte(c.value);
            CHECK_EQ(unless_refused(bad, "read.tga: " + std::string(c.message)), "");
        }
    };
    refused({2, 24}, {{1, 2, "byte 1: colour map type 2 is not 0 or 1"},
                      {2, 0, "byte 2: image type 0 is not 1, 2, 3, 9, 10 or 11"},
                      {2, 4, "byte 2: image type 4 is not"},
                      {2, 8, "byte 2: image type 8 is not"},
                      {2, 32, "byte 2: image type 32 is not"},
                      {2, 1, "byte 1: a colour-mapped picture without a colour map"},
                      {12, 0, "byte 12: the picture is 0 pixels wide"},
                      {14, 0, "byte 14: the picture is 0 pixels high"},
                      {16, 8, "byte 16: colour depth 8 is not 15, 16, 24 or 32"},
                      {16, 0, "byte 16: colour depth 0 is not"},
                      {16, 23, "byte 16: colour depth 23 is not"},
                      {17, 0x40, "byte 17: interleaved rows are not supported"},
                      {17, 0x80, "byte 17: interleaved rows are not supported"},
                      {12, 255, "byte 104: the pixel data is truncated"},
                      {15, 255, "byte 104: the pixel data is truncated"}});
    refused({11, 8}, {{16, 24, "byte 16: grey depth 24 is not 8 or 16"},
                      {16, 15, "byte 16: grey depth 15 is not 8 or 16"}});
    refused({1, 8, 0, 24, 0, 9}, {{16, 24, "byte 16: index depth 24 is not 8 or 16"},
                                  {7, 8, "byte 7: colour map depth 8 is not 15, 16, 24 or 32"},
                                  {5, 0, "byte 5: the colour map has no entries"},
                                  {6, 255, "byte 91: the colour map is truncated"}});
}

TEST("a colour index outside the map is refused, and the message names its byte") {
    for (const int rle : {0, 8})
        for (const int index : {9, 30, 255}) {
            Bytes file = header({1 + rle, 8, 0, 24, 10, 20}, 3, 1, 0, 0);
            file.resize(18 + 60);
            if (rle) file.push_back(2);
            append(file, {10, 29, byte(index)});
            const std::string message = "colour index " + std::to_string(index) + " is outside the map, 10 to 29";
            CHECK_EQ(unless_refused(file, (rle ? "byte 81: " : "byte 80: ") + message), "");
        }
    for (const int index : {999, 1600, 65535}) {
        Bytes file = header({9, 16, 0, 16, 1000, 600}, 3, 1, 0, 0);
        file.resize(18 + 1200);
        append(file, {0x82, byte(index), byte(index >> 8)});
        CHECK_EQ(unless_refused(file, "byte 1219: colour index " + std::to_string(index) + " is outside"), "");
    }
}

TEST("a packet that goes beyond the last pixel is refused") {
    for (const int run : {0, 0x80}) {
        Bytes file = header({11, 8}, 3, 3, 0, 0);
        append(file, {0x80 | 6, 7, byte(run | 1), 1, 2});
        CHECK_EQ(difference(read(file), [&] {
                     TGAImage picture(3, 3, TGAImage::GRAYSCALE);
                     for (int i = 0; i < 9; i++) picture.set(i % 3, i / 3, {{byte(i < 7 ? 7 : run || i == 7 ? 1 : 2)}});
                     return picture;
                 }()), "");
        file[20] = byte(run | 2);
        append(file, {3, 4, 5});
        CHECK_EQ(unless_refused(file, "byte 20: a packet goes beyond the last pixel"), "");
    }
}

TEST("text, other formats and what is no file are refused with a clear word") {
    const auto text = [](const std::string& s) { return Bytes(s.begin(), s.end()); };
    for (const char* const s : {"v 0.1 0.2 0.3\nv 0.4 0.5 0.6\n", "a\n\n", "\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n"})
        CHECK_EQ(unless_refused(text(s), "byte 0: the file is text, not a TGA picture"), "");
    CHECK_EQ(unless_refused(text("\x89PNG\r\n\x1A\n and so on, a good deal of it"), "byte 1: colour map type 80"), "");
    CHECK_THROWS(TGAImage::read_tga_file(folder() / "none.tga"), "none.tga: cannot open: No such file or directory");
    CHECK_THROWS(TGAImage::read_tga_file(folder().path()), ": cannot read: it is not a regular file");
}

TEST("a short file that claims a large picture costs no memory") {
    for (const Kind& kind : all_kinds()) {
        Bytes file = header(kind, 65535, 65535, 0, 0);
        file.resize(18 + size(kind.map_length * 4));
        write_bytes(folder() / "large.tga", file);
        const std::size_t before = bytes_asked_for();
        CHECK_THROWS(TGAImage::read_tga_file(folder() / "large.tga"), "truncated");
        CHECK(bytes_asked_for() - before < 70000);  // the window of 64 KiB, names and messages
    }
}

TEST("a file makes the reader ask for no more than 256 times its size and the window") {
    Bytes file = header({9, 8, 1, 16, 0, 1}, 128, 1000, 0, 0);  // the worst that can be: 2 bytes make 128 pixels of 4
    append(file, {0, 0});
    for (int i = 0; i < 1000; i++) append(file, {0xFF, 0});
    write_bytes(folder() / "worst.tga", file);
    const std::size_t before = bytes_asked_for();
    CHECK_EQ(TGAImage::read_tga_file(folder() / "worst.tga").width(), 128);
    CHECK(bytes_asked_for() - before < 256 * file.size() + 70000);
}

TEST("random bytes are refused or read, never more") {
    std::mt19937 random(20);
    const std::vector<Kind> kinds = all_kinds();
    int was_read = 0;
    for (int i = 0; i < 20000; i++) {
        Bytes file;
        if (i % 4 == 0) {  // nothing but noise, with a type that exists
            file.resize(random() % 200);
            for (std::uint8_t& b : file) b = byte(any(random, 256));
            if (file.size() > 17) {
                file[1] = byte(any(random, 2));
                file[2] = byte(1 + any(random, 3) + 8 * any(random, 2));
                for (const std::size_t at : {4u, 6u, 13u, 15u}) file[at] = 0;
                file[16] = byte(std::array{8, 15, 16, 24, 32}[random() % 5]);
                file[17] &= 0x3F;
            }
        } else {  // a good file with some bytes changed, or cut
            const int w = 1 + any(random, 40), h = 1 + any(random, 10), origin = any(random, 4) * 16;
            file = build(kinds[random() % kinds.size()], w, h, origin, "ID", true, static_cast<unsigned>(i)).bytes;
            for (unsigned k = random() % 4; k > 0; k--)
                file[random() % 3 ? random() % file.size() : random() % 18] = byte(any(random, 256));
            if (random() % 4 == 0) file.resize(random() % file.size());
        }
        write_bytes(folder() / "random.tga", file);
        const std::size_t before = bytes_asked_for();
        try {
            const TGAImage picture = TGAImage::read_tga_file(folder() / "random.tga");
            CHECK(picture.width() > 0 && picture.height() > 0);
            was_read++;
        } catch (const std::runtime_error& e) {
            CHECK(std::strstr(e.what(), "random.tga: byte "));
        }
        CHECK(bytes_asked_for() - before <= 256 * file.size() + 70000);
    }
    CHECK(was_read > 1000 && was_read < 19000);  // both kinds were thrown
}

TEST("a picture of 0 x 0 pixels cannot be written") {
    bool refused = false;
    try {
        TGAImage().write_tga_file(folder() / "empty.tga");
    } catch (const std::invalid_argument& e) {
        refused = std::strstr(e.what(), "empty.tga: a picture of 0 x 0 pixels cannot be written");
    }
    CHECK(refused);
    CHECK(!fs::exists(folder() / "empty.tga"));
}

TEST("where writing fails the old picture stays and nothing else is left") {
    const TemporaryFolder own("tgaimage_atomic");
    const fs::path target = own / "picture.tga", part = own / "picture.tga.part";
    const TGAImage old = picture_of(20, 10, TGAImage::RGB, [](int x, int y) { return x * y; });
    std::mt19937 random(1);
    const TGAImage large = picture_of(500, 500, TGAImage::RGB, [&](int, int) { return any(random, 256); });
    old.write_tga_file(target);
    const Bytes before = read_bytes(target);
    const auto unchanged = [&] {
        std::vector<std::string> names;
        for (const auto& entry : fs::directory_iterator(own.path())) names.push_back(entry.path().filename().string());
        return read_bytes(target) == before && names == std::vector<std::string>{"picture.tga"};
    };

    CHECK_THROWS(large.write_tga_file(own / "missing/picture.tga"),
                 "missing/picture.tga: cannot write: No such file or directory");
    CHECK(unchanged());
    CHECK_THROWS(large.write_tga_file(target / "picture.tga"), "cannot write: Not a directory");
    CHECK(unchanged());
    CHECK_THROWS(large.write_tga_file(own.path()), "cannot write: it is not a regular file");
    CHECK(unchanged());
    CHECK_THROWS(large.write_tga_file(own / std::string(300, 'x')), "cannot write: File name too long");
    CHECK(unchanged());

    fs::create_directory(part);  // the temporary file cannot be opened
    CHECK_THROWS(large.write_tga_file(target), "picture.tga: cannot write: Is a directory");
    CHECK(fs::is_directory(part));
    fs::remove(part);
    CHECK(unchanged());

    if (fs::is_character_file("/dev/full")) {  // a device on which every write fails for want of space
        for (const TGAImage* const picture : {&old, &large}) {  // on closing, and long before
            fs::create_symlink("/dev/full", part);
            CHECK_THROWS(picture->write_tga_file(target), "picture.tga: cannot write: No space left on device");
            CHECK(unchanged());
        }
    } else {
        std::cout << "no /dev/full here: a full disk is not tested\n";
    }
    if (fs::is_character_file("/dev/null")) {
        fs::create_symlink("/dev/null", own / "device.tga");
        CHECK_THROWS(large.write_tga_file(own / "device.tga"), "device.tga: cannot write: it is not a regular file");
        CHECK(fs::is_symlink(own / "device.tga"));
        fs::remove(own / "device.tga");
        CHECK(unchanged());
    }

    fs::permissions(own.path(), fs::perms::owner_read | fs::perms::owner_exec);
    if (std::ofstream(own / "probe")) {
        std::cout << "this user may write everywhere: a folder without permission is not tested\n";
        fs::remove(own / "probe");
    } else {
        CHECK_THROWS(large.write_tga_file(target), "picture.tga: cannot write: Permission denied");
        CHECK(unchanged());
    }
    fs::permissions(own.path(), fs::perms::owner_all);

    large.write_tga_file(target);  // and now nothing is in the way
    CHECK_EQ(difference(TGAImage::read_tga_file(target), large), "");
    CHECK(!fs::exists(part));
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
