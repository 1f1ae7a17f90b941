// model.cpp: reads an .obj, its .mtl and the pictures they name; cuts polygons into triangles and makes missing
// normals. It draws nothing. The formats are Wavefront's "Object Files (.obj)" and "Material Library File (.mtl)", as
// found in the wild: what is clear is read, and what is not is an error with its line.
#include "model.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <deque>
#include <future>
#include <map>
#include <memory>
#include <numbers>
#include <set>
#include <string_view>
#include <thread>

namespace fs = std::filesystem;

namespace {

using Corner = Model::Corner;
constexpr double epsilon = std::numeric_limits<double>::epsilon();

// A vertex takes 8 bytes of text, a face's corner 2: no array made from a file of 4 GiB has 2^31 elements.
int count(const auto& array) { return static_cast<int>(array.size()); }

// ---- text, line by line and word by word ----

// Text from elsewhere, made fit for a message: at most 60 characters, none of them a control character.
std::string in_quotes(std::string_view text) {
    std::string out(text.substr(0, 60));
    for (char& c : out)
        if (static_cast<unsigned char>(c) < ' ' || c == 127) c = '?';
    return "'" + out + (text.size() > 60 ? "...'" : "'");
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\0'; }  // '\0': see join_lines
bool ends_word(char c) { return is_blank(c) || c == '\n' || c == '#'; }
template <typename Char>
Char* find(char c, Char* begin, Char* end) {
    return static_cast<Char*>(std::memchr(begin, c, end - begin));
}

// A line that ends in '\' goes on in the next one; not where it holds a '#', since a stray '\' in a comment must not
// swallow a vertex. Both bytes become blanks, the newline '\0', which no text has: so lines can still be counted.
void join_lines(char* begin, char* end) {
    for (char* p = begin; (p = find('\\', p, end)); p++) {
        char *newline = p + 1, *before = p;
        while (is_blank(*newline)) newline++;
        if (*newline != '\n') continue;
        while (before > begin && !std::strchr("#\n", before[-1])) before--;  // it finds '\0', too
        if (before > begin && before[-1] == '#') continue;
        *p = ' ';
        if (newline + 1 < end) *newline = '\0';
    }
}

// A whole text file, its lines joined and each ended by '\n', the last one too.
FileBytes read_text(const fs::path& path) {
    FileBytes text = read_file(path, 1);
    if (text.begin == text.end || text.end[-1] != '\n') *text.end++ = '\n';
    if (find('\0', text.begin, text.end)) throw std::runtime_error(path.string() + ": is a binary file, not text");
    if (std::string_view(text.begin, text.end).starts_with("\xEF\xBB\xBF")) text.begin += 3;  // UTF-8's byte order mark
    join_lines(text.begin, text.end);
    return text;
}

// Reads [BEGIN,END), a whole text or a part that ends with '\n', after join_lines. NAME is for messages.
class Scanner {
public:
    Scanner(const fs::path& name, const char* begin, const char* end)
        : name_(name.string()), at_(begin), end_(end), counted_(begin) {}

    bool is_done() const { return at_ == end_; }
    void next_line() { at_ = (*at_ == '\n' ? at_ : find('\n', at_, end_)) + 1; }
    bool at_end() {  // of a statement, be it the end of the line or a comment
        while (is_blank(*at_)) at_++;
        return *at_ == '\n' || *at_ == '#';
    }
    const char* position() const { return at_; }
    char peek() const { return *at_; }
    bool skip(char c) {
        if (*at_ != c) return false;
        at_++;
        return true;
    }
    bool at_word_end() const { return ends_word(*at_); }
    std::string_view peek_word() {  // empty at the end of the statement
        at_end();
        const char* end = at_;
        while (!ends_word(*end)) end++;
        return {at_, end};
    }
    std::string_view word() {
        const std::string_view w = peek_word();
        at_ += w.size();
        return w;
    }
    std::string rest() {  // of the line, without blanks at its ends: a name may contain blanks and '#'
        at_end();
        const char *const begin = at_, *end = at_ = find('\n', at_, end_);
        while (end > begin && is_blank(end[-1])) end--;
        std::string text(begin, end);
        std::replace(text.begin(), text.end(), '\0', ' ');
        return text;
    }

    // A finite number. What is too small is zero or denormal.
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
        double value = 0;
        const auto [end, error] = std::from_chars(after_plus(), end_, value);
        if (error == std::errc::result_out_of_range)  // too large or too small: strtod says which
            value = std::strtod(std::string(after_plus(), end).c_str(), nullptr);
        if (error == std::errc::invalid_argument || !std::isfinite(value) || !ends_word(*end))
            fail_word("finite number");
        at_ = end;
        return value;
    }
    template <int size>
    int reals(vec<size>& kept) {  // all up to the end of the statement: how many there are; as many as fit are kept
        int n = 0;
        for (; !at_end(); n++) {
            const double value = real();
            if (n < size) kept[n] = value;
        }
        return n;
    }
    int integer(const char* what) {  // its magnitude is below 2^31
        int small = 0;  // nearly all are short: reading them so takes .94 of the loading time
        const char* p = at_;
        for (; is_digit(*p) && p < at_ + 9; p++) small = small * 10 + (*p - '0');
        if (p > at_ && !is_digit(*p)) return at_ = p, small;
        std::int64_t value = 0;
        const auto [end, error] = std::from_chars(after_plus(), end_, value);
        if (error != std::errc() || std::abs(value) > INT32_MAX) fail_word(what);
        at_ = end;
        return static_cast<int>(value);
    }

    std::string place(const char* position) {  // FILE:LINE; counts on from the last one: positions must not go back
        line_ += std::count_if(counted_, position, [](char c) { return c == '\n' || c == '\0'; });
        counted_ = position;
        return name_ + ":" + std::to_string(line_) + ": ";
    }
    [[noreturn]] void fail_word(const char* what) { fail(in_quotes(peek_word()) + " is no " + what); }
    [[noreturn]] void fail(const std::string& what) { throw std::runtime_error(place(at_) + what); }

private:
    const char* after_plus() const { return at_ + (*at_ == '+' && at_[1] != '-'); }

    std::string name_;
    const char *at_, *end_, *counted_;
    std::int64_t line_ = 1;  // of counted_
};

// ---- the .obj ----

// What the file says. Its indices are right, those of normals but for the corners that have none. Faces are triangles
// already; those of a polygon are a fan, to be cut better.
class Obj : Scanner {
public:
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

