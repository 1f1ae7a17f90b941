// model.cpp: reads an .obj, its .mtl and the pictures they name; cuts polygons into triangles and makes missing
// normals. It draws nothing. The formats are Wavefront's "Object Files (.obj)" and "Material Library File (.mtl)", as
// found in the wild: what is clear is read, and what is not is an error with its line.
#include "model.h"

#include <charconv>
#include <cstdio>
#include <deque>
#include <future>
#include <optional>
#include <set>
#include <stdexcept>
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
std::string in_quotes(std::string_view text, std::size_t most = 60) {
    std::string out(text.substr(0, most));
    std::replace_if(out.begin(), out.end(), [](unsigned char c) { return c < ' ' || c == 127; }, '?');
    return "'" + out + (text.size() > most ? "...'" : "'");
}

void add(Model::Notes& notes, const std::string& what, const std::string& which, int count = 1) {
    Model::Note& note = notes[what];
    if (note.count == 0) note.first = which;
    note.count += count;
}

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\0'; }  // '\0': see join_lines
bool ends_word(char c) { return is_blank(c) || c == '\n' || c == '#'; }
char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c; }
std::string lower(std::string text) {
    for (char& c : text) c = lower(c);
    return text;
}
std::string unquoted(std::string text) {
    return text.size() > 2 && text.front() == '"' && text.back() == '"' ? text.substr(1, text.size() - 2) : text;
}
char* find(char c, char* begin, char* end) { return static_cast<char*>(std::memchr(begin, c, end - begin)); }

// A line that ends in '\' goes on in the next one; not where it holds a '#', since a stray '\' in a comment must not
// swallow a vertex. Both bytes become blanks, the newline '\0', which no text has: so lines can still be counted.
void join_lines(char* begin, char* end, const char* text_end) {
    for (char* p = begin; (p = find('\\', p, end)); p++) {
        char *newline = p + 1, *before = p;
        while (is_blank(*newline)) newline++;
        if (*newline != '\n') continue;
        while (before > begin && !std::strchr("#\n", before[-1])) before--;  // it finds '\0', too
        if (before > begin && before[-1] == '#') continue;
        *p = ' ';
        if (newline + 1 < text_end) *newline = '\0';
    }
}

// What else is found under the name of an .obj, by its first bytes.
constexpr std::pair<std::string_view, const char*> other_files[] = {
    {"solid", "STL"}, {"ply", "PLY"}, {"glTF", "glTF"}, {"{", "glTF or JSON"}, {"<", "HTML or XML"},
    {"\x1F\x8B", "gzip"}, {"PK\3\4", "ZIP"}, {"Kaydara FBX", "FBX"}, {"BLENDER", "Blender"},
    {"\xFF\xFE", "UTF-16"}, {"\xFE\xFF", "UTF-16"}, {"version https://git-lfs", "Git LFS pointer ('git lfs pull')"}};

[[noreturn]] void refuse(const fs::path& path, const std::string& kind) {
    throw std::runtime_error(path.string() + ": is a " + kind + " file, not a text of vertices and faces");
}

// A whole text file, each line ended by '\n', the last one too.
FileBytes read_text(const fs::path& path) {
    FileBytes text = read_file(path, 1);
    const std::string_view all(text.begin, text.end);
    for (const auto& [bytes, kind] : other_files)
        if (all.starts_with(bytes)) refuse(path, kind);
    std::uint32_t faces = 0;  // of STL that is not text: 80 bytes, the number of faces, 50 bytes for each
    if (all.size() >= 84) std::memcpy(&faces, &all[80], 4);
    if (all.size() == 84 + 50 * std::uint64_t{faces}) refuse(path, "STL");
    while (text.end > text.begin && text.end[-1] == '\0') text.end--;  // some programs fill up their last block
    if (text.end == text.begin || text.end[-1] != '\n') *text.end++ = '\n';
    if (all.starts_with("\xEF\xBB\xBF")) text.begin += 3;  // UTF-8's byte order mark
    // Lines that end in '\r' alone, if the first ones do.
    if (char* p = find('\r', text.begin, std::min(text.end, text.begin + 4096)); p && p[1] != '\n')
        for (text.is_mapped = false; p; p = find('\r', p + 1, text.end)) *p = p[1] == '\n' ? ' ' : '\n';  // all kept
    return text;
}

