// mesh.cpp: the idol's distance function turned into triangles, and these into fewer.
#include "mesh.h"

#include <limits>
#include <map>
#include <optional>
#include <queue>
#include <set>
#include <stdexcept>

#include "idol.h"

void check_closed(const Mesh& m, const std::string& name, int euler) {
    const auto fail = [&](const std::string& what) { throw std::runtime_error(name + ": " + what); };
    std::map<std::pair<int, int>, int> next;  // the directed edge (a,b) of a face -> its third vertex
    double volume = 0;
    for (const Face& f : m.faces) {
        for (int k = 0; k < 3; k++)
            if (!next.insert({{f[k], f[(k + 1) % 3]}, f[(k + 2) % 3]}).second) fail("an edge is used twice");
        if (!(norm(m.area_vector(f)) > 1e-9)) fail("a face is degenerate");
        volume += dot(m.verts[f[0]], cross(m.verts[f[1]], m.verts[f[2]])) / 6;
    }
    std::vector<int> degree(m.verts.size()), start(m.verts.size(), -1);
    for (const auto& [edge, third] : next) {
        if (!next.count({edge.second, edge.first})) fail("an edge is open");
        degree[edge.first]++, start[edge.first] = edge.second;
    }
    for (int v = 0; v < m.nverts(); v++) {
        if (!degree[v]) fail("a vertex without a face");
        int turns = 1;
        for (int w = next.at({v, start[v]}); w != start[v]; w = next.at({v, w})) turns++;
        if (turns != degree[v]) fail("a vertex with more than one fan");
    }
    if (!(volume > 0)) fail("the faces look inwards");
    const int chi = m.nverts() + m.nfaces() - static_cast<int>(next.size() / 2);
    if (chi != euler) fail("Euler characteristic " + std::to_string(chi));
}

namespace {

// For each vertex the faces around it.
std::vector<std::vector<int>> fans_of(const Mesh& m) {
    std::vector<std::vector<int>> fans(m.verts.size());
    for (int f = 0; f < m.nfaces(); f++)
        for (const int v : m.faces[f]) fans[v].push_back(f);
    return fans;
}

// Moves every vertex onto the surface, but for those that would turn or flatten a face by it.
void settle(Mesh& m) {
    std::vector<vec3> target(m.verts.size());
    parallel(m.nverts(), [&](int i) { target[i] = onto_surface(m.verts[i]); });
    const auto fans = fans_of(m);
    for (int v = 0; v < m.nverts(); v++) {
        const vec3 before = m.verts[v];
        std::vector<vec3> was;
        for (const int f : fans[v]) was.push_back(m.area_vector(m.faces[f]));
        m.verts[v] = target[v];
        bool fine = true;
        for (std::size_t k = 0; k < fans[v].size(); k++) {
            const vec3 is = m.area_vector(m.faces[fans[v][k]]);
            if (dot(was[k], is) < .5 * norm(was[k]) * norm(is) || norm(is) < .2 * norm(was[k])) fine = false;
        }
        if (!fine) m.verts[v] = before;
    }
}

// Gauss-Jordan elimination with full pivoting, after rows and columns have been scaled by powers of two to a largest
// element in [1,2). It is as careful as the renderer's needs not be, and the committed idol hangs on its last bits.
std::optional<mat3> inverse_of(mat3 a) {
    int row_exponent[3], column_exponent[3], column_of[3];
    const auto exponent = [](const vec3& v) {
        const double largest = std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)});
        return largest > 0 ? std::ilogb(largest) : 0;
    };
    for (int i = 0; i < 3; i++) {
        row_exponent[i] = exponent(a[i]);
        for (int j = 0; j < 3; j++) a[i][j] = std::scalbn(a[i][j], -row_exponent[i]);
    }
    for (int j = 0; j < 3; j++) {
        column_exponent[j] = exponent(a.col(j));
        for (int i = 0; i < 3; i++) a[i][j] = std::scalbn(a[i][j], -column_exponent[j]);
    }
    mat3 inverse = mat3::identity(), out;
    bool used[3] = {};
    for (int k = 0; k < 3; k++) {
        int row = k, column = 0;
        double best = -1;
        for (int i = k; i < 3; i++)
            for (int j = 0; j < 3; j++)
                if (!used[j] && std::fabs(a[i][j]) > best) best = std::fabs(a[i][j]), row = i, column = j;
        if (!(best > 6 * std::numeric_limits<double>::epsilon())) return {};
        std::swap(a[k], a[row]);
        std::swap(inverse[k], inverse[row]);
        used[column] = true, column_of[k] = column;
        const double pivot = a[k][column];
        a[k] = a[k] / pivot, inverse[k] = inverse[k] / pivot;
        for (int i = 0; i < 3; i++) {
            if (i == k) continue;
            const double factor = a[i][column];
            a[i] = a[i] - a[k] * factor, inverse[i] = inverse[i] - inverse[k] * factor;
        }
    }
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < 3; j++)
            out[column_of[k]][j] = std::scalbn(inverse[k][j], -column_exponent[column_of[k]] - row_exponent[j]);
    return out;
}

