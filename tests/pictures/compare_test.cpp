// compare_test.cpp: that the comparison of pictures says what is so, and above all that it fails when it must.
#include "compare.h"

#include "check.h"
#include "files.h"
#include "png.h"

#include <cstdlib>
#include <stdexcept>
#include <string>

namespace fs = std::filesystem;

namespace {

TGAImage checkered(int w, int h, TGAImage::Format format) {
    TGAImage picture(w, h, format);
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++)
            picture.set(x, y, (x + y) % 2 ? TGAColor{{10, 20, 30, 40}} : TGAColor{{200, 150, 100, 250}});
    return picture;
}

// The picture with N pixels changed by OFF in one channel, from the bottom row up.
TGAImage changed(TGAImage picture, int n, int off, int channel = 0) {
    for (int i = 0; i < n; i++) {
        std::uint8_t& value = picture.pixel(i % picture.width(), i / picture.width())[channel];
        value = static_cast<std::uint8_t>(value + off);
    }
    return picture;
}

// What is written to standard output while it lives.
class Output {
public:
    Output() : before_(std::cout.rdbuf(text_.rdbuf())) {}
    ~Output() { std::cout.rdbuf(before_); }
    Output(const Output&) = delete;
    Output& operator=(const Output&) = delete;
    bool has(const std::string& what) const { return text_.str().find(what) != std::string::npos; }
    bool empty() const { return text_.str().empty(); }

private:
    std::ostringstream text_;
    std::streambuf* before_;
};

const TGAImage reference = checkered(50, 40, TGAImage::RGB);  // 2000 pixels: two of them are 0.1 %

}  // namespace

TEST("equal pictures are the same") {
    for (const TGAImage::Format format : {TGAImage::GRAYSCALE, TGAImage::RGB, TGAImage::RGBA}) {
        const Difference d = compare(checkered(5, 4, format), checkered(5, 4, format));
        CHECK(d.same_size && d.same() && d.tolerable());
        CHECK_EQ(d.pixels, 20L);
        CHECK_EQ(d.pixels_differ, 0L);
        CHECK_EQ(d.largest, 0);
        CHECK_EQ(d.outliers, 0L);
        CHECK_EQ(d.rmse, 0.);
        CHECK_EQ(in_words(d), "all 20 pixels are the same");
    }
}

TEST("pictures of another size or format are neither the same nor tolerable") {
    for (const TGAImage& other : {checkered(51, 40, TGAImage::RGB), checkered(50, 39, TGAImage::RGB), TGAImage(),
                                  checkered(50, 40, TGAImage::RGBA), checkered(40, 50, TGAImage::RGB)}) {
        const Difference d = compare(reference, other);
        CHECK(!d.same_size && !d.same() && !d.tolerable());
        CHECK_EQ(in_words(d), "the sizes differ");
        CHECK_THROWS(difference_picture(reference, other), "pictures of 50 x 40 x 3 and ");
    }
}

TEST("the figures are those of the pixels that differ") {
    TGAImage other = reference;
    other.pixel(7, 3)[2] = static_cast<std::uint8_t>(other.pixel(7, 3)[2] + 6);    // red
    other.pixel(2, 5)[1] = static_cast<std::uint8_t>(other.pixel(2, 5)[1] + 2);    // green, and no outlier
    other.pixel(49, 39)[0] = static_cast<std::uint8_t>(other.pixel(49, 39)[0] + 3);
    other.pixel(49, 39)[1] = static_cast<std::uint8_t>(other.pixel(49, 39)[1] + 6);  // as large as the first, but later
    for (const Difference& d : {compare(reference, other), compare(other, reference)}) {
        CHECK(d.same_size && !d.same());
        CHECK_EQ(d.pixels, 2000L);
        CHECK_EQ(d.pixels_differ, 3L);
        CHECK_EQ(d.outliers, 2L);
        CHECK_EQ(d.largest, 6);
        CHECK_EQ(d.x, 7);
        CHECK_EQ(d.y, 3);
        CHECK_EQ(d.channel, 2);
        CHECK_NEAR(d.rmse, std::sqrt((36 + 4 + 9 + 36) / 6000.), 1e-15);
        CHECK_EQ(in_words(d), "3 of 2000 pixels differ, by 6 at most (pixel 7,3, red), RMSE 0.119024, 2 outliers");
    }
}

