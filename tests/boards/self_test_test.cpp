// SPDX-License-Identifier: BSD-3-Clause
#include "boards/self_test.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "boards/wiring_test.hpp"
#include "rig.hpp"

namespace trifinger::boards {
namespace {

using test::options_of_tests;
using test::Rig;
using testing::HasSubstr;

constexpr double kStep = 1e-3;

/// Joints with any inverse mass matrix, whose motors move other joints, forwards or backwards.
struct Miswired {
  std::size_t size;
  std::vector<double> inverse_mass;
  std::vector<std::size_t> joint_of_motor;
  std::vector<double> sign_of_motor;
  std::vector<double> position;
  std::vector<double> velocity;
  std::vector<double> weight;  // accelerations
  double friction{0.0};        // [Nm]
  double stop{0.0};            // 1 or -1: the joints cannot be beyond 0 in this direction

  void step(const std::vector<double>& torques) {
    std::vector<double> at_joints(size);
    for (std::size_t i = 0; i < size; ++i) {
      at_joints[joint_of_motor[i]] += sign_of_motor[i] * torques[i];
    }
    for (std::size_t i = 0; i < size; ++i) {
      at_joints[i] -= friction * std::tanh(velocity[i] / 0.01);
    }
    for (std::size_t i = 0; i < size; ++i) {
      double acceleration = weight[i];
      for (std::size_t k = 0; k < size; ++k) {
        acceleration += inverse_mass[i * size + k] * at_joints[k];
      }
      velocity[i] += kStep * acceleration;
    }
    for (std::size_t i = 0; i < size; ++i) {
      position[i] += kStep * velocity[i];
      if (stop * position[i] <= 0.0) continue;
      position[i] = 0.0;
      velocity[i] = 0.0;
    }
  }
};

// An inverse mass matrix of `size` joints, with any coupling that nature allows.
std::vector<double> any_inverse_mass(std::size_t size, std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::vector<double> root(size * size);
  for (double& x : root) x = normal(random);
  std::vector<double> matrix(size * size);
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t k = 0; k < size; ++k) {
      for (std::size_t m = 0; m < size; ++m) {
        matrix[i * size + k] += root[i * size + m] * root[k * size + m];
      }
      if (i == k) matrix[i * size + k] += 1.0;
    }
  }
  const double scale = 300.0 / static_cast<double>(size);  // [rad/s^2/Nm]
  for (double& x : matrix) x *= scale;
  return matrix;
}

std::vector<WiringFinding> findings_on(Miswired& plant) {
  const std::vector<double> most(plant.size, 0.3);
  WiringTest test(most, std::chrono::milliseconds(1));
  test.begin();
  std::vector<double> torques(plant.size);
  for (int i = 0; i < 100'000 && !test.is_done(); ++i) {
    test.next(plant.position, torques);
    plant.step(torques);
  }
  EXPECT_TRUE(test.is_done());
  return {test.findings().begin(), test.findings().end()};
}

TEST(WiringTest, fault_50_FindsAnyOrderAndAnySignsOfMotorsOnAnyJoints) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int round = 0; round < 300; ++round) {
    const std::size_t size = 1 + static_cast<std::size_t>(round) % 9;
    Miswired plant{.size = size,
                   .inverse_mass = any_inverse_mass(size, random),
                   .joint_of_motor = std::vector<std::size_t>(size),
                   .sign_of_motor = std::vector<double>(size),
                   .position = std::vector<double>(size),
                   .velocity = std::vector<double>(size),
                   .weight = std::vector<double>(size)};
    std::iota(plant.joint_of_motor.begin(), plant.joint_of_motor.end(), 0U);
    if (round % 2 == 1) std::ranges::shuffle(plant.joint_of_motor, random);
    for (std::size_t i = 0; i < size; ++i) {
      plant.sign_of_motor[i] = uniform(random) < 0.5 ? 1.0 : -1.0;
      plant.position[i] = 3.0 * uniform(random);
      plant.velocity[i] = 2.0 * uniform(random);
      plant.weight[i] = 20.0 * uniform(random);
    }
    const std::vector<WiringFinding> found = findings_on(plant);
    for (std::size_t i = 0; i < size; ++i) {
      ASSERT_TRUE(found[i].moves) << "round " << round << ", joint " << i;
      ASSERT_EQ(found[i].joint, plant.joint_of_motor[i]) << "round " << round << ", joint " << i;
      ASSERT_EQ(found[i].is_reversed, plant.sign_of_motor[i] < 0.0)
          << "round " << round << ", joint " << i;
    }
  }
}

