// model.cpp: reads an .obj, its .mtl and the pictures they name; cuts polygons into triangles and makes missing
// normals. It draws nothing. The formats are Wavefront's "Object Files (.obj)" and "Material Library File (.mtl)", as
// found in the wild: what other programs write is read where its meaning is clear, and is an error with its line where
// it is not.
#include "model.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <future>
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

// A vertex takes 8 bytes of text, a face's corner 2: no array made from so much text has 2^31 elements.
constexpr std::uintmax_t max_bytes = std::uintmax_t{1} << 32;

template <typename T>
int count(const std::vector<T>& array) {
    return static_cast<int>(array.size());
}

// ---- text, line by line and word by word ----

// Text from elsewhere, made fit for one line of a message: at most 60 characters, none of them a control character.
std::string printable(std::string_view text) {
    std::string out(text.substr(0, 60));
    for (char& c : out)
        if (static_cast<unsigned char>(c) < ' ' || c == 127) c = '?';
    return text.size() > 60 ? out + "..." : out;
}
std::string in_quotes(std::string_view text) { return std::string("'").append(printable(text)).append("'"); }

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\0'; }  // '\0': see join_lines

// A line that ends in '\' goes on in the next one; not where it holds a '#', since a stray '\' in a comment must not
// swallow a vertex. Both bytes become blanks, the newline '\0', which no text has: so lines can still be counted.
void join_lines(std::string& text) {
    for (std::size_t at = 0; (at = text.find('\\', at)) != text.npos; at++) {
        std::size_t newline = at + 1;
        while (is_blank(text[newline])) newline++;
        if (text[newline] != '\n') continue;
        const std::size_t before = text.find_last_of(std::string_view("#\n\0", 3), at);
        if (before != text.npos && text[before] == '#') continue;
        text[at] = ' ';
        if (newline + 1 < text.size()) text[newline] = '\0';
    }
}

// The whole of a text file, its lines joined and each ended by '\n', the last one too.
std::string read_text(const fs::path& path) {
    const auto fail = [&](const std::string& what) { throw std::runtime_error(path.string() + ": " + what); };
    std::error_code unknown;
    if (fs::is_directory(path, unknown)) fail("is a directory");
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.string().c_str(), "rb"), std::fclose);
    if (!file) fail("cannot be opened: " + std::generic_category().message(errno));
    std::string text;
    const std::uintmax_t size = fs::file_size(path, unknown);  // a pipe has none
    if (!unknown && size <= max_bytes) text.reserve(size + 1);
    std::array<char, 1 << 14> piece;
    while (const std::size_t n = std::fread(piece.data(), 1, piece.size(), file.get())) {
        if (std::memchr(piece.data(), 0, n)) fail("is a binary file, not text");
        if (text.size() + n > max_bytes) fail("is larger than 4 GiB");
        text.append(piece.data(), n);
    }
    if (std::ferror(file.get())) fail("cannot be read");
    if (!text.ends_with('\n')) text += '\n';
    if (text.starts_with("\xEF\xBB\xBF")) text.replace(0, 3, "   ");  // UTF-8's byte order mark
    join_lines(text);
    return text;
}

// Reads a text, or a part of one that ends with a newline, from the first byte to the last.
class Scanner {
public:
    // [BEGIN,END) is not empty, ends with '\n' and has been through join_lines. NAME is for messages.
    Scanner(const fs::path& name, std::string_view text)
        : name_(name.string()), at_(text.data()), end_(at_ + text.size()), statement_(at_), counted_(at_) {}

    bool is_done() const { return at_ == end_; }
    void next_line() { statement_ = at_ = newline() + 1; }

    // At the end of a statement, be it the end of the line or a comment. Call it after skip_blanks.
    bool at_end() const { return *at_ == '\n' || *at_ == '#'; }
    void skip_blanks() {
        while (is_blank(*at_)) at_++;
    }
    bool skip(char c) {
        if (*at_ != c) return false;
        at_++;
        return true;
    }
    char peek() const { return *at_; }
    std::string_view peek_word() {  // up to a blank
        skip_blanks();
        const char* end = at_;
        while (!is_blank(*end) && *end != '\n') end++;
        return {at_, end};
    }
    std::string_view word() {  // empty at the end of the statement
        skip_blanks();
        const char* const begin = at_;
        while (!ends_word(*at_)) at_++;
        return {begin, at_};
    }
    std::string rest() {  // of the line, without blanks at its ends: a name may contain blanks and '#'
        skip_blanks();
        const char *const begin = at_, *end = at_ = newline();
        while (end > begin && is_blank(end[-1])) end--;
        std::string text(begin, end);
        std::replace(text.begin(), text.end(), '\0', ' ');
        return text;
    }

