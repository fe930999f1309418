// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace trifinger {

/// Who has chosen the name of a file decides what may lie there.
enum class NamedBy : std::uint8_t {
  /// The user, for instance on the command line: the file may be anybody's, and links are followed.
  kUser,
  /// The program, in a folder that others can write: somebody else may have put a file of this name
  /// there. Links are refused, and so are files of strangers: neither ours nor the administrator's,
  /// nor shared with a group of ours.
  kProgram,
};

/// Opens the regular file `path` and returns its descriptor, which the caller owns. `flags` are
/// those of open(2); descriptors are not passed on to other programs. It never waits: FIFOs,
/// devices, folders and sockets are refused, whoever has named them.
/// @throws SystemError that says what was found
[[nodiscard]] int open_regular_file(const std::filesystem::path& path, int flags, NamedBy named_by,
                                    mode_t mode = 0);

/// A regular file that a user has named, to be read once from its beginning.
class FileReader {
 public:
  /// @throws SystemError that says what was found
  explicit FileReader(const std::filesystem::path& path);
  FileReader(const FileReader&) = delete;
  FileReader& operator=(const FileReader&) = delete;
  ~FileReader();

  /// Bytes that the file had when it was opened.
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  /// Reads the next bytes and returns their number; fewer than asked for only at the end.
  /// @throws SystemError
  [[nodiscard]] std::size_t read(std::span<char> bytes);
  /// Continues at `offset`.
  void seek(std::uint64_t offset) noexcept { offset_ = offset; }

 private:
  std::filesystem::path path_;
  int file_;
  std::uint64_t size_;
  std::uint64_t offset_{0};
};

/// What the system calls a user; its number if it has no name.
[[nodiscard]] std::string user_name(uid_t user);

/// The bytes of the regular file `path`, which a user has named.
/// @throws SystemError; its error_number() is EFBIG if there are more than `max_size`
[[nodiscard]] std::string read_file(const std::filesystem::path& path, std::size_t max_size);

/// Makes the new file `path` with these bytes. Nothing that is there already is touched.
/// @throws SystemError; its error_number() is EEXIST if there is something
void write_new_file(const std::filesystem::path& path, std::span<const std::byte> bytes);

}  // namespace trifinger
