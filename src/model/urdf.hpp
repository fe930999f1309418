// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>

#include "xml.hpp"

namespace trifinger::detail {

// What a URDF says of a joint and MuJoCo does not read.
struct UrdfJoint {
  std::optional<double> max_velocity{};               // <limit velocity> [rad/s], [m/s]
  std::optional<std::array<double, 2>> soft_range{};  // <safety_controller> [rad], [m]
};

// Prepares a URDF for MuJoCo, which then keeps fixed links, as bodies, and what only looks, and
// does steps of 1 ms. Returns what else it says of joints, by their names. `repairs` gives a link
// with a mass and without an inertia that of a ball. Throws InvalidArgument that names file and
// line if it is a template of xacro, or if a link must be repaired.
std::map<std::string, UrdfJoint> prepare_urdf(XmlElement& robot, const std::string& source,
                                              bool repairs);

}  // namespace trifinger::detail
