// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/safety.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <functional>
#include <limits>
#include <new>
#include <random>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "joint/limits_of_tests.hpp"
#include "support/allocation_counter.hpp"

namespace trifinger {
namespace {

using testing::Each;

using Chain = SafetyChain<Finger>;
using Action = Finger::Action;
using Observation = Finger::Observation;
using Applied = Finger::AppliedAction;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Nanoseconds kPeriod = std::chrono::milliseconds(1);

constexpr JointLimit kLimit = test::with_the_rest_off({.max_torque = 0.36,
                                                       .safety_kd = 0.09,
                                                       .soft_lower = -1.0,
                                                       .soft_upper = 1.5,
                                                       .hard_lower = -2.0,
                                                       .hard_upper = 2.5,
                                                       .default_kp = 7.0,
                                                       .default_kd = 0.02,
                                                       .max_kp = 50.0,
                                                       .max_kd = 0.5});

// A finger whose three joints all have this limit.
JointLimits<3> equal_limits(const JointLimit& limit = kLimit) { return {limit, limit, limit}; }

// Returns what a fresh chain applies.
Applied applied_for(const Action& desired, const Observation& observation = {}) {
  SafetyState<3> state;
  Applied applied;
  (void)Chain(equal_limits()).apply(desired, observation, kPeriod, state, applied);
  return applied;
}

// --- The action as data ---

TEST(AcceptCommand, LeavesAGoodCommandAlone) {
  const auto [command, reasons] = accept_command({0.1, 0.5, 3.0, 0.1}, kNotGiven, kLimit);
  EXPECT_EQ(reasons, 0U);
  EXPECT_EQ(command.torque, 0.1);
  EXPECT_EQ(command.position, 0.5);
  EXPECT_EQ(command.position_kp, 3.0);
  EXPECT_EQ(command.position_kd, 0.1);
}

TEST(AcceptCommand, UsesTheDefaultGainsForAPositionWithoutGains) {
  const auto [command, reasons] = accept_command({.position = 0.5}, kNotGiven, kLimit);
  EXPECT_EQ(reasons, 0U);
  EXPECT_EQ(command.position_kp, kLimit.default_kp);
  EXPECT_EQ(command.position_kd, kLimit.default_kd);
}

TEST(AcceptCommand, IgnoresGainsWithoutAPosition) {
  for (const double gain : {-1.0, 1e9, kInfinity, 3.0}) {
    const auto [command, reasons] = accept_command(
        {.torque = 0.1, .position_kp = gain, .position_kd = gain}, kNotGiven, kLimit);
    EXPECT_EQ(reasons, 0U) << gain;
    EXPECT_EQ(command.torque, 0.1);
    EXPECT_TRUE(std::isnan(command.position_kp)) << gain;
  }
}

TEST(AcceptCommand, fault_06_NamesTheFieldThatIsNotFit) {
  const auto reasons_of = [](const JointCommand& command) {
    return accept_command(command, kNotGiven, kLimit).reasons;
  };
  EXPECT_EQ(reasons_of({.torque = kNotGiven}), bit(Reason::kTorqueNotFinite));
  EXPECT_EQ(reasons_of({.torque = -kInfinity}), bit(Reason::kTorqueNotFinite));
  EXPECT_EQ(reasons_of({.position = kInfinity}), bit(Reason::kPositionNotFinite));
  EXPECT_EQ(reasons_of({.position = 0.0, .position_kp = -1e-9}), bit(Reason::kKpOutOfBounds));
  EXPECT_EQ(reasons_of({.position = 0.0, .position_kp = 50.1}), bit(Reason::kKpOutOfBounds));
  EXPECT_EQ(reasons_of({.position = 0.0, .position_kd = kInfinity}), bit(Reason::kKdOutOfBounds));
  EXPECT_EQ(reasons_of({kInfinity, kInfinity, -1.0, -1.0}), kRejected);
}

TEST(AcceptCommand, AcceptsGainsAtTheirBounds) {
  EXPECT_EQ(accept_command({0.0, 0.5, kLimit.max_kp, kLimit.max_kd}, kNotGiven, kLimit).reasons,
            0U);
  EXPECT_EQ(accept_command({0.0, 0.5, 0.0, 0.0}, kNotGiven, kLimit).reasons, 0U);
}

TEST(AcceptCommand, fault_06_HoldsTheLastAcceptedTargetInsteadOfABadCommand) {
  const auto [command, reasons] = accept_command({kNotGiven, 0.5, 3.0, 0.1}, 0.2, kLimit);
  EXPECT_EQ(reasons, bit(Reason::kTorqueNotFinite));
  EXPECT_EQ(command.torque, 0.0);
  EXPECT_EQ(command.position, 0.2);
  EXPECT_EQ(command.position_kp, kLimit.default_kp);
  EXPECT_EQ(command.position_kd, kLimit.default_kd);
}

TEST(AcceptCommand, AsksForNothingIfThereIsNoLastTarget) {
  const JointCommand command = accept_command({.torque = kNotGiven}, kNotGiven, kLimit).command;
  EXPECT_EQ(command.torque, 0.0);
  EXPECT_TRUE(std::isnan(command.position));
}

// --- Soft limits ---

TEST(SoftLimits, ClampTheTarget) {
  const JointCommand above{.position = 9.0, .position_kp = 3.0, .position_kd = 0.1};
  const auto [command, reasons] = stay_within_soft_limits(above, 0.0, kLimit);
  EXPECT_EQ(command.position, kLimit.soft_upper);
  EXPECT_EQ(command.position_kp, 3.0);
  EXPECT_EQ(reasons, bit(Reason::kTargetClamped));
}

TEST(SoftLimits, PushBackAJointThatHasNoTarget) {
  const auto [command, reasons] = stay_within_soft_limits({.torque = -0.1}, 1.6, kLimit);
  EXPECT_EQ(command.torque, -0.1);
  EXPECT_EQ(command.position, kLimit.soft_upper);
  EXPECT_EQ(command.position_kp, kLimit.default_kp);
  EXPECT_EQ(reasons, bit(Reason::kPushedBack));
}

TEST(SoftLimits, TakeAwayTorqueThatPushesOutward) {
  EXPECT_EQ(stay_within_soft_limits({.torque = 0.3}, 1.6, kLimit).command.torque, 0.0);
  EXPECT_EQ(stay_within_soft_limits({.torque = -0.3}, 1.6, kLimit).command.torque, -0.3);
  EXPECT_EQ(stay_within_soft_limits({.torque = -0.3}, -1.1, kLimit).command.torque, 0.0);
  EXPECT_EQ(stay_within_soft_limits({.torque = 0.3}, -1.1, kLimit).command.torque, 0.3);
}

TEST(SoftLimits, CannotBeWeakenedByTheUsersGains) {
  const JointCommand weak{.position = 0.0, .position_kp = 0.0, .position_kd = 0.0};
  const auto [command, reasons] = stay_within_soft_limits(weak, 1.6, kLimit);
  EXPECT_EQ(command.position, 0.0);
  EXPECT_EQ(command.position_kp, kLimit.default_kp);
  EXPECT_EQ(command.position_kd, kLimit.default_kd);
  EXPECT_EQ(reasons, bit(Reason::kPushedBack));
}

TEST(SoftLimits, LeaveAJointInsideAlone) {
  for (const double position : {kLimit.soft_lower, 0.0, kLimit.soft_upper}) {
    EXPECT_EQ(stay_within_soft_limits({.torque = 0.3}, position, kLimit).reasons, 0U) << position;
  }
}

// --- Torque ---

TEST(TorqueOf, IsTheTorqueAloneWithoutATarget) {
  EXPECT_EQ(torque_of({.torque = 0.2}, 0.5, 3.0), 0.2);
}

TEST(TorqueOf, AddsThePdOfTheTarget) {
  EXPECT_DOUBLE_EQ(torque_of({0.2, 0.5, 3.0, 0.1}, 0.4, 2.0), 0.2 + 3.0 * 0.1 - 0.1 * 2.0);
}

TEST(LimitTorque, fault_07_BrakesAFastJointHoweverMuchTorqueIsAsked) {
  for (const double huge : {1e9, 1e300, std::numeric_limits<double>::max()}) {
    EXPECT_DOUBLE_EQ(limit_torque(huge, 2.0, kLimit.max_torque, kLimit).torque, 0.36 - 0.09 * 2.0);
    EXPECT_DOUBLE_EQ(limit_torque(-huge, -2.0, kLimit.max_torque, kLimit).torque,
                     -0.36 + 0.09 * 2.0);
  }
}

TEST(LimitTorque, ClipsTheBrakeToo) {
  EXPECT_EQ(limit_torque(0.0, 1000.0, kLimit.max_torque, kLimit).torque, -kLimit.max_torque);
  EXPECT_EQ(limit_torque(0.0, -1000.0, kLimit.max_torque, kLimit).torque, kLimit.max_torque);
}

TEST(LimitTorque, TellsClippingFromDamping) {
  EXPECT_EQ(limit_torque(0.2, 0.0, kLimit.max_torque, kLimit).reasons, 0U);
  EXPECT_EQ(limit_torque(0.2, 1.0, kLimit.max_torque, kLimit).reasons, bit(Reason::kDamped));
  EXPECT_EQ(limit_torque(0.5, 0.0, kLimit.max_torque, kLimit).reasons, bit(Reason::kTorqueClipped));
  EXPECT_EQ(limit_torque(0.5, 1.0, kLimit.max_torque, kLimit).reasons,
            bit(Reason::kTorqueClipped) | bit(Reason::kDamped));
}

TEST(LimitTorque, ClipsToLessThanTheMaximumWhenTheMotorIsWarm) {
  const auto [torque, reasons] = limit_torque(0.3, 0.0, 0.2, kLimit);
  EXPECT_EQ(torque, 0.2);
  EXPECT_EQ(reasons, bit(Reason::kDerated));
  EXPECT_EQ(limit_torque(0.5, 0.0, 0.2, kLimit).reasons,
            bit(Reason::kTorqueClipped) | bit(Reason::kDerated));
  EXPECT_EQ(limit_torque(0.1, 0.0, 0.2, kLimit).reasons, 0U);
}

TEST(LimitTorque, BrakesAWarmMotorAsItDoesAColdOne) {
  // It is clipped before it is damped, so the request cannot drown the brake.
  EXPECT_DOUBLE_EQ(limit_torque(1e9, 2.0, 0.2, kLimit).torque, 0.2 - 0.09 * 2.0);
}

// --- Torque rate ---

constexpr double kStep = 0.001;  // [s]

JointLimit with_torque_rate(double rate) {
  JointLimit limit = kLimit;
  limit.max_torque_rate = rate;
  return limit;
}

TEST(LimitTorqueRate, fault_08_LetsTheTorqueFollowAStepInSmallOnes) {
  const JointLimit limit = with_torque_rate(10.0);
  double torque = 0.0;
  for (int i = 1; i <= 30; ++i) {
    const CheckedTorque next = limit_torque_rate(0.3, torque, 0.0, kStep, limit);
    EXPECT_NEAR(next.torque, 0.01 * i, 1e-12);
    EXPECT_EQ(next.reasons, i < 30 ? bit(Reason::kTorqueRateLimited) : 0U) << i;
    torque = next.torque;
  }
}

TEST(LimitTorqueRate, fault_08_AllowsMoreAfterSkippedSteps) {
  EXPECT_NEAR(limit_torque_rate(-0.3, 0.0, 0.0, 5 * kStep, with_torque_rate(10.0)).torque, -0.05,
              1e-12);
}

TEST(LimitTorqueRate, fault_08_IsNoLimitWhenInfinite) {
  for (const double torque : {1e300, -1e300, 0.0}) {
    EXPECT_EQ(limit_torque_rate(torque, 0.3, 0.0, kStep, kLimit).torque, torque);
  }
}

TEST(LimitTorqueRate, fault_08_DelaysNoTorqueThatBringsAJointBackFromBeyondASoftLimit) {
  const JointLimit limit = with_torque_rate(10.0);
  EXPECT_EQ(limit_torque_rate(-0.3, 0.36, 1.6, kStep, limit).torque, -0.3);
  EXPECT_EQ(limit_torque_rate(0.3, -0.36, -1.1, kStep, limit).torque, 0.3);
  // In the other direction it is as slow as before.
  EXPECT_NEAR(limit_torque_rate(0.3, -0.36, 1.6, kStep, limit).torque, -0.35, 1e-12);
}

// --- Velocity ---

JointLimit with_velocity(double max_velocity, double braking = kInfinity) {
  JointLimit limit = kLimit;
  limit.max_velocity = max_velocity;
  limit.braking = braking;
  return limit;
}

TEST(LimitVelocity, fault_13_LeavesASlowJointAlone) {
  for (const double velocity : {-5.0, 0.0, 5.0}) {
    EXPECT_EQ(limit_velocity(0.3, 0.0, velocity, 0.36, with_velocity(5.0)).reasons, 0U);
  }
}

TEST(LimitVelocity, fault_13_TakesAwayWhatDrivesAFastJointAndBrakesIt) {
  const JointLimit limit = with_velocity(5.0);
  EXPECT_DOUBLE_EQ(limit_velocity(0.3, 0.0, 5.25, 0.36, limit).torque, -0.25 * 0.36);
  EXPECT_DOUBLE_EQ(limit_velocity(-0.3, 0.0, -5.25, 0.36, limit).torque, 0.25 * 0.36);
  EXPECT_EQ(limit_velocity(0.3, 0.0, 5.25, 0.36, limit).reasons, bit(Reason::kTooFast));
  EXPECT_EQ(limit_velocity(0.3, 0.0, 100.0, 0.36, limit).torque, -0.36);
}

TEST(LimitVelocity, fault_13_NeverBrakesLessThanWasAsked) {
  const auto [torque, reasons] = limit_velocity(-0.3, 0.0, 5.25, 0.36, with_velocity(5.0));
  EXPECT_EQ(torque, -0.3);
  EXPECT_EQ(reasons, 0U);
}

TEST(LimitVelocity, fault_13_IsLowerNearTheSoftLimitAhead) {
  // 2 * 10 * 0.05 = 1: at 1 rad/s the joint can be stopped within 0.05 rad.
  const JointLimit limit = with_velocity(5.0, 10.0);
  const double near = kLimit.soft_upper - 0.05;
  EXPECT_EQ(limit_velocity(0.3, near, 0.99, 0.36, limit).reasons, 0U);
  EXPECT_NEAR(limit_velocity(0.3, near, 1.5, 0.36, limit).torque, -0.18, 1e-9);
  EXPECT_EQ(limit_velocity(-0.3, near, -4.9, 0.36, limit).reasons, 0U) << "the other way";
  const double low = kLimit.soft_lower + 0.05;
  EXPECT_NEAR(limit_velocity(-0.3, low, -1.5, 0.36, limit).torque, 0.18, 1e-9);
}

TEST(LimitVelocity, fault_13_BrakesAllThatMovesOutwardBeyondASoftLimit) {
  const JointLimit limit = with_velocity(5.0, 10.0);
  EXPECT_NEAR(limit_velocity(0.0, 1.6, 0.5, 0.36, limit).torque, -0.18, 1e-12);
  EXPECT_EQ(limit_velocity(0.0, 1.6, -0.5, 0.36, limit).reasons, 0U);
}

TEST(LimitVelocity, fault_13_IsNoLimitWhenInfinite) {
  for (const double position : {-1.1, -1.0, 0.0, 1.5, 1.6}) {
    EXPECT_EQ(limit_velocity(0.3, position, 1e6, 0.36, kLimit).reasons, 0U) << position;
  }
}

// --- Heat ---

constexpr JointLimit with_thermal(double continuous_torque, double thermal_time) {
  JointLimit limit = kLimit;
  limit.continuous_torque = continuous_torque;
  limit.thermal_time = thermal_time;
  return limit;
}
constexpr JointLimit kThermal = with_thermal(0.18, 10.0);

TEST(Heat, fault_47_FollowsTheSquareOfTheTorqueWithItsTimeConstant) {
  for (const double torque : {0.09, 0.18, 0.2}) {
    double heat = 0.0;
    for (int i = 0; i < 10'000; ++i) heat = heat_after(heat, torque, kStep, kThermal);
    const double load = torque / 0.18;
    EXPECT_NEAR(heat, load * load * (1.0 - std::exp(-1.0)), 1e-4) << torque;
  }
}

TEST(Heat, fault_47_IsTheSameForOneLongStepAsForManyShortOnes) {
  double heat = 0.0;
  for (int i = 0; i < 100; ++i) heat = heat_after(heat, 0.3, kStep, kThermal);
  EXPECT_NEAR(heat_after(0.0, 0.3, 0.1, kThermal), heat, 1e-2 * heat);
}

TEST(Heat, fault_47_IsNilWhereAMotorHasNoSuchLimit) {
  EXPECT_EQ(heat_after(0.0, 0.36, kStep, with_thermal(kInfinity, 10.0)), 0.0);
  EXPECT_EQ(heat_after(0.0, 0.36, kStep, with_thermal(0.18, kInfinity)), 0.0);
}

TEST(Heat, fault_47_TakesTorqueAwayOnAStraightLine) {
  EXPECT_EQ(derated_torque(0.0, kThermal), 0.36);
  EXPECT_EQ(derated_torque(0.8, kThermal), 0.36);
  EXPECT_NEAR(derated_torque(0.9, kThermal), 0.27, 1e-12);
  EXPECT_NEAR(derated_torque(1.0, kThermal), 0.18, 1e-12);
  EXPECT_NEAR(derated_torque(2.0, kThermal), 0.18, 1e-12);
  for (const double torque : {0.36, 1.0, kInfinity}) {
    EXPECT_EQ(derated_torque(1.0, with_thermal(torque, 10.0)), 0.36) << "never more than cold";
  }
}

TEST(Heat, fault_47_NeverPassesOneWhateverIsAskedAndHoweverLongAStepIs) {
  std::mt19937 random(1);
  for (const double ratio : {0.1, 0.5, 0.9, 1.0}) {
    // The shortest time that limits may have.
    const JointLimit limit = with_thermal(ratio * kLimit.max_torque, 1.0 / (ratio * ratio));
    for (const double elapsed : {1e-4, 1e-3, 0.01, 0.1, 0.2}) {
      double heat = 0.0;
      for (int i = 0; i < 20'000; ++i) {
        const double asked = i < 10'000 ? 1e9 : random() % 2 == 0 ? 1e9 : 0.0;
        const double torque = limit_torque(asked, 0.0, derated_torque(heat, limit), limit).torque;
        heat = heat_after(heat, torque, elapsed, limit);
        ASSERT_LE(heat, 1.0 + 1e-12) << ratio << " " << elapsed << " " << i;
      }
    }
  }
}

TEST(Heat, fault_47_IsPublishedAsAMarginInPartsOf256) {
  EXPECT_EQ(thermal_margin_of(0.0), 1.0);
  EXPECT_EQ(thermal_margin_of(0.5), 0.5);
  EXPECT_EQ(thermal_margin_of(1.0), 0.0);
  EXPECT_EQ(thermal_margin_of(2.0), -1.0);
  for (double heat = 0.0; heat <= 2.0; heat += 0.0007) {
    const double margin = thermal_margin_of(heat);
    EXPECT_EQ(margin * 256.0, std::floor(margin * 256.0));
    EXPECT_LE(margin, 1.0 - heat);
    EXPECT_GT(margin, 1.0 - heat - 1.0 / 256.0);
  }
}

TEST(Heat, fault_47_IsAFaultOnlyAboveWhatAnObedientMotorReaches) {
  EXPECT_EQ(check_heat(1.0), 0U);
  EXPECT_EQ(check_heat(1.2), 0U);
  EXPECT_EQ(check_heat(1.21), bit(Reason::kOverheated));
}

TEST(Heat, fault_47_ThatNobodyKnowsIsTheMost) {
  for (const double heat : {kNotGiven, kInfinity}) {
    EXPECT_EQ(derated_torque(heat, kThermal), 0.18);
    EXPECT_EQ(check_heat(heat), bit(Reason::kOverheated));
    EXPECT_EQ(check_heat(heat_after(heat, 0.1, kStep, kThermal)), bit(Reason::kOverheated));
  }
  EXPECT_EQ(check_heat(heat_after(0.0, kNotGiven, kStep, kThermal)), bit(Reason::kOverheated));
  EXPECT_EQ(thermal_margin_of(heat_after(-5.0, 0.0, kStep, kThermal)), 1.0);
}

// --- Measurements ---

TEST(CheckMeasurement, RefusesWhatIsNoMeasurement) {
  for (const double bad : {kNotGiven, kInfinity, -kInfinity, 1e7, -1e7}) {
    EXPECT_EQ(check_measurement({bad, 0.0, 0.0}, kLimit), bit(Reason::kBadMeasurement)) << bad;
    EXPECT_EQ(check_measurement({0.0, bad, 0.0}, kLimit), bit(Reason::kBadMeasurement)) << bad;
  }
}

TEST(CheckMeasurement, AllowsAJointUpToItsHardLimit) {
  EXPECT_EQ(check_measurement({kLimit.hard_upper, 0.0, 0.0}, kLimit), 0U);
  EXPECT_EQ(check_measurement({std::nextafter(kLimit.hard_upper, 9.0), 0.0, 0.0}, kLimit),
            bit(Reason::kHardLimit));
  EXPECT_EQ(check_measurement({std::nextafter(kLimit.hard_lower, -9.0), 0.0, 0.0}, kLimit),
            bit(Reason::kHardLimit));
}

TEST(CheckMeasurement, RefusesATorqueThatIsNoNumber) {
  for (const double bad : {kNotGiven, kInfinity, 1e7}) {
    EXPECT_EQ(check_measurement({0.0, 0.0, bad}, kLimit), bit(Reason::kBadMeasurement)) << bad;
  }
}

TEST(CheckJump, fault_45_AllowsWhatAJointCanMoveInTheTimeThatHasPassed) {
  JointLimit limit = kLimit;
  limit.max_position_rate = 50.0;
  EXPECT_EQ(check_jump(0.149, 0.1, kStep, limit), 0U);
  EXPECT_EQ(check_jump(0.151, 0.1, kStep, limit), bit(Reason::kPositionJumped));
  EXPECT_EQ(check_jump(0.049, 0.1, kStep, limit), bit(Reason::kPositionJumped));
  EXPECT_EQ(check_jump(0.151, 0.1, 2 * kStep, limit), 0U) << "after a skipped step";
  EXPECT_EQ(check_jump(9.0, kNotGiven, kStep, limit), 0U) << "the first measurement";
  EXPECT_EQ(check_jump(9.0, 0.1, kStep, kLimit), 0U) << "off";
}

// Measures joint positions `position_of(t)` and velocities `velocity_of(t)` for `steps` steps of a
// millisecond. Returns the error at the end.
template <class Position, class Velocity>
double velocity_error(const Position& position_of, const Velocity& velocity_of, int steps) {
  JointLimit limit = kLimit;
  limit.velocity_error_time = 0.1;
  JointMemory memory;
  for (int i = 0; i < steps; ++i) {
    const double t = kStep * i;
    const JointMeasurement measured{position_of(t), velocity_of(t), 0.0};
    memory.velocity_error = velocity_error_after(memory, measured, kStep, limit);
    memory.position = measured.position;
    memory.velocity = measured.velocity;
  }
  return memory.velocity_error;
}

TEST(VelocityError, fault_45_IsNilForTrueMotion) {
  EXPECT_NEAR(
      velocity_error([](double t) { return 3.0 * t * t; }, [](double t) { return 6.0 * t; }, 1000),
      0.0, 1e-9);
  EXPECT_NEAR(velocity_error([](double t) { return 0.05 * std::sin(100.0 * t); },
                             [](double t) { return 5.0 * std::cos(100.0 * t); }, 1000),
              0.0, 0.01);
}

TEST(VelocityError, fault_45_GrowsToTheErrorWithItsTimeConstant) {
  const auto still = [](double) { return 0.3; };
  const auto wrong = [](double) { return 2.0; };
  EXPECT_NEAR(velocity_error(still, wrong, 101), 2.0 * (1.0 - std::exp(-1.0)), 0.02);
  EXPECT_NEAR(velocity_error(still, wrong, 2000), 2.0, 1e-6);
}

TEST(VelocityError, fault_45_IsNotSeenInStepsTooLongToTell) {
  JointLimit limit = kLimit;
  limit.velocity_error_time = 0.1;
  const JointMemory before{.position = 0.0, .velocity = 2.0};
  const JointMeasurement still{0.0, 2.0, 0.0};
  EXPECT_GT(velocity_error_after(before, still, 0.01, limit), 0.0);
  EXPECT_EQ(velocity_error_after(before, still, 0.011, limit), 0.0);
}

TEST(VelocityError, fault_45_IsAFaultAboveItsBound) {
  JointLimit limit = kLimit;
  limit.max_velocity_error = 1.0;
  EXPECT_EQ(check_velocity(0.99, limit), 0U);
  EXPECT_EQ(check_velocity(-1.01, limit), bit(Reason::kVelocityMismatch));
  EXPECT_EQ(check_velocity(1e6, kLimit), 0U) << "off";
}

// Returns for how many milliseconds, from the first on, a joint may measure `measured_at(i)` under
// the torque `torque_at(i)` before it counts as stuck. Returns `steps` if it never does.
template <class Measured, class Torque>
int steps_until_stuck(const Measured& measured_at, const Torque& torque_at, int steps) {
  JointLimit limit = kLimit;
  limit.stuck_time = 0.1;
  limit.stuck_torque = 0.2;
  JointMemory memory;
  for (int i = 0; i < steps; ++i) {
    const JointMeasurement measured = measured_at(i);
    memory = with_stillness(memory, measured, kStep, limit);
    if (check_stuck(memory.still_time, limit) != 0) return i;
    memory.position = measured.position;
    memory.velocity = measured.velocity;
    memory.applied_torque = torque_at(i);
  }
  return steps;
}
constexpr auto kStill = [](int) { return JointMeasurement{0.3, 0.0, 0.0}; };

TEST(Stuck, fault_45_IsAJointThatIsStillWhileItsTorqueVaries) {
  const auto varied = [](int i) { return i % 2 == 0 ? 0.15 : -0.15; };
  EXPECT_NEAR(steps_until_stuck(kStill, varied, 1000), 100, 1);
}

TEST(Stuck, fault_45_IsNotAJointThatIsPressedAgainstAWall) {
  EXPECT_EQ(steps_until_stuck(kStill, [](int) { return 0.36; }, 1000), 1000);
  EXPECT_EQ(steps_until_stuck(
                kStill, [](int i) { return 0.1 + 0.19 * (i % 2); }, 1000),
            1000)
      << "with a little more and a little less";
}

TEST(Stuck, fault_45_IsNotAJointThatIsLetGoAfterALongPress) {
  const auto follows_late = [](int i) { return JointMeasurement{i < 1050 ? 0.5 : 0.4}; };
  const auto lets_go = [](int i) { return i < 1000 ? 0.36 : 0.0; };
  EXPECT_EQ(steps_until_stuck(follows_late, lets_go, 2000), 2000);
}

TEST(Stuck, fault_45_IsNotAJointThatCameToRestUnderAnotherTorque) {
  const auto moves_at_first = [](int i) { return JointMeasurement{i < 500 ? 0.001 * i : 0.5}; };
  const auto lets_go = [](int i) { return i < 500 ? 0.36 : 0.0; };
  EXPECT_EQ(steps_until_stuck(moves_at_first, lets_go, 2000), 2000);
}

TEST(Stuck, fault_45_IsNotAJointThatMovesByTheLastBit) {
  const auto trembles = [](int i) {
    return JointMeasurement{i % 50 == 0 ? std::nextafter(0.3, 1.0) : 0.3};
  };
  EXPECT_EQ(steps_until_stuck(trembles, [](int i) { return i % 2 == 0 ? 0.3 : -0.3; }, 2000), 2000);
}

TEST(FaultOf, PutsAMeasurementThatCannotBeTrueBeforeWhatItSays) {
  EXPECT_EQ(fault_of(0), SafetyFault::kNone);
  EXPECT_EQ(fault_of(bit(Reason::kHardLimit) | bit(Reason::kPositionJumped)),
            SafetyFault::kPositionJumped);
  EXPECT_EQ(fault_of(bit(Reason::kDamped)), SafetyFault::kNone);
}

// --- The chain ---

TEST(SafetyChain, AppliesAHarmlessActionAsItIs) {
  const Applied applied = applied_for(Action::of_torque({0.1, -0.2, 0.3}));
  EXPECT_THAT(applied.torque, testing::ElementsAre(0.1, -0.2, 0.3));
  EXPECT_THAT(applied.reasons, Each(0U));
}

TEST(SafetyChain, AppliesTheDefaultGainsWithoutCallingItADifference) {
  const Applied applied = applied_for(Action::of_position({0.01, 0.0, 0.0}));
  EXPECT_DOUBLE_EQ(applied.torque[0], 7.0 * 0.01);
  EXPECT_EQ(applied.position_kp[0], 7.0);
  EXPECT_THAT(applied.reasons, Each(0U));
}

TEST(SafetyChain, KeepsEachJointsLimitsApart) {
  const JointLimits<9> limits = test::some_limits<9>();
  SafetyState<9> state;
  TriFinger::AppliedAction applied;
  (void)SafetyChain<TriFinger>(limits).apply(TriFinger::Action::of_torque(detail::filled<9>(100.0)),
                                             {}, kPeriod, state, applied);
  EXPECT_EQ(applied.torque, values_of(limits, &JointLimit::max_torque));
}

TEST(SafetyChain, fault_06_LetsOneBadJointHoldAndTheOthersMove) {
  const Chain chain(equal_limits());
  SafetyState<3> state;
  Applied applied;
  EXPECT_FALSE(chain.apply(Action::of_position({0.1, 0.1, 0.1}), {}, kPeriod, state, applied)
                   .action_rejected);

  Action bad = Action::of_position({0.2, 0.2, 0.2});
  bad.torque[1] = kNotGiven;
  const SafetyReport report = chain.apply(bad, {}, kPeriod, state, applied);
  EXPECT_TRUE(report.action_rejected);
  EXPECT_EQ(report.fault, SafetyFault::kNone);
  EXPECT_THAT(applied.position, testing::ElementsAre(0.2, 0.1, 0.2));
  EXPECT_TRUE(has(applied.reasons[1], Reason::kTorqueNotFinite));
}

TEST(SafetyChain, HoldsTheSameTargetHoweverManyBadActionsFollow) {
  const Chain chain(equal_limits());
  SafetyState<3> state;
  Applied applied;
  (void)chain.apply(Action::of_position({0.1, 0.1, 0.1}), {}, kPeriod, state, applied);
  for (int i = 0; i < 100; ++i) {
    (void)chain.apply(Action::of_torque(detail::filled<3>(kNotGiven)), {}, kPeriod, state, applied);
    ASSERT_THAT(applied.position, Each(0.1));
  }
}

TEST(SafetyChain, DoesNotReturnToATargetThatWasGivenUp) {
  const Chain chain(equal_limits());
  SafetyState<3> state;
  Applied applied;
  (void)chain.apply(Action::of_position({0.1, 0.1, 0.1}), {}, kPeriod, state, applied);
  (void)chain.apply(Action::of_torque({0.1, 0.1, 0.1}), {}, kPeriod, state, applied);
  (void)chain.apply(Action::of_torque(detail::filled<3>(kNotGiven)), {}, kPeriod, state, applied);
  EXPECT_THAT(applied.position, Each(testing::IsNan()));
  EXPECT_THAT(applied.torque, Each(0.0));
}

TEST(SafetyChain, fault_11_PushesBackAgainstAnyTorqueTargetAndGains) {
  const Observation beyond{.position = {1.6, 0.0, 0.0}};
  for (const double torque : {0.0, 0.36, 1e300}) {
    for (const double position : {kNotGiven, 1.5, 9.0, 1e300}) {
      Action action;
      action.torque[0] = torque;
      action.position[0] = position;
      action.position_kp[0] = 0.0;
      EXPECT_DOUBLE_EQ(applied_for(action, beyond).torque[0], -0.36) << torque << " " << position;
    }
  }
}

TEST(SafetyChain, fault_12_BrakesEveryJointWhenOneIsBeyondItsHardLimit) {
  const Chain chain(equal_limits());
  SafetyState<3> state;
  Applied applied;
  const Observation observation{.position = {0.0, 2.6, 0.0}, .velocity = {1.0, 1.0, -1.0}};
  const SafetyReport report =
      chain.apply(Action::of_torque({0.3, 0.3, 0.3}), observation, kPeriod, state, applied);
  EXPECT_EQ(report.fault, SafetyFault::kHardLimit);
  EXPECT_EQ(report.joint, 1);
  EXPECT_THAT(applied.torque, testing::ElementsAre(-0.09, -0.09, 0.09));
  EXPECT_THAT(applied.reasons, testing::ElementsAre(bit(Reason::kBraking),
                                                    bit(Reason::kBraking) | bit(Reason::kHardLimit),
                                                    bit(Reason::kBraking)));
}

TEST(SafetyChain, StopsOnAMeasurementThatIsNoNumber) {
  const Chain chain(equal_limits());
  SafetyState<3> state;
  Applied applied;
  const Observation observation{.position = {0.0, 0.0, 0.0}, .velocity = {0.0, 1.0, kNotGiven}};
  const SafetyReport report = chain.apply(Action{}, observation, kPeriod, state, applied);
  EXPECT_EQ(report.fault, SafetyFault::kBadMeasurement);
  EXPECT_EQ(report.joint, 2);
  EXPECT_THAT(applied.torque, testing::ElementsAre(0.0, -0.09, 0.0));
}

// A chain of one finger that has measured `before` once, and its verdict on `after`.
struct Judged {
  SafetyReport report;
  Applied applied;
};
Judged judged_after(const JointLimit& limit, const Observation& before, const Observation& after,
                    int steps = 1, const Action& action = {}) {
  const Chain chain(equal_limits(limit));
  SafetyState<3> state;
  Judged judged;
  (void)chain.apply(action, before, kPeriod, state, judged.applied);
  for (int i = 0; i < steps; ++i) {
    judged.report = chain.apply(action, after, kPeriod, state, judged.applied);
    if (judged.report.fault != SafetyFault::kNone) break;
  }
  return judged;
}

TEST(SafetyChain, fault_45_NamesTheJointThatJumpedAndDoesNotDampItByAVelocityItCannotTrust) {
  JointLimit limit = kLimit;
  limit.max_position_rate = 50.0;
  const auto [report, applied] =
      judged_after(limit, {}, {.position = {0.0, 0.1, 0.0}, .velocity = {1.0, 2.0, 0.0}});
  EXPECT_EQ(report.fault, SafetyFault::kPositionJumped);
  EXPECT_EQ(report.joint, 1);
  EXPECT_THAT(applied.torque, testing::ElementsAre(-0.09, 0.0, 0.0));
  EXPECT_EQ(fault_text_of(fault_code_of(report)),
            "joint 1 has measured a position that changed faster than it can move");
}

TEST(SafetyChain, fault_45_NamesTheJointWhoseVelocityIsNotThatOfItsPosition) {
  JointLimit limit = kLimit;
  limit.max_velocity_error = 1.0;
  limit.velocity_error_time = 0.1;
  const Observation lying{.velocity = {0.0, 0.0, 2.0}};
  const SafetyReport report = judged_after(limit, lying, lying, 1000).report;
  EXPECT_EQ(report.fault, SafetyFault::kVelocityMismatch);
  EXPECT_EQ(report.joint, 2);
}

TEST(SafetyChain, fault_45_NamesTheJointThatIsStuck) {
  JointLimit limit = kLimit;
  limit.stuck_torque = 0.2;
  limit.stuck_time = 0.1;
  const Chain chain(equal_limits(limit));
  SafetyState<3> state;
  Applied applied;
  SafetyReport report;
  Observation observation;
  for (int i = 0; i < 1000 && report.fault == SafetyFault::kNone; ++i) {
    // Joint 0 always gets an equal torque, and joint 2 moves.
    observation.position[2] = 1e-6 * i;
    const double torque = i % 2 == 0 ? 0.3 : -0.3;
    report =
        chain.apply(Action::of_torque({0.3, torque, torque}), observation, kPeriod, state, applied);
  }
  EXPECT_EQ(report.fault, SafetyFault::kStuck);
  EXPECT_EQ(report.joint, 1);
}

TEST(SafetyChain, fault_47_DeratesWhatAsksTooMuchForTooLongAndShowsTheMargin) {
  const Chain chain(equal_limits(kThermal));
  SafetyState<3> state;
  Applied applied;
  double margin = 1.0;
  for (int i = 0; i < 60'000; ++i) {
    const SafetyReport report =
        chain.apply(Action::of_torque({1e3, 0.1, 0.0}), {}, kPeriod, state, applied);
    ASSERT_EQ(report.fault, SafetyFault::kNone);
    ASSERT_LE(applied.thermal_margin[0], margin);
    ASSERT_GE(applied.thermal_margin[0], 0.0);
    margin = applied.thermal_margin[0];
  }
  EXPECT_NEAR(applied.torque[0], kThermal.continuous_torque, 0.01);
  EXPECT_TRUE(has(applied.reasons[0], Reason::kDerated));
  EXPECT_EQ(applied.reasons[1], 0U);
  EXPECT_EQ(applied.thermal_margin[2], 1.0);
}

TEST(SafetyChain, fault_47_StopsOnAMotorThatGivesMoreThanItWasTold) {
  const auto [report, applied] = judged_after(kThermal, {}, {.torque = {0.0, 0.25, 0.0}}, 60'000);
  EXPECT_EQ(report.fault, SafetyFault::kOverheated);
  EXPECT_EQ(report.joint, 1);
  EXPECT_LT(applied.thermal_margin[1], -0.19);
  EXPECT_EQ(fault_text_of(fault_code_of(report)),
            "joint 1 is too warm: it has given more torque than was commanded");
}

TEST(SafetyChain, fault_08_DampsAtOnceHoweverSlowTheTorqueMayChange) {
  JointLimit limit = with_torque_rate(0.1);
  for (const double velocity : {-3.0, 0.5, 4.0}) {
    const Observation moving{.velocity = detail::filled<3>(velocity)};
    const Applied applied = judged_after(limit, {}, moving).applied;
    EXPECT_THAT(applied.torque, Each(std::clamp(-0.09 * velocity, -0.36, 0.36)));
  }
}

TEST(SafetyReport, BecomesAFaultCodeWhoseTextNamesTheJoint) {
  const auto text_of = [](const SafetyReport& report) {
    return fault_text_of(fault_code_of(report));
  };
  EXPECT_EQ(text_of({.fault = SafetyFault::kHardLimit, .joint = 4}),
            "joint 4 is beyond its hard limit");
  EXPECT_EQ(text_of({.fault = SafetyFault::kBadMeasurement, .joint = 0}),
            "joint 0 has measured a position, velocity or torque that is no plausible number");
  EXPECT_EQ(text_of({.fault = SafetyFault::kHardLimit, .joint = 1000}),
            "a joint is beyond its hard limit");
  EXPECT_EQ(text_of({.fault = SafetyFault::kOwnCheck}), describe(SafetyFault::kOwnCheck));
  EXPECT_EQ(fault_code_of({}), 0);
  for (const int other : {0, 9, 64, -1, 256}) EXPECT_EQ(fault_text_of(other), "") << other;
}

// Returns how `describe` explains an action that was rejected.
std::string rejection_of(const Action& desired, Chain& chain) {
  SafetyState<3> state;
  Applied applied;
  const SafetyReport report = chain.apply(desired, {}, kPeriod, state, applied);
  EXPECT_TRUE(report.action_rejected);
  const RejectedCommand rejected = chain.find_rejected(desired, applied);
  const test::AllocationCounter allocations;
  const FixedText text = describe(rejected, "middle", chain.limits()[rejected.joint]);
  EXPECT_EQ(allocations.count(), 0U);
  return std::string(text.view());
}

TEST(RejectedCommand, fault_06_NamesFieldJointValueAndWhatIsAllowed) {
  Chain chain(equal_limits());
  const auto with = [](JointVector<3> Action::* field, std::size_t joint, double value) {
    Action action = Action::of_position({});
    (action.*field)[joint] = value;
    return action;
  };
  EXPECT_EQ(rejection_of(with(&Action::position_kd, 1, 1.0), chain),
            "position_kd of joint 1 (middle) is 1, allowed are 0 to 0.5 (max_kd)");
  EXPECT_EQ(rejection_of(with(&Action::position_kp, 2, -3.5), chain),
            "position_kp of joint 2 (middle) is -3.5, allowed are 0 to 50 (max_kp)");
  EXPECT_EQ(rejection_of(with(&Action::torque, 0, kNotGiven), chain),
            "torque of joint 0 (middle) is nan, allowed are finite numbers");
  EXPECT_EQ(rejection_of(with(&Action::position, 0, -kInfinity), chain),
            "position of joint 0 (middle) is -inf, allowed are finite numbers, and NaN for no "
            "target");
}

TEST(RejectedCommand, fault_06_SaysHowMuchElseWasNotFit) {
  Chain chain(equal_limits());
  Action action = Action::of_position({});
  action.position_kd = {0.1, 1.0, 1.0};
  EXPECT_EQ(rejection_of(action, chain),
            "position_kd of joint 1 (middle) is 1, allowed are 0 to 0.5 (max_kd); "
            "of the same action 1 more value was not fit");
  action.position_kp.fill(kInfinity);
  EXPECT_EQ(rejection_of(action, chain),
            "position_kp of joint 0 (middle) is inf, allowed are 0 to 50 (max_kp); "
            "of the same action 4 more values were not fit");
}

TEST(RejectedCommand, fault_06_DoesNotBlameTheUserForWhatACheckHasDone) {
  Chain chain(equal_limits());
  chain.add_check([](const Observation&, Action& action) { action.torque[2] = kInfinity; });
  EXPECT_EQ(rejection_of({}, chain),
            "torque of joint 2 (middle) was made invalid by a safety check that was added, allowed "
            "are finite numbers");
}

// --- A user's own checks ---

TEST(OwnCheck, ChangesTheActionAndIsNamedAsTheReason) {
  Chain chain(equal_limits());
  chain.add_check([](const Observation&, Action& action) { action.torque[1] = 0.0; });
  SafetyState<3> state;
  Applied applied;
  (void)chain.apply(Action::of_torque({0.1, 0.1, 0.1}), {}, kPeriod, state, applied);
  EXPECT_THAT(applied.torque, testing::ElementsAre(0.1, 0.0, 0.1));
  EXPECT_THAT(applied.reasons, testing::ElementsAre(0U, bit(Reason::kOwnCheck), 0U));
}

TEST(OwnCheck, SeesFiniteValuesAndFilledInGains) {
  Chain chain(equal_limits());
  bool is_finite = true;
  chain.add_check([&](const Observation&, Action& action) {
    for (std::size_t i = 0; i < 3; ++i) {
      is_finite = is_finite && std::isfinite(action.torque[i]);
      is_finite =
          is_finite && (std::isnan(action.position[i]) || std::isfinite(action.position_kp[i]));
    }
  });
  SafetyState<3> state;
  Applied applied;
  Action desired = Action::of_position({0.1, kInfinity, kNotGiven});
  desired.torque[0] = kNotGiven;
  (void)chain.apply(desired, {}, kPeriod, state, applied);
  EXPECT_TRUE(is_finite);
}

TEST(OwnCheck, CannotBreakALimit) {
  Chain chain(equal_limits());
  chain.add_check([](const Observation&, Action& action) {
    action.torque = {100.0, kNotGiven, 0.3};
    action.position[2] = 9.0;
    action.position_kp[2] = -5.0;
  });
  SafetyState<3> state;
  Applied applied;
  const Observation observation{.position = {1.6, 0.0, 0.0}};
  const SafetyReport report = chain.apply(Action{}, observation, kPeriod, state, applied);
  EXPECT_DOUBLE_EQ(applied.torque[0], -0.36);  // still pushed back
  EXPECT_EQ(applied.torque[1], 0.0);
  EXPECT_EQ(applied.torque[2], 0.0);
  EXPECT_TRUE(report.action_rejected);
  EXPECT_TRUE(has(applied.reasons[1], Reason::kTorqueNotFinite));
  EXPECT_TRUE(has(applied.reasons[2], Reason::kKpOutOfBounds));
}

TEST(OwnCheck, DoesNotWorkOnItsOwnResultWhileAJointHolds) {
  Chain chain(equal_limits());
  chain.add_check([](const Observation&, Action& action) { action.position[0] *= 0.5; });
  SafetyState<3> state;
  Applied applied;
  (void)chain.apply(Action::of_position({0.8, 0.0, 0.0}), {}, kPeriod, state, applied);
  for (int i = 0; i < 3; ++i) {
    (void)chain.apply(Action::of_torque(detail::filled<3>(kNotGiven)), {}, kPeriod, state, applied);
    EXPECT_EQ(applied.position[0], 0.4);
  }
}

TEST(OwnCheck, RunsInTheOrderInWhichItWasAdded) {
  Chain chain(equal_limits());
  chain.add_check([](const Observation&, Action& action) { action.torque[0] += 0.1; });
  chain.add_check([](const Observation&, Action& action) { action.torque[0] *= 2.0; });
  SafetyState<3> state;
  Applied applied;
  (void)chain.apply(Action{}, {}, kPeriod, state, applied);
  EXPECT_DOUBLE_EQ(applied.torque[0], 0.2);
}

// The result of a check that does `thrown`, for a finger whose first joint moves.
struct Thrown {
  SafetyFault fault;
  FixedText text;
  Applied applied;
};
Thrown after_check(const std::function<void()>& thrown) {
  Chain chain(equal_limits());
  chain.add_check([&](const Observation&, Action&) { thrown(); });
  SafetyState<3> state;
  Thrown result{};
  result.fault = chain
                     .apply(Action::of_torque({0.3, 0.3, 0.3}), {.velocity = {1.0, 0.0, 0.0}},
                            kPeriod, state, result.applied, &result.text)
                     .fault;
  return result;
}

TEST(OwnCheck, fault_16_ThatThrowsBrakesTheRobotAndItsTextIsKept) {
  const Thrown thrown = after_check([] { throw std::runtime_error("too near to the table"); });
  EXPECT_EQ(thrown.fault, SafetyFault::kOwnCheck);
  EXPECT_EQ(thrown.text.view(), "a safety check threw an exception: too near to the table");
  EXPECT_THAT(thrown.applied.torque, testing::ElementsAre(-0.09, 0.0, 0.0));
  EXPECT_TRUE(has(thrown.applied.reasons[0], Reason::kOwnCheckFailed));
  EXPECT_EQ(after_check([] { std::rethrow_exception(std::make_exception_ptr(3)); }).text.view(),
            "a safety check threw an object that is no std::exception, so there is no text");
}

TEST(OwnCheck, fault_63_ThatIsInterruptedBrakesTheRobotToo) {
  const Thrown thrown = after_check([] { throw Interrupted("Ctrl-C"); });
  EXPECT_EQ(thrown.fault, SafetyFault::kInterrupted);
  EXPECT_THAT(thrown.applied.torque, testing::ElementsAre(-0.09, 0.0, 0.0));
}

// --- Promises of the loop ---

TEST(SafetyChain, DoesNotAllocate) {
  SafetyChain<TriFinger> chain(test::some_limits<9>());
  double bound = 0.2;
  chain.add_check([&bound](const TriFinger::Observation&, TriFinger::Action& action) {
    action.torque[0] = std::min(action.torque[0], bound);
  });
  SafetyState<9> state;
  TriFinger::AppliedAction applied;
  TriFinger::Observation observation;
  TriFinger::Action bad;
  bad.torque[3] = kNotGiven;
  const test::AllocationCounter allocations;
  (void)chain.apply(TriFinger::Action::of_torque(detail::filled<9>(1.0)), observation, kPeriod,
                    state, applied);
  (void)chain.apply(bad, observation, kPeriod, state, applied);
  observation.position[4] = 9.0;
  (void)chain.apply(bad, observation, kPeriod, state, applied);
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(AllocationCounter, CountsWhatIsTaken) {
  const test::AllocationCounter allocations;
  // The operator is called directly, because a compiler may remove a new-expression.
  ::operator delete(::operator new(1));
  EXPECT_EQ(allocations.count(), 1U);
}

TEST(SafetyState, IsPlainData) {
  static_assert(std::is_trivially_copyable_v<SafetyState<9>>);
  static_assert(std::is_standard_layout_v<SafetyState<9>>);
}

}  // namespace
}  // namespace trifinger
