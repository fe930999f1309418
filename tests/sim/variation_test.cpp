// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/variation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <initializer_list>
#include <limits>
#include <memory>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kGravity = 9.81;

// Holds for a number of steps. Returns where the cube is.
ObjectPose wait(Frontend<TriFinger>& robot, const Simulation& simulation, int steps) {
  const auto hold = hold_position(robot.latest_observation());
  for (int i = 0; i < steps; ++i) (void)robot.get_observation(robot.append_desired_action(hold));
  return simulation.robot().object_pose("cube");
}

TEST(Variation, OfTheMassIsFeltByAForceAndNotByGravity) {
  for (const double factor : {0.5, 1.0, 3.0}) {
    const Simulation simulation;
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
    const Simulation simulation;
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

TEST(Variation, OfThePairsIsForThemAlone) {
  const auto slide = [](SurfacePair pair, double factor) {
    const Simulation simulation;
    Variation variation;
    variation.pair_friction[pair] = factor;
    simulation.robot().vary(variation);
    simulation.robot().reset();
    simulation.robot().set_object_velocity("cube", {.linear = {0.3, 0.0, 0.0}});
    auto robot = simulation.connect();
    return wait(robot, simulation, 100).position[0];
  };
  const double usual = slide(SurfacePair::kObjectTable, 1.0);
  EXPECT_GT(slide(SurfacePair::kObjectTable, 0.0), 1.3 * usual);
  EXPECT_LT(slide(SurfacePair::kObjectTable, 2.0), usual);
  EXPECT_NEAR(slide(SurfacePair::kTipObject, 0.0), usual, 1e-9);
  EXPECT_NEAR(slide(SurfacePair::kLinkLink, 5.0), usual, 1e-9);
}

TEST(Variation, OfTheContactsDecidesHowFarADroppedCubeSinks) {
  const auto sink = [](double factor) {
    const Simulation simulation;
    simulation.robot().vary({.contact_time = factor});
    simulation.robot().reset();
    simulation.robot().place_object("cube", {.position = {0.0, 0.0, 0.08}});
    auto robot = simulation.connect();
    double lowest = 1.0;
    for (int i = 0; i < 200; ++i) lowest = std::min(lowest, wait(robot, simulation, 1).position[2]);
    return 0.5 * cube().size[2] - lowest;
  };
  EXPECT_LT(sink(1.0), 1e-3);
  EXPECT_GT(sink(10.0), 4e-3);
}

// Checks what is set in the model, including joints and the pairs that the description has.
TEST(Variation, ReachesTheModel) {
  SimulationOptions options;
  options.description.actuator = ActuatorParameters{.friction = 0.01};
  options.description.contact.friction = {{SurfacePair::kTipObject, 0.8}};
  const Simulator simulator(options);
  Variation variation{.friction = 0.5,
                      .contact_time = 2.0,
                      .rotor_inertia = 3.0,
                      .joint_damping = 4.0,
                      .joint_friction = 0.02,
                      .stop_margin = 0.5,
                      .tip_radius = 1.1};
  variation.pair_friction[SurfacePair::kTipObject] = 0.25;
  variation.pair_friction[SurfacePair::kObjectTable] = 0.3;
  const SceneModel::Compiled varied = simulator.make_varied_model(variation);
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(varied.get()), mj_deleteData);
  const mjModel& usual = *simulator.model().mujoco();
  // Done twice: only the model counts, not what was varied before.
  for (int round = 0; round < 2; ++round) {
    simulator.vary(variation, *varied, *data);
    for (int i = 0; i < 9; ++i) {
      EXPECT_DOUBLE_EQ(varied->dof_armature[i], 3.0 * usual.dof_armature[i]);
      EXPECT_DOUBLE_EQ(varied->dof_damping[i], 4.0 * usual.dof_damping[i]);
      EXPECT_DOUBLE_EQ(varied->dof_frictionloss[i], 0.01 + 0.02);
      EXPECT_DOUBLE_EQ(varied->jnt_range[2 * i], usual.jnt_range[2 * i] + 0.1);
      EXPECT_DOUBLE_EQ(varied->jnt_range[2 * i + 1], usual.jnt_range[2 * i + 1] - 0.1);
    }
    for (const int tip : simulator.model().tip_geoms()) {
      EXPECT_DOUBLE_EQ(varied->geom_size[3 * tip], 1.1 * usual.geom_size[3 * tip]);
      EXPECT_DOUBLE_EQ(varied->geom_rbound[tip], 1.1 * usual.geom_rbound[tip]);
      EXPECT_DOUBLE_EQ(varied->geom_aabb[6 * tip + 3], 1.1 * usual.geom_aabb[6 * tip + 3]);
    }
    ASSERT_EQ(static_cast<int>(varied->npair), 3 + 1);
    int of_tips = 0;
    for (int pair = 0; pair < 4; ++pair) {
      const bool is_tip =
          std::ranges::count(simulator.model().tip_geoms(), varied->pair_geom1[pair]) +
              std::ranges::count(simulator.model().tip_geoms(), varied->pair_geom2[pair]) >
          0;
      of_tips += is_tip ? 1 : 0;
      EXPECT_DOUBLE_EQ(varied->pair_friction[5 * pair], 0.5 * (is_tip ? 0.25 * 0.8 : 0.3 * 0.5));
      EXPECT_DOUBLE_EQ(varied->pair_friction[5 * pair + 1], varied->pair_friction[5 * pair]);
      EXPECT_DOUBLE_EQ(varied->pair_solref[2 * pair], is_tip ? 0.012 : 0.004);
    }
    EXPECT_EQ(of_tips, 3);
  }
}

// Returns the steps from a change of the torque until the joints differ from the motion without it.
TimeIndex steps_until_felt(TimeIndex delay) {
  constexpr TimeIndex kChange = 20;
  const auto run = [&](double torque) {
    const Simulation simulation;
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
  for (const TimeIndex delay : {TimeIndex{0}, TimeIndex{1}, Variation::kMaxDelay}) {
    // The effect of a step is visible in the next one.
    EXPECT_EQ(steps_until_felt(delay), delay + 1);
  }
}

TEST(Variation, OfTheMotorsIsNotSeenInTheirTorque) {
  const auto run = [](double gain) {
    const Simulation simulation;
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
  // Gravity is equal for both, and so is half of the torque.
  const auto none = run(1e-9);
  EXPECT_NEAR(weak.velocity[0] - none.velocity[0], 0.5 * (usual.velocity[0] - none.velocity[0]),
              1e-6);
}

TEST(Variation, StaysWhateverIsResetAndGoesIntoSavedStates) {
  Variation variation{.object_mass = 2.0,
                      .friction = 0.7,
                      .contact_time = 1.5,
                      .motor_gain = 0.9,
                      .torque_delay = 3,
                      .rotor_inertia = 0.8,
                      .joint_damping = 2.0,
                      .joint_friction = 0.005,
                      .stop_margin = 0.5,
                      .homing_error = 0.01,
                      .motor_spread = 0.1,
                      .torque_ripple = 0.05,
                      .seed = 9,
                      .backlash = 0.004,
                      .measurement_delay = 2,
                      .velocity_noise = 0.02,
                      .motor_heat = 0.5,
                      .tip_radius = 1.1};
  variation.pair_friction[SurfacePair::kObjectTable] = 0.6;
  const Simulation simulation;
  simulation.robot().vary(variation);
  simulation.robot().reset();
  simulation.robot().place_object("cube", {.position = {0.0, 0.0, 0.1}});
  const SimulationState state = simulation.robot().save();
  auto robot = simulation.connect();
  const ObjectPose first = wait(robot, simulation, 300);

  const Simulation other;
  other.robot().restore(state);
  auto other_robot = other.connect();
  const ObjectPose second = wait(other_robot, other, 300);
  EXPECT_EQ(first.position, second.position);
  EXPECT_EQ(first.orientation, second.orientation);
  EXPECT_EQ(robot.latest_observation().position, other_robot.latest_observation().position);
}

TEST(Variation, LeavesNothingOfTheOneBefore) {
  Variation pairs{.friction = 0.5, .stop_margin = 2.0};
  pairs.pair_friction[SurfacePair::kObjectTable] = 0.3;
  const Variation variation{.object_mass = 2.0, .joint_damping = 3.0};
  const auto result = [](std::initializer_list<Variation> all) {
    const Simulation simulation;
    for (const Variation& one : all) simulation.robot().vary(one);
    auto robot = simulation.connect();
    static_cast<void>(wait(robot, simulation, 100));
    return simulation.robot().save();
  };
  const SimulationState expected = result({variation});
  EXPECT_EQ(result({{.friction = 0.1, .contact_time = 2.0}, variation}), expected);
  EXPECT_EQ(result({pairs, variation}), expected);
}

TEST(Variation, OfNothingChangesNothing) {
  const Simulation simulation;
  const SimulationState before = simulation.robot().save();
  simulation.robot().vary({});
  EXPECT_EQ(simulation.robot().save(), before);
}

TEST(Variation, IsRefusedWhereItMakesNoSense) {
  SimulatedRobot robot;
  const auto refuses = [&](const Variation& variation, const char* name) {
    EXPECT_THAT([&] { robot.vary(variation); },
                ThrowsMessage<InvalidArgument>(AllOf(HasSubstr(name), HasSubstr("must be"))));
  };
  refuses({.object_mass = 0.0}, "object_mass is 0");
  refuses({.friction = -1.0}, "friction is -1");
  refuses({.motor_gain = std::numeric_limits<double>::quiet_NaN()}, "motor_gain is nan");
  refuses({.torque_delay = Variation::kMaxDelay + 1}, "torque_delay is 11");
  refuses({.contact_time = 0.0}, "contact_time is 0");
  refuses({.rotor_inertia = -1.0}, "rotor_inertia is -1");
  refuses({.joint_damping = -1.0}, "joint_damping is -1");
  refuses({.joint_friction = -0.1}, "joint_friction is -0.1");
  refuses({.stop_margin = -1.0}, "stop_margin is -1");
  refuses({.homing_error = -1.0}, "homing_error is -1");
  refuses({.motor_spread = 1.0}, "motor_spread is 1");
  refuses({.torque_ripple = 1.0}, "torque_ripple is 1");
  refuses({.backlash = -1.0}, "backlash is -1");
  refuses({.measurement_delay = -1}, "measurement_delay is -1");
  refuses({.velocity_noise = -1.0}, "velocity_noise is -1");
  refuses({.motor_heat = 1.0}, "motor_heat is 1");
  refuses({.tip_radius = 0.0}, "tip_radius is 0");
  Variation pairs;
  pairs.pair_friction[SurfacePair::kTipTable] = -0.5;
  refuses(pairs, "pair_friction of tip_table is -0.5");
}

}  // namespace
}  // namespace trifinger
