// compare.cpp: how two pictures differ, and whether a picture is what its reference says.
#include "compare.h"

#include "png.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <sstream>
#include <stdexcept>

namespace fs = std::filesystem;

namespace {

std::string size_of(const TGAImage& picture) {
    std::ostringstream out;
    out << picture.width() << " x " << picture.height() << " x " << picture.bytespp();
    return out.str();
}

bool same_size(const TGAImage& a, const TGAImage& b) {
    return a.width() == b.width() && a.height() == b.height() && a.bytespp() == b.bytespp();
}

}  // namespace

Difference compare(const TGAImage& a, const TGAImage& b) {
    Difference d;
    d.same_size = same_size(a, b);
    if (!d.same_size) return d;
    d.pixels = long{a.width()} * a.height();
    std::int64_t squares = 0;  // whole numbers, so that the order of summing does not matter
    for (int y = 0; y < a.height(); y++)
        for (int x = 0; x < a.width(); x++) {
            int of_pixel = 0;
            for (int c = 0; c < a.bytespp(); c++) {
                const int off = std::abs(a.pixel(x, y)[c] - b.pixel(x, y)[c]);
                squares += off * off;
                of_pixel = std::max(of_pixel, off);
                if (off <= d.largest) continue;
                d.largest = off;
                d.x = x;
                d.y = y;
                d.channel = c;
            }
            d.pixels_differ += of_pixel > 0;
            d.outliers += of_pixel > 2;
        }
    if (d.pixels > 0) d.rmse = std::sqrt(static_cast<double>(squares) / static_cast<double>(d.pixels * a.bytespp()));
    return d;
}

std::string in_words(const Difference& d) {
    if (!d.same_size) return "the sizes differ";
    if (d.same()) return "all " + std::to_string(d.pixels) + " pixels are the same";
    constexpr const char* channels[] = {"blue or grey", "green", "red", "alpha"};
    std::ostringstream out;
    out << d.pixels_differ << " of " << d.pixels << " pixels differ, by " << d.largest << " at most (pixel " << d.x
        << ',' << d.y << ", " << channels[d.channel] << "), RMSE " << d.rmse << ", " << d.outliers << " outliers";
    return out.str();
}

TGAImage difference_picture(const TGAImage& a, const TGAImage& b) {
    if (!same_size(a, b)) throw std::invalid_argument("pictures of " + size_of(a) + " and " + size_of(b));
    const int channels = std::min(a.bytespp(), 3);
    TGAImage picture(a.width(), a.height(), channels == 1 ? TGAImage::GRAYSCALE : TGAImage::RGB);
    for (int y = 0; y < a.height(); y++)
        for (int x = 0; x < a.width(); x++)
            for (int c = 0; c < channels; c++) {
                const auto off = [&](int channel) { return std::abs(a.pixel(x, y)[channel] - b.pixel(x, y)[channel]); };
                const int sum = off(c) + (a.bytespp() == TGAImage::RGBA ? off(3) : 0);
                picture.pixel(x, y)[c] = static_cast<std::uint8_t>(std::min(8 * sum, 255));
            }
    return picture;
}

TGAImage read_picture(const fs::path& path) {
    if (path.extension() == ".png") return read_png_file(path);
    if (path.extension() == ".tga") return TGAImage::read_tga_file(path);
    throw std::runtime_error(path.string() + ": neither .tga nor .png");
}

void write_picture(const TGAImage& picture, const fs::path& path) {
    if (path.extension() == ".png") return write_png_file(picture, path);
    if (path.extension() == ".tga") return picture.write_tga_file(path);
    throw std::runtime_error(path.string() + ": neither .tga nor .png");
}

References default_references() {
    const char* const update = std::getenv("UMBRA_UPDATE_REFERENCES");
    return {UMBRA_REFERENCE_DIR, "failed", update && std::string(update) == "1"};
}

bool check_reference(const TGAImage& picture, const std::string& name, const References& references) {
    const fs::path file = references.folder / (name + ".png");
    if (references.update) {
        fs::create_directories(references.folder);
        write_png_file(picture, file);
        std::cout << name << ": is now the reference " << file.string() << '\n';
        return true;
    }

    TGAImage reference;
    std::string why;
    Difference difference;
    try {
        reference = read_png_file(file);
        difference = compare(picture, reference);
        if (difference.same()) return true;
        why = in_words(difference);
        if (!difference.same_size) why = size_of(picture) + " where the reference is " + size_of(reference);
    } catch (const std::runtime_error& e) {
        why = std::string("no reference: ") + e.what();
    }
    if (difference.tolerable()) {
        std::cout << name << ": not the reference, but tolerable: " << why << '\n';
        return true;
    }

    fs::create_directories(references.failed);
    const fs::path seen = references.failed / (name + ".png"), differing = references.failed / (name + ".diff.png");
    fs::remove(differing);  // one of an earlier run would mislead
    write_png_file(picture, seen);
    if (difference.same_size) write_png_file(difference_picture(picture, reference), differing);
    std::cout << name << ": " << why << "; see " << seen.string() << '\n';
    return false;
}
