// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/health.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "joints.hpp"

namespace trifinger::apps {
namespace {

constexpr std::size_t kJoints = 2;

// Joints that follow exactly; their motors give weight and friction.
class Ideal {
 public:
  explicit Ideal(const MotionOptions& options = {})
      : motion(test::limits_of_joints(kJoints), options), health(motion), tally(kJoints) {
    motion.begin(std::vector<double>(kJoints, 0.2), std::vector<double>(kJoints, 0.2), 0);
    health.begin_session();
    position.assign(kJoints, 0.2);
    torque.assign(kJoints, 0.0);
  }

  void step() {
    const MotionStep step = motion.next();
    health.add(
        step, motion.position(),
        {.position = position, .torque = torque, .reasons = reasons, .thermal_margin = margin},
        tally);
    for (std::size_t i = 0; i < kJoints; ++i) {
      const double wanted = motion.position()[i];
      const double moved = i == blocked ? 0.0 : wanted - position[i];
      // Weight depends on the place in any way.
      torque[i] = 0.1 * std::cos(3.0 * position[i]) + (moved > 0.0 ? friction : -friction);
      position[i] += moved;
    }
  }

  RandomMotion motion;
  Health health;
  Tally tally;
  double friction{0.025};
  std::optional<std::size_t> blocked{};
  std::vector<double> position;
  std::vector<double> torque;
  std::array<std::uint64_t, kJoints> reasons{};
  std::array<double, kJoints> margin{1.0, 1.0};
};

std::optional<PassResult> run_pass(Ideal& robot) {
  for (int i = 0; i < 30'000; ++i) {
    robot.step();
    if (const auto pass = robot.health.take_pass()) return pass;
  }
  return std::nullopt;
}

TEST(Health, FindsTheFrictionWhateverTheWeight) {
  Ideal robot;
  const auto pass = run_pass(robot);
  ASSERT_TRUE(pass.has_value());
  EXPECT_FALSE(pass->hindered.has_value());
  for (const JointTally& joint : robot.tally.joints) {
    ASSERT_EQ(joint.passes, 1U);
    EXPECT_NEAR(joint.friction_sum, robot.friction, 1e-3);
  }
}

TEST(Health, NamesTheJointThatDoesNotFollow) {
  Ideal robot;
  robot.blocked = 1;
  const auto pass = run_pass(robot);
  ASSERT_TRUE(pass.has_value());
  EXPECT_EQ(pass->hindered, 1U);
  EXPECT_EQ(robot.tally.passes_failed, 1U);
  EXPECT_EQ(robot.tally.joints[0].passes, 1U);
  EXPECT_EQ(robot.tally.joints[1].passes, 0U);
}

TEST(Health, CountsACollisionOnceHoweverLongItLasts) {
  Ideal robot({.pass_every = Seconds(1e6)});
  ASSERT_TRUE(run_pass(robot).has_value());
  EXPECT_EQ(robot.tally.collisions, 0U);
  for (int i = 0; i < 20'000; ++i) robot.step();
  EXPECT_EQ(robot.tally.collisions, 0U) << "nothing was in the way";
  robot.blocked = 0;
  int hindrances = 0;
  for (int i = 0; robot.tally.collisions == 0; ++i) {
    ASSERT_LT(i, 100'000);
    robot.step();
  }
  // The reference stays far away as long as it stays beyond the same side.
  const double error = robot.motion.position()[0] - robot.position[0];
  for (int i = 0; i < 100; ++i) {
    robot.step();
    hindrances += robot.health.take_hindrance() ? 1 : 0;
  }
  EXPECT_GT(std::abs(error), 2 * 0.36 / 9.0);
  EXPECT_EQ(hindrances, 1);
  EXPECT_EQ(robot.tally.joints[0].collisions, 1U);
  EXPECT_EQ(robot.tally.joints[1].collisions, 0U);
}

TEST(Health, CountsTheWayAndTheStepsOfEachReason) {
  Ideal robot({.pass_every = Seconds(1e6)});
  robot.reasons = {bit(Reason::kDamped), bit(Reason::kDamped) | bit(Reason::kStuck)};
  robot.margin = {0.5, 0.25};
  double travel = 0.0;
  double before = robot.position[0];
  for (int i = 0; i < 10'000; ++i) {
    robot.step();
    if (i == 9'999) break;  // the last movement is seen in the next step only
    travel += std::abs(robot.position[0] - before);
    before = robot.position[0];
  }
  EXPECT_EQ(robot.tally.steps, 10'000U);
  EXPECT_NEAR(robot.tally.joints[0].travel, travel, 1e-9);
  EXPECT_EQ(robot.tally.reasons[8], 10'000U) << "a step counts once, not once per joint";
  EXPECT_EQ(robot.tally.reasons[19], 10'000U);
  EXPECT_EQ(robot.tally.reasons[7], 0U);
  EXPECT_EQ(robot.tally.joints[1].thermal_margin, 0.25);
}

}  // namespace
}  // namespace trifinger::apps
