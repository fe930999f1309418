// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/guiding/guide_controller.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "guiding/frame_kinematics.hpp"
#include "guiding/robots.hpp"
#include "servos/rig.hpp"
#include "support/allocation_counter.hpp"
#include "support/message_of.hpp"
#include "support/soak.hpp"
#include "trifinger/joint/reasons.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

using namespace guiding;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kRounding = 1e-12;

class GuideControllerOf : public ::testing::TestWithParam<const char*> {
 protected:
  const GuidedRobot robot_ = guided(GetParam());
  const Nanoseconds period_ = guided_options(GetParam()).period;
  const int joints_ = static_cast<int>(robot_.limits.size());
  const int frames_ = static_cast<int>(robot_.frames.size());
  const GuideSpeeds speeds_{};
  std::mt19937 random_{7};

  [[nodiscard]] bool is_slide(int joint) const {
    return robot_.model->joints()[static_cast<std::size_t>(joint)].is_slide;
  }
  // What counts as 1 rad [rad], [m].
  [[nodiscard]] double radian(int joint) const { return is_slide(joint) ? 0.1 : 1.0; }
  double uniform(double least, double most) {
    return std::uniform_real_distribution<double>(least, most)(random_);
  }
  // A joint that turns without end turns up to twice in these tests.
  [[nodiscard]] double soft_lower(int joint) const {
    return std::max(-6.0, robot_.limits[static_cast<std::size_t>(joint)].soft_lower);
  }
  [[nodiscard]] double soft_upper(int joint) const {
    return std::min(6.0, robot_.limits[static_cast<std::size_t>(joint)].soft_upper);
  }
  // Positions within the soft limits, `margin` away from them [rad].
  GuidedJoints random_pose(double margin = 0.0) {
    GuidedJoints pose(joints_);
    for (int i = 0; i < joints_; ++i)
      pose[i] = uniform(soft_lower(i) + margin * radian(i), soft_upper(i) - margin * radian(i));
    return pose;
  }
  Setpoint random_setpoint() {
    const int choice = std::uniform_int_distribution<int>(0, 9)(random_);
    if (choice == 0) return {.mode = Mode::kHold};
    if (choice == 1) return {.mode = Mode::kHome};
    if (choice == 2) return {.mode = Mode::kFloat};
    if (choice <= 5) {
      Setpoint setpoint{.mode = Mode::kMoveJoints, .joints = GuidedJoints(joints_)};
      for (int i = 0; i < joints_; ++i) setpoint.joints[i] = uniform(-4.0, 4.0);
      return setpoint;
    }
    return {.mode = Mode::kMoveFrame,
            .frame = std::uniform_int_distribution<int>(0, frames_ - 1)(random_),
            .point = {uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(-0.2, 1.0)}};
  }
  static MeasuredJoints at_rest(const GuidedJoints& position) {
    return {.position = position, .velocity = GuidedJoints::Zero(position.size())};
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
    const GuidedJoints& reference =
        before.mode == Mode::kFloat ? before.measured : before.reference;
    const double period = std::chrono::duration<double>(period_).count();
    for (int i = 0; i < joints_; ++i) {
      const JointLimit& limit = robot_.limits[static_cast<std::size_t>(i)];
      ASSERT_LE(std::abs(after.reference[i] - reference[i]),
                std::min(speeds_.joint_speed * radian(i), limit.max_velocity) * period + kRounding);
      ASSERT_GE(after.reference[i], std::min(limit.soft_lower, reference[i]) - kRounding);
      ASSERT_LE(after.reference[i], std::max(limit.soft_upper, reference[i]) + kRounding);
      ASSERT_GE(after.target[i], limit.soft_lower);
      ASSERT_LE(after.target[i], limit.soft_upper);
      const double moved = after.reference[i] - reference[i];
      const double lead = after.reference[i] - after.measured[i];
      // It leads the joint by no more than `max_lead`, unless it comes back.
      ASSERT_TRUE(std::abs(lead) <= speeds_.max_lead * radian(i) + kRounding || moved * lead <= 0.0)
          << "joint " << i << ": " << lead << ", " << moved;
    }
  }
};

INSTANTIATE_TEST_SUITE_P(Robots, GuideControllerOf, ::testing::ValuesIn(kGuidedRobots),
                         [](const auto& robot) { return std::string(robot.param); });

TEST_P(GuideControllerOf, AsksForNothingBeforeItBegins) {
  GuideController controller(robot_, speeds_, period_);
  const MeasuredJoints measured = at_rest(random_pose());
  EXPECT_FALSE(controller.accept({.mode = Mode::kHome}));
  const GuideCommand& command = controller.update(measured);
  EXPECT_TRUE(command.torque.isZero(0.0));
  EXPECT_TRUE(command.position.array().isNaN().all());
}

TEST_P(GuideControllerOf, DoesNotBeginWithoutAWholeMeasurement) {
  GuideController controller(robot_, speeds_, period_);
  MeasuredJoints measured = at_rest(random_pose());
  measured.position[joints_ - 1] = kNan;
  EXPECT_FALSE(controller.begin(measured));
  EXPECT_FALSE(controller.has_begun());
  measured.position.resize(joints_ - 1);
  EXPECT_FALSE(controller.begin(measured));
}

TEST_P(GuideControllerOf, BeginsAtTheMeasuredPoseWhateverIsAsked) {
  for (int trial = 0; trial < 200; ++trial) {
    GuideController controller(robot_, speeds_, period_);
    const MeasuredJoints measured = at_rest(random_pose());
    ASSERT_TRUE(controller.begin(measured));
    static_cast<void>(controller.accept(random_setpoint()));
    static_cast<void>(controller.update(measured));
    EXPECT_LE((controller.state().reference - measured.position).cwiseAbs().maxCoeff(),
              speeds_.joint_speed * std::chrono::duration<double>(period_).count());
  }
}

