// png_test.cpp: the reader and writer of PNG files and the compression under them. Files to be read are built byte by
// byte from the format's description, or come from another program.
#include "png.h"

#include "check.h"
#include "deflate.h"
#include "files.h"
#include "memory.h"

#include <algorithm>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr TGAImage::Format all_formats[] = {TGAImage::GRAYSCALE, TGAImage::RGB, TGAImage::RGBA};

std::uint8_t byte(unsigned n) { return static_cast<std::uint8_t>(n & 255); }
unsigned any(std::mt19937& random, unsigned n) { return static_cast<unsigned>(random() % n); }  // in [0,n)
void append(Bytes& to, const Bytes& what) { to.insert(to.end(), what.begin(), what.end()); }
Bytes first(const Bytes& bytes, std::size_t n) { return Bytes(bytes.begin(), bytes.begin() + static_cast<int>(n)); }

Bytes u32(std::size_t value) {
    Bytes bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<std::uint8_t>(value >> shift));
    return bytes;
}

// ---- a PNG file, made by the book ----

std::size_t crc(const Bytes& bytes) {
    std::uint32_t c = 0xFFFFFFFF;
    for (const std::uint8_t b : bytes)
        for (unsigned i = 0; i < 8; i++) c = (c >> 1) ^ ((c ^ unsigned{b} >> i) & 1 ? 0xEDB88320 : 0);
    return ~c;
}

Bytes chunk(const std::string& type, const Bytes& data) {
    Bytes body(type.begin(), type.end());
    append(body, data);
    Bytes bytes = u32(data.size());
    append(bytes, body);
    append(bytes, u32(crc(body)));
    return bytes;
}

Bytes header(std::size_t w, std::size_t h, unsigned colour_type, unsigned depth = 8, unsigned interlaced = 0) {
    Bytes data = u32(w);
    append(data, u32(h));
    append(data, {byte(depth), byte(colour_type), 0, 0, byte(interlaced)});
    return chunk("IHDR", data);
}

Bytes png(const std::vector<Bytes>& chunks) {
    Bytes file{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
    for (const Bytes& c : chunks) append(file, c);
    return file;
}

Bytes adler(const Bytes& data) {
    std::size_t a = 1, b = 0;
    for (const std::uint8_t d : data) b += a += d;
    return u32(b % 65521 << 16 | a % 65521);  // the sums are small here
}

// A zlib stream that stores the data as it is, in blocks of at most LARGEST bytes.
Bytes stored(const Bytes& data, std::size_t largest = 65535) {
    Bytes stream{0x78, 0x01};
    std::size_t at = 0;
    do {
        const std::size_t n = std::min(largest, data.size() - at);
        const bool last = at + n == data.size();
        append(stream, {last, byte(static_cast<unsigned>(n)), byte(static_cast<unsigned>(n >> 8)),
                        byte(static_cast<unsigned>(~n)), byte(static_cast<unsigned>(~n >> 8))});
        stream.insert(stream.end(), data.begin() + static_cast<int>(at), data.begin() + static_cast<int>(at + n));
        at += n;
    } while (at < data.size());
    append(stream, adler(data));
    return stream;
}

// A deflate stream put together bit by bit; what it stands for is of no interest, for it is wrong.
class Bits {
public:
    Bits& number(unsigned value, unsigned n) {  // lowest bit first
        for (unsigned i = 0; i < n; i++) put(value >> i & 1);
        return *this;
    }
    Bits& code(unsigned value, unsigned n) {  // highest bit first
        for (unsigned i = n; i > 0; i--) put(value >> (i - 1) & 1);
        return *this;
    }
    Bytes stream() const {
        Bytes bytes{0x78, 0x01};
        append(bytes, bytes_);
        append(bytes, {0, 0, 0, 0, 0, 0, 0, 0});
        return bytes;
    }

private:
    void put(unsigned bit) {
        if (count_++ % 8 == 0) bytes_.push_back(0);
        bytes_.back() = byte(bytes_.back() | bit << (count_ - 1) % 8);
    }
    Bytes bytes_;
    unsigned count_ = 0;
};

Bytes inflated(const Bytes& stream, std::size_t size) {
    return inflate(stream, size, [](std::size_t at, const std::string& what) {
        throw std::runtime_error("byte " + std::to_string(at) + ": " + what);
    });
}

bool same(const TGAImage& a, const TGAImage& b) {
    if (a.width() != b.width() || a.height() != b.height() || a.bytespp() != b.bytespp()) return false;
    return std::equal(a.pixel(0, 0), a.pixel(0, a.height()), b.pixel(0, 0));  // the rows are one behind the other
}

template <typename Value>
TGAImage picture_of(int w, int h, TGAImage::Format format, Value value) {
    TGAImage picture(w, h, format);
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++)
            for (int c = 0; c < format; c++) picture.pixel(x, y)[c] = byte(static_cast<unsigned>(value(x, y, c)));
    return picture;
}

