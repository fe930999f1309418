// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <string>

#include "trifinger/core/session.hpp"

namespace trifinger::log::detail {

// Series of observations measured outside of a session's steps. Logs of the flight recorder hold
// them as companions.
inline constexpr std::array kExtraSeries{Series::kHolding, Series::kStopping};

// Returns the type of such a companion.
[[nodiscard]] inline std::string extra_type(const std::string& robot_type, Series series) {
  return robot_type + "_" + std::string(name_of(series));
}

[[nodiscard]] inline bool is_extra(const std::string& robot_type, const std::string& type) {
  return std::ranges::any_of(kExtraSeries,
                             [&](Series series) { return type == extra_type(robot_type, series); });
}

}  // namespace trifinger::log::detail
