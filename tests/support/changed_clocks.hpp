// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>

namespace trifinger::test {

/// Sets this program's clocks, as an operator, NTP or a suspended machine would: a program that is
/// linked with changed_clocks.cpp asks that for the time. They are right again behind its life.
class ChangedClocks {
 public:
  ChangedClocks() = default;
  ChangedClocks(const ChangedClocks&) = delete;
  ChangedClocks& operator=(const ChangedClocks&) = delete;
  ~ChangedClocks();

  /// How far the clock on the wall shall be ahead of the right one.
  void set_wall_ahead(std::chrono::seconds ahead) noexcept;
  /// For how long the machine shall have been suspended, which its monotonic clock does not count.
  void set_suspended(std::chrono::seconds time) noexcept;

  /// True if the standard library asks us for the time.
  [[nodiscard]] bool work() noexcept;
};

}  // namespace trifinger::test