    int nfaces() const { return static_cast<int>(corners.size() / 3); }
    Corner* corners_of(int face) { return corners.data() + 3 * std::ptrdiff_t{face}; }

    Obj(const fs::path& path, const FileBytes& text) : Scanner(path, text.begin, text.end) {
        // About what a mesh of many faces comes to: to grow costs a copy and fresh memory, a fifth of the loading time.
        const std::ptrdiff_t bytes = text.end - text.begin;
        verts.reserve(bytes / 96), uvs.reserve(bytes / 96), normals.reserve(bytes / 96), corners.reserve(bytes / 32);
        const char* kept = text.begin;
        for (; !is_done(); next_line()) {
            if (position() - kept > 1 << 24) text.forget_before(kept = position());  // else all of it is held at once
            const std::string_view first = word();
            if (first == "v") verts.push_back(vector<3>(3, "a vertex needs three coordinates"));
            else if (first == "vt") uvs.push_back(vector<2>(1, "a texture coordinate needs a number"));
            else if (first == "vn") normals.push_back(normalized(vector<3>(3, "a normal needs three coordinates")));
            else if (first == "f") face();
            else if (first == "usemtl") runs.push_back({nfaces(), rest()});
            else if (first == "mtllib") libraries.push_back(rest());
            // o, g, s, lines, curves and what nobody knows are passed over
        }
        if (std::find(normals.begin(), normals.end(), vec3{}) != normals.end()) lacks_normals = true;
        const int counts[] = {count(verts), count(uvs), count(normals)};
        for (const Forward& f : forward_)
            if (f.index > counts[f.kind])
                throw std::runtime_error(place(f.position) + kinds[f.kind] + " " + std::to_string(f.index) +
                                         ", but the file has only " + std::to_string(counts[f.kind]));
        if (corners.empty()) throw std::runtime_error(path.string() + ": no faces");
    }

private:
    enum Kind { vertex, texture, normal };
    static constexpr const char* kinds[] = {"vertex index", "texture index", "normal index"};
    struct Forward {  // an index of something that had not been defined yet: checked at the end
        const char* position;
        Kind kind;
        int index;
    };