    // A finite number. What underflows is zero, or the nearest denormal.
    double real() {
        // Most numbers are short: up to 15 digits make an integer below 2^53, and 10^15 is a double too, so one
        // division rounds correctly and gives what from_chars gives, in less time.
        static constexpr double power_of_ten[] = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                  1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
        const char* p = at_ + (*at_ == '-' || *at_ == '+');
        const char *const first = p, *point = nullptr;
        std::uint64_t digits = 0;  // wraps round where there are too many, and then is not used
        for (; is_digit(*p) || (*p == '.' && !point); p++) {
            if (*p == '.') point = p;
            else digits = digits * 10 + static_cast<unsigned>(*p - '0');
        }
        const std::ptrdiff_t length = p - first - (point ? 1 : 0);
        if (length > 0 && length <= 15 && ends_word(*p)) {
            const double value = static_cast<double>(digits) / power_of_ten[point ? p - point - 1 : 0];
            return *std::exchange(at_, p) == '-' ? -value : value;
        }

        const char* const begin = after_plus();
        double value = 0;
        const auto [end, error] = std::from_chars(begin, end_, value);
        if (error == std::errc::invalid_argument) fail(in_quotes(peek_word()) + " is no number");
        if (error == std::errc::result_out_of_range)  // above or below: strtod says which
            value = std::strtod(std::string(begin, end).c_str(), nullptr);
        if (!std::isfinite(value)) fail(in_quotes(peek_word()) + " is not finite");
        at_ = end;
        expect_end_of_word();
        return value;
    }

    // An integer whose magnitude is below 2^31.
    int integer(const char* what) {
        std::int64_t value = 0;
        const auto [end, error] = std::from_chars(after_plus(), end_, value);
        if (error == std::errc::invalid_argument) fail(in_quotes(peek_word()) + " is no " + what);
        if (error != std::errc() || std::abs(value) > INT32_MAX)
            fail(std::string(what) + " " + in_quotes(peek_word()) + " is out of range");
        at_ = end;
        return static_cast<int>(value);
    }

    // After a number: it must not run into something else.
    void expect_end_of_word() {
        if (!ends_word(*at_)) fail("garbage after a number: " + in_quotes(peek_word()));
    }

    const char* position() const { return at_; }
    // The number of the statement's first line.
    std::int64_t line() { return line(statement_); }
    // Errors of what is at the cursor, at the beginning of the statement, and at a former position.
    [[noreturn]] void fail(const std::string& what) { fail(at_, what); }
    [[noreturn]] void fail_statement(const std::string& what) { fail(statement_, what); }
    [[noreturn]] void fail(const char* position, const std::string& what) {
        throw std::runtime_error(name_ + ":" + std::to_string(line(position)) + ": " + what);
    }

private:
    static bool ends_word(char c) { return is_blank(c) || c == '\n' || c == '#'; }
    const char* newline() const { return static_cast<const char*>(std::memchr(at_, '\n', end_ - at_)); }
    const char* after_plus() const { return at_ + (*at_ == '+' && at_[1] != '-'); }
    std::int64_t line(const char* position) {  // counts on from where it was asked last: positions do not go back
        line_ += std::count_if(counted_, position, [](char c) { return c == '\n' || c == '\0'; });
        counted_ = position;
        return line_;
    }

    std::string name_;
    const char *at_, *end_, *statement_;  // the cursor; the text's end; the beginning of the cursor's statement
    const char* counted_;
    std::int64_t line_ = 1;  // of counted_
};

// ---- the .obj ----

// What the file says, before it is known whether its indices are right. Faces are triangles already, but those of a
// polygon are a fan, to be cut better once the vertices are known.
struct Obj {
    struct Polygon {
        int face, corners;  // its first triangle, and how many corners it has: two more than triangles
    };
    struct Run {
        int face;  // from this face on MATERIAL is used
        std::string material;
    };
    std::vector<vec3> verts, normals;
    std::vector<vec2> uvs;
    std::vector<Corner> corners;
    std::vector<Polygon> polygons;
    std::vector<Run> runs{{0, ""}};
    std::vector<std::string> libraries;
    bool lacks_normals = false;  // some corner has none, or some normal has no length
};