struct Quadric {  // x'Ax + 2b'x + c: a weighted sum of squared distances to planes
    mat3 A;
    vec3 b;
    double c = 0;
    void add_plane(const vec3& n, double d, double w) {
        for (int i = 0; i < 3; i++) A[i] = A[i] + n * (n[i] * w);
        b = b + n * (d * w), c += d * d * w;
    }
    void add(const Quadric& q) {
        for (int i = 0; i < 3; i++) A[i] = A[i] + q.A[i];
        b = b + q.b, c += q.c;
    }
    double error(const vec3& p) const { return dot(p, A * p) + 2 * dot(b, p) + c; }
};

// visit(x, y, z) for begin <= x, y, z < end, x first.
template <typename F>
void for_each_cell(int begin, int end, const F& visit) {
    for (int z = begin; z < end; z++)
        for (int y = begin; y < end; y++)
            for (int x = begin; x < end; x++) visit(x, y, z);
}

// Whether the surface passes through a cell as one sheet: on no face do opposite corners pair up, nor do they alone in
// the whole cube. Bit c of INSIDE tells of corner c.
bool one_sheet(int inside) {
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++) {
            const int a = 1 << (axis + 1) % 3, b = 1 << (axis + 2) % 3, o = side << axis;
            const auto in = [&](int c) { return inside >> c & 1; };
            if (in(o) == in(o + a + b) && in(o + a) == in(o + b) && in(o) != in(o + a)) return false;
        }
    for (int c = 0; c < 4; c++)
        if (inside == (1 << c | 1 << (7 - c)) || inside == (255 ^ (1 << c | 1 << (7 - c)))) return false;
    return true;
}

}  // namespace

// Naive surface nets: one vertex in every cell that the surface crosses, one quad across every grid edge that it
// crosses. That is a closed manifold as long as no cell has two sheets in it: such cells are filled.
Mesh surface_net(int n) {
    const int m = n + 1;
    const double cell = 2. / n;
    const auto index = [&](int x, int y, int z) { return (z * m + y) * m + x; };
    const auto place = [&](int x, int y, int z) { return vec3{x * cell - 1, y * cell - 1, z * cell - 1}; };
    std::vector<double> value(m * m * m);
    parallel(m, [&](int z) {
        for (int y = 0; y < m; y++)
            for (int x = 0; x < m; x++) value[index(x, y, z)] = idol(place(x, y, z));
    });
    const auto corner = [&](int x, int y, int z, int c) { return index(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)); };
    const auto mask = [&](int x, int y, int z) {
        int inside = 0;
        for (int c = 0; c < 8; c++) inside |= (value[corner(x, y, z, c)] < 0) << c;
        return inside;
    };
    for (bool changed = true; changed;) {
        changed = false;
        for_each_cell(0, n, [&](int x, int y, int z) {
            if (one_sheet(mask(x, y, z))) return;
            int nearest = 0;
            double smallest = 1e9;
            for (int c = 0; c < 8; c++) {
                const double v = value[corner(x, y, z, c)];
                if (v >= 0 && v < smallest) smallest = v, nearest = corner(x, y, z, c);
            }
            value[nearest] = -1e-6;
            changed = true;
        });
    }

    Mesh out;
    std::vector<int> vertex(value.size(), -1);  // of the cell at each corner's index
    for_each_cell(0, n, [&](int x, int y, int z) {
        const int inside = mask(x, y, z);
        if (inside == 0 || inside == 255) return;
        vec3 sum;
        int crossings = 0;
        for (int c = 0; c < 8; c++)
            for (int axis = 0; axis < 3; axis++) {
                const int d = c | 1 << axis;
                if (d == c || (inside >> c & 1) == (inside >> d & 1)) continue;
                const double a = value[corner(x, y, z, c)], b = value[corner(x, y, z, d)];
                vec3 p{1. * (c & 1), 1. * (c >> 1 & 1), 1. * (c >> 2)};
                p[axis] = std::clamp(a / (a - b), .1, .9);  // no quad shrinks to a point
                sum = sum + p, crossings++;
            }
        vertex[index(x, y, z)] = out.nverts();
        out.verts.push_back(place(x, y, z) + sum * (cell / crossings));
    });
    for_each_cell(1, n, [&](int x, int y, int z) {
        for (int axis = 0; axis < 3; axis++) {
            const bool a = value[index(x, y, z)] < 0, b = value[corner(x, y, z, 1 << axis)] < 0;
            if (a == b) continue;
            int q[4];  // the four cells around the edge, counter-clockwise seen from the edge's end
            constexpr int around[4][2] = {{1, 1}, {0, 1}, {0, 0}, {1, 0}};
            for (int k = 0; k < 4; k++) {
                int c[3] = {x, y, z};
                c[(axis + 1) % 3] -= around[k][0], c[(axis + 2) % 3] -= around[k][1];
                q[k] = vertex[index(c[0], c[1], c[2])];
            }
            if (b) std::swap(q[1], q[3]);
            const auto edge = [&](int i, int j) { return norm(out.verts[q[i]] - out.verts[q[j]]); };
            const int s = edge(0, 2) <= edge(1, 3) ? 0 : 1;
            out.faces.push_back({q[s], q[s + 1], q[(s + 2) % 4]});
            out.faces.push_back({q[s], q[(s + 2) % 4], q[(s + 3) % 4]});
        }
    });
    settle(out);
    return out;
}

