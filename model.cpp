// model.cpp: reads an .obj, its .mtl and the pictures they name; cuts polygons into triangles and makes missing
// normals. It draws nothing. The formats are Wavefront's "Object Files (.obj)" and "Material Library File (.mtl)", as
// found in the wild: what other programs write is read where its meaning is clear, and is an error with its line where
// it is not.
#include "model.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <map>
#include <memory>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>

namespace fs = std::filesystem;

namespace {

using Corner = Model::Corner;

constexpr std::size_t to_size(int n) { return static_cast<std::size_t>(n); }
constexpr int to_int(std::size_t n) {
    return static_cast<int>(n);
}  // every array here is shorter than 2^31, see max_bytes

// ---- text, line by line and word by word ----

// Text from elsewhere, made fit for one line of a message: at most 60 characters, none of them a control character.
std::string printable(std::string_view text) {
    std::string out(text.substr(0, 60));
    for (char& c : out)
        if (static_cast<unsigned char>(c) < ' ' || c == 127) c = '?';
    return text.size() > 60 ? out + "..." : out;
}
std::string in_quotes(std::string_view text) { return "'" + printable(text) + "'"; }

// A text file seen through a window that holds whole lines and grows with the longest. So a big file costs neither its
// size in memory nor the cache misses of being written there and read again: a quarter of the time of loading a big
// mesh.
//
// A line that ends in '\' goes on in the next one. In a comment it does not: a stray '\' there must not swallow a
// vertex.
class TextFile {
public:
    explicit TextFile(const fs::path& path) : name_(path.string()) {
        std::error_code ignored;
        if (fs::is_directory(path, ignored)) throw std::runtime_error(name_ + ": is a directory");
        file_.reset(std::fopen(name_.c_str(), "rb"));
        if (!file_) throw std::runtime_error(name_ + ": cannot be opened: " + std::generic_category().message(errno));
    }

    // Drops what is left of this line and goes to the first word of the next. False at the end of the file.
    bool next_line() {
        if (*at_ != '\n') at_ = find_newline(at_);
        at_++;
        line_++;
        if (at_ == limit_ && !refill()) return false;
        skip_blanks();
        first_line_ = line_;
        return true;
    }

    // At the end of a statement, be it the end of the line or a comment. Call it after skip_blanks.
    bool at_end() const { return *at_ == '\n' || *at_ == '#'; }
    char peek() const { return *at_; }

    void skip_blanks() {
        while (is_blank(*at_) || (*at_ == '\\' && continued(at_))) {
            if (*at_ == '\\') {
                at_ = find_newline(at_);
                line_++;
            }
            at_++;
        }
    }

    std::string_view word() {
        const char* const begin = at_;
        while (!ends_word()) at_++;
        return {begin, static_cast<std::size_t>(at_ - begin)};
    }

    // The rest of the statement without blanks at its ends: a name may contain blanks and '#'. Valid until the next
    // call.
    std::string_view rest() {
        skip_blanks();
        const char* const begin = at_;
        skip_statement();
        std::string_view text(begin, static_cast<std::size_t>(at_ - begin));
        if (text.find('\n') != text.npos) {
            joined_ = text;
            for (std::size_t i = 0; (i = joined_.find('\n', i)) != joined_.npos;)
                joined_[joined_.rfind('\\', i)] = joined_[i] = ' ';
            text = joined_;
        }
        while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
        return text;
    }

    // To the end of the line, over continuations.
    void skip_statement() {
        for (;;) {
            const char* const newline = find_newline(at_);
            if (!is_continuation(newline, at_)) {
                at_ = newline;
                return;
            }
            at_ = newline + 1;
            line_++;
        }
    }

    // A finite number. What underflows is zero.
    double real() {
        // Most numbers are short: up to 15 digits make an integer below 2^53, and 10^15 is a double too, so one
        // division rounds correctly and gives what from_chars gives. It saves a seventh of the time of loading a big
        // mesh.
        static constexpr double power_of_ten[] = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                  1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
        const char* p = at_;
        const bool negative = *p == '-';
        if (negative || *p == '+') p++;
        std::uint64_t digits = 0;  // wraps round where there are too many, and then is not used
        const char* const integer = p;
        while (is_digit(*p)) digits = digits * 10 + static_cast<unsigned>(*p++ - '0');
        std::ptrdiff_t count = p - integer, decimals = 0;
        if (*p == '.') {
            const char* const fraction = ++p;
            while (is_digit(*p)) digits = digits * 10 + static_cast<unsigned>(*p++ - '0');
            decimals = p - fraction;
            count += decimals;
        }
        if (count < 1 || count > 15 || !(is_blank(*p) || *p == '\n')) return any_real();
        at_ = p;
        const double value = static_cast<double>(digits) / power_of_ten[decimals];
        return negative ? -value : value;
    }

    // An integer whose magnitude is below 2^31.
    int integer(const char* what) {
        const char* p = at_;
        const bool negative = *p == '-';
        if (negative || *p == '+') p++;
        std::uint64_t n = 0;  // wraps round after 19 digits
        const char* const first = p;
        while (is_digit(*p)) n = n * 10 + static_cast<unsigned>(*p++ - '0');
        if (p == first) fail(in_quotes(rest_of_word()) + " is no " + what);
        if (p - first > 19 || n > INT32_MAX)
            fail(std::string(what) + " " + in_quotes(rest_of_word()) + " is out of range");
        at_ = p;
        return negative ? -static_cast<int>(n) : static_cast<int>(n);
    }

    bool skip(char c) {
        if (*at_ != c) return false;
        at_++;
        return true;
    }

    // After a number: it must not run into something else.
    void expect_end_of_word() {
        if (!ends_word()) fail("garbage after a number: " + in_quotes(rest_of_word()));
    }

    std::int64_t line() const { return line_; }
    std::size_t bytes_read() const { return total_ - static_cast<std::size_t>(end_ - at_); }  // up to the cursor
    [[noreturn]] void fail(const std::string& what) const { fail(line_, what); }
    [[noreturn]] void fail_statement(const std::string& what) const { fail(first_line_, what); }
    [[noreturn]] void fail(std::int64_t line, const std::string& what) const {
        throw std::runtime_error(name_ + ":" + std::to_string(line) + ": " + what);
    }

private:
    // A vertex takes 8 bytes of text, a corner 2: no array made from so much text has 2^31 elements.
    static constexpr std::size_t max_bytes = std::size_t{1} << 32;
    static constexpr std::size_t chunk = std::size_t{1} << 18;  // what is read at once: it fits a core's own cache

    static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
    static bool is_digit(char c) { return c >= '0' && c <= '9'; }

