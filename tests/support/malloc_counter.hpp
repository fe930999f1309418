// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace trifinger::test {

/// Counts what this thread takes from the heap by `malloc` while the counter lives, as Eigen does,
/// which an AllocationCounter does not see. The test program must be built with malloc_counter.cpp,
/// which replaces `malloc`, and without a sanitizer, which has one of its own.
class MallocCounter {
 public:
  MallocCounter() noexcept : before_(total()) {}

  [[nodiscard]] std::size_t count() const noexcept { return total() - before_; }

 private:
  // What this thread has taken since it began.
  [[nodiscard]] static std::size_t total() noexcept;

  std::size_t before_;
};

}  // namespace trifinger::test
