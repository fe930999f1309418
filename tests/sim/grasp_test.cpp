// SPDX-License-Identifier: BSD-3-Clause
#include "sim/grasp.hpp"

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <cmath>
#include <iostream>
#include <limits>
#include <numbers>
#include <optional>

namespace trifinger::test {
namespace {

constexpr std::array<int, 3> kFingersOnFaces{0, 1, 2};

double radians(double degrees) { return degrees * std::numbers::pi / 180; }

struct Hold {
  double creep;   // drift of the cube relative to the tips, from second 1 to second 15 [m]
  double height;  // height of the cube at the end [m]
  std::array<double, 3> tip_force;
};

Hold hold_for_15_seconds(double yaw, std::optional<double> impratio = {}) {
  const Simulation simulation;
  SimulatedRobot& driver = simulation.robot();
  // Only this test changes the setting, to see what another one would do.
  if (impratio) const_cast<mjModel*>(driver.model().mujoco())->opt.impratio = *impratio;

  Grasp grasp(driver.options().description, yaw, kFingersOnFaces);
  EXPECT_TRUE(grasp.can_be_reached());
  grasp.put(driver);
  Frontend<TriFinger> robot = simulation.connect();
  TriFinger::Observation observation = robot.latest_observation();
  Eigen::Vector3d after_one_second = Eigen::Vector3d::Zero();
  constexpr int kSteps = 15000;
  for (int i = 0; i < kSteps; ++i) {
    observation = robot.get_observation(robot.append_desired_action(grasp.action(observation)));
    if (i == 1000) after_one_second = grasp.cube_relative_to_tips(driver, observation);
  }
  const Eigen::Vector3d end = grasp.cube_relative_to_tips(driver, observation);
  return {(end - after_one_second).norm(), driver.object_pose("cube").position[2],
          observation.tip_force};
}

TEST(Grasp, HoldsTheCubeForFifteenSeconds) {
  for (const double degrees : {105.0, 135.0, 165.0}) {
    const Hold hold = hold_for_15_seconds(radians(degrees));
    EXPECT_LT(hold.creep, 1e-3) << degrees;
    EXPECT_NEAR(hold.height, Grasp::kHeight, 3e-3) << degrees;
    // The springs reduce the force a little.
    EXPECT_NEAR(hold.tip_force[0], Grasp::kSqueeze, 0.15) << degrees;
    EXPECT_NEAR(hold.tip_force[1], Grasp::kSqueeze, 0.15) << degrees;
    EXPECT_GT(hold.tip_force[2], 0.1) << degrees;
    std::cout << "a cube turned by " << degrees << " degrees creeps by " << hold.creep * 1e3
              << " mm in 14 s\n";
  }
}

// docs/decisions/contact_settings.md explains this choice.
TEST(Grasp, WouldCreepWithOtherContactSettings) {
  const double chosen = hold_for_15_seconds(radians(135)).creep;
  EXPECT_GT(hold_for_15_seconds(radians(135), 10).creep, 3 * chosen);
}

}  // namespace
}  // namespace trifinger::test
