// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/guiding/guide_controller.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "guiding/robots.hpp"
#include "support/allocation_counter.hpp"
#include "support/soak.hpp"

namespace trifinger::test {
namespace {

using namespace guiding;

constexpr double kPeriod = 1e-3;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kRounding = 1e-12;

template <class R>
class GuideControllerOf : public ::testing::Test {
 protected:
  static constexpr int kJoints = static_cast<int>(R::kJoints);
  static constexpr int kFingers = static_cast<int>(R::kTips);

  const GuidedRobot robot_ = guided_robot(guided_options<R>().description);
  const GuideSpeeds speeds_{};
  std::mt19937 random_{7};

  double uniform(double least, double most) {
    return std::uniform_real_distribution<double>(least, most)(random_);
  }
  [[nodiscard]] double soft_lower(int joint) const {
    return robot_.limits[static_cast<std::size_t>(joint)].soft_lower;
  }
  [[nodiscard]] double soft_upper(int joint) const {
    return robot_.limits[static_cast<std::size_t>(joint)].soft_upper;
  }
  // Positions within the soft limits, `margin` away from them.
  JointValues random_pose(double margin = 0.0) {
    JointValues pose(kJoints);
    for (int i = 0; i < kJoints; ++i)
      pose[i] = uniform(soft_lower(i) + margin, soft_upper(i) - margin);
    return pose;
  }
  Setpoint random_setpoint() {
    const int choice = std::uniform_int_distribution<int>(0, 9)(random_);
    if (choice == 0) return {.mode = Mode::kHold};
    if (choice == 1) return {.mode = Mode::kHome};
    if (choice == 2) return {.mode = Mode::kFloat};
    if (choice <= 5) {
      Setpoint setpoint{.mode = Mode::kMoveJoints, .joints = JointValues(kJoints)};
      for (int i = 0; i < kJoints; ++i) setpoint.joints[i] = uniform(-4.0, 4.0);
      return setpoint;
    }
    return {.mode = Mode::kMoveTip,
            .finger = std::uniform_int_distribution<int>(0, kFingers - 1)(random_),
            .tip = {uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(-0.2, 0.7)}};
  }
  static MeasuredJoints at_rest(const JointValues& position) {
    return {.position = position, .velocity = JointValues::Zero(position.size())};
  }
  // Checks what always holds between two steps.
  void expect_lawful(const ControllerState& before, const ControllerState& after,
                     const GuideCommand& command) const {
    ASSERT_TRUE(command.torque.allFinite());
    if (after.mode == Mode::kFloat) {
      ASSERT_TRUE(command.position.array().isNaN().all());
      return;
    }
    ASSERT_TRUE(command.position.allFinite());
    // While floating there was no reference that could jump.
    const JointValues& reference = before.mode == Mode::kFloat ? before.measured : before.reference;
    for (int i = 0; i < kJoints; ++i) {
      ASSERT_LE(std::abs(after.reference[i] - reference[i]),
                speeds_.joint_speed * kPeriod + kRounding);
      ASSERT_GE(after.reference[i], std::min(soft_lower(i), reference[i]) - kRounding);
      ASSERT_LE(after.reference[i], std::max(soft_upper(i), reference[i]) + kRounding);
      ASSERT_GE(after.target[i], soft_lower(i));
      ASSERT_LE(after.target[i], soft_upper(i));
    }
  }
};

using Robots = ::testing::Types<TriFinger, Finger>;
TYPED_TEST_SUITE(GuideControllerOf, Robots);

TYPED_TEST(GuideControllerOf, AsksForNothingBeforeItBegins) {
  GuideController controller(this->robot_, this->speeds_);
  const MeasuredJoints measured = this->at_rest(this->random_pose());
  EXPECT_FALSE(controller.accept({.mode = Mode::kHome}));
  const GuideCommand& command = controller.update(measured);
  EXPECT_TRUE(command.torque.isZero(0.0));
  EXPECT_TRUE(command.position.array().isNaN().all());
}

TYPED_TEST(GuideControllerOf, DoesNotBeginWithoutAWholeMeasurement) {
  GuideController controller(this->robot_, this->speeds_);
  MeasuredJoints measured = this->at_rest(this->random_pose());
  measured.position[1] = kNan;
  EXPECT_FALSE(controller.begin(measured));
  EXPECT_FALSE(controller.has_begun());
  measured.position.resize(1);
  EXPECT_FALSE(controller.begin(measured));
}

TYPED_TEST(GuideControllerOf, BeginsAtTheMeasuredPoseWhateverIsAsked) {
  for (int trial = 0; trial < 200; ++trial) {
    GuideController controller(this->robot_, this->speeds_);
    const MeasuredJoints measured = this->at_rest(this->random_pose());
    ASSERT_TRUE(controller.begin(measured));
    static_cast<void>(controller.accept(this->random_setpoint()));
    static_cast<void>(controller.update(measured));
    EXPECT_LE((controller.state().reference - measured.position).cwiseAbs().maxCoeff(),
              this->speeds_.joint_speed * kPeriod);
  }
}

TYPED_TEST(GuideControllerOf, RefusesSetpointsThatMakeNoSense) {
  GuideController controller(this->robot_, this->speeds_);
  ASSERT_TRUE(controller.begin(this->at_rest(this->robot_.home)));
  ASSERT_TRUE(controller.accept({.mode = Mode::kMoveJoints, .joints = this->random_pose()}));
  const JointValues target = controller.state().target;
  EXPECT_FALSE(controller.accept({.mode = Mode::kMoveTip, .finger = -1}));
  EXPECT_FALSE(controller.accept({.mode = Mode::kMoveTip, .finger = this->kFingers}));
  EXPECT_FALSE(controller.accept({.mode = Mode::kMoveTip, .tip = {0.0, kNan, 0.0}}));
  EXPECT_FALSE(controller.accept({.mode = Mode::kMoveJoints, .joints = JointValues(1)}));
  EXPECT_FALSE(controller.accept(
      {.mode = Mode::kMoveJoints, .joints = JointValues::Constant(this->kJoints, kNan)}));
  EXPECT_EQ(controller.state().target, target);
  EXPECT_EQ(controller.state().mode, Mode::kMoveJoints);
}

TYPED_TEST(GuideControllerOf, KeepsItsLawsWithRandomSetpointsInASimulation) {
  const std::int64_t steps = repetitions(100'000, 1'000'000);
  GuidedSimulation<TypeParam> simulation;
  int until_setpoint = 0;
  for (std::int64_t step = 0; step < steps; ++step) {
    ControllerState before = simulation.controller.state();
    if (until_setpoint-- == 0) {
      ASSERT_TRUE(simulation.controller.accept(this->random_setpoint()));
      until_setpoint = std::uniform_int_distribution<int>(1, 1500)(this->random_);
    }
    ASSERT_NO_THROW(simulation.step()) << "at step " << step;
    this->expect_lawful(before, simulation.controller.state(), simulation.command);
    if (this->HasFatalFailure()) return;
    for (int i = 0; i < this->kJoints; ++i) {
      const JointLimit& limit = this->robot_.limits[static_cast<std::size_t>(i)];
      const double position = simulation.observation.position[static_cast<std::size_t>(i)];
      ASSERT_GT(position, limit.hard_lower);
      ASSERT_LT(position, limit.hard_upper);
    }
  }
}

TYPED_TEST(GuideControllerOf, KeepsItsLawsWhateverIsMeasured) {
  GuideController controller(this->robot_, this->speeds_);
  JointValues pose = this->random_pose();
  ASSERT_TRUE(controller.begin(this->at_rest(pose)));
  const std::int64_t steps = repetitions(100'000, 1'000'000);
  for (std::int64_t step = 0; step < steps; ++step) {
    const ControllerState before = controller.state();
    if (step % 37 == 0) static_cast<void>(controller.accept(this->random_setpoint()));
    MeasuredJoints measured = this->at_rest(pose);
    for (int i = 0; i < this->kJoints; ++i) {
      const double odd = this->uniform(0.0, 1.0);
      pose[i] += this->uniform(-0.01, 0.01);
      measured.velocity[i] = this->uniform(-20.0, 20.0);
      if (odd < 0.01) measured.position[i] = kNan;
      if (odd > 0.99) measured.velocity[i] = -std::numeric_limits<double>::infinity();
      if (odd > 0.50 && odd < 0.51) measured.position[i] = this->uniform(-1e300, 1e300);
      if (odd > 0.60 && odd < 0.61) pose[i] = this->uniform(-5.0, 5.0);
    }
    const GuideCommand& command = controller.update(measured);
    this->expect_lawful(before, controller.state(), command);
    if (this->HasFatalFailure()) return;
  }
}

TYPED_TEST(GuideControllerOf, BringsJointsWhereTheyAreSent) {
  GuidedSimulation<TypeParam> simulation;
  for (int trial = 0; trial < 5; ++trial) {
    // Poses near the initial one, where nothing is in the way.
    JointValues goal = this->robot_.home;
    for (int i = 0; i < this->kJoints; ++i)
      goal[i] =
          std::clamp(goal[i] + this->uniform(-0.2, 0.2), this->soft_lower(i), this->soft_upper(i));
    ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveJoints, .joints = goal}));
    ASSERT_TRUE(simulation.arrive());
    EXPECT_LT((joint_values(simulation.observation.position) - goal).cwiseAbs().maxCoeff(), 0.02);
    EXPECT_EQ(simulation.controller.state().reference, goal);
  }
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kHome}));
  ASSERT_TRUE(simulation.arrive());
  EXPECT_EQ(simulation.controller.state().reference, this->robot_.home);
}

