// tgaimage.cpp: reading and writing Truevision TGA files. It knows no other format, and not what a picture is for.
//
// A file is: a header of 18 bytes, an image ID, a colour map, the pixels row by row, and since version 2.0 a footer.
// Everything that a header claims is held against the bytes that the file has before memory is asked for.
#include "tgaimage.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <type_traits>

namespace fs = std::filesystem;
using Byte = std::uint8_t;

namespace {

constexpr int header_size = 18;
constexpr int longest_packet = 128;  // pixels
constexpr int rle_bit = 8;           // of the image type
constexpr int top_bit = 0x20, right_bit = 0x10, interleaving_bits = 0xC0, attribute_bits = 0x0F;  // of the descriptor

using Stream = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

Stream open(const fs::path& path, const char* mode) {
    errno = 0;
    return Stream(std::fopen(path.string().c_str(), mode), &std::fclose);
}

// ENOSPC and its like in words; to be called before anything else can touch errno.
std::string reason() { return errno ? std::generic_category().message(errno) : "unknown error"; }

// ---- reading ----

struct Header {
    int id_length, map_type, type, map_first, map_length, map_depth, width, height, depth, descriptor;

    bool rle() const { return type & rle_bit; }
    int kind() const { return type & ~rle_bit; }  // 1 colour-mapped, 2 true colour, 3 grey
    int pixel_bytes() const { return (depth + 7) / 8; }
    std::size_t map_bytes() const {
        return static_cast<std::size_t>(map_length) * static_cast<std::size_t>((map_depth + 7) / 8);
    }
    std::size_t pixels() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
};

// A file that is read from front to back through a window. The window stays in the cache and is all the memory that the
// file takes: for a file of 3 MB, the first touch of the pages it would land in costs 2 ms, as much as decoding it.
class Source {
public:
    explicit Source(const fs::path& path) : name_(path.string()), stream_(nullptr, &std::fclose), window_(1 << 16) {
        std::error_code error;
        const fs::file_status status = fs::status(path, error);
        if (fs::exists(status) && !fs::is_regular_file(status))  // opening a pipe would wait for ever
            throw std::runtime_error(name_ + ": cannot read: it is not a regular file");
        stream_ = open(path, "rb");
        if (!stream_) throw std::runtime_error(name_ + ": cannot open: " + reason());
        std::setvbuf(stream_.get(), nullptr, _IONBF, 0);  // the window is the buffer
        size_ = fs::file_size(path, error);
        if (error) throw std::runtime_error(name_ + ": cannot read: " + error.message());
        begin = end = window_.data();
    }

    // What the window holds now, the bytes from position() on. Who uses some of them moves BEGIN.
    const Byte* begin = nullptr;
    const Byte* end = nullptr;

    std::size_t size() const { return size_; }
    std::size_t position() const { return read_ - static_cast<std::size_t>(end - begin); }

    // Moves the window so that it begins at BEGIN, and fills it; at the end of the file it stays partly empty.
    void refill() {
        if (at_end_) return;
        const Byte* const kept = std::copy(begin, end, window_.data());
        const std::size_t room = window_.size() - static_cast<std::size_t>(kept - window_.data());
        errno = 0;
        const std::size_t n = std::fread(window_.data() + (kept - window_.data()), 1, room, stream_.get());
        if (std::ferror(stream_.get())) throw std::runtime_error(name_ + ": cannot read: " + reason());
        at_end_ = n < room;
        read_ += n;
        begin = window_.data();
        end = kept + n;
    }

    // Makes n bytes (at most the window) stand at BEGIN, or throws "byte N: the WHAT is truncated".
    void need(int n, const char* what) {
        if (end - begin < n) refill();
        if (end - begin < n) fail(read_, "the " + std::string(what) + " is truncated");
    }

    void skip(std::size_t n, const char* what) {
        while (n > 0) {
            need(1, what);
            const std::size_t step = std::min(n, static_cast<std::size_t>(end - begin));
            begin += step;
            n -= step;
        }
    }

