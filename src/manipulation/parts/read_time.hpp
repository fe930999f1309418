// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "trifinger/config/node.hpp"
#include "trifinger/control/motion.hpp"

namespace trifinger::manipulation {

// Reads a time [s] in this range.
[[nodiscard]] inline control::Seconds read_time(
    const config::Node& section, std::string_view key,
    const config::Range& range = {.unit = "s", .min = 0, .max = 3600, .above_min = true}) {
  return control::Seconds(section.required<double>(key, range));
}

}  // namespace trifinger::manipulation