TEST("tolerable is 2 in a channel everywhere, and more in a thousandth of the pixels") {
    CHECK(compare(reference, changed(reference, 2000, 2)).tolerable());
    CHECK(compare(reference, changed(reference, 2, 55)).tolerable());
    CHECK(!compare(reference, changed(reference, 3, 3)).tolerable());
    CHECK(!compare(reference, changed(reference, 2000, 3)).tolerable());
    const TGAImage small = checkered(31, 32, TGAImage::GRAYSCALE);  // of 992 pixels none may be an outlier
    CHECK(!compare(small, changed(small, 1, 3)).tolerable());
}

TEST("the difference picture shows eight times the difference") {
    const TGAImage picture = difference_picture(reference, changed(changed(reference, 1, 5, 2), 2, 40, 1));
    CHECK_EQ(picture.bytespp(), 3);
    CHECK_EQ(int{picture.get(0, 0)[2]}, 40);
    CHECK_EQ(int{picture.get(0, 0)[1]}, 255);
    CHECK_EQ(int{picture.get(1, 0)[1]}, 255);
    CHECK_EQ(int{picture.get(1, 0)[2]}, 0);
    CHECK_EQ(compare(picture, TGAImage(50, 40, TGAImage::RGB)).pixels_differ, 2L);

    const TGAImage alpha = checkered(3, 3, TGAImage::RGBA);
    const TGAImage of_alpha = difference_picture(alpha, changed(alpha, 1, -4, 3));
    CHECK_EQ(of_alpha.bytespp(), 3);
    for (int c = 0; c < 3; c++) CHECK_EQ(int{of_alpha.get(0, 0)[c]}, 32);
}

TEST("a picture that is its reference passes in silence and leaves nothing behind") {
    const TemporaryFolder folder("compare_test");
    const References references{folder.path(), folder / "failed", false};
    write_png_file(reference, folder / "name.png");
    const Output output;
    CHECK(check_reference(reference, "name", references));
    CHECK(output.empty());
    CHECK(!fs::exists(folder / "failed"));
}

TEST("a tolerable picture passes, and it is said") {
    const TemporaryFolder folder("compare_test");
    const References references{folder.path(), folder / "failed", false};
    write_png_file(reference, folder / "name.png");
    const Output output;
    CHECK(check_reference(changed(reference, 2000, 2), "name", references));
    CHECK(output.has("name: not the reference, but tolerable: 2000 of 2000 pixels differ, by 2 at most"));
    CHECK(!fs::exists(folder / "failed"));
}

TEST("a slightly wrong picture fails and is left with its difference") {
    const TemporaryFolder folder("compare_test");
    const References references{folder.path(), folder / "failed", false};
    write_png_file(reference, folder / "name.png");
    const TGAImage wrong = changed(reference, 3, 3);
    const Output output;
    CHECK(!check_reference(wrong, "name", references));
    CHECK(output.has("name: 3 of 2000 pixels differ, by 3 at most (pixel 0,0, blue or grey)"));
    CHECK(output.has("name.png"));
    CHECK(compare(read_png_file(folder / "failed/name.png"), wrong).same());
    CHECK(compare(read_png_file(folder / "failed/name.diff.png"), difference_picture(wrong, reference)).same());
    CHECK(compare(read_png_file(folder / "name.png"), reference).same());  // the reference is as it was
}

TEST("a missing reference fails, and none is made") {
    const TemporaryFolder folder("compare_test");
    const References references{folder.path(), folder / "failed", false};
    const Output output;
    CHECK(!check_reference(reference, "name", references));
    CHECK(output.has("name: no reference: "));
    CHECK(output.has("name.png: cannot open"));
    CHECK(compare(read_png_file(folder / "failed/name.png"), reference).same());
    CHECK(!fs::exists(folder / "failed/name.diff.png"));
    CHECK(!fs::exists(folder / "name.png"));
}