    [[noreturn]] void fail(std::size_t position, const std::string& what) const {
        throw std::runtime_error(name_ + ": byte " + std::to_string(position) + ": " + what);
    }
    [[noreturn]] void fail(const Byte* at, const std::string& what) const {
        fail(read_ - static_cast<std::size_t>(end - at), what);
    }

private:
    std::string name_;
    Stream stream_;
    std::vector<Byte> window_;
    std::size_t size_ = 0;  // of the file
    std::size_t read_ = 0;  // bytes of the file that have been in the window
    bool at_end_ = false;
};

// Blanks, printable ASCII and anything that UTF-8 may hold. No TGA header looks so: its second byte is 0 or 1.
bool looks_like_text(const Byte* begin, const Byte* end) {
    return std::all_of(begin, end, [](Byte b) { return (b >= ' ' && b != 0x7F) || (b >= '\t' && b <= '\r'); });
}

Header read_header(Source& file) {
    file.refill();
    const Byte* const b = file.begin;
    const Byte* const end = b + std::min(file.end - b, std::ptrdiff_t{header_size});
    if (b == end) file.fail(b, "the file is empty");
    if (looks_like_text(b, end)) file.fail(b, "the file is text, not a TGA picture");
    file.need(header_size, "header");

    const auto u16 = [b](int i) { return b[i] | b[i + 1] << 8; };
    const Header h{b[0], b[1], b[2], u16(3), u16(5), b[7], u16(12), u16(14), b[16], b[17]};
    const auto is_one_of = [](int value, std::initializer_list<int> list) {
        return std::find(list.begin(), list.end(), value) != list.end();
    };
    const auto refuse = [&file](std::size_t byte, const std::string& what, int value, const std::string& allowed) {
        file.fail(byte, what + " " + std::to_string(value) + " is not " + allowed);
    };
    if (h.map_type > 1) refuse(1, "colour map type", h.map_type, "0 or 1");
    if (!is_one_of(h.type, {1, 2, 3, 9, 10, 11})) refuse(2, "image type", h.type, "1, 2, 3, 9, 10 or 11");
    if (h.kind() == 1) {
        if (h.map_type == 0) file.fail(1, "a colour-mapped picture without a colour map");
        if (h.map_length == 0) file.fail(5, "the colour map has no entries");
        if (!is_one_of(h.map_depth, {15, 16, 24, 32})) refuse(7, "colour map depth", h.map_depth, "15, 16, 24 or 32");
        if (!is_one_of(h.depth, {8, 16})) refuse(16, "index depth", h.depth, "8 or 16");
    } else if (h.kind() == 2) {
        if (!is_one_of(h.depth, {15, 16, 24, 32})) refuse(16, "colour depth", h.depth, "15, 16, 24 or 32");
    } else if (!is_one_of(h.depth, {8, 16})) {
        refuse(16, "grey depth", h.depth, "8 or 16");
    }
    if (h.width == 0) file.fail(12, "the picture is 0 pixels wide");
    if (h.height == 0) file.fail(14, "the picture is 0 pixels high");
    if (h.descriptor & interleaving_bits) file.fail(17, "interleaved rows are not supported");
    file.begin += header_size;
    return h;
}

// Five bits a channel, blue lowest, and an attribute bit that stands for alpha.
TGAColor from_five_bits(const Byte* p) {
    const int v = p[0] | p[1] << 8;
    const auto eight = [v](int shift) {
        const int five = v >> shift & 31;
        return static_cast<Byte>((five * 255 + 15) / 31);  // to the nearest; 31 is odd, so nothing lies halfway
    };
    return {{eight(0), eight(5), eight(10), static_cast<Byte>(v & 0x8000 ? 255 : 0)}};
}

// The converters: IN bytes a pixel in the file, OUT bytes in memory. convert(p, n, dst) takes n pixels from p to dst.

template <int bytes>
struct Same {
    static constexpr int in = bytes, out = bytes;
    void operator()(const Byte* p, int n, Byte* dst) const { std::memcpy(dst, p, static_cast<std::size_t>(n * bytes)); }
};

// Eight bits of grey, then eight of alpha. The alpha is dropped: a grey TGAImage has no room for it, and nobody who
// reads a grey map looks at it.
struct GreyOfGreyAlpha {
    static constexpr int in = 2, out = 1;
    void operator()(const Byte* p, int n, Byte* dst) const {
        for (int i = 0; i < n; i++) dst[i] = p[i * in];
    }
};

template <int bytes>
struct FiveBits {
    static constexpr int in = 2, out = bytes;
    void operator()(const Byte* p, int n, Byte* dst) const {
        for (int i = 0; i < n; i++) std::memcpy(dst + i * out, from_five_bits(p + i * in).bgra, out);
    }
};

template <int index_bytes, int bytes>
struct Mapped {
    static constexpr int in = index_bytes, out = bytes;
    const Source& file;
    int first;
    const std::vector<TGAColor>& map;

