// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::log {

/// What a look at every byte of an MCAP file has found.
struct FileReport {
  std::uint64_t size{0};        ///< Of the file [bytes].
  std::uint64_t messages{0};    ///< That could be read.
  std::uint64_t lost_bytes{0};  ///< That could not be used.
  bool is_finished{false};      ///< The summary at the end is there.
  std::vector<Damage> damage{};

  [[nodiscard]] bool is_whole() const noexcept {
    return is_finished && lost_bytes == 0 && damage.empty();
  }
};

/// Reads all of `file`, a log or any other MCAP file, and trusts nothing that can be checked.
/// @throws mcap::FormatError if it is no MCAP file, SystemError
[[nodiscard]] FileReport check(const std::filesystem::path& file);

/// Writes all that can be read of `file` to the new file `whole`: finished, with a summary, and in
/// a log with what is missing written down as gaps. Says what is wrong with `file`.
/// @throws mcap::FormatError, SystemError; then there is no new file
FileReport recover(const std::filesystem::path& file, const std::filesystem::path& whole);

/// Which part of a log `copy` takes, and how it is written.
struct CopyOptions {
  /// Of this robot's newest session the steps [first, last), of all others what was at that time.
  std::string session;
  std::optional<TimeIndex> first{};
  std::optional<TimeIndex> last{};
  Precision precision{Precision::kDouble};
  mcap::Compression compression{mcap::Compression::kZstd};
};

/// Writes a part of `log`, or all of it, to the new file `copy`, with the sessions and documents
/// that belong to it. Of companions, the newest elements from before the part come along.
/// @throws InvalidArgument if nothing is left, SystemError; then there is no new file
void copy(const Log& log, const std::filesystem::path& copy, const CopyOptions& options = {});

}  // namespace trifinger::log
