// compare.cpp: how two pictures differ, and whether a picture is what its reference says.
#include "compare.h"

#include <algorithm>
#include <cassert>
#include <cstdlib>

namespace fs = std::filesystem;

static std::string size_of(const TGAImage& p) {
    return std::to_string(p.width()) + " x " + std::to_string(p.height()) + " x " + std::to_string(p.bytespp());
}

Difference compare(const TGAImage& a, const TGAImage& b) {
    Difference d;
    d.same_size = size_of(a) == size_of(b);
    if (!d.same_size) return d;
    d.pixels = long{a.width()} * a.height();
    for (int y = 0; y < a.height(); y++)
        for (int x = 0; x < a.width(); x++) {
            int of_pixel = 0;
            for (int c = 0; c < a.bytespp(); c++)
                of_pixel = std::max(of_pixel, std::abs(a.pixel(x, y)[c] - b.pixel(x, y)[c]));
            d.pixels_differ += of_pixel > 0;
            if (of_pixel <= d.largest) continue;
            d.largest = of_pixel;
            d.x = x;
            d.y = y;
        }
    return d;
}

std::string in_words(const Difference& d) {
    if (!d.same_size) return "the sizes differ";
    if (d.same()) return "all " + std::to_string(d.pixels) + " pixels are the same";
    return std::to_string(d.pixels_differ) + " of " + std::to_string(d.pixels) + " pixels differ, by " +
           std::to_string(d.largest) + " at most, at " + std::to_string(d.x) + ',' + std::to_string(d.y);
}

TGAImage difference_picture(const TGAImage& a, const TGAImage& b) {
    assert(size_of(a) == size_of(b));
    const int channels = std::min(a.bytespp(), 3);
    TGAImage picture(a.width(), a.height(), channels == 1 ? TGAImage::GRAYSCALE : TGAImage::RGB);
    for (int y = 0; y < a.height(); y++)
        for (int x = 0; x < a.width(); x++) {
            const auto off = [&](int channel) { return std::abs(a.get(x, y)[channel] - b.get(x, y)[channel]); };
            for (int c = 0; c < channels; c++)
                picture.pixel(x, y)[c] = static_cast<std::uint8_t>(std::min(8 * (off(c) + off(3)), 255));
        }
    return picture;
}

References default_references() {
    const char* const update = std::getenv("UMBRA_UPDATE_REFERENCES");
    return {UMBRA_REFERENCE_DIR, "failed", update && std::string(update) == "1"};
}

std::string not_reference(const TGAImage& picture, const std::string& name, const References& references) {
    const fs::path file = references.folder / (name + ".tga");
    if (references.update) {
        fs::create_directories(references.folder);
        picture.write_tga_file(file);
        return "";
    }

    TGAImage reference;
    Difference difference;
    std::string why;
    try {
        reference = TGAImage::read_tga_file(file);
        difference = compare(picture, reference);
        why = in_words(difference);
        if (!difference.same_size) why = size_of(picture) + " where the reference is " + size_of(reference);
        if (difference.same()) return "";
    } catch (const std::runtime_error& e) {
        why = std::string("no reference: ") + e.what();
    }
    fs::create_directories(references.failed);
    const fs::path seen = references.failed / (name + ".tga"), differing = references.failed / (name + ".diff.tga");
    fs::remove(differing);  // one of an earlier run would mislead
    picture.write_tga_file(seen);
    if (difference.same_size) difference_picture(picture, reference).write_tga_file(differing);
    return why + "; see " + seen.string();
}
