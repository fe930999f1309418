// SPDX-License-Identifier: BSD-3-Clause
#include "support/malloc_counter.hpp"

namespace trifinger::test {
namespace {

thread_local std::size_t malloc_count = 0;

}  // namespace

std::size_t MallocCounter::total() noexcept { return malloc_count; }

}  // namespace trifinger::test

#if defined(__has_feature)
#define TRIFINGER_HAS_SANITIZER __has_feature(address_sanitizer)
#elif defined(__SANITIZE_ADDRESS__)
#define TRIFINGER_HAS_SANITIZER 1
#else
#define TRIFINGER_HAS_SANITIZER 0
#endif

#if !TRIFINGER_HAS_SANITIZER
extern "C" void* malloc_of_libc(std::size_t size) __asm__("__libc_malloc");

extern "C" void* malloc(std::size_t size) {
  ++trifinger::test::malloc_count;
  return malloc_of_libc(size);
}
#endif