TEST(WiringTest, fault_50_FrictionHidesNothing) {
  std::mt19937 random(11);
  for (int round = 0; round < 50; ++round) {
    Miswired plant{.size = 3,
                   .inverse_mass = any_inverse_mass(3, random),
                   .joint_of_motor = {0, 2, 1},
                   .sign_of_motor = {-1.0, 1.0, 1.0},
                   .position = {0.0, 0.0, 0.0},
                   .velocity = {0.0, 0.0, 0.0},
                   .weight = {0.0, 0.0, 0.0},
                   .friction = 0.04};
    const std::vector<WiringFinding> found = findings_on(plant);
    EXPECT_TRUE(found[0].is_reversed);
    EXPECT_EQ(found[0].joint, 0U);
    EXPECT_EQ(found[1].joint, 2U);
    EXPECT_EQ(found[2].joint, 1U);
  }
}

TEST(WiringTest, fault_50_JointsThatDoNotMoveAreNamedAndChangeNothingElse) {
  std::mt19937 random(13);
  Miswired plant{.size = 3,
                 .inverse_mass = any_inverse_mass(3, random),
                 .joint_of_motor = {0, 1, 2},
                 .sign_of_motor = {1.0, 0.0, 1.0},
                 .position = {0.0, 0.0, 0.0},
                 .velocity = {0.0, 0.0, 0.0},
                 .weight = {0.0, 0.0, 0.0}};
  const std::vector<WiringFinding> found = findings_on(plant);
  EXPECT_TRUE(found[0].moves);
  EXPECT_FALSE(found[1].moves);
  EXPECT_TRUE(found[2].moves);
  EXPECT_EQ(found[2].joint, 2U);
}

TEST(WiringTest, fault_50_AnEndStopIsNoReversedMotor) {
  for (const double stop : {1.0, -1.0}) {
    for (const double sign : {1.0, -1.0}) {
      for (const double weight : {0.0, 5.0, 30.0}) {
        Miswired plant{.size = 1,
                       .inverse_mass = {300.0},
                       .joint_of_motor = {0},
                       .sign_of_motor = {sign},
                       .position = {0.0},
                       .velocity = {0.0},
                       .weight = {stop * weight},
                       .stop = stop};
        const std::vector<WiringFinding> found = findings_on(plant);
        EXPECT_TRUE(found[0].moves);
        EXPECT_FALSE(found[0].is_hindered);
        EXPECT_EQ(found[0].is_reversed, sign < 0.0) << stop << ", " << sign << ", " << weight;
      }
    }
  }
}

TEST(WiringTest, MovesEachJointByAFewDegreesAndLeavesItAtRest) {
  std::mt19937 random(17);
  for (int round = 0; round < 20; ++round) {
    Miswired plant{.size = 9,
                   .inverse_mass = any_inverse_mass(9, random),
                   .joint_of_motor = {0, 1, 2, 3, 4, 5, 6, 7, 8},
                   .sign_of_motor = std::vector<double>(9, 1.0),
                   .position = std::vector<double>(9),
                   .velocity = std::vector<double>(9),
                   .weight = std::vector<double>(9)};
    WiringTest test(std::vector<double>(9, 0.3), std::chrono::milliseconds(1));
    test.begin();
    std::vector<double> torques(9);
    double farthest = 0.0;
    while (!test.is_done()) {
      test.next(plant.position, torques);
      plant.step(torques);
      for (const double x : plant.position) farthest = std::max(farthest, std::abs(x));
    }
    EXPECT_LT(farthest, 5.0 * std::numbers::pi / 180.0);
    for (const double v : plant.velocity) EXPECT_NEAR(v, 0.0, 1e-9);
  }
}

