// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/read_limits.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "support/config_message.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger {
namespace {

using config::File;
using test::message_of;
using testing::Each;
using testing::ElementsAre;

constexpr const char* kSafety =
    "safety:\n"
    "  max_torque: 0.36\n"
    "  safety_kd: [0.09, 0.09, 0.05]\n"
    "  soft_lower: [-1.6, -1.2, -3.0]\n"
    "  soft_upper: [1.0, 1.6, 3.0]\n"
    "  hard_lower: [-2.0, -1.4, -3.2]\n"
    "  hard_upper: [1.6, 1.8, 3.2]\n"
    "  default_kp: [7, 7, 6.5]\n"
    "  default_kd: [0.01, 0.015, 0.02]\n"
    "  max_kp: 50\n"
    "  max_kd: 0.5\n"
    "  max_velocity: 10\n"
    "  braking: 5\n"
    "  max_torque_rate: .inf\n"
    "  continuous_torque: 0.3\n"
    "  thermal_time: 20\n"
    "  plausibility:\n"
    "    max_position_rate: 60\n"
    "    max_velocity_error: [1, 2, 3]\n"
    "    velocity_error_time: 0.1\n"
    "    stuck_torque: 0.2\n"
    "    stuck_time: .inf\n";

template <std::size_t N>
JointLimits<N> limits_with(const std::vector<std::string>& overrides = {}) {
  return read_joint_limits<N>(
      File::parse(kSafety, "robot.yml", overrides).root().section("safety"));
}

TEST(ReadJointLimits, RepeatsTheNumbersOfOneFinger) {
  const JointLimits<9> limits = limits_with<9>();
  EXPECT_THAT(limits.max_torque, Each(0.36));
  EXPECT_THAT(limits.safety_kd, ElementsAre(0.09, 0.09, 0.05, 0.09, 0.09, 0.05, 0.09, 0.09, 0.05));
  EXPECT_THAT(limits_with<3>().soft_lower, ElementsAre(-1.6, -1.2, -3.0));
}

TEST(ReadJointLimits, FillsEveryMemberFromTheKeyOfItsName) {
  const JointLimits<3> limits = limits_with<3>();
  EXPECT_EQ(limits.max_torque[2], 0.36);
  EXPECT_EQ(limits.safety_kd[2], 0.05);
  EXPECT_EQ(limits.soft_lower[2], -3.0);
  EXPECT_EQ(limits.soft_upper[2], 3.0);
  EXPECT_EQ(limits.hard_lower[2], -3.2);
  EXPECT_EQ(limits.hard_upper[2], 3.2);
  EXPECT_EQ(limits.default_kp[2], 6.5);
  EXPECT_EQ(limits.default_kd[2], 0.02);
  EXPECT_EQ(limits.max_kp[2], 50.0);
  EXPECT_EQ(limits.max_kd[2], 0.5);
  EXPECT_EQ(limits.max_velocity[2], 10.0);
  EXPECT_EQ(limits.braking[2], 5.0);
  EXPECT_EQ(limits.max_torque_rate[2], std::numeric_limits<double>::infinity());
  EXPECT_EQ(limits.continuous_torque[2], 0.3);
  EXPECT_EQ(limits.thermal_time[2], 20.0);
  EXPECT_EQ(limits.plausibility.max_position_rate[2], 60.0);
  EXPECT_EQ(limits.plausibility.max_velocity_error[2], 3.0);
  EXPECT_EQ(limits.plausibility.velocity_error_time[2], 0.1);
  EXPECT_EQ(limits.plausibility.stuck_torque[2], 0.2);
  EXPECT_EQ(limits.plausibility.stuck_time[2], std::numeric_limits<double>::infinity());
}

TEST(ReadJointLimits, fault_59_HasNoDefaultForAnyMember) {
  const std::string whole = kSafety;
  std::size_t members = 0;
  for (std::size_t begin = whole.find('\n') + 1; begin < whole.size();
       begin = whole.find('\n', begin) + 1) {
    const std::string line = whole.substr(begin, whole.find('\n', begin) + 1 - begin);
    if (line == "  plausibility:\n") continue;
    ++members;
    std::string text = whole;
    text.erase(begin, line.size());
    const File file = File::parse(text, "robot.yml");
    EXPECT_THAT(message_of([&] { (void)read_joint_limits<9>(file.root().section("safety")); }),
                testing::EndsWith("] is missing"))
        << line;
  }
  EXPECT_EQ(members, detail::kJointLimitFields);
}

TEST(ReadJointLimits, RefusesListsThatDoNotFit) {
  EXPECT_EQ(message_of([] { (void)limits_with<9>({"safety.max_torque=[1, 2]"}); }),
            "--set safety.max_torque: safety.max_torque has 2 entries, must have 1, 3 or 9");
  EXPECT_EQ(message_of([] { (void)limits_with<9>({"safety.max_torque=[]"}); }),
            "--set safety.max_torque: safety.max_torque has 0 entries, must have 1, 3 or 9");
}

TEST(ReadJointLimits, PointsAtTheLimitThatMakesNoSense) {
  EXPECT_EQ(message_of([] { (void)limits_with<9>({"safety.soft_lower=[-1.6, 1.7, -3.0]"}); }),
            "--set safety.soft_lower: safety.soft_lower of joint 1 is 1.7 rad, must be less than "
            "soft_upper (1.6 "
            "rad)");
  EXPECT_EQ(message_of([] { (void)limits_with<9>({"safety.max_torque=-1 Nm"}); }),
            "--set safety.max_torque: safety.max_torque of joint 0 is -1 Nm, must be more than 0");
  EXPECT_EQ(
      message_of([] { (void)limits_with<9>({"safety.hard_upper=.inf"}); }),
      "--set safety.hard_upper: safety.hard_upper is .inf rad, must be a finite number [rad]");
}

class ShippedConfiguration : public testing::TestWithParam<std::string> {};

TEST_P(ShippedConfiguration, HasLimitsThatMakeSenseAroundItsInitialPosition) {
  const File file = File::load(std::filesystem::path(TRIFINGER_CONFIG_DIR) / GetParam());
  const auto limits = read_joint_limits<3>(file.root().section("safety"));
  const auto position =
      file.root().section("fingers").required<std::array<double, 3>>("initial_position");
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_GT(position[i], limits.soft_lower[i]) << "joint " << i;
    EXPECT_LT(position[i], limits.soft_upper[i]) << "joint " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Files, ShippedConfiguration,
                         testing::Values("sim.yml", "trifinger_edu.yml", "trifinger_pro.yml",
                                         "trifinger_one.yml", "finger_edu.yml", "finger_pro.yml",
                                         "finger_one.yml"),
                         [](const auto& test) {
                           return test.param.substr(0, test.param.find('.'));
                         });

}  // namespace
}  // namespace trifinger
