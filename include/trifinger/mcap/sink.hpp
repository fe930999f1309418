// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::mcap {

/// Where a writer puts its bytes.
class Sink {
 public:
  virtual ~Sink() = default;

  /// Appends all of `bytes`, or throws and leaves the size as it was.
  /// @throws SystemError, as when the disk is full
  virtual void append(std::span<const std::byte> bytes) = 0;
  /// Makes what was appended survive a loss of power. @throws SystemError
  virtual void sync() = 0;
  /// Bytes appended so far, those that were there in the beginning included.
  [[nodiscard]] virtual std::uint64_t size() const noexcept = 0;
};

/// A file that nobody else may write meanwhile.
class FileSink final : public Sink {
 public:
  /// Makes the file. @throws SystemError, also if it exists
  [[nodiscard]] static FileSink create(const std::filesystem::path& path);
  /// Goes on at byte `size` of an existing file, the rest is cut off.
  /// @throws SystemError, InvalidArgument if another process writes it
  [[nodiscard]] static FileSink resume(const std::filesystem::path& path, std::uint64_t size);

  void append(std::span<const std::byte> bytes) override;
  void sync() override;
  [[nodiscard]] std::uint64_t size() const noexcept override { return size_; }

 private:
  FileSink(ipc::FileDescriptor file, std::uint64_t size) noexcept;

  ipc::FileDescriptor file_;
  std::uint64_t size_;
};

}  // namespace trifinger::mcap