TEST_P(GuideControllerOf, RefusesSetpointsThatMakeNoSense) {
  GuideController controller(robot_, speeds_, period_);
  ASSERT_TRUE(controller.begin(at_rest(robot_.home)));
  ASSERT_TRUE(controller.accept({.mode = Mode::kMoveJoints, .joints = random_pose()}));
  const GuidedJoints target = controller.state().target;
  EXPECT_FALSE(controller.accept({.mode = Mode::kMoveFrame, .frame = -1}));
  EXPECT_FALSE(controller.accept({.mode = Mode::kMoveFrame, .frame = frames_}));
  EXPECT_FALSE(controller.accept({.mode = Mode::kMoveFrame, .point = {0.0, kNan, 0.0}}));
  EXPECT_FALSE(controller.accept({.mode = Mode::kMoveJoints, .joints = GuidedJoints(joints_ + 1)}));
  EXPECT_FALSE(controller.accept(
      {.mode = Mode::kMoveJoints, .joints = GuidedJoints::Constant(joints_, kNan)}));
  EXPECT_EQ(controller.state().target, target);
  EXPECT_EQ(controller.state().mode, Mode::kMoveJoints);
}

TEST_P(GuideControllerOf, KeepsItsLawsWithRandomSetpointsInASimulation) {
  const std::int64_t steps = repetitions(100'000, 1'000'000);
  GuidedSimulation simulation(GetParam());
  int until_setpoint = 0;
  for (std::int64_t step = 0; step < steps; ++step) {
    ControllerState before = simulation.controller.state();
    if (until_setpoint-- == 0) {
      ASSERT_TRUE(simulation.controller.accept(random_setpoint()));
      until_setpoint = std::uniform_int_distribution<int>(1, 1500)(random_);
    }
    ASSERT_NO_THROW(simulation.step()) << "at step " << step;
    expect_lawful(before, simulation.controller.state(), simulation.command);
    if (HasFatalFailure()) return;
    for (int i = 0; i < joints_; ++i) {
      const JointLimit& limit = robot_.limits[static_cast<std::size_t>(i)];
      const double position = simulation.measured().position[i];
      ASSERT_GT(position, limit.hard_lower);
      ASSERT_LT(position, limit.hard_upper);
    }
  }
}

TEST_P(GuideControllerOf, KeepsItsLawsWhateverIsMeasured) {
  GuideController controller(robot_, speeds_, period_);
  GuidedJoints pose = random_pose();
  ASSERT_TRUE(controller.begin(at_rest(pose)));
  const std::int64_t steps = repetitions(100'000, 1'000'000);
  for (std::int64_t step = 0; step < steps; ++step) {
    const ControllerState before = controller.state();
    if (step % 37 == 0) static_cast<void>(controller.accept(random_setpoint()));
    MeasuredJoints measured = at_rest(pose);
    for (int i = 0; i < joints_; ++i) {
      const double odd = uniform(0.0, 1.0);
      pose[i] += uniform(-0.01, 0.01);
      measured.velocity[i] = uniform(-20.0, 20.0);
      if (odd < 0.01) measured.position[i] = kNan;
      if (odd > 0.99) measured.velocity[i] = -std::numeric_limits<double>::infinity();
      if (odd > 0.50 && odd < 0.51) measured.position[i] = uniform(-1e300, 1e300);
      if (odd > 0.60 && odd < 0.61) pose[i] = uniform(-5.0, 5.0);
    }
    const GuideCommand& command = controller.update(measured);
    expect_lawful(before, controller.state(), command);
    if (HasFatalFailure()) return;
  }
}

TEST_P(GuideControllerOf, BringsJointsWhereTheyAreSent) {
  GuidedSimulation simulation(GetParam());
  for (int trial = 0; trial < 5; ++trial) {
    // Poses near the initial one, where nothing is in the way.
    GuidedJoints goal = robot_.home;
    for (int i = 0; i < joints_; ++i)
      goal[i] = std::clamp(goal[i] + uniform(-0.2, 0.2), soft_lower(i), soft_upper(i));
    ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveJoints, .joints = goal}));
    ASSERT_TRUE(simulation.arrive());
    EXPECT_LT((simulation.measured().position - goal).cwiseAbs().maxCoeff(), 0.02);
    EXPECT_EQ(simulation.controller.state().reference, goal);
  }
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kHome}));
  ASSERT_TRUE(simulation.arrive());
  EXPECT_EQ(simulation.controller.state().reference, robot_.home);
}

