// peak.cpp: operator new and delete that keep count of what is held. A file of its own, so that they are never inlined
// by halves. Blocks are counted by the size that the allocator says they have, which is the size asked for or little
// more.
#include "peak.h"

#include <atomic>
#include <cstdlib>
#include <new>
#if defined(__APPLE__)
#include <malloc/malloc.h>
#else
#include <malloc.h>
#endif

namespace {

std::atomic<std::ptrdiff_t> held = 0, highest = 0, at_start = 0;

std::ptrdiff_t size_of(void* p) {
#if defined(__APPLE__)
    return static_cast<std::ptrdiff_t>(malloc_size(p));
#elif defined(_WIN32)
    return static_cast<std::ptrdiff_t>(_msize(p));
#else
    return static_cast<std::ptrdiff_t>(malloc_usable_size(p));
#endif
}

void* take(std::size_t n) {
    void* const p = std::malloc(n ? n : 1);
    if (!p) return nullptr;
    const std::ptrdiff_t now = held += size_of(p);
    for (std::ptrdiff_t seen = highest; seen < now && !highest.compare_exchange_weak(seen, now);) {}
    return p;
}

void give_back(void* p) {
    if (p) held -= size_of(p);
    std::free(p);
}

}  // namespace

void start_peak() { highest = at_start = held.load(); }
std::size_t peak_bytes() { return static_cast<std::size_t>(highest - at_start); }

void* operator new(std::size_t n) {
    if (void* const p = take(n)) return p;
    throw std::bad_alloc();
}
void* operator new(std::size_t n, const std::nothrow_t&) noexcept { return take(n); }
void* operator new[](std::size_t n) { return operator new(n); }  // else a sanitizer has its own
void* operator new[](std::size_t n, const std::nothrow_t&) noexcept { return take(n); }
void operator delete(void* p) noexcept { give_back(p); }
void operator delete(void* p, std::size_t) noexcept { give_back(p); }
void operator delete(void* p, const std::nothrow_t&) noexcept { give_back(p); }
void operator delete[](void* p) noexcept { give_back(p); }
void operator delete[](void* p, std::size_t) noexcept { give_back(p); }
void operator delete[](void* p, const std::nothrow_t&) noexcept { give_back(p); }
