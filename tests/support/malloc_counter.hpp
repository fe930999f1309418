// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace trifinger::test {

/// Counts the `malloc` allocations of this thread while the counter lives. Eigen allocates that
/// way, which an AllocationCounter does not see. The test program must be built with
/// malloc_counter.cpp, which replaces `malloc`, and without a sanitizer, because that has its own
/// `malloc`.
class MallocCounter {
 public:
  MallocCounter() noexcept : before_(total()) {}

  [[nodiscard]] std::size_t count() const noexcept { return total() - before_; }

 private:
  // Returns the number of allocations by this thread since it began.
  [[nodiscard]] static std::size_t total() noexcept;

  std::size_t before_;
};

}  // namespace trifinger::test