TYPED_TEST(GuideControllerOf, LeadsATipOnAStraightLine) {
  GuidedSimulation<TypeParam> simulation;
  const Kinematics kinematics(this->robot_.description);
  const auto tip_of = [&](int finger) -> Eigen::Vector3d {
    return kinematics.tip_positions(joint_values(simulation.observation.position))
        .template segment<3>(3 * finger);
  };
  for (int finger = 0; finger < this->kFingers; ++finger) {
    const Eigen::Vector3d begin = tip_of(finger);
    const JointValues others = simulation.controller.state().target;
    const Eigen::Vector3d end = begin + Eigen::Vector3d(0.02, -0.02, 0.05);
    ASSERT_TRUE(
        simulation.controller.accept({.mode = Mode::kMoveTip, .finger = finger, .tip = end}));
    const Eigen::Vector3d along = (end - begin).normalized();
    double aside = 0.0;
    bool has_arrived = false;
    for (int step = 0; step < 10000 && !has_arrived; ++step) {
      simulation.step();
      const Eigen::Vector3d way = tip_of(finger) - begin;
      aside = std::max(aside, (way - along * along.dot(way)).norm());
      has_arrived = simulation.controller.state().has_arrived;
    }
    EXPECT_TRUE(has_arrived);
    EXPECT_LT((tip_of(finger) - end).norm(), 0.004);
    EXPECT_LT(aside, 0.005);
    // The other fingers have not moved.
    for (int i = 0; i < this->kJoints; ++i) {
      if (i / kJointsPerFinger == finger) continue;
      EXPECT_EQ(simulation.controller.state().target[i], others[i]);
    }
  }
}

