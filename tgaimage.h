// tgaimage.h: a picture in memory and its file, Truevision TGA 2.0. It knows nothing of triangles.
//
// Pixels are addressed with (0,0) at the bottom left, whatever order the file has them in. Channels are stored in the
// file's order: blue, green, red, alpha; a grey picture has one channel.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

// A file as a whole: the bytes [begin,end), there as long as OWNER is.
struct FileBytes {
    std::shared_ptr<void> owner;
    char *begin = nullptr, *end = nullptr;
    bool is_mapped = false;

    // What lies before PLACE is not needed any more, and what has been written there may be lost: a mapped file then
    // takes no memory for it.
    void forget_before(const char* place) const;
};

// Its bytes and those BEYOND its end may be written to, which stays in memory. Where the system can, the file is mapped
// and must not become shorter while it is used. Throws std::runtime_error "FILE: what", also for 4 GiB or more.
FileBytes read_file(const std::filesystem::path& path, std::size_t beyond);

// "png:", "jpeg:" and so on, as ImageMagick calls them, where a file is such a picture by its first bytes; or nothing.
std::string other_picture_kind(const std::filesystem::path& path);

struct TGAColor {
    std::uint8_t bgra[4] = {0, 0, 0, 0};
    constexpr std::uint8_t& operator[](int i) { return bgra[i]; }
    constexpr const std::uint8_t& operator[](int i) const { return bgra[i]; }
};

class TGAImage {
public:
    enum Format { GRAYSCALE = 1, RGB = 3, RGBA = 4 };  // the value is the number of bytes in a pixel

    TGAImage() = default;                              // no picture: 0 x 0
    // All bytes 0. 1 to 65535 pixels a side, or std::invalid_argument.
    TGAImage(int width, int height, Format format);

    // Reads types 1, 2, 3, 9, 10, 11 at 8, 15, 16, 24 and 32 bits, all four origins, with or without image ID, colour
    // map and 2.0 footer. A colour-mapped picture comes out in the format of its map; 15 and 16 bits become RGB (RGBA
    // where the header declares an attribute bit), five bits scaled to eight. Throws std::runtime_error "FILE: what" or
    // "FILE: byte N: what". Allocates at most 257 times the size of the file, which may be held whole, and 4 KiB: 256
    // times is what RLE can ask for (a packet of 2 bytes gives 128 pixels of 4 bytes through a colour map).
    static TGAImage read_tga_file(const std::filesystem::path& path);

    // Makes it a file at PATH, see TGAFile.
    void write_tga_file(const std::filesystem::path& path, bool rle = true) const;

    // For a terminal of so many columns, averaged down to them, in blocks of 24-bit colours: a character is two pixels,
    // one above the other. print() puts it on standard output: the terminal's own columns, or COLUMNS, or 80.
    std::string half_blocks(int columns) const;
    void print() const;

    int width() const { return w_; }
    int height() const { return h_; }
    int bytespp() const { return bpp_; }
    bool empty() const { return data_.empty(); }

    bool is_grey() const;  // blue, green and red are the same at each pixel

    // Outside the picture get() is all zeros and set() does nothing.
    TGAColor get(int x, int y) const {
        TGAColor c;
        if (!inside(x, y)) return c;
        for (int i = 0; i < bpp_; i++) c[i] = pixel(x, y)[i];
        return c;
    }
    void set(int x, int y, const TGAColor& c) {
        if (!inside(x, y)) return;
        for (int i = 0; i < bpp_; i++) pixel(x, y)[i] = c[i];
    }

    // The bytes of the pixel (x,y), unchecked; the next pixel of the row is bytespp() further, the row above width()
    // pixels.
    std::uint8_t* pixel(int x, int y) { return data_.data() + offset(x, y); }
    const std::uint8_t* pixel(int x, int y) const { return data_.data() + offset(x, y); }

private:
    bool inside(int x, int y) const { return x >= 0 && y >= 0 && x < w_ && y < h_; }
    std::size_t offset(int x, int y) const { return (std::size_t{1} * y * w_ + x) * bpp_; }

    int w_ = 0, h_ = 0, bpp_ = 0;
    std::vector<std::uint8_t> data_;  // rows from the bottom up, and 3 bytes more: four can be read at every pixel
};

// The terminal as a window that shows pictures and takes keys: standard input and output, of POSIX systems. It is as it
// was before when this ends, and when a signal ends the program.
class Terminal {
public:
    Terminal();  // throws std::runtime_error where there is none
    ~Terminal();
    Terminal(const Terminal&) = delete;

    int columns() const;
    int rows() const;
    void show(const TGAImage& picture, std::string line) const;  // at the upper left, and the line below it

    // The next key: its character, or ^ v < > for an arrow. 0 if none is pressed within so many milliseconds (-1: waits
    // for ever) or the window has changed; q where no more can come.
    char key(int milliseconds) const;

    // How many frames are drawn, where standard error is a terminal: a line that is written over, and goes at the end.
    static void progress(int done, int all);
};

// A picture on its way to PATH: the top row first, with the 2.0 footer, run-length encoded or not. The constructor
// writes it into a temporary file beside PATH; commit() renames that, so PATH is either the old picture or the new one,
// never half of one. Without commit() the temporary file goes with the object. Of several pictures, commit the first
// when all are written: where one does not fit on the disk, none is replaced. Throws std::runtime_error "FILE: what".
class TGAFile {
public:
    TGAFile(const TGAImage& image, const std::filesystem::path& path, bool rle = true);
    TGAFile(const TGAFile&) = delete;
    ~TGAFile();
    void commit();

private:
    explicit TGAFile(const std::filesystem::path& path) : path_(path) {}  // what throws after it is destroyed, too
    std::filesystem::path path_, temporary_;  // the second is empty where there is none
};
