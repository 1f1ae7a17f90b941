// stiffness.h: the error of the program, and of the classic route where there is one, as a scene gets stiffer: farther
// from the origin, more grazing, larger, smaller, nearer. The report's second table. Whether each case has the outcome
// that it should have is the business of stiff_test.
#pragma once
#include "run.h"

struct StiffRow {
    std::string family;   // what grows
    std::string measure;  // what is off, and its unit
    double bearable;      // ... and how much of it is no fault
    double stiffness, error;
};

// Runs the program on scenes made for it, and computes matrices in float, double and long double.
std::vector<StiffRow> measure_stiffness(const Program& umbra);

// A line of names, then a line for each.
std::string csv(const std::vector<StiffRow>& rows);
