// SPDX-License-Identifier: BSD-3-Clause
// What `trifinger new robot` proposes, and the warning about gains.
#include "sim/propose_limits.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "base/text_of.hpp"
#include "model/file_robots.hpp"
#include "sim/gain_warnings.hpp"
#include "support/folder.hpp"
#include "trifinger/joint/limits.hpp"

namespace trifinger::test {
namespace {

using detail::JointProposal;
using detail::RobotProposal;
using detail::text_of;
using testing::ElementsAre;
using testing::HasSubstr;

class ProposeLimits : public testing::Test {
 protected:
  [[nodiscard]] ModelFile model(const std::string& text) const {
    write(folder_ / "robot.xml", text);
    return ModelFile({.path = folder_ / "robot.xml"});
  }
  [[nodiscard]] RobotProposal proposal(const std::string& text) const {
    return detail::propose_limits(model(text));
  }

  Folder folder_;
};

// A lever of 1 kg at 0.2 m that sticks out, and what `joint` and `motor` say.
std::string lever(const std::string& joint, const std::string& motor,
                  const std::string& more = "") {
  return text_of(R"(<mujoco><compiler angle="radian"/><option timestep="0.001"/><worldbody>
    <body><joint name="lift" axis="0 1 0" )",
                 joint, R"(/><inertial pos="0.2 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/></body>
    </worldbody><actuator>)",
                 motor, "</actuator>", more, "</mujoco>");
}

constexpr const char* kStops = R"(range="-1 2")";
constexpr const char* kMotor = R"(<motor joint="lift" ctrlrange="-6 6"/>)";
constexpr double kInertia = 0.041;
constexpr double kWeight = 0.2 * 9.81;

TEST_F(ProposeLimits, ProposesWhatTheChainAccepts) {
  const std::vector<std::string> robots{kArm, lever(kStops, kMotor), lever("", kMotor),
                                        lever(R"(type="slide" range="0 0.01")", kMotor)};
  for (const std::string& robot : robots) {
    std::vector<JointLimit> limits;
    for (const JointProposal& joint : proposal(robot).joints) {
      JointLimit limit = joint.limit;
      const double infinity = std::numeric_limits<double>::infinity();
      if (std::isnan(limit.max_torque)) limit.max_torque = joint.suggested_torque;
      for (const JointLimitField& field : JointLimit::fields()) {
        if (!std::isnan(limit.*field.value)) continue;
        const bool is_gain =
            field.value == &JointLimit::max_kp || field.value == &JointLimit::max_kd;
        EXPECT_TRUE(is_gain || field.may_be_infinite()) << field.name;
        limit.*field.value = infinity;
      }
      limit.max_kp = limit.default_kp;
      limit.max_kd = limit.default_kd;
      limit.soft_lower = std::max(limit.soft_lower, -kLargestJointLimit);
      limit.soft_upper = std::min(limit.soft_upper, kLargestJointLimit);
      limits.push_back(limit);
    }
    EXPECT_EQ(find_problem(limits), std::nullopt);
  }
}

TEST_F(ProposeLimits, TakesGainsFromInertiaAndWeight) {
  const JointProposal joint = proposal(lever(kStops, kMotor)).joints[0];
  EXPECT_NEAR(joint.load.inertia, kInertia, 0.01 * kInertia);
  EXPECT_NEAR(joint.load.largest_weight, kWeight, 0.02 * kWeight);
  // The weight moves it by 0.02 rad, and the damping is critical.
  EXPECT_NEAR(joint.limit.default_kp, kWeight / 0.02, 2.0);
  EXPECT_NEAR(joint.limit.default_kd, 2 * std::sqrt(joint.limit.default_kp * kInertia), 0.05);
  EXPECT_NEAR(joint.limit.safety_kd, 0.1 * joint.limit.default_kd, 0.01);
  EXPECT_EQ(joint.limit.soft_lower, -0.94);
  EXPECT_EQ(joint.limit.soft_upper, 1.94);
  EXPECT_EQ(joint.limit.max_torque, 6.0);
}

TEST_F(ProposeLimits, SoftLimitsAreInsideTheStops) {
  const JointProposal joint =
      proposal(lever(R"(range="-0.333333333 0.777777777")", kMotor)).joints[0];
  EXPECT_GE(joint.limit.soft_lower, -0.333333333 + 0.02 * 1.111);
  EXPECT_LE(joint.limit.soft_upper, 0.777777777 - 0.02 * 1.111);
  EXPECT_NEAR(joint.limit.soft_lower, -0.3111, 0.0011);
  const JointProposal free = proposal(lever("", kMotor)).joints[0];
  EXPECT_EQ(free.limit.soft_upper, std::numeric_limits<double>::infinity());
}

TEST_F(ProposeLimits, GivesALightLinkBehindAStrongMotorARotor) {
  const RobotProposal weak = proposal(lever(kStops, kMotor));
  EXPECT_TRUE(weak.rotors.empty());
  const RobotProposal strong =
      proposal(lever(kStops, R"(<motor joint="lift" ctrlrange="-600 600"/>)"));
  ASSERT_EQ(strong.rotors.size(), 1U);
  // In a step of 1 ms the motor changes the speed by a fifth of 3 rad/s.
  EXPECT_NEAR(strong.joints[0].load.inertia, 600 * 0.001 / 0.6, 0.1);
  // A rotor of the file counts.
  EXPECT_TRUE(proposal(lever(R"(range="-1 2" armature="1")",
                             R"(<motor joint="lift" ctrlrange="-600 600"/>)"))
                  .rotors.empty());
}

TEST_F(ProposeLimits, BeginsInTheMiddleIfZeroIsAtALimit) {
  EXPECT_TRUE(proposal(lever(kStops, kMotor)).initial_position.empty());
  const RobotProposal moved = proposal(lever(R"(range="0 2")", kMotor));
  ASSERT_EQ(moved.initial_position.size(), 1U);
  EXPECT_EQ(moved.initial_position[0].first, "lift");
  EXPECT_EQ(moved.initial_position[0].second, 1.0);
  // A pose that somebody has chosen stays, unless it is at a limit.
  const auto with_key = [&](const std::string& place) {
    return proposal(
        lever(R"(range="0 2")", kMotor, "<keyframe><key qpos=\"" + place + "\"/></keyframe>"));
  };
  EXPECT_TRUE(with_key("0.2").initial_position.empty());
  ASSERT_EQ(with_key("0").initial_position.size(), 1U);
  EXPECT_NEAR(with_key("0").initial_position[0].second, 0.04 + 0.02 * 1.92, 1e-3);
}

TEST_F(ProposeLimits, LeavesALoopWhereItIsClosed) {
  const std::string tied = R"(<equality><connect body1="arm" anchor="0 0 0"/></equality>)";
  std::string text = lever(R"(range="0 2")", kMotor, tied);
  text.replace(text.find("<body>"), 6, R"(<body name="arm">)");
  EXPECT_TRUE(proposal(text).initial_position.empty());
}

TEST_F(ProposeLimits, StopsGiveWayBeforeTheHardLimit) {
  const JointProposal joint = proposal(lever(kStops, kMotor)).joints[0];
  EXPECT_NEAR(joint.limit.hard_lower, -1.3, 1e-9);
  EXPECT_NEAR(joint.limit.hard_upper, 2.3, 1e-9);
  EXPECT_NEAR(proposal(lever(R"(range="0 0.01")", kMotor)).joints[0].limit.hard_upper, 0.06, 1e-9);
}

TEST_F(ProposeLimits, OvercomesDampingAndFrictionOfTheJointItself) {
  const auto stiffness = [&](const std::string& joint) {
    return proposal(lever(joint + R"( range="-1 2")", kMotor)).joints[0].limit.default_kp;
  };
  EXPECT_NEAR(stiffness(R"(damping="50")"), 500.0, 1.0);
  EXPECT_NEAR(stiffness(R"(frictionloss="4")"), (kWeight + 4) / 0.02, 3.0);
}

TEST_F(ProposeLimits, KeepsGainsOfTheFileThatWork) {
  const JointProposal good =
      proposal(lever(kStops, R"(<position joint="lift" kp="80" kv="3"/>)")).joints[0];
  EXPECT_FALSE(good.replaces_gains);
  EXPECT_EQ(good.limit.default_kp, 80.0);
  EXPECT_EQ(good.limit.default_kd, 3.0);
  for (const std::string gains : {R"(kp="80")", R"(kp="1" kv="1")", R"(kp="1e5" kv="500")"}) {
    const JointProposal bad =
        proposal(lever(kStops, R"(<position joint="lift" )" + gains + "/>")).joints[0];
    EXPECT_TRUE(bad.replaces_gains) << gains;
    EXPECT_NEAR(bad.limit.default_kp, kWeight / 0.02, 2.0) << gains;
  }
}

TEST_F(ProposeLimits, SuggestsATorqueThatCarriesTheLinks) {
  const JointProposal joint = proposal(lever(kStops, R"(<motor joint="lift"/>)")).joints[0];
  EXPECT_TRUE(std::isnan(joint.limit.max_torque));
  EXPECT_GE(joint.suggested_torque, 3 * joint.load.largest_weight);
}

TEST_F(ProposeLimits, WarnsOfDampingThatIsTooStrongForTheStep) {
  SimulationOptions options;
  options.file = std::make_shared<const ModelFile>(model(lever(kStops, kMotor)));
  options.period = options.file->period();
  options.limits = std::vector<JointLimit>{{.safety_kd = 1, .default_kd = 30}};
  EXPECT_TRUE(detail::gain_warnings(options).empty());
  options.limits->front().default_kd = 50;
  EXPECT_THAT(detail::gain_warnings(options),
              ElementsAre(testing::Pair(
                  0, testing::AllOf(HasSubstr("joint 'lift' has an inertia of 0.041 kgm^2"),
                                    HasSubstr("safety_kd + default_kd = 51 Nms/rad"),
                                    HasSubstr("steps of 0.001 s"), HasSubstr("robot.armature")))));
}

}  // namespace
}  // namespace trifinger::test
