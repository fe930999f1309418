// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::mcap {

/// The destination of a writer's bytes.
class Sink {
 public:
  virtual ~Sink() = default;

  /// Appends all of `bytes`. If it throws, the size is unchanged.
  /// @throws SystemError, for example when the disk is full
  virtual void append(std::span<const std::byte> bytes) = 0;
  /// Makes the appended bytes survive a loss of power. @throws SystemError
  virtual void sync() = 0;
  /// Size in bytes, including what was there at the beginning.
  [[nodiscard]] virtual std::uint64_t size() const noexcept = 0;
};

/// A file that only this process may write as long as the object lives.
class FileSink final : public Sink {
 public:
  /// Makes the file. @throws SystemError, also if it exists already
  [[nodiscard]] static FileSink create(const std::filesystem::path& path);
  /// Continues at byte `size` of an existing file and cuts off the rest.
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