// Edge collapses in the order of the quadric error (Garland and Heckbert, "Surface simplification using quadric error
// metrics", 1997).
Mesh simplify(Mesh m, int target) {
    std::vector<Quadric> quadric(m.verts.size());
    for (const Face& f : m.faces) {
        const vec3 c = m.area_vector(f), n = normalized(c),
                   middle = (m.verts[f[0]] + m.verts[f[1]] + m.verts[f[2]]) / 3;
        const double w = norm(c) * importance(middle);
        for (const int v : f) {
            quadric[v].add_plane(n, -dot(n, m.verts[v]), w);
            for (int k = 0; k < 3; k++) {  // a weak pull to the place itself: flat parts keep well-shaped triangles
                vec3 e;
                e[k] = 1;
                quadric[v].add_plane(e, -m.verts[v][k], w * 2e-3);
            }
        }
    }
    std::vector<std::vector<int>> fans = fans_of(m);
    std::vector<bool> dead(m.faces.size());
    std::vector<int> stamp(m.verts.size());  // how often the vertex was moved, -1: it is no more

    struct Candidate {
        double cost;
        int a, b, stamp_a, stamp_b;
        vec3 p;
    };
    const auto later = [](const Candidate& x, const Candidate& y) {
        return std::tie(x.cost, x.a, x.b) > std::tie(y.cost, y.a, y.b);
    };
    std::priority_queue<Candidate, std::vector<Candidate>, decltype(later)> heap(later);
    const auto offer = [&](int a, int b) {
        if (a > b) std::swap(a, b);
        Quadric q = quadric[a];
        q.add(quadric[b]);
        const vec3 middle = (m.verts[a] + m.verts[b]) / 2;
        vec3 p = middle;
        if (const auto inverse = inverse_of(q.A)) p = *inverse * (-q.b);
        if (norm(p - middle) > norm(m.verts[a] - m.verts[b])) p = middle;
        heap.push({std::max(0., q.error(p)), a, b, stamp[a], stamp[b], p});
    };
    const auto neighbours = [&](int v) {
        std::set<int> out;
        for (const int f : fans[v]) out.insert(m.faces[f].begin(), m.faces[f].end());
        out.erase(v);
        return out;
    };
    for (int v = 0; v < m.nverts(); v++)
        for (const int w : neighbours(v))
            if (v < w) offer(v, w);

    int left = m.nfaces();
    while (left > target && !heap.empty()) {
        const Candidate c = heap.top();
        heap.pop();
        if (stamp[c.a] != c.stamp_a || stamp[c.b] != c.stamp_b) continue;
        const std::set<int> na = neighbours(c.a), nb = neighbours(c.b);
        const auto common = std::count_if(na.begin(), na.end(), [&](int v) { return nb.count(v); });
        if (common != 2 || na.size() + nb.size() < 8) continue;  // the surface would pinch
        bool fine = true;
        for (const int end : {c.a, c.b})
            for (const int f : fans[end]) {
                const Face& t = m.faces[f];
                if (std::count(t.begin(), t.end(), c.a) && std::count(t.begin(), t.end(), c.b)) continue;
                vec3 p[3];
                for (int k = 0; k < 3; k++) p[k] = t[k] == end ? c.p : m.verts[t[k]];
                const vec3 before = m.area_vector(t), after = cross(p[1] - p[0], p[2] - p[0]);
                const double longest = std::max({norm(p[1] - p[0]), norm(p[2] - p[1]), norm(p[0] - p[2])});
                if (dot(before, after) < .6 * norm(before) * norm(after) || norm(after) < .12 * longest * longest)
                    fine = false;
            }
        if (!fine) continue;
        m.verts[c.a] = c.p;
        quadric[c.a].add(quadric[c.b]);
        for (const int f : fans[c.b]) {
            Face& t = m.faces[f];
            if (std::count(t.begin(), t.end(), c.a)) {
                dead[f] = true, left--;
                for (const int v : t)
                    if (v != c.b) fans[v].erase(std::find(fans[v].begin(), fans[v].end(), f));
            } else {
                std::replace(t.begin(), t.end(), c.b, c.a);
                fans[c.a].push_back(f);
            }
        }
        stamp[c.a]++, stamp[c.b] = -1;
        for (const int w : neighbours(c.a)) offer(c.a, w);
    }

    Mesh out;
    std::vector<int> renamed(m.verts.size(), -1);
    for (int v = 0; v < m.nverts(); v++)
        if (stamp[v] >= 0) renamed[v] = out.nverts(), out.verts.push_back(m.verts[v]);
    for (int f = 0; f < m.nfaces(); f++)
        if (const Face& t = m.faces[f]; !dead[f])
            out.faces.push_back({renamed[t[0]], renamed[t[1]], renamed[t[2]]});
    settle(out);
    return out;
}
