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
  EXPECT_THAT(values_of(limits, &JointLimit::max_torque), Each(0.36));
  EXPECT_THAT(values_of(limits, &JointLimit::safety_kd),
              ElementsAre(0.09, 0.09, 0.05, 0.09, 0.09, 0.05, 0.09, 0.09, 0.05));
  EXPECT_THAT(values_of(limits_with<3>(), &JointLimit::soft_lower), ElementsAre(-1.6, -1.2, -3.0));
}

TEST(ReadJointLimits, FillsEveryFieldFromTheKeyOfItsName) {
  const JointLimit limit = limits_with<3>()[2];
  const File file = File::parse(kSafety, "robot.yml");
  for (const JointLimitField& field : JointLimit::fields()) {
    std::string key(field.name);
    config::Node section = file.root().section("safety");
    if (const std::size_t dot = key.find('.'); dot != std::string::npos) {
      section = section.section(key.substr(0, dot));
      key.erase(0, dot + 1);
    }
    const config::Node node = section.at(key, field.unit);
    const config::Range any{.allow_infinite = true};
    const double written =
        node.is_list() ? node.as<std::vector<double>>(any).back() : node.as<double>(any);
    EXPECT_EQ(limit.*field.value, written) << field.name;
  }
  EXPECT_EQ(limit.hard_upper, 3.2);
  EXPECT_EQ(limit.max_velocity_error, 3.0);
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
  EXPECT_EQ(members, JointLimit::fields().size());
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
            "--set safety.max_torque: safety.max_torque is -1 Nm, must be more than 0 and at "
            "most 1e+06 Nm");
  EXPECT_EQ(message_of([] { (void)limits_with<9>({"safety.hard_upper=.inf"}); }),
            "--set safety.hard_upper: safety.hard_upper is .inf rad, must be -1e+06 to 1e+06 rad");
}

class ShippedConfiguration : public testing::TestWithParam<std::string> {};

TEST_P(ShippedConfiguration, HasLimitsThatMakeSenseAroundItsInitialPosition) {
  const File file = File::load(std::filesystem::path(TRIFINGER_CONFIG_DIR) / GetParam());
  const auto limits = read_joint_limits<3>(file.root().section("safety"));
  const auto position =
      file.root().section("fingers").required<std::array<double, 3>>("initial_position");
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_GT(position[i], limits[i].soft_lower) << "joint " << i;
    EXPECT_LT(position[i], limits[i].soft_upper) << "joint " << i;
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
