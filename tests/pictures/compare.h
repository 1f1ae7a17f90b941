// compare.h: how two pictures differ, and whether a picture is what its reference says. It makes no pictures itself.
//
// A reference is a PNG file in tests/reference, to be had anew with UMBRA_UPDATE_REFERENCES=1 in the environment.
#pragma once
#include "tgaimage.h"

#include <filesystem>
#include <string>

struct Difference {
    bool same_size = false;   // width, height and number of channels; where they are not the same the rest is 0
    long pixels = 0;          // of each picture
    long pixels_differ = 0;   // in any channel
    int largest = 0;          // difference of a channel, of 255
    int x = 0, y = 0;         // the first pixel that has it, row by row from the bottom
    int channel = 0;          // and its channel: 0 blue or grey, 1 green, 2 red, 3 alpha
    double rmse = 0;          // over all channels, of 255
    long outliers = 0;        // pixels with a channel off by more than 2

    bool same() const { return same_size && pixels_differ == 0; }
    // The rule for a platform whose pow rounds otherwise: 2 in any channel, and 0.1 % of the pixels may be outliers.
    bool tolerable() const { return same_size && outliers * 1000 <= pixels; }
};

Difference compare(const TGAImage& a, const TGAImage& b);

// The figures in one line: "3 of 640000 pixels differ, by 12 at most (pixel 5,7, red), RMSE 0.01, 2 outliers".
std::string in_words(const Difference& difference);

// Eight times the absolute difference of each channel, up to 255. RGBA gives RGB, where a difference of alpha is added
// to every channel so that it can be seen. Throws std::invalid_argument where the sizes differ.
TGAImage difference_picture(const TGAImage& a, const TGAImage& b);

// Pictures by the suffix of the file's name, .tga or .png. Throw what the file's format throws, and std::runtime_error
// for another suffix.
TGAImage read_picture(const std::filesystem::path& path);
void write_picture(const TGAImage& picture, const std::filesystem::path& path);

struct References {
    std::filesystem::path folder;  // where NAME.png is the reference called NAME
    std::filesystem::path failed;  // where a picture that is not its reference goes
    bool update;                   // make the picture the reference instead of comparing them
};

// tests/reference, failed/ in the current folder, and whether the environment has UMBRA_UPDATE_REFERENCES=1.
References default_references();

// Whether the picture is its reference, exactly or, which is said on standard output, by the rule of
// Difference::tolerable. Where it is not, or the reference is missing, unreadable or of another size, a line on
// standard output says why, and the picture is written to NAME.png in the folder of failed ones, with NAME.diff.png
// where the sizes agree.
bool check_reference(const TGAImage& picture, const std::string& name,
                     const References& references = default_references());
