// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>

namespace trifinger::ipc {

/// Owns a file descriptor. It is closed in forked children at once: a child that kept it would keep
/// the locks on the file alive after the death of its parent.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  /// Takes ownership of `fd`, which must have been opened with O_CLOEXEC.
  explicit FileDescriptor(int fd);
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~FileDescriptor();

  [[nodiscard]] int get() const noexcept { return fd_; }
  explicit operator bool() const noexcept { return fd_ >= 0; }

 private:
  int fd_{-1};
};

}  // namespace trifinger::ipc
