// watertight_test.cpp: every sample of a tessellated surface is drawn exactly once, whatever happens to the surface on
// its way to the screen; and coverage agrees with a reference that tests every pixel by itself.
#include "check.h"
#include "drawing.h"
#include "random.h"

#include <array>

namespace {

constexpr int W = 64, H = 48;

// The grid [0,cells]^2 under M, each cell cut along one of its diagonals, faces in either winding.
Drawing tessellated(const mat4& M, const mat4& Viewport, int cells, Random& r) {
    std::vector<vec4> clip;
    for (int i = 0; i < cells; i++) {
        for (int j = 0; j < cells; j++) {
            const auto at = [&](int x, int y) { return M * point(vec3{double(x), double(y), 0}); };
            const vec4 q[4] = {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)};
            const int a = r.below(4), b = (a + 1) % 4, c = (a + 2) % 4, d = (a + 3) % 4;
            const bool turned = r.below(2);
            for (const int k : {a, turned ? c : b, turned ? b : c, c, turned ? a : d, turned ? d : a})
                clip.push_back(q[k]);
        }
    }
    return drawing(ClipShader(clip), W, H, Viewport);
}

// Where the pixel centre lies in the square, from the inverse transform: 1 inside, 0 outside, -1 within 1/4096 pixel of
// its outline: snapping moves a corner by up to 2^-17 pixel, and clipping by the near plane by 2^-13 (w_near in
// our_gl.cpp).
int expected(const mat4& M, const mat4& Viewport, int cells, int x, int y) {
    const mat4 s = Viewport * M;
    const mat3 h{{{s[0].x, s[0].y, s[0].w}, {s[1].x, s[1].y, s[1].w}, {s[3].x, s[3].y, s[3].w}}};
    const auto to_square = invert(h);
    if (!to_square) return -1;
    bool in = false, out = false;
    for (const double dx : {-1. / 4096, 1. / 4096}) {
        for (const double dy : {-1. / 4096, 1. / 4096}) {
            const vec3 p = *to_square * vec3{x + .5 + dx, y + .5 + dy, 1};
            const double u = p.x / p.z, v = p.y / p.z;
            const bool front = h[2].x * u + h[2].y * v + h[2].z > 1e-5;  // in front of the near plane, clearly
            const bool behind = h[2].x * u + h[2].y * v + h[2].z < 1e-7;
            if (!front && !behind) return -1;
            (front && u >= 0 && v >= 0 && u <= cells && v <= cells ? in : out) = true;
        }
    }
    return in && out ? -1 : in;
}

// As many samples as pixels: no pixel is hit twice.
void check_once(const mat4& M, const mat4& Viewport, int cells, Random& r) {
    const Drawing d = tessellated(M, Viewport, cells, r);
    int wrong = 0;
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) {
            const int want = expected(M, Viewport, cells, x, y);
            wrong += want >= 0 && d.drawn(x, y) != want;
        }
    }
    CHECK_EQ(wrong, 0);
    CHECK_EQ(d.count.covered, d.seen());
}

const mat4 pixels = [] {  // clip space in pixels: the viewport undone
    return invert(viewport(0, 0, W, H)).value();
}();

mat4 scaled(double s, double x, double y) { return {{{s, 0, 0, x}, {0, s, 0, y}, {0, 0, 1, 0}, {0, 0, 0, 1}}}; }

}  // namespace

TEST("cells on integers and halves, from .05 to 64 pixels") {
    Random r(1);
    for (const double cell : {.05, .0625, .1, .25, .3, .5, 1., 1.5, 2., 3.7, 8., 16., 64.})
        for (const double at : {0., .5, 10., 10.5, -3.5})
            check_once(pixels * scaled(cell, at, at), viewport(0, 0, W, H),
                       std::min(64, static_cast<int>(100 / cell) + 1), r);
}

