// png.cpp: PNG files (ISO/IEC 15948): chunks and filters. The compression is in deflate.cpp.
#include "png.h"

#include "deflate.h"
#include "files.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <stdexcept>

namespace {

using Byte = std::uint8_t;

constexpr Byte signature[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
enum ColourType { grey = 0, rgb = 2, rgba = 6 };

std::uint32_t crc32(const Byte* begin, const Byte* end) {
    static const std::array<std::uint32_t, 256> table = [] {
        std::array<std::uint32_t, 256> t{};
        for (std::uint32_t i = 0; i < 256; i++) {
            t[i] = i;
            for (int k = 0; k < 8; k++) t[i] = (t[i] & 1 ? 0xEDB88320 : 0) ^ t[i] >> 1;
        }
        return t;
    }();
    std::uint32_t crc = 0xFFFFFFFF;
    for (; begin < end; begin++) crc = table[(crc ^ *begin) & 255] ^ crc >> 8;
    return ~crc;
}

// Where a TGAImage has the channel that is PNG's c-th: PNG has red first.
int channel(int c, int bpp) { return bpp > 1 && c < 3 ? 2 - c : c; }

// What a filter predicts for a byte from its neighbours, which are 0 outside the picture.
int predict(int filter, int left, int up, int corner) {
    if (filter == 1) return left;
    if (filter == 2) return up;
    if (filter == 3) return (left + up) / 2;
    if (filter == 4) {  // the neighbour closest to left + up - corner
        const int from_left = std::abs(up - corner), from_up = std::abs(left - corner);
        const int from_corner = std::abs(left + up - 2 * corner);
        if (from_left <= from_up && from_left <= from_corner) return left;
        return from_up <= from_corner ? up : corner;
    }
    return 0;
}

// The bytes of the file's y-th row, top row first and red first; a row of zeros stands above the picture.
Bytes file_row(const TGAImage& picture, int y) {
    const int bpp = picture.bytespp();
    Bytes row;
    for (int x = 0; x < picture.width(); x++)
        for (int c = 0; c < bpp; c++)
            row.push_back(y < 0 ? Byte{0} : picture.pixel(x, picture.height() - 1 - y)[channel(c, bpp)]);
    return row;
}

// The rows, each behind the number of its filter: the one whose differences, taken as signed, have the least sum of
// absolute values, as the PNG specification proposes (12.7).
Bytes filtered(const TGAImage& picture) {
    const std::size_t bpp = static_cast<std::size_t>(picture.bytespp());
    Bytes rows, best;
    for (int y = 0; y < picture.height(); y++) {
        const Bytes row = file_row(picture, y), above = file_row(picture, y - 1);
        long least = 0;
        for (int filter = 0; filter <= 4; filter++) {
            long sum = 0;
            Bytes differences{static_cast<Byte>(filter)};
            for (std::size_t i = 0; i < row.size(); i++) {
                const int left = i < bpp ? 0 : row[i - bpp], corner = i < bpp ? 0 : above[i - bpp];
                differences.push_back(static_cast<Byte>(row[i] - predict(filter, left, above[i], corner)));
                sum += std::min<int>(differences.back(), 256 - differences.back());
            }
            if (filter > 0 && sum >= least) continue;
            least = sum;
            best = differences;
        }
        rows.insert(rows.end(), best.begin(), best.end());
    }
    return rows;
}

void put_u32(Bytes& out, std::size_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<Byte>(value >> shift));
}

void put_chunk(Bytes& file, const std::string& type, const Bytes& data) {
    put_u32(file, data.size());
    const std::size_t begin = file.size();
    file.insert(file.end(), type.begin(), type.end());
    file.insert(file.end(), data.begin(), data.end());
    put_u32(file, crc32(file.data() + begin, file.data() + file.size()));
}

// A file on its way to a picture; NAME stands for it in messages.
struct Decoding {
    Decoding(const Bytes& bytes, const std::string& file_name) : file(bytes), name(file_name) {}

    const Bytes& file;
    const std::string& name;
    std::size_t width = 0, height = 0;
    TGAImage::Format format = TGAImage::GRAYSCALE;
    Bytes stream;  // the data of all IDAT chunks

