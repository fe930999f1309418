// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "trifinger/log/log.hpp"

namespace trifinger::log {

/// The result of reading every byte of an MCAP file.
struct FileReport {
  std::uint64_t size{0};        ///< Size of the file [bytes].
  std::uint64_t messages{0};    ///< Number of readable messages.
  std::uint64_t lost_bytes{0};  ///< Number of bytes that could not be used.
  bool is_finished{false};      ///< The file has its summary at the end.
  std::vector<Damage> damage{};

  [[nodiscard]] bool is_whole() const noexcept {
    return is_finished && lost_bytes == 0 && damage.empty();
  }
};

/// Reads all of `file`, a log or any other MCAP file, and verifies everything that can be verified.
/// @throws mcap::FormatError if it is not an MCAP file, SystemError
[[nodiscard]] FileReport check(const std::filesystem::path& file);

/// Writes everything that can be read from `file` to the new file `whole`, which is finished and
/// has a summary. In a log, missing steps are recorded as gaps. Returns what is wrong with `file`.
/// @throws mcap::FormatError, SystemError; then there is no new file
FileReport recover(const std::filesystem::path& file, const std::filesystem::path& whole);

}  // namespace trifinger::log
