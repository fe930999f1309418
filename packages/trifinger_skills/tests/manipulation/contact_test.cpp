// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/contact.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace trifinger::evaluation {
namespace {

control::Pose any_pose(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return {.position = {normal(random), normal(random), normal(random)},
          .orientation =
              Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                  .normalized()};
}

// The distance from a surface changes at most as fast as the point moves, in one direction exactly
// as fast. So a step by the distance along its gradient leads to the surface.
TEST(DistanceToSurface, IsTheWayToTheNearestPointOfTheSurface) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> between(-0.12, 0.12);
  for (const ObjectDescription& object : {cube(), cuboid(), stick(), ball()}) {
    for (int i = 0; i < 200; ++i) {
      const control::Pose pose = any_pose(random);
      const Eigen::Vector3d point =
          pose.position + Eigen::Vector3d(between(random), between(random), between(random));
      const double distance = distance_to_surface(object, pose, point);
      Eigen::Vector3d gradient;
      constexpr double kStep = 1e-7;
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
        gradient[axis] = (distance_to_surface(object, pose, point + step) -
                          distance_to_surface(object, pose, point - step)) /
                         (2 * kStep);
      }
      // On an edge of what is nearest the gradient is not defined.
      if (std::abs(gradient.norm() - 1.0) > 1e-5) continue;
      EXPECT_NEAR(distance_to_surface(object, pose, point - distance * gradient), 0.0, 1e-6);
    }
  }
}

TEST(LowestPoint, IsWhereAPlaneFromBelowFirstTouches) {
  std::mt19937 random(2);
  for (const ObjectDescription& object : {cube(), cuboid(), stick(), ball()}) {
    for (int i = 0; i < 20; ++i) {
      const control::Pose pose = any_pose(random);
      const double lowest = lowest_point(object, pose);
      // No point of a fine grid below it is inside, and some point just above it is.
      double nearest = 1.0;
      for (double x = -0.08; x <= 0.08; x += 0.001) {
        for (double y = -0.08; y <= 0.08; y += 0.001) {
          const Eigen::Vector3d on_plane(pose.position.x() + x, pose.position.y() + y, lowest);
          nearest = std::min(nearest, distance_to_surface(object, pose, on_plane));
        }
      }
      EXPECT_GT(nearest, -1e-9);
      EXPECT_LT(nearest, 1e-3);
    }
  }
}

}  // namespace
}  // namespace trifinger::evaluation
