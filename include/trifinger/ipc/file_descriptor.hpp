// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <utility>

namespace trifinger::ipc {

/// Owns a file descriptor. It is closed in forked children at once: a child that kept it would keep
/// the locks on the file alive after the death of its parent.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  /// Owns what `open` returns, which must have O_CLOEXEC; negative for nothing, with errno as
  /// `open` has left it. No fork comes between opening and owning.
  explicit FileDescriptor(const std::function<int()>& open);
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
