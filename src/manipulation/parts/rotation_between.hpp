// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

namespace trifinger::manipulation {

// The smallest rotation that turns `from` to `to`. Neither may be zero. It is Eigen's own, in a
// file of its own, because each file that calls Eigen's compiles a singular value decomposition: 23
// s.
[[nodiscard]] Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from,
                                                  const Eigen::Vector3d& to);

}  // namespace trifinger::manipulation
