// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "trifinger/config/node.hpp"
#include "trifinger/joint/orderly_stop.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation_options.hpp"

// Reads the parts of a configuration that robots from a description and from a file share. All of
// it throws config::ConfigError at the value that is wrong.
namespace trifinger::detail {

// Reads positions within the soft limits of `options`, one for each joint. Those of a description
// may be fewer: three for every finger.
[[nodiscard]] std::vector<double> read_pose(const config::Node& section, std::string_view key,
                                            const SimulationOptions& options);

// Reads the section "stop" of a robot whose limits are known; without it nothing happens after the
// end of a session.
[[nodiscard]] OrderlyStopOptions read_stop(const config::Node& root,
                                           const SimulationOptions& robot);

// What a key that is missing means.
enum class Missing : std::uint8_t {
  kRefused,  // an error
  kUsual,    // the value that `options` has
};

// Reads the section "simulation". `options` must have its period.
void read_simulation(const config::Node& section, Missing missing, SimulationOptions& options);

// Reads the section "identified" of a robot with so many driven joints, whose steps have this
// period; without it, nothing was identified.
[[nodiscard]] Identified read_identified(const config::Node& root, std::size_t joints,
                                         Nanoseconds period);

// Reads the section "cameras", how the robot knows its objects, and what simulated cameras need.
void read_sight(const config::Node& root, RobotConfig& config);

}  // namespace trifinger::detail