    template <int size>
    vec<size> vector(int least, const char* needs) {  // what follows is a weight or colours
        vec<size> v;
        if (reals(v) < least) fail(needs);
        return v;
    }
    // An index as written, from 1 or from the end of what has been defined so far, made one from 0.
    int index(Kind kind, int defined) {
        const int i = integer(kinds[kind]);
        if (i > defined) forward_.push_back({position(), kind, i});
        if (i > 0) return i - 1;
        if (i < 0 && -i <= defined) return defined + i;
        fail(std::string(kinds[kind]) + " " + std::to_string(i) +
             (i == 0 ? " (indices count from 1)" : ", but only " + std::to_string(defined) + " are defined so far"));
    }
    Corner corner() {  // v, v/vt, v//vn or v/vt/vn; v/ and v// are seen too
        Corner c{index(vertex, count(verts)), -1, -1};
        const bool has_more = skip('/');
        if (has_more && peek() != '/' && !at_word_end()) c.uv = index(texture, count(uvs));
        if (has_more && skip('/') && !at_word_end()) c.normal = index(normal, count(normals));
        if (!at_word_end()) fail("garbage after a number: " + in_quotes(peek_word()));
        if (c.normal < 0) lacks_normals = true;
        return c;
    }
    void face() {
        Corner first{}, previous{};
        const int begin = nfaces();
        int n = 0;
        for (; !at_end(); n++) {
            const Corner c = corner();
            if (n == 0) first = c;
            if (n >= 2) corners.insert(corners.end(), {first, previous, c});
            previous = c;
        }
        if (n < 3) fail("a face needs three corners, this one has " + std::to_string(n));
        if (n > 3) polygons.push_back({begin, n});
    }

    std::vector<Forward> forward_;
};

// ---- polygons ----

double largest(const vec3& v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); }

// The power of two that brings X > 0 into [1,2), so that products of what is no larger neither overflow nor vanish; it
// rounds nothing. (A denormal X comes out smaller: 2^1023 is the largest power of two.)
double unit_for(double x) { return std::scalbn(1., std::min(-std::ilogb(x), 1023)); }

