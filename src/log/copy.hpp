// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "log/message_layout.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/records.hpp"

namespace trifinger::log {

/// Selects the part of a log that `copy` takes, and how it is written.
struct CopyOptions {
  /// The robot whose newest session gives the steps [first, last). From all other sessions, `copy`
  /// takes what happened at that time.
  std::string session;
  std::optional<TimeIndex> first{};
  std::optional<TimeIndex> last{};
  Precision precision{Precision::kDouble};
  mcap::Compression compression{mcap::Compression::kZstd};
};

/// Writes a part of `log`, or all of it, to the new file `copy`, with the sessions and documents
/// that belong to it. From companions, `copy` also takes the newest elements from before the part.
/// @throws InvalidArgument if nothing is left, SystemError; then there is no new file
void copy(const Log& log, const std::filesystem::path& copy, const CopyOptions& options = {});

}  // namespace trifinger::log
