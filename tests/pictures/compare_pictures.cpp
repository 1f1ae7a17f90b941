// compare_pictures.cpp: the command that says how two pictures differ. What it says is computed in compare.cpp.
#include "compare.h"

#include <exception>
#include <iostream>

int main(int argc, char** argv) {
    constexpr int same = 0, different = 1, unreadable = 2;
    if (argc != 3 && argc != 4) {
        std::cerr << "usage: compare_pictures A B [DIFF]\n"
                     "Says how the pictures A and B differ, and writes eight times their difference to DIFF;\n"
                     "files are .tga or .png. The status is 0 if all pixels are the same, 1 if not, 2 for an error.\n";
        return unreadable;
    }
    try {
        const TGAImage a = read_picture(argv[1]), b = read_picture(argv[2]);
        const Difference difference = compare(a, b);
        std::cout << in_words(difference) << '\n';
        if (argc == 4 && difference.same_size) write_picture(difference_picture(a, b), argv[3]);
        return difference.same() ? same : different;
    } catch (const std::exception& e) {
        std::cerr << "compare_pictures: " << e.what() << '\n';
        return unreadable;
    }
}
