// chart.h: the report's figures as a table of commas and as a picture: error against time, both on logarithmic axes.
// It knows nothing of how they were measured.
#pragma once
#include <optional>
#include <string>
#include <vector>

struct Figures {  // of one method at one size
    std::string method;
    int size = 0;  // texels a side, 0 for a method without a buffer
    std::vector<std::string> arguments = {};               // that ask the program for it
    double acne = 0, leak = 0, error = 0;                  // falsely dark, falsely lit, both: % of the facing pixels
    double rmse = 0;                                       // of 255
    double depth_ms = 0, shade_ms = 0, total_ms = 0;       // medians
    long long bytes = 0;
    bool rival = true;      // whether it is a shadow method at all: only those are compared
    bool frontier = false;  // no rival is as good and as fast, and better in one of the two
    struct Prediction {
        double floor, coefficient, texel, boundary_per_area;  // %, 1, the scene's unit, one over it
        double predicted, measured, noise;                    // %; the noise is one standard deviation of the measured
    };
    std::optional<Prediction> prediction = {};
};

// Sets `frontier` by error and total_ms.
void mark_frontier(std::vector<Figures>& figures);

// A line of names, then a line for each, numbers with a point; empty where there is no prediction.
std::string csv(const std::vector<Figures>& figures);

// The rivals, methods in the order of their first figures; sizes along a line. Throws std::invalid_argument without
// any, and for a time that is not positive or an error that is negative.
std::string svg(std::vector<Figures> figures, const std::string& title, const std::string& subtitle);