    // Whether the newline after a statement's part that starts at BEGIN is preceded by '\', blanks aside.
    static bool is_continuation(const char* newline, const char* begin) {
        while (newline > begin && is_blank(newline[-1])) newline--;
        return newline > begin && newline[-1] == '\\';
    }
    // Whether the '\' here is the last thing in its line.
    static bool continued(const char* backslash) {
        do backslash++;
        while (is_blank(*backslash));
        return *backslash == '\n';
    }
    const char* find_newline(const char* from) const {  // there is one: the window ends with it
        return static_cast<const char*>(std::memchr(from, '\n', static_cast<std::size_t>(limit_ - from)));
    }
    bool ends_word() const { return is_blank(*at_) || *at_ == '\n' || *at_ == '#' || (*at_ == '\\' && continued(at_)); }
    std::string_view rest_of_word() const {
        const char* end = at_;
        while (!is_blank(*end) && *end != '\n') end++;
        return {at_, static_cast<std::size_t>(end - at_)};
    }

    double any_real() {
        const char* const first = at_ + (*at_ == '+' && at_[1] != '-');
        double value = 0;
        const auto [end, error] = std::from_chars(first, limit_, value);
        if (error == std::errc::invalid_argument) fail(in_quotes(rest_of_word()) + " is no number");
        if (error == std::errc::result_out_of_range)
            value = std::copysign(is_large(first, end) ? HUGE_VAL : 0, *first == '-' ? -1 : 1);
        if (!std::isfinite(value)) fail(in_quotes(rest_of_word()) + " is not finite");
        at_ = end;
        expect_end_of_word();
        return value;
    }

    // Of a number that does not fit a double: whether it is too large, not too small. That is decided by the decimal
    // exponent of its first digit other than 0.
    static bool is_large(const char* p, const char* end) {
        std::int64_t exponent = 0;
        bool significant = false, fraction = false;
        for (; p < end && *p != 'e' && *p != 'E'; p++) {
            if (*p == '.') fraction = true;
            if (!is_digit(*p)) continue;
            significant = significant || *p != '0';
            exponent += fraction ? (significant ? 0 : -1) : (significant ? 1 : 0);
        }
        if (p < end) {
            const bool negative = *++p == '-';
            std::int64_t written = 0;
            for (; p < end; p++)
                if (is_digit(*p))
                    written = std::min(written * 10 + (*p - '0'), std::int64_t{1} << 40);  // beyond any length
            exponent += negative ? -written : written;
        }
        return exponent > 0;
    }

    // Keeps the unfinished line and reads on until the window ends with a whole one.
    bool refill() {
        if (finished_) return false;
        const std::size_t kept = static_cast<std::size_t>(end_ - limit_);
        std::memmove(window_.get(), limit_, kept);
        std::size_t filled = kept;
        for (;;) {
            if (filled + chunk + 2 > capacity_) {
                const std::size_t larger = std::max(2 * capacity_, chunk + chunk / 4);
                auto grown = std::make_unique_for_overwrite<char[]>(larger);
                std::memcpy(grown.get(), window_.get(), filled);
                window_ = std::move(grown);
                capacity_ = larger;
            }
            char* const fresh = window_.get() + filled;
            const std::size_t n = std::fread(fresh, 1, chunk, file_.get());
            if (std::ferror(file_.get())) throw std::runtime_error(name_ + ": cannot be read");
            if (std::memchr(fresh, 0, n)) throw std::runtime_error(name_ + ": is a binary file, not text");
            if ((total_ += n) > max_bytes) throw std::runtime_error(name_ + ": is larger than 4 GiB");
            filled += n;
            at_ = window_.get();
            if (line_ == 1 && filled >= 3 && std::memcmp(at_, "\xEF\xBB\xBF", 3) == 0)
                at_ += 3;     // UTF-8's byte order mark
            if (n < chunk) {  // the end; two newlines, so that even a '\' there has a line to go on in
                window_[filled] = window_[filled + 1] = '\n';
                end_ = limit_ = window_.get() + filled + 2;
                return finished_ = true;
            }
            end_ = window_.get() + filled;
            for (const char* p = end_; p > fresh;)
                if (*--p == '\n' && !is_continuation(p, window_.get())) {
                    limit_ = p + 1;
                    return true;
                }
        }
    }

    struct Close {
        void operator()(std::FILE* f) const { std::fclose(f); }
    };
    std::string name_, joined_;
    std::unique_ptr<std::FILE, Close> file_;
    std::size_t capacity_ = 1, total_ = 0;
    std::unique_ptr<char[]> window_ = std::make_unique<char[]>(1);
    // window_ <= at_ < limit_ <= end_: the cursor, the end of the last whole line, the end of what has been read.
    const char* at_ = &(window_[0] = '\n');  // as if after line 0
    const char* limit_ = at_ + 1;
    const char* end_ = limit_;
    std::int64_t line_ = 0, first_line_ = 0;  // of the cursor, of its statement
    bool finished_ = false;
};

// ---- the .obj ----

// Numbers the distinct strings that it is given, in the order of their first appearance.
class Names {
public:
    int id(std::string_view name) {
        const auto found = ids_.find(name);
        if (found != ids_.end()) return found->second;
        ids_.emplace(name, to_int(list_.size()));
        list_.emplace_back(name);
        return to_int(list_.size()) - 1;
    }
    const std::vector<std::string>& list() const { return list_; }

private:
    std::map<std::string, int, std::less<>> ids_;
    std::vector<std::string> list_;
};

// What the file says, before it is known whether its indices are right. Faces are triangles already, but those of a
// polygon are a fan, to be cut better once the vertices are known.
struct Obj {
    struct Polygon {
        int face, corners;  // its first triangle, and how many corners it has: two more than triangles
    };
    struct Run {
        int face, name;  // from this face on usemtl holds; -1 before the first one
    };
    std::vector<vec3> verts, normals;
    std::vector<vec2> uvs;
    std::vector<Corner> corners;
    std::vector<Polygon> polygons;
    std::vector<Run> runs{{0, -1}};
    bool lacks_normals = false;  // some corner has none, or some normal has no length
    Names materials, libraries;
};

class ObjReader {
public:
    explicit ObjReader(const fs::path& path) : in_(path), path_(path) {
        std::error_code unknown;
        const auto bytes = fs::file_size(path, unknown);
        file_size_ = unknown ? 0 : bytes;
    }

