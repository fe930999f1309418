// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "trifinger/control/motion.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::evaluation {

// Returns the distance of a point in the world from the surface of `object` at `pose` [m]; below
// zero inside. Computed from the shape alone, with nothing of the physics.
[[nodiscard]] double distance_to_surface(const ObjectDescription& object, const control::Pose& pose,
                                         const Eigen::Vector3d& point);

// Returns the height of the lowest point of `object` at `pose` above the table [m].
[[nodiscard]] double lowest_point(const ObjectDescription& object, const control::Pose& pose);

}  // namespace trifinger::evaluation