// Reads what read_text gives, some lines at a time. NAME is for messages.
class Scanner {
public:
    Scanner(const fs::path& name, const FileBytes& text) : text_(text), name_(name) { prepare(); }

    bool is_done() const { return at_ == text_.end; }
    void next_line() {
        at_ = (*at_ == '\n' ? at_ : find('\n', at_, text_.end)) + 1;
        if (at_ == ready_ && !is_done()) prepare();
    }
    bool at_end() {  // of a statement, be it the end of the line or a comment
        while (is_blank(*at_)) at_++;
        return *at_ == '\n' || *at_ == '#';
    }
    std::string_view peek_word() {  // empty at the end of the statement
        at_end();
        const char* end = at_;
        while (!ends_word(*end)) end++;
        return {at_, end};
    }
    bool skip_word(std::string_view keyword) {  // in small letters or others
        at_end();
        for (std::size_t i = 0; i < keyword.size(); i++)
            if (lower(at_[i]) != keyword[i]) return false;
        if (!ends_word(at_[keyword.size()])) return false;
        at_ += keyword.size();
        return true;
    }
    std::string rest() {  // of the line, without blanks at its ends: a name may contain blanks and '#'
        at_end();
        char *const begin = at_, *end = at_ = find('\n', at_, text_.end);
        while (end > begin && is_blank(end[-1])) end--;
        std::string text(begin, end);
        std::replace(text.begin(), text.end(), '\0', ' ');
        return unquoted(text);
    }

    // A finite number, or false. What is too small is zero or denormal.
    bool real(double& value) {
        const auto [end, error] = std::from_chars(after_plus(), text_.end, value);
        if (error == std::errc::result_out_of_range)  // too large or too small: strtod says which
            value = std::strtod(std::string(after_plus(), end).c_str(), nullptr);
        if (error == std::errc::invalid_argument || !std::isfinite(value) || !ends_word(*end)) return false;
        at_ += end - at_;
        return true;
    }
    template <int size>
    int reals(vec<size>& kept) {  // those up to what is none: how many there are; as many as fit are kept
        int n = 0;
        for (double value = 0; !at_end() && real(value); n++)
            if (n < size) kept[n] = value;
        return n;
    }
    int integer(const char* what) {  // its magnitude is below 2^31
        int value = 0;
        const auto [end, error] = std::from_chars(after_plus(), text_.end, value);
        if (error != std::errc()) fail_word(what);
        at_ += end - at_;
        return value;
    }

    void note(Model::Notes& notes, const char* what) const {  // the place is looked for only once
        add(notes, what, notes.contains(what) ? "" : name_.filename().string() + ':' + line());
    }
    [[noreturn]] void fail_word(const char* what) { fail(in_quotes(peek_word()) + " is no " + what); }
    [[noreturn]] void fail(const std::string& what) {
        throw std::runtime_error(name_.string() + ':' + line() + ": " + what);
    }

protected:
    FileBytes text_;
    char* at_ = text_.begin;

private:
    // Joins the lines of about a megabyte more. What lies before them is not held any longer.
    void prepare() {
        text_.forget_before(at_);
        do {
            char* const begin = ready_;
            ready_ = find('\n', begin + std::min<std::ptrdiff_t>(1 << 20, text_.end - begin - 1), text_.end) + 1;
            if (find('\0', begin, ready_)) refuse(name_, "binary");
            join_lines(begin, ready_, text_.end);
        } while (ready_[-1] != '\n');  // the last one goes on
    }
    const char* after_plus() const { return at_ + (*at_ == '+' && at_[1] != '-'); }
    std::string line() const {
        return std::to_string(1 + std::count_if(text_.begin, at_, [](char c) { return c == '\n' || c == '\0'; }));
    }

