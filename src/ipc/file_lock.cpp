// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/file_lock.hpp"

#include <fcntl.h>

#include <cerrno>

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

void unlock(const FileDescriptor& file) noexcept {
  struct flock lock = whole_file(F_UNLCK);
  ::fcntl(file.get(), F_OFD_SETLK, &lock);
}

bool is_locked_by_other(const FileDescriptor& file) noexcept {
  struct flock lock = whole_file(F_WRLCK);
  return ::fcntl(file.get(), F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

}  // namespace trifinger::ipc
