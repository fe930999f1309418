// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/grasp.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "model/symmetric_solve.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& arm) {
  Eigen::Matrix3d matrix;
  matrix << 0, -arm.z(), arm.y(), arm.z(), 0, -arm.x(), -arm.y(), arm.x(), 0;
  return matrix;
}

}  // namespace

Eigen::Matrix3d contact_frame(const Eigen::Vector3d& normal) noexcept {
  // Below this cosine the cross product with the vertical is far from zero.
  constexpr double kVertical = 0.9;
  const Eigen::Vector3d n = normal.stableNormalized();
  const Eigen::Vector3d aside = std::abs(n.z()) < kVertical ? Eigen::Vector3d::UnitZ().cross(n)
                                                            : Eigen::Vector3d::UnitX().cross(n);
  Eigen::Matrix3d frame;
  frame.col(0) = aside.normalized();
  frame.col(1) = n.cross(frame.col(0));
  frame.col(2) = n;
  return frame;
}

GraspMap grasp_map(const Grasp& grasp, const Eigen::Vector3d& centre) noexcept {
  GraspMap map;
  for (int i = 0; i < kContacts; ++i) {
    map.block<3, 3>(0, 3 * i).setIdentity();
    map.block<3, 3>(3, 3 * i) = cross_matrix(grasp[static_cast<std::size_t>(i)].position - centre);
  }
  return map;
}

Wrench wrench_of(const Grasp& grasp, const Eigen::Vector3d& centre,
                 const ContactForces& forces) noexcept {
  Wrench wrench;
  for (int i = 0; i < kContacts; ++i) {
    const Eigen::Vector3d force = forces.segment<3>(3 * i);
    wrench.force += force;
    wrench.moment += (grasp[static_cast<std::size_t>(i)].position - centre).cross(force);
  }
  return wrench;
}

Twist twist_of(const Grasp& grasp, const Eigen::Vector3d& centre,
               const ContactForces& velocities) noexcept {
  // The transpose of the grasp map turns a twist into velocities of the contacts. A length scales
  // the rotations, so that all numbers of the equations are of one size.
  constexpr double kLength = 0.03;  // [m]
  GraspMap map = grasp_map(grasp, centre);
  map.bottomRows<3>() /= kLength;
  const Eigen::Matrix<double, 6, 6> squares = map * map.transpose();
  const Eigen::Matrix<double, 6, 1> twist = symmetric_solve(squares, map * velocities);
  return {.linear = twist.head<3>(), .angular = twist.tail<3>() / kLength};
}

FrictionPyramid::FrictionPyramid(int sides)
    : sides_(sides), apothem_(std::cos(std::numbers::pi / sides)) {
  if (sides < kMinSides || sides > kMaxSides) {
    throw InvalidArgument("a friction pyramid has " + std::to_string(sides) + " sides, must have " +
                          std::to_string(kMinSides) + " to " + std::to_string(kMaxSides));
  }
  directions_.setZero();
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / sides;
    directions_.col(i) = Eigen::Vector2d(std::cos(angle), std::sin(angle));
  }
}

double FrictionPyramid::margin(const Eigen::Vector3d& force, double friction) const noexcept {
  double margin = std::numeric_limits<double>::infinity();
  for (int i = 0; i < sides_; ++i) margin = std::min(margin, side(i, friction).dot(force));
  return margin;
}

}  // namespace trifinger::control