    char* ready_ = text_.begin;  // lines up to here are joined
    fs::path name_;
};

// ---- the .obj ----

// What the file says. Its indices are right; corners without a normal have -1. Faces are triangles already; those of a
// polygon are a fan, to be cut better.
class Obj : Scanner {
public:
    std::vector<vec3> verts, normals;
    std::vector<vec3> colors;  // of all vertices or of none
    std::vector<vec2> uvs;
    std::vector<Corner> corners;
    std::vector<std::pair<int, int>> polygons;  // the first triangle, and how many corners: two more than triangles
    std::vector<std::pair<int, std::string>> runs{{0, ""}};  // from this face on this material
    std::vector<int> groups;  // the smoothing group of each face, 0 for facets; or of none
    std::vector<std::string> libraries;
    Model::Notes notes;
    bool lacks_normals = false;  // some corner has none, or some normal has no length

    int nfaces() const { return static_cast<int>(corners.size() / 3); }
    Corner* corners_of(int face) { return corners.data() + 3 * std::ptrdiff_t{face}; }

    Obj(const fs::path& path, const FileBytes& text) : Scanner(path, text) {
        // About what a mesh of many faces comes to: to grow costs a copy and fresh memory, a fifth of the loading time.
        const std::ptrdiff_t bytes = text.end - text.begin;
        verts.reserve(bytes / 96), uvs.reserve(bytes / 96), normals.reserve(bytes / 96), corners.reserve(bytes / 32);
        for (; !is_done(); next_line()) {
            if (skip_word("v")) vertex();
            else if (skip_word("vt")) uvs.push_back(vector<2>(1));
            else if (skip_word("vn")) normals.push_back(normalized(vector<3>(3)));
            else if (skip_word("f")) face();
            else if (skip_word("usemtl")) runs.push_back({nfaces(), rest()});
            else if (skip_word("mtllib")) libraries.push_back(rest());
            else if (skip_word("s")) smooth();
            // o, g, lines, curves and what nobody knows are passed over
        }
        if (std::find(normals.begin(), normals.end(), vec3{}) != normals.end()) lacks_normals = true;
        double brightest = 0;  // some write colours from 0 to 255
        for (const vec3& c : colors) brightest = std::max({brightest, c.x, c.y, c.z});
        for (vec3& c : colors)
            for (int i = 0; i < 3; i++) c[i] = std::clamp(brightest > 1 ? c[i] / 255 : c[i], 0., 1.);
        if (group_) groups.resize(nfaces(), *group_);
        for (const auto& [position, vert] : forward_)
            if (vert >= count(verts)) fail_vertex(position);
        for (Corner& c : corners) {
            const bool is_uv = c.uv < count(uvs) && c.uv >= -1, is_normal = c.normal < count(normals) && c.normal >= -1;
            if (is_uv && is_normal) continue;
            add(notes, "an index of a normal or texture coordinate that is not there, left out",
                "face " + std::to_string((&c - corners.data()) / 3 + 1));
            if (!is_uv) c.uv = -1;
            if (!is_normal) c.normal = -1, lacks_normals = true;
        }
        if (corners.empty()) throw std::runtime_error(path.string() + ": no faces");
    }

private:
    void vertex() {
        vec<6> v;  // the place, then a weight, or red, green and blue
        const int n = reals(v);
        if (n < 3) at_end() ? fail("a vertex needs three coordinates") : fail_word("finite number");
        if (!at_end()) note(notes, "a colour that is no number, left out");
        verts.push_back({v[0], v[1], v[2]});
        if (n < 6 && colors.empty()) return;
        colors.resize(verts.size(), {1, 1, 1});
        if (n >= 6) colors.back() = {v[3], v[4], v[5]};
    }
    template <int size>
    vec<size> vector(int least) {  // what follows is a weight
        vec<size> v;
        if (reals(v) >= least && at_end()) return v;
        note(notes, "a normal or texture coordinate that is no number, left out");
        return {};
    }
    void smooth() {  // what is no number is "off"
        groups.resize(nfaces(), group_.value_or(0));
        group_ = static_cast<int>(std::strtol(rest().c_str(), nullptr, 10));
    }
    // An index as written, from 1 or from the end of what has been defined so far, made one from 0; INT_MIN: nowhere.
    int index(const char* what, int defined) {
        const int i = integer(what);
        return i > 0 ? i - 1 : i < 0 && i >= -defined ? defined + i : INT_MIN;
    }
    [[noreturn]] void fail_vertex(char* position) {
        at_ = position;
        fail(in_quotes(peek_word()) + " is none of the " + std::to_string(count(verts)) + " vertices, counted from 1");
    }
    Corner corner() {  // v, v/vt, v//vn or v/vt/vn; v/ and v// are seen too
        char* const begin = at_;
        Corner c{index("vertex index", count(verts)), -1, -1};
        if (c.vert < 0) fail_vertex(begin);
        if (c.vert >= count(verts)) forward_.push_back({begin, c.vert});
        if (*at_ == '/' && *++at_ != '/' && !ends_word(*at_)) c.uv = index("texture index", count(uvs));
        if (*at_ == '/' && !ends_word(*++at_)) c.normal = index("normal index", count(normals));
        if (!ends_word(*at_)) fail("garbage after a number: " + in_quotes(peek_word()));
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
        if (n < 3) note(notes, "a face of fewer than three corners, left out");
        if (n > 3) polygons.push_back({begin, n});
    }

