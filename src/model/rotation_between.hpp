// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

namespace trifinger {

// The smallest rotation that turns `from` to `to`. Neither may be zero. It calls Eigen's function
// once for all: each file that calls that one compiles a singular value decomposition for 23 s.
[[nodiscard]] Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from,
                                                  const Eigen::Vector3d& to);

}  // namespace trifinger