TEST_P(GuideControllerOf, LeadsAFrameOnAStraightLine) {
  const std::optional<Eigen::Vector3d> displacement = line_of(GetParam());
  if (!displacement) GTEST_SKIP() << "it moves on circles";
  GuidedSimulation simulation(GetParam());
  guiding::detail::FrameKinematics kinematics(robot_);
  const auto measured_point = [&](int frame) -> Eigen::Vector3d {
    const MeasuredJoints& measured = simulation.measured();
    kinematics.measure(measured.position, measured.all);
    return kinematics.point(frame, measured.position);
  };
  for (int frame = 0; frame < frames_; ++frame) {
    if (frame > 0 && kinematics.moves_with(frame, 0)) break;
    const Eigen::Vector3d begin = measured_point(frame);
    const GuidedJoints others = simulation.controller.state().target;
    const Eigen::Vector3d end = begin + *displacement;
    ASSERT_TRUE(
        simulation.controller.accept({.mode = Mode::kMoveFrame, .frame = frame, .point = end}));
    const Eigen::Vector3d along = (end - begin).normalized();
    double aside = 0.0;
    bool has_arrived = false;
    for (int step = 0; step < 10000 && !has_arrived; ++step) {
      simulation.step();
      const Eigen::Vector3d way = measured_point(frame) - begin;
      aside = std::max(aside, (way - along * along.dot(way)).norm());
      has_arrived = simulation.controller.state().has_arrived;
    }
    EXPECT_TRUE(has_arrived);
    EXPECT_LT((measured_point(frame) - end).norm(), 0.004);
    EXPECT_LT(aside, 0.005);
    const ControllerState& state = simulation.controller.state();
    EXPECT_LT((state.target_frames.col(frame) - end).norm(), 1e-6);
    EXPECT_EQ(state.missing[static_cast<std::size_t>(frame)], 0.0);
    // The other fingers have not moved.
    for (int i = 0; i < joints_; ++i) {
      EXPECT_TRUE(kinematics.moves(i, frame) || state.target[i] == others[i]);
    }
  }
}

TEST_P(GuideControllerOf, FollowsAPointThatMovesOnWithEverySetpoint) {
  const std::optional<Eigen::Vector3d> displacement = line_of(GetParam());
  if (!displacement) GTEST_SKIP() << "it moves on circles";
  // Somebody steers at 30 Hz. If every setpoint began from rest, the frame would fall behind.
  GuidedSimulation simulation(GetParam());
  const Eigen::Vector3d begin = simulation.controller.state().measured_frames.col(0);
  const Eigen::Vector3d along = displacement->normalized();
  constexpr double kSpeed = 0.05;
  const double period = std::chrono::duration<double>(period_).count();
  double distance = 0.0;
  for (int step = 0; step * period < 1.0; ++step) {
    if (step % 33 == 0) {
      distance = kSpeed * period * step;
      ASSERT_TRUE(simulation.controller.accept(
          {.mode = Mode::kMoveFrame, .point = begin + distance * along}));
    }
    simulation.step();
  }
  const Eigen::Vector3d point = simulation.controller.state().measured_frames.col(0);
  EXPECT_GT((point - begin).dot(along), 0.8 * distance);
  ASSERT_TRUE(simulation.arrive());
  const Eigen::Vector3d end = simulation.controller.state().reference_frames.col(0);
  EXPECT_LT((end - begin - distance * along).norm(), 1e-6);
}

TEST_P(GuideControllerOf, ComesBackAtOnceFromWhereItCannotGo) {
  const std::optional<Eigen::Vector3d> displacement = line_of(GetParam());
  if (!displacement) GTEST_SKIP() << "it moves on circles";
  GuidedSimulation simulation(GetParam());
  const ControllerState& state = simulation.controller.state();
  const Eigen::Vector3d begin = state.measured_frames.col(0);
  const auto steps_in = [&](double seconds) {
    return static_cast<int>(seconds / std::chrono::duration<double>(period_).count());
  };
  // Somebody leads the frame two metres away, so fast that no target is found, and holds it there.
  for (int step = 0; step < steps_in(8.0); ++step) {
    if (step % 3 == 0) {
      const double distance = std::min(1.0, step / (0.5 * steps_in(8.0))) * 2.0;
      ASSERT_TRUE(simulation.controller.accept(
          {.mode = Mode::kMoveFrame, .point = begin + distance * displacement->normalized()}));
    }
    simulation.step();
  }
  const double distance = (state.measured_frames.col(0) - begin).norm();
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveFrame, .point = begin}));
  // It needs as long as the way of the frame, and some time for its joints.
  EXPECT_TRUE(simulation.arrive(steps_in(2.0 * distance / speeds_.tip_speed + 2.0)));
  EXPECT_LT((state.reference_frames.col(0) - begin).norm(), 1e-4);
}

TEST(GuideController, MovesFramesThatShareJointsTogether) {
  GuidedSimulation simulation("seven_joints");
  // Where both frames are in another posture.
  guiding::detail::FrameKinematics kinematics(guided("seven_joints"));
  GuidedJoints posture = guided("seven_joints").home;
  for (Eigen::Index i = 0; i < posture.size(); ++i) posture[i] += i % 2 == 0 ? 0.15 : -0.1;
  const std::array ends{kinematics.point(0, posture), kinematics.point(1, posture)};
  for (const int frame : {0, 1}) {
    ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveFrame,
                                              .frame = frame,
                                              .point = ends.at(static_cast<std::size_t>(frame))}));
  }
  ASSERT_TRUE(simulation.arrive());
  const ControllerState& state = simulation.controller.state();
  EXPECT_EQ(state.missing[0] + state.missing[1], 0.0);
  EXPECT_LT((state.reference_frames.col(0) - ends[0]).norm(), 1e-5);
  EXPECT_LT((state.reference_frames.col(1) - ends[1]).norm(), 1e-5);

  // Both cannot be reached at once, so both go only near.
  ASSERT_TRUE(simulation.controller.accept(
      {.mode = Mode::kMoveFrame, .frame = 1, .point = ends[1] + Eigen::Vector3d(0.5, 0.0, 0.0)}));
  ASSERT_TRUE(simulation.arrive());
  EXPECT_GT(state.missing[0] + state.missing[1], 0.1);
}

