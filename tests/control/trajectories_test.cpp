// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/trajectories.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <numbers>

#include "random_grasps.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using std::chrono::milliseconds;
using test::Random;

constexpr double kStep = 1e-5;  // [s]

// Checks that velocity and acceleration are derivatives of the position: on the whole trajectory,
// at its ends and beyond them. This also shows that all three are continuous.
template <class Trajectory>
void expect_derivatives(const Trajectory& trajectory) {
  const double duration = trajectory.duration().count();
  for (int i = -100; i <= 1100; ++i) {
    const double time = duration * i / 1000;
    const auto at = [&](double seconds) { return trajectory.at(Seconds(seconds)); };
    const PointMotion now = at(time);
    const PointMotion after = at(time + kStep);
    const PointMotion before = at(time - kStep);
    ASSERT_LT(((after.position - before.position) / (2 * kStep) - now.velocity).norm(), 1e-6) << i;
    ASSERT_LT(((after.velocity - before.velocity) / (2 * kStep) - now.acceleration).norm(), 1e-2)
        << i;
    ASSERT_LT((after.acceleration - before.acceleration).norm(), 1e-2) << i;
  }
}

template <class Trajectory>
void expect_rest_outside(const Trajectory& trajectory) {
  const Seconds end = trajectory.duration();
  for (const Seconds time : {Seconds(-1), Seconds(0), end, end + Seconds(1)}) {
    const PointMotion motion = trajectory.at(time);
    EXPECT_LT(motion.velocity.norm(), 1e-12);
    EXPECT_LT(motion.acceleration.norm(), 1e-12);
    EXPECT_LT((motion.position - trajectory.at(time < end ? Seconds(0) : end).position).norm(),
              1e-12);
  }
}

TEST(LineTrajectory, GoesFromRestToRestOnAStraightLine) {
  const Eigen::Vector3d from(0.1, -0.2, 0.3);
  const Eigen::Vector3d to(0.2, 0.1, 0.1);
  const LineTrajectory line(from, to, milliseconds(700));
  expect_rest_outside(line);
  expect_derivatives(line);
  EXPECT_EQ(line.at(Seconds(0)).position, from);
  EXPECT_LT((line.at(line.duration()).position - to).norm(), 1e-15);
  EXPECT_LT((line.at(line.duration() / 2).position - (from + to) / 2).norm(), 1e-15);
  for (int i = 0; i <= 100; ++i) {
    const Eigen::Vector3d displacement = line.at(line.duration() * i / 100).position - from;
    EXPECT_LT(displacement.cross(to - from).norm(), 1e-15);
    EXPECT_GE(displacement.dot(to - from), 0);
  }
}

TEST(MinimumJerk, HasTheLeastJerkOfAllMovementsBetweenTheSameEnds) {
  // A neighbour is x + e n, where n and its first two derivatives vanish at both ends. Its squared
  // jerk has its minimum at e = 0 exactly if the integral of the product of both jerks is zero.
  constexpr int kCells = 1000;
  double product_with_cubic = 0;    // n = s^3 (1 - s)^3
  double product_with_quartic = 0;  // n = s^4 (1 - s)^3
  double squared = 0;
  for (int i = 0; i < kCells; ++i) {
    const double s = (i + 0.5) / kCells;
    const auto acceleration = [](double at) {
      return minimum_jerk(Seconds(at), Seconds(1)).acceleration;
    };
    const double jerk = (acceleration(s + 1e-4) - acceleration(s - 1e-4)) / 2e-4;
    product_with_cubic += jerk * (6 + s * (-72 + s * (180 - 120 * s))) / kCells;
    product_with_quartic += jerk * s * (24 + s * (-180 + s * (360 - 210 * s))) / kCells;
    squared += jerk * jerk / kCells;
  }
  EXPECT_NEAR(product_with_cubic, 0, 1e-3);
  EXPECT_NEAR(product_with_quartic, 0, 1e-3);
  EXPECT_NEAR(squared, 720, 1e-2);
}

TEST(MinimumJerk, IsCompleteWithoutDuration) {
  EXPECT_EQ(minimum_jerk(Seconds(0), Seconds(0)).value, 1);
  EXPECT_EQ(minimum_jerk(Seconds(1), Seconds(-1)).value, 1);
  EXPECT_EQ(minimum_jerk(Seconds(std::nan("")), Seconds(1)).value, 0);
}