    std::optional<int> group_;  // since there has been one
    std::vector<std::pair<char*, int>> forward_;  // vertices not yet defined where they are used
};

// ---- polygons ----

double largest(const vec3& v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); }

// Twice the signed area of the triangle abc, positive where it is counterclockwise.
double area2(const vec2& a, const vec2& b, const vec2& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Cuts polygons into triangles, always two fewer than corners, in the plane of the polygon's Newell normal: a fan where
// that is right, and else ear clipping (G. H. Meisters, "Polygons have ears", 1975). An ear is a corner with a convex
// angle whose triangle no reflex corner lies in; cutting it off changes only whether its two neighbours are ears. So n
// corners are asked 3n times at most, and n are looked at each time: 3 max_corners looks a corner, a microsecond.
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
        // A power of two, which rounds nothing: products neither overflow nor vanish. (2^1023 is the largest one.)
        const double unit = std::scalbn(1., std::min(-std::ilogb(span), 1023));
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
    if (!std::isfinite(largest(edges[0]) + largest(edges[1]) + largest(edges[2])))
        return measure(a * .25, b * .25, c * .25);  // a difference has overflowed
    for (vec3& e : edges) e = normalized(e);
    // The largest of the three sines has the best-conditioned cross product. An edge's coordinates are off by 3 epsilon
    // at most (difference, length, quotient), which turns it by no more than 6: an angle of 12 may be none.
    Face face;
    double most = 12 * epsilon;
    for (int k = 0; k < 3; k++) {
        const vec3 across = cross(edges[(k + 2) % 3], edges[k]);
        const double sine = norm(across);
        face.angles[k] = std::atan2(sine, -dot(edges[(k + 2) % 3], edges[k]));
        if (sine > most) most = sine, face.normal = normalized(across);
    }
    return face.normal == vec3{} ? Face{} : face;
}