TEST_P(GuideControllerOf, WaitsAtAnObstacleAndHoldsTheMeasuredPose) {
  GuideController controller(robot_, speeds_, period_);
  const MeasuredJoints blocked = at_rest(random_pose(0.3));
  ASSERT_TRUE(controller.begin(blocked));
  for (const double side : {-1.0, 1.0}) {
    ASSERT_TRUE(controller.accept(
        {.mode = Mode::kMoveJoints, .joints = GuidedJoints::Constant(joints_, side * 10.0)}));
    for (int step = 0; step < 5000; ++step) static_cast<void>(controller.update(blocked));
    const GuidedJoints lead = controller.state().reference - blocked.position;
    for (int i = 0; i < joints_; ++i) EXPECT_NEAR(lead[i], side * 0.15 * radian(i), 1e-9);
    EXPECT_FALSE(controller.state().has_arrived);

    ASSERT_TRUE(controller.accept({.mode = Mode::kHold}));
    for (int step = 0; step < 1000; ++step) static_cast<void>(controller.update(blocked));
    EXPECT_EQ(controller.state().reference, blocked.position);
    EXPECT_TRUE(controller.state().has_arrived);
  }
}

TEST_P(GuideControllerOf, FollowsJointsThatAreDraggedAwayAndReturnsLater) {
  GuideController controller(robot_, speeds_, period_);
  const GuidedJoints pose = random_pose(0.6);
  ASSERT_TRUE(controller.begin(at_rest(pose)));
  GuidedJoints away = pose;
  for (int i = 0; i < joints_; ++i) away[i] += 0.5 * radian(i);
  const MeasuredJoints dragged = at_rest(away);
  for (int step = 0; step < 2000; ++step) static_cast<void>(controller.update(dragged));
  for (int i = 0; i < joints_; ++i)
    EXPECT_LE(std::abs(controller.state().reference[i] - away[i]), 0.15 * radian(i) + 1e-9);
  for (int step = 0; step < 2000; ++step) static_cast<void>(controller.update(at_rest(pose)));
  EXPECT_EQ(controller.state().reference, pose);
}

TEST_P(GuideControllerOf, HoldsThePoseThatItHoldsAlready) {
  GuideController controller(robot_, speeds_, period_);
  const GuidedJoints pose = random_pose(0.3);
  ASSERT_TRUE(controller.begin(at_rest(pose)));
  // Something heavy pulls the joints down. Each new hold of the measured pose would let them sink.
  GuidedJoints lower = pose;
  for (int i = 0; i < joints_; ++i) lower[i] -= 0.1 * radian(i);
  const MeasuredJoints sunk = at_rest(lower);
  for (int step = 0; step < 100; ++step) {
    ASSERT_TRUE(controller.accept({.mode = Mode::kHold}));
    static_cast<void>(controller.update(sunk));
  }
  EXPECT_EQ(controller.state().target, pose);
}

TEST_P(GuideControllerOf, BrakesFromTheMiddleOfAMotion) {
  GuidedSimulation simulation(GetParam());
  GuidedJoints goal = robot_.home;
  goal[0] = std::clamp(goal[0] + 0.6 * radian(0), soft_lower(0), soft_upper(0));
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveJoints, .joints = goal}));
  const auto steps = static_cast<int>(std::chrono::milliseconds(300) / period_);
  for (int step = 0; step < steps; ++step) simulation.step();
  const double there = simulation.measured().position[0];
  ASSERT_GT(simulation.measured().velocity[0], 0.5 * radian(0));
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kHold}));
  ASSERT_TRUE(simulation.arrive());
  // A second of its speed would be ten times as far.
  EXPECT_GT(simulation.controller.state().target[0], there);
  EXPECT_LT(simulation.controller.state().target[0], there + 0.2 * radian(0));
}

TEST_P(GuideControllerOf, GoesNearAPointThatNoFrameReaches) {
  GuidedSimulation simulation(GetParam());
  const ControllerState& state = simulation.controller.state();
  const Eigen::Vector3d begin = state.measured_frames.col(0);
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveFrame, .point = {5.0, 0.5, 3.0}}));
  ASSERT_TRUE(simulation.arrive());
  EXPECT_GT(state.missing[0], 1.0);
  EXPECT_NEAR((state.target_frames.col(0) - Eigen::Vector3d(5.0, 0.5, 3.0)).norm(),
              state.missing[0], 1e-9);
  for (int i = 0; i < joints_; ++i) {
    EXPECT_GE(state.target[i], robot_.limits[static_cast<std::size_t>(i)].soft_lower);
    EXPECT_LE(state.target[i], robot_.limits[static_cast<std::size_t>(i)].soft_upper);
  }
  // It gets nearer than it was.
  EXPECT_LT(state.missing[0], (begin - Eigen::Vector3d(5.0, 0.5, 3.0)).norm());
  // A later setpoint that can be reached forgets this.
  ASSERT_TRUE(simulation.controller.accept(
      {.mode = Mode::kMoveFrame, .point = state.target_frames.col(0)}));
  ASSERT_TRUE(simulation.arrive());
  EXPECT_EQ(state.missing[0], 0.0);
}

TEST_P(GuideControllerOf, FindsItsTargetInFewStepsHoweverFarThePointIs) {
  for (const double far : {1e3, 1e160, std::numeric_limits<double>::max()}) {
    GuidedSimulation simulation(GetParam());
    const ControllerState& state = simulation.controller.state();
    ASSERT_TRUE(simulation.controller.accept(
        {.mode = Mode::kMoveFrame, .point = {far, -0.3 * far, 0.1 * far}}));
    for (int step = 0; step < 200; ++step) simulation.step();
    EXPECT_GT(state.missing[0], 0.9 * far);
    ASSERT_TRUE(simulation.arrive());
    const Eigen::Vector3d end = state.target_frames.col(0);
    ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveFrame, .point = end}));
    EXPECT_TRUE(simulation.arrive());
    EXPECT_EQ(state.missing[0], 0.0);
  }
}

