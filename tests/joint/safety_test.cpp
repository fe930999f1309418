// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/safety.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <new>
#include <stdexcept>
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

constexpr JointLimit kLimit{.max_torque = 0.36,
                            .safety_kd = 0.09,
                            .soft_lower = -1.0,
                            .soft_upper = 1.5,
                            .hard_lower = -2.0,
                            .hard_upper = 2.5,
                            .default_kp = 7.0,
                            .default_kd = 0.02,
                            .max_kp = 50.0,
                            .max_kd = 0.5};

// A finger whose three joints all have kLimit.
JointLimits<3> equal_limits() {
  return {.max_torque = detail::filled<3>(kLimit.max_torque),
          .safety_kd = detail::filled<3>(kLimit.safety_kd),
          .soft_lower = detail::filled<3>(kLimit.soft_lower),
          .soft_upper = detail::filled<3>(kLimit.soft_upper),
          .hard_lower = detail::filled<3>(kLimit.hard_lower),
          .hard_upper = detail::filled<3>(kLimit.hard_upper),
          .default_kp = detail::filled<3>(kLimit.default_kp),
          .default_kd = detail::filled<3>(kLimit.default_kd),
          .max_kp = detail::filled<3>(kLimit.max_kp),
          .max_kd = detail::filled<3>(kLimit.max_kd)};
}