// Gives a normal to each corner without one, or with one of no length: the mean of the normals of the faces around its
// vertex, each weighted by its angle there (G. Thuermer and C. Wuethrich, "Computing vertex normals from polygonal
// facets", 1998), which does not depend on how the polygons have been cut. Only those faces count that are reached from
// its own across smooth edges: within a smoothing group where the file has any, else those of up to 60 degrees.
void make_normals(Obj& obj) {
    // The cosine of 60 degrees, less what coordinates of five digits may miss: so a column of six sides is smooth.
    constexpr double sharpest = .4999;
    std::vector<Face> faces(obj.nfaces());
    for (int f = 0; f < obj.nfaces(); f++) {
        const Corner* const c = obj.corners_of(f);
        faces[f] = measure(obj.verts[c[0].vert], obj.verts[c[1].vert], obj.verts[c[2].vert]);
    }
    const auto is_flat = [&](int corner) { return faces[corner / 3].normal == vec3{}; };
    const auto is_smooth = [&](int f, int g) {
        if (obj.groups.empty()) return dot(faces[f].normal, faces[g].normal) >= sharpest;
        return obj.groups[f] == obj.groups[g] && obj.groups[f] != 0;
    };

    // The corners around vertex v are around[first[v]] to around[first[v + 1]], those of earlier faces first.
    std::vector<int> first(obj.verts.size() + 2), around(obj.corners.size());
    for (const Corner& c : obj.corners) first[c.vert + 2]++;
    for (std::size_t v = 1; v < first.size(); v++) first[v] += first[v - 1];
    for (int i = 0; i < count(obj.corners); i++) around[first[obj.corners[i].vert + 1]++] = i;

    struct Sum {
        vec3 normals;
        double angles = 0;
        int faces = 0, normal = -1;  // the last is its index
    };
    std::vector<Sum> sums;
    std::vector<int> parents;                // a tree of corners for each smooth fan of faces
    std::vector<std::pair<int, int>> edges;  // to that vertex, of that corner
    const auto root = [&](int j) {
        while (parents[j] != j) j = parents[j] = parents[parents[j]];
        return j;
    };
    for (int v = 0; v < count(obj.verts); v++) {
        const int* const own = around.data() + first[v];
        const int n = first[v + 1] - first[v];
        const auto solid = static_cast<int>(std::find_if_not(own, own + n, is_flat) - own);
        parents.resize(n), edges.clear();
        for (int j = 0; j < n; j++) {
            parents[j] = is_flat(own[j]) && solid < n ? solid : j;  // what has no area goes with its neighbours
            for (int k = 1; k < 3 && !is_flat(own[j]); k++)
                edges.push_back({obj.corners_of(own[j] / 3)[(own[j] + k) % 3].vert, j});
        }
        std::sort(edges.begin(), edges.end());
        for (int e = 1; e < count(edges); e++)  // where more than two faces meet, each may be smooth with another
            for (int d = e - 1; d >= std::max(0, e - 8) && edges[d].first == edges[e].first; d--) {
                const int i = edges[d].second, j = edges[e].second;
                if (is_smooth(own[i] / 3, own[j] / 3)) parents[root(j)] = root(i);
            }
        sums.assign(n, {});
        for (int j = 0; j < n; j++) {
            const Face& face = faces[own[j] / 3];
            const double angle = face.angles[own[j] % 3];
            Sum& sum = sums[root(j)];
            sum = {sum.normals + face.normal * angle, sum.angles + angle, sum.faces + 1};
        }
        for (int j = 0; j < n; j++) {
            int& normal = obj.corners[own[j]].normal;
            if (normal >= 0 && obj.normals[normal] != vec3{}) continue;
            // A sum of n terms is off by at most n half-units of the sum of their sizes, its terms themselves by less
            // than 4 units each. No more than that is left where the faces cancel, as on the two sides of a sheet: then
            // a face has its own normal, or an upright one where it has no area.
            Sum& sum = sums[root(j)];
            const vec3 face = faces[own[j] / 3].normal;
            const bool cancels = norm(sum.normals) <= (sum.faces + 4) * sum.angles * epsilon;
            normal = cancels || sum.normal < 0 ? count(obj.normals) : sum.normal;
            if (normal < count(obj.normals)) continue;
            obj.normals.push_back(!cancels ? normalized(sum.normals) : face == vec3{} ? vec3{0, 0, 1} : face);
            sum.normal = normal;
        }
    }
}

// ---- materials ----