TEST(GuideController, SearchesForEachFingerByItself) {
  GuidedSimulation simulation("trifinger");
  const ControllerState& state = simulation.controller.state();
  const Eigen::Vector3d begin = state.measured_frames.col(1);
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveFrame, .point = {1.5, 0.5, 1.0}}));
  // Somebody leads another finger meanwhile.
  for (int step = 0; step < 200; ++step) {
    const Eigen::Vector3d point = begin + Eigen::Vector3d(0.0, 0.0, 1e-4 * step);
    ASSERT_TRUE(
        simulation.controller.accept({.mode = Mode::kMoveFrame, .frame = 1, .point = point}));
    simulation.step();
  }
  EXPECT_GT(state.missing[0], 0.5);
  ASSERT_TRUE(simulation.arrive());
  EXPECT_EQ(state.missing[1], 0.0);
}

TEST(GuideController, EndsASearchWhileThatOfAnotherFingerGoesOn) {
  GuidedSimulation simulation("trifinger");
  const ControllerState& state = simulation.controller.state();
  const Eigen::Vector3d point = state.measured_frames.col(1) + Eigen::Vector3d(0.0, 0.0, 0.5);
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveFrame, .point = {1.5, 0.5, 1.0}}));
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kMoveFrame, .frame = 1, .point = point}));
  for (int step = 0; step < 12; ++step) simulation.step();
  EXPECT_GT(state.missing[1], 0.1);
  EXPECT_EQ(state.missing[0], 0.0);
  for (int step = 0; step < 200; ++step) simulation.step();
  EXPECT_GT(state.missing[0], 0.5);
}

TEST(GuideController, MovesOneJointAndLeavesTheOtherSetpointsAlone) {
  GuidedSimulation simulation("trifinger");
  const ControllerState& state = simulation.controller.state();
  const GuidedJoints begin = state.target;
  const std::array<Eigen::Vector3d, 2> points{
      state.measured_frames.col(0) + Eigen::Vector3d(0.0, 0.0, 0.03),
      state.measured_frames.col(1) + Eigen::Vector3d(0.0, 0.0, 0.03)};
  for (const int frame : {0, 1}) {
    ASSERT_TRUE(
        simulation.controller.accept({.mode = Mode::kMoveFrame,
                                      .frame = frame,
                                      .point = points.at(static_cast<std::size_t>(frame))}));
  }
  Setpoint setpoint{.mode = Mode::kMoveJoints, .joints = GuidedJoints::Constant(9, kNan)};
  EXPECT_FALSE(simulation.controller.accept(setpoint));
  setpoint.joints[1] = 0.7;  // of finger 0
  ASSERT_TRUE(simulation.controller.accept(setpoint));
  ASSERT_TRUE(simulation.arrive());
  EXPECT_EQ(state.mode, Mode::kMoveJoints);
  EXPECT_EQ(state.reference[0], begin[0]);
  EXPECT_EQ(state.reference[1], 0.7);
  EXPECT_EQ(state.reference[2], begin[2]);
  EXPECT_LT((state.reference_frames.col(1) - points[1]).norm(), 1e-6);
  for (int i = 6; i < 9; ++i) EXPECT_EQ(state.reference[i], begin[i]);
}

TEST_P(GuideControllerOf, ClampsTargetsToSoftLimitsAndSaysSo) {
  GuideController controller(robot_, speeds_, period_);
  ASSERT_TRUE(controller.begin(at_rest(robot_.home)));
  const int last = joints_ - 1;
  const double upper = robot_.limits[static_cast<std::size_t>(last)].soft_upper;
  if (upper > 100.0) GTEST_SKIP() << "it turns without end";
  GuidedJoints far = robot_.home;
  far[last] = 100.0;
  ASSERT_TRUE(controller.accept({.mode = Mode::kMoveJoints, .joints = far}));
  EXPECT_EQ(controller.state().target[last], upper);
  EXPECT_TRUE(controller.state().is_clamped[static_cast<std::size_t>(last)]);
  EXPECT_EQ(std::ranges::count(controller.state().is_clamped, true), 1);
}

TEST_P(GuideControllerOf, FloatsWithoutSinking) {
  std::vector<double> begin(robot_.home.begin(), robot_.home.end());
  for (int i = 0; i < joints_; ++i) {
    double& position = begin[static_cast<std::size_t>(i)];
    position = std::min(position + (i % 3 == 0 ? 0.3 : 0.1) * radian(i), soft_upper(i));
  }
  GuidedSimulation simulation(GetParam(), begin);
  ASSERT_TRUE(simulation.controller.accept({.mode = Mode::kFloat}));
  const auto steps = static_cast<int>(std::chrono::seconds(3) / period_);
  for (int step = 0; step < steps; ++step) simulation.step();
  for (int i = 0; i < joints_; ++i) {
    EXPECT_NEAR(simulation.measured().position[i], begin[static_cast<std::size_t>(i)],
                0.01 * radian(i))
        << "joint " << i;
  }
  EXPECT_FALSE(simulation.controller.state().has_arrived);
}

TEST(GuideController, KnowsWhereJointsWithoutMotorsAreMeasured) {
  const std::vector<std::string> frames{"far"};
  GuideController controller(guided_robot(guided_options("four_joints"), frames), {});
  const GuidedJoints home = controller.robot().home;
  MeasuredJoints measured{.position = home, .velocity = GuidedJoints::Zero(home.size())};
  ASSERT_TRUE(controller.begin(measured));
  const Eigen::Vector3d assumed = controller.state().measured_frames.col(0);
  // The tendon is as long as before, and its two joints have turned against each other.
  const std::vector<double> all{0.0, 0.5, 1.0, 0.4, 0.0, 0.0};
  measured.all = all;
  static_cast<void>(controller.update(measured));
  const Eigen::Vector3d seen = controller.state().measured_frames.col(0);
  // A turn of 0.2 rad moves the end of a link of 50 mm.
  EXPECT_NEAR((seen - assumed).norm(), 2 * 0.05 * std::sin(0.1), 1e-6);
}