    Obj read() {
        while (in_.next_line()) {
            if (in_.at_end()) continue;
            const std::string_view word = in_.word();
            if (word == "v") append(obj_.verts, verts_began_, vector("a vertex needs three coordinates"));
            else if (word == "vt") append(obj_.uvs, uvs_began_, uv());
            else if (word == "vn") append(obj_.normals, normals_began_, unit_normal());
            else if (word == "f") face();
            else if (word == "usemtl") use_material();
            else if (word == "mtllib") obj_.libraries.id(in_.rest());
            else in_.skip_statement();  // o, g, s, lines, curves and what nobody knows
        }
        if (obj_.corners.empty()) throw std::runtime_error(path_.string() + ": no faces");
        const std::size_t counts[] = {obj_.verts.size(), obj_.uvs.size(), obj_.normals.size()};
        for (const Forward& f : forward_)
            if (to_size(f.index) > counts[f.kind])
                in_.fail(f.line, std::string(kinds[f.kind]) + " " + std::to_string(f.index) +
                                     ", but the file has only " + std::to_string(counts[f.kind]));
        return std::move(obj_);
    }

private:
    enum Kind { vertex, texture, normal };
    static constexpr const char* kinds[] = {"vertex index", "texture index", "normal index"};
    struct Forward {  // an index of something that had not been defined yet: checked at the end
        std::int64_t line;
        Kind kind;
        int index;
    };

    // A full array grows to what it would be if the rest of the file were like the part since its first element, within
    // 2 to 16 times its size. Less is copied than by doubling, and less fresh memory touched: a seventh of the loading
    // time.
    template <typename T>
    void append(std::vector<T>& array, std::uintmax_t& began, const T& value) {
        const std::size_t n = array.size();
        if (n == array.capacity()) {
            const std::uintmax_t read = in_.bytes_read();
            if (n == 0) began = read;
            const double per_byte = static_cast<double>(n) / static_cast<double>(read - began + 1);
            const double expected = per_byte * static_cast<double>(file_size_ - std::min(file_size_, read));
            array.reserve(n + std::clamp(static_cast<std::size_t>(expected), n + 64, 15 * n + 64));
        }
        array.push_back(value);
    }
    double real(const char* needs) {
        in_.skip_blanks();
        if (in_.at_end()) in_.fail_statement(needs);
        return in_.real();
    }
    void skip_reals() {  // a weight, colours
        for (in_.skip_blanks(); !in_.at_end(); in_.skip_blanks()) in_.real();
    }
    vec3 vector(const char* needs) {
        const double x = real(needs), y = real(needs), z = real(needs);
        skip_reals();
        return {x, y, z};
    }
    vec3 unit_normal() {
        const vec3 n = normalized(vector("a normal needs three coordinates"));
        if (n == vec3{}) obj_.lacks_normals = true;
        return n;
    }
    vec2 uv() {
        const double u = real("a texture coordinate needs a number");
        in_.skip_blanks();
        const double v = in_.at_end() ? 0 : in_.real();
        skip_reals();
        return {u, v};
    }

    // An index as written, from 1 or from the end of what has been defined so far, made one from 0.
    int index(Kind kind, std::size_t count) {
        const int i = in_.integer(kinds[kind]);
        if (i > 0) {
            if (to_size(i) > count) forward_.push_back({in_.line(), kind, i});
            return i - 1;
        }
        if (i == 0) in_.fail(std::string(kinds[kind]) + " 0 (indices count from 1)");
        if (to_size(-i) > count)
            in_.fail(std::string(kinds[kind]) + " " + std::to_string(i) + ", but only " + std::to_string(count) +
                     " are defined so far");
        return to_int(count) + i;
    }
    Corner corner() {  // v, v/vt, v//vn or v/vt/vn; v/ and v// are seen too
        const auto given = [this] {
            return in_.peek() == '-' || in_.peek() == '+' || (in_.peek() >= '0' && in_.peek() <= '9');
        };
        Corner c{index(vertex, obj_.verts.size()), -1, -1};
        if (in_.skip('/')) {
            if (given()) c.uv = index(texture, obj_.uvs.size());
            if (in_.skip('/') && given()) c.normal = index(normal, obj_.normals.size());
        }
        in_.expect_end_of_word();
        if (c.normal < 0) obj_.lacks_normals = true;
        return c;
    }
    void face() {
        Corner first{}, previous{};
        int n = 0;
        const int begin = to_int(obj_.corners.size() / 3);
        for (in_.skip_blanks(); !in_.at_end(); in_.skip_blanks()) {
            const Corner c = corner();
            if (n >= 2)
                for (const Corner& each : {first, previous, c}) append(obj_.corners, corners_began_, each);
            if (n++ == 0) first = c;
            previous = c;
        }
        if (n < 3) in_.fail_statement("a face needs three corners, this one has " + std::to_string(n));
        if (n > 3) obj_.polygons.push_back({begin, n});
    }
    void use_material() {
        const int name = obj_.materials.id(in_.rest()), face = to_int(obj_.corners.size() / 3);
        if (obj_.runs.back().face == face) obj_.runs.back().name = name;
        else obj_.runs.push_back({face, name});
    }

    TextFile in_;
    fs::path path_;
    std::uintmax_t file_size_ = 0;
    std::uintmax_t verts_began_ = 0, uvs_began_ = 0, normals_began_ = 0,
                   corners_began_ = 0;  // bytes before the first one
    Obj obj_;
    std::vector<Forward> forward_;
};

// ---- polygons ----

double scaled(double x, int exponent) { return std::scalbn(x, -exponent); }
vec3 scaled(const vec3& v, int e) { return {scaled(v.x, e), scaled(v.y, e), scaled(v.z, e)}; }
double largest(const vec3& v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); }

// Products of two such numbers, and sums of a few, stay clear of the ends of the double's range; what lies outside is
// scaled by a power of two first, which changes no sign and no direction.
bool is_moderate(double x) { return x > 1e-100 && x < 1e100; }

