// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

namespace trifinger::ipc {

/// Names a process for good: process numbers are used again, start times are not.
struct ProcessIdentity {
  std::int64_t pid{0};
  std::uint64_t start_time{0};  ///< Clock ticks since boot, as in /proc/PID/stat.
  /// Numbers are those of a namespace: each container counts its own. 0: not known.
  std::uint64_t number_space{0};

  [[nodiscard]] static ProcessIdentity of_this_process() noexcept;
  /// Who has the number `pid` now, in our namespace.
  [[nodiscard]] static ProcessIdentity of(std::int64_t pid) noexcept;
  /// True if the process still runs (a zombie does not).
  [[nodiscard]] bool is_alive() const noexcept;
  /// True if it is certain that the process has ended. What is not certain is false: the process of
  /// another container, one that this user may not see, an identity that makes no sense. A few
  /// system calls, no memory from the heap.
  [[nodiscard]] bool is_known_dead() const noexcept;

  /// True if the process is gone, or a kill is under way that it cannot escape: the kernel still
  /// takes its memory apart, and gives its locks back only then.
  [[nodiscard]] bool is_ending() const noexcept;

  friend bool operator==(const ProcessIdentity&, const ProcessIdentity&) = default;
};

/// "python3 (process 4711)", or "process 4711" once it is gone.
[[nodiscard]] std::string describe(const ProcessIdentity& process);

}  // namespace trifinger::ipc
