// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <utility>

namespace trifinger::ipc {

/// Owns a file descriptor. Forked children close it at once. A child that kept it would keep the
/// locks on the file after the death of its parent.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  /// Owns the descriptor that `open` returns. The descriptor must have O_CLOEXEC. A negative value
  /// means that there is none, and errno is as `open` has left it. No fork can happen between
  /// opening and owning.
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
