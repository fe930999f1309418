// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/impedance.hpp"

#include <numbers>

namespace trifinger::control {
namespace {

// Moments of inertia of a box with edges of length `size`.
Eigen::Vector3d box_inertia(double mass, const Eigen::Vector3d& size) {
  const Eigen::Vector3d squares = size.cwiseAbs2();
  return mass / 12 * (Eigen::Vector3d::Constant(squares.sum()) - squares);
}

// Moments of inertia of a cylinder along x with half a ball at each end. `length` includes both
// ends.
Eigen::Vector3d stick_inertia(double mass, double length, double diameter) {
  const double radius = diameter / 2;
  const double straight = length - diameter;
  const double cylinder_volume = std::numbers::pi * radius * radius * straight;
  const double ball_volume = 4.0 / 3 * std::numbers::pi * radius * radius * radius;
  const double ball = mass * ball_volume / (cylinder_volume + ball_volume);
  const double cylinder = mass - ball;
  const double along = (cylinder / 2 + ball * 2 / 5) * radius * radius;
  // The ends are half balls with their centres of mass 3/8 of a radius outside the cylinder.
  const double across =
      cylinder * (radius * radius / 4 + straight * straight / 12) +
      ball * (radius * radius * 2 / 5 + straight * straight / 4 + straight * radius * 3 / 8);
  return {along, across, across};
}

}  // namespace

RigidBody rigid_body(const ObjectDescription& object) noexcept {
  const Eigen::Vector3d size(object.size[0], object.size[1], object.size[2]);
  Eigen::Vector3d inertia = Eigen::Vector3d::Zero();
  switch (object.shape) {
    case ObjectShape::kBox:
      inertia = box_inertia(object.mass, size);
      break;
    case ObjectShape::kStick:
      inertia = stick_inertia(object.mass, size.x(), size.y());
      break;
    case ObjectShape::kBall:
      inertia.setConstant(object.mass / 10 * size.x() * size.x());
      break;
  }
  return {object.mass, inertia.asDiagonal()};
}

Wrench object_impedance(const Motion& desired, const Pose& pose, const Twist& twist,
                        const RigidBody& body, const ObjectGains& gains) noexcept {
  const Eigen::Matrix3d to_world = pose.orientation.toRotationMatrix();
  const Eigen::Matrix3d inertia = to_world * body.inertia * to_world.transpose();
  const Eigen::Vector3d& angular = desired.twist.angular;
  return {gains.stiffness * (desired.pose.position - pose.position) +
              gains.damping * (desired.twist.linear - twist.linear) +
              body.mass * (desired.acceleration.linear - gravity()),
          gains.rotational_stiffness * rotation_error(desired.pose.orientation, pose.orientation) +
              gains.rotational_damping * (angular - twist.angular) +
              inertia * desired.acceleration.angular + angular.cross(inertia * angular)};
}

Eigen::Vector3d tip_impedance(const PointMotion& desired, const Eigen::Vector3d& position,
                              const Eigen::Vector3d& velocity, const TipGains& gains) noexcept {
  return gains.stiffness * (desired.position - position) +
         gains.damping * (desired.velocity - velocity);
}

}  // namespace trifinger::control