// Something like a rendered picture: a shaded disc with a noisy texture before a plain background.
TGAImage disc(int side, TGAImage::Format format) {
    std::mt19937 random(1);
    return picture_of(side, side, format, [&](int x, int y, int c) {
        const int dx = 2 * x - side, dy = 2 * y - side, r = dx * dx + dy * dy;
        return r > side * side * 3 / 4 ? 40 : 200 - c * 30 - r * 150 / (side * side) + static_cast<int>(any(random, 4));
    });
}

}  // namespace

TEST("what is written is read again, in every format") {
    std::mt19937 random(1);
    const int sizes[][2] = {{1, 1}, {1, 50}, {50, 1}, {3, 2}, {64, 64}, {300, 7}};
    for (const TGAImage::Format format : all_formats)
        for (const auto& s : sizes) {
            const TGAImage pictures[] = {
                picture_of(s[0], s[1], format, [](int, int, int) { return 0; }),
                picture_of(s[0], s[1], format, [](int x, int y, int c) { return x * 3 + y * 2 + c * 50; }),
                picture_of(s[0], s[1], format, [](int x, int y, int c) { return (x / 5 + y / 3) % 2 * 200 + c; }),
                picture_of(s[0], s[1], format, [&](int, int, int) { return any(random, 256); }),
                picture_of(s[0], s[1], format, [&](int, int, int) { return any(random, 3); })};
            for (const TGAImage& picture : pictures) CHECK(same(decode_png(encode_png(picture), "it"), picture));
        }
    CHECK(same(decode_png(encode_png(disc(200, TGAImage::RGB)), "it"), disc(200, TGAImage::RGB)));
}

TEST("a file on the disk has the same bytes, and the same picture makes the same file") {
    const TemporaryFolder folder("png_test");
    const TGAImage picture = disc(50, TGAImage::RGBA);
    write_png_file(picture, folder / "a.png");
    CHECK(read_bytes(folder / "a.png") == encode_png(picture));
    CHECK(encode_png(picture) == encode_png(disc(50, TGAImage::RGBA)));
    CHECK(same(read_png_file(folder / "a.png"), picture));
    CHECK_THROWS(read_png_file(folder / "none.png"), "none.png: cannot open");
    CHECK_THROWS(write_png_file(picture, folder / "none/a.png"), "a.png: cannot write");
    CHECK_THROWS(encode_png(TGAImage()), "0 x 0");
    write_bytes(folder / "text.png", {'t', 'e', 'x', 't'});
    CHECK_THROWS(read_png_file(folder / "text.png"), "text.png: byte 0: this is no PNG file");
}

// USUAL is what zlib 1.2.13 makes of the same filtered rows at its highest level. The chunks take 57 bytes more.
TEST("files are little larger than those of other programs") {
    const auto check = [](const TGAImage& picture, double usual) {
        const double size = static_cast<double>(encode_png(picture).size());
        if (!CHECK(size < 1.3 * usual + 57)) std::cerr << size << " bytes, usual are " << usual << '\n';
    };
    std::mt19937 random(1);
    check(disc(256, TGAImage::RGB), 50148);
    check(disc(256, TGAImage::GRAYSCALE), 17910);
    const auto rings = [](int x, int y, int c) { return (x * x + y * y) / 500 * (c + 1); };
    check(picture_of(512, 512, TGAImage::RGB, rings), 32747);
    check(picture_of(512, 512, TGAImage::RGB, [](int, int, int) { return 77; }), 1433);
    check(picture_of(256, 256, TGAImage::RGB, [&](int, int, int) { return any(random, 256); }), 196935);
}

