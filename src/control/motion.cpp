// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/motion.hpp"

#include <cmath>

namespace trifinger::control {

Eigen::Quaterniond rotation_from_vector(const Eigen::Vector3d& vector) noexcept {
  const double angle = vector.norm();
  Eigen::Quaterniond rotation;
  rotation.w() = std::cos(angle / 2);
  // For small angles the series is exact to rounding; the quotient is not.
  rotation.vec() = (angle > 1e-4 ? std::sin(angle / 2) / angle : 0.5 - angle * angle / 48) * vector;
  return rotation;
}

Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& rotation) noexcept {
  // A quaternion and its negative are the same rotation. This sign gives at most half a turn.
  const double sign = rotation.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d axis = sign * rotation.vec();
  const double sine = axis.norm();
  const double cosine = std::abs(rotation.w());
  return (sine > 1e-4 ? 2 * std::atan2(sine, cosine) / sine : 2 + sine * sine / 3) * axis;
}

Eigen::Vector3d rotation_error(const Eigen::Quaterniond& desired,
                               const Eigen::Quaterniond& actual) noexcept {
  return rotation_vector(desired * actual.conjugate());
}

Pose moved(const Pose& pose, const Twist& twist, Seconds duration) noexcept {
  const double time = duration.count();
  return {pose.position + time * twist.linear,
          (rotation_from_vector(time * twist.angular) * pose.orientation).normalized()};
}

PointMotion point_of_body(const Motion& body, const Eigen::Vector3d& point) noexcept {
  const Eigen::Vector3d arm = body.pose.orientation * point;
  const Eigen::Vector3d& angular = body.twist.angular;
  const Eigen::Vector3d turning = angular.cross(arm);
  return {body.pose.position + arm, body.twist.linear + turning,
          body.acceleration.linear + body.acceleration.angular.cross(arm) + angular.cross(turning)};
}

}  // namespace trifinger::control
