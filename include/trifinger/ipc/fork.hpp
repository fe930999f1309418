// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace trifinger::ipc {

/// Number of forks between the start of the program and this process.
[[nodiscard]] std::uint64_t fork_generation() noexcept;

/// A member of handles that a forked child must neither use nor clean up.
class ForkGuard {
 public:
  /// True in a child that was forked after the guard was made.
  [[nodiscard]] bool is_inherited() const noexcept { return fork_generation() != generation_; }

 private:
  std::uint64_t generation_{fork_generation()};
};

}  // namespace trifinger::ipc
