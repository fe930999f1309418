// SPDX-License-Identifier: BSD-3-Clause
#include "model/rotation_between.hpp"

namespace trifinger {

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

}  // namespace trifinger