TEST("the first row of the file is the top one, and red comes first") {
    const Bytes rows{0, 1, 2, 3, 4, 5, 6, 0, 11, 12, 13, 14, 15, 16};
    const TGAImage picture = decode_png(png({header(2, 2, 2), chunk("IDAT", stored(rows)), chunk("IEND", {})}), "it");
    CHECK_EQ(int{picture.get(0, 1)[2]}, 1);
    CHECK_EQ(int{picture.get(0, 1)[1]}, 2);
    CHECK_EQ(int{picture.get(0, 1)[0]}, 3);
    CHECK_EQ(int{picture.get(1, 1)[2]}, 4);
    CHECK_EQ(int{picture.get(0, 0)[2]}, 11);
    CHECK_EQ(int{picture.get(1, 0)[0]}, 16);
}

// Each row by hand, from the definitions in the specification, 9.
TEST("every filter is undone as the specification says") {
    const Bytes rows{1, 10, 20,  30, 200,   // left:  10 30 60 4
                     2, 1,  2,   3,  255,   // up:    11 32 63 3
                     3, 1,  2,   3,  4,     // mean of left and up, rounded down: 1+5 2+19 3+42 4+24
                     4, 5,  100, 1,  250};  // of left l, up u, corner c the closest to l+u-c
    // The last row: 5+u(6) = 11; l 11, u 21, c 6: 26 is closest to u, 121; l 121, u 45, c 21: 145 to l, 122;
    // l 122, u 28, c 45: 105 to l, 372 - 256 = 116.
    const int expected[4][4] = {{10, 30, 60, 4}, {11, 32, 63, 3}, {6, 21, 45, 28}, {11, 121, 122, 116}};
    const TGAImage picture = decode_png(png({header(4, 4, 0), chunk("IDAT", stored(rows)), chunk("IEND", {})}), "it");
    for (int y = 0; y < 4; y++)
        for (int x = 0; x < 4; x++) CHECK_EQ(int{picture.get(x, 3 - y)[0]}, expected[y][x]);

    // Where distances tie, left comes before up and up before corner. Corner 20: left 25 and up 10 make 15, as far from
    // up as from corner; left 10 and up 25 make 15, as far from left as from corner.
    for (const unsigned left : {25u, 10u}) {
        const Bytes tie{0, 20, byte(35 - left), 4, byte(left - 20), 0};
        const TGAImage two = decode_png(png({header(2, 2, 0), chunk("IDAT", stored(tie)), chunk("IEND", {})}), "it");
        CHECK_EQ(int{two.get(0, 0)[0]}, static_cast<int>(left));
        CHECK_EQ(int{two.get(1, 0)[0]}, 10);
    }
}

TEST("the filters of RGB look one pixel back, not one byte") {
    const Bytes rows{1, 10, 20, 30, 1, 2, 3, 4, 1, 1, 1, 1, 1, 1};
    const TGAImage picture = decode_png(png({header(2, 2, 2), chunk("IDAT", stored(rows)), chunk("IEND", {})}), "it");
    CHECK_EQ(int{picture.get(1, 1)[2]}, 11);
    CHECK_EQ(int{picture.get(1, 1)[1]}, 22);
    CHECK_EQ(int{picture.get(1, 1)[0]}, 33);
    CHECK_EQ(int{picture.get(1, 0)[2]}, 12);  // l 11, u 11, c 10: 12 is closest to l, 11; and 1 more
    CHECK_EQ(int{picture.get(1, 0)[0]}, 34);
}

