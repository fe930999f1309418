// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/direct_simulation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "sim/robots.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::test {
namespace {

using testing::DoubleEq;
using testing::DoubleNear;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
using Direct = DirectSimulation<TriFinger>;
using Action = TriFinger::Action;

JointVector<9> all(double value) {
  JointVector<9> values{};
  values.fill(value);
  return values;
}

TEST(DirectSimulation, BeginsAtRestInTheInitialPoseOfEachVariant) {
  for (const SimulationOptions<Finger>& options : all_variants<Finger>()) {
    const DirectSimulation<Finger> direct(options);
    EXPECT_THAT(direct.observation().velocity, Each(0.0)) << label(options);
    EXPECT_THAT(direct.observation().torque, Each(0.0)) << label(options);
    EXPECT_EQ(direct.configuration_position().front(), direct.observation().position[0]);
  }
}

TEST(DirectSimulation, AppliesGainsOfItsOwnerWhereTheActionHasNone) {
  Direct direct({});
  JointVector<9> position = all(0.1);
  direct.set_joints(position, all(0.5));
  Action action;
  action.torque = all(0.01);
  action.position = all(0.2);
  action.position_kp = all(kNaN);
  action.position_kp[0] = 2.0;
  action.position_kd = all(kNaN);
  Action applied;
  direct.apply_control(action, {.kp = all(1.0), .kd = all(0.1), .max_torque = 1.0}, applied);
  EXPECT_DOUBLE_EQ(applied.torque[0], 0.01 + 2.0 * 0.1 - 0.1 * 0.5);
  EXPECT_DOUBLE_EQ(applied.torque[1], 0.01 + 1.0 * 0.1 - 0.1 * 0.5);
  EXPECT_EQ(applied.position_kp[0], 2.0);
  EXPECT_EQ(applied.position_kp[1], 1.0);
}

TEST(DirectSimulation, ClipsBeforeAndAfterDamping) {
  Direct direct({});
  direct.set_joints(direct.observation().position, all(2.0));
  Action action;
  action.torque = all(1e9);
  action.position = all(kNaN);
  Action applied;
  direct.apply_control(action, {.damping = all(0.1), .max_torque = 0.3}, applied);
  EXPECT_THAT(applied.torque, Each(DoubleEq(0.3 - 0.1 * 2.0)));
  action.torque = all(-1e9);
  direct.apply_control(action, {.damping = all(0.1), .max_torque = 0.3}, applied);
  EXPECT_THAT(applied.torque, Each(-0.3));
}

TEST(DirectSimulation, MeasuresTheTorqueOfTheLastStep) {
  Direct direct({});
  EXPECT_TRUE(direct.step(all(0.05)));
  EXPECT_THAT(direct.observation().torque, Each(DoubleEq(0.05)));
}

TEST(DirectSimulation, SaysThatItHasDivergedAfterATorqueThatIsNotANumber) {
  Direct direct({});
  JointVector<9> torque{};
  torque[4] = kNaN;
  EXPECT_FALSE(direct.step(torque));
}

TEST(DirectSimulation, IsEqualBitForBitInEachRun) {
  Direct first({});
  Direct second({});
  for (int i = 0; i < 200; ++i) {
    const JointVector<9> torque = all(0.1 * std::sin(0.1 * i));
    ASSERT_TRUE(first.step(torque));
    ASSERT_TRUE(second.step(torque));
  }
  EXPECT_EQ(first.observation().position, second.observation().position);
  EXPECT_EQ(first.observation().velocity, second.observation().velocity);
}

TEST(DirectSimulation, PlacesMovesAndPushesObjects) {
  Direct direct({});
  direct.place_object("cube", {.position = {0, 0, 0.6}, .orientation = {0, 0, 0, 1}});
  EXPECT_THAT(direct.object_pose("cube").position, ElementsAre(0, 0, 0.6));
  EXPECT_THAT(direct.object_pose("cube").orientation, ElementsAre(0, 0, 0, 1));
  direct.set_object_velocity("cube", {.linear = {0.1, 0, 0}, .angular = {0, 0, 1}});
  EXPECT_THAT(direct.object_velocity("cube").linear, ElementsAre(0.1, 0, 0));
  EXPECT_THAT(direct.object_velocity("cube").angular, ElementsAre(0, 0, 1));
  const double weight = 0.094 * 9.81;
  direct.push_object("cube", {0, 0, weight / 2}, {0, 0, 0});
  direct.push_object("cube", {0, 0, weight / 2}, {0, 0, 0});
  ASSERT_TRUE(direct.step({}));
  EXPECT_NEAR(direct.object_velocity("cube").linear[2], 0.0, 1e-4);
  ASSERT_TRUE(direct.step({}));  // a push lasts for one step
  EXPECT_NEAR(direct.object_velocity("cube").linear[2], -9.81e-3, 2e-4);
}

TEST(DirectSimulation, MovesAHeavierObjectLess) {
  std::array<double, 2> speeds{};
  for (std::size_t i = 0; i < 2; ++i) {
    Direct direct({});
    direct.place_object("cube", {.position = {0, 0, 0.6}});
    direct.set_object_mass("cube", i == 0 ? 0.1 : 0.2);
    direct.push_object("cube", {1, 0, 0}, {0, 0, 0.001});
    ASSERT_TRUE(direct.step({}));
    speeds[i] = direct.object_velocity("cube").linear[0];
  }
  EXPECT_NEAR(speeds[0], 0.01, 1e-4);
  EXPECT_NEAR(speeds[1], 0.005, 1e-4);
}

TEST(DirectSimulation, ContinuesFromAnotherOneWithTheObjectsThatBothHave) {
  Direct first({});
  first.place_object("cube", {.position = {0.02, 0, 0.3}});
  first.set_object_mass("cube", 0.5);
  ASSERT_TRUE(first.step(all(0.1)));
  SimulationOptions<TriFinger> options;
  options.description.objects.push_back(ball());
  options.description.objects.back().position = {{0, 0, 0.7}};
  Direct second(options);
  second.continue_from(first);
  EXPECT_EQ(second.observation().position, first.observation().position);
  EXPECT_EQ(second.observation().velocity, first.observation().velocity);
  EXPECT_EQ(second.observation().torque, first.observation().torque);
  EXPECT_EQ(second.object_pose("cube").position, first.object_pose("cube").position);
  EXPECT_THAT(second.object_pose("ball").position, ElementsAre(0, 0, DoubleNear(0.7, 1e-12)));
}

TEST(DirectSimulation, RefusesWhatItsObjectsCannotBe) {
  Direct direct({});
  const auto refuses = [](auto work, const std::string& text) {
    EXPECT_THAT(work, ThrowsMessage<InvalidArgument>(HasSubstr(text)));
  };
  refuses([&] { direct.place_object("dog", {}); }, "cube");
  refuses([&] { static_cast<void>(direct.object_pose("dog")); }, "cube");
  refuses([&] { direct.place_object("cube", {.orientation = {0, 0, 0, 0}}); }, "quaternion");
  refuses([&] { direct.place_object("cube", {.position = {0, kNaN, 0}}); }, "finite");
  refuses([&] { direct.set_object_mass("cube", 0.0); }, "above 0");
  refuses([&] { direct.push_object("cube", {kNaN, 0, 0}, {}); }, "force");
  refuses([&] { direct.set_object_velocity("cube", {.linear = {kNaN, 0, 0}}); }, "linear");
  refuses([&] { direct.set_joints(all(kNaN), {}); }, "position");
}

}  // namespace
}  // namespace trifinger::test