constexpr std::size_t kJoints = TriFinger::kJoints;

BoardRobotOptions options_with_test() {
  auto options = options_of_tests<TriFinger>();
  options.self_test = true;
  return options;
}

// How far the joints have ever been from where they began.
double way_of(const Rig<TriFinger>& rig, const JointVector<kJoints>& start) {
  double way = 0.0;
  for (std::size_t i = 0; i < kJoints; ++i) {
    way = std::max(way, std::abs(rig.joints.position()[i] - start[i]));
  }
  return way;
}

void expect_fault_that_says(Rig<TriFinger>& rig, const std::string& sentence) {
  rig.joints.weight = 0.0;
  const DriverReport report = rig.prepare();
  ASSERT_EQ(report.state, DriverReport::State::kFault);
  EXPECT_EQ(rig.robot->fault_text(report.fault_code), sentence);
  EXPECT_LT(way_of(rig, {}), 10.0 * std::numbers::pi / 180.0) << "nothing may move far";
  for (int i = 0; i < 20; ++i) rig.pass();
  for (std::size_t board = 0; board < rig.emulator->num_boards(); ++board) {
    for (const double current : rig.emulator->board(board).currents()) EXPECT_EQ(current, 0.0);
  }
}

TEST(SelfTest, fault_50_ExchangedMotorsAreFoundBeforeAnythingMovesFar) {
  Rig<TriFinger> rig(options_with_test());
  std::swap(rig.joints.joint_of_motor[4], rig.joints.joint_of_motor[5]);
  expect_fault_that_says(
      rig,
      "joint 4 is not what its motor moves: that is joint 5; exchange the cables "
      "of these motors, or those of their encoders");
}

TEST(SelfTest, fault_50_AMotorThatTurnsTheOtherWayIsFound) {
  Rig<TriFinger> rig(options_with_test());
  rig.joints.sign_of_motor[7] = -1.0;
  expect_fault_that_says(rig, "joint 7 turns against its torque; exchange two wires of its motor");
}

TEST(SelfTest, fault_50_ALooseJointIsFound) {
  Rig<TriFinger> rig(options_with_test());
  rig.joints.sign_of_motor[2] = 0.0;
  expect_fault_that_says(rig,
                         "joint 2 does not move when its motor is driven; check the motor's cable, "
                         "the belt, and what is in its way");
}

TEST(SelfTest, fault_50_EveryPairOfMotorsThatAreExchangedIsFound) {
  for (std::size_t i = 0; i < kJoints; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      Rig<TriFinger> rig(options_with_test());
      std::swap(rig.joints.joint_of_motor[i], rig.joints.joint_of_motor[k]);
      ASSERT_EQ(rig.prepare().state, DriverReport::State::kFault);
      EXPECT_EQ(rig.robot->report(i).wiring->joint, k);
      EXPECT_EQ(rig.robot->report(k).wiring->joint, i);
    }
  }
}

TEST(SelfTest, MeasuresLoadFrictionAndTheDistanceOfIndexes) {
  auto options = options_of_tests<TriFinger>();
  Rig<TriFinger> rig(options);
  rig.joints.friction = 0.03;
  rig.robot->set_preparation({.test = true});
  ASSERT_EQ(rig.prepare().state, DriverReport::State::kReady);
  for (std::size_t i = 0; i < kJoints; ++i) {
    const JointReport& report = rig.robot->report(i);
    ASSERT_TRUE(report.wiring && report.sweep);
    EXPECT_NEAR(report.sweep->friction, 0.03, 0.003);
    // The weight of the rig's joints pushes them upwards.
    EXPECT_NEAR(report.sweep->load, -rig.joints.weight * std::sin(0.3 + 0.017), 0.002);
    EXPECT_NEAR(report.index_distance, 2.0 * std::numbers::pi / 9.0, 1e-3);
  }
}

