// compare.h: how two pictures differ, and whether a picture is what its reference says. It makes no pictures itself.
//
// A reference is a TGA file in tests/reference, to be had anew with UMBRA_UPDATE_REFERENCES=1 in the environment.
#pragma once
#include "tgaimage.h"

#include <filesystem>
#include <string>

struct Difference {
    bool same_size = false;  // width, height and number of channels; where they are not the same the rest is 0
    long pixels = 0;         // of each picture
    long pixels_differ = 0;  // in any channel
    int largest = 0;         // difference of a channel, of 255
    int x = 0, y = 0;        // the first pixel that has it, row by row from the bottom

    bool same() const { return same_size && pixels_differ == 0; }
};

Difference compare(const TGAImage& a, const TGAImage& b);

// The figures in one line: "3 of 640000 pixels differ, by 12 at most, at 5,7".
std::string in_words(const Difference& difference);

// Eight times the absolute difference of each channel, up to 255. RGBA gives RGB, where a difference of alpha is added
// to every channel so that it can be seen. The sizes must be the same.
TGAImage difference_picture(const TGAImage& a, const TGAImage& b);

struct References {
    std::filesystem::path folder;  // where NAME.tga is the reference called NAME
    std::filesystem::path failed;  // where a picture that is not its reference goes
    bool update;                   // make the picture the reference instead of comparing them
};

// tests/reference, failed/ in the current folder, and whether the environment has UMBRA_UPDATE_REFERENCES=1.
References default_references();

// Why the picture is not its reference, in one line; empty where it is, exactly. Where it is not, or a file is missing,
// unreadable or of another size, the picture is written to NAME.tga in the folder of failed ones, with NAME.diff.tga
// where the sizes agree.
std::string not_reference(const TGAImage& picture, const std::string& name,
                          const References& references = default_references());
