// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/tips_drive.hpp"

#include <Eigen/LU>

#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {

TipsDrive::TipsDrive(const RobotDescription& description, const control::SafetyLimits& limits,
                     const control::TipGains& gains)
    : kinematics_(description),
      gains_(gains),
      safety_damping_(JointValues::Map(limits.safety_kd.data(), kMaxJoints)),
      max_torque_(JointValues::Map(limits.max_torque.data(), kMaxJoints)),
      torques_(JointValues::Zero(kMaxJoints)) {
  if (kinematics_.num_fingers() != 3)
    throw InvalidArgument("this needs a robot with three fingers");
}

void TipsDrive::sense(const control::JointState& joints) noexcept {
  joints_ = joints;
  kinematics_.update(joints.position);
  jacobians_ = kinematics_.tip_jacobians();
  bias_ = kinematics_.bias_torques(joints.velocity);
  tip_velocity_ = jacobians_ * joints.velocity;
  for (int i = 0; i < 3; ++i) tips_[static_cast<std::size_t>(i)] = kinematics_.tip_position(i);
}

Eigen::Vector3d TipsDrive::felt_force(std::size_t tip) const noexcept {
  const auto i = static_cast<Eigen::Index>(3 * tip);
  const Eigen::Matrix3d inverse = jacobians_.block<3, 3>(i, i).inverse();
  return inverse.transpose() * (joints_.torque.segment<3>(i) - bias_.segment<3>(i));
}

const JointValues& TipsDrive::torques(const Motions& motions, const Points& forces) noexcept {
  const TipPositions drift = kinematics_.tip_accelerations(joints_.velocity);
  JointValues acceleration(kMaxJoints);
  JointValues force(kMaxJoints);
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    force.segment<3>(3 * i) =
        forces[k] +
        control::tip_impedance(motions[k], tips_[k], tip_velocity_.segment<3>(3 * i), gains_);
    acceleration.segment<3>(3 * i) = jacobians_.block<3, 3>(3 * i, 3 * i).inverse() *
                                     (motions[k].acceleration - drift.segment<3>(3 * i));
  }
  torques_ = jacobians_.transpose() * force + kinematics_.mass_matrix() * acceleration + bias_ +
             safety_damping_.cwiseProduct(joints_.velocity);
  // Near a stretched finger the inverse is large, and a torque without bounds helps nobody.
  torques_ = torques_.cwiseMax(-max_torque_).cwiseMin(max_torque_).eval();
  share_ = torques_.cwiseQuotient(max_torque_).cwiseAbs().maxCoeff();
  return torques_;
}

}  // namespace trifinger::manipulation
