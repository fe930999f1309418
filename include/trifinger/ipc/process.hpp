// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

namespace trifinger::ipc {

/// Identifies a process uniquely: the system reuses process numbers, but not start times.
struct ProcessIdentity {
  std::int64_t pid{0};
  std::uint64_t start_time{0};  ///< Clock ticks since boot, from /proc/PID/stat.
  /// The namespace of the number, since each container counts its own. 0: not known.
  std::uint64_t number_space{0};

  [[nodiscard]] static ProcessIdentity of_this_process() noexcept;
  /// The process that now has the number `pid` in our namespace.
  [[nodiscard]] static ProcessIdentity of(std::int64_t pid) noexcept;
  /// True if the process still runs (a zombie does not).
  [[nodiscard]] bool is_alive() const noexcept;
  /// True if the process has certainly ended. False if this is uncertain: for a process of another
  /// container, a process that this user may not see, or an identity that makes no sense. Needs a
  /// few system calls and no memory from the heap.
  [[nodiscard]] bool is_known_dead() const noexcept;

  /// True if the process is gone or is being killed and cannot escape. While the kernel still
  /// releases its memory, the process keeps its locks.
  [[nodiscard]] bool is_ending() const noexcept;

  friend bool operator==(const ProcessIdentity&, const ProcessIdentity&) = default;
};

/// For example "python3 (process 4711)"; "process 4711" after the process has ended.
[[nodiscard]] std::string describe(const ProcessIdentity& process);

}  // namespace trifinger::ipc
