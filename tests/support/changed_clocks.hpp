// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>

namespace trifinger::test {

/// Sets this program's clocks, like an operator, NTP or a suspended machine would. A program that
/// is linked with changed_clocks.cpp asks it for the time. The clocks are right again after this
/// object's life.
class ChangedClocks {
 public:
  ChangedClocks() = default;
  ChangedClocks(const ChangedClocks&) = delete;
  ChangedClocks& operator=(const ChangedClocks&) = delete;
  ~ChangedClocks();

  /// Sets how far the wall clock is ahead of the right time.
  void set_wall_ahead(std::chrono::seconds ahead) noexcept;
  /// Sets for how long the machine was suspended. Its monotonic clock does not count that time.
  void set_suspended(std::chrono::seconds time) noexcept;

  /// True if the standard library uses our clocks.
  [[nodiscard]] bool work() noexcept;
};

}  // namespace trifinger::test
