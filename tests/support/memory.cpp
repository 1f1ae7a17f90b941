// memory.cpp: operator new and delete that count. A file of its own, so that they are never inlined by halves.
#include "memory.h"

#include <atomic>
#include <cstdlib>
#include <new>

static std::atomic<std::size_t> total = 0;

std::size_t bytes_asked_for() { return total; }

void* operator new(std::size_t n) {
    total += n;
    if (void* const p = std::malloc(n ? n : 1)) return p;
    throw std::bad_alloc();
}
void* operator new(std::size_t n, const std::nothrow_t&) noexcept {
    total += n;
    return std::malloc(n ? n : 1);
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, const std::nothrow_t&) noexcept { std::free(p); }
