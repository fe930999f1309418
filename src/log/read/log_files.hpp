// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "log/read/channel_reader.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::log::detail {

/// A file of a log.
struct LogFile {
  /// @throws mcap::FormatError if it is not a log or is one of a later version, SystemError
  explicit LogFile(const std::filesystem::path& its_path);
  [[nodiscard]] std::int64_t part() const;
  [[nodiscard]] std::string recording() const;
  [[nodiscard]] std::string created() const;
  /// Returns the date that orders recordings, as in the names of their files: it is later than
  /// those of all recordings that began before in its folder, even if the clock was set back.
  [[nodiscard]] std::string began() const;

  std::filesystem::path path;
  std::uint64_t size{0};
  mcap::Reader reader;
  std::map<std::string, std::string> origin;
  std::map<std::uint16_t, ChannelReader> channels;
  std::vector<ChannelReader*> channels_by_id;
  // The chunk that was read last.
  std::optional<std::size_t> loaded;
  std::span<const mcap::Message> messages;
};

/// What to do with files of several recordings.
enum class Several : std::uint8_t { kRefuse, kTakeNewest };

/// Opens the files of one recording and returns them in the order of the parts. Adds parts that are
/// missing or have no beginning to `damage`.
/// @throws mcap::FormatError if none is a log, InvalidArgument if they belong to several
/// recordings, SystemError
[[nodiscard]] std::vector<LogFile> open_parts(const std::vector<std::filesystem::path>& parts,
                                              Several several, std::vector<Damage>& damage);

/// Returns the damage of a file of `size` bytes.
[[nodiscard]] std::vector<Damage> damage_of(const std::filesystem::path& file, std::uint64_t size,
                                            const mcap::Contents& contents);
/// Returns the number of damaged bytes; each byte counts once. `damage` is all damage of one file.
[[nodiscard]] std::uint64_t lost_bytes_of(const std::vector<Damage>& damage, std::uint64_t size);

}  // namespace trifinger::log::detail
