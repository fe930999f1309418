// SPDX-License-Identifier: BSD-3-Clause
// The configurations of lift and slide.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <variant>

#include "manipulation/skills/lift/lift.hpp"
#include "support/folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::manipulation {
namespace {

using ::testing::HasSubstr;

SkillContext context(const std::string& robot = "sim") {
  const RobotConfig config = load_robot_config(robot, {"objects=[{name: cube, type: cube}]"});
  const auto& options = config.simulation;
  return {.description = options.description, .limits = safety_limits_of(options)};
}

TEST(LiftConfig, TakesItsSettings) {
  const ManipulationConfig config =
      load_lift(context(), {"lift.height=0.1", "grasp.friction=0.6", "grasp.min_normal_force=1.1"});
  EXPECT_EQ(std::get<LiftTask>(config.task).height, 0.1);
  EXPECT_EQ(config.controller.friction, 0.6);
  EXPECT_EQ(config.planner.min_normal_force, 1.1);
}

TEST(LiftConfig, IsThatOfTheRobotsVariant) {
  EXPECT_EQ(std::get<LiftTask>(load_lift(context()).task).height, 0.2);
  EXPECT_EQ(std::get<LiftTask>(load_lift(context("trifinger_pro")).task).height, 0.165);
}

TEST(LiftConfig, MayBeExtendedByName) {
  const test::Folder folder;
  const std::filesystem::path path = folder / "mine.yml";
  std::ofstream(path) << "extends: lift_pro\nmax_duration: 7\n";
  EXPECT_EQ(make_skill("lift", context(), path.string())->max_duration(), Seconds(7));
}

TEST(LiftConfig, RefusesWhatItDoesNotKnow) {
  EXPECT_THROW((void)make_skill("lift", context(), {}, {"lift.hight=0.1"}), config::ConfigError);
  EXPECT_THROW((void)make_skill("slide", context(), {}, {"slide.radius=-1"}), config::ConfigError);
  EXPECT_THROW((void)make_skill("slide", context(), {}, {"lift.time=1"}), config::ConfigError);
  EXPECT_THROW((void)make_skill("slide", context(), "lift"), config::ConfigError);
  try {
    (void)make_skill("lift", context(), "lfit");
    FAIL();
  } catch (const InvalidArgument& error) {
    EXPECT_THAT(error.what(), HasSubstr("lift, lift_pro"));
  }
}

}  // namespace
}  // namespace trifinger::manipulation
