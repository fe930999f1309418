// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "random_grasps.hpp"

namespace trifinger::control {
namespace {

using test::Random;

TEST(RotationVector, IsUndoneByItsRotation) {
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const double length = std::pow(10.0, random.between(-12, 0.497));  // Below pi.
    const Eigen::Vector3d vector = length * random.direction();
    const Eigen::Quaterniond rotation = rotation_from_vector(vector);
    EXPECT_NEAR(rotation.norm(), 1, 1e-15);
    EXPECT_LT((rotation_vector(rotation) - vector).norm(), 1e-14 * (1 + length));
    // The negative quaternion is an equal rotation.
    const Eigen::Quaterniond negative(-rotation.coeffs());
    EXPECT_LT((rotation_vector(negative) - vector).norm(), 1e-14 * (1 + length));
  }
}

TEST(RotationVector, IsThatOfAnglesAboutAxes) {
  Random random(2);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d axis = random.direction();
    const double angle = random.between(0, std::numbers::pi - 1e-6);
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(angle, axis));
    EXPECT_LT((rotation_vector(rotation) - angle * axis).norm(), 1e-12);
    EXPECT_LT(rotation_from_vector(angle * axis).angularDistance(rotation), 1e-12);
  }
}

TEST(RotationVector, IsNothingForNoRotation) {
  EXPECT_EQ(rotation_vector(Eigen::Quaterniond::Identity()), Eigen::Vector3d::Zero());
  EXPECT_EQ(rotation_from_vector(Eigen::Vector3d::Zero()).w(), 1.0);
}

TEST(RotationError, TurnsTheActualIntoTheDesired) {
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Quaterniond desired = random.orientation();
    const Eigen::Quaterniond actual = random.orientation();
    const Eigen::Vector3d error = rotation_error(desired, actual);
    EXPECT_LE(error.norm(), std::numbers::pi + 1e-12);
    EXPECT_LT((rotation_from_vector(error) * actual).angularDistance(desired), 1e-7);
  }
}

TEST(MovedPose, ChangesAtTheRateOfItsTwist) {
  Random random(4);
  constexpr Seconds kStep{1e-6};
  for (int i = 0; i < 100; ++i) {
    const Motion body = random.motion();
    const Pose after = moved(body.pose, body.twist, kStep);
    const Pose before = moved(body.pose, body.twist, -kStep);
    const double span = 2 * kStep.count();
    EXPECT_LT(((after.position - before.position) / span - body.twist.linear).norm(), 1e-8);
    EXPECT_LT(
        (rotation_error(after.orientation, before.orientation) / span - body.twist.angular).norm(),
        1e-8);
  }
}

TEST(PointOfBody, HasTheDerivativesOfItsPosition) {
  Random random(5);
  constexpr double kStep = 1e-4;
  for (int i = 0; i < 100; ++i) {
    const Motion body = random.motion();
    const Eigen::Vector3d point = random.numbers<3>(0.1);
    // Exact to second order in time.
    const auto position = [&](double time) {
      const Twist mean{body.twist.linear + time / 2 * body.acceleration.linear,
                       body.twist.angular + time / 2 * body.acceleration.angular};
      const Pose pose = moved(body.pose, mean, Seconds(time));
      return Eigen::Vector3d(pose.position + pose.orientation * point);
    };
    const PointMotion found = point_of_body(body, point);
    EXPECT_LT((found.position - position(0)).norm(), 1e-15);
    EXPECT_LT((found.velocity - (position(kStep) - position(-kStep)) / (2 * kStep)).norm(), 1e-5);
    const Eigen::Vector3d acceleration =
        (position(kStep) - 2 * position(0) + position(-kStep)) / (kStep * kStep);
    EXPECT_LT((found.acceleration - acceleration).norm(), 1e-5 * (1 + acceleration.norm()));
  }
}

}  // namespace
}  // namespace trifinger::control
