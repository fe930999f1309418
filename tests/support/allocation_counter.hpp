// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>

// Replaces the program's operator new: include it in one source file of a test program, not in two.

namespace trifinger::test {

/// Counts what this thread takes from the heap by `new` while the counter lives.
class AllocationCounter {
 public:
  AllocationCounter() noexcept : before_(total()) {}

  [[nodiscard]] std::size_t count() const noexcept { return total() - before_; }

  static std::size_t& total() noexcept {
    thread_local std::size_t count = 0;
    return count;
  }

 private:
  std::size_t before_;
};

namespace detail {

inline void* allocate(std::size_t size, std::size_t alignment) {
  ++AllocationCounter::total();
  // aligned_alloc wants a multiple of the alignment, and at least one.
  const std::size_t rounded = (size + alignment - 1) / alignment * alignment;
  void* memory = std::aligned_alloc(alignment, rounded == 0 ? alignment : rounded);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace detail
}  // namespace trifinger::test

// The array and nothrow forms call these.
void* operator new(std::size_t size) {
  return trifinger::test::detail::allocate(size, __STDCPP_DEFAULT_NEW_ALIGNMENT__);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return trifinger::test::detail::allocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