    void operator()(const Byte* p, int n, Byte* dst) const {
        for (int i = 0; i < n; i++, p += in, dst += out) {
            const int index = in == 1 ? p[0] : p[0] | p[1] << 8;
            const std::size_t entry = static_cast<std::size_t>(index - first);  // an index below FIRST becomes huge
            if (entry >= map.size()) {
                const int last = first + static_cast<int>(map.size()) - 1;
                file.fail(p, "colour index " + std::to_string(index) + " is outside the map, " +
                                 std::to_string(first) + " to " + std::to_string(last));
            }
            std::memcpy(dst, map[entry].bgra, out);
        }
    }
};

// Packets average a few pixels in real textures, so that decoding them is a matter of mispredicted branches, not of
// bytes: where this many bytes are free behind a packet, in the row and in the file, it is stored in blocks of fixed
// size which may overshoot; what they spoil is overwritten by the packets that follow in the row. At 1024 x 1024 that
// takes a 24-bit picture of 175 000 packets from 2.3 to 2.0 ms and an 8-bit one of 218 000 packets from 2.1 to 1.2 ms.
constexpr int overshoot = 32;

// Copies n pixels; up to OVERSHOOT bytes behind them may be read and written.
template <int bytes>
void copy_blocks(Byte* dst, const Byte* src, int n) {
    for (int i = 0; i < n * bytes; i += overshoot) std::memcpy(dst + i, src + i, overshoot);
}

// Repeats the pixel at dst n - 1 times behind it; up to OVERSHOOT bytes behind them may be written.
template <int bytes>
void repeat_blocks(Byte* dst, int n) {
    constexpr int together = 8;  // pixels
    Byte pixel[4];
    std::memcpy(pixel, dst, 4);
    for (int i = 0; i < n; i += together, dst += together * bytes)
        for (int k = 0; k < together; k++) std::memcpy(dst + k * bytes, pixel, 4);
}
template <>
void repeat_blocks<1>(Byte* dst, int n) {
    const Byte grey = *dst;
    for (int i = 0; i < n; i += overshoot) std::memset(dst + i, grey, overshoot);
}

template <int bytes>
void repeat(Byte* dst, int n) {
    for (int i = bytes; i < n * bytes; i++) dst[i] = dst[i - bytes];
}

// Decodes the pixels, which come next in the file, into the picture, whose size and format are set. Whether the file's
// first row is the picture's lowest or its highest is a matter of where it is put.
template <typename Convert>
void decode(Source& file, const Header& h, TGAImage& image, const Convert& convert) {
    constexpr int in = Convert::in, out = Convert::out;
    const auto row = [&](int y) { return image.pixel(0, h.descriptor & top_bit ? h.height - 1 - y : y); };
    if (!h.rle()) {
        for (int y = 0; y < h.height; y++)
            for (int x = 0, n; x < h.width; x += n) {
                file.need(in, "pixel data");
                n = static_cast<int>(std::min<std::ptrdiff_t>(h.width - x, (file.end - file.begin) / in));
                convert(file.begin, n, row(y) + x * out);
                file.begin += n * in;
            }
        return;
    }

    std::size_t missing = h.pixels();  // after the packet at hand
    int left = 0;                      // pixels of the packet at hand that are not in the picture yet
    bool run = false;
    const Byte* src = file.begin;
    const Byte* end = file.end;
    for (int y = 0; y < h.height; y++) {
        Byte* dst = row(y);
        for (int x = 0; x < h.width;) {
            if (left == 0) {
                if (end - src < 1 + longest_packet * in + overshoot) {
                    file.begin = src;
                    file.refill();
                    src = file.begin;
                    end = file.end;
                    file.need(1, "pixel data");
                }
                run = *src & 0x80;
                left = (*src & 0x7F) + 1;
                if (static_cast<std::size_t>(left) > missing) file.fail(src, "a packet goes beyond the last pixel");
                missing -= static_cast<std::size_t>(left);
                src++;
                if (end - src < (run ? in : left * in)) file.fail(end, "the pixel data is truncated");
            }
            const int n = std::min(left, h.width - x);
            const bool roomy = (h.width - x - n) * out >= overshoot;
            if (run) {
                convert(src, 1, dst);
                roomy ? repeat_blocks<out>(dst, n) : repeat<out>(dst, n);
                if (n == left) src += in;
            } else {
                constexpr bool unchanged = std::is_same_v<Convert, Same<out>>;
                if (unchanged && roomy && end - src >= n * in + overshoot) copy_blocks<out>(dst, src, n);
                else convert(src, n, dst);
                src += n * in;
            }
            left -= n;
            x += n;
            dst += n * out;
        }
    }
}

std::vector<TGAColor> read_map(Source& file, const Header& h) {
    std::vector<TGAColor> map(static_cast<std::size_t>(h.map_length));
    const int bytes = (h.map_depth + 7) / 8;
    for (TGAColor& color : map) {
        file.need(bytes, "colour map");
        if (bytes == 2) color = from_five_bits(file.begin);
        else std::memcpy(color.bgra, file.begin, static_cast<std::size_t>(bytes));
        file.begin += bytes;
    }
    return map;
}

// The format that a picture comes out in: the file's, or its colour map's. 32 bits have alpha even where the header
// declares no attribute bits: many programs write it so.
TGAImage::Format format_of(const Header& h) {
    if (h.kind() == 3) return TGAImage::GRAYSCALE;
    const int depth = h.kind() == 1 ? h.map_depth : h.depth;
    const bool alpha = depth == 32 || (depth <= 16 && (h.descriptor & attribute_bits) == 1);
    return alpha ? TGAImage::RGBA : TGAImage::RGB;
}

template <int bytes>
void decode_mapped(Source& file, const Header& h, TGAImage& image, const std::vector<TGAColor>& map) {
    if (h.depth == 8) decode(file, h, image, Mapped<1, bytes>{file, h.map_first, map});
    else decode(file, h, image, Mapped<2, bytes>{file, h.map_first, map});
}

void mirror_rows(TGAImage& image) {
    for (int y = 0; y < image.height(); y++)
        for (int left = 0, right = image.width() - 1; left < right; left++, right--)
            std::swap_ranges(image.pixel(left, y), image.pixel(left, y) + image.bytespp(), image.pixel(right, y));
}

}  // namespace

