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

// Open-file-description locks. They end with their holder, however it ends. Unlike POSIX locks they
// are not lost when the holder closes another descriptor of the file.

/// What a lock means. Each lock covers a byte of its own.
enum class Lock : off_t {
  kOwner = 0,  ///< The holder owns the file.
  kClaim = 1,  ///< The holder alone may take, replace or remove the file.
  kUse = 2,    ///< The holders have the file mapped.
  kJob = 3,    ///< The holder runs a job of a user on the robot of a lock file.
};

/// Takes the exclusive lock of the file, as long as the descriptor is open. False if another
/// descriptor holds the lock. @throws SystemError
[[nodiscard]] bool try_lock(const FileDescriptor& file, Lock lock = Lock::kOwner);

/// Takes the lock together with others who share it. False if another descriptor holds it
/// exclusively. @throws SystemError
[[nodiscard]] bool try_share(const FileDescriptor& file, Lock lock);

/// Limits how long a process that was refused a lock asks for it again. A killed holder keeps its
/// lock until the kernel has released its memory, which takes a while.
class LockTimeout {
 public:
  /// Sleeps for some milliseconds. False if another try makes no sense: the holder lives, or has
  /// been ending for 10 s. For `holder_is_ending` see `ProcessIdentity::is_ending`.
  [[nodiscard]] bool wait(bool holder_is_ending) const;

 private:
  Instant begin_{std::chrono::steady_clock::now()};
};

/// Gives the lock back.
void unlock(const FileDescriptor& file, Lock lock = Lock::kOwner) noexcept;

/// True if `path` leads to the open file: it was neither removed nor replaced.
[[nodiscard]] bool is_named(const FileDescriptor& file, const std::filesystem::path& path) noexcept;

/// Opens the lock file `path`, or makes it, for this user alone. @throws SystemError
[[nodiscard]] FileDescriptor open_lock_file(const std::filesystem::path& path);

/// Removes the lock file `path` unless another process owns it or has a turn. A file that stayed
/// would shut out all other users. False if another process has the claim. Whoever opens a lock
/// file must therefore take `kClaim` first, then ask `is_named`, and open it again if it is not.
bool remove_lock_file(const FileDescriptor& file, const std::filesystem::path& path) noexcept;

/// Ends the use of the lock file `path`: gives its locks back and removes it as above.
void leave_lock_file(const FileDescriptor& file, const std::filesystem::path& path) noexcept;

/// True if a process owns the file `path`. The kernel tells this to everybody, also to those who
/// may not open the file. True if the kernel does not tell.
[[nodiscard]] bool is_owned(const std::filesystem::path& path);

/// True if a descriptor other than `file` holds the lock. The call needs no write permission and
/// makes one system call.
[[nodiscard]] bool is_locked_by_other(const FileDescriptor& file,
                                      Lock lock = Lock::kOwner) noexcept;

/// The processes that own the file `path`, oldest first, as far as this user may see them. The
/// system hides other users' processes from ordinary users. The result includes owners of a file of
/// this name that was removed.
[[nodiscard]] std::vector<ProcessIdentity> owners_of(const std::filesystem::path& path);

}  // namespace trifinger::ipc