TYPED_TEST(GuideControllerOf, FollowsAPointThatMovesOnWithEverySetpoint) {
  // Somebody steers at 30 Hz. If every setpoint began from rest, the tip would fall behind.
  GuidedSimulation<TypeParam> simulation;
  const Eigen::Vector3d begin = simulation.controller.kinematics().tip_position(0);
  constexpr double kSpeed = 0.05;
  Eigen::Vector3d point = begin;
  for (int step = 0; step < 1000; ++step) {
    if (step % 33 == 0) {
      point = begin + Eigen::Vector3d(0.0, 0.0, kSpeed * kPeriod * step);
      ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveTip, .tip = point}));
    }
    simulation.step();
  }
  const Kinematics kinematics(this->robot_.description);
  const Eigen::Vector3d tip =
      kinematics.tip_positions(joint_values(simulation.observation.position)).template head<3>();
  EXPECT_GT(tip.z() - begin.z(), 0.8 * (point.z() - begin.z()));
}

TYPED_TEST(GuideControllerOf, WaitsAtAnObstacleAndHoldsTheMeasuredPose) {
  GuideController controller(this->robot_, this->speeds_);
  const MeasuredJoints blocked = this->at_rest(this->random_pose(0.3));
  ASSERT_TRUE(controller.begin(blocked));
  for (const double side : {-1.0, 1.0}) {
    ASSERT_TRUE(controller.accept(
        {.mode = Mode::kMoveJoints, .joints = JointValues::Constant(this->kJoints, side * 10.0)}));
    for (int step = 0; step < 5000; ++step) static_cast<void>(controller.update(blocked));
    const JointValues lead = controller.state().reference - blocked.position;
    for (int i = 0; i < this->kJoints; ++i) EXPECT_NEAR(lead[i], side * 0.15, 1e-9);
    EXPECT_FALSE(controller.state().has_arrived);

    ASSERT_TRUE(controller.accept({.mode = Mode::kHold}));
    for (int step = 0; step < 1000; ++step) static_cast<void>(controller.update(blocked));
    EXPECT_EQ(controller.state().reference, blocked.position);
    EXPECT_TRUE(controller.state().has_arrived);
  }
}