class ObjParser {
public:
    ObjParser(const fs::path& path, std::string_view text) : in_(path, text) {}

    Obj parse() {
        for (; !in_.is_done(); in_.next_line()) {
            const std::string_view word = in_.word();
            if (word == "v") obj_.verts.push_back(vector("a vertex needs three coordinates"));
            else if (word == "vt") obj_.uvs.push_back(uv());
            else if (word == "vn") obj_.normals.push_back(unit_normal());
            else if (word == "f") face();
            else if (word == "usemtl") use_material();
            else if (word == "mtllib") obj_.libraries.push_back(in_.rest());
            // o, g, s, lines, curves and what nobody knows: nothing
        }
        const int counts[] = {count(obj_.verts), count(obj_.uvs), count(obj_.normals)};
        for (const Forward& f : forward_)
            if (f.index > counts[f.kind])
                in_.fail(f.position, std::string(kinds[f.kind]) + " " + std::to_string(f.index) +
                                         ", but the file has only " + std::to_string(counts[f.kind]));
        return std::move(obj_);
    }

private:
    enum Kind { vertex, texture, normal };
    static constexpr const char* kinds[] = {"vertex index", "texture index", "normal index"};
    struct Forward {  // an index of something that had not been defined yet: checked at the end
        const char* position;
        Kind kind;
        int index;
    };

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
    int index(Kind kind, int defined) {
        const int i = in_.integer(kinds[kind]);
        if (i > defined) forward_.push_back({in_.position(), kind, i});
        if (i > 0) return i - 1;
        if (i == 0) in_.fail(std::string(kinds[kind]) + " 0 (indices count from 1)");
        if (-i > defined)
            in_.fail(std::string(kinds[kind]) + " " + std::to_string(i) + ", but only " + std::to_string(defined) +
                     " are defined so far");
        return defined + i;
    }
    Corner corner() {  // v, v/vt, v//vn or v/vt/vn; v/ and v// are seen too
        const auto given = [this] { return in_.peek() == '-' || in_.peek() == '+' || is_digit(in_.peek()); };
        Corner c{index(vertex, count(obj_.verts)), -1, -1};
        if (in_.skip('/')) {
            if (given()) c.uv = index(texture, count(obj_.uvs));
            if (in_.skip('/') && given()) c.normal = index(normal, count(obj_.normals));
        }
        in_.expect_end_of_word();
        if (c.normal < 0) obj_.lacks_normals = true;
        return c;
    }
    void face() {
        Corner first{}, previous{};
        int n = 0;
        const int begin = nfaces();
        for (in_.skip_blanks(); !in_.at_end(); in_.skip_blanks(), n++) {
            const Corner c = corner();
            if (n == 0) first = c;
            if (n >= 2) obj_.corners.insert(obj_.corners.end(), {first, previous, c});
            previous = c;
        }
        if (n < 3) in_.fail_statement("a face needs three corners, this one has " + std::to_string(n));
        if (n > 3) obj_.polygons.push_back({begin, n});
    }
    void use_material() {
        if (obj_.runs.back().face != nfaces()) obj_.runs.push_back({nfaces(), {}});
        obj_.runs.back().material = in_.rest();
    }
    int nfaces() const { return static_cast<int>(obj_.corners.size() / 3); }

    Scanner in_;
    Obj obj_;
    std::vector<Forward> forward_;
};

// ---- polygons ----

double largest(const vec3& v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); }

// The power of two that brings X > 0 into [1,2), so that products and differences of numbers up to X neither overflow
// nor vanish. To multiply by it changes no sign and no direction. (What is denormal comes out smaller: 2^1023 is the
// largest power of two.)
double unit_for(double x) { return std::scalbn(1., std::min(-std::ilogb(x), 1023)); }