TEST(GuideController, ChangesThePostureOfAFingerIfNoLineLeadsToThePoint) {
  SimulationOptions options = guided_options("finger");
  options.description.variant = Variant::kEdu;
  GuidedRobot robot = guided_robot(options);
  // The elbow is bent the other way, so every line ends at a soft limit.
  const Eigen::Vector3d bent(0.12, 1.24, 1.87);
  const Eigen::Vector3d point = guiding::detail::FrameKinematics(robot).point(0, bent);
  for (const bool has_closed_form : {true, false}) {
    if (!has_closed_form) robot.description.reset();
    GuideController controller(robot, {});
    MeasuredJoints measured{.position = robot.home, .velocity = GuidedJoints::Zero(3)};
    ASSERT_TRUE(controller.begin(measured));
    ASSERT_TRUE(controller.accept({.mode = Mode::kMoveFrame, .point = point}));
    for (int step = 0; step < 20000 && !controller.state().has_arrived; ++step)
      measured.position = controller.update(measured).position;
    EXPECT_TRUE(controller.state().has_arrived);
    const double distance = (controller.state().measured_frames.col(0) - point).norm();
    if (has_closed_form) {
      EXPECT_LT(distance, 1e-6);
    } else {
      EXPECT_NEAR(distance, controller.state().missing[0], 1e-6);
      EXPECT_GT(distance, 0.01);
    }
  }
}

TEST(GuideController, ChangesThePostureOfTheFingerWhoseTipTheFrameIs) {
  SimulationOptions options = guided_options("trifinger");
  options.description.variant = Variant::kEdu;
  GuidedRobot robot = guided_robot(options);
  std::ranges::reverse(robot.frames);
  robot.frames.emplace_back("finger_lower_link_0");
  GuideController controller(robot, {});
  MeasuredJoints measured{.position = robot.home, .velocity = GuidedJoints::Zero(9)};
  GuidedJoints bent = robot.home;
  bent.tail<3>() = Eigen::Vector3d(0.12, 1.24, 1.87);
  guiding::detail::FrameKinematics kinematics(robot);
  const Eigen::Vector3d point = kinematics.point(0, bent);
  ASSERT_TRUE(controller.begin(measured));
  ASSERT_TRUE(controller.accept({.mode = Mode::kMoveFrame, .point = point}));
  for (int step = 0; step < 20000 && !controller.state().has_arrived; ++step)
    measured.position = controller.update(measured).position;
  EXPECT_TRUE(controller.state().has_arrived);
  EXPECT_LT((controller.state().measured_frames.col(0) - point).norm(), 1e-6);
  EXPECT_EQ(measured.position.head<6>(), robot.home.head<6>());
  // A frame that is no tip has no closed form.
  const Eigen::Vector3d link = kinematics.point(3, bent);
  EXPECT_FALSE(kinematics.find_posture({.frame = 3, .point = link}, bent));
}

TEST(GuideController, ChecksTheSizesOfARobotThatSomebodyHasMade) {
  const auto refusal_of = [](const auto& change) {
    GuidedRobot robot = guided("trifinger");
    change(robot);
    return message_of<InvalidArgument>(
        [&] { return std::make_unique<GuideController>(robot, GuideSpeeds{}); });
  };
  EXPECT_EQ(refusal_of([](GuidedRobot& robot) { robot.model = nullptr; }),
            "a guided robot must have a model");
  for (const std::size_t count : {0U, 3U, 1000U}) {
    EXPECT_EQ(refusal_of([&](GuidedRobot& robot) { robot.limits.resize(count); }),
              "there are limits of " + std::to_string(count) + " joints, the model has 9");
  }
  EXPECT_EQ(refusal_of([](GuidedRobot& robot) { robot.frames.resize(9, robot.frames[0]); }),
            "there are 9 frames, allowed are 8");
  EXPECT_EQ(refusal_of([](GuidedRobot& robot) {
              robot.description = guided_options("finger").description;
            }),
            "the description has 3 joints, the model has 9");
  EXPECT_EQ(refusal_of([](GuidedRobot& robot) { robot.home.resize(3); }),
            "home has 3 joints, the robot has 9");
}

TEST(GuideController, GivesNoTorqueToMotorsThatRefuseIt) {
  GuidedRobot robot = guided("finger");
  robot.refuses_torques = true;
  GuideController controller(robot, {});
  MeasuredJoints measured{.position = robot.home, .velocity = GuidedJoints::Zero(3)};
  ASSERT_TRUE(controller.begin(measured));
  EXPECT_FALSE(controller.accept({.mode = Mode::kFloat}));
  EXPECT_EQ(controller.state().mode, Mode::kHold);
  const GuidedJoints goal = robot.home.array() + 0.2;
  ASSERT_TRUE(controller.accept({.mode = Mode::kMoveJoints, .joints = goal}));
  for (int step = 0; step < 2000 && !controller.state().has_arrived; ++step) {
    const GuideCommand& command = controller.update(measured);
    ASSERT_TRUE(command.torque.isZero(0.0));
    measured.position = command.position;
  }
  EXPECT_EQ(measured.position, goal);
}