// Twice the signed area of the triangle abc, positive where it is counterclockwise.
double area2(const vec2& a, const vec2& b, const vec2& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Cuts polygons into triangles, always two fewer than corners, in the plane of the polygon's Newell normal: a fan where
// that is right, and else ear clipping (G. H. Meisters, "Polygons have ears", 1975). An ear is a corner with a convex
// angle whose triangle no reflex corner lies in; cutting it off changes only whether its two neighbours are ears.
//
// The reflex corners are kept in a k-d tree, so a test usually looks at some ten to a hundred nodes instead of all
// corners: 100 000 corners take a tenth of a second. Where it does not (a fine staircase askew to the axes is the worst
// case known), the work is bounded all the same: a model has 2^27 nodes (a second or two) and 100 per corner; what is
// left then becomes a fan.
class PolygonCutter {
public:
    // FAN holds the polygon (c0, c1, c2, ...) as the triangles (c0,c1,c2), (c0,c2,c3), ... and receives the triangles.
    // They wind as the polygon does. Returns false where the polygon crosses itself, or was too much work, so that a
    // part of it is still a fan. A polygon without area stays a fan, too.
    bool cut(const std::vector<vec3>& verts, Corner* fan, int n) {
        corners_.assign({fan[0], fan[1]});
        for (int i = 0; i < n - 2; i++) corners_.push_back(fan[3 * std::ptrdiff_t{i} + 2]);
        if (!project(verts) || is_good_fan()) return true;
        return clip_ears(fan);
    }

private:
    // Fills points_: the corners seen along the axis that is nearest to the normal, so that the polygon runs
    // counterclockwise. Unlike a turn into the plane, leaving out a coordinate rounds nothing: three corners on a line
    // stay on it. False where there is no area.
    bool project(const std::vector<vec3>& verts) {
        const auto vert = [&](std::size_t i) { return verts[to_size(corners_[i].vert)]; };
        double extent = 0;
        for (std::size_t i = 0; i < corners_.size(); i++) extent = std::max(extent, largest(vert(i)));
        const int e = extent < 1e100 ? 0 : std::ilogb(extent);  // else differences may overflow
        const vec3 origin = scaled(vert(0), e);
        relative_.clear();
        double span = 0;
        for (std::size_t i = 0; i < corners_.size(); i++) {
            relative_.push_back((e ? scaled(vert(i), e) : vert(i)) - origin);
            span = std::max(span, largest(relative_.back()));
        }
        if (!(span > 0)) return false;
        if (!is_moderate(span))
            for (vec3& p : relative_) p = scaled(p, std::ilogb(span));

        vec3 newell;  // twice the polygon's area along its normal
        for (std::size_t i = 1; i + 1 < relative_.size(); i++) newell = newell + cross(relative_[i], relative_[i + 1]);
        const double area = largest(newell);
        if (!(area > 0)) return false;
        const int axis = std::fabs(newell.z) == area ? 2 : std::fabs(newell.y) == area ? 1 : 0;
        const int right = (axis + 1) % 3, up = (axis + 2) % 3;
        points_.clear();
        for (const vec3& p : relative_)
            points_.push_back(newell[axis] > 0 ? vec2{p[right], p[up]} : vec2{p[up], p[right]});
        return true;
    }

    // The fan's signed areas add up to the polygon, wherever the corners are. So it is right where all are positive.
    bool is_good_fan() const {
        for (std::size_t i = 1; i + 1 < points_.size(); i++)
            if (!(area2(points_[0], points_[i], points_[i + 1]) > 0)) return false;
        return true;
    }

    bool clip_ears(Corner* out) {
        const int n = to_int(corners_.size());
        previous_.resize(to_size(n));
        next_.resize(to_size(n));
        reflex_.assign(to_size(n), 0);
        queued_.assign(to_size(n), 0);
        alive_.assign(to_size(n), 1);
        place_.resize(to_size(n));
        tree_.clear();
        spikes_.clear();
        queue_.clear();
        queue_head_ = 0;
        for (int i = 0; i < n; i++) {
            previous_[to_size(i)] = i ? i - 1 : n - 1;
            next_[to_size(i)] = i < n - 1 ? i + 1 : 0;
        }
        for (int i = 0; i < n; i++) {
            if (turn(i) <= 0) {
                reflex_[to_size(i)] = 1;
                tree_.push_back({points_[to_size(i)], {}, {}, i, 0});
            }
            enqueue(i);
        }
        grow_tree(0, to_int(tree_.size()));

        work_ += std::int64_t{100} * n;
        const auto emit = [&](int a, int b, int c) {
            *out++ = corners_[to_size(a)];
            *out++ = corners_[to_size(b)];
            *out++ = corners_[to_size(c)];
        };
        int left = n, some = 0;
        while (left > 3 && work_ > 0) {
            const int v = dequeue();
            if (v < 0) break;  // no ear: it crosses itself
            work_--;
            if (!alive_[to_size(v)] || !is_ear(v)) continue;
            const int u = previous_[to_size(v)], w = next_[to_size(v)];
            emit(u, v, w);
            alive_[to_size(v)] = 0;
            next_[to_size(u)] = w;
            previous_[to_size(w)] = u;
            some = w;
            left--;
            if (reflex_[to_size(v)]) remove_from_tree(v);
            for (const int neighbour : {u, w}) {
                if (reflex_[to_size(neighbour)] && turn(neighbour) > 0) remove_from_tree(neighbour);
                enqueue(neighbour);
            }
        }
        for (int a = next_[to_size(some)]; next_[to_size(a)] != some; a = next_[to_size(a)])
            emit(some, a, next_[to_size(a)]);
        return left == 3;
    }

    double turn(int v) const {  // positive where the angle at v is convex
        return area2(points_[to_size(previous_[to_size(v)])], points_[to_size(v)], points_[to_size(next_[to_size(v)])]);
    }

    // A corner without area that is not between its neighbours: the tip of a spike, or a point twice. It can be cut off
    // at any time, and must be before an ear is cut beside it, because that would be outside the polygon.
    bool is_spike(int v) const {
        const vec2 p = points_[to_size(v)];
        return turn(v) == 0 &&
               dot(points_[to_size(previous_[to_size(v)])] - p, points_[to_size(next_[to_size(v)])] - p) >= 0;
    }
    bool is_ear(int v) {
        if (!(turn(v) > 0)) return is_spike(v);
        triangle_ = {points_[to_size(previous_[to_size(v)])], points_[to_size(v)], points_[to_size(next_[to_size(v)])]};
        const auto& [a, b, c] = triangle_;
        low_ = {std::min({a.x, b.x, c.x}), std::min({a.y, b.y, c.y})};
        high_ = {std::max({a.x, b.x, c.x}), std::max({a.y, b.y, c.y})};
        return !is_any_inside(0, to_int(tree_.size()));
    }

    // First in, first out, so that the ears are taken all round the polygon; but spikes before everything else.
    void enqueue(int v) {
        if (is_spike(v)) spikes_.push_back(v);
        else if (!queued_[to_size(v)]) {
            queued_[to_size(v)] = 1;
            queue_.push_back(v);
        }
    }
    int dequeue() {
        if (!spikes_.empty()) {
            const int v = spikes_.back();
            spikes_.pop_back();
            return v;
        }
        if (queue_head_ == queue_.size()) return -1;
        const int v = queue_[queue_head_++];
        queued_[to_size(v)] = 0;
        return v;
    }

    // The k-d tree of reflex corners. The subtree of tree_[low,high) has its root in the middle.
    struct Node {
        vec2 point, low, high;  // the corner; the box of the subtree
        int corner;
        int reflex;  // how many corners of the subtree are reflex still
    };

    void grow_tree(int low, int high) {
        if (low >= high) return;
        const int middle = low + (high - low) / 2;
        vec2 least = tree_[to_size(low)].point, most = least;
        for (int i = low + 1; i < high; i++) {
            const vec2& p = tree_[to_size(i)].point;
            least = {std::min(least.x, p.x), std::min(least.y, p.y)};
            most = {std::max(most.x, p.x), std::max(most.y, p.y)};
        }
        const int axis = most.x - least.x < most.y - least.y ? 1 : 0;  // across the longer side
        std::nth_element(
            tree_.begin() + low, tree_.begin() + middle, tree_.begin() + high, [&](const Node& a, const Node& b) {
                return a.point[axis] != b.point[axis] ? a.point[axis] < b.point[axis] : a.corner < b.corner;
            });
        Node& root = tree_[to_size(middle)];
        root.low = least;
        root.high = most;
        root.reflex = high - low;
        place_[to_size(root.corner)] = middle;
        grow_tree(low, middle);
        grow_tree(middle + 1, high);
    }
    void remove_from_tree(int v) {
        reflex_[to_size(v)] = 0;
        for (int low = 0, high = to_int(tree_.size());;) {
            const int middle = low + (high - low) / 2;
            tree_[to_size(middle)].reflex--;
            if (place_[to_size(v)] == middle) return;
            if (place_[to_size(v)] < middle) high = middle;
            else low = middle + 1;
        }
    }

    // Whether a reflex corner of the subtree blocks the ear triangle_.
    bool is_any_inside(int low, int high) {
        if (low >= high) return false;
        const int middle = low + (high - low) / 2;
        const Node& node = tree_[to_size(middle)];
        if (node.reflex == 0) return false;
        work_--;
        if (high_.x < node.low.x || low_.x > node.high.x || high_.y < node.low.y || low_.y > node.high.y) return false;
        // Nothing is inside if even the innermost corner of the box is outside an edge. Since rounding is monotonic,
        // what is computed for that corner is not below what blocks() computes for any point of the box.
        for (std::size_t i = 0; i < 3; i++) {
            const vec2 &a = triangle_[i], &b = triangle_[(i + 1) % 3];
            const vec2 innermost{b.y > a.y ? node.low.x : node.high.x, b.x > a.x ? node.high.y : node.low.y};
            if (area2(a, b, innermost) < 0) return false;
        }
        return (reflex_[to_size(node.corner)] && blocks(node.point)) || is_any_inside(low, middle) ||
               is_any_inside(middle + 1, high);
    }
    bool blocks(const vec2& p) const {  // a corner of the triangle itself does not, nor one at the same place
        const auto& [a, b, c] = triangle_;
        if (p == a || p == b || p == c) return false;
        return area2(a, b, p) >= 0 && area2(b, c, p) >= 0 && area2(c, a, p) >= 0;
    }

    std::vector<Corner> corners_;
    std::vector<vec3> relative_;
    std::vector<vec2> points_;
    std::vector<Node> tree_;
    std::vector<int> previous_, next_, spikes_, queue_, place_;  // place_: where in the tree a reflex corner is
    std::vector<char> reflex_, queued_, alive_;
    std::size_t queue_head_ = 0;
    std::array<vec2, 3> triangle_;               // of the ear in question
    vec2 low_, high_;                            // its box
    std::int64_t work_ = std::int64_t{1} << 27;  // nodes that may still be looked at
};

// ---- normals where the file gives none ----

// A triangle's unit normal and its angles; no normal and no angles where it has no area.
struct Face {
    vec3 normal;
    double angles[3] = {0, 0, 0};
};

Face measure(const vec3& a, const vec3& b, const vec3& c) {
    vec3 edges[] = {b - a, c - b, a - c};
    double length = std::max({largest(edges[0]), largest(edges[1]), largest(edges[2])});
    if (!std::isfinite(length)) return measure(a * .25, b * .25, c * .25);  // a difference has overflowed
    if (!(length > 0)) return {};
    if (!is_moderate(length))
        for (vec3& e : edges) e = scaled(e, std::ilogb(length));

    // The two edges across from the longest one have the best-conditioned cross product.
    const double squares[] = {dot(edges[0], edges[0]), dot(edges[1], edges[1]), dot(edges[2], edges[2])};
    const std::size_t i = static_cast<std::size_t>(std::max_element(squares, squares + 3) - squares);
    const vec3 longest = edges[i], next = edges[(i + 1) % 3], last = edges[(i + 2) % 3];
    const vec3 across = cross(next, last);

    // An edge's coordinate is a difference rounded once, a product of two is off by 3 half-units in the last place, and
    // their difference by another: a component of no more than 2 epsilon (|p| + |q|) may be nothing but that.
    const auto is_noise = [](double component, double p, double q) {
        return std::fabs(component) <= 2 * std::numeric_limits<double>::epsilon() * (std::fabs(p) + std::fabs(q));
    };
    if (is_noise(across.x, next.y * last.z, next.z * last.y) && is_noise(across.y, next.z * last.x, next.x * last.z) &&
        is_noise(across.z, next.x * last.y, next.y * last.x))
        return {};

    Face face{normalized(across)};
    const double area =
        norm(across);  // twice; of any two edges, it is the product of their lengths and the sine between
    face.angles[i] = std::atan2(area, -dot(longest, last));
    face.angles[(i + 1) % 3] = std::atan2(area, -dot(next, longest));
    face.angles[(i + 2) % 3] = std::numbers::pi - face.angles[i] - face.angles[(i + 1) % 3];
    return face;
}

// Gives a normal to each corner without one, or with one of no length: the mean of the normals of the faces around its
// vertex, each weighted by its angle there (G. Thuermer and C. Wuethrich, "Computing vertex normals from polygonal
// facets", 1998), which does not depend on how the polygons have been cut.
void make_normals(const std::vector<vec3>& verts, std::vector<Corner>& corners, std::vector<vec3>& normals) {
    for (Corner& c : corners)
        if (c.normal >= 0 && normals[to_size(c.normal)] == vec3{}) c.normal = -1;
    struct Sum {
        vec3 normals;
        double angles = 0;
        int faces = 0;
        int index = -1;  // of the mean in NORMALS; -2 where there is none
    };
    std::vector<Sum> sums(verts.size());
    const auto face_of = [&](std::size_t first) {
        return measure(verts[to_size(corners[first].vert)], verts[to_size(corners[first + 1].vert)],
                       verts[to_size(corners[first + 2].vert)]);
    };
    for (std::size_t first = 0; first < corners.size(); first += 3) {
        const Face face = face_of(first);
        for (std::size_t k = 0; k < 3; k++) {
            Sum& sum = sums[to_size(corners[first + k].vert)];
            sum.normals = sum.normals + face.normal * face.angles[k];
            sum.angles += face.angles[k];
            sum.faces++;
        }
    }

    // A sum of n terms is off by at most n half-units of the sum of their sizes, its terms themselves by less than 4
    // units each. No more than that is left where the faces cancel, as on the two sides of a sheet: then a face has its
    // own normal.
    const auto mean = [&](Sum& sum) {
        if (sum.index == -1) {
            const double noise = (sum.faces + 4) * sum.angles * std::numeric_limits<double>::epsilon();
            sum.index = norm(sum.normals) > noise ? to_int(normals.size()) : -2;
            if (sum.index >= 0) normals.push_back(normalized(sum.normals));
        }
        return sum.index;
    };
    int upright = -1;  // the normal of what has no direction at all
    for (std::size_t first = 0; first < corners.size(); first += 3) {
        int own = -1;
        for (std::size_t k = 0; k < 3; k++) {
            int& normal = corners[first + k].normal;
            if (normal >= 0 || (normal = mean(sums[to_size(corners[first + k].vert)])) >= 0) continue;
            if (own < 0) {
                vec3 n = face_of(first).normal;
                int& index = n == vec3{} ? upright : own;
                if (n == vec3{}) n = {0, 0, 1};
                if (index < 0) {
                    index = to_int(normals.size());
                    normals.push_back(n);
                }
                own = index;
            }
            normal = own;
        }
    }
}

// ---- materials ----

enum Map { diffuse_map, specular_map, glow_map, normal_map, bump_map };
constexpr std::size_t map_count = 5;

struct MtlMaterial {
    struct Name {
        std::string file;  // as written; empty where there is no such map
        std::int64_t line = 0;
    };
    vec3 Kd{1, 1, 1};
    std::array<Name, map_count> maps;
    fs::path mtl;  // the file that it stands in
};
using MtlMaterials = std::map<std::string, MtlMaterial, std::less<>>;

// At most 20 notes, each once, and how many there would have been.
class Notes {
public:
    void add(std::string note) {
        if (std::find(notes_.begin(), notes_.end(), note) != notes_.end()) return;
        if (++count_ <= 20) notes_.push_back(std::move(note));
    }
    std::vector<std::string> take() {
        if (count_ > 20) notes_.push_back("and " + std::to_string(count_ - 20) + " more like these");
        return std::move(notes_);
    }

private:
    std::vector<std::string> notes_;
    int count_ = 0;
};

// Takes the first word, and the blanks after it, off TEXT.
std::string_view take_word(std::string_view& text) {
    const std::string_view word = text.substr(0, text.find_first_of(" \t"));
    text.remove_prefix(std::min(text.find_first_not_of(" \t", word.size()), text.size()));
    return word;
}

bool is_number(std::string_view word) {
    if (word.starts_with('+')) word.remove_prefix(1);
    double ignored = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), ignored);
    return error != std::errc::invalid_argument && end == word.data() + word.size();
}