TEST("blocks of every kind that another program wrote are read") {
    Bytes data(400, 7);
    for (std::size_t i = 0; i < 300; i++) data[i] = byte(static_cast<unsigned>(i * i / 9 % 8));
    const Bytes fixed{0x78, 0x01, 0x63, 0x60, 0x60, 0x60, 0x64, 0x64, 0x62, 0x61, 0x65, 0x67, 0x64, 0x66, 0x65, 0x60,
                      0x62, 0x65, 0x64, 0x61, 0x00, 0x42, 0x46, 0x56, 0x26, 0x06, 0x56, 0x66, 0x46, 0x76, 0x56, 0x16,
                      0x26, 0x46, 0x46, 0x06, 0x10, 0x18, 0x55, 0x03, 0x54, 0xC3, 0x4E, 0x07, 0x00, 0x00, 0x47, 0xA1,
                      0x05, 0x8A};
    const Bytes dynamic{0x78, 0xDA, 0xED, 0xCA, 0xB1, 0x11, 0x00, 0x30, 0x08, 0xC3, 0x40, 0xCB, 0xE0, 0x63, 0xFF, 0x8D,
                        0x43, 0x96, 0x48, 0x95, 0x57, 0x2B, 0x49, 0xE0, 0xCE, 0x50, 0x91, 0x43, 0x6B, 0x23, 0x56, 0x8A,
                        0x49, 0x1B, 0x74, 0xFD, 0x67, 0x9F, 0x79, 0xE0, 0x00, 0x47, 0xA1, 0x05, 0x8A};
    CHECK_EQ(fixed[2] >> 1 & 3, 1);
    CHECK_EQ(dynamic[2] >> 1 & 3, 2);
    CHECK(inflated(fixed, 400) == data);
    CHECK(inflated(dynamic, 400) == data);
    CHECK(inflated(stored(data), 400) == data);
    CHECK(inflated(stored(data, 1), 400) == data);
    CHECK(inflated(stored(data, 399), 400) == data);
    CHECK(inflated(stored({}), 0).empty());
    for (const Bytes& stream : {fixed, dynamic, stored(data, 77)}) {
        for (std::size_t n = 0; n < stream.size(); n++) CHECK_THROWS(inflated(first(stream, n), 400), "byte ");
        CHECK_THROWS(inflated(stream, 399), "more bytes than expected");
        CHECK_THROWS(inflated(stream, 401), "fewer bytes than expected");
        Bytes longer = stream;
        longer.push_back(0);
        CHECK_THROWS(inflated(longer, 400), "bytes after the compressed data");
    }
}

TEST("whatever is compressed is the same afterwards") {
    std::mt19937 random(1);
    const auto check = [](const Bytes& data) { CHECK(inflated(deflate(data), data.size()) == data); };
    check({});
    for (unsigned n = 1; n < 20; n++) check(Bytes(n, 5));
    for (const std::size_t n : {257u, 258u, 259u, 260u, 261u, 516u, 517u, 20000u}) check(Bytes(n, 5));
    for (const std::size_t period : {1u, 2u, 3u, 4u, 255u, 4096u, 4097u, 32768u, 32769u}) {  // far matches
        Bytes data;
        for (std::size_t i = 0; i < period; i++) data.push_back(byte(any(random, 256)));
        for (std::size_t i = 0; i < period + 300; i++) data.push_back(std::uint8_t{data[i]});
        check(data);
        if (period > 1000 && period <= 32768) CHECK(deflate(data).size() < period * 11 / 10);  // it was found
    }
    for (const unsigned values : {2u, 10u, 256u})
        for (const unsigned n : {1u, 2u, 3u, 10u, 1000u, 40000u}) {
            Bytes data(n);
            for (std::uint8_t& d : data) d = byte(any(random, any(random, values) + 1));  // small ones are frequent
            check(data);
        }
    for (const unsigned rarest : {10u, 20u, 30u}) {  // each value half as frequent as the last: codes of all lengths
        Bytes data(50000);
        for (std::uint8_t& d : data)
            for (d = 0; d < rarest && any(random, 2) == 0;) d++;
        check(data);
    }
}