TEST("a thousand random rotations, shears and perspectives") {
    Random r(2);
    for (int k = 0; k < 1000; k++) {
        const int cells = 1 + r.below(24);
        const double a = r.in(0, 6.3), size = std::exp(r.in(-3, 4.2)), shear = r.in(-1, 1), squeeze = r.in(.2, 1);
        const mat4 plane{{{size * std::cos(a), -size * squeeze * std::sin(a) + shear, 0, r.in(0, W)},
                          {size * std::sin(a), size * squeeze * std::cos(a), 0, r.in(0, H)},
                          {0, 0, 1, 0},
                          {0, 0, 0, 1}}};
        mat4 M = pixels * plane;
        if (k % 2)  // w varies across the square; some of it may be behind the eye
            M[3] = {r.in(-1, 1) / cells, r.in(-1, 1) / cells, 0, 1};
        check_once(M, viewport(0, 0, W, H), cells, r);
    }
}

TEST("clipped by each plane") {
    Random r(3);
    for (int k = 0; k < 200; k++) {  // a square much larger than the guard band, pushed over each side of the picture
        const double cell = r.in(500, 20000), a = r.in(0, 6.3);
        const int cells = 1 + r.below(8);
        const mat4 turned{{{cell * std::cos(a), -cell * std::sin(a), 0, r.in(-3e4, 3e4)},
                           {cell * std::sin(a), cell * std::cos(a), 0, r.in(-3e4, 3e4)},
                           {0, 0, 1, 0},
                           {0, 0, 0, 1}}};
        check_once(pixels * turned, viewport(0, 0, W, H), cells, r);
    }
    for (int k = 0; k < 200; k++) {  // a floor that runs under and behind the eye
        const int cells = 1 + r.below(30);
        const double size = r.in(2, 100), height = r.in(.1, 1), turn = r.in(0, 6.3);
        const mat4 floor{{{std::cos(turn) * size / cells, std::sin(turn) * size / cells, 0, r.in(-size, 0)},
                          {0, 0, 0, -height},
                          {-std::sin(turn) * size / cells, std::cos(turn) * size / cells, 0, r.in(-size, 1)},
                          {0, 0, 0, 1}}};
        check_once(projection(-r.in(.1, 2)) * floor, viewport(0, 0, W, H), cells, r);
    }
}

TEST("100 000 random triangles against a test of every pixel by itself") {
    Random r(4);
    for (int k = 0; k < 100000; k++) {
        // Corners on a coarse grid often, so that edges run through pixel centres.
        const double grid = std::array{1., .5, .25, 1. / 65536}[r.below(4)], size = std::exp(r.in(0, 4.2));
        double x[3], y[3];
        std::vector<vec4> clip(3);
        const double cx = r.in(0, W), cy = r.in(0, H);
        for (int i = 0; i < 3; i++) {
            x[i] = std::round((cx + r.in(-size, size)) / grid) * grid;
            y[i] = std::round((cy + r.in(-size, size)) / grid) * grid;
            clip[i] = {2 * x[i] / W - 1, 2 * y[i] / H - 1, 0, 1};
        }
        const Drawing d = drawing(clip, W, H);
        using wide = std::int64_t;
        wide ix[3], iy[3];
        for (int i = 0; i < 3; i++) ix[i] = std::llround(x[i] * 65536), iy[i] = std::llround(y[i] * 65536);
        const wide area = (ix[1] - ix[0]) * (iy[2] - iy[0]) - (iy[1] - iy[0]) * (ix[2] - ix[0]);
        if (area < 0) std::swap(ix[1], ix[2]), std::swap(iy[1], iy[2]);
        int wrong = 0;
        for (int py = 0; py < H; py++) {
            for (int px = 0; px < W; px++) {
                bool inside = area != 0;
                for (int i = 0; i < 3 && inside; i++) {
                    const int j = (i + 1) % 3;
                    const wide e = (ix[j] - ix[i]) * (py * 65536 + 32768 - iy[i]) -
                                   (iy[j] - iy[i]) * (px * 65536 + 32768 - ix[i]);
                    const bool left = iy[j] < iy[i], top = iy[j] == iy[i] && ix[j] < ix[i];
                    inside = e > 0 || (e == 0 && (left || top));
                }
                wrong += d.drawn(px, py) != inside;
            }
        }
        CHECK_EQ(wrong, 0);
        CHECK_EQ(d.count.covered, d.seen());
    }
}

int main(int argc, char** argv) {
    use_threads(1);  // so many small pictures are drawn sooner without waking others
    return run_tests(argc, argv);
}