// What is left of "-bm 1 -s 2 2 2 the file.tga" without the options. What looks like an option but is none of the
// format's belongs to the name.
std::string_view without_options(std::string_view text) {
    for (;;) {
        std::string_view rest = text;
        const std::string_view option = take_word(rest);
        const auto is_one_of = [&](std::initializer_list<std::string_view> list) {
            return std::find(list.begin(), list.end(), option) != list.end();
        };
        if (is_one_of({"-blendu", "-blendv", "-cc", "-clamp", "-imfchan", "-texres", "-bm", "-boost", "-type"})) {
            take_word(rest);
        } else if (is_one_of({"-mm", "-o", "-s", "-t"})) {  // one to three numbers; two for -mm
            for (int i = 0; i < (option == "-mm" ? 2 : 3); i++) {
                std::string_view after = rest;
                if (!is_number(take_word(after))) break;
                rest = after;
            }
        } else {
            return text;
        }
        text = rest;
    }
}

// The path of a file that is named in another one, where programs of another system may have written '\' for '/'.
fs::path beside(const fs::path& file, std::string name) {
    std::replace(name.begin(), name.end(), '\\', '/');
    return (file.parent_path() / name).lexically_normal();
}

vec3 read_Kd(TextFile& in, Notes& notes, const fs::path& library) {
    in.skip_blanks();
    if (in.peek() == 's' || in.peek() == 'x') {
        const std::string word(in.word());
        if (word != "spectral" && word != "xyz") in.fail(in_quotes(word) + " is no number");
        notes.add(library.filename().string() + ":" + std::to_string(in.line()) + ": Kd " + word +
                  " is not known, white is used");
        in.skip_statement();
        return {1, 1, 1};
    }
    vec3 Kd;
    int n = 0;
    for (; !in.at_end(); in.skip_blanks()) {
        const double value = in.real();
        if (n < 3) Kd[n] = std::clamp(value, 0., 1.);
        n++;
    }
    if (n != 1 && n != 3) in.fail_statement("Kd needs three numbers, or one");
    return n == 1 ? vec3{Kd[0], Kd[0], Kd[0]} : Kd;
}

