// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "servos/read_options.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::detail {

// Reads the Dynamixel motors of this robot from the section "dynamixel" of `root`. Throws
// config::ConfigError at the value that is wrong.
[[nodiscard]] servos::ServoConfig read_servos(const config::Node& root,
                                              const SimulationOptions& simulation);

}  // namespace trifinger::detail
