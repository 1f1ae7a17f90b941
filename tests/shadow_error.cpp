// shadow_error.cpp: the line that `umbra --report` prints.
#include "shadow_error.h"

std::string report_line(const TruthImage& truth, const Verdicts& verdicts, const TGAImage& picture, const TGAImage& exact) {
    const ShadowError e = compare(truth, verdicts.lit);
    long self = 0, covered = 0;
    double squares = 0;
    for (std::size_t i = 0; i < truth.pixel.size(); i++) {
        self += truth.pixel[i] == Truth::lit && !verdicts.lit[i] && verdicts.cause[i] == 1;
        if (truth.pixel[i] == Truth::background) continue;
        covered++;
        const int x = static_cast<int>(i) % truth.width, y = static_cast<int>(i) / truth.width;
        for (int c = 0; c < 3; c++) squares += std::pow(picture.pixel(x, y)[c] - exact.pixel(x, y)[c], 2);
    }
    char line[256];
    std::snprintf(line, sizeof line,
                  "facing %ld falsely_dark %ld falsely_dark_percent %.4f self %ld falsely_lit %ld falsely_lit_percent %.4f "
                  "error_percent %.4f rmse %.4f",
                  e.facing, e.falsely_dark, e.percent_dark(), self, e.falsely_lit, e.percent_lit(), e.percent(),
                  covered ? std::sqrt(squares / (3. * static_cast<double>(covered))) : 0.);
    return line;
}