// Adds the file's materials to the others; one of the same name is replaced.
void read_mtl(const fs::path& path, MtlMaterials& materials, Notes& notes) {
    TextFile in(path);
    MtlMaterial* material = nullptr;
    while (in.next_line()) {
        if (in.at_end()) continue;
        const std::string word(in.word());
        if (word == "newmtl") {
            material = &materials[std::string(in.rest())];
            *material = {};
            material->mtl = path;
            continue;
        }
        static const std::map<std::string, Map, std::less<>> words = {
            {"map_Kd", diffuse_map}, {"map_Ks", specular_map}, {"map_Ke", glow_map}, {"norm", normal_map},
            {"map_Bump", bump_map},  {"map_bump", bump_map},   {"bump", bump_map}};
        const auto map = words.find(word);
        if (word == "Kd") {
            const vec3 Kd = read_Kd(in, notes, path);
            if (material) material->Kd = Kd;
        } else if (map != words.end() && material) {
            const std::int64_t line = in.line();
            material->maps[map->second] = {std::string(without_options(in.rest())), line};
        } else {
            in.skip_statement();
        }
    }
}

// Reads the files that the mtllib lines name: each line is one name, which may contain blanks, or else several.
MtlMaterials read_libraries(const fs::path& obj, const std::vector<std::string>& lines, Notes& notes) {
    MtlMaterials materials;
    std::set<fs::path> seen;
    const auto read = [&](std::string_view name) {
        const fs::path path = beside(obj, std::string(name));
        std::error_code ignored;
        if (!fs::exists(path, ignored)) return false;
        if (fs::is_other(path, ignored)) throw std::runtime_error(path.string() + ": is not a file");  // a pipe may never end
        if (seen.insert(path).second) read_mtl(path, materials, notes);
        return true;
    };
    for (const std::string& line : lines) {
        if (line.empty() || read(line)) continue;
        std::vector<std::string_view> missing;
        bool several = false;
        for (std::string_view rest = line; !rest.empty();) {
            const std::string_view name = take_word(rest);
            if (read(name)) several = true;
            else missing.push_back(name);
        }
        if (!several) missing.assign({line});
        for (const std::string_view name : missing) notes.add("there is no material file " + in_quotes(name));
    }
    return materials;
}

