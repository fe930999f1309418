// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/variation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kGravity = 9.81;

// Holds for a number of steps; returns where the cube is.
ObjectPose wait(Frontend<TriFinger>& robot, const Simulation<TriFinger>& simulation, int steps) {
  const auto hold = hold_position(robot.latest_observation());
  for (int i = 0; i < steps; ++i) (void)robot.get_observation(robot.append_desired_action(hold));
  return simulation.robot().object_pose("cube");
}

TEST(Variation, OfTheMassIsFeltByAForceAndNotByGravity) {
  for (const double factor : {0.5, 1.0, 3.0}) {
    const Simulation<TriFinger> simulation;
    simulation.robot().vary({.object_mass = factor});
    simulation.robot().reset();
    simulation.robot().place_object("cube", {.position = {0.0, 0.0, 1.0}});
    auto robot = simulation.connect();
    simulation.robot().push_object("cube", {0.4, 0.0, 0.0});
    const ObjectPose pose = wait(robot, simulation, 100);
    EXPECT_NEAR(pose.position[0], 0.5 * 0.4 / (factor * cube().mass) * 0.01, 5e-4 / factor);
    EXPECT_NEAR(1.0 - pose.position[2], 0.5 * kGravity * 0.01, 1e-3);
  }
}

TEST(Variation, OfTheFrictionDecidesHowFarAnObjectSlides) {
  const auto slide = [](double factor) {
    const Simulation<TriFinger> simulation;
    simulation.robot().vary({.friction = factor});
    simulation.robot().reset();
    auto robot = simulation.connect();
    (void)wait(robot, simulation, 50);
    simulation.robot().push_object("cube", {2.0, 0.0, 0.0});
    (void)wait(robot, simulation, 10);
    simulation.robot().push_object("cube", {});
    return wait(robot, simulation, 100).position[0];
  };
  const double free = slide(0.0);
  const double rough = slide(1.0);
  EXPECT_GT(free, 2 * rough);
  EXPECT_GT(rough, slide(2.0));
}

// Steps from a change of the torque until the joints are elsewhere than without it.
TimeIndex steps_until_felt(TimeIndex delay) {
  constexpr TimeIndex kChange = 20;
  const auto run = [&](double torque) {
    const Simulation<TriFinger> simulation;
    simulation.robot().vary({.torque_delay = delay});
    auto robot = simulation.connect();
    std::vector<double> positions;
    for (TimeIndex t = 0; t < 50; ++t) {
      JointVector<9> torques{};
      if (t >= kChange) torques[0] = torque;
      (void)robot.append_desired_action(JointAction<9>::of_torque(torques));
      positions.push_back(robot.get_observation(t).position[0]);
    }
    return positions;
  };
  const std::vector<double> with = run(0.1);
  const std::vector<double> without = run(0.0);
  const auto [first, other] = std::ranges::mismatch(with, without);
  return (first - with.begin()) - kChange;
}

TEST(Variation, OfTheDelayMovesTheTorqueByThatManySteps) {
  for (const TimeIndex delay : {TimeIndex{0}, TimeIndex{1}, Variation::kMaxTorqueDelay}) {
    // What acts in a step is seen in the next one.
    EXPECT_EQ(steps_until_felt(delay), delay + 1);
  }
}

TEST(Variation, OfTheMotorsIsNotSeenInTheirTorque) {
  const auto run = [](double gain) {
    const Simulation<TriFinger> simulation;
    simulation.robot().vary({.motor_gain = gain});
    auto robot = simulation.connect();
    JointVector<9> torques{};
    torques[0] = 0.1;
    (void)robot.append_desired_action(JointAction<9>::of_torque(torques));
    (void)robot.append_desired_action(JointAction<9>::of_torque(torques));
    return robot.get_observation(1);
  };
  const auto weak = run(0.5);
  const auto usual = run(1.0);
  EXPECT_EQ(weak.torque, usual.torque);
  EXPECT_NE(weak.velocity[0], usual.velocity[0]);
  // Gravity is the same for both; so is half of the torque.
  const auto none = run(1e-9);
  EXPECT_NEAR(weak.velocity[0] - none.velocity[0], 0.5 * (usual.velocity[0] - none.velocity[0]),
              1e-6);
}

TEST(Variation, StaysWhateverIsResetAndGoesIntoSavedStates) {
  const Variation variation{
      .object_mass = 2.0, .friction = 0.7, .motor_gain = 0.9, .torque_delay = 3};
  const Simulation<TriFinger> simulation;
  simulation.robot().vary(variation);
  simulation.robot().reset();
  simulation.robot().place_object("cube", {.position = {0.0, 0.0, 0.1}});
  const SimulationState state = simulation.robot().save();
  auto robot = simulation.connect();
  const ObjectPose first = wait(robot, simulation, 300);

  const Simulation<TriFinger> other;
  other.robot().restore(state);
  auto other_robot = other.connect();
  const ObjectPose second = wait(other_robot, other, 300);
  EXPECT_EQ(first.position, second.position);
  EXPECT_EQ(first.orientation, second.orientation);
  EXPECT_EQ(robot.latest_observation().position, other_robot.latest_observation().position);
}

TEST(Variation, OfNothingChangesNothing) {
  const Simulation<TriFinger> simulation;
  const SimulationState before = simulation.robot().save();
  simulation.robot().vary({});
  EXPECT_EQ(simulation.robot().save(), before);
}

TEST(Variation, IsRefusedWhereItMakesNoSense) {
  SimulatedRobot<TriFinger> robot;
  const auto refuses = [&](const Variation& variation, const char* name) {
    EXPECT_THAT([&] { robot.vary(variation); },
                ThrowsMessage<InvalidArgument>(AllOf(HasSubstr(name), HasSubstr("must be"))));
  };
  refuses({.object_mass = 0.0}, "object_mass is 0");
  refuses({.friction = -1.0}, "friction is -1");
  refuses({.motor_gain = std::numeric_limits<double>::quiet_NaN()}, "motor_gain is nan");
  refuses({.torque_delay = Variation::kMaxTorqueDelay + 1}, "torque_delay is 11");
}

}  // namespace
}  // namespace trifinger
