// SPDX-License-Identifier: BSD-3-Clause
// Robots of others. tools/fetch_robots.py fetches those that nobody here made; tests/robots has
// their configurations.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sim/enemy.hpp"
#include "support/soak.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::test {
namespace {

class OtherRobots : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const std::filesystem::path root = TRIFINGER_ROOT;
    const std::string name = GetParam();
    const bool is_ours = name == "dclaw";
    const std::string_view package = name == "shadow" ? "gymnasium_robotics" : "robosuite";
    if (!is_ours && !std::filesystem::exists(root / "build/robots" / package)) {
      GTEST_SKIP() << "the robot is missing: python tools/fetch_robots.py --all";
    }
    const std::filesystem::path folder = root / (is_ours ? "config" : "tests/robots");
    config_ = load_robot_config((folder / (name + ".yml")).string());
  }

  RobotConfig config_;
};

TEST_P(OtherRobots, AreHeldByTheSafetyChainUnderHostileActions) {
  SimulatedRobot robot(config_.simulation);
  const std::size_t joints = config_.simulation.limits->size();
  const std::int64_t steps = repetitions(10'000, 1'000'000);
  Enemy enemy(1, joints);
  CountedObservation measured(joints);
  std::vector<std::byte> observation(robot.description().observation.size());
  std::vector<std::byte> action(robot.description().action.size());
  std::vector<std::byte> applied(robot.description().applied_action.size());
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  ProgressLine progress(steps);
  for (std::int64_t step = 0; step < steps; ++step) {
    ASSERT_EQ(robot.get_latest_observation(observation.data()).state, DriverReport::State::kReady);
    read_element(observation.data(), measured);
    write_element(enemy.next(), action.data());
    const DriverReport report = robot.apply_action(action.data(), applied.data());
    ASSERT_EQ(report.state, DriverReport::State::kReady)
        << robot.fault_text(report.fault_code) << " in step " << step;
    // The applied action begins with the torques.
    const auto* const torque = reinterpret_cast<const double*>(applied.data());
    for (std::size_t i = 0; i < joints; ++i) {
      const JointLimit& limit = config_.simulation.limits->at(i);
      const std::string& name = robot.model().joints()[i].name;
      ASSERT_LE(std::abs(torque[i]), limit.max_torque) << name << " in step " << step;
      ASSERT_GT(measured.position[i], limit.hard_lower) << name << " in step " << step;
      ASSERT_LT(measured.position[i], limit.hard_upper) << name << " in step " << step;
    }
    progress.update(step);
  }
}

INSTANTIATE_TEST_SUITE_P(Sim, OtherRobots,
                         testing::Values("dclaw", "jaco", "panda", "shadow", "ur5e"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace trifinger::test