// ---- textures ----

// Pictures to be decoded, each once, however many materials use it.
class TextureFiles {
public:
    int add(const fs::path& path) {
        const auto [entry, is_new] = indices_.emplace(path.lexically_normal(), to_int(files_.size()));
        if (is_new) files_.push_back(path);
        return entry->second;
    }

    // Decodes them all, in as many threads as there are cores. What is thrown is the error of the first bad file in the
    // order of addition, whatever thread was the first to see one.
    std::vector<TGAImage> decode() const {
        std::vector<TGAImage> images(files_.size());
        std::vector<std::exception_ptr> errors(files_.size());
        std::atomic<std::size_t> next = 0;
        const auto work = [&] {
            for (std::size_t i; (i = next++) < files_.size();) {
                try {
                    images[i] = TGAImage::read_tga_file(files_[i]);
                } catch (...) {
                    errors[i] = std::current_exception();
                }
            }
        };
        {
            std::vector<std::jthread> helpers;
            const std::size_t cores = std::max(1u, std::thread::hardware_concurrency());
            try {
                while (helpers.size() + 1 < std::min(cores, files_.size())) helpers.emplace_back(work);
            } catch (const std::system_error&) {
                // no more threads to be had: those that run do the work
            }
            work();
        }
        for (const std::exception_ptr& error : errors)
            if (error) std::rethrow_exception(error);
        return images;
    }

    const std::vector<fs::path>& list() const { return files_; }

private:
    std::map<fs::path, int> indices_;
    std::vector<fs::path> files_;
};

TGAImage widened(const TGAImage& grey) {
    TGAImage out(grey.width(), grey.height(), TGAImage::RGB);
    for (int y = 0; y < grey.height(); y++)
        for (int x = 0; x < grey.width(); x++) std::fill_n(out.pixel(x, y), 3, *grey.pixel(x, y));
    return out;
}

// Fills the materials' maps: from their .mtl, and where that has none, from the pictures beside the model.
class Texturing {
public:
    Texturing(const fs::path& obj, NormalMap wanted, Notes& notes) : obj_(obj), wanted_(wanted), notes_(notes) {
        const auto if_there = [&](const char* suffix) {
            fs::path path = obj;
            path.replace_extension();
            path += suffix;
            std::error_code ignored;
            return fs::exists(path, ignored) ? path : fs::path();
        };
        beside_ = {if_there("_diffuse.tga"), if_there("_nm.tga"), if_there("_nm_tangent.tga"), if_there("_spec.tga"),
                   if_there("_glow.tga")};
    }

    // Notes what the material needs. MTL is null for the default material.
    void plan(std::size_t material, const MtlMaterial* mtl, const std::string& name, bool has_uvs) {
        std::array<fs::path, map_count> named;
        if (mtl)
            for (std::size_t i = 0; i < map_count; i++) named[i] = usable(*mtl, mtl->maps[i]);
        if (named[normal_map].empty()) named[normal_map] = named[bump_map];

        Maps maps = beside_;
        const auto prefer = [](fs::path& map, const fs::path& other) {
            if (!other.empty()) map = other;
        };
        prefer(maps.diffuse, named[diffuse_map]);
        prefer(maps.tangent, named[normal_map]);
        prefer(maps.specular, named[specular_map]);
        prefer(maps.glow, named[glow_map]);
        if (!maps.object.empty() && !maps.tangent.empty())
            (wanted_ == NormalMap::object ? maps.tangent : maps.object).clear();

        bool left_out = false;
        const auto use = [&](const fs::path& path, TGAImage Material::*slot) {
            if (path.empty()) return;
            if (has_uvs) uses_.push_back({files_.add(path), material, slot});
            else left_out = true;
        };
        use(maps.diffuse, &Material::diffuse);
        use(maps.object, &Material::normal);
        use(maps.tangent, &Material::tangent);
        use(maps.specular, &Material::specular);
        use(maps.glow, &Material::glow);
        if (left_out)
            notes_.add((name.empty() ? "" : "material " + in_quotes(name) + ": ") +
                       "no texture coordinates, so no textures");
    }

    void load(std::vector<Material>& materials) const {
        std::vector<TGAImage> images = files_.decode();
        std::vector<int> users(images.size(), 0);
        for (const Use& use : uses_) users[to_size(use.file)]++;
        std::uint64_t copied = 0;
        for (const Use& use : uses_) {
            TGAImage& image = images[to_size(use.file)];
            TGAImage& map = materials[use.material].*use.slot;
            const bool grey = image.bytespp() == 1, last = --users[to_size(use.file)] == 0;
            if (grey && (use.slot == &Material::normal || use.slot == &Material::tangent)) {
                notes_.add(files_.list()[to_size(use.file)].filename().string() +
                           " is grey, so no normal map: left out");
                continue;
            }
            const bool widen = grey && use.slot != &Material::specular;
            if (!last)
                copied += static_cast<std::uint64_t>(image.width()) * static_cast<std::uint64_t>(image.height()) *
                          (widen ? 3 : static_cast<std::uint64_t>(image.bytespp()));
            if (copied > max_copied)
                throw std::runtime_error(obj_.string() +
                                         ": its materials share pictures that would take more than 1 GiB in copies");
            if (widen) map = widened(image);
            else if (last) map = std::move(image);
            else map = image;
        }
    }

private:
    static constexpr std::uint64_t max_copied = std::uint64_t{1} << 30;
    struct Use {
        int file;
        std::size_t material;
        TGAImage Material::*slot;
    };
    struct Maps {  // empty where there is none
        fs::path diffuse, object, tangent, specular, glow;
    };

    // The path of a map that can be loaded; else it is empty, with a note.
    fs::path usable(const MtlMaterial& of, const MtlMaterial::Name& name) const {
        if (name.file.empty()) return {};
        const auto note = [&](const char* what) {
            notes_.add(of.mtl.filename().string() + ":" + std::to_string(name.line) + ": " + printable(name.file) +
                       what);
        };
        const fs::path path = beside(of.mtl, name.file);
        std::string extension = path.extension().string();
        for (char& c : extension)
            if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
        std::error_code ignored;
        if (extension != ".tga") note(" is not a TGA file, left out");
        else if (!fs::exists(path, ignored)) note(" does not exist, left out");
        else return path;
        return {};
    }

