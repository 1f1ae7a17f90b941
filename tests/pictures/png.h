// png.h: pictures as PNG files, for the reference pictures of the tests and the pictures of the README. It is no
// general PNG library: 8 bits a channel, grey, RGB or RGBA, not interlaced, and no chunk but the pixels.
#pragma once
#include "tgaimage.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

// Reads a PNG file (ISO/IEC 15948) of colour type 0, 2 or 6 at 8 bits. Every check sum is checked; ancillary chunks are
// passed over. Throws std::runtime_error "FILE: what" or "FILE: byte N: what". Allocates at most 2100 times the size of
// the file: deflate can ask for 1032 bytes a byte, and they are there twice, as filtered rows and as pixels.
TGAImage read_png_file(const std::filesystem::path& path);

// The same from the bytes of a file; NAME stands for it in messages.
TGAImage decode_png(const std::vector<std::uint8_t>& file, const std::string& name);

// Writes the picture; the same picture gives the same bytes. Throws std::runtime_error "FILE: cannot write" and, for a
// picture of 0 x 0 pixels, std::invalid_argument.
void write_png_file(const TGAImage& picture, const std::filesystem::path& path);
std::vector<std::uint8_t> encode_png(const TGAImage& picture);
