// SPDX-License-Identifier: BSD-3-Clause
// Motors, encoders and tips that are not as described.
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "trifinger/sim/simulation.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger {
namespace {

// What a robot has measured, and what was true, step by step.
struct Motion {
  std::vector<TriFinger::Observation> seen{};
  std::vector<std::vector<double>> position{};  // true
  std::vector<std::vector<double>> velocity{};
  std::vector<double> thermal_margin{};  // of joint 0
};

// Moves with torques that differ from joint to joint and change their signs.
Motion move(const Variation& variation, int steps = 600) {
  const Simulation simulation;
  simulation.robot().vary(variation);
  simulation.robot().reset();
  auto robot = simulation.connect();
  Motion motion;
  const auto note_truth = [&] {
    const std::vector<double> all = simulation.robot().configuration();
    motion.position.emplace_back(all.begin(), all.begin() + 9);
    const auto velocities = all.begin() + simulation.robot().model().mujoco()->nq;
    motion.velocity.emplace_back(velocities, velocities + 9);
  };
  for (int step = 0; step < steps; ++step) {
    JointVector<9> torques{};
    for (std::size_t i = 0; i < torques.size(); ++i) {
      torques[i] = 0.15 * std::sin(0.05 * step + static_cast<double>(i));
    }
    note_truth();
    const TimeIndex t = robot.append_desired_action(JointAction<9>::of_torque(torques));
    motion.seen.push_back(robot.get_observation(t));
    motion.thermal_margin.push_back(robot.get_applied_action(t).thermal_margin[0]);
  }
  return motion;
}

TEST(ImperfectJoints, HaveEachAZeroOfItsOwnWithinTheError) {
  const Motion motion = move({.homing_error = 0.01, .seed = 3});
  const Motion other = move({.homing_error = 0.01, .seed = 4});
  JointVector<9> errors{};
  for (std::size_t joint = 0; joint < 9; ++joint) {
    errors[joint] = motion.seen[0].position[joint] - motion.position[0][joint];
    EXPECT_LE(std::abs(errors[joint]), 0.01);
    EXPECT_NE(errors[joint], other.seen[0].position[joint] - other.position[0][joint]);
    for (std::size_t t = 0; t < motion.seen.size(); ++t) {
      EXPECT_NEAR(motion.seen[t].position[joint] - motion.position[t][joint], errors[joint], 1e-12);
    }
  }
  std::ranges::sort(errors);
  EXPECT_EQ(std::ranges::adjacent_find(errors), errors.end());
  EXPECT_GT(errors[8] - errors[0], 0.005);
}

TEST(ImperfectJoints, AreSeenWhereTheyAreAfterAnotherDelay) {
  const Simulation simulation;
  for (const TimeIndex delay : {3, 0, 2, 5, 1, 0}) {
    simulation.robot().vary({.torque_delay = delay, .measurement_delay = delay});
    const std::vector<double> all = simulation.robot().configuration();
    auto robot = simulation.connect();
    for (int step = 0; step < 20; ++step) {
      JointVector<9> torques{};
      torques.fill(step % 2 == 0 ? 0.2 : -0.1);
      const TimeIndex t = robot.append_desired_action(JointAction<9>::of_torque(torques));
      if (step > 0) continue;
      for (std::size_t joint = 0; joint < 9; ++joint)
        EXPECT_EQ(robot.get_observation(t).position[joint], all[joint]) << delay;
    }
  }
}

TEST(ImperfectJoints, AreSeenWhereTheyWereThatManyStepsAgo) {
  for (const std::size_t delay : {std::size_t{1}, std::size_t{2}, std::size_t{10}}) {
    const Motion motion = move({.measurement_delay = static_cast<TimeIndex>(delay)});
    for (std::size_t t = 0; t < motion.seen.size(); ++t) {
      const std::size_t then = t < delay ? 0 : t - delay;
      for (std::size_t joint = 0; joint < 9; ++joint) {
        ASSERT_EQ(motion.seen[t].position[joint], motion.position[then][joint]) << t;
        ASSERT_EQ(motion.seen[t].velocity[joint], motion.velocity[then][joint]) << t;
      }
    }
  }
}

TEST(ImperfectJoints, HaveVelocitiesWithNoiseOfThatSize) {
  const Motion motion = move({.velocity_noise = 0.05});
  double sum = 0.0;
  double squares = 0.0;
  double products = 0.0;
  double count = 0.0;
  double last = 0.0;
  for (std::size_t t = 1; t < motion.seen.size(); ++t) {
    for (std::size_t joint = 0; joint < 9; ++joint) {
      EXPECT_EQ(motion.seen[t].position[joint], motion.position[t][joint]);
      const double noise = motion.seen[t].velocity[joint] - motion.velocity[t][joint];
      sum += noise;
      squares += noise * noise;
      products += noise * last;
      last = noise;
      ++count;
    }
  }
  // Six standard deviations of what independent numbers give.
  EXPECT_NEAR(sum / count, 0.0, 6 * 0.05 / std::sqrt(count));
  EXPECT_NEAR(std::sqrt(squares / count), 0.05, 6 * 0.05 / std::sqrt(2 * count));
  EXPECT_NEAR(products / squares, 0.0, 6 / std::sqrt(count));
}

TEST(ImperfectJoints, TurnWithinTheirPlay) {
  constexpr double kPlay = 0.006;
  const Motion motion = move({.backlash = kPlay});
  for (std::size_t joint = 0; joint < 9; ++joint) {
    double lowest = 1.0;
    double highest = -1.0;
    for (std::size_t t = 0; t < motion.seen.size(); ++t) {
      const double apart = motion.seen[t].position[joint] - motion.position[t][joint];
      lowest = std::min(lowest, apart);
      highest = std::max(highest, apart);
    }
    // The torques push both ways, so both ends are reached.
    EXPECT_NEAR(lowest, -0.5 * kPlay, 1e-12);
    EXPECT_NEAR(highest, 0.5 * kPlay, 1e-12);
  }
}

// Where joint 0 is after a torque that changes its sign so often, and where its motor is.
std::pair<double, double> alternate(double torque, int half_period, int steps) {
  const Simulation simulation;
  simulation.robot().vary({.backlash = 0.2});
  simulation.robot().reset();
  auto robot = simulation.connect();
  double seen = 0.0;
  for (int step = 0; step < steps; ++step) {
    JointVector<9> torques{};
    torques[0] = step / half_period % 2 == 0 ? torque : -torque;
    seen = robot.get_observation(robot.append_desired_action(JointAction<9>::of_torque(torques)))
               .position[0];
  }
  return {simulation.robot().true_position()[0], seen};
}

TEST(ImperfectJoints, DoNotFeelAMotorThatTurnsWithinItsPlay) {
  const auto [pushed, motor] = alternate(0.05, 4, 60);
  const auto [alone, idle] = alternate(0.0, 4, 60);
  EXPECT_EQ(pushed, alone);
  EXPECT_NE(motor, idle);
  // It has come to the end of its play, and pushes.
  EXPECT_NE(alternate(0.05, 200, 200).first, alternate(0.0, 200, 200).first);
}

// The accelerations by a torque of each motor of a robot that else hangs still.
JointVector<9> accelerations(const Variation& variation) {
  const auto run = [&](double torque) {
    const Simulation simulation;
    simulation.robot().vary(variation);
    simulation.robot().reset();
    auto robot = simulation.connect();
    JointVector<9> torques{};
    torques.fill(torque);
    (void)robot.append_desired_action(JointAction<9>::of_torque(torques));
    (void)robot.append_desired_action(JointAction<9>::of_torque(torques));
    return robot.get_observation(1).velocity;
  };
  const auto with = run(0.1);
  const auto without = run(0.0);
  JointVector<9> result{};
  for (std::size_t i = 0; i < result.size(); ++i) result[i] = (with[i] - without[i]) / 0.001;
  return result;
}

TEST(ImperfectJoints, HaveMotorsThatDifferWithinTheirSpread) {
  const JointVector<9> usual = accelerations({});
  const JointVector<9> weak = accelerations({.motor_gain = 0.8});
  const JointVector<9> spread = accelerations({.motor_spread = 0.2, .seed = 1});
  const JointVector<9> again = accelerations({.motor_spread = 0.2, .seed = 1});
  const JointVector<9> other = accelerations({.motor_spread = 0.2, .seed = 2});
  EXPECT_EQ(spread, again);
  EXPECT_NE(spread, other);
  // All motors of a finger together give what each gives; a finger's sum is within the spread.
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(weak[i], 0.8 * usual[i], 1e-6);
  EXPECT_NE(spread, usual);
}

TEST(ImperfectJoints, HaveTorquesThatComeAndGo) {
  const JointVector<9> usual = accelerations({});
  const JointVector<9> ripple = accelerations({.torque_ripple = 0.1, .seed = 1});
  EXPECT_NE(ripple, usual);
  // Fingers 0 and 1 are alike but for the phases of their motors.
  EXPECT_NE(ripple[0], ripple[3]);
}

TEST(ImperfectJoints, BeginWarm) {
  EXPECT_NEAR(move({.motor_heat = 0.6}, 1).thermal_margin[0], 0.4, 0.01);
  EXPECT_NEAR(move({}, 1).thermal_margin[0], 1.0, 0.01);
}

}  // namespace
}  // namespace trifinger
