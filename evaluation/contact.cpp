// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/contact.hpp"

#include <algorithm>
#include <cmath>

namespace trifinger::evaluation {

double distance_to_surface(const ObjectDescription& object, const control::Pose& pose,
                           const Eigen::Vector3d& point) {
  const Eigen::Vector3d local = pose.orientation.conjugate() * (point - pose.position);
  switch (object.shape) {
    case ObjectShape::kBox: {
      const Eigen::Vector3d beyond =
          local.cwiseAbs() - Eigen::Vector3d::Map(object.size.data()) / 2;
      return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
    }
    case ObjectShape::kStick: {
      const double straight = (object.size[0] - object.size[1]) / 2;
      const Eigen::Vector3d nearest(std::clamp(local.x(), -straight, straight), 0.0, 0.0);
      return (local - nearest).norm() - object.size[1] / 2;
    }
    case ObjectShape::kBall:
      return local.norm() - object.size[0] / 2;
  }
  return 0.0;
}

double lowest_point(const ObjectDescription& object, const control::Pose& pose) {
  // The vertical in the object's frame.
  const Eigen::Vector3d up = pose.orientation.conjugate() * Eigen::Vector3d::UnitZ();
  switch (object.shape) {
    case ObjectShape::kBox:
      return pose.position.z() - up.cwiseAbs().dot(Eigen::Vector3d::Map(object.size.data())) / 2;
    case ObjectShape::kStick:
      return pose.position.z() - std::abs(up.x()) * (object.size[0] - object.size[1]) / 2 -
             object.size[1] / 2;
    case ObjectShape::kBall:
      return pose.position.z() - object.size[0] / 2;
  }
  return 0.0;
}

}  // namespace trifinger::evaluation