// What a fresh chain applies.
Applied applied_for(const Action& desired, const Observation& observation = {}) {
  SafetyState<3> state;
  Applied applied;
  (void)Chain(equal_limits()).apply(desired, observation, state, applied);
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

TEST(AcceptCommand, NamesTheFieldThatIsNotFit) {
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

TEST(AcceptCommand, HoldsTheLastAcceptedTargetInsteadOfABadCommand) {
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

TEST(LimitTorque, BrakesAFastJointHoweverMuchTorqueIsAsked) {
  for (const double huge : {1e9, 1e300, std::numeric_limits<double>::max()}) {
    EXPECT_DOUBLE_EQ(limit_torque(huge, 2.0, kLimit).torque, 0.36 - 0.09 * 2.0);
    EXPECT_DOUBLE_EQ(limit_torque(-huge, -2.0, kLimit).torque, -0.36 + 0.09 * 2.0);
  }
}

TEST(LimitTorque, ClipsTheBrakeToo) {
  EXPECT_EQ(limit_torque(0.0, 1000.0, kLimit).torque, -kLimit.max_torque);
  EXPECT_EQ(limit_torque(0.0, -1000.0, kLimit).torque, kLimit.max_torque);
}

TEST(LimitTorque, TellsClippingFromDamping) {
  EXPECT_EQ(limit_torque(0.2, 0.0, kLimit).reasons, 0U);
  EXPECT_EQ(limit_torque(0.2, 1.0, kLimit).reasons, bit(Reason::kDamped));
  EXPECT_EQ(limit_torque(0.5, 0.0, kLimit).reasons, bit(Reason::kTorqueClipped));
  EXPECT_EQ(limit_torque(0.5, 1.0, kLimit).reasons,
            bit(Reason::kTorqueClipped) | bit(Reason::kDamped));
}

// --- Measurements ---

TEST(CheckMeasurement, RefusesWhatIsNoMeasurement) {
  for (const double bad : {kNotGiven, kInfinity, -kInfinity, 1e7, -1e7}) {
    EXPECT_EQ(check_measurement(bad, 0.0, kLimit), bit(Reason::kBadMeasurement)) << bad;
    EXPECT_EQ(check_measurement(0.0, bad, kLimit), bit(Reason::kBadMeasurement)) << bad;
  }
}

TEST(CheckMeasurement, AllowsAJointUpToItsHardLimit) {
  EXPECT_EQ(check_measurement(kLimit.hard_upper, 0.0, kLimit), 0U);
  EXPECT_EQ(check_measurement(std::nextafter(kLimit.hard_upper, 9.0), 0.0, kLimit),
            bit(Reason::kHardLimit));
  EXPECT_EQ(check_measurement(std::nextafter(kLimit.hard_lower, -9.0), 0.0, kLimit),
            bit(Reason::kHardLimit));
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
                                             {}, state, applied);
  EXPECT_EQ(applied.torque, limits.max_torque);
}

TEST(SafetyChain, LetsOneBadJointHoldAndTheOthersMove) {
  const Chain chain(equal_limits());
  SafetyState<3> state;
  Applied applied;
  EXPECT_FALSE(
      chain.apply(Action::of_position({0.1, 0.1, 0.1}), {}, state, applied).action_rejected);

  Action bad = Action::of_position({0.2, 0.2, 0.2});
  bad.torque[1] = kNotGiven;
  const SafetyReport report = chain.apply(bad, {}, state, applied);
  EXPECT_TRUE(report.action_rejected);
  EXPECT_EQ(report.fault, SafetyFault::kNone);
  EXPECT_THAT(applied.position, testing::ElementsAre(0.2, 0.1, 0.2));
  EXPECT_TRUE(has(applied.reasons[1], Reason::kTorqueNotFinite));
}

TEST(SafetyChain, HoldsTheSameTargetHoweverManyBadActionsFollow) {
  const Chain chain(equal_limits());
  SafetyState<3> state;
  Applied applied;
  (void)chain.apply(Action::of_position({0.1, 0.1, 0.1}), {}, state, applied);
  for (int i = 0; i < 100; ++i) {
    (void)chain.apply(Action::of_torque(detail::filled<3>(kNotGiven)), {}, state, applied);
    ASSERT_THAT(applied.position, Each(0.1));
  }
}

TEST(SafetyChain, DoesNotReturnToATargetThatWasGivenUp) {
  const Chain chain(equal_limits());
  SafetyState<3> state;
  Applied applied;
  (void)chain.apply(Action::of_position({0.1, 0.1, 0.1}), {}, state, applied);
  (void)chain.apply(Action::of_torque({0.1, 0.1, 0.1}), {}, state, applied);
  (void)chain.apply(Action::of_torque(detail::filled<3>(kNotGiven)), {}, state, applied);
  EXPECT_THAT(applied.position, Each(testing::IsNan()));
  EXPECT_THAT(applied.torque, Each(0.0));
}

TEST(SafetyChain, PushesBackAgainstAnyTorqueTargetAndGains) {
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

TEST(SafetyChain, BrakesEveryJointWhenOneIsBeyondItsHardLimit) {
  const Chain chain(equal_limits());
  SafetyState<3> state;
  Applied applied;
  const Observation observation{.position = {0.0, 2.6, 0.0}, .velocity = {1.0, 1.0, -1.0}};
  const SafetyReport report =
      chain.apply(Action::of_torque({0.3, 0.3, 0.3}), observation, state, applied);
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
  const SafetyReport report = chain.apply(Action{}, observation, state, applied);
  EXPECT_EQ(report.fault, SafetyFault::kBadMeasurement);
  EXPECT_EQ(report.joint, 2);
  EXPECT_THAT(applied.torque, testing::ElementsAre(0.0, -0.09, 0.0));
}

TEST(SafetyReport, BecomesAFaultCodeWhoseTextNamesTheJoint) {
  const auto text_of = [](const SafetyReport& report) {
    return fault_text_of(fault_code_of(report));
  };
  EXPECT_EQ(text_of({.fault = SafetyFault::kHardLimit, .joint = 4}),
            "joint 4 is beyond its hard limit");
  EXPECT_EQ(text_of({.fault = SafetyFault::kBadMeasurement, .joint = 0}),
            "joint 0 has measured a position or velocity that is no plausible number");
  EXPECT_EQ(text_of({.fault = SafetyFault::kHardLimit, .joint = 1000}),
            "a joint is beyond its hard limit");
  EXPECT_EQ(text_of({.fault = SafetyFault::kOwnCheck}), describe(SafetyFault::kOwnCheck));
  EXPECT_EQ(fault_code_of({}), 0);
  for (const int other : {0, 4, 64, -1, 256}) EXPECT_EQ(fault_text_of(other), "") << other;
}

// --- A user's own checks ---

TEST(OwnCheck, ChangesTheActionAndIsNamedAsTheReason) {
  Chain chain(equal_limits());
  chain.add_check([](const Observation&, Action& action) { action.torque[1] = 0.0; });
  SafetyState<3> state;
  Applied applied;
  (void)chain.apply(Action::of_torque({0.1, 0.1, 0.1}), {}, state, applied);
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
  (void)chain.apply(desired, {}, state, applied);
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
  const SafetyReport report = chain.apply(Action{}, observation, state, applied);
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
  (void)chain.apply(Action::of_position({0.8, 0.0, 0.0}), {}, state, applied);
  for (int i = 0; i < 3; ++i) {
    (void)chain.apply(Action::of_torque(detail::filled<3>(kNotGiven)), {}, state, applied);
    EXPECT_EQ(applied.position[0], 0.4);
  }
}

TEST(OwnCheck, RunsInTheOrderInWhichItWasAdded) {
  Chain chain(equal_limits());
  chain.add_check([](const Observation&, Action& action) { action.torque[0] += 0.1; });
  chain.add_check([](const Observation&, Action& action) { action.torque[0] *= 2.0; });
  SafetyState<3> state;
  Applied applied;
  (void)chain.apply(Action{}, {}, state, applied);
  EXPECT_DOUBLE_EQ(applied.torque[0], 0.2);
}

TEST(OwnCheck, ThatThrowsBrakesTheRobot) {
  Chain chain(equal_limits());
  chain.add_check([](const Observation&, Action&) { throw std::runtime_error("no"); });
  SafetyState<3> state;
  Applied applied;
  const Observation observation{.velocity = {1.0, 0.0, 0.0}};
  const SafetyReport report =
      chain.apply(Action::of_torque({0.3, 0.3, 0.3}), observation, state, applied);
  EXPECT_EQ(report.fault, SafetyFault::kOwnCheck);
  EXPECT_THAT(applied.torque, testing::ElementsAre(-0.09, 0.0, 0.0));
  EXPECT_TRUE(has(applied.reasons[0], Reason::kOwnCheckFailed));
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
  (void)chain.apply(TriFinger::Action::of_torque(detail::filled<9>(1.0)), observation, state,
                    applied);
  (void)chain.apply(bad, observation, state, applied);
  observation.position[4] = 9.0;
  (void)chain.apply(bad, observation, state, applied);
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(AllocationCounter, CountsWhatIsTaken) {
  const test::AllocationCounter allocations;
  // Called directly: a compiler may leave out what a new-expression would take.
  ::operator delete(::operator new(1));
  EXPECT_EQ(allocations.count(), 1U);
}

TEST(SafetyState, IsPlainData) {
  static_assert(std::is_trivially_copyable_v<SafetyState<9>>);
  static_assert(std::is_standard_layout_v<SafetyState<9>>);
}

}  // namespace
}  // namespace trifinger