    void fail(std::size_t at, const std::string& what) const {
        throw std::runtime_error(name + ": byte " + std::to_string(at) + ": " + what);
    }
    std::size_t u32(std::size_t at) const {
        std::size_t value = 0;
        for (std::size_t i = 0; i < 4; i++) value = value << 8 | file[at + i];
        return value;
    }
    void read_header(std::size_t at);
    void read_chunks();
    TGAImage unfilter(Bytes rows) const;
};

void Decoding::read_header(std::size_t at) {
    const auto side = [&](std::size_t place) {
        const std::size_t pixels = u32(place);
        if (pixels < 1 || pixels > 65535) fail(place, "a side of " + std::to_string(pixels) + " pixels");
        return pixels;
    };
    width = side(at);
    height = side(at + 4);
    if (file[at + 8] != 8) fail(at + 8, "a depth of " + std::to_string(file[at + 8]) + " bits is not supported");
    const int colour_type = file[at + 9];
    if (colour_type == grey) format = TGAImage::GRAYSCALE;
    else if (colour_type == rgb) format = TGAImage::RGB;
    else if (colour_type == rgba) format = TGAImage::RGBA;
    else fail(at + 9, "colour type " + std::to_string(colour_type) + " is not supported");
    if (file[at + 10] != 0) fail(at + 10, "an unknown compression");
    if (file[at + 11] != 0) fail(at + 11, "an unknown set of filters");
    if (file[at + 12] != 0) fail(at + 12, "interlacing is not supported");
}

void Decoding::read_chunks() {
    if (file.size() < sizeof signature || !std::equal(std::begin(signature), std::end(signature), file.begin()))
        fail(0, "this is no PNG file");
    const auto place = [&](std::size_t at) { return file.begin() + static_cast<std::ptrdiff_t>(at); };
    std::string type, before;
    for (std::size_t at = sizeof signature; type != "IEND";) {
        constexpr std::size_t frame = 12;  // length, type and CRC
        if (file.size() - at < frame || file.size() - at - frame < u32(at)) fail(file.size(), "a chunk is truncated");
        const std::size_t begin = at + 8, end = begin + u32(at);  // of the chunk's data
        before = type;
        type.assign(place(at + 4), place(begin));
        if (!std::all_of(place(at + 4), place(begin), [](Byte b) { return std::isalpha(b); }))
            fail(at + 4, "the type of a chunk is not four letters");
        const std::uint32_t crc = crc32(file.data() + at + 4, file.data() + end);
        if (u32(end) != crc) fail(end, "the check sum of " + type + " is wrong");
        if ((type == "IHDR") != (at == sizeof signature)) fail(at + 4, "IHDR must be the first chunk, and no other");
        if (type == "IHDR") {
            if (end - begin != 13) fail(at, "IHDR must have 13 bytes");
            read_header(begin);
        } else if (type == "IDAT") {
            if (!stream.empty() && before != "IDAT") fail(at + 4, "IDAT chunks must follow one another");
            stream.insert(stream.end(), place(begin), place(end));
        } else if (type != "IEND" && type != "PLTE" && std::isupper(file[at + 4])) {  // PLTE is only a hint here
            fail(at + 4, "chunk " + type + " is unknown, but may not be passed over");
        }
        at = end + 4;
        if (type == "IEND" && at < file.size()) fail(at, "bytes after IEND");
    }
}

// Undoes the filters, row by row from the top: the rows are replaced by what they stand for.
TGAImage Decoding::unfilter(Bytes rows) const {
    TGAImage picture(static_cast<int>(width), static_cast<int>(height), format);
    const std::size_t bpp = static_cast<std::size_t>(format), row_size = 1 + width * bpp;
    for (int y = 0; y < picture.height(); y++) {
        Byte* const row = rows.data() + static_cast<std::size_t>(y) * row_size + 1;
        const Byte* const above = y == 0 ? nullptr : row - row_size;
        const int filter = row[-1];
        if (filter > 4) fail(file.size(), "row " + std::to_string(y) + " has filter " + std::to_string(filter));
        for (std::size_t i = 0; i + 1 < row_size; i++) {
            const int left = i < bpp ? 0 : row[i - bpp], up = above ? above[i] : 0;
            const int corner = i < bpp || !above ? 0 : above[i - bpp];
            row[i] = static_cast<Byte>(row[i] + predict(filter, left, up, corner));
        }
        for (int x = 0; x < picture.width(); x++)
            for (int c = 0; c < format; c++)
                picture.pixel(x, picture.height() - 1 - y)[channel(c, format)] = row[x * format + c];
    }
    return picture;
}

}  // namespace

TGAImage decode_png(const Bytes& file, const std::string& name) {
    Decoding decoding(file, name);
    decoding.read_chunks();
    const std::size_t size = decoding.height * (1 + decoding.width * static_cast<std::size_t>(decoding.format));
    return decoding.unfilter(inflate(decoding.stream, size, [&](std::size_t at, const std::string& what) {
        throw std::runtime_error(name + ": byte " + std::to_string(at) + " of the pixel data: " + what);
    }));
}

Bytes encode_png(const TGAImage& picture) {
    if (picture.empty()) throw std::invalid_argument("a picture of 0 x 0 pixels cannot be written");
    const int bpp = picture.bytespp();
    const ColourType colour_type = bpp == TGAImage::GRAYSCALE ? grey : bpp == TGAImage::RGB ? rgb : rgba;
    Bytes header;
    put_u32(header, static_cast<std::size_t>(picture.width()));
    put_u32(header, static_cast<std::size_t>(picture.height()));
    for (const int b : {8, int{colour_type}, 0, 0, 0}) header.push_back(static_cast<Byte>(b));  // bits; not interlaced
    Bytes file(std::begin(signature), std::end(signature));
    put_chunk(file, "IHDR", header);
    put_chunk(file, "IDAT", deflate(filtered(picture)));
    put_chunk(file, "IEND", {});
    return file;
}

TGAImage read_png_file(const std::filesystem::path& path) { return decode_png(read_bytes(path), path.string()); }

void write_png_file(const TGAImage& picture, const std::filesystem::path& path) {
    write_bytes(path, encode_png(picture));
}