TEST("a reference of another size, or one that is no picture, fails") {
    const TemporaryFolder folder("compare_test");
    const References references{folder.path(), folder / "failed", false};
    fs::create_directory(folder / "failed");
    write_bytes(folder / "failed/name.diff.png", {1, 2, 3});  // from an earlier run
    write_png_file(checkered(51, 40, TGAImage::RGB), folder / "name.png");
    const Output output;
    CHECK(!check_reference(reference, "name", references));
    CHECK(output.has("name: 50 x 40 x 3 where the reference is 51 x 40 x 3"));
    CHECK(!fs::exists(folder / "failed/name.diff.png"));

    write_png_file(checkered(50, 40, TGAImage::RGBA), folder / "format.png");
    CHECK(!check_reference(reference, "format", references));
    CHECK(output.has("format: 50 x 40 x 3 where the reference is 50 x 40 x 4"));

    write_bytes(folder / "broken.png", {1, 2, 3});
    CHECK(!check_reference(reference, "broken", references));
    CHECK(output.has("broken.png: byte 0: this is no PNG file"));
}

TEST("updating makes the picture the reference") {
    const TemporaryFolder folder("compare_test");
    const Output output;
    CHECK(check_reference(reference, "name", {folder / "new", folder / "failed", true}));
    CHECK(output.has("name: is now the reference "));
    CHECK(check_reference(reference, "name", {folder / "new", folder / "failed", false}));
    CHECK(check_reference(changed(reference, 9, 9), "name", {folder / "new", folder / "failed", true}));
    CHECK(!check_reference(reference, "name", {folder / "new", folder / "failed", false}));
}

TEST("pictures are read and written by their suffix") {
    const TemporaryFolder folder("compare_test");
    for (const char* const name : {"a.png", "a.tga"}) {
        write_picture(reference, folder / name);
        CHECK(compare(read_picture(folder / name), reference).same());
    }
    CHECK_THROWS(write_picture(reference, folder / "a.jpg"), "a.jpg: neither .tga nor .png");
    CHECK_THROWS(read_picture(folder / "a.jpg"), "a.jpg: neither .tga nor .png");
}

// The command itself, run by the shell, which also says whether its status is the expected one.
TEST("the command says how pictures differ, and its status whether") {
    const TemporaryFolder folder("compare_test");
    write_picture(reference, folder / "a.tga");
    write_picture(reference, folder / "b.png");
    write_picture(changed(reference, 2, 5), folder / "c.png");
    write_picture(checkered(5, 5, TGAImage::RGB), folder / "d.png");
    write_bytes(folder / "e.png", {1, 2, 3});
    const auto check = [&](const std::string& files, int status, const std::string& output) {
        const std::string test = "; test $? -eq " + std::to_string(status);
        const std::string command = "cd \"" + folder.path().string() + "\"; \"" UMBRA_COMPARE_PICTURES "\" ";
        CHECK_EQ(std::system((command + files + " > out 2>&1" + test).c_str()), 0);
        const Bytes text = read_bytes(folder / "out");
        CHECK_EQ(std::string(text.begin(), text.end()).substr(0, output.size()), output);
    };
    check("a.tga b.png", 0, "all 2000 pixels are the same\n");
    check("a.tga c.png diff.png", 1, "2 of 2000 pixels differ, by 5 at most");
    CHECK(compare(read_picture(folder / "diff.png"), difference_picture(reference, changed(reference, 2, 5))).same());
    check("a.tga d.png size.png", 1, "the sizes differ\n");
    CHECK(!fs::exists(folder / "size.png"));
    check("a.tga e.png", 2, "compare_pictures: e.png: byte 0: this is no PNG file\n");
    check("a.tga none.png", 2, "compare_pictures: none.png: cannot open\n");
    check("a.tga", 2, "usage: compare_pictures A B [DIFF]\n");
}

int main(int argc, char** argv) { return run_tests(argc, argv); }
