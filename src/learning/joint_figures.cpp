// SPDX-License-Identifier: BSD-3-Clause
#include "joint_figures.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "trifinger/learning/task.hpp"

namespace trifinger::learning {
namespace {

// Bounds of the observed values. The safety checks brake joints that are faster.
constexpr double kMaxVelocity = 10.0;  // [rad/s]
constexpr double kBeyondLimits = 0.2;  // [rad]

}  // namespace

// The range of desired positions is that of the authors' simulation of their reaching task, in the
// sign convention of the variant and clipped to the soft limits.
JointFigures figures_of(const Kinematics& kinematics) {
  const RobotDescription& description = kinematics.description();
  const bool is_one = description.variant == Variant::kOne;
  const FingerJoints low{-70 * kDegree, is_one ? -70 * kDegree : 0.0, -160 * kDegree};
  const FingerJoints high{70 * kDegree, is_one ? 0.0 : 70 * kDegree, -2 * kDegree};
  const VariantFigures& limits = figures(description);
  JointFigures joints;
  for (int finger = 0; finger < kinematics.num_fingers(); ++finger) {
    for (std::size_t i = 0; i < kJointsPerFinger; ++i) {
      joints.initial.push_back(limits.initial_position[i]);
      joints.low.push_back(std::max(low[i], limits.soft_lower[i]));
      joints.high.push_back(std::min(high[i], limits.soft_upper[i]));
      joints.hard_low.push_back(limits.hard_lower[i]);
      joints.hard_high.push_back(limits.hard_upper[i]);
      joints.max_torque.push_back(actuator(description).torque_limit);
      joints.kp.push_back(limits.kp[i]);
      joints.position.low.push_back(limits.hard_lower[i] - kBeyondLimits);
      joints.position.high.push_back(limits.hard_upper[i] + kBeyondLimits);
      joints.velocity.low.push_back(-kMaxVelocity);
      joints.velocity.high.push_back(kMaxVelocity);
    }
  }
  return joints;
}

// The range of desired positions is that of the soft limits. Where a joint has no end, it is asked
// for half a turn from where it begins, and observed for half a turn more.
JointFigures figures_of(const FileBody& body) {
  JointFigures joints;
  bool has_slide = false;
  bool has_hinge = false;
  for (std::size_t i = 0; i < body.num_joints(); ++i) {
    const JointLimit& limit = body.limits()[i];
    const bool is_slide = body.model().joints()[i].is_slide;
    (is_slide ? has_slide : has_hinge) = true;
    const double half_turn = is_slide ? 1.0 : std::numbers::pi;
    const auto is_end = [](double bound) { return std::abs(bound) < kLargestJointLimit; };
    const double initial = body.initial_position()[i];
    const double low = is_end(limit.soft_lower) ? limit.soft_lower : initial - half_turn;
    const double high = is_end(limit.soft_upper) ? limit.soft_upper : initial + half_turn;
    joints.initial.push_back(initial);
    joints.low.push_back(low);
    joints.high.push_back(high);
    joints.hard_low.push_back(limit.hard_lower);
    joints.hard_high.push_back(limit.hard_upper);
    joints.max_torque.push_back(limit.max_torque);
    joints.kp.push_back(limit.default_kp);
    joints.position.low.push_back(is_end(limit.hard_lower) ? limit.hard_lower - kBeyondLimits
                                                           : low - half_turn);
    joints.position.high.push_back(is_end(limit.hard_upper) ? limit.hard_upper + kBeyondLimits
                                                            : high + half_turn);
    const double fastest = is_end(limit.max_velocity) ? limit.max_velocity : kMaxVelocity;
    joints.velocity.low.push_back(-fastest);
    joints.velocity.high.push_back(fastest);
  }
  if (has_slide) {
    joints.position.unit = has_hinge ? "rad or m" : "m";
    joints.velocity.unit = has_hinge ? "rad/s or m/s" : "m/s";
  }
  return joints;
}

}  // namespace trifinger::learning