enum { diffuse_map, normal_map, tangent_map, specular_map, glow_map, map_count, bump_map = map_count };
constexpr Map Material::*map_members[] = {&Material::diffuse, &Material::normal, &Material::tangent,
                                               &Material::specular, &Material::glow};
constexpr const char* map_suffixes[] = {"_diffuse.tga", "_nm.tga", "_nm_tangent.tga", "_spec.tga", "_glow.tga"};

struct MtlMap {
    std::string path;  // empty where there is none
    Map map;           // without a picture
};
struct MtlMaterial {
    vec3 Kd{1, 1, 1}, Ke;
    MtlMap maps[map_count + 1];  // bump_map is for where there is no tangent_map
    Model::Notes notes;          // for when it is used
};
using Library = std::map<std::string, MtlMaterial>;

// Takes the first word, and the blanks after it, off TEXT.
std::string_view take_word(std::string_view& text) {
    const std::string_view word = text.substr(0, text.find_first_of(" \t"));
    text.remove_prefix(std::min(text.find_first_not_of(" \t", word.size()), text.size()));
    return word;
}

// Of "-s 2 2 2 -bm 1 -clamp on the file.tga" the options, and what is left is the name. Each has a word and the numbers
// after it.
std::string take_options(std::string_view text, Map& map) {
    while (text.starts_with('-')) {
        const std::string_view option = take_word(text);
        vec2* const target = option == "-s" ? &map.scale : option == "-o" ? &map.offset : nullptr;
        for (int i = 0; !text.empty(); i++) {
            auto rest = text;
            const std::string number(take_word(rest));
            if (i > 0 && number.find_first_not_of("+-.0123456789eE") != number.npos) break;
            text = rest;
            double value = 0;
            if (target && i < 2 && std::sscanf(number.c_str(), "%lf", &value) == 1 && std::isfinite(value))
                (*target)[i] = value, map.is_moved = true;
        }
    }
    return unquoted(std::string(text));
}

// The path of a file that is named in another one, be it beside that or beside what that is a link to; empty where
// there is none. Programs of other systems write '\' for '/', the whole path on another machine, and other capitals:
// where there is no file of that name, one is taken whose last part is the same in small letters.
fs::path found(const fs::path& from, std::string name) {
    if (name.empty()) return {};
    for (std::size_t i; (i = name.find("\\ ")) != name.npos;) name.erase(i, 1);
    std::replace(name.begin(), name.end(), '\\', '/');
    std::error_code ignored;
    std::set<fs::path> places;
    for (const fs::path& folder : {from.parent_path(), fs::weakly_canonical(from, ignored).parent_path()}) {
        if (const auto s = fs::status(folder / name, ignored); fs::exists(s) && !fs::is_directory(s))
            return (folder / name).lexically_normal();
        places.insert({folder, (folder / name).parent_path()});
    }
    fs::path best;
    const std::string last = lower(fs::path(name).filename().string());
    for (const fs::path& place : places)
        for (const fs::path& entry : fs::directory_iterator(place.empty() ? "." : place, ignored))
            if (lower(entry.filename().string()) == last && (best.empty() || entry < best) &&
                !fs::is_directory(entry, ignored))
                best = entry;
    return best.lexically_normal();
}

// The path of a picture that a file names, if it is a TGA file, or else of the TGA file of the same stem, or else
// nothing, with a note. Other kinds are known by their first bytes, whatever the file's name.
std::string picture(const fs::path& from, const fs::path& obj, const std::string& name, Model::Notes& notes) {
    if (name.empty()) return "";
    fs::path other;
    for (const std::string& each : {name, fs::path(name).replace_extension(".tga").string()})
        for (const fs::path& file : {from, obj}) {
            const fs::path path = found(file, each);
            if (lower(path.extension().string()) == ".tga" && other_picture_kind(path).empty()) return path.string();
            if (other.empty()) other = path;
        }
    if (other.empty()) add(notes, "a picture that is not there, left out", in_quotes(name));
    else add(notes, "a picture that is not TGA, left out until it is converted",
             "convert " + in_quotes(other_picture_kind(other) + other.string(), 4096) + " " +
                 in_quotes(fs::path(other).replace_extension(".tga").string(), 4096));
    return "";
}

