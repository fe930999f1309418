// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/condition.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger {
namespace {

TEST(Condition, IsPerfectAsDocumented) {
  Random random{.seed = 1};
  EXPECT_EQ(draw(Condition::kAsDocumented, random), Variation{});
  EXPECT_EQ(random, Random{.seed = 1});
}

TEST(Condition, GivesRobotsThatDifferAndThatASimulationTakes) {
  SimulatedRobot robot;
  for (const Condition condition : {Condition::kAsBuilt, Condition::kWorn}) {
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
      Random first{.seed = seed};
      Random second{.seed = seed};
      Random other{.seed = seed + 1000};
      const Variation drawn = draw(condition, first);
      robot.vary(drawn);
      EXPECT_EQ(drawn, draw(condition, second));
      EXPECT_NE(drawn, draw(condition, other));
    }
  }
}

TEST(Condition, IsFoundByItsName) {
  for (const Condition condition :
       {Condition::kAsDocumented, Condition::kAsBuilt, Condition::kWorn}) {
    EXPECT_EQ(condition_from_name(name_of(condition)), condition);
  }
  EXPECT_THROW((void)condition_from_name("new"), InvalidArgument);
}

TEST(Condition, ANumberIsSetByItsName) {
  Variation robot;
  set_value(robot, "backlash", 0.004);
  set_value(robot, "torque_delay", 2.0);
  Variation expected;
  expected.backlash = 0.004;
  expected.torque_delay = 2;
  EXPECT_EQ(robot, expected);
  for (const char* name : {"play", "pair_friction", ""}) {
    EXPECT_THROW(set_value(robot, name, 1.0), InvalidArgument) << name;
  }
}

TEST(Condition, OfAConfigurationIsThatOfItsRobot) {
  // Errors of homing are what a session sees at once.
  const auto seen = [](const std::vector<std::string>& settings) {
    SimulatedRobot robot(
        load_robot_config(TRIFINGER_CONFIG_DIR "/trifinger_edu.yml", settings).simulation);
    EXPECT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
    TriFinger::Observation observation;
    (void)robot.get_latest_observation(&observation);
    return observation.position;
  };
  const auto documented = seen({});
  EXPECT_EQ(seen({"simulation.condition=as documented"}), documented);
  const auto worn = seen({"simulation.condition=worn", "simulation.seed=3"});
  EXPECT_NE(worn, documented);
  EXPECT_EQ(seen({"simulation.condition=worn", "simulation.seed=3"}), worn);
  EXPECT_NE(seen({"simulation.condition=worn", "simulation.seed=4"}), worn);
  EXPECT_THROW((void)seen({"simulation.condition=new"}), config::ConfigError);
}

}  // namespace
}  // namespace trifinger
