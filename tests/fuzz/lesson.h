// lesson.h: main.cpp as a header, so that a fuzzer can call its functions one by one. Its main() is renamed.
#pragma once
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wreturn-type"  // only main() itself may end without a return
#endif
#define main umbra_main
#include "../../main.cpp"
#undef main
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif
