// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/read_limits.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <iomanip>
#include <limits>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "joint/limits_of_tests.hpp"
#include "support/config_message.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger {
namespace {

using config::File;
using test::message_of;
using testing::Each;
using testing::ElementsAre;

// A list that names a value of each joint.
template <std::size_t N>
std::string list_of(const JointLimits<N>& limits, double JointLimit::* value) {
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10);
  for (const JointLimit& limit : limits) {
    text << (text.tellp() == 0 ? "[" : ", ");
    if (limit.*value == test::kOff) {
      text << ".inf";
    } else {
      text << limit.*value;
    }
  }
  return text.str() + "]";
}

// A section with the values of `some_limits`, except for the one called `missing`.
std::string safety_without(std::string_view missing) {
  const JointLimits<3> limits = test::some_limits<3>();
  std::string outer = "safety:\n";
  std::string inner = "  plausibility:\n";
  for (const JointLimitField& field : JointLimit::fields()) {
    if (field.name == missing) continue;
    const std::string line = std::string(field.name) + ": " + list_of(limits, field.value) + "\n";
    if (const std::size_t dot = line.find('.'); dot < field.name.size()) {
      inner += "    " + line.substr(dot + 1);
    } else {
      outer += "  " + line;
    }
  }
  return outer + inner;
}

template <std::size_t N>
JointLimits<N> limits_with(const std::vector<std::string>& overrides = {}) {
  JointLimits<N> limits;
  const File file = File::parse(safety_without(""), "robot.yml", overrides);
  read_joint_limits(file.root().section("safety"), limits);
  return limits;
}

TEST(ReadJointLimits, RepeatsTheNumbersOfOneFinger) {
  const JointLimits<9> limits =
      limits_with<9>({"safety.max_torque=0.36", "safety.safety_kd=[0.09, 0.09, 0.05]"});
  EXPECT_THAT(values_of(limits, &JointLimit::max_torque), Each(0.36));
  EXPECT_THAT(values_of(limits, &JointLimit::safety_kd),
              ElementsAre(0.09, 0.09, 0.05, 0.09, 0.09, 0.05, 0.09, 0.09, 0.05));
}

TEST(ReadJointLimits, FillsEveryFieldFromTheKeyOfItsName) {
  const JointLimits<3> expected = test::some_limits<3>();
  const JointLimits<3> limits = limits_with<3>();
  for (const JointLimitField& field : JointLimit::fields()) {
    EXPECT_EQ(values_of(limits, field.value), values_of(expected, field.value)) << field.name;
  }
  const std::vector<std::string> error{"safety.plausibility.max_velocity_error=[1, 2, 3]"};
  EXPECT_EQ(limits_with<3>(error)[2].max_velocity_error, 3.0);
}

TEST(ReadJointLimits, fault_59_HasNoDefaultForAnyMember) {
  for (const JointLimitField& field : JointLimit::fields()) {
    const File file = File::parse(safety_without(field.name), "robot.yml");
    JointLimits<9> limits;
    EXPECT_THAT(message_of([&] { read_joint_limits(file.root().section("safety"), limits); }),
                testing::EndsWith("] is missing"))
        << field.name;
  }
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
            "soft_upper (1.51 rad)");
  EXPECT_EQ(message_of([] { (void)limits_with<9>({"safety.max_torque=-1 Nm"}); }),
            "--set safety.max_torque: safety.max_torque is -1 Nm, must be more than 0 and at "
            "most 1e+06 Nm");
  EXPECT_EQ(message_of([] { (void)limits_with<9>({"safety.hard_upper=.inf"}); }),
            "--set safety.hard_upper: safety.hard_upper is .inf rad, must be -1e+06 to 1e+06 rad");
}

class ShippedConfiguration : public testing::TestWithParam<std::string> {};

TEST_P(ShippedConfiguration, HasLimitsThatMakeSenseAroundItsInitialPosition) {
  const File file = File::load(std::filesystem::path(TRIFINGER_CONFIG_DIR) / GetParam());
  JointLimits<3> limits;
  read_joint_limits(file.root().section("safety"), limits);
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
