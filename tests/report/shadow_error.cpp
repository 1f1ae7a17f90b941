// shadow_error.cpp: the line that `umbra --report` prints.
#include "shadow_error.h"

std::string report_line(TruthImage truth, const FaceBuffer& faces, const Verdicts& verdicts, const TGAImage& picture,
                        const TGAImage& exact) {
    long coverage = 0, self = 0;
    double squares = 0;
    for (std::size_t i = 0; i < truth.pixel.size(); i++) {
        const int x = static_cast<int>(i) % truth.width, y = static_cast<int>(i) / truth.width;
        if ((truth.triangle[i] < 0) != (faces.row(y)[x] < 0)) coverage++, truth.pixel[i] = Truth::background;
        if (truth.pixel[i] != Truth::lit && truth.pixel[i] != Truth::shadowed) continue;
        self += truth.pixel[i] == Truth::lit && !verdicts.lit[i] && verdicts.cause[i] == 1;
        for (int c = 0; c < 3; c++) squares += std::pow(picture.pixel(x, y)[c] - exact.pixel(x, y)[c], 2);
    }
    const ShadowError e = compare(truth, verdicts.lit);
    char line[300];
    std::snprintf(line, sizeof line,
                  "coverage %ld facing %ld falsely_dark %ld falsely_dark_percent %.4f self %ld falsely_lit %ld "
                  "falsely_lit_percent %.4f error_percent %.4f rmse %.4f",
                  coverage, e.facing, e.falsely_dark, e.percent_dark(), self, e.falsely_lit, e.percent_lit(), e.percent(),
                  e.facing ? std::sqrt(squares / (3. * static_cast<double>(e.facing))) : 0.);
    return line;
}

ShadowError compare(const TruthImage& truth, std::span<const std::uint8_t> lit) {
    if (lit.size() != truth.pixel.size()) throw std::invalid_argument("verdicts and truth differ in size");
    ShadowError error;
    for (std::size_t i = 0; i < lit.size(); i++) {
        const bool truly_lit = truth.pixel[i] == Truth::lit;
        if (!truly_lit && truth.pixel[i] != Truth::shadowed) continue;
        error.facing++;
        if (truly_lit && !lit[i]) error.falsely_dark++;
        if (!truly_lit && lit[i]) error.falsely_lit++;
    }
    return error;
}
