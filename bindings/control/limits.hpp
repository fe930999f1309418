// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "trifinger/control/safety_limits.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::bindings {

/// The limits of a configuration's safety checks; nothing if it does not have three fingers.
[[nodiscard]] std::optional<control::SafetyLimits> limits_of(const RobotConfig& config);

}  // namespace trifinger::bindings
