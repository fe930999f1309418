// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "trifinger/config/node.hpp"
#include "trifinger/control/motion.hpp"

// How skills read their configurations. Each is a struct whose members have no defaults, made in
// one expression: a value stands in its file alone, and a forgotten member does not compile.
namespace trifinger::manipulation {

[[nodiscard]] constexpr config::Range above_zero(std::string_view unit, double max) noexcept {
  return {.unit = unit, .min = 0, .max = max, .above_min = true};
}

// Reads a time [s].
[[nodiscard]] inline control::Seconds read_time(const config::Node& section, std::string_view key,
                                                const config::Range& range = above_zero("s",
                                                                                        3600)) {
  return control::Seconds(section.required<double>(key, range));
}

}  // namespace trifinger::manipulation
