// compare_test.cpp: that the comparison of pictures says what is so, and above all that it fails when it must; and that
// the README's pictures are PNG files.
#include "compare.h"

#include "png.h"
#include "run.h"

#include <random>

namespace fs = std::filesystem;

namespace {

TGAImage checkered(int w, int h, TGAImage::Format format) {
    TGAImage picture(w, h, format);
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++)
            picture.set(x, y, (x + y) % 2 ? TGAColor{{10, 20, 30, 40}} : TGAColor{{200, 150, 100, 250}});
    return picture;
}

// The picture with one channel of one pixel changed.
TGAImage changed(TGAImage picture, int x, int y, int channel, int off) {
    std::uint8_t& value = picture.pixel(x, y)[channel];
    value = static_cast<std::uint8_t>(value + off);
    return picture;
}

const TGAImage reference = checkered(50, 40, TGAImage::RGB);

}  // namespace

TEST("the figures are those of the pixels that differ") {
    for (const TGAImage::Format format : {TGAImage::GRAYSCALE, TGAImage::RGB, TGAImage::RGBA}) {
        const TGAImage a = checkered(5, 4, format);
        CHECK_EQ(in_words(compare(a, a)), "all 20 pixels are the same");
        for (int c = 0; c < format; c++) CHECK(!compare(a, changed(a, 4, 3, c, 1)).same());
    }
    for (const TGAImage& other : {checkered(51, 40, TGAImage::RGB), checkered(50, 39, TGAImage::RGB), TGAImage(),
                                  checkered(50, 40, TGAImage::RGBA), checkered(40, 50, TGAImage::RGB)})
        CHECK(!compare(reference, other).same() && in_words(compare(reference, other)) == "the sizes differ");
    TGAImage other = changed(changed(reference, 7, 3, 2, 6), 2, 5, 1, 2);
    other = changed(changed(other, 49, 39, 0, 3), 49, 39, 1, 6);  // as large as the first, but later
    for (const Difference& d : {compare(reference, other), compare(other, reference)})
        CHECK_EQ(in_words(d), "3 of 2000 pixels differ, by 6 at most, at 7,3");
}

TEST("the difference picture shows eight times the difference") {
    const TGAImage other = changed(changed(reference, 0, 0, 2, 5), 1, 0, 1, 40);
    TGAImage expected = changed(changed(TGAImage(50, 40, TGAImage::RGB), 0, 0, 2, 40), 1, 0, 1, 255);
    CHECK(compare(difference_picture(reference, other), expected).same());

    const TGAImage alpha = checkered(3, 3, TGAImage::RGBA);
    expected = TGAImage(3, 3, TGAImage::RGB);
    expected.set(2, 1, {{32, 32, 32}});
    CHECK(compare(difference_picture(alpha, changed(alpha, 2, 1, 3, -4)), expected).same());
}

TEST("a picture passes where it is its reference, and else it is said why not") {
    const TemporaryFolder folder("compare_test");
    const fs::path seen = folder / "failed/name.tga", differing = folder / "failed/name.diff.tga";
    const fs::path file = folder / "new/name.tga";
    const auto check = [&](const TGAImage& picture, const std::string& begin) {
        const std::string why = not_reference(picture, "name", {folder / "new", folder / "failed", false});
        CHECK_EQ(why.substr(0, begin.size()), begin);
        CHECK(why.empty() == begin.empty() && fs::exists(seen) == !begin.empty());
        if (fs::exists(seen)) CHECK(compare(TGAImage::read_tga_file(seen), picture).same());
    };
    const auto update = [&](const TGAImage& picture) {
        CHECK_EQ(not_reference(picture, "name", {folder / "new", folder / "failed", true}), "");
        fs::remove_all(folder / "failed");
    };
    check(reference, "no reference: " + file.string() + ": cannot be opened: ");
    CHECK(!fs::exists(file) && !fs::exists(differing));  // none was made

    update(reference);
    check(reference, "");

    const TGAImage wrong = changed(reference, 49, 39, 2, 1);
    check(wrong, "1 of 2000 pixels differ, by 1 at most, at 49,39; see " + seen.string());
    CHECK(compare(TGAImage::read_tga_file(differing), difference_picture(wrong, reference)).same());
    CHECK(compare(TGAImage::read_tga_file(file), reference).same());  // it is as it was
    check(checkered(51, 40, TGAImage::RGB), "51 x 40 x 3 where the reference is 50 x 40 x 3");
    CHECK(!fs::exists(differing));  // the one before would mislead
    check(checkered(50, 40, TGAImage::RGBA), "50 x 40 x 4 where the reference is 50 x 40 x 3");

    update(wrong);
    check(wrong, "");
    write_bytes(file, {1, 2, 3});
    check(reference, "no reference: " + file.string() + ": byte 3: the header is truncated");
}

