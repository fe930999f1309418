// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace trifinger::evaluation {

// Depth of the floor below the feet of the platform [m]: it stands on a table, and balls fly on.
inline constexpr double kFloorDepth = 1.0;

// Where a ball lands that is at `position` with `velocity` now and that nothing touches any more:
// its distance from the platform's axis when its surface meets a floor so far below the feet of the
// platform [m]. Without air.
[[nodiscard]] double landing(const Eigen::Vector3d& position, const Eigen::Vector3d& velocity,
                             double radius, double depth = kFloorDepth) noexcept;

}  // namespace trifinger::evaluation