TEST("a wrong stream is refused with a word that says why") {
    const auto refused = [](const Bits& bits, const char* why) { CHECK_THROWS(inflated(bits.stream(), 1000), why); };
    refused(Bits().number(1, 1).number(3, 2), "a block of type 3");
    refused(Bits().number(1, 1).number(0, 2).number(0, 5).number(5, 16).number(5, 16), "length and its complement");
    // Fixed codes: 8 bits for literals up to 143 from 0x30 on, 7 bits for 256 to 279, 8 bits for 280 on from 0xC0 on.
    const Bits fixed = Bits().number(1, 1).number(1, 2);
    refused(Bits(fixed).code(1, 7).code(0, 5), "a distance to before the first byte");
    refused(Bits(fixed).code(0x30, 8).code(1, 7).code(1, 5), "a distance to before the first byte");
    refused(Bits(fixed).code(0x30, 8).code(1, 7).code(30, 5), "a distance that does not exist");
    refused(Bits(fixed).code(0xC6, 8), "a length that does not exist");
    refused(Bits(fixed).code(0, 7), "fewer bytes than expected");
    // Dynamic codes: the number of literals less 257, of distances less 1, of code lengths less 4, then three bits for
    // each of these in the order 16, 17, 18, 0, 8, 7, 9, ...
    const Bits dynamic = Bits().number(1, 1).number(2, 2);
    refused(Bits(dynamic).number(30, 5), "more codes than there are symbols");
    refused(Bits(dynamic).number(0, 5).number(30, 5).number(0, 4), "more codes than there are symbols");
    const Bits smallest = Bits(dynamic).number(0, 5).number(0, 5).number(0, 4);
    refused(Bits(smallest).number(01111, 12), "more codes than there can be");
    refused(Bits(smallest).number(00000, 12), "a code that stands for nothing");
    refused(Bits(smallest).number(00011, 12).code(0, 1), "the first code length repeats the one before it");
    refused(Bits(smallest).number(00110, 12).code(1, 1).number(127, 7).code(1, 1).number(127, 7),
            "more code lengths than there are codes");

    const Bytes good = stored({1, 2, 3});
    const auto with = [&good](std::size_t at, unsigned value) {
        Bytes bad = good;
        bad[at] = byte(value);
        return bad;
    };
    CHECK_THROWS(inflated(with(0, 0x79), 3), "byte 0: this is no zlib stream");  // another method
    CHECK_THROWS(inflated(with(1, 0x02), 3), "byte 0: this is no zlib stream");  // another check of the header
    CHECK_THROWS(inflated(with(1, 0x20), 3), "byte 0: this is no zlib stream");  // a preset dictionary, rightly checked
    CHECK_THROWS(inflated(with(8, 0xFF), 3), "the check sum is wrong");
    CHECK_THROWS(inflated(with(13, 0xFF), 3), "the check sum is wrong");
}

TEST("a file with any bit turned over is refused") {
    const Bytes good = encode_png(disc(12, TGAImage::RGB));
    CHECK(same(decode_png(good, "it"), disc(12, TGAImage::RGB)));
    for (std::size_t i = 0; i < good.size(); i++)
        for (unsigned bit = 0; bit < 8; bit++) {
            Bytes bad = good;
            bad[i] = byte(bad[i] ^ 1u << bit);
            CHECK_THROWS(decode_png(bad, "it"), "it: byte ");
        }
}

TEST("a file that ends too early is refused at every byte") {
    const Bytes good = encode_png(disc(12, TGAImage::RGBA));
    for (std::size_t n = 0; n < good.size(); n++)
        CHECK_THROWS(decode_png(first(good, n), "it"), (n < 8 ? "this is no PNG file" : "a chunk is truncated"));
}

TEST("random changes that the CRC does not see are refused or harmless") {
    std::mt19937 random(1);
    const TGAImage picture = disc(20, TGAImage::RGB);
    const Bytes file = encode_png(picture);
    const Bytes stream(file.begin() + 41, file.end() - 16);  // between IHDR with IDAT's head, and IDAT's CRC with IEND
    CHECK(png({header(20, 20, 2), chunk("IDAT", stream), chunk("IEND", {})}) == file);
    int refused = 0;
    for (int i = 0; i < 2000; i++) {
        Bytes bad = stream;
        for (unsigned k = 1 + any(random, 3); k > 0; k--) bad[random() % bad.size()] = byte(any(random, 256));
        if (any(random, 4) == 0) bad.resize(random() % bad.size());
        try {
            CHECK(same(decode_png(png({header(20, 20, 2), chunk("IDAT", bad), chunk("IEND", {})}), "it"), picture));
        } catch (const std::runtime_error& e) {
            CHECK(std::strstr(e.what(), "it: byte "));
            refused++;
        }
    }
    CHECK(refused > 1800);
}

