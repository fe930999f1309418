// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/tip_servo.hpp"

#include <Eigen/LU>

#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {

TipServo::TipServo(const RobotDescription& description, const control::SafetyLimits& limits)
    : kinematics_(description), radius_(figures(description).tip_radius) {
  if (kinematics_.num_fingers() != control::kContacts)
    throw InvalidArgument("the robot has not three fingers");
  control::validate(limits);
  damping_ = JointValues::Map(limits.safety_kd.data(), kMaxJoints);
  limits_ = JointValues::Map(limits.max_torque.data(), kMaxJoints);
  torques_.setZero(kMaxJoints);
  for (TipVectors* vectors : {&tips_, &velocities_, &felt_}) vectors->fill(Eigen::Vector3d::Zero());
}

void TipServo::sense(const control::JointState& joints) noexcept {
  kinematics_.update(joints.position);
  joint_velocity_ = joints.velocity;
  jacobians_ = kinematics_.tip_jacobians();
  bias_ = kinematics_.bias_torques(joints.velocity);
  for (int i = 0; i < control::kContacts; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Matrix3d jacobian = jacobians_.block<3, 3>(3 * i, 3 * i);
    inverses_[k] = jacobian.inverse();
    tips_[k] = kinematics_.tip_position(i);
    velocities_[k] = jacobian * joints.velocity.segment<3>(3 * i);
    felt_[k] =
        inverses_[k].transpose() * (joints.torque.segment<3>(3 * i) - bias_.segment<3>(3 * i));
  }
}

const JointValues& TipServo::torques(const TipsCommand& command,
                                     control::Seconds elapsed) noexcept {
  const TipPositions drift = kinematics_.tip_accelerations(joint_velocity_);
  JointValues acceleration(kMaxJoints);
  JointValues rates(kMaxJoints);
  JointValues force(kMaxJoints);
  for (int i = 0; i < control::kContacts; ++i) {
    const auto k = static_cast<std::size_t>(i);
    acceleration.segment<3>(3 * i) =
        inverses_[k] * (command.accelerations[k] - drift.segment<3>(3 * i));
    rates.segment<3>(3 * i) = inverses_[k] * command.velocities[k];
    force.segment<3>(3 * i) = command.forces[k];
  }
  const JointValues pushed = jacobians_.transpose() * force;
  torques_ = pushed + friction_.torques(rates, pushed, command.are_free, elapsed) +
             kinematics_.mass_matrix() * acceleration + bias_ +
             damping_.cwiseProduct(joint_velocity_);
  torque_share_ = torques_.cwiseQuotient(limits_).cwiseAbs().maxCoeff();
  return torques_;
}

}  // namespace trifinger::manipulation
