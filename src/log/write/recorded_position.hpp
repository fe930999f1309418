// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "trifinger/base/time.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::log::detail {

// The position up to which an earlier recorder has recorded a session.
struct RecordedPosition {
  std::filesystem::path file;  // the newest file that knows the session
  TimeIndex next_step{0};
  std::map<std::string, TimeIndex> next_elements;  // by companion
  std::int64_t time_offset{0};
  bool has_end{false};    // y_N and its status are in the log
  bool is_closed{false};  // the log has everything, including the end
};

// Finds the position in one file; nothing if the file does not know the session.
[[nodiscard]] std::optional<RecordedPosition> find_position(mcap::Reader& reader,
                                                            const std::string& robot,
                                                            std::uint64_t session_id);

}  // namespace trifinger::log::detail
