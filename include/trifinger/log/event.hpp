// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

namespace trifinger::log {

/// How much an event matters. The values are those of rcl_interfaces/msg/Log.
enum class Level : std::uint8_t { kInfo = 20, kWarning = 30, kError = 40 };

/// A message for people.
struct Event {
  std::int64_t time{0};  ///< Since 1970 [ns].
  Level level{Level::kInfo};
  std::string source;  ///< The robot concerned, or "recorder".
  std::string text;    ///< A sentence.
};

}  // namespace trifinger::log
