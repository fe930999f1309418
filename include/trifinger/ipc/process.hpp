// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

namespace trifinger::ipc {

/// Names a process for good: process numbers are used again, start times are not.
struct ProcessIdentity {
  std::int64_t pid{0};
  std::uint64_t start_time{0};  ///< Clock ticks since boot, as in /proc/PID/stat.

  [[nodiscard]] static ProcessIdentity of_this_process() noexcept;
  /// True if the process still runs (a zombie does not).
  [[nodiscard]] bool is_alive() const noexcept;

  /// True if the process is gone, or a kill is under way that it cannot escape: the kernel still
  /// takes its memory apart, and gives its locks back only then.
  [[nodiscard]] bool is_ending() const noexcept;

  friend bool operator==(const ProcessIdentity&, const ProcessIdentity&) = default;
};

/// "python3 (process 4711)", or "process 4711" once it is gone.
[[nodiscard]] std::string describe(const ProcessIdentity& process);

}  // namespace trifinger::ipc
