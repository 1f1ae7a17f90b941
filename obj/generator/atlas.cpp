// atlas.cpp: the idol's mesh cut into charts that lie flat in the texture.
#include <cstdio>
#include <functional>
#include <map>
#include <queue>

#include "formulas.h"
#include "idol.h"
#include "textured.h"

namespace {

constexpr int block_texels = 2;

struct Chart {
    std::vector<int> faces;
    vec3 u, v, w;                               // an orthonormal frame: the chart is the projection along w
    double shrink = 1;                          // its scale, relative to the atlas's
    int x0 = 0, y0 = 0, width = 0, height = 0;  // its box in blocks; x0, y0: in the chart's own coordinates
    int at_x = 0, at_y = 0;                     // its place in the atlas, in blocks

    vec2 flat(const vec3& p, double scale) const { return vec2{dot(p, u), dot(p, v)} * (scale * shrink); }
    Corners flat(const Mesh& m, int f, double scale) const {
        Corners t;
        for (int k = 0; k < 3; k++) t[k] = flat(m.verts[m.faces[f][k]], scale);
        return t;
    }
    vec2 shift(int x, int y) const { return vec2{1. * (x - x0) * block_texels, 1. * (y - y0) * block_texels}; }
};

// Charts grow from a seed over faces that look roughly the same way, and stop where the projection would fold over
// itself. SCALE is in texels per unit of length.
std::vector<Chart> cut(const Mesh& m, double scale) {
    std::map<std::pair<int, int>, int> owner;
    for (int f = 0; f < m.nfaces(); f++)
        for (int k = 0; k < 3; k++) owner[{m.faces[f][k], m.faces[f][(k + 1) % 3]}] = f;
    std::vector<Face> beside(m.faces.size());
    std::vector<vec3> normal(m.faces.size()), middle(m.faces.size());
    for (int f = 0; f < m.nfaces(); f++) {
        normal[f] = normalized(m.area_vector(m.faces[f]));
        for (int k = 0; k < 3; k++) {
            beside[f][k] = owner.at({m.faces[f][(k + 1) % 3], m.faces[f][k]});
            middle[f] = middle[f] + m.verts[m.faces[f][k]] / 3;
        }
    }
    std::vector<int> chart_of(m.faces.size(), -1);
    std::vector<Chart> charts;

    // Grows one chart from SEED over the faces whose normals have at least the cosine LEAST with its direction W.
    const auto grow = [&](int seed, const vec3& w, double least) {
        Chart c;
        c.w = w;
        c.u = normalized(cross(std::fabs(w.y) < .8 ? vec3{0, 1, 0} : vec3{0, 0, 1}, w));
        c.v = cross(w, c.u);
        std::map<std::pair<int, int>, double> heights;  // texel -> where the surface is above it
        using Entry = std::pair<double, int>;
        std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> open;
        open.push({0, seed});
        std::vector<bool> seen(m.faces.size());
        seen[seed] = true;
        while (!open.empty()) {
            const int f = open.top().second;
            open.pop();
            const double facing = dot(normal[f], w);
            if (chart_of[f] >= 0 || facing < least) continue;
            std::vector<std::pair<std::pair<int, int>, double>> fresh;
            bool folds = false;
            cover(c.flat(m, f, scale), 1.5, [&](int x, int y) {
                const vec3 q = c.u * ((x + .5) / scale) + c.v * ((y + .5) / scale);
                const double height = dot(middle[f] - q, normal[f]) / facing;
                const auto found = heights.find({x, y});
                if (found == heights.end()) fresh.push_back({{x, y}, height});
                else if (std::fabs(found->second - height) > 7 / scale) folds = true;
            });
            if (folds) continue;
            heights.insert(fresh.begin(), fresh.end());
            c.faces.push_back(f);
            for (const int g : beside[f])
                if (!seen[g] && chart_of[g] < 0) {
                    seen[g] = true;
                    open.push({norm(middle[g] - middle[seed]) + .25 * (1 - dot(normal[g], w)), g});
                }
        }
        return c;
    };
    for (int seed = 0; seed < m.nfaces(); seed++) {
        if (chart_of[seed] >= 0) continue;
        Chart c = grow(seed, normal[seed], .72);
        for (int round = 0; round < 2; round++) {
            vec3 mean;
            for (const int f : c.faces) mean = mean + m.area_vector(m.faces[f]);
            mean = normalized(mean);
            if (dot(mean, normal[seed]) < .62) break;
            c = grow(seed, mean, .6);
        }
        if (middle[seed].y < -.95 && c.w.y < -.99) c.shrink = .25;  // under the pedestal: nobody looks there
        for (const int f : c.faces) chart_of[f] = static_cast<int>(charts.size());
        charts.push_back(std::move(c));
    }
    return charts;
}

// Places the charts in a square of SIZE texels, first fit, large ones first. Returns whether they all fit at this
// scale.
bool place(const Mesh& m, std::vector<Chart>& charts, double scale, int size) {
    constexpr double padding = 2.5;  // texels around every chart that hold what lies just outside
    const int blocks = size / block_texels;
    std::vector<Chart*> order;
    for (Chart& c : charts) {
        vec2 lo{1e9, 1e9}, hi{-1e9, -1e9};
        for (const int f : c.faces)
            for (const vec2& t : c.flat(m, f, scale))
                for (int k = 0; k < 2; k++) lo[k] = std::min(lo[k], t[k]), hi[k] = std::max(hi[k], t[k]);
        c.x0 = static_cast<int>(std::floor((lo.x - padding) / block_texels));
        c.y0 = static_cast<int>(std::floor((lo.y - padding) / block_texels));
        c.width = static_cast<int>(std::ceil((hi.x + padding) / block_texels)) - c.x0;
        c.height = static_cast<int>(std::ceil((hi.y + padding) / block_texels)) - c.y0;
        order.push_back(&c);
    }
    std::stable_sort(order.begin(), order.end(),
                     [](const Chart* a, const Chart* b) { return a->width * a->height > b->width * b->height; });
    std::vector<char> used(blocks * blocks);
    for (Chart* c : order) {
        std::vector<char> mask(c->width * c->height);  // the blocks that it needs, padding included
        for (const int f : c->faces) {
            Corners t = c->flat(m, f, scale);
            for (vec2& corner : t) corner = corner + c->shift(0, 0);
            cover(t, padding, [&](int x, int y) {
                const int bx = x / block_texels, by = y / block_texels;
                if (bx >= 0 && by >= 0 && bx < c->width && by < c->height) mask[by * c->width + bx] = true;
            });
        }
        std::vector<int> needed;  // the same, counted from the chart's first block in the atlas
        for (int i = 0; i < c->width * c->height; i++)
            if (mask[i]) needed.push_back(i / c->width * blocks + i % c->width);
        const auto fits = [&](int x, int y) {
            return std::none_of(needed.begin(), needed.end(), [&](int i) { return used[y * blocks + x + i]; });
        };
        int x = 0, y = 0;
        while (y + c->height <= blocks && (x + c->width > blocks || !fits(x, y)))
            if (++x + c->width > blocks) x = 0, y++;
        if (y + c->height > blocks) return false;
        for (const int i : needed) used[y * blocks + x + i] = true;
        c->at_x = x, c->at_y = y;
    }
    return true;
}

}  // namespace

Textured unwrap(Mesh m, int size, double scale) {
    Textured out;
    for (vec3& v : m.verts) v = rounded(v, 1e5);
    std::vector<Chart> charts = cut(m, scale);
    while (!place(m, charts, scale, size)) scale *= .98;
    std::printf("  %zu charts, %.0f texels per unit\n", charts.size(), scale);
    out.uv_of.resize(m.faces.size());
    for (const Chart& c : charts) {
        std::map<int, int> uv_of_vertex;
        for (const int f : c.faces)
            for (int k = 0; k < 3; k++) {
                const int v = m.faces[f][k];
                const auto [found, fresh] = uv_of_vertex.insert({v, static_cast<int>(out.uvs.size())});
                if (fresh) {
                    const vec2 t = c.flat(m.verts[v], scale) + c.shift(c.at_x, c.at_y);
                    out.uvs.push_back({rounded(t.x / size, 1e5), rounded(t.y / size, 1e5)});
                }
                out.uv_of[f][k] = found->second;
            }
    }
    for (const vec3& v : m.verts) out.normals.push_back(rounded(idol_normal(v), 1e4));
    out.normal_of = m.faces;
    out.mesh = std::move(m);
    return out;
}