TEST("the command says how pictures differ, and its status whether") {
    const Folder folder;
    const TGAImage wrong = changed(reference, 7, 3, 2, 5);
    reference.write_tga_file(folder / "a.tga");
    reference.write_tga_file(folder / "b.tga", false);
    wrong.write_tga_file(folder / "c.tga");
    checkered(5, 5, TGAImage::RGB).write_tga_file(folder / "d.tga");
    const auto check = [&](const std::string& files, int status, const std::string& output) {
        const Outcome o = folder.run(files);
        CHECK_EQ(o.status, status);
        CHECK_EQ((o.out + o.err).substr(0, output.size()), output);
    };
    check("a.tga b.tga", 0, "all 2000 pixels are the same\n");
    check("a.tga c.tga diff.tga", 1, "1 of 2000 pixels differ, by 5 at most, at 7,3\n");
    CHECK(compare(TGAImage::read_tga_file(folder / "diff.tga"), difference_picture(reference, wrong)).same());
    check("a.tga d.tga size.tga", 1, "the sizes differ\n");
    CHECK(!fs::exists(folder / "size.tga"));
    write_bytes(folder / "a.png", png_file(reference));
    write_bytes(folder / "cut.png", Bytes(50, 1));
    check("c.tga a.png", 1, "1 of 2000 pixels differ, by 5 at most, at 7,3\n");
    check("cut.png a.tga", 2, "compare_pictures: cut.png: no PNG file that was made here\n");
    check("a.tga none.png", 2, "compare_pictures: none.png: cannot open\n");
    check("a.tga none.tga", 2, "compare_pictures: none.tga: cannot be opened: ");
    check("a.tga", 2, "usage: compare_pictures A.tga B.tga [DIFF.tga]\n");
}

TEST("a PNG file has the chunks, the check sums and the size that it must have") {
    const std::string digits = "123456789", word = "Wikipedia";  // the sums are those of the literature
    CHECK_EQ(crc32(Bytes(digits.begin(), digits.end())), 0xCBF43926u);
    CHECK_EQ(adler32(Bytes(word.begin(), word.end())), 0x11E60398u);

    for (const TGAImage& picture : {reference, checkered(300, 2, TGAImage::GRAYSCALE)}) {
        const Bytes file = png_file(picture);
        const auto u32 = [&](std::size_t i) {
            return unsigned{file[i]} << 24 | unsigned{file[i + 1]} << 16 | unsigned{file[i + 2]} << 8 | file[i + 3];
        };
        CHECK(Bytes(file.begin(), file.begin() + 8) == (Bytes{0x89, 'P', 'N', 'G', 13, 10, 26, 10}));
        std::string types;
        std::size_t at = 8;
        for (; at + 12 <= file.size() && u32(at) <= file.size() - at - 12; at += 12 + u32(at)) {
            const Bytes body(file.begin() + at + 4, file.begin() + at + 8 + u32(at));
            types.append(body.begin(), body.begin() + 4);
            CHECK_EQ(u32(at + 8 + u32(at)), crc32(body));
        }
        CHECK_EQ(at, file.size());
        CHECK_EQ(types, "IHDRIDATIEND");
        CHECK(static_cast<int>(u32(16)) == picture.width() && static_cast<int>(u32(20)) == picture.height());
        const std::uint8_t colour_type = picture.bytespp() == TGAImage::GRAYSCALE ? 0 : 2;
        CHECK(Bytes(file.begin() + 24, file.begin() + 29) == (Bytes{8, colour_type, 0, 0, 0}));
        CHECK(compare(png_picture(file), picture).same());
    }
}

TEST("a picture comes back from its PNG file, and nothing from another") {
    std::mt19937 rng(7);
    for (int round = 0; round < 60; round++) {
        const int width = static_cast<int>(rng() % 300) + 1, height = static_cast<int>(rng() % 40) + 1;
        TGAImage picture(width, height, round % 2 ? TGAImage::RGB : TGAImage::GRAYSCALE);
        const unsigned shades = 1 << rng() % 9;  // few ones repeat, near by and far off
        std::generate(picture.pixel(0, 0), picture.pixel(0, picture.height()),
                      [&] { return static_cast<std::uint8_t>(rng() % shades); });
        Bytes file = png_file(picture);
        CHECK(compare(png_picture(file), picture).same());
        std::uint8_t& byte = file[rng() % file.size()];
        byte = static_cast<std::uint8_t>(byte ^ 1 << rng() % 8);
        CHECK_THROWS(png_picture(file), "no PNG file that was made here");
    }
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