// Adds the file's materials to the others; one of the same name is replaced.
void read_mtl(const fs::path& path, const fs::path& obj, Library& library) {
    static constexpr std::pair<const char*, int> maps[] = {
        {"map_kd", diffuse_map}, {"map_ns", specular_map}, {"map_ke", glow_map}, {"norm", tangent_map},
        {"map_bump", bump_map}, {"bump", bump_map}};
    const FileBytes text = read_text(path);
    MtlMaterial before_the_first, *material = &before_the_first;
    for (Scanner in(path, text); !in.is_done(); in.next_line()) {
        const bool is_Ke = in.skip_word("ke");
        if (is_Ke || in.skip_word("kd")) {
            vec3 color;
            const int n = in.reals(color);
            if (!in.at_end() || (n != 1 && n != 3)) {
                in.note(material->notes, "a colour that is no number, left out");
                continue;
            }
            for (int i = 0; i < 3; i++)
                (is_Ke ? material->Ke : material->Kd)[i] = std::clamp(color[n == 1 ? 0 : i], 0., 1.);
        } else if (in.skip_word("newmtl")) {
            material = &library[in.rest()];
            *material = {};
        } else
            for (const auto& [keyword, map] : maps)
                if (in.skip_word(keyword)) {
                    MtlMap& its = material->maps[map] = {};
                    its.path = picture(path, obj, take_options(in.rest(), its.map), material->notes);
                }
    }
}

// Reads the files that the mtllib lines name: each line is one name, which may contain blanks, or else several.
Library read_libraries(const fs::path& obj, const std::vector<std::string>& lines, Model::Notes& notes) {
    Library library{{"", {}}};  // the default material
    std::set<fs::path> seen;
    const auto read = [&](std::string_view name) {
        const fs::path path = found(obj, std::string(name));
        if (path.empty()) return false;
        if (fs::is_other(path)) throw std::runtime_error(path.string() + ": is not a file");  // a pipe may never end
        if (seen.insert(path).second) read_mtl(path, obj, library);
        return true;
    };
    for (const std::string& line : lines)
        for (std::string_view rest = read(line) ? std::string_view() : line; !rest.empty();)
            if (const std::string_view name = take_word(rest); !read(name))
                add(notes, "a material file that is not there", in_quotes(name));
    return library;
}

