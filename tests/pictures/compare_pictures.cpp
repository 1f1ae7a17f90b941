// compare_pictures.cpp: the command that says how two pictures differ. What it says is computed in compare.cpp.
#include "compare.h"
#include "png.h"

#include <iostream>
#include <stdexcept>

namespace {

TGAImage picture_of(const std::filesystem::path& file) {
    if (file.extension() != ".png") return TGAImage::read_tga_file(file);
    const Bytes bytes = read_bytes(file);
    try {
        return png_picture(bytes);
    } catch (const std::invalid_argument& e) {
        throw std::runtime_error(file.string() + ": " + e.what());
    }
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 3 && argc != 4) {
        std::cerr << "usage: compare_pictures A.tga B.tga [DIFF.tga]\n"
                     "Says how the pictures A and B differ, and writes eight times their difference to DIFF. Either\n"
                     "may be a PNG file of the lesson.\n"
                     "The status is 0 if all pixels are the same, 1 if not, 2 for an error.\n";
        return 2;
    }
    try {
        const TGAImage a = picture_of(argv[1]), b = picture_of(argv[2]);
        const Difference difference = compare(a, b);
        std::cout << in_words(difference) << '\n';
        if (argc == 4 && difference.same_size) difference_picture(a, b).write_tga_file(argv[3]);
        return difference.same() ? 0 : 1;
    } catch (const std::exception& e) {
        std::cerr << "compare_pictures: " << e.what() << '\n';
        return 2;
    }
}
