// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/ipc/file_descriptor.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger::ipc {

// Open-file-description locks: they end with their holder, however it ends, and are not lost when
// the holder closes some other descriptor of the same file, as POSIX locks are.

/// What a lock stands for: each is of a byte of its own.
enum class Lock : off_t {
  kOwner = 0,  ///< The file belongs to its holder.
  kClaim = 1,  ///< Its holder looks whose the file is, and may take it.
  kUse = 2,    ///< Its holders have the file mapped.
};

/// Takes the exclusive lock of the file, for as long as the descriptor is open. False if another
/// descriptor holds it. @throws SystemError
[[nodiscard]] bool try_lock(const FileDescriptor& file, Lock lock = Lock::kOwner);

/// Takes the lock together with others who share it. False if another descriptor holds it alone.
/// @throws SystemError
[[nodiscard]] bool try_share(const FileDescriptor& file, Lock lock);

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
void unlock(const FileDescriptor& file, Lock lock = Lock::kOwner) noexcept;

/// True if a descriptor other than `file` holds the lock. Needs no write permission. One system
/// call.
[[nodiscard]] bool is_locked_by_other(const FileDescriptor& file,
                                      Lock lock = Lock::kOwner) noexcept;

/// The processes that own the file `path`, oldest first, as far as this user may see: those of
/// others are hidden from ordinary users. Also finds who owns a file of this name that was removed.
[[nodiscard]] std::vector<ProcessIdentity> owners_of(const std::filesystem::path& path);

}  // namespace trifinger::ipc