// Sorts the faces, stably, by material, and fills MATERIALS with those that faces use, in the order of their first
// face. What the library does not define is all one default material, without a name.
std::vector<Model::Group> group_by_material(Obj& obj, const Library& library, std::vector<Material>& materials,
                                            Model::Notes& notes) {
    std::map<std::string, int> indices;
    std::set<std::string> unknown;
    std::vector<Model::Group> pieces, groups;
    obj.runs.push_back({obj.nfaces(), ""});
    for (int i = 0; i + 1 < count(obj.runs); i++) {
        auto& [begin, name] = obj.runs[i];
        const int end = obj.runs[i + 1].first;
        if (begin == end) continue;
        if (!library.contains(name)) {
            if (unknown.insert(name).second) add(notes, "a material that no file has", in_quotes(name));
            name.clear();
        }
        const auto [entry, is_new] = indices.emplace(name, count(materials));
        if (is_new) materials.push_back({name, library.at(name).Kd, library.at(name).Ke, {}, {}, {}, {}, {}});
        pieces.push_back({begin, end, entry->second});
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

// Adds what a group of faces needs: from the .mtl, and where that names none, the pictures beside the model or beside
// what it is a link to.
void plan_textures(const fs::path& path, const Model::Group& group, Obj& obj, const MtlMaterial& mtl,
                   Material& material, NormalMap wanted, Model::Textures& textures, Model::Notes& notes) {
    for (const auto& [what, note] : mtl.notes) add(notes, what, note.first, note.count);
    MtlMap maps[map_count];
    std::error_code ignored;
    const fs::path places[] = {path, fs::weakly_canonical(path, ignored)};
    for (int i = 0; i < map_count; i++) {
        const bool is_bump = i == tangent_map && mtl.maps[i].path.empty();
        maps[i] = mtl.maps[is_bump ? bump_map : i];
        for (fs::path file : places)
            if (maps[i].path.empty() && fs::exists(file.replace_extension() += map_suffixes[i], ignored)) {
                maps[i].path = picture(file, file, file.filename().string(), notes);
                break;
            }
    }
    if (!maps[normal_map].path.empty() && !maps[tangent_map].path.empty())
        maps[wanted == NormalMap::object ? tangent_map : normal_map] = {};
    const bool has_uvs = std::any_of(obj.corners_of(group.begin), obj.corners_of(group.end),
                                     [](const Corner& c) { return c.uv >= 0; });
    for (int i = 0; i < map_count; i++) {
        if (maps[i].path.empty()) continue;
        if (!has_uvs) return add(notes, "no texture coordinates, so no textures", in_quotes(material.name));
        textures[maps[i].path].push_back({group.material, map_members[i]});
        material.*map_members[i] = maps[i].map;
        if (i == diffuse_map && material.Kd == vec3{}) material.Kd = {1, 1, 1};  // black where a map is in its place
    }
}

}  // namespace

// ---- the model ----

Model::Model(const fs::path& path, NormalMap wanted) {
    Obj obj(path, read_text(path));
    notes_ = std::move(obj.notes);
    PolygonCutter cutter;
    for (const auto& [face, n] : obj.polygons)
        if (!cutter.cut(obj.verts, obj.corners_of(face), n))
            add(notes_, "a polygon that crosses itself or has very many corners", "of " + std::to_string(n));
    given_normals_ = count(obj.normals);
    if (obj.lacks_normals) make_normals(obj);

    const Library library = read_libraries(path, obj.libraries, notes_);
    groups_ = group_by_material(obj, library, materials_, notes_);
    for (const Group& g : groups_) {
        Material& material = materials_[g.material];
        plan_textures(path, g, obj, library.at(material.name), material, wanted, textures_, notes_);
    }
    // A vertex that no face uses may be anywhere. It is put where another is, so that all can be measured and moved.
    std::vector<bool> is_used(obj.verts.size());
    for (const Corner& c : obj.corners) is_used[c.vert] = true;
    for (int i = 0; i < count(obj.verts); i++)
        if (!is_used[i]) obj.verts[i] = obj.verts[obj.corners[0].vert];
    verts_ = std::move(obj.verts);
    colors_ = std::move(obj.colors);
    normals_ = std::move(obj.normals);
    uvs_ = std::move(obj.uvs);
    corners_ = std::move(obj.corners);
    find_box();
}

// As many at a time as there are cores. What is thrown is the error of the first bad one in the order of their paths.
void Model::load_textures(Pictures& loaded) {
    std::deque<std::future<TGAImage>> started;
    auto next = textures_.begin();
    for (const auto& [path, uses] : textures_) {
        for (; next != textures_.end() && started.size() < std::max(1u, std::thread::hardware_concurrency()); next++)
            if (!loaded[next->first]) started.push_back(std::async(TGAImage::read_tga_file, next->first));
        auto& picture = loaded[path];
        if (!picture) picture = std::make_shared<const TGAImage>(started.front().get()), started.pop_front();
        for (const auto& [material, map] : uses)
            if ((map == &Material::normal || map == &Material::tangent) && picture->is_grey())
                add(notes_, "a grey picture, heights and no normals, left out", fs::path(path).filename().string());
            else (materials_[material].*map).picture = picture;
    }
}

std::vector<std::string> Model::notes() const {
    std::vector<std::string> lines;
    for (const auto& [what, note] : notes_)
        lines.push_back(what + ": " + note.first +
                        (note.count > 1 ? " and " + std::to_string(note.count - 1) + " more" : ""));
    return lines;
}

