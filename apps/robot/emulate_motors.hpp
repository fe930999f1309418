// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "trifinger/realtime/thread.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {

// The faults of emulated Dynamixel motors that `emulate_motors` understands, one per line.
[[nodiscard]] std::string_view motor_fault_texts();

// Is the Dynamixel motors of this robot, until a signal comes. Throws InvalidArgument for a fault
// that makes no sense, SystemError.
void emulate_motors(const RobotConfig& config, const std::vector<std::string>& faults,
                    const RealtimeOptions& realtime);

}  // namespace trifinger::apps