TEST("chunks that need not be known are passed over, and others are not") {
    const Bytes rows{0, 1, 0, 2}, stream = stored(rows), end = chunk("IEND", {}), pixels = chunk("IDAT", stream);
    const auto read = [&](const std::vector<Bytes>& chunks) { return int{decode_png(png(chunks), "it").get(0, 0)[0]}; };
    const Bytes text = chunk("tEXt", {'a', 0, 'b'}), none = chunk("IDAT", {});
    CHECK_EQ(read({header(1, 2, 0), text, pixels, text, end}), 2);
    CHECK_EQ(read({header(1, 2, 0), chunk("IDAT", first(stream, 5)), none,
                   chunk("IDAT", Bytes(stream.begin() + 5, stream.end())), end}), 2);
    CHECK_EQ(read({header(1, 2, 0), chunk("PLTE", {1, 2, 3}), pixels, end}), 2);
    CHECK_THROWS(read({header(1, 2, 0), chunk("ABCD", {}), pixels, end}), "byte 37: chunk ABCD is unknown");
    CHECK_THROWS(read({header(1, 2, 0), chunk("a1cd", {}), pixels, end}), "byte 37: the type of a chunk is not four");
    CHECK_THROWS(read({text, header(1, 2, 0), pixels, end}), "byte 12: IHDR must be the first chunk");
    CHECK_THROWS(read({header(1, 2, 0), header(1, 2, 0), pixels, end}), "byte 37: IHDR must be the first chunk");
    CHECK_THROWS(read({chunk("IHDR", {1}), pixels, end}), "byte 8: IHDR must have 13 bytes");
    CHECK_THROWS(read({header(1, 2, 0), chunk("IDAT", first(stream, 5)), text, pixels, end}), "IDAT chunks must");
    CHECK_THROWS(read({header(1, 2, 0), end}), "of the pixel data: the compressed data is truncated");
    CHECK_THROWS(read({header(1, 2, 0), pixels}), "a chunk is truncated");
    CHECK_THROWS(read({header(1, 2, 0), pixels, end, {0}}), "bytes after IEND");
}

TEST("a header that asks for more than is supported is refused, and the message names the byte") {
    const auto refused = [](const Bytes& ihdr, const char* why) {
        CHECK_THROWS(decode_png(png({ihdr, chunk("IDAT", stored({0, 1})), chunk("IEND", {})}), "it"), why);
    };
    refused(header(0, 1, 0), "it: byte 16: a side of 0 pixels");
    refused(header(1, 0, 0), "it: byte 20: a side of 0 pixels");
    refused(header(65536, 1, 0), "it: byte 16: a side of 65536 pixels");
    refused(header(1, 0xFFFFFFFF, 0), "it: byte 20: a side of 4294967295 pixels");
    refused(header(1, 1, 0, 16), "it: byte 24: a depth of 16 bits is not supported");
    refused(header(1, 1, 0, 1), "it: byte 24: a depth of 1 bits is not supported");
    refused(header(1, 1, 3), "it: byte 25: colour type 3 is not supported");
    refused(header(1, 1, 4), "it: byte 25: colour type 4 is not supported");
    refused(header(1, 1, 0, 8, 1), "it: byte 28: interlacing is not supported");
    refused(header(2, 1, 0), "fewer bytes than expected");
    refused(header(1, 1, 2), "fewer bytes than expected");
    CHECK_THROWS(decode_png(png({header(1, 2, 0), chunk("IDAT", stored({0, 1, 5, 1})), chunk("IEND", {})}), "it"),
                 "row 1 has filter 5");
}

TEST("a short file that claims a large picture costs no memory") {
    const Bytes file = png({header(65535, 65535, 6), chunk("IDAT", stored({0, 1})), chunk("IEND", {})});
    const std::size_t before = bytes_asked_for();
    CHECK_THROWS(decode_png(file, "it"), "the compressed data is truncated");
    CHECK(bytes_asked_for() - before < 5000);
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
