// peak.h: the most memory that was held at one time between two points of a program. What is freed counts no more.
#pragma once
#include <cstddef>

void start_peak();         // from here on
std::size_t peak_bytes();  // the most that was held of what operator new has given out since
