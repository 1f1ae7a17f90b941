// memory.h: how much memory a program has asked for, so that a test can hold the reader of a file to its bound.
#pragma once
#include <cstddef>

// All bytes that operator new was asked for since the program began, freed since or not.
std::size_t bytes_asked_for();
