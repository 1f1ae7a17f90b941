// png.cpp: PNG files: chunks, and compression (RFC 1951) by the fixed codes, which need no tables. Rows are not
// filtered: under those codes the differences of shades take more bytes than the shades. Back again the same way.
#include "png.h"

#include <algorithm>
#include <bit>
#include <stdexcept>

namespace {

using Byte = std::uint8_t;

struct Bits {
    Bytes bytes;
    int count = 0;  // modulo 8 the bits of the last byte

    void put(int value, int n) {  // lowest bit first
        for (int i = 0; i < n; i++, count++) {
            if (count % 8 == 0) bytes.push_back(0);
            bytes.back() = static_cast<Byte>(bytes.back() | (value >> i & 1) << count % 8);
        }
    }
    void code(int value, int n) {  // highest bit first
        for (int i = n - 1; i >= 0; i--) put(value >> i, 1);
    }
    void symbol(int s) {  // a byte, 256 for the end, or 257 and more for the length of a match
        if (s < 144) code(0x30 + s, 8);
        else if (s < 256) code(0x190 + s - 144, 9);
        else if (s < 280) code(s - 256, 7);
        else code(0xC0 + s - 280, 8);
    }
    // A match of 3 to 257 bytes. Codes of lengths and distances are for ranges that double: a value's leading bits, 3
    // of a length and 2 of a distance, choose the range, and the bits after them follow as they are.
    void match(int length, int distance) {
        const auto after = [](unsigned value, int leading) {
            return std::max(0, static_cast<int>(std::bit_width(value)) - leading);
        };
        const int l = length - 3, l_bits = after(l, 3), d = distance - 1, d_bits = after(d, 2);
        symbol(257 + 4 * l_bits + (l >> l_bits));
        put(l, l_bits);
        code(2 * d_bits + (d >> d_bits), 5);
        put(d, d_bits);
    }
};

// A zlib stream of one block. Of what went before, only the last place where the next three bytes hash alike is tried.
Bytes deflate(const Bytes& data) {
    constexpr int farthest = 32768, longest = 257;
    const int size = static_cast<int>(data.size());
    std::vector<int> last(1 << 15, -farthest - 1);
    Bits out{{0x78, 0x01}};
    out.put(0b011, 3);  // the last block, of fixed codes
    for (int at = 0, length; at < size; at += std::max(length, 1)) {
        length = 0;
        if (at + 3 <= size) {
            const int before = std::exchange(last[(data[at] << 10 ^ data[at + 1] << 5 ^ data[at + 2]) & 0x7FFF], at);
            const int most = at - before <= farthest ? std::min(longest, size - at) : 0;
            while (length < most && data[before + length] == data[at + length]) length++;
            if (length < 3) length = 0;
            else out.match(length, at - before);
        }
        if (length == 0) out.symbol(data[at]);
    }
    out.symbol(256);
    return out.bytes;
}

// What Bits wrote, from a byte on.
struct Taken {
    const Bytes& bytes;
    std::size_t at;  // in bits

    int get(int n) {  // lowest bit first
        int value = 0;
        for (int i = 0; i < n; i++, at++) value |= (bytes.at(at / 8) >> at % 8 & 1) << i;
        return value;
    }
    int code(int n, int value = 0) {  // highest bit first
        while (n-- > 0) value = value * 2 + get(1);
        return value;
    }
    int symbol() {
        int code_so_far = code(7);
        if (code_so_far < 0x18) return code_so_far + 256;
        code_so_far = code(1, code_so_far);
        if (code_so_far < 0xC0) return code_so_far - 0x30;
        if (code_so_far < 0xC8) return code_so_far - 0xC0 + 280;
        return code(1, code_so_far) - 0x190 + 144;
    }
    int in_range(int value, int leading) {  // of what is left of a length or a distance when its code is known
        const int bits = std::max(0, (value >> (leading - 1)) - 1);
        return ((value - (bits << (leading - 1))) << bits) + get(bits);
    }
};

// The data of a stream of deflate(), which is so long.
Bytes inflate(Taken in, std::size_t size) {
    Bytes out;
    if (in.get(3) != 0b011) throw std::invalid_argument("not one block of fixed codes");
    while (out.size() < size) {
        const int symbol = in.symbol();
        if (symbol < 256) {
            out.push_back(static_cast<Byte>(symbol));
        } else {
            const int length = in.in_range(symbol - 257, 3) + 3, distance = in.in_range(in.code(5), 2) + 1;
            for (int i = 0; i < length; i++) out.push_back(out.at(out.size() - distance));
        }
    }
    return out;
}

void put_u32(Bytes& out, std::uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<Byte>(value >> shift));
}

void put_chunk(Bytes& file, const char* type, const Bytes& data) {
    Bytes body(type, type + 4);
    body.insert(body.end(), data.begin(), data.end());
    put_u32(file, static_cast<std::uint32_t>(data.size()));
    file.insert(file.end(), body.begin(), body.end());
    put_u32(file, crc32(body));
}

}  // namespace

std::uint32_t crc32(const Bytes& bytes) {
    std::uint32_t crc = 0xFFFFFFFF;
    for (const Byte b : bytes)
        for (int i = 0; i < 8; i++) crc = crc >> 1 ^ ((crc ^ b >> i) & 1 ? 0xEDB88320 : 0);
    return ~crc;
}

std::uint32_t adler32(const Bytes& bytes) {
    std::uint32_t a = 1, b = 0;
    for (const Byte c : bytes) {
        a = (a + c) % 65521;
        b = (b + a) % 65521;
    }
    return b << 16 | a;
}

Bytes png_file(const TGAImage& picture) {
    const int bpp = picture.bytespp();
    Bytes rows, header, file{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
    for (int y = picture.height() - 1; y >= 0; y--) {
        rows.push_back(0);  // no filter
        for (int x = 0; x < picture.width(); x++)
            for (int c = bpp - 1; c >= 0; c--) rows.push_back(picture.pixel(x, y)[c]);  // red first
    }
    put_u32(header, picture.width());
    put_u32(header, picture.height());
    header.insert(header.end(), {8, bpp == TGAImage::GRAYSCALE ? Byte{0} : Byte{2}, 0, 0, 0});
    Bytes stream = deflate(rows);
    put_u32(stream, adler32(rows));
    put_chunk(file, "IHDR", header);
    put_chunk(file, "IDAT", stream);
    put_chunk(file, "IEND", {});
    return file;
}

TGAImage png_picture(const Bytes& file) {
    try {
        const auto u32 = [&](int i) {
            return file.at(i) << 24 | file.at(i + 1) << 16 | file.at(i + 2) << 8 | file.at(i + 3);
        };
        const int width = u32(16), height = u32(20), bpp = file.at(25) == 0 ? 1 : 3;
        constexpr std::size_t data_begin = 8 + 25 + 8 + 2;  // signature, IHDR, head of IDAT, head of the stream
        const Bytes rows = inflate({file, data_begin * 8}, (1 + std::size_t{1} * bpp * width) * height);
        TGAImage picture(width, height, bpp == 1 ? TGAImage::GRAYSCALE : TGAImage::RGB);
        auto from = rows.begin();
        for (int y = height - 1; y >= 0; y--) {
            from++;
            for (int x = 0; x < width; x++)
                for (int c = bpp - 1; c >= 0; c--) picture.pixel(x, y)[c] = *from++;
        }
        if (png_file(picture) == file) return picture;
    } catch (const std::exception&) {  // said below
    }
    throw std::invalid_argument("no PNG file that was made here");
}