TEST(GuideController, ArrivesWithMotorsThatSagAndLowersThemNoFurther) {
  GuidedRobot robot = guided("finger");
  robot.refuses_torques = true;
  GuideController controller(robot, {});
  const double sag = 0.1;  // less than it may lead
  MeasuredJoints measured{.position = robot.home, .velocity = GuidedJoints::Zero(3)};
  ASSERT_TRUE(controller.begin(measured));
  const GuidedJoints goal = robot.home.array() + 0.2;
  ASSERT_TRUE(controller.accept({.mode = Mode::kMoveJoints, .joints = goal}));
  const auto go_on_until_arrived = [&] {
    int steps = 0;
    while (!controller.state().has_arrived && ++steps < 2000) {
      measured.position = controller.update(measured).position.array() - sag;
    }
    return controller.state().has_arrived;
  };
  EXPECT_TRUE(go_on_until_arrived());
  for (int tap = 0; tap < 10; ++tap) {
    ASSERT_TRUE(controller.accept({.mode = Mode::kMoveJoints, .joints = goal}));
    ASSERT_TRUE(controller.accept({.mode = Mode::kHold}));
    EXPECT_TRUE(go_on_until_arrived());
    EXPECT_EQ(controller.state().target, goal);
  }
}

// Two arms on one trunk, with a hand each.
GuidedRobot two_arms() {
  const auto arm = [](const std::string& side, const char* y) {
    return "<body name='" + side + "_arm' pos='0 " + y + " 0.4'><joint name='" + side +
           "_shoulder' axis='0 1 0' range='-2 2'/><geom type='capsule' size='0.02' fromto='0 0 0 "
           "0.2 "
           "0 0'/><body name='" +
           side + "_hand' pos='0.2 0 0'><joint name='" + side +
           "_elbow' axis='0 1 0' range='-2 2'/><geom type='capsule' size='0.02' fromto='0 0 0 0.2 "
           "0 "
           "0'/><site name='" +
           side + "_tip' pos='0.2 0 0'/></body></body>";
  };
  const std::string model =
      "<mujoco><compiler angle='radian'/><worldbody><body name='trunk'><joint name='trunk' axis='0 "
      "0 "
      "1' range='-2 2'/><geom size='0.1'/>" +
      arm("left", "0.2") + arm("right", "-0.2") + "</body></worldbody></mujoco>";
  const std::vector<std::string> frames{"left_tip", "right_tip"};
  return guided_robot(
      options_of_file(
          model.c_str(),
          "safety:\n  every_joint: {max_torque: 10, safety_kd: 0.1, soft_lower: -2, "
          "soft_upper: 2, max_velocity: 1, braking: 5, default_kp: 10, default_kd: 1}\n"),
      frames);
}

TEST(GuideController, KeepsTheLineOfAFrameIfAJointMovesThatIsNotItsOwn) {
  const GuidedRobot robot = two_arms();
  GuideController controller(robot, {});
  GuidedJoints begin(5);
  begin << 0.0, 0.5, -1.0, 0.5, -1.0;
  MeasuredJoints measured{.position = begin, .velocity = GuidedJoints::Zero(5)};
  ASSERT_TRUE(controller.begin(measured));
  const Eigen::Vector3d point =
      controller.state().measured_frames.col(0) + Eigen::Vector3d(0.0, 0.0, 0.05);
  ASSERT_TRUE(controller.accept({.mode = Mode::kMoveFrame, .frame = 0, .point = point}));
  GuidedJoints elbow = GuidedJoints::Constant(5, kNotGiven);
  elbow[4] = -0.7;
  ASSERT_TRUE(controller.accept({.mode = Mode::kMoveJoints, .joints = elbow}));
  for (int step = 0; step < 5000 && !controller.state().has_arrived; ++step) {
    measured.position = controller.update(measured).position;
  }
  EXPECT_LT((controller.state().measured_frames.col(0) - point).norm(), 1e-4);
  EXPECT_NEAR(measured.position[4], -0.7, 1e-9);
}

TEST(GuideController, MovesMotorsThatFollowPositions) {
  servos::test::RigOptions options{.robot = servos::test::claw_options()};
  options.robot.mode = servos::ServoMode::kPosition;
  servos::test::Rig rig(options);
  rig.begin();
  ASSERT_EQ(rig.observe().state, DriverReport::State::kReady);
  const auto measured = [&] {
    return MeasuredJoints{.position = GuidedJoints::Map(rig.observation.position.data(), 9),
                          .velocity = GuidedJoints::Map(rig.observation.velocity.data(), 9)};
  };
  const RobotConfig config =
      load_robot_config(TRIFINGER_CONFIG_DIR "/dclaw_dynamixel.yml", {"dynamixel.mode=position"});
  const Simulation simulation(config.simulation, config.session);
  GuidedRobot robot = guided_robot(simulation.connect_untyped().session());
  ASSERT_TRUE(robot.refuses_torques);
  robot.limits = options.robot.limits;
  GuideController controller(robot, {});
  ASSERT_TRUE(controller.begin(measured()));
  const GuidedJoints goal = measured().position.array() + 0.2;
  ASSERT_TRUE(controller.accept({.mode = Mode::kMoveJoints, .joints = goal}));
  for (int step = 0; step < 1000; ++step) {
    const GuideCommand& command = controller.update(measured());
    servos::test::Claw::Action action;
    std::ranges::copy(command.torque, action.torque.begin());
    std::ranges::copy(command.position, action.position.begin());
    ASSERT_TRUE(rig.step(action)) << rig.fault();
    for (const std::uint64_t reasons : rig.applied.reasons) ASSERT_EQ(reasons & kRejected, 0U);
  }
  EXPECT_TRUE(controller.state().has_arrived);
  EXPECT_LT((measured().position - goal).cwiseAbs().maxCoeff(), 0.03);
}