    fs::path obj_;
    NormalMap wanted_;
    Notes& notes_;
    Maps beside_;  // the pictures beside the model
    TextureFiles files_;
    std::vector<Use> uses_;
};

// ---- materials for faces ----

struct Piece {  // the faces [begin,end) of the file share a material
    int begin, end, material;
};

// Fills MATERIALS with those that faces use, in the order of their first face. What the .mtl does not define is all one
// default material, without a name.
std::vector<Piece> assign_materials(const Obj& obj, const MtlMaterials& library, std::vector<Material>& materials,
                                    Notes& notes) {
    const std::vector<std::string>& names = obj.materials.list();
    std::vector<int> index(names.size(), -1);
    int default_index = -1;
    std::vector<Piece> pieces;
    for (std::size_t i = 0; i < obj.runs.size(); i++) {
        const int begin = obj.runs[i].face, name = obj.runs[i].name;
        const int end = i + 1 < obj.runs.size() ? obj.runs[i + 1].face : to_int(obj.corners.size() / 3);
        if (begin == end) continue;
        int& known = name < 0 ? default_index : index[to_size(name)];
        if (known < 0) {
            const auto found = name < 0 ? library.end() : library.find(names[to_size(name)]);
            if (name >= 0 && found == library.end())
                notes.add("there is no material " + in_quotes(names[to_size(name)]));
            int& slot = found == library.end() ? default_index : known;
            if (slot < 0) {
                slot = to_int(materials.size());
                materials.emplace_back();
                if (found != library.end()) {
                    materials.back().name = found->first;
                    materials.back().Kd = found->second.Kd;
                }
            }
            known = slot;
        }
        pieces.push_back({begin, end, known});
    }
    return pieces;
}

// Sorts the faces, stably, by material.
std::vector<Model::Group> group_by_material(std::vector<Piece> pieces, std::vector<Corner>& corners) {
    const auto before = [](const Piece& a, const Piece& b) { return a.material < b.material; };
    if (!std::is_sorted(pieces.begin(), pieces.end(), before)) {
        std::stable_sort(pieces.begin(), pieces.end(), before);
        std::vector<Corner> sorted;
        sorted.reserve(corners.size());
        for (const Piece& p : pieces)
            sorted.insert(sorted.end(), corners.begin() + 3 * std::ptrdiff_t{p.begin},
                          corners.begin() + 3 * std::ptrdiff_t{p.end});
        corners = std::move(sorted);
    }
    std::vector<Model::Group> groups;
    int face = 0;
    for (const Piece& p : pieces) {
        if (groups.empty() || groups.back().material != p.material) groups.push_back({face, face, p.material});
        groups.back().end = face += p.end - p.begin;
    }
    return groups;
}

}  // namespace

// ---- the model ----

Model::Model(const fs::path& path, NormalMap wanted) {
    Obj obj = ObjReader(path).read();
    Notes notes;

    PolygonCutter cutter;
    int crossed = 0;
    for (const Obj::Polygon& p : obj.polygons)
        crossed += !cutter.cut(obj.verts, &obj.corners[to_size(p.face) * 3], p.corners);
    if (crossed > 0)
        notes.add(std::to_string(crossed) + (crossed == 1 ? " polygon crosses itself" : " polygons cross themselves") +
                  " or cannot be cut well");
    if (obj.lacks_normals) make_normals(obj.verts, obj.corners, obj.normals);

    const MtlMaterials library = read_libraries(path, obj.libraries.list(), notes);
    Texturing texturing(path, wanted, notes);
    groups_ = group_by_material(assign_materials(obj, library, materials_, notes), obj.corners);
    for (const Group& g : groups_) {
        const Material& material = materials_[to_size(g.material)];
        const auto found = library.find(material.name);
        const bool has_uvs =
            std::any_of(obj.corners.begin() + 3 * std::ptrdiff_t{g.begin},
                        obj.corners.begin() + 3 * std::ptrdiff_t{g.end}, [](const Corner& c) { return c.uv >= 0; });
        texturing.plan(to_size(g.material), found != library.end() ? &found->second : nullptr, material.name, has_uvs);
    }
    texturing.load(materials_);

    verts_ = std::move(obj.verts);
    normals_ = std::move(obj.normals);
    uvs_ = std::move(obj.uvs);
    corners_ = std::move(obj.corners);
    notes_ = notes.take();
}

bool Model::fit() {
    if (corners_.empty()) return false;
    vec3 low = verts_[to_size(corners_[0].vert)], high = low;
    for (const Corner& c : corners_) {
        const vec3& v = verts_[to_size(c.vert)];
        for (int i = 0; i < 3; i++) {
            low[i] = std::min(low[i], v[i]);
            high[i] = std::max(high[i], v[i]);
        }
    }
    const double extent = std::max(largest(low), largest(high));
    constexpr double pixel = 2 / (.75 * 16384);  // [-1,1] are three quarters of a picture's side
    const bool invisible = largest(high - low) < pixel && !(low == high);
    if (extent <= 1 && !invisible) return false;

    // First by a power of two, so that the largest coordinate is in [1,2) and nothing overflows. From there on the
    // numbers are the same whatever power of two the model is multiplied by, and so are their roundings. (What is denormal
    // comes out smaller: 2^1023 is the largest power of two.)
    const double unit = std::scalbn(1., std::min(-std::ilogb(extent), 1023));
    low = low * unit;
    high = high * unit;
    const vec3 sides = high - low;
    const double side = std::max({sides.x, sides.y, sides.z});
    for (vec3& v : verts_) {
        v = v * unit;
        v = (v - low) - (high - v);  // twice the way from the centre, which itself may be no double
        if (side > 0) v = v / side;
        for (int i = 0; i < 3; i++) v[i] = std::clamp(v[i], -1., 1.);  // what no face uses may be anywhere
    }
    notes_.push_back("fitted to [-1,1]^3");
    return true;
}

void Model::move(const vec3& by) {
    for (vec3& v : verts_) v = v + by;
}

std::string missing_maps(const std::vector<Model>& models) {
    const auto used = [&](auto&& has) {
        for (const Model& model : models)
            for (const Material& m : model.materials())
                if (has(m)) return true;
        return false;
    };
    std::string names;
    const auto check = [&](const char* name, auto&& has) {
        if (!used(has)) names += (names.empty() ? "" : ",") + std::string(name);
    };
    check("diffuse", [](const Material& m) { return !m.diffuse.empty(); });
    check("normal_map", [](const Material& m) { return !m.normal.empty() || !m.tangent.empty(); });
    check("specular", [](const Material& m) { return !m.specular.empty(); });
    check("glow", [](const Material& m) { return !m.glow.empty(); });
    return names;
}