TEST(SelfTest, SaysWhatIsWrongWithWhatItHasMeasured) {
  const double distance = 2.0 * std::numbers::pi / 9.0;
  const JointReport good{.wiring = WiringFinding{.moves = true},
                         .sweep = SweepResult{.load = 0.06, .friction = 0.02, .error = 0.001},
                         .weight = 0.05,
                         .index_distance = distance};
  const auto problem = [&](const JointReport& found) {
    return problem_of(found, distance, "boards.gear_ratio");
  };
  EXPECT_EQ(problem(good), "");
  JointReport report = good;
  report.sweep->load = -0.06;
  EXPECT_THAT(problem(report), HasSubstr("its load is -0.06 Nm, its weight 0.05 Nm"));
  report = good;
  report.sweep->error = 0.034;
  EXPECT_THAT(problem(report), HasSubstr("does not follow"));
  report = good;
  report.sweep->friction = 0.15;
  EXPECT_THAT(problem(report), HasSubstr("friction is 0.15 Nm"));
  report = good;
  report.index_distance = 0.9 * distance;
  EXPECT_THAT(problem(report), HasSubstr("check how its encoder is fixed, and boards.gear_ratio"));
  EXPECT_THAT(problem({}), HasSubstr("not tested"));
}

TEST(Reference, GivesTheHomesOfTheJoints) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1.2, 1.2);
  for (int round = 0; round < 5; ++round) {
    JointVector<kJoints> pose{};
    for (double& angle : pose) angle = uniform(random);
    auto options = options_of_tests<TriFinger>();
    test::set_home_position(options, 0.0);  // nobody knows it yet
    test::set_method(options,
                     round % 2 == 0 ? HomingMethod::kEndStop : HomingMethod::kEndStopIndex);
    Rig<TriFinger> rig(options, pose);
    rig.robot->set_preparation({.reference = std::vector(pose.begin(), pose.end())});
    rig.joints.is_blocked = true;  // somebody holds the joints at the reference
    ASSERT_EQ(rig.prepare(2000).state, DriverReport::State::kBusy);
    ASSERT_EQ(rig.robot->phase(), BoardRobot::Phase::kReference);
    for (std::size_t board = 0; board < 6; ++board) {
      for (const double current : rig.emulator->board(board).currents()) EXPECT_EQ(current, 0.0);
    }
    rig.robot->take_reference();
    for (TimeIndex step = 2000; step < 2100; ++step) {
      rig.pass();
      ASSERT_EQ(rig.robot->prepare(step).state, DriverReport::State::kBusy);
      for (std::size_t board = 0; board < 6; ++board) {
        for (const double current : rig.emulator->board(board).currents()) EXPECT_EQ(current, 0.0);
      }
    }
    // It hangs somewhere else when the hands are away.
    rig.joints.is_blocked = false;
    for (int i = 0; i < 50; ++i) rig.pass();
    rig.robot->leave_reference();
    DriverReport report = DriverReport::busy();
    for (TimeIndex step = 2100; report.state == DriverReport::State::kBusy; ++step) {
      rig.pass();
      report = rig.robot->prepare(step);
    }
    ASSERT_EQ(report.state, DriverReport::State::kReady);
    rig.pass();
    ASSERT_EQ(rig.robot->get_latest_observation(&rig.observation).state,
              DriverReport::State::kReady);
    for (std::size_t i = 0; i < kJoints; ++i) {
      EXPECT_NEAR(rig.observation.position[i], rig.joints.position()[i], 0.002);
      if (options.motors[0].homing.method == HomingMethod::kEndStop) {
        EXPECT_NEAR(rig.robot->home_position()[i], 2.1011, 0.002);
      }
    }
  }
}

}  // namespace
}  // namespace trifinger::boards
