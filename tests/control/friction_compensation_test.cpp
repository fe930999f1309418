// SPDX-License-Identifier: BSD-3-Clause
#include "control/friction_compensation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "trifinger/model/kinematics.hpp"

namespace trifinger::control {
namespace {

constexpr Seconds kStep{1e-3};

// Nine joints that swing, each in its own time. Their feedback gives what friction takes, the error
// of a motor, and nothing else.
struct Swinging {
  double friction;  // [Nm]
  bool are_free{true};
  double error{0.0};  // Each motor gives so much too much or too little, in turns [Nm].

  FrictionCompensation compensation{};
  JointValues compensated{JointValues::Zero(kMaxJoints)};

  [[nodiscard]] JointValues rates(double time) const {
    JointValues all(kMaxJoints);
    for (Eigen::Index i = 0; i < all.size(); ++i)
      all[i] = std::cos(std::numbers::pi * time * (1.0 + 0.1 * static_cast<double>(i)));
    return all;
  }

  void swing(double duration) {
    for (double time = 0.0; time < duration; time += kStep.count()) {
      const JointValues now = rates(time);
      JointValues pushed(kMaxJoints);
      for (Eigen::Index i = 0; i < pushed.size(); ++i)
        pushed[i] =
            std::copysign(friction, now[i]) - compensated[i] + (i % 2 == 0 ? error : -error);
      compensated = compensation.torques(now, pushed, are_free, kStep);
    }
  }
};

TEST(FrictionCompensation, LearnsMostOfTheFrictionOfJointsThatMoveFreely) {
  for (const double friction : {0.0, 0.005, 0.015, 0.025}) {
    Swinging joints{.friction = friction};
    joints.swing(2.0);
    EXPECT_NEAR(joints.compensation.friction(), friction, 0.1 * friction + 1e-6);
  }
}

TEST(FrictionCompensation, TakesTheErrorsOfMotorsForNoFriction) {
  Swinging joints{.friction = 0.01, .error = 0.02};
  joints.swing(4.0);
  EXPECT_NEAR(joints.compensation.friction(), 0.01, 0.004);
}

TEST(FrictionCompensation, LearnsNothingFromJointsThatTouchSomething) {
  Swinging joints{.friction = 0.02, .are_free = false};
  joints.swing(2.0);
  EXPECT_EQ(joints.compensation.friction(), 0.0);
}

TEST(FrictionCompensation, NeverPushesMoreThanFrictionTakesAndNothingAtRest) {
  Swinging joints{.friction = 0.02};
  joints.swing(2.0);
  for (const double rate : {-2.0, -0.01, 0.0, 0.003, 1.0}) {
    const JointValues rates = JointValues::Constant(kMaxJoints, rate);
    const JointValues torques =
        joints.compensation.torques(rates, JointValues::Zero(kMaxJoints), false, kStep);
    EXPECT_LE(torques.cwiseAbs().maxCoeff(), 0.02);
    EXPECT_GE((torques.array() * rates.array()).minCoeff(), 0.0);
    EXPECT_LE(torques.cwiseAbs().maxCoeff(), std::abs(rate));
  }
}

TEST(FrictionCompensation, DoesNotTakeAStuckJointForFriction) {
  Swinging joints{.friction = 0.5};
  joints.swing(2.0);
  EXPECT_LE(joints.compensated.cwiseAbs().maxCoeff(), 0.03);
}

}  // namespace
}  // namespace trifinger::control
