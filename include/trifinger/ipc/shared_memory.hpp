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

/// A file mapped into memory. Should another process truncate the file, the lost pages read as
/// zeros and `is_damaged()` turns true; nobody crashes.
class SharedMemory {
 public:
  /// Makes `size` bytes of zeros that no other process can find by a name.
  /// @throws SystemError
  [[nodiscard]] static SharedMemory create_anonymous(std::size_t size);

  /// Makes a file with `size` bytes of zeros in `folder`, not visible under `name` before
  /// `publish()`; before and after that it has a hidden name, as long as this object lives. All its
  /// pages are there, or this throws: a full disk cannot surprise anyone later.
  /// @throws SystemError
  [[nodiscard]] static SharedMemory create_file(const std::filesystem::path& folder,
                                                const std::string& name, std::size_t size,
                                                unsigned mode);

  /// Maps the whole of an existing file. Never waits: see NamedBy::kProgram for what is refused.
  /// @throws SystemError; its error_number() is ENOENT if there is none, EACCES if it may not be
  /// opened.
  [[nodiscard]] static SharedMemory open(const std::filesystem::path& path, Access access);

  /// Another mapping of the same memory with a file description, and so locks, of its own.
  [[nodiscard]] SharedMemory reopen(Access access) const;

  SharedMemory(SharedMemory&&) noexcept;
  SharedMemory& operator=(SharedMemory&&) noexcept;
  ~SharedMemory();

  /// Gives up the mapping of a file that was made here, and keeps its memory for `make_anew`.
  void retire() noexcept;
  /// Makes a new file of a retired one: zeros that can be found under `name` after `publish()`.
  /// False if others still have the old one mapped, or if somebody has cut it off or removed it.
  /// @throws SystemError
  [[nodiscard]] bool make_anew(const std::string& name, unsigned mode);

  /// Gives the file its name, replacing an older file of that name in one step.
  void publish();
  /// Gives the file its name unless there is one of that name already; false in that case.
  [[nodiscard]] bool publish_if_absent();

  [[nodiscard]] std::byte* data() const noexcept { return data_; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] const FileDescriptor& file() const noexcept { return file_; }
  /// Where the file is, empty for anonymous memory.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] bool is_damaged() const noexcept;
  /// False once the file was removed or replaced by another of its name; anonymous memory has none
  /// to lose. Two system calls.
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