TYPED_TEST(GuideControllerOf, FollowsJointsThatAreDraggedAwayAndReturnsLater) {
  GuideController controller(this->robot_, this->speeds_);
  const JointValues pose = this->random_pose(0.6);
  ASSERT_TRUE(controller.begin(this->at_rest(pose)));
  const MeasuredJoints dragged = this->at_rest(pose + JointValues::Constant(this->kJoints, 0.5));
  for (int step = 0; step < 2000; ++step) static_cast<void>(controller.update(dragged));
  EXPECT_LE((controller.state().reference - dragged.position).cwiseAbs().maxCoeff(), 0.15 + 1e-9);
  for (int step = 0; step < 2000; ++step) static_cast<void>(controller.update(this->at_rest(pose)));
  EXPECT_EQ(controller.state().reference, pose);
}

TYPED_TEST(GuideControllerOf, HoldsThePoseThatItHoldsAlready) {
  GuideController controller(this->robot_, this->speeds_);
  const JointValues pose = this->random_pose(0.3);
  ASSERT_TRUE(controller.begin(this->at_rest(pose)));
  // Something heavy pulls the joints down. Each new hold of the measured pose would let them sink.
  const MeasuredJoints sunk = this->at_rest(pose - JointValues::Constant(this->kJoints, 0.1));
  for (int step = 0; step < 100; ++step) {
    ASSERT_TRUE(controller.accept({.mode = Mode::kHold}));
    static_cast<void>(controller.update(sunk));
  }
  EXPECT_EQ(controller.state().target, pose);
}

TYPED_TEST(GuideControllerOf, BrakesFromTheMiddleOfAMotion) {
  GuidedSimulation<TypeParam> simulation;
  JointValues goal = this->robot_.home;
  goal[0] = std::clamp(goal[0] + 0.6, this->soft_lower(0), this->soft_upper(0));
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveJoints, .joints = goal}));
  for (int step = 0; step < 300; ++step) simulation.step();
  const double there = simulation.observation.position[0];
  ASSERT_GT(simulation.observation.velocity[0], 0.5);
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kHold}));
  ASSERT_TRUE(simulation.arrive());
  // A second of its speed would be ten times as far.
  EXPECT_GT(simulation.controller.state().target[0], there);
  EXPECT_LT(simulation.controller.state().target[0], there + 0.2);
}

