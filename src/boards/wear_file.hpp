// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "trifinger/core/description.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::boards {

/// The running hours of a robot in a file, which is whole after any kill, at any instant.
///
/// Each record is a line in JSON with all numbers and a checksum. Records are appended and synced;
/// the newest whole one counts. When the file has more than 1 MiB, a new file with one record
/// takes its place.
class WearFile {
 public:
  /// What a file of running hours belongs to.
  struct Owner {
    std::string robot;  ///< Name of the robot.
    std::string type;   ///< Type of the element, such as "trifinger_wear".
  };

  /// Reads the newest record. `element` describes a `Wear`. The file is made by the first `append`.
  /// A file without a whole record is renamed to `path`.damaged.
  /// @throws SystemError that says what lies at `path`, InvalidArgument if the file belongs to
  /// another robot or another process, config::ConfigError if its numbers are not those of
  /// `element`
  WearFile(std::filesystem::path path, Owner owner, ElementDescription element);

  /// The newest record when the file was opened, as an element; empty if there was none.
  [[nodiscard]] const std::vector<std::byte>& newest() const noexcept { return newest_; }
  /// Says that a damaged file was renamed; otherwise empty.
  [[nodiscard]] const std::string& damage() const noexcept { return damage_; }

  /// Appends a record, which is safe when this returns. After an error the file is as before, or
  /// ends in a part of the record, which nobody reads; try again later.
  /// @throws SystemError
  void append(std::span<const std::byte> element);

 private:
  void open();
  [[nodiscard]] std::string read_end() const;
  [[nodiscard]] std::vector<std::byte> parse(const std::string& line) const;
  [[nodiscard]] std::string line_of(std::span<const std::byte> element) const;
  // Puts a file with this one record in the place of the file.
  void replace_by(const std::string& line);
  void write(const ipc::FileDescriptor& file, std::string_view text) const;

  std::filesystem::path path_;
  Owner owner_;
  ElementDescription element_;
  ipc::FileDescriptor file_;  // locked; empty until there is a file
  std::vector<std::byte> newest_;
  std::string damage_;
};

}  // namespace trifinger::boards
