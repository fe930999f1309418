// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace trifinger::test {

/// Counts the `new` allocations of this thread while the counter lives. The test program must be
/// built with allocation_counter.cpp, which replaces `operator new`.
class AllocationCounter {
 public:
  AllocationCounter() noexcept : before_(total()) {}

  [[nodiscard]] std::size_t count() const noexcept { return total() - before_; }

 private:
  // Returns the number of allocations by this thread since it began.
  [[nodiscard]] static std::size_t total() noexcept;

  std::size_t before_;
};

}  // namespace trifinger::test
