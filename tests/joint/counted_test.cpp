// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/counted.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "joint/limits_of_tests.hpp"
#include "support/allocation_counter.hpp"
#include "support/message_of.hpp"
#include "trifinger/joint/safety.hpp"

namespace trifinger {
namespace {

constexpr Nanoseconds kPeriod = std::chrono::milliseconds(1);

std::vector<JointKind> hinges(std::size_t count) { return {count, JointKind::kHinge}; }

TEST(CountedJoints, HaveTheElementsOfARobotWithThatManyJoints) {
  const RobotTypes counted = describe_counted("arm", hinges(9));
  EXPECT_EQ(counted.type, "arm");
  EXPECT_EQ(counted.action, describe<JointAction<9>>());
  EXPECT_EQ(counted.applied_action, describe<AppliedJointAction<9>>());
  EXPECT_EQ(counted.observation, (describe<JointObservation<9>>()));
  EXPECT_EQ(counted.default_action, detail::bytes_of(JointAction<9>{}));
}

TEST(CountedJoints, HaveTheUnitsOfTheirKind) {
  constexpr std::array kSlides{JointKind::kSlide, JointKind::kSlide};
  constexpr std::array kBoth{JointKind::kHinge, JointKind::kSlide};
  EXPECT_EQ(describe_counted("gripper", kSlides).action.text(),
            "torque float64[2] N\n"
            "position float64[2] m\n"
            "position_kp float64[2] N/m\n"
            "position_kd float64[2] Ns/m\n");
  const RobotTypes both = describe_counted("arm", kBoth);
  EXPECT_EQ(both.observation.find("velocity")->unit, "rad/s or m/s");
  EXPECT_EQ(ElementDescription::parse(both.observation.text()), both.observation);
}

TEST(CountedJoints, MayMeasureMore) {
  const std::array more{FieldDescription{
      .name = "joint_position", .type = ScalarType::kFloat64, .shape = {3}, .unit = "rad"}};
  const RobotTypes types = describe_counted("hand", hinges(2), more);
  EXPECT_EQ(types.observation.fields().back().name, "joint_position");
  EXPECT_EQ(types.observation.size(), (3 * 2 + 3) * sizeof(double));
}

TEST(CountedJoints, AreAtLeastOneAndAtMostSoMany) {
  EXPECT_EQ(test::message_of<InvalidArgument>([] { (void)describe_counted("arm", hinges(0)); }),
            "a robot has 0 joints, must have 1 to 128");
  EXPECT_EQ(test::message_of<InvalidArgument>(
                [] { (void)describe_counted("arm", hinges(kMaxCountedJoints + 1)); }),
            "a robot has 129 joints, must have 1 to 128");
  EXPECT_NO_THROW((void)describe_counted("arm", hinges(kMaxCountedJoints)));
}

TEST(CountedJoints, AreFollowedByWhatElseIsMeasured) {
  CountedObservation observation(2);
  observation.torque[1] = 0.5;
  constexpr std::array kPosition{1.0, 2.0, 3.0};
  constexpr std::array kVelocity{4.0, 5.0, 6.0};
  constexpr std::array kTipForce{7.0};
  std::array<double, 3 * 2 + 2 * 3 + 1> element{};
  write_element(observation, kPosition, kVelocity, kTipForce, element.data());
  EXPECT_THAT(element, testing::ElementsAre(0, 0, 0, 0, 0, 0.5, 1, 2, 3, 4, 5, 6, 7));
}

TEST(CountedJoints, ComeBackFromAnElementAsTheyWere) {
  JointAction<5> packed;
  for (std::size_t i = 0; i < 5; ++i) {
    packed.torque[i] = 0.1 * static_cast<double>(i);
    packed.position[i] = 1.0 + static_cast<double>(i);
    packed.position_kp[i] = 2.0 + static_cast<double>(i);
    packed.position_kd[i] = 3.0 + static_cast<double>(i);
  }
  CountedAction action(5);
  read_element(&packed, action);
  EXPECT_THAT(action.position_kd, testing::ElementsAre(3.0, 4.0, 5.0, 6.0, 7.0));
  JointAction<5> again;
  write_element(action, &again);
  EXPECT_EQ(detail::bytes_of(again), detail::bytes_of(packed));
}

// Numbers like those of a hostile user and a broken sensor.
class Chance {
 public:
  explicit Chance(std::uint32_t seed) : engine_(seed) {}

