// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/file_lock.hpp"

#include <fcntl.h>

#include <cerrno>
#include <thread>

#include "trifinger/base/error.hpp"

namespace trifinger::ipc {
namespace {

struct flock whole_file(short type) noexcept {
  struct flock lock{};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  return lock;
}

}  // namespace

bool try_lock(const FileDescriptor& file) {
  struct flock lock = whole_file(F_WRLCK);
  if (::fcntl(file.get(), F_OFD_SETLK, &lock) == 0) return true;
  if (errno == EAGAIN || errno == EACCES) return false;
  throw SystemError("lock a session file", errno);
}

bool LockPatience::wait(bool holder_is_ending) const {
  constexpr Nanoseconds kLook = std::chrono::milliseconds(5);
  // There is an instant in which a kill is no longer pending and not yet seen otherwise.
  constexpr Nanoseconds kDoubt = std::chrono::milliseconds(100);
  constexpr Nanoseconds kLongest = std::chrono::seconds(10);
  const Nanoseconds waited = std::chrono::steady_clock::now() - begin_;
  if (waited >= (holder_is_ending ? kLongest : kDoubt)) return false;
  std::this_thread::sleep_for(kLook);
  return true;
}

void unlock(const FileDescriptor& file) noexcept {
  struct flock lock = whole_file(F_UNLCK);
  ::fcntl(file.get(), F_OFD_SETLK, &lock);
}

bool is_locked_by_other(const FileDescriptor& file) noexcept {
  struct flock lock = whole_file(F_WRLCK);
  return ::fcntl(file.get(), F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

}  // namespace trifinger::ipc
