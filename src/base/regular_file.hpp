// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace trifinger {

/// Who chose the name of a file. This decides which files are accepted.
enum class NamedBy : std::uint8_t {
  /// The user chose it, for instance on the command line. The file may belong to anybody, and links
  /// are followed.
  kUser,
  /// The program chose it, in a folder where others can write, so somebody else may have put a file
  /// of this name there. Links are refused. A file is accepted only if it belongs to us or to the
  /// administrator, or if it is shared with one of our groups.
  kProgram,
};

/// Opens the regular file `path` and returns its descriptor, which the caller owns. `flags` are
/// those of open(2). Other programs do not inherit the descriptor. This never waits: FIFOs,
/// devices, folders and sockets are refused, whoever has named them.
/// @throws SystemError that says what was found
[[nodiscard]] int open_regular_file(const std::filesystem::path& path, int flags, NamedBy named_by,
                                    mode_t mode = 0);

/// Reads bytes from `offset` on and returns their number. It is smaller than requested only at the
/// end of the file `path`, whose descriptor is `file`.
/// @throws SystemError
[[nodiscard]] std::size_t read_at(int file, std::uint64_t offset, std::span<std::byte> bytes,
                                  const std::filesystem::path& path);

/// A regular file that a user has named. It is read once from its beginning.
class FileReader {
 public:
  /// @throws SystemError that says what was found
  explicit FileReader(const std::filesystem::path& path);
  FileReader(const FileReader&) = delete;
  FileReader& operator=(const FileReader&) = delete;
  ~FileReader();

  /// Size of the file when it was opened [bytes].
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  /// Reads the next bytes and returns their number. It is smaller than requested only at the end.
  /// @throws SystemError
  [[nodiscard]] std::size_t read(std::span<char> bytes);
  /// Continues reading at `offset`.
  void seek(std::uint64_t offset) noexcept { offset_ = offset; }

 private:
  std::filesystem::path path_;
  int file_;
  std::uint64_t size_;
  std::uint64_t offset_{0};
};

/// Login name of a user; the user's number if it has no name.
[[nodiscard]] std::string user_name(uid_t user);

/// Returns the bytes of the regular file `path`, which a user has named.
/// @throws SystemError; its error_number() is EFBIG if the file has more than `max_size` bytes
[[nodiscard]] std::string read_file(const std::filesystem::path& path, std::size_t max_size);

/// Creates the file `path` with these bytes. An existing file is left unchanged.
/// @throws SystemError; its error_number() is EEXIST if `path` exists already
void write_new_file(const std::filesystem::path& path, std::span<const std::byte> bytes);

/// Gives the file `path` these bytes; it is made if it does not exist, and keeps its mode if it
/// does. Whatever kills the program or the machine, the file then has the old bytes or the new
/// ones; a file that alone is mounted, as in containers, is written in place. Its folder must
/// exist.
/// @throws SystemError
void replace_file(const std::filesystem::path& path, std::span<const std::byte> bytes);

}  // namespace trifinger
