// png.h: writes pictures as PNG files, for the README: browsers show no TGA. It reads those alone that it wrote.
#pragma once
#include "files.h"
#include "tgaimage.h"

// A PNG file (ISO/IEC 15948) of a grey or RGB picture: 8 bits a channel, not interlaced. The same picture gives the
// same bytes.
Bytes png_file(const TGAImage& picture);

// The picture of such a file; std::invalid_argument for any other.
TGAImage png_picture(const Bytes& file);

// The check sums of a chunk and of the pixel data's zlib stream (RFC 1950).
std::uint32_t crc32(const Bytes& bytes);
std::uint32_t adler32(const Bytes& bytes);
