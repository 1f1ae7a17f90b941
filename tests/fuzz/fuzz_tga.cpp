// fuzz_tga.cpp: any bytes as a .tga. They are refused in one line or become a picture, within the memory that
// tgaimage.h states; and a picture that was read is the same after it has been written and read again.
#include "fuzz.h"
#include "tgaimage.h"

#include <cstring>
#include <stdexcept>

static bool same(const TGAImage& a, const TGAImage& b) {
    if (a.width() != b.width() || a.height() != b.height() || a.bytespp() != b.bytespp()) return false;
    const auto bytes = static_cast<std::size_t>(a.width() * a.bytespp()) * static_cast<std::size_t>(a.height());
    return std::memcmp(a.pixel(0, 0), b.pixel(0, 0), bytes) == 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const TemporaryFolder folder("fuzz_tga");
    static ScratchFile file(folder / "in.tga");
    static MemoryBound bound(4096, 257);  // names and messages; the factor of tgaimage.h
    file.assign(data, size);

    TGAImage picture;
    start_peak();
    try {
        picture = TGAImage::read_tga_file(file.path());
    } catch (const std::runtime_error& e) {
        const std::string what = e.what();
        if (!is_one_line(what) || !what.starts_with(file.path().string() + ": ")) refuse(what);
    }
    bound.check(peak_bytes(), size);
    if (picture.empty()) return 0;

    const int w = picture.width(), h = picture.height(), bpp = picture.bytespp();
    REQUIRE(w >= 1 && w <= 65535 && h >= 1 && h <= 65535);
    REQUIRE(bpp == TGAImage::GRAYSCALE || bpp == TGAImage::RGB || bpp == TGAImage::RGBA);
    // All bytes are there: the sanitizer sees to the last one, and get() agrees with it.
    const std::uint8_t* const last = picture.pixel(w - 1, h - 1);
    REQUIRE(picture.get(w - 1, h - 1)[bpp - 1] == last[bpp - 1]);
    if (w * static_cast<long>(h) > 4096) return 0;

    const std::filesystem::path copy = folder / "out.tga";
    picture.write_tga_file(copy, size % 2 == 0);
    REQUIRE(same(picture, TGAImage::read_tga_file(copy)));
    return 0;
}
