// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "support/folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::manipulation {
namespace {

using ::testing::HasSubstr;
using ::testing::IsSupersetOf;

TEST(ManipulationConfig, IsReadForBothTasksFromEveryFileThatComesWithTheProgram) {
  const auto names = config_names("manipulate");
  EXPECT_THAT(names, IsSupersetOf({"edu", "pro"}));
  for (const std::string& name : names) {
    EXPECT_TRUE(std::holds_alternative<LiftTask>(load_config(name, "lift").task));
    EXPECT_TRUE(std::holds_alternative<SlideTask>(load_config(name, "slide").task));
  }
}

TEST(ManipulationConfig, TakesItsSettings) {
  const ManipulationConfig config = load_config(
      "edu", "lift", {"lift.height=0.1", "grasp.friction=0.6", "grasp.min_normal_force=1.1"});
  EXPECT_EQ(std::get<LiftTask>(config.task).height, 0.1);
  EXPECT_EQ(config.controller.friction, 0.6);
  EXPECT_EQ(config.planner.min_normal_force, 1.1);
}

TEST(ManipulationConfig, ExtendsOneThatComesWithTheProgramByName) {
  const test::Folder folder;
  const std::filesystem::path path = folder / "mine.yml";
  std::ofstream(path) << "extends: pro\nlook_time: 0.7\n";
  const ManipulationConfig mine = load_config(path.string(), "lift");
  const ManipulationConfig shipped = load_config("pro", "lift");
  EXPECT_EQ(mine.look_time, Seconds(0.7));
  EXPECT_EQ(mine.max_duration, shipped.max_duration);
  EXPECT_EQ(mine.object, shipped.object);
}

TEST(ManipulationConfig, RefusesWhatItDoesNotKnow) {
  EXPECT_THROW((void)load_config("edu", "lift", {"lift.hight=0.1"}), config::ConfigError);
  EXPECT_THROW((void)load_config("edu", "lift", {"slide.radius=-1"}), config::ConfigError);
  EXPECT_THROW((void)load_config("edu", "throw"), InvalidArgument);
  try {
    (void)load_config("edo", "lift");
    FAIL();
  } catch (const InvalidArgument& error) {
    EXPECT_THAT(error.what(), HasSubstr("edu, pro"));
  }
}

}  // namespace
}  // namespace trifinger::manipulation
