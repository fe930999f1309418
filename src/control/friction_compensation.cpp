// SPDX-License-Identifier: BSD-3-Clause
#include "control/friction_compensation.hpp"

#include <algorithm>
#include <cmath>

namespace trifinger::control {
namespace {

constexpr double kMoves = 0.15;         // Joints that should be this fast slide for sure [rad/s].
constexpr double kSlow = 0.02;          // Below it the direction of friction is not sure [rad/s].
constexpr double kLearning = 4.0;       // [1/s]
constexpr double kMostFriction = 0.03;  // More is a joint that is stuck [Nm].
constexpr double kShare = 0.9;          // More than all of it would push joints by itself.

}  // namespace

JointValues FrictionCompensation::torques(const JointValues& rates, const JointValues& pushed,
                                          bool are_free, Seconds elapsed) noexcept {
  double taken = 0.0;
  int moving = 0;
  for (Eigen::Index i = 0; are_free && i < rates.size(); ++i) {
    if (std::abs(rates[i]) < kMoves) continue;
    taken += std::copysign(1.0, rates[i]) * pushed[i] + kShare * friction_;
    ++moving;
  }
  if (moving > 0) {
    const double share = std::min(kLearning * elapsed.count(), 1.0);
    friction_ = std::clamp(friction_ + share * (taken / moving - friction_), 0.0, kMostFriction);
  }
  return kShare * friction_ * (rates / kSlow).array().tanh();
}

}  // namespace trifinger::control
