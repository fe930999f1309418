// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/task.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {
namespace {

const Pose kStart{
    .position = {0.02, -0.01, 0.0325},
    .orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()))};
constexpr double kRadius = 0.05;
constexpr Seconds kLead(1.5);
constexpr LiftTask kLift{
    .height = 0.2, .lift_time = Seconds(3), .hold_time = Seconds(2), .lower_time = Seconds(3)};
constexpr SlideTask kSlide{.radius = kRadius,
                           .turns = 1.5,
                           .period = Seconds(4),
                           .ramp_time = Seconds(1),
                           .table_share = 0.2,
                           .start_angles = 12};

Pose led() {
  return {.position = {0.0, 0.0, 0.0355},
          .orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()))};
}

ObjectTrajectory slide() {
  return {kSlide,
          kLead,
          kStart,
          {.position = {0.0, kRadius, 0.0325}, .orientation = kStart.orientation},
          M_PI / 2};
}

ObjectTrajectory carry() {
  return {CarryTask{.goal = {{0.03, 0.04, 0.08},
                             Eigen::Quaterniond(Eigen::AngleAxisd(
                                 0.8, Eigen::Vector3d(1.0, 0.5, 0.3).normalized()))},
                    .speed = 0.1,
                    .turn_speed = 0.6,
                    .clearance = 0.004,
                    .hold_time = Seconds(3)},
          kLead,
          kStart,
          kStart,
          0.0,
          0.0563};
}

std::vector<ObjectTrajectory> trajectories() {
  LiftTask touch = kLift;
  touch.hold_time = Seconds(0);
  return {ObjectTrajectory(kLift, kLead, kStart, led()),
          ObjectTrajectory(touch, kLead, kStart, kStart), slide(), carry()};
}

void expect_no_jumps(const ObjectTrajectory& trajectory) {
  constexpr Seconds kStep(1e-3);
  Motion before = trajectory.at(Seconds(0));
  EXPECT_LT((before.pose.position - kStart.position).norm(), 1e-12);
  for (Seconds time = kStep; time < trajectory.duration() + Seconds(0.1); time += kStep) {
    const Motion now = trajectory.at(time);
    // The motion between two points agrees with the velocity.
    const Eigen::Vector3d moved = now.pose.position - before.pose.position;
    const Eigen::Vector3d mean = (now.twist.linear + before.twist.linear) / 2 * kStep.count();
    ASSERT_LT((moved - mean).norm(), 1e-6) << time.count();
    // No trajectory turns faster than 2 rad/s.
    ASSERT_LT(control::rotation_error(now.pose.orientation, before.pose.orientation).norm(), 2e-3);
    before = now;
  }
  EXPECT_LT(before.twist.linear.norm(), 1e-9);
}

TEST(ObjectTrajectory, IsContinuousFromItsStartToItsEnd) {
  for (const ObjectTrajectory& trajectory : trajectories()) expect_no_jumps(trajectory);
}

TEST(ObjectTrajectory, GoesThroughItsLegsInTheirOrder) {
  for (const ObjectTrajectory& trajectory : trajectories()) {
    Leg before = Leg::kLead;
    for (Seconds time(0); time < trajectory.duration() + Seconds(0.1); time += Seconds(0.01)) {
      const Leg leg = trajectory.leg_at(time);
      EXPECT_GE(leg, before);
      EXPECT_GE(time, trajectory.begin_of(leg));
      before = leg;
    }
    EXPECT_EQ(before, Leg::kRest);
  }
}

TEST(ObjectTrajectory, LiftsAlongAVerticalLineAndPutsBackOnTheTable) {
  const ObjectTrajectory trajectory(kLift, kLead, kStart, led());
  const Pose top = trajectory.at(trajectory.begin_of(Leg::kHold)).pose;
  EXPECT_LT((top.position - led().position - Eigen::Vector3d(0, 0, kLift.height)).norm(), 1e-12);
  const Pose end = trajectory.at(trajectory.duration()).pose;
  EXPECT_LT((end.position.head<2>() - led().position.head<2>()).norm(), 1e-12);
  EXPECT_NEAR(end.position.z(), kStart.position.z(), 1e-12);
}

TEST(ObjectTrajectory, SlidesOnTheCircleAndLeavesAShareOfTheWeightOnTheTable) {
  const ObjectTrajectory trajectory = slide();
  for (Seconds time = trajectory.begin_of(Leg::kFollow); time < trajectory.duration();
       time += Seconds(0.05)) {
    const Motion motion = trajectory.at(time);
    EXPECT_NEAR(motion.pose.position.head<2>().norm(), kRadius, 1e-12);
    EXPECT_NEAR(motion.acceleration.linear.z(), -kSlide.table_share * 9.81, 1e-12);
  }
}

TEST(ObjectTrajectory, ComesDownWhereverItIsGivenUp) {
  for (const ObjectTrajectory& whole : trajectories()) {
    for (Seconds time(0); time < whole.duration(); time += Seconds(0.31)) {
      ObjectTrajectory trajectory = whole;
      trajectory.give_up(time);
      EXPECT_LE(trajectory.duration(), std::max(time + Seconds(4), whole.duration()));
      EXPECT_LT((trajectory.at(time).pose.position - whole.at(time).pose.position).norm(), 1e-12);
      EXPECT_NEAR(trajectory.at(trajectory.duration()).pose.position.z(), kStart.position.z(),
                  1e-12);
    }
  }
}

TEST(ObjectTrajectory, RefusesWhatMakesNoSense) {
  LiftTask sudden = kLift;
  sudden.lift_time = Seconds(0);
  LiftTask early = kLift;
  early.hold_time = Seconds(-1);
  SlideTask still = kSlide;
  still.turns = 0.0;
  for (const Task& task : {Task(sudden), Task(early), Task(still)})
    EXPECT_THROW(ObjectTrajectory(task, kLead, kStart, led()), InvalidArgument) << task.index();
}

TEST(Upright, TurnsTheNearestAxisUpAndKeepsTheYaw) {
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(i);
    const Eigen::Quaterniond standing =
        Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) *
        Eigen::Quaterniond::FromTwoVectors(axis, Eigen::Vector3d::UnitZ());
    const Eigen::Quaterniond leaning =
        control::rotation_from_vector(Eigen::Vector3d(0.05, -0.08, 0.0)) * standing;
    const Pose found = upright({.position = {0.1, 0.2, 0.3}, .orientation = leaning});
    EXPECT_NEAR((found.orientation * axis).z(), 1.0, 1e-12);
    EXPECT_LT(control::rotation_error(standing, found.orientation).norm(), 1e-3);
    EXPECT_EQ(found.position, Eigen::Vector3d(0.1, 0.2, 0.3));
  }
}

}  // namespace
}  // namespace trifinger::manipulation