TGAImage::TGAImage(int width, int height, Format format) : w_(width), h_(height), bpp_(format) {
    if (width < 1 || width > 65535 || height < 1 || height > 65535)
        throw std::invalid_argument("a picture of " + std::to_string(width) + " x " + std::to_string(height) +
                                    " pixels: a side has 1 to 65535");
    data_.resize(static_cast<std::size_t>(w_) * static_cast<std::size_t>(h_) * static_cast<std::size_t>(bpp_) + 3);
}

TGAImage TGAImage::read_tga_file(const fs::path& path) {
    Source file(path);
    const Header h = read_header(file);
    file.skip(static_cast<std::size_t>(h.id_length), "image ID");
    const std::size_t map_bytes = h.map_type ? h.map_bytes() : 0;
    const std::size_t ahead = file.size() - std::min(file.size(), file.position());
    if (map_bytes > ahead) file.fail(file.size(), "the colour map is truncated");

    // Can the picture come from the bytes that are there? A packet of 1 + pixel_bytes gives at most 128 pixels.
    const std::size_t there = ahead - map_bytes, pixel_bytes = static_cast<std::size_t>(h.pixel_bytes());
    const std::size_t most = h.rle() ? there / (1 + pixel_bytes) * longest_packet : there / pixel_bytes;
    if (most < h.pixels())
        file.fail(file.size(), "the pixel data is truncated: " + std::to_string(h.width) + " x " +
                                   std::to_string(h.height) + " pixels cannot come from " + std::to_string(there) +
                                   " bytes");

    TGAImage image(h.width, h.height, format_of(h));
    if (h.kind() == 1) {
        const std::vector<TGAColor> map = read_map(file, h);
        if (image.bytespp() == RGB) decode_mapped<RGB>(file, h, image, map);
        else decode_mapped<RGBA>(file, h, image, map);
    } else {
        file.skip(map_bytes, "colour map");  // a map that no pixel uses
        if (h.kind() == 3 && h.depth == 8) decode(file, h, image, Same<GRAYSCALE>{});
        else if (h.kind() == 3) decode(file, h, image, GreyOfGreyAlpha{});
        else if (h.depth == 24) decode(file, h, image, Same<RGB>{});
        else if (h.depth == 32) decode(file, h, image, Same<RGBA>{});
        else if (image.bytespp() == RGB) decode(file, h, image, FiveBits<RGB>{});
        else decode(file, h, image, FiveBits<RGBA>{});
    }
    if (h.descriptor & right_bit) mirror_rows(image);
    return image;
}

// ---- writing ----