// Twice the signed area of the triangle abc, positive where it is counterclockwise.
double area2(const vec2& a, const vec2& b, const vec2& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Cuts polygons into triangles, always two fewer than corners, in the plane of the polygon's Newell normal: a fan where
// that is right, and else ear clipping (G. H. Meisters, "Polygons have ears", 1975). An ear is a corner with a convex
// angle whose triangle no reflex corner lies in; cutting it off changes only whether its two neighbours are ears. So n
// corners are asked 3n times at most, and each time n corners are looked at. From max_corners on a polygon is a fan,
// so that this stays below 3000 looks per corner, whatever the file.
class PolygonCutter {
public:
    // FAN holds the polygon (c0, c1, c2, ...) as the triangles (c0,c1,c2), (c0,c2,c3), ... and receives the triangles.
    // They wind as the polygon does. Returns false where the polygon crosses itself or has too many corners, so that a
    // part of it is still a fan. A polygon without area stays a fan, too.
    bool cut(const std::vector<vec3>& verts, Corner* fan, int n) {
        corners_.assign({fan[0], fan[1]});
        for (std::ptrdiff_t i = 0; i < n - 2; i++) corners_.push_back(fan[3 * i + 2]);
        if (!project(verts) || is_good_fan()) return true;
        return n <= max_corners && clip_ears(fan);
    }

private:
    static constexpr int max_corners = 1000;

    // Fills points_: the corners seen along the axis that is nearest to the normal, so that the polygon runs
    // counterclockwise. Unlike a turn into the plane, leaving out a coordinate rounds nothing: three corners on a line
    // stay on it. False where there is no area.
    bool project(const std::vector<vec3>& verts) {
        double extent = 0, span = 0;
        for (const Corner& c : corners_) extent = std::max(extent, largest(verts[c.vert]));
        if (!(extent > 0)) return false;
        const double unit = unit_for(extent);  // else differences may overflow
        const vec3 origin = verts[corners_[0].vert] * unit;
        relative_.clear();
        for (const Corner& c : corners_) {
            relative_.push_back(verts[c.vert] * unit - origin);
            span = std::max(span, largest(relative_.back()));
        }
        if (!(span > 0)) return false;
        for (vec3& p : relative_) p = p * unit_for(span);

        vec3 newell;  // twice the polygon's area along its normal
        for (int i = 1; i + 1 < count(relative_); i++) newell = newell + cross(relative_[i], relative_[i + 1]);
        const double area = largest(newell);
        if (!(area > 0)) return false;
        const int axis = std::fabs(newell.z) == area ? 2 : std::fabs(newell.y) == area ? 1 : 0;
        int right = (axis + 1) % 3, up = (axis + 2) % 3;
        if (newell[axis] < 0) std::swap(right, up);
        points_.clear();
        for (const vec3& p : relative_) points_.push_back({p[right], p[up]});
        return true;
    }

    // The fan's signed areas add up to the polygon, wherever the corners are. So it is right where all are positive.
    bool is_good_fan() const {
        for (int i = 1; i + 1 < count(points_); i++)
            if (!(area2(points_[0], points_[i], points_[i + 1]) > 0)) return false;
        return true;
    }

    bool clip_ears(Corner* out) {
        const int n = count(corners_);
        previous_.resize(n);
        next_.resize(n);
        for (int i = 0; i < n; i++) {
            previous_[i] = i ? i - 1 : n - 1;
            next_[i] = i < n - 1 ? i + 1 : 0;
        }
        const auto emit = [&](int a, int b, int c) {
            for (const int i : {a, b, c}) *out++ = corners_[i];
        };
        std::vector<char> is_no_ear(n, 0);
        int left = n, v = 0;
        for (int passed = 0; left > 3 && passed < left;) {  // all passed: there is no ear, it crosses itself
            const int u = previous_[v], w = next_[v];
            if (is_no_ear[v] || !is_ear(v)) {
                is_no_ear[v] = 1;
                passed++;
            } else {
                emit(u, v, w);
                next_[u] = w;
                previous_[w] = u;
                is_no_ear[u] = is_no_ear[w] = 0;
                passed = 0;
                left--;
            }
            v = w;
        }
        for (int a = next_[v]; next_[a] != v; a = next_[a]) emit(v, a, next_[a]);
        return left == 3;
    }

    double turn(int v) const {  // positive where the angle at v is convex
        return area2(points_[previous_[v]], points_[v], points_[next_[v]]);
    }

    // A corner without area that is not between its neighbours: the tip of a spike, or a point twice. It can be cut off
    // at any time, and must be before an ear is cut beside it, because that would be outside the polygon.
    bool is_spike(int v) const {
        const vec2 p = points_[v];
        return turn(v) == 0 && dot(points_[previous_[v]] - p, points_[next_[v]] - p) >= 0;
    }
    bool is_ear(int v) const {
        const int u = previous_[v], w = next_[v];
        if (!(turn(v) > 0)) return is_spike(v);
        if (is_spike(u) || is_spike(w)) return false;
        const vec2 a = points_[u], b = points_[v], c = points_[w];
        for (int i = next_[w]; i != u; i = next_[i]) {
            const vec2 p = points_[i];
            if (area2(a, b, p) < 0 || area2(b, c, p) < 0 || area2(c, a, p) < 0) continue;
            const bool is_corner = p == a || p == b || p == c;  // a corner at the same place does not block
            if (!is_corner && turn(i) <= 0) return false;
        }
        return true;
    }

    std::vector<Corner> corners_;
    std::vector<vec3> relative_;
    std::vector<vec2> points_;
    std::vector<int> previous_, next_;
};

// ---- normals where the file gives none ----

// A triangle's unit normal and its angles; no normal and no angles where it has no area.
struct Face {
    vec3 normal;
    double angles[3] = {0, 0, 0};
};

Face measure(const vec3& a, const vec3& b, const vec3& c) {
    vec3 edges[] = {b - a, c - b, a - c};
    const double length = std::max({largest(edges[0]), largest(edges[1]), largest(edges[2])});
    if (!std::isfinite(length)) return measure(a * .25, b * .25, c * .25);  // a difference has overflowed
    if (!(length > 0)) return {};
    for (vec3& e : edges) e = e * unit_for(length);

    // The two edges across from the longest one have the best-conditioned cross product.
    const double squares[] = {dot(edges[0], edges[0]), dot(edges[1], edges[1]), dot(edges[2], edges[2])};
    const std::ptrdiff_t i = std::max_element(squares, squares + 3) - squares;
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
    const double area = norm(across);  // twice: the product of any two edges' lengths and the sine between them
    face.angles[i] = std::atan2(area, -dot(longest, last));
    face.angles[(i + 1) % 3] = std::atan2(area, -dot(next, longest));
    face.angles[(i + 2) % 3] = std::numbers::pi - face.angles[i] - face.angles[(i + 1) % 3];
    return face;
}

// Gives a normal to each corner without one, or with one of no length: the mean of the normals of the faces around its
// vertex, each weighted by its angle there (G. Thuermer and C. Wuethrich, "Computing vertex normals from polygonal
// facets", 1998), which does not depend on how the polygons have been cut.
void make_normals(const std::vector<vec3>& verts, std::vector<Corner>& corners, std::vector<vec3>& normals) {
    struct Sum {
        vec3 normals;
        double angles = 0;
        int faces = 0;
    };
    std::vector<Sum> sums(verts.size());
    const auto face_of = [&](const Corner* c) { return measure(verts[c[0].vert], verts[c[1].vert], verts[c[2].vert]); };
    const Corner* const end = corners.data() + corners.size();
    for (const Corner* c = corners.data(); c < end; c += 3) {
        const Face face = face_of(c);
        for (int k = 0; k < 3; k++) {
            Sum& sum = sums[c[k].vert];
            sum.normals = sum.normals + face.normal * face.angles[k];
            sum.angles += face.angles[k];
            sum.faces++;
        }
    }

    // A sum of n terms is off by at most n half-units of the sum of their sizes, its terms themselves by less than 4
    // units each. No more than that is left where the faces cancel, as on the two sides of a sheet: then a face has its
    // own normal, or an upright one where it has no area.
    const int first_mean = count(normals);
    for (const Sum& sum : sums) {
        const double noise = (sum.faces + 4) * sum.angles * std::numeric_limits<double>::epsilon();
        normals.push_back(norm(sum.normals) > noise ? normalized(sum.normals) : vec3{});
    }
    for (Corner* c = corners.data(); c < end; c += 3) {
        int own = -1;
        for (int k = 0; k < 3; k++) {
            int& normal = c[k].normal;
            if (normal < 0 || normals[normal] == vec3{}) normal = first_mean + c[k].vert;
            if (!(normals[normal] == vec3{})) continue;
            if (own < 0) {
                own = count(normals);
                const vec3 n = face_of(c).normal;
                normals.push_back(n == vec3{} ? vec3{0, 0, 1} : n);
            }
            normal = own;
        }
    }
}

// ---- materials ----

// The kinds of map: the end of the name of a picture beside the model, and where it goes.
enum { diffuse_map, normal_map, tangent_map, specular_map, glow_map, map_count, bump_map = map_count };
constexpr struct {
    const char* suffix;
    TGAImage Material::*map;
} map_kinds[map_count] = {{"_diffuse.tga", &Material::diffuse},
                          {"_nm.tga", &Material::normal},
                          {"_nm_tangent.tga", &Material::tangent},
                          {"_spec.tga", &Material::specular},
                          {"_glow.tga", &Material::glow}};

struct MtlMaterial {
    vec3 Kd{1, 1, 1};
    std::array<std::string, map_count + 1> maps;  // paths, or empty; bump_map stands in for tangent_map
    std::vector<std::string> notes;
};
using Library = std::map<std::string, MtlMaterial>;

// At most 20 notes, each once, and how many there would have been.
class Notes {
public:
    void add(const std::string& note) {
        if (std::find(notes_.begin(), notes_.end(), note) != notes_.end()) return;
        if (++count_ <= 20) notes_.push_back(note);
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
    static const std::map<std::string_view, int> options = {  // one word, or up to so many numbers
        {"-blendu", 1}, {"-blendv", 1}, {"-cc", 1}, {"-clamp", 1}, {"-imfchan", 1}, {"-texres", 1}, {"-bm", 1},
        {"-boost", 1},  {"-type", 1},   {"-mm", 2}, {"-o", 3},     {"-s", 3},       {"-t", 3}};
    for (;;) {
        std::string_view rest = text;
        const auto option = options.find(take_word(rest));
        if (option == options.end()) return text;
        for (int i = 0; i < option->second; i++) {
            std::string_view after = rest;
            if (!is_number(take_word(after)) && option->second > 1) break;
            rest = after;
        }
        text = rest;
    }
}

// The path of a file that is named in another one, where programs of another system may have written '\' for '/'.
fs::path beside(const fs::path& file, std::string name) {
    std::replace(name.begin(), name.end(), '\\', '/');
    return (file.parent_path() / name).lexically_normal();
}

bool is_there(const fs::path& path) {
    std::error_code ignored;
    return fs::exists(path, ignored);
}

vec3 read_Kd(Scanner& in) {
    double values[3];
    int n = 0;
    for (in.skip_blanks(); !in.at_end(); in.skip_blanks(), n++) {
        const double value = std::clamp(in.real(), 0., 1.);
        if (n < 3) values[n] = value;
    }
    if (n != 1 && n != 3) in.fail_statement("Kd needs three numbers, or one");
    return n == 1 ? vec3{values[0], values[0], values[0]} : vec3{values[0], values[1], values[2]};
}

// Adds the file's materials to the others; one of the same name is replaced.
void read_mtl(const fs::path& path, Library& library) {
    static const std::map<std::string_view, int> maps = {
        {"map_Kd", diffuse_map}, {"map_Ks", specular_map}, {"map_Ke", glow_map}, {"norm", tangent_map},
        {"map_Bump", bump_map},  {"map_bump", bump_map},   {"bump", bump_map}};
    const std::string text = read_text(path);
    MtlMaterial before_the_first, *material = &before_the_first;
    for (Scanner in(path, text); !in.is_done(); in.next_line()) {
        const auto note = [&](const std::string& what) {
            material->notes.push_back(path.filename().string() + ":" + std::to_string(in.line()) + ": " + what);
        };
        const std::string_view word = in.word();
        const auto map = maps.find(word);
        if (word == "newmtl") {
            material = &library[in.rest()];
            *material = {};
        } else if (word == "Kd" && (in.peek_word() == "spectral" || in.peek_word() == "xyz")) {
            note("Kd " + std::string(in.peek_word()) + " is not known, white is used");
        } else if (word == "Kd") {
            material->Kd = read_Kd(in);
        } else if (map != maps.end()) {
            const std::string all = in.rest(), name(without_options(all));
            const fs::path file = beside(path, name);
            std::string extension = file.extension().string();
            for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
            if (name.empty()) continue;
            if (extension != ".tga") note(printable(name) + " is not a TGA file, left out");
            else if (!is_there(file)) note(printable(name) + " does not exist, left out");
            else material->maps[map->second] = file.string();
        }
    }
}

// Reads the files that the mtllib lines name: each line is one name, which may contain blanks, or else several.
Library read_libraries(const fs::path& obj, const std::vector<std::string>& lines, Notes& notes) {
    Library library{{"", {}}};  // the default material
    std::set<fs::path> seen;
    const auto read = [&](std::string_view name) {
        const fs::path path = beside(obj, std::string(name));
        if (!is_there(path)) return false;
        if (fs::is_other(path)) throw std::runtime_error(path.string() + ": is not a file");  // a pipe may never end
        if (seen.insert(path).second) read_mtl(path, library);
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
    return library;
}

// Sorts the faces, stably, by material, and fills MATERIALS with those that faces use, in the order of their first
// face. What the library does not define is all one default material, without a name.
std::vector<Model::Group> group_by_material(Obj& obj, const Library& library, std::vector<Material>& materials,
                                            Notes& notes) {
    std::map<std::string, int> indices;
    std::vector<Model::Group> pieces, groups;
    obj.runs.push_back({static_cast<int>(obj.corners.size() / 3), ""});
    for (int i = 0; i + 1 < count(obj.runs); i++) {
        const int begin = obj.runs[i].face, end = obj.runs[i + 1].face;
        if (begin == end) continue;
        std::string name = obj.runs[i].material;
        if (!library.contains(name)) {
            notes.add("there is no material " + in_quotes(name));
            name.clear();
        }
        const auto [entry, is_new] = indices.emplace(name, count(materials));
        if (is_new) materials.push_back({name, library.at(name).Kd, {}, {}, {}, {}, {}});
        pieces.push_back({begin, end, entry->second});
    }
    std::stable_sort(pieces.begin(), pieces.end(), [](auto& a, auto& b) { return a.material < b.material; });

    std::vector<Corner> sorted;
    if (materials.size() > 1) sorted.reserve(obj.corners.size());
    int face = 0;
    for (const auto& [begin, end, material] : pieces) {
        if (groups.empty() || groups.back().material != material) groups.push_back({face, face, material});
        groups.back().end = face += end - begin;
        if (materials.size() > 1)
            sorted.insert(sorted.end(), &obj.corners[begin * std::size_t{3}], &obj.corners[end * std::size_t{3}]);
    }
    if (materials.size() > 1) obj.corners = std::move(sorted);
    return groups;
}

// ---- textures ----

struct Texture {  // a picture, and the maps that it becomes
    struct Use {
        int material;
        TGAImage Material::*map;
    };
    std::string path;
    std::vector<Use> uses;
};

// The maps of each group's material: from its .mtl, and where that has none, from the pictures beside the model.
std::vector<Texture> plan_textures(const fs::path& obj, const std::vector<Model::Group>& groups,
                                   const std::vector<Corner>& corners, const std::vector<Material>& materials,
                                   const Library& library, NormalMap wanted, Notes& notes) {
    std::array<std::string, map_count> pictures_beside;
    for (int i = 0; i < map_count; i++) {
        const fs::path path = fs::path(obj).replace_extension() += map_kinds[i].suffix;
        if (is_there(path)) pictures_beside[i] = path.lexically_normal().string();
    }
    std::vector<Texture> textures;
    std::map<std::string, int> indices;
    for (const Model::Group& g : groups) {
        const std::string& name = materials[g.material].name;
        const MtlMaterial& mtl = library.at(name);
        for (const std::string& note : mtl.notes) notes.add(note);
        std::array<std::string, map_count> maps = pictures_beside;
        for (const int i : {diffuse_map, bump_map, tangent_map, specular_map, glow_map})
            if (!mtl.maps[i].empty()) maps[i == bump_map ? tangent_map : i] = mtl.maps[i];
        if (!maps[normal_map].empty() && !maps[tangent_map].empty())
            maps[wanted == NormalMap::object ? tangent_map : normal_map].clear();

        const bool has_uvs = std::any_of(&corners[g.begin * std::size_t{3}], &corners[g.end * std::size_t{3}],
                                         [](const Corner& c) { return c.uv >= 0; });
        for (int i = 0; i < map_count; i++) {
            if (maps[i].empty()) continue;
            if (!has_uvs) {
                notes.add((name.empty() ? "" : "material " + in_quotes(name) + ": ") +
                          "no texture coordinates, so no textures");
                break;
            }
            const auto [entry, is_new] = indices.emplace(maps[i], count(textures));
            if (is_new) textures.push_back({maps[i], {}});
            textures[entry->second].uses.push_back({g.material, map_kinds[i].map});
        }
    }
    return textures;
}

TGAImage widened(const TGAImage& grey) {
    TGAImage out(grey.width(), grey.height(), TGAImage::RGB);
    for (int y = 0; y < grey.height(); y++)
        for (int x = 0; x < grey.width(); x++) std::fill_n(out.pixel(x, y), 3, *grey.pixel(x, y));
    return out;
}

// Decodes each picture once, some at the same time, and hands it to the materials. What is thrown is the error of the
// first bad one in their order.
void load_textures(const std::vector<Texture>& textures, const fs::path& obj, std::vector<Material>& materials,
                   Notes& notes) {
    constexpr std::uint64_t max_copied = std::uint64_t{1} << 30;
    std::uint64_t copied = 0;
    const int ahead = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    std::vector<std::future<TGAImage>> images(textures.size());
    for (int i = 0, started = 0; i < count(textures); i++) {
        for (; started < std::min(i + ahead, count(textures)); started++)
            images[started] = std::async(TGAImage::read_tga_file, textures[started].path);
        TGAImage image = images[i].get();
        for (const Texture::Use& use : textures[i].uses) {
            const bool is_grey = image.bytespp() == 1, is_last = &use == &textures[i].uses.back();
            if (is_grey && (use.map == &Material::normal || use.map == &Material::tangent)) {
                notes.add(fs::path(textures[i].path).filename().string() + " is grey, so no normal map: left out");
                continue;
            }
            const bool widens = is_grey && use.map != &Material::specular;
            if (!is_last) copied += std::uint64_t{1} * image.width() * image.height() * (widens ? 3 : image.bytespp());
            if (copied > max_copied)
                throw std::runtime_error(obj.string() +
                                         ": its materials share pictures that would take more than 1 GiB in copies");
            TGAImage& map = materials[use.material].*use.map;
            map = widens ? widened(image) : is_last ? std::move(image) : image;
        }
    }
}

}  // namespace

// ---- the model ----

Model::Model(const fs::path& path, NormalMap wanted) {
    Obj obj = ObjParser(path, read_text(path)).parse();
    if (obj.corners.empty()) throw std::runtime_error(path.string() + ": no faces");
    Notes notes;

    PolygonCutter cutter;
    int crossed = 0;
    for (const Obj::Polygon& p : obj.polygons)
        crossed += !cutter.cut(obj.verts, &obj.corners[p.face * std::size_t{3}], p.corners);
    if (crossed > 0)
        notes.add(std::to_string(crossed) + (crossed == 1 ? " polygon crosses itself" : " polygons cross themselves") +
                  " or cannot be cut well");
    if (obj.lacks_normals) make_normals(obj.verts, obj.corners, obj.normals);

    const Library library = read_libraries(path, obj.libraries, notes);
    groups_ = group_by_material(obj, library, materials_, notes);
    const auto textures = plan_textures(path, groups_, obj.corners, materials_, library, wanted, notes);
    load_textures(textures, path, materials_, notes);

    verts_ = std::move(obj.verts);
    normals_ = std::move(obj.normals);
    uvs_ = std::move(obj.uvs);
    corners_ = std::move(obj.corners);
    notes_ = notes.take();
}

bool Model::fit() {
    if (corners_.empty()) return false;
    vec3 low = vert(0, 0), high = low;
    for (const Corner& c : corners_)
        for (int i = 0; i < 3; i++) {
            low[i] = std::min(low[i], verts_[c.vert][i]);
            high[i] = std::max(high[i], verts_[c.vert][i]);
        }
    const double extent = std::max(largest(low), largest(high));
    constexpr double pixel = 2 / (.75 * 16384);  // [-1,1] are three quarters of a picture's side
    const bool invisible = largest(high - low) < pixel && !(low == high);
    if (extent <= 1 && !invisible) return false;

    // First the largest coordinate is brought into [1,2), so that nothing overflows. From there on the numbers are the
    // same whatever power of two the model is multiplied by, and so are their roundings.
    const double unit = unit_for(extent);
    low = low * unit;
    high = high * unit;
    const double side = largest(high - low);
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
    constexpr struct {
        const char* name;
        TGAImage Material::*map, Material::*other;
    } kinds[] = {{"diffuse", &Material::diffuse, &Material::diffuse},
                 {"normal_map", &Material::normal, &Material::tangent},
                 {"specular", &Material::specular, &Material::specular},
                 {"glow", &Material::glow, &Material::glow}};
    std::string names;
    for (const auto& kind : kinds) {
        bool used = false;
        for (const Model& model : models)
            for (const Material& m : model.materials())
                used = used || !(m.*kind.map).empty() || !(m.*kind.other).empty();
        if (!used) names.append(names.empty() ? "" : ",").append(kind.name);
    }
    return names;
}