TYPED_TEST(GuideControllerOf, GoesNearAPointThatNoTipReaches) {
  GuidedSimulation<TypeParam> simulation;
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveTip, .tip = {0.0, 0.0, 2.0}}));
  const ControllerState& state = simulation.controller.state();
  EXPECT_NE(state.shortfalls[0].reach, Reach::kYes);
  const JointValues target = state.target;
  for (int i = 0; i < this->kJoints; ++i) {
    EXPECT_GE(target[i], this->soft_lower(i));
    EXPECT_LE(target[i], this->soft_upper(i));
  }
  // A later setpoint that can be reached forgets the refusal.
  ASSERT_TRUE(simulation.controller.accept(
      {.mode = Mode::kMoveTip, .tip = simulation.controller.kinematics().tip_position(0)}));
  EXPECT_EQ(simulation.controller.state().shortfalls[0].reach, Reach::kYes);
  EXPECT_FALSE(simulation.controller.state().shortfalls[0].is_clamped);
}

TYPED_TEST(GuideControllerOf, ClampsTargetsToSoftLimitsAndSaysSo) {
  GuideController controller(this->robot_, this->speeds_);
  ASSERT_TRUE(controller.begin(this->at_rest(this->robot_.home)));
  JointValues far = this->robot_.home;
  far[this->kJoints - 1] = 100.0;
  ASSERT_TRUE(controller.accept({.mode = Mode::kMoveJoints, .joints = far}));
  EXPECT_EQ(controller.state().target[this->kJoints - 1], this->soft_upper(this->kJoints - 1));
  EXPECT_TRUE(
      controller.state().shortfalls[static_cast<std::size_t>(this->kFingers - 1)].is_clamped);
}

TYPED_TEST(GuideControllerOf, FloatsWithoutSinking) {
  JointVector<TypeParam::kJoints> begin{};
  for (int i = 0; i < this->kJoints; ++i)
    begin[static_cast<std::size_t>(i)] = this->robot_.home[i] + (i % 3 == 0 ? 0.3 : 0.1);
  GuidedSimulation<TypeParam> simulation(begin);
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kFloat}));
  for (int step = 0; step < 3000; ++step) simulation.step();
  for (std::size_t i = 0; i < TypeParam::kJoints; ++i)
    EXPECT_NEAR(simulation.observation.position[i], begin[i], 0.01);
  EXPECT_FALSE(simulation.controller.state().has_arrived);
}

TYPED_TEST(GuideControllerOf, HoldsTheLastPoseIfMeasurementsFailWhileItFloats) {
  GuideController controller(this->robot_, this->speeds_);
  const MeasuredJoints measured = this->at_rest(this->random_pose());
  ASSERT_TRUE(controller.begin(measured));
  ASSERT_TRUE(controller.accept({.mode = Mode::kFloat}));
  static_cast<void>(controller.update(measured));
  const MeasuredJoints nothing = this->at_rest(JointValues::Constant(this->kJoints, kNan));
  EXPECT_TRUE(controller.update(nothing).torque.allFinite());
  ASSERT_TRUE(controller.accept({.mode = Mode::kHold}));
  const GuideCommand& command = controller.update(nothing);
  EXPECT_EQ(command.position, measured.position);
  EXPECT_TRUE(command.torque.allFinite());
}

TYPED_TEST(GuideControllerOf, DoesNotAllocateAfterConstruction) {
  GuideController controller(this->robot_, this->speeds_);
  JointValues pose = this->random_pose();
  const AllocationCounter allocations;
  static_cast<void>(controller.begin(this->at_rest(pose)));
  for (int step = 0; step < 2000; ++step) {
    if (step % 50 == 0) static_cast<void>(controller.accept(this->random_setpoint()));
    const GuideCommand& command = controller.update(this->at_rest(pose));
    if (command.position.allFinite()) pose = command.position;
  }
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(GuideSpeeds, NamesTheSettingThatMakesNoSense) {
  const GuidedRobot robot = guided_robot(guided_options<TriFinger>().description);
  for (const double bad : {0.0, -1.0, kNan}) {
    EXPECT_THROW(GuideController(robot, {.joint_speed = bad}), InvalidArgument);
    EXPECT_THROW(GuideController(robot, {.joint_acceleration = bad}), InvalidArgument);
    EXPECT_THROW(GuideController(robot, {.tip_speed = bad}), InvalidArgument);
    EXPECT_THROW(GuideController(robot, {.max_lead = bad}), InvalidArgument);
  }
}

}  // namespace
}  // namespace trifinger::test
