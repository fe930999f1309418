// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>

#include "trifinger/base/time.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::ipc {

// Open-file-description locks: they end with their holder, however it ends, and are not lost when
// the holder closes some other descriptor of the same file, as POSIX locks are.

/// Takes the exclusive lock of the file, for as long as the descriptor is open. False if another
/// descriptor holds it. @throws SystemError
[[nodiscard]] bool try_lock(const FileDescriptor& file);

/// For whoever was refused a lock and asks again: a holder that is killed has the lock until the
/// kernel has taken its memory apart, which lasts a while.
class LockPatience {
 public:
  /// Sleeps for some milliseconds. False if it makes no sense to try again: the holder lives, or
  /// has been ending for 10 s. `holder_is_ending`: see `ProcessIdentity::is_ending`.
  [[nodiscard]] bool wait(bool holder_is_ending) const;

 private:
  Instant begin_{std::chrono::steady_clock::now()};
};

/// Gives the lock back.
void unlock(const FileDescriptor& file) noexcept;

/// True if a descriptor other than `file` holds the lock. Needs no write permission. One system
/// call.
[[nodiscard]] bool is_locked_by_other(const FileDescriptor& file) noexcept;

}  // namespace trifinger::ipc
