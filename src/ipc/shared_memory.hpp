// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "trifinger/ipc/file_descriptor.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger::ipc {

enum class Access : std::uint8_t { kReadOnly, kReadWrite };

/// A file mapped into memory. If another process truncates the file, nobody crashes: the lost pages
/// read as zeros and `is_damaged()` becomes true.
class SharedMemory {
 public:
  /// Makes `size` bytes of zeros. They have no name by which another process could find them.
  /// @throws SystemError
  [[nodiscard]] static SharedMemory create_anonymous(std::size_t size);

  /// Makes a file with `size` bytes of zeros in `folder`. It appears under `name` only after
  /// `publish()`. It also has a hidden name as long as this object lives. All its pages are
  /// allocated now, so a full disk cannot cause an error later.
  /// @throws SystemError
  [[nodiscard]] static SharedMemory create_file(const std::filesystem::path& folder,
                                                const std::string& name, std::size_t size,
                                                unsigned mode);

  /// Maps the whole of an existing file. It never waits: see NamedBy::kProgram for the files that
  /// it refuses.
  /// @throws SystemError; its error_number() is ENOENT if the file does not exist, EACCES if this
  /// user may not open it.
  [[nodiscard]] static SharedMemory open(const std::filesystem::path& path, Access access);

  /// Maps the same memory again, with its own file description and therefore its own locks.
  [[nodiscard]] SharedMemory reopen(Access access) const;

  SharedMemory(SharedMemory&&) noexcept;
  SharedMemory& operator=(SharedMemory&&) noexcept;
  ~SharedMemory();

  /// Unmaps a file that was made here, and keeps its memory for `make_anew`.
  void retire() noexcept;
  /// Makes a new file from a retired one: zeros that can be found under `name` after `publish()`.
  /// False if others still have the old file mapped, or if somebody has truncated or removed it.
  /// @throws SystemError
  [[nodiscard]] bool make_anew(const std::string& name, unsigned mode);

  /// Gives the file its name and replaces an older file of that name in one step.
  void publish();
  /// Gives the file its name. False if a file of that name exists already.
  [[nodiscard]] bool publish_if_absent();

  [[nodiscard]] std::byte* data() const noexcept { return data_; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] const FileDescriptor& file() const noexcept { return file_; }
  /// Path of the file; empty for anonymous memory.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] bool is_damaged() const noexcept;
  /// False after the file was removed or replaced by another one of its name. Always true for
  /// anonymous memory. Needs two system calls.
  [[nodiscard]] bool has_name() const noexcept;

 private:
  SharedMemory() = default;
  void map(Access access);
  void unmap() noexcept;
  void set_mode(unsigned mode);

  FileDescriptor file_;
  std::filesystem::path path_;
  std::filesystem::path hidden_path_;
  std::byte* data_{nullptr};
  std::size_t size_{0};
  int guard_{-1};  // entry in the table of the SIGBUS handler
  ForkGuard fork_;
};

}  // namespace trifinger::ipc
