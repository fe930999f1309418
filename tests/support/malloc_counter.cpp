// SPDX-License-Identifier: BSD-3-Clause
#include "support/malloc_counter.hpp"

namespace trifinger::test {
namespace {

thread_local std::size_t malloc_count = 0;

}  // namespace

std::size_t MallocCounter::total() noexcept { return malloc_count; }

}  // namespace trifinger::test

extern "C" void* malloc_of_libc(std::size_t size) __asm__("__libc_malloc");

extern "C" void* malloc(std::size_t size) {
  ++trifinger::test::malloc_count;
  return malloc_of_libc(size);
}