TEST(PoseTrajectory, EndsWhereItShouldAndTurnsTheShorterWay) {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const Pose from = random.pose();
    const Pose to = random.pose();
    const PoseTrajectory trajectory(from, to, Seconds(2));
    const Motion begin = trajectory.at(Seconds(0));
    const Motion end = trajectory.at(Seconds(2));
    EXPECT_LT(begin.pose.orientation.angularDistance(from.orientation), 1e-7);
    EXPECT_LT(end.pose.orientation.angularDistance(to.orientation), 1e-7);
    EXPECT_LT((end.pose.position - to.position).norm(), 1e-15);
    const double angle = from.orientation.angularDistance(to.orientation);
    const Motion middle = trajectory.at(Seconds(1));
    EXPECT_NEAR(middle.pose.orientation.angularDistance(from.orientation), angle / 2, 1e-7);
    for (const Motion& rest : {begin, end}) {
      EXPECT_EQ(rest.twist.angular.norm(), 0);
      EXPECT_EQ(rest.acceleration.angular.norm(), 0);
    }
  }
}

TEST(PoseTrajectory, HasTheDerivativesOfItsPose) {
  Random random(2);
  for (int i = 0; i < 50; ++i) {
    const PoseTrajectory trajectory(random.pose(), random.pose(), Seconds(2));
    const double time = random.between(0.01, 1.99);
    const Motion now = trajectory.at(Seconds(time));
    const Motion after = trajectory.at(Seconds(time + kStep));
    const Motion before = trajectory.at(Seconds(time - kStep));
    const auto expect = [](const Eigen::Vector3d& difference, const Eigen::Vector3d& derivative) {
      EXPECT_LT((difference / (2 * kStep) - derivative).norm(), 1e-6);
    };
    expect(after.pose.position - before.pose.position, now.twist.linear);
    expect(rotation_error(after.pose.orientation, before.pose.orientation), now.twist.angular);
    expect(after.twist.linear - before.twist.linear, now.acceleration.linear);
    expect(after.twist.angular - before.twist.angular, now.acceleration.angular);
  }
}

TEST(CircleTrajectory, GoesRoundAndComesToRestAsOftenAsAsked) {
  Random random(3);
  for (int i = 0; i < 50; ++i) {
    CircleConfig config{.centre = random.numbers<3>(0.1),
                        .radius = random.between(0.01, 0.1),
                        .start_angle = random.between(-4, 4),
                        .turns = random.between(0.5, 3) * (random.one_in(2) ? 1 : -1),
                        .period = Seconds(random.between(1, 5))};
    config.ramp_time = random.between(0.3, 1.0) *
                       std::min<Seconds>(Seconds(1), std::abs(config.turns) * config.period);
    const CircleTrajectory circle(config);
    expect_rest_outside(circle);
    expect_derivatives(circle);
    double turned = 0;
    constexpr int kSamples = 2000;
    for (int k = 0; k < kSamples; ++k) {
      const Eigen::Vector3d a =
          circle.at(circle.duration() * k / kSamples).position - config.centre;
      const Eigen::Vector3d b =
          circle.at(circle.duration() * (k + 1) / kSamples).position - config.centre;
      EXPECT_NEAR(a.norm(), config.radius, 1e-12);
      turned += std::atan2(a.cross(b).z(), a.dot(b));
    }
    EXPECT_NEAR(turned, 2 * std::numbers::pi * config.turns, 1e-9);
    const PointMotion middle = circle.at(circle.duration() / 2);
    EXPECT_NEAR(middle.velocity.norm(),
                2 * std::numbers::pi * config.radius / config.period.count(), 1e-9);
  }
}

TEST(Trajectories, RefuseWhatMakesNoSense) {
  const Eigen::Vector3d here(0, 0, 0);
  const Eigen::Vector3d nowhere(0, std::nan(""), 0);
  EXPECT_THROW(LineTrajectory(here, here, Seconds(0)), InvalidArgument);
  EXPECT_THROW(LineTrajectory(here, nowhere, Seconds(1)), InvalidArgument);
  const Pose half{.orientation = Eigen::Quaterniond(0.5, 0, 0, 0)};
  EXPECT_THROW(PoseTrajectory({}, half, Seconds(1)), InvalidArgument);
  EXPECT_THROW(PoseTrajectory({}, {}, Seconds(-1)), InvalidArgument);
  const auto circle = [](const CircleConfig& config) { CircleTrajectory{config}; };
  EXPECT_NO_THROW(circle({}));
  EXPECT_THROW(circle({.centre = nowhere}), InvalidArgument);
  EXPECT_THROW(circle({.radius = 0}), InvalidArgument);
  EXPECT_THROW(circle({.start_angle = std::nan("")}), InvalidArgument);
  EXPECT_THROW(circle({.turns = 0}), InvalidArgument);
  EXPECT_THROW(circle({.period = Seconds(0)}), InvalidArgument);
  EXPECT_THROW(circle({.ramp_time = Seconds(0)}), InvalidArgument);
  EXPECT_THROW(circle({.turns = 0.2, .period = Seconds(4)}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::control