namespace {

// Writes the row as packets, none of which the next row shares, and returns the end of what was written.
template <int bytes>
Byte* encode_row(const Byte* row, int width, Byte* dst) {
    // A run takes 1 + BYTES and, amid raw pixels, another header for those behind it: two grey pixels are cheaper raw.
    constexpr int shortest_run = bytes == 1 ? 3 : 2;
    const auto raw = [&](int begin, int end) {
        for (int n; begin < end; begin += n) {
            n = std::min(end - begin, longest_packet);
            *dst++ = static_cast<Byte>(n - 1);
            dst = std::copy_n(row + begin * bytes, n * bytes, dst);
        }
    };
    int raw_begin = 0;
    for (int x = 0; x < width;) {
        const Byte* const pixel = row + x * bytes;
        const int most = std::min(width - x, longest_packet);
        int run = 1;
        while (run < most && std::memcmp(pixel, pixel + run * bytes, bytes) == 0) run++;
        if (run >= shortest_run) {
            raw(raw_begin, x);
            *dst++ = static_cast<Byte>(0x80 | (run - 1));
            dst = std::copy_n(pixel, bytes, dst);
            raw_begin = x + run;
        }
        x += run;
    }
    raw(raw_begin, width);
    return dst;
}

// What a file begins with. Byte by byte: length of the image ID, colour map type, image type, colour map (5), origin
// (4), width (2), height (2), depth, descriptor.
std::array<Byte, header_size> header_of(const TGAImage& image, bool rle) {
    const int w = image.width(), h = image.height(), depth = image.bytespp() * 8;
    const int type = (image.bytespp() == TGAImage::GRAYSCALE ? 3 : 2) | (rle ? rle_bit : 0);
    const int alpha_bits = image.bytespp() == TGAImage::RGBA ? 8 : 0;
    const int values[header_size] = {0,       0,      type,    0,      0,     0, 0, 0, 0, 0, 0, 0,
                                     w & 255, w >> 8, h & 255, h >> 8, depth, top_bit | alpha_bits};
    std::array<Byte, header_size> header;
    std::transform(std::begin(values), std::end(values), header.begin(), [](int b) { return static_cast<Byte>(b); });
    return header;
}

// What a file of version 2.0 ends with: extension area and developer directory at 0, that is none, then the signature
// and a zero byte, the literal's own.
constexpr char footer[] = "\0\0\0\0\0\0\0\0TRUEVISION-XFILE.";

[[noreturn]] void fail(const fs::path& path, const std::string& why) {
    throw std::runtime_error(path.string() + ": cannot write: " + why);
}

}  // namespace

void TGAImage::write_tga_file(const fs::path& path, bool rle) const { TGAFile(*this, path, rle).commit(); }

TGAFile::TGAFile(const TGAImage& image, const fs::path& path, bool rle) : path_(path), temporary_{} {
    if (image.empty()) throw std::invalid_argument(path.string() + ": a picture of 0 x 0 pixels cannot be written");
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    // Renaming would put the picture in the place of a device.
    if (fs::exists(status) && !fs::is_regular_file(status)) fail(path, "it is not a regular file");

    // A run saves at least the header of the raw packet before it, so that a row takes at most its own bytes and a
    // header for each 128 pixels.
    const int w = image.width(), bpp = image.bytespp();
    const std::size_t row_size = static_cast<std::size_t>(w) * static_cast<std::size_t>(bpp);
    const auto encode = bpp == TGAImage::GRAYSCALE ? encode_row<TGAImage::GRAYSCALE>
                        : bpp == TGAImage::RGB     ? encode_row<TGAImage::RGB>
                                                   : encode_row<TGAImage::RGBA>;
    std::vector<Byte> packets(row_size + static_cast<std::size_t>((w + longest_packet - 1) / longest_packet));
    std::vector<char> buffer(1 << 16);

    fs::path temporary = path;
    temporary += ".part";
    Stream stream = open(temporary, "wb");
    if (!stream) fail(path, reason());
    temporary_.path = temporary;

    std::setvbuf(stream.get(), buffer.data(), _IOFBF, buffer.size());
    const auto write = [&](const void* bytes, std::size_t size) {
        errno = 0;
        if (std::fwrite(bytes, 1, size, stream.get()) != size) fail(path, reason());
    };
    const std::array<Byte, header_size> header = header_of(image, rle);
    write(header.data(), header.size());
    for (int y = image.height() - 1; y >= 0; y--) {
        const Byte* const row = image.pixel(0, y);
        if (rle) write(packets.data(), static_cast<std::size_t>(encode(row, w, packets.data()) - packets.data()));
        else write(row, row_size);
    }
    write(footer, sizeof footer);
    errno = 0;
    if (std::fclose(stream.release())) fail(path, reason());  // flushes what is left
}

void TGAFile::commit() {
    std::error_code error;
    fs::rename(temporary_.path, path_, error);
    if (error) fail(path_, error.message());
    temporary_.path.clear();
}

TGAFile::Temporary::~Temporary() {
    std::error_code ignored;
    if (!path.empty()) fs::remove(path, ignored);
}
