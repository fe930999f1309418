// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "manipulation/parts/pinched_handling.hpp"
#include "manipulation/skills/makers.hpp"

namespace trifinger::manipulation {
namespace {

using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

PinchedHandlingConfig config_of(const std::string& skill) {
  return read_pinched_handling(load_skill_file(skill, {}).root(), skill == "stand");
}

class ChoosePinch : public ::testing::TestWithParam<const char*> {
 protected:
  ChoosePinch()
      : is_stand_(std::string(GetParam()) == "stand"),
        box_(is_stand_ ? cuboid() : cube()),
        config_(config_of(GetParam())) {}

  [[nodiscard]] Pose resting(double x, double y, double yaw) const {
    return {.position = {x, y, box_.size[2] / 2},
            .orientation = Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Vector3d::UnitZ()))};
  }
  [[nodiscard]] std::optional<Pinch> choose(const Pose& pose,
                                            const std::vector<int>& tried = {}) const {
    return choose_pinch(kinematics_, limits_, box_, pose, config_, kRadius, tried);
  }

  static constexpr double kRadius = 0.0095;
  bool is_stand_;
  ObjectDescription box_;
  PinchedHandlingConfig config_;
  Kinematics kinematics_;
  control::SafetyLimits limits_{control::safety_limits(RobotDescription{})};
};

TEST_P(ChoosePinch, FindsFingersForEveryPlaceNearTheMiddle) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 60; ++i) {
    const Pose pose = resting(0.02 * unit(random), 0.02 * unit(random), kPi * unit(random));
    const auto pinch = choose(pose);
    ASSERT_TRUE(pinch) << i;
    EXPECT_EQ((std::set{pinch->left, pinch->right, pinch->pusher}).size(), 3U);
    EXPECT_NEAR(pinch->axis.dot(pinch->forward), 0.0, 1e-9);
    EXPECT_NEAR(pinch->axis.z(), 0.0, 1e-9);
    // The tips press on two faces that are across from each other.
    const Vector3d face = pose.orientation.conjugate() * pinch->axis;
    EXPECT_NEAR(face.cwiseAbs().maxCoeff(), 1.0, 1e-9);
    // Each finger is on its own side.
    const auto side = [&](int finger) {
      const double azimuth = kinematics_.finger_azimuth(finger);
      return Vector3d(std::cos(azimuth), std::sin(azimuth), 0.0);
    };
    EXPECT_GT(side(pinch->pusher).dot(pinch->forward), 0.8);
    EXPECT_LT(side(pinch->left).dot(pinch->axis), side(pinch->right).dot(pinch->axis));
    if (is_stand_) {
      EXPECT_DOUBLE_EQ(pinch->width, 0.02);
      EXPECT_DOUBLE_EQ(pinch->length, 0.08);
    }
  }
}

TEST_P(ChoosePinch, LeavesOutWhatWasTried) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> unit(-1, 1);
  int others = 0;
  for (int i = 0; i < 60; ++i) {
    const Pose pose = resting(0.02 * unit(random), 0.02 * unit(random), kPi * unit(random));
    std::vector<int> tried;
    while (const auto pinch = choose(pose, tried)) {
      ASSERT_EQ(std::ranges::count(tried, pinch->pusher), 0) << i;
      tried.push_back(pinch->pusher);
    }
    ASSERT_LE(tried.size(), 3U);
    if (tried.size() > 1) ++others;
  }
  EXPECT_GT(others, 20);  // where the box lies decides which fingers reach it
}

TEST_P(ChoosePinch, TurnsWithThePlatform) {
  // A third of a turn clockwise: finger 0 comes to where finger 1 is.
  const Eigen::Quaterniond third(Eigen::AngleAxisd(-2 * kPi / 3, Vector3d::UnitZ()));
  for (const double yaw : {0.1, 0.9, 1.7, 2.5}) {
    const Pose pose = resting(0.01, -0.015, yaw);
    const Pose turned{.position = third * pose.position, .orientation = third * pose.orientation};
    const auto one = choose(pose);
    const auto other = choose(turned);
    ASSERT_TRUE(one && other);
    EXPECT_EQ(other->pusher, (one->pusher + 1) % 3);
    EXPECT_EQ(other->left, (one->left + 1) % 3);
    EXPECT_LT((other->axis - third * one->axis).norm(), 1e-6);
    EXPECT_LT((other->forward - third * one->forward).norm(), 1e-6);
  }
}

TEST_P(ChoosePinch, RefusesWhatItCannotReachOrWhatDoesNotRest) {
  EXPECT_FALSE(choose(resting(0.0, 0.22, 0.0)));
  Pose leaning = resting(0.0, 0.0, 0.0);
  leaning.orientation = Eigen::AngleAxisd(0.6, Vector3d(1, 1, 0).normalized());
  EXPECT_FALSE(choose(leaning));
}

TEST_P(ChoosePinch, TurnsTheSideOfThePusherDown) {
  const auto pinch = choose(resting(0.0, 0.0, 0.4));
  ASSERT_TRUE(pinch);
  const Vector3d turned = turn_by(*pinch, kPi / 2) * pinch->forward;
  EXPECT_LT((turned + Vector3d::UnitZ()).norm(), 1e-9);
  EXPECT_LT((turn_by(*pinch, 1.0) * pinch->axis - pinch->axis).norm(), 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Skills, ChoosePinch, ::testing::Values("turn", "stand"),
                         [](const auto& instance) { return std::string(instance.param); });

TEST(ChoosePinchOfStand, RefusesWhatStandsAlready) {
  PinchedHandlingConfig config = config_of("stand");
  config.pinch_height = 0.014;
  const Pose standing{
      .position = {0, 0, 0.04},
      .orientation = Eigen::Quaterniond(Eigen::AngleAxisd(kPi / 2, Vector3d::UnitX()))};
  EXPECT_FALSE(choose_pinch(Kinematics(), control::safety_limits(RobotDescription{}), cuboid(),
                            standing, config, 0.0095));
}

}  // namespace
}  // namespace trifinger::manipulation