// A chain of hinges whose limits are wider and wider, so that one after the other is at its limit.
GuidedRobot chain_of(int joints) {
  std::string bodies;
  for (int i = 0; i < joints; ++i) {
    bodies += "<body name='b" + std::to_string(i) + "' pos='0 0 0.02'><joint name='j" +
              std::to_string(i) + "' axis='" + (i % 2 == 0 ? "0 1 0" : "1 0 0") +
              "' range='-1 1'/><geom size='0.005'/>";
  }
  for (int i = 0; i < joints; ++i) bodies += "</body>";
  const std::string model =
      "<mujoco><compiler angle='radian'/><worldbody>" + bodies + "</worldbody></mujoco>";
  GuidedRobot robot = guided_robot(options_of_file(
      model.c_str(),
      "safety:\n  every_joint: {max_torque: 1, safety_kd: 0.1, soft_lower: -1, soft_upper: 1, "
      "max_velocity: 1, braking: 5, default_kp: 1, default_kd: 0.1}\n"));
  for (std::size_t i = 0; i < robot.limits.size(); ++i) {
    robot.limits[i].soft_upper = 1e-4 * std::pow(1.1, static_cast<double>(i));
    robot.limits[i].soft_lower = -robot.limits[i].soft_upper;
  }
  return robot;
}

TEST(FrameKinematics, SolvesFewSystemsInAStepHoweverManyJointsStopAtTheirLimits) {
  const GuidedRobot robot = chain_of(60);
  guiding::detail::FrameKinematics kinematics(robot);
  std::mt19937 random{7};
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  int most = 0;
  for (int trial = 0; trial < 100; ++trial) {
    GuidedJoints joints = GuidedJoints::Zero(60);
    GuidedJoints goal = joints;
    for (int i = 0; i < 60; ++i)
      goal[i] = any(random) * robot.limits[static_cast<std::size_t>(i)].soft_upper;
    const std::array goals{
        guiding::detail::FrameGoal{.frame = 0, .point = kinematics.point(0, goal)}};
    double distance = 0.0;
    for (int step = 0; step < 200; ++step) {
      distance = kinematics.approach(goals, joints);
      most = std::max(most, kinematics.num_turns());
    }
    EXPECT_LT(distance, 1e-6);
  }
  EXPECT_LE(most, guiding::detail::FrameKinematics::kMaxTurns);
  EXPECT_GT(most, 1);
}

TEST(GuideController, KnowsTheFrictionOfMotorsTendonsAndJoints) {
  const guiding::detail::FrameKinematics arm(guided("four_joints"));
  const std::vector<std::string> names = guided("four_joints").model->joint_names();
  const auto joint = [&](const char* name) {
    return static_cast<int>(std::ranges::find(names, name) - names.begin());
  };
  EXPECT_NEAR(arm.damping(joint("elbow")), 0.2, 1e-12);
  // The tendon moves two joints with a share of a half each: 2 (1/2)^2 0.05 / (1/2)^2.
  EXPECT_NEAR(arm.damping(joint("finger")), 0.1, 1e-12);
  EXPECT_EQ(guiding::detail::FrameKinematics(guided("slide")).friction(0), 0.5);
  EXPECT_EQ(guiding::detail::FrameKinematics(guided("slide")).radian(0), 0.1);
  const ActuatorParameters pro = actuator(guided_options("finger").description);
  EXPECT_NEAR(guiding::detail::FrameKinematics(guided("finger")).damping(1), pro.damping, 1e-12);
  EXPECT_NEAR(guiding::detail::FrameKinematics(guided("finger")).friction(1), pro.friction, 1e-12);
}

TEST_P(GuideControllerOf, HoldsTheLastPoseIfMeasurementsFailWhileItFloats) {
  GuideController controller(robot_, speeds_, period_);
  const MeasuredJoints measured = at_rest(random_pose());
  ASSERT_TRUE(controller.begin(measured));
  ASSERT_TRUE(controller.accept({.mode = Mode::kFloat}));
  static_cast<void>(controller.update(measured));
  const MeasuredJoints nothing = at_rest(GuidedJoints::Constant(joints_, kNan));
  EXPECT_TRUE(controller.update(nothing).torque.allFinite());
  ASSERT_TRUE(controller.accept({.mode = Mode::kHold}));
  const GuideCommand& command = controller.update(nothing);
  EXPECT_EQ(command.position, measured.position);
  EXPECT_TRUE(command.torque.allFinite());
}

TEST_P(GuideControllerOf, DoesNotAllocateAfterConstruction) {
  GuideController controller(robot_, speeds_, period_);
  GuidedJoints pose = random_pose();
  const AllocationCounter allocations;
  static_cast<void>(controller.begin(at_rest(pose)));
  for (int step = 0; step < 2000; ++step) {
    if (step % 50 == 0) static_cast<void>(controller.accept(random_setpoint()));
    const GuideCommand& command = controller.update(at_rest(pose));
    if (command.position.allFinite()) pose = command.position;
  }
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(GuideSpeeds, NamesTheSettingThatMakesNoSense) {
  const GuidedRobot robot = guided("trifinger");
  for (const double bad : {0.0, -1.0, kNan}) {
    EXPECT_THROW(GuideController(robot, {.joint_speed = bad}), InvalidArgument);
    EXPECT_THROW(GuideController(robot, {.joint_acceleration = bad}), InvalidArgument);
    EXPECT_THROW(GuideController(robot, {.tip_speed = bad}), InvalidArgument);
    EXPECT_THROW(GuideController(robot, {.max_lead = bad}), InvalidArgument);
  }
}

}  // namespace
}  // namespace trifinger::test
