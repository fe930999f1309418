// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/pose_estimator.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "random_grasps.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/trajectories.hpp"

namespace trifinger::control {
namespace {

using test::Random;

constexpr Seconds kPosePeriod{0.01};

double position_error(const Motion& found, const Pose& actual) {
  return (found.pose.position - actual.position).norm();
}

double turn_error(const Motion& found, const Pose& actual) {
  return rotation_error(found.pose.orientation, actual.orientation).norm();
}

TEST(PoseEstimator, FollowsAConstantTwistWithoutLag) {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const Pose begin = random.pose();
    const Twist twist{random.numbers<3>(0.3), random.numbers<3>(5.0)};
    PoseEstimator estimator(3);
    Seconds time{5};
    for (int k = 0; k < 300; ++k) {
      time += random.between(0.5, 1.5) * kPosePeriod;
      ASSERT_TRUE(estimator.update(time, moved(begin, twist, time)));
    }
    const Seconds later = time + Seconds(0.03);
    const Motion found = estimator.predict(later);
    EXPECT_LT(position_error(found, moved(begin, twist, later)), 1e-9);
    EXPECT_LT(turn_error(found, moved(begin, twist, later)), 1e-9);
    EXPECT_LT((found.twist.linear - twist.linear).norm(), 1e-8);
    EXPECT_LT((found.twist.angular - twist.angular).norm(), 1e-8);
  }
}

// A way round a circle, with a turn.
Motion led(const CircleTrajectory& circle, Seconds time) {
  const Eigen::Vector3d spin(0.5, -1, 2);
  const PointMotion point = circle.at(time);
  return {.pose = {point.position, rotation_from_vector(time.count() * spin)},
          .twist = {point.velocity, spin},
          .acceleration = {.linear = point.acceleration}};
}

TEST(PoseEstimator, NeedsNoBandwidthForAMotionThatIsKnown) {
  const CircleTrajectory circle({.period = Seconds(1), .ramp_time = Seconds(0.3)});
  // The object follows with a constant error.
  const Eigen::Vector3d off(0.002, -0.001, 0.003);
  const Eigen::Quaterniond turn = rotation_from_vector({0.02, 0.05, -0.1});
  const auto object = [&](const Motion& known) {
    return Pose{known.pose.position + off, turn * known.pose.orientation};
  };
  PoseEstimator estimator(0.5);
  const Seconds delay{0.02};
  for (Seconds time{0}; time < circle.duration(); time += kPosePeriod) {
    const Motion then = led(circle, time - delay);
    ASSERT_TRUE(estimator.update(time - delay, object(then), then));
    const Motion now = led(circle, time);
    const Motion found = estimator.predict(time, now);
    ASSERT_LT(position_error(found, object(now)), 1e-12);
    ASSERT_LT(turn_error(found, object(now)), 1e-12);
    ASSERT_LT((found.twist.linear - now.twist.linear).norm(), 1e-12);
    ASSERT_LT((found.twist.angular - turn * now.twist.angular).norm(), 1e-12);
    ASSERT_EQ(found.acceleration.linear, now.acceleration.linear);
  }
}

TEST(PoseEstimator, FiltersNoise) {
  Random random(2);
  PoseEstimator estimator(2);
  const Pose actual = random.pose();
  double squares = 0;
  double noise_squares = 0;
  constexpr int kPoses = 5000;
  for (int k = 0; k < kPoses; ++k) {
    const Eigen::Vector3d noise = random.numbers<3>(1e-3);
    ASSERT_TRUE(estimator.update(
        k * kPosePeriod,
        {actual.position + noise, rotation_from_vector(noise) * actual.orientation}));
    if (k < 500) continue;
    const Motion found = estimator.predict(k * kPosePeriod + Seconds(0.02));
    squares += std::pow(position_error(found, actual), 2);
    noise_squares += noise.squaredNorm();
    EXPECT_LT(turn_error(found, actual), 2e-3);
  }
  EXPECT_LT(squares, noise_squares / 2);
}

TEST(PoseEstimator, FollowsARotationThroughManyTurns) {
  PoseEstimator estimator(5);
  const Twist spin{.angular = {0, 0, 20}};
  for (int k = 0; k < 1000; ++k)
    ASSERT_TRUE(estimator.update(k * kPosePeriod, moved({}, spin, k * kPosePeriod)));
  EXPECT_NEAR(estimator.predict(Seconds(10)).twist.angular.z(), 20, 1e-6);
}

TEST(PoseEstimator, KnowsNothingButTheKnownMotionBeforeTheFirstPose) {
  Random random(3);
  PoseEstimator estimator;
  const Motion known = random.motion();
  EXPECT_EQ(estimator.predict(Seconds(3), known).pose.position, known.pose.position);
  EXPECT_TRUE(estimator.update(Seconds(1), random.pose(), known));
  EXPECT_NE(estimator.predict(Seconds(3), known).pose.position, known.pose.position);
  estimator.reset();
  EXPECT_EQ(estimator.predict(Seconds(3), known).pose.position, known.pose.position);
}

TEST(PoseEstimator, IgnoresWhatIsNotNewOrNotFinite) {
  Random random(4);
  PoseEstimator estimator;
  const Pose first = random.pose();
  const Pose second = random.pose();
  EXPECT_TRUE(estimator.update(Seconds(1), first));
  EXPECT_FALSE(estimator.update(Seconds(1), second));
  EXPECT_FALSE(estimator.update(Seconds(0.5), second));
  EXPECT_FALSE(estimator.update(Seconds(std::nan("")), second));
  Pose bad = second;
  bad.position.x() = std::nan("");
  EXPECT_FALSE(estimator.update(Seconds(2), bad));
  EXPECT_EQ(estimator.last_time(), Seconds(1));
  EXPECT_EQ(estimator.predict(Seconds(2)).pose.position, first.position);
}

TEST(PoseEstimator, RefusesABandwidthThatMakesNoSense) {
  EXPECT_THROW(PoseEstimator(0), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::control