// Twice the signed area of the triangle abc, positive where it is counterclockwise.
double area2(const vec2& a, const vec2& b, const vec2& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Cuts polygons into triangles, always two fewer than corners, in the plane of the polygon's Newell normal: a fan where
// that is right, and else ear clipping (G. H. Meisters, "Polygons have ears", 1975). An ear is a corner with a convex
// angle whose triangle no reflex corner lies in; cutting it off changes only whether its two neighbours are ears. So n
// corners are asked 3n times at most, and n are looked at each time: 3 max_corners looks a corner, whatever the file
// holds. Measured with combs, spirals and stairs of 1000 corners, that is a microsecond a corner.
class PolygonCutter {
public:
    // FAN holds the polygon (c0, c1, c2, ...) as the triangles (c0,c1,c2), (c0,c2,c3), ... and receives the triangles.
    // They wind as the polygon does. Where it crosses itself or has too many corners, a part is still a fan, and the
    // result false. A polygon without area stays a fan, too.
    bool cut(const std::vector<vec3>& verts, Corner* fan, int n) {
        ring_.assign({{fan[0]}, {fan[1]}});
        for (std::ptrdiff_t i = 0; i < n - 2; i++) ring_.push_back({fan[3 * i + 2]});
        if (!project(verts, 1) || is_good_fan()) return true;
        return n <= max_corners && clip_ears(fan);
    }

private:
    static constexpr int max_corners = 1000;
    struct Node {
        Corner corner;
        vec3 relative{};  // to the first corner
        vec2 point{};
        bool is_no_ear = false;
    };

    // The corners' points are those seen along the axis that is nearest to the normal, so that the polygon runs
    // counterclockwise. Unlike a turn into the plane, leaving out a coordinate rounds nothing: three corners on a line
    // stay on it. False where there is no area.
    bool project(const std::vector<vec3>& verts, double scale) {
        const vec3 origin = verts[ring_[0].corner.vert] * scale;
        double span = 0;
        for (Node& node : ring_) {
            node.relative = verts[node.corner.vert] * scale - origin;
            span = std::max(span, largest(node.relative));
        }
        if (!(span > 0)) return false;
        if (!std::isfinite(span)) return project(verts, .25);  // a difference has overflowed
        const double unit = unit_for(span);
        for (Node& node : ring_) node.relative = node.relative * unit;
        vec3 newell;  // twice the polygon's area along its normal
        for (int i = 1; i + 1 < count(ring_); i++) newell = newell + cross(ring_[i].relative, ring_[i + 1].relative);
        const double area = largest(newell);
        const int axis = std::fabs(newell.z) == area ? 2 : std::fabs(newell.y) == area ? 1 : 0;
        int right = (axis + 1) % 3, up = (axis + 2) % 3;
        if (newell[axis] < 0) std::swap(right, up);
        for (Node& node : ring_) node.point = {node.relative[right], node.relative[up]};
        return area > 0;
    }

    // The fan's signed areas add up to the polygon, wherever the corners are. So it is right where all are positive.
    bool is_good_fan() const {
        for (int i = 1; i + 1 < count(ring_); i++)
            if (!(area2(ring_[0].point, ring_[i].point, ring_[i + 1].point) > 0)) return false;
        return true;
    }

    bool clip_ears(Corner* out) {
        const auto emit = [&](int a, int b, int c) {
            for (const int i : {a, b, c}) *out++ = at(i).corner;
        };
        int v = 0;
        for (int passed = 0; ring_.size() > 3 && passed < count(ring_); v = (v + 1) % count(ring_), passed++) {
            if (at(v).is_no_ear || (at(v).is_no_ear = !is_ear(v))) continue;
            emit(v - 1, v, v + 1);
            at(v - 1).is_no_ear = at(v + 1).is_no_ear = false;
            ring_.erase(ring_.begin() + v--);
            passed = -1;
        }
        for (int i = 1; i + 1 < count(ring_); i++) emit(v, v + i, v + i + 1);
        return ring_.size() == 3;  // else no corner is an ear: it crosses itself
    }

    Node& at(int i) { return ring_[(i + count(ring_)) % count(ring_)]; }
    double turn(int v) { return area2(at(v - 1).point, at(v).point, at(v + 1).point); }  // positive where it is convex

    // A corner without area that is not between its neighbours: the tip of a spike, or a point twice. It can be cut off
    // at any time, and must be before an ear is cut beside it, because that would be outside the polygon.
    bool is_spike(int v) {
        return turn(v) == 0 && dot(at(v - 1).point - at(v).point, at(v + 1).point - at(v).point) >= 0;
    }
    bool is_ear(int v) {
        if (!(turn(v) > 0)) return is_spike(v);
        if (is_spike(v - 1) || is_spike(v + 1)) return false;
        const vec2 a = at(v - 1).point, b = at(v).point, c = at(v + 1).point;
        for (int i = 0; i < count(ring_); i++) {
            const vec2 p = ring_[i].point;
            if (area2(a, b, p) < 0 || area2(b, c, p) < 0 || area2(c, a, p) < 0) continue;
            if (p == a || p == b || p == c) continue;  // a corner of the triangle, or one at the same place
            if (turn(i) <= 0) return false;
        }
        return true;
    }

    std::vector<Node> ring_;  // what is left of the polygon
};

// ---- normals where the file gives none ----

struct Face {  // a triangle's unit normal and its angles; zeros where it has no area
    vec3 normal;
    double angles[3] = {0, 0, 0};
};

Face measure(const vec3& a, const vec3& b, const vec3& c) {
    vec3 edges[] = {b - a, c - b, a - c};
    const double length = std::max({largest(edges[0]), largest(edges[1]), largest(edges[2])});
    if (!std::isfinite(length)) return measure(a * .25, b * .25, c * .25);  // a difference has overflowed
    if (!(length > 0)) return {};
    const double unit = unit_for(length);
    for (vec3& e : edges) e = e * unit;

    // The two edges across from the longest one have the best-conditioned cross product.
    const double squares[] = {dot(edges[0], edges[0]), dot(edges[1], edges[1]), dot(edges[2], edges[2])};
    const std::ptrdiff_t i = std::max_element(squares, squares + 3) - squares;
    const vec3 across = cross(edges[(i + 1) % 3], edges[(i + 2) % 3]);
    const double area = norm(across);  // twice: the product of any two edges' lengths and the sine between them

    // An edge's coordinate is a difference rounded once, a product of two is off by 3 half-units in the last place, and
    // their difference by another: a component pq - rs by 2 epsilon (|pq| + |rs|), no more than 2 epsilon times the two
    // lengths, and the whole by less than twice that. So little area may be none.
    if (area <= 4 * epsilon * std::sqrt(squares[(i + 1) % 3] * squares[(i + 2) % 3])) return {};
    Face face{normalized(across)};
    for (int k = 0; k < 3; k++) face.angles[k] = std::atan2(area, -dot(edges[k], edges[(k + 2) % 3]));
    return face;
}

// Gives a normal to each corner without one, or with one of no length: the mean of the normals of the faces around its
// vertex, each weighted by its angle there (G. Thuermer and C. Wuethrich, "Computing vertex normals from polygonal
// facets", 1998), which does not depend on how the polygons have been cut.
void make_normals(Obj& obj) {
    struct Sum {
        vec3 normals;
        double angles = 0;
        int faces = 0;
    };
    std::vector<Sum> sums(obj.verts.size());
    const auto face_of = [&](const Corner* c) {
        return measure(obj.verts[c[0].vert], obj.verts[c[1].vert], obj.verts[c[2].vert]);
    };
    for (int f = 0; f < obj.nfaces(); f++) {
        const Corner* const c = obj.corners_of(f);
        const Face face = face_of(c);
        for (int k = 0; k < 3; k++) {
            Sum& sum = sums[c[k].vert];
            sum = {sum.normals + face.normal * face.angles[k], sum.angles + face.angles[k], sum.faces + 1};
        }
    }
    // A sum of n terms is off by at most n half-units of the sum of their sizes, its terms themselves by less than 4
    // units each. No more than that is left where the faces cancel, as on the two sides of a sheet: then a face has its
    // own normal, or an upright one where it has no area.
    const int first_mean = count(obj.normals);
    for (const Sum& sum : sums) {
        const double noise = (sum.faces + 4) * sum.angles * epsilon;
        obj.normals.push_back(norm(sum.normals) > noise ? normalized(sum.normals) : vec3{});
    }
    for (int f = 0; f < obj.nfaces(); f++) {
        int own = -1;
        for (int k = 0; k < 3; k++) {
            int& normal = obj.corners_of(f)[k].normal;
            if (normal < 0 || obj.normals[normal] == vec3{}) normal = first_mean + obj.corners_of(f)[k].vert;
            if (!(obj.normals[normal] == vec3{})) continue;
            if (own < 0) {
                own = count(obj.normals);
                const vec3 n = face_of(obj.corners_of(f)).normal;
                obj.normals.push_back(n == vec3{} ? vec3{0, 0, 1} : n);
            }
            normal = own;
        }
    }
}

// ---- materials ----

enum { diffuse_map, normal_map, tangent_map, specular_map, glow_map, map_count, bump_map = map_count };
constexpr Map Material::*map_members[] = {&Material::diffuse, &Material::normal, &Material::tangent,
                                               &Material::specular, &Material::glow};
constexpr const char* map_suffixes[] = {"_diffuse.tga", "_nm.tga", "_nm_tangent.tga", "_spec.tga", "_glow.tga"};

using Notes = std::vector<std::string>;

struct MtlMaterial {
    vec3 Kd{1, 1, 1};
    std::string maps[map_count + 1];  // paths, empty where there is none; bump_map is for where there is no tangent_map
    Notes notes;                      // for when it is used
};
using Library = std::map<std::string, MtlMaterial>;

// Takes the first word, and the blanks after it, off TEXT.
std::string_view take_word(std::string_view& text) {
    const std::string_view word = text.substr(0, text.find_first_of(" \t"));
    text.remove_prefix(std::min(text.find_first_not_of(" \t", word.size()), text.size()));
    return word;
}

// What is left of "-bm 1 -s 2 2 2 -clamp on the file.tga" without options: each has a word and the numbers after it.
std::string without_options(std::string_view text) {
    while (text.starts_with('-')) {
        take_word(text);
        take_word(text);
        for (auto rest = text; !rest.empty() && take_word(rest).find_first_not_of("+-.0123456789eE") == rest.npos;)
            text = rest;
    }
    return std::string(text);
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

// Adds the file's materials to the others; one of the same name is replaced.
void read_mtl(const fs::path& path, Library& library) {
    static const std::map<std::string_view, int> maps = {
        {"map_Kd", diffuse_map}, {"map_Ks", specular_map}, {"map_Ke", glow_map}, {"norm", tangent_map},
        {"map_Bump", bump_map},  {"map_bump", bump_map},   {"bump", bump_map}};
    const FileBytes text = read_text(path);
    Scanner in(path, text.begin, text.end), in_folder(path.filename(), text.begin, text.end);
    MtlMaterial before_the_first, *material = &before_the_first;
    const auto note = [&](const std::string& what) {
        material->notes.push_back(in_folder.place(in.position()) + what);
    };
    for (; !in.is_done(); in.next_line()) {
        const std::string_view word = in.word();
        if (word == "newmtl") {
            material = &library[in.rest()];
            *material = {};
        } else if (word == "Kd" && (in.peek_word() == "spectral" || in.peek_word() == "xyz")) {
            note("Kd " + std::string(in.word()) + " is not known, white is used");
        } else if (word == "Kd") {
            vec3& Kd = material->Kd;
            const int n = in.reals(Kd);
            if (n != 1 && n != 3) in.fail("Kd needs three numbers, or one");
            if (n == 1) Kd = {Kd.x, Kd.x, Kd.x};
            for (int i = 0; i < 3; i++) Kd[i] = std::clamp(Kd[i], 0., 1.);
        } else if (const auto map = maps.find(word); map != maps.end()) {
            const std::string name = without_options(in.rest());
            const fs::path file = beside(path, name);
            std::string extension = file.extension().string();
            for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
            if (extension != ".tga") note(in_quotes(name) + " is not a TGA file, left out");
            else if (!is_there(file)) note(in_quotes(name) + " does not exist, left out");
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
        if (name.empty() || !is_there(path)) return false;
        if (fs::is_other(path)) throw std::runtime_error(path.string() + ": is not a file");  // a pipe may never end
        if (seen.insert(path).second) read_mtl(path, library);
        return true;
    };
    for (const std::string& line : lines) {
        std::string missing;
        for (std::string_view rest = read(line) ? std::string_view() : line; !rest.empty();)
            if (const std::string_view name = take_word(rest); !read(name))
                missing.append(missing.empty() ? "" : " ").append(name);
        if (!missing.empty()) notes.push_back("there is no material file " + in_quotes(missing));
    }
    return library;
}

// Sorts the faces, stably, by material, and fills MATERIALS with those that faces use, in the order of their first
// face. What the library does not define is all one default material, without a name.
std::vector<Model::Group> group_by_material(Obj& obj, const Library& library, std::vector<Material>& materials,
                                            Notes& notes) {
    std::map<std::string, int> indices;
    std::vector<Model::Group> pieces, groups;
    obj.runs.push_back({obj.nfaces(), ""});
    for (int i = 0; i + 1 < count(obj.runs); i++) {
        auto& [begin, name] = obj.runs[i];
        if (begin == obj.runs[i + 1].face) continue;
        if (!library.contains(name)) notes.push_back("there is no material " + in_quotes(std::exchange(name, "")));
        const auto [entry, is_new] = indices.emplace(name, count(materials));
        if (is_new) materials.push_back({name, library.at(name).Kd, {}, {}, {}, {}, {}});
        pieces.push_back({begin, obj.runs[i + 1].face, entry->second});
    }
    std::stable_sort(pieces.begin(), pieces.end(), [](auto& a, auto& b) { return a.material < b.material; });
    std::vector<Corner> sorted;
    int face = 0;
    for (const auto& [begin, end, material] : pieces) {
        if (groups.empty() || groups.back().material != material) groups.push_back({face, face, material});
        groups.back().end = face += end - begin;
        if (materials.size() > 1) sorted.insert(sorted.end(), obj.corners_of(begin), obj.corners_of(end));
    }
    if (materials.size() > 1) obj.corners = std::move(sorted);
    return groups;
}

// ---- textures ----

// Adds what a group of faces needs: from the .mtl, and where that names none, the pictures beside the model.
void plan_textures(const fs::path& path, const Model::Group& group, Obj& obj, const MtlMaterial& mtl,
                   const std::string& name, NormalMap wanted, Model::Textures& textures, Notes& notes) {
    std::string maps[map_count];
    for (int i = 0; i < map_count; i++) {
        const fs::path picture = fs::path(path).replace_extension() += map_suffixes[i];
        const bool is_bump = i == tangent_map && mtl.maps[i].empty();
        maps[i] = mtl.maps[is_bump ? bump_map : i];
        if (maps[i].empty() && is_there(picture)) maps[i] = picture.lexically_normal().string();
    }
    if (!maps[normal_map].empty() && !maps[tangent_map].empty())
        maps[wanted == NormalMap::object ? tangent_map : normal_map].clear();
    const bool has_uvs = std::any_of(obj.corners_of(group.begin), obj.corners_of(group.end),
                                     [](const Corner& c) { return c.uv >= 0; });
    notes.insert(notes.end(), mtl.notes.begin(), mtl.notes.end());
    for (int i = 0; i < map_count; i++)
        if (!maps[i].empty() && has_uvs) textures[maps[i]].push_back({group.material, map_members[i]});
    if (!has_uvs && std::any_of(maps, maps + map_count, [](const std::string& map) { return !map.empty(); }))
        notes.push_back((name.empty() ? "" : "material " + in_quotes(name) + ": ") +
                        "no texture coordinates, so no textures");
}

}  // namespace

// ---- the model ----

Model::Model(const fs::path& path, NormalMap wanted) {
    Obj obj(path, read_text(path));
    PolygonCutter cutter;
    int crossed = 0;
    for (const Obj::Polygon& p : obj.polygons) crossed += !cutter.cut(obj.verts, obj.corners_of(p.face), p.corners);
    if (crossed > 0)
        notes_.push_back("polygons that cross themselves or have too many corners: " + std::to_string(crossed));
    if (obj.lacks_normals) make_normals(obj);

    const Library library = read_libraries(path, obj.libraries, notes_);
    groups_ = group_by_material(obj, library, materials_, notes_);
    for (const Group& g : groups_) {
        const std::string& name = materials_[g.material].name;
        plan_textures(path, g, obj, library.at(name), name, wanted, textures_, notes_);
    }
    // A vertex that no face uses may be anywhere. It is put where another is, so that all can be measured and moved.
    std::vector<bool> is_used(obj.verts.size());
    for (const Corner& c : obj.corners) is_used[c.vert] = true;
    for (int i = 0; i < count(obj.verts); i++)
        if (!is_used[i]) obj.verts[i] = obj.verts[obj.corners[0].vert];
    verts_ = std::move(obj.verts);
    normals_ = std::move(obj.normals);
    uvs_ = std::move(obj.uvs);
    corners_ = std::move(obj.corners);
    find_box();
}

// As many at a time as there are cores. What is thrown is the error of the first bad one in the order of their paths.
void Model::load_textures() {
    std::deque<std::future<TGAImage>> started;
    auto next = textures_.begin();
    for (const auto& [path, uses] : textures_) {
        for (; next != textures_.end() && started.size() < std::max(1u, std::thread::hardware_concurrency()); next++)
            started.push_back(std::async(TGAImage::read_tga_file, next->first));
        const auto picture = std::make_shared<const TGAImage>(started.front().get());
        started.pop_front();
        for (const auto& [material, map] : uses)
            if (picture->bytespp() == 1 && (map == &Material::normal || map == &Material::tangent))
                notes_.push_back(fs::path(path).filename().string() + " is grey, so no normal map: left out");
            else materials_[material].*map = picture;
    }
}

std::vector<std::string> Model::notes() const {
    std::vector<std::string> notes;
    for (const std::string& note : notes_)
        if (std::find(notes.begin(), notes.end(), note) == notes.end()) notes.push_back(note);
    if (notes.size() > 20) {
        notes[20] = "and " + std::to_string(notes.size() - 20) + " more like these";
        notes.resize(21);
    }
    return notes;
}

void Model::find_box() {
    if (!verts_.empty()) low_ = high_ = verts_[0];
    for (const vec3& v : verts_)
        for (int i = 0; i < 3; i++) low_[i] = std::min(low_[i], v[i]), high_[i] = std::max(high_[i], v[i]);
}

std::string missing_maps(const std::vector<Model>& models) {
    constexpr std::pair<const char*, int> kinds[] = {
        {"diffuse", diffuse_map}, {"normal_map", normal_map}, {"specular", specular_map}, {"glow", glow_map}};
    std::string names;
    for (const auto& [name, map] : kinds) {
        bool used = false;
        for (const Model& model : models)
            for (const Material& m : model.materials())
                used = used || m.*map_members[map] || (map == normal_map && m.tangent);
        if (!used) names += (names.empty() ? "" : ",") + std::string(name);
    }
    return names;
}