  [[nodiscard]] double number(double size) {
    constexpr std::array kNasty{std::numeric_limits<double>::quiet_NaN(),
                                std::numeric_limits<double>::infinity(),
                                -std::numeric_limits<double>::max(),
                                1e300,
                                0.0,
                                -0.0};
    const auto draw = static_cast<std::uint32_t>(engine_());
    if (draw % 16 == 0) return kNasty[(draw / 16) % kNasty.size()];
    return size * (static_cast<double>(engine_()) / 2147483648.0 - 1.0);
  }
  [[nodiscard]] bool one_in(std::uint32_t count) { return engine_() % count == 0; }

 private:
  std::mt19937 engine_;
};

TEST(CountedJoints, AreCheckedByTheSameChainBitForBit) {
  const JointLimits<9> limits = test::some_limits<9>();
  const SafetyChain<TriFinger> fixed_chain(limits);
  const SafetyChain<CountedJoints> counted_chain({limits.begin(), limits.end()});
  SafetyState<9> fixed_state;
  CountedSafetyState counted_state{.joints = std::vector<JointMemory>(9)};
  CountedAction counted_action(9);
  CountedObservation counted_observation(9);
  CountedAppliedAction counted_applied(9);
  Chance chance(1);
  for (int step = 0; step < 20'000; ++step) {
    JointAction<9> action;
    JointObservation<9, 3> observation;
    for (std::size_t i = 0; i < 9; ++i) {
      action.torque[i] = chance.number(1.0);
      action.position[i] = chance.number(3.0);
      action.position_kp[i] = chance.number(50.0);
      action.position_kd[i] = chance.number(0.5);
      // Most measurements are true, or the chain would only brake.
      observation.position[i] = chance.one_in(500) ? chance.number(5.0) : 1e-3 * (step % 7);
      observation.velocity[i] = chance.one_in(500) ? chance.number(50.0) : 0.1;
    }
    read_element(&action, counted_action);
    read_element(&observation, counted_observation);

    AppliedJointAction<9> applied;
    const SafetyReport report =
        fixed_chain.apply(action, observation, kPeriod, fixed_state, applied);
    const SafetyReport counted_report = counted_chain.apply(
        counted_action, counted_observation, kPeriod, counted_state, counted_applied);

    AppliedJointAction<9> written;
    write_element(counted_applied, &written);
    ASSERT_EQ(std::memcmp(&written, &applied, sizeof(applied)), 0) << step;
    ASSERT_EQ(counted_report.fault, report.fault) << step;
    ASSERT_EQ(counted_report.joint, report.joint) << step;
    ASSERT_EQ(counted_report.action_rejected, report.action_rejected) << step;
  }
}

TEST(CountedJoints, NeedNoMemoryFromTheHeapInAStep) {
  const std::vector<JointLimit> limits(kMaxCountedJoints, test::some_limits<1>()[0]);
  const SafetyChain<CountedJoints> chain(limits);
  CountedSafetyState state{.joints = std::vector<JointMemory>(kMaxCountedJoints)};
  const CountedAction action(kMaxCountedJoints);
  const CountedObservation observation(kMaxCountedJoints);
  CountedAppliedAction applied(kMaxCountedJoints);
  const test::AllocationCounter allocations;
  (void)chain.apply(action, observation, kPeriod, state, applied);
  EXPECT_EQ(allocations.count(), 0);
}

}  // namespace
}  // namespace trifinger
