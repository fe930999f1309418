// SPDX-License-Identifier: BSD-3-Clause
#include "model/joint_loads.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "model/file_robots.hpp"
#include "support/folder.hpp"
#include "trifinger/model/model_file.hpp"

namespace trifinger::test {
namespace {

using detail::JointLoads;

class JointLoadsTest : public testing::Test {
 protected:
  [[nodiscard]] ModelFile model(const std::string& text) const {
    write(folder_ / "robot.xml", text);
    return ModelFile({.path = folder_ / "robot.xml"});
  }

  Folder folder_;
};

// Two pendulums of 2 kg at 0.5 m, with 0.01 kgm^2 about their centres.
std::string pendulums(const std::string& more) {
  const std::string link = R"(<inertial pos="0 0 -0.5" mass="2" diaginertia="0.01 0.01 0.01"/>)";
  return R"(<mujoco><compiler angle="radian"/><worldbody>
    <body><joint name="a" axis="0 1 0"/>)" +
         link + R"(</body><body pos="1 0 0"><joint name="b" axis="0 1 0"/>)" + link +
         "</body></worldbody>" + more + "</mujoco>";
}

constexpr double kInertia = 2 * 0.5 * 0.5 + 0.01;
constexpr double kWeight = 2 * 9.81 * 0.5;

TEST_F(JointLoadsTest, SayWhatAMotorFeels) {
  const ModelFile file = model(pendulums(""));
  JointLoads loads(file);
  const double everywhere = std::numbers::pi;
  const auto hanging = loads.loads({{-everywhere, everywhere}, {0.0, 0.0}});
  EXPECT_NEAR(hanging[0].inertia, kInertia, 1e-9);
  EXPECT_NEAR(hanging[0].weight, 0.0, 1e-9);
  EXPECT_NEAR(hanging[0].largest_weight, kWeight, 0.05 * kWeight);
  EXPECT_NEAR(hanging[1].largest_weight, 0.0, 1e-9);
  EXPECT_TRUE(loads.begin_at(0, std::numbers::pi / 2).empty());
  EXPECT_NEAR(loads.loads({{0.0, 0.0}, {0.0, 0.0}})[0].weight, kWeight, 1e-9);
  EXPECT_NEAR(loads.start(0), std::numbers::pi / 2, 1e-12);  // The poses that were tried are gone.
}

TEST_F(JointLoadsTest, GiveAMotorARotor) {
  const ModelFile file = model(pendulums(""));
  JointLoads loads(file);
  const auto rotors = loads.add_rotor(1, 0.3);
  ASSERT_EQ(rotors.size(), 1U);
  EXPECT_EQ(rotors[0].first, "b");
  EXPECT_NEAR(rotors[0].second, 0.3, 1e-12);
  EXPECT_NEAR(loads.inertias()[1], kInertia + 0.3, 1e-9);
  EXPECT_NEAR(loads.inertias()[0], kInertia, 1e-9);
}

TEST_F(JointLoadsTest, KnowMotorsOfTendons) {
  const ModelFile file = model(pendulums(
      R"(<tendon><fixed name="t"><joint joint="a" coef="0.5"/><joint joint="b" coef="0.5"/></fixed></tendon>
         <actuator><motor tendon="t"/></actuator>)"));
  JointLoads loads(file);
  // The length changes by the mean of both angles.
  EXPECT_NEAR(loads.inertias()[0], 2 * kInertia, 1e-9);
  const auto rotors = loads.add_rotor(0, 0.3);
  ASSERT_EQ(rotors.size(), 2U);
  EXPECT_NEAR(rotors[0].second, 0.15, 1e-9);
  EXPECT_NEAR(loads.inertias()[0], 2 * kInertia + 0.3, 1e-9);
}

TEST_F(JointLoadsTest, KnowWhatResistsTheMotion) {
  const ModelFile file = model(
      R"(<mujoco><default><joint damping="2" frictionloss="0.3"/><geom size="0.1"/></default><worldbody>
         <body><joint name="a"/><geom/></body><body><joint name="b"/><geom/></body>
         <body><joint name="c"/><geom/></body></worldbody>
         <tendon><fixed name="t"><joint joint="a" coef="0.5"/><joint joint="b" coef="0.5"/></fixed></tendon>
         <actuator><motor tendon="t"/><motor joint="c"/></actuator></mujoco>)");
  const auto loads = JointLoads(file).loads({{0, 0}, {0, 0}});
  EXPECT_NEAR(loads[1].damping, 2.0, 1e-9);
  EXPECT_NEAR(loads[1].friction, 0.3, 1e-9);
  // Both joints turn by 1 rad if the tendon moves by 1.
  EXPECT_NEAR(loads[0].damping, 4.0, 1e-9);
  EXPECT_NEAR(loads[0].friction, 0.6, 1e-9);
}

TEST_F(JointLoadsTest, CountTheRotorsOfActuators) {
  const ModelFile file = model(pendulums(
      R"(<actuator><motor joint="a" gear="2" armature="0.01"/><motor joint="b"/></actuator>)"));
  JointLoads loads(file);
  const double before = loads.inertias()[0];
  const auto rotors = loads.add_rotor(0, 0.3);
  ASSERT_EQ(rotors.size(), 1U);
  // A configuration that says this has the same inertia: it stands for both.
  ModelFileOptions options{.path = folder_ / "robot.xml"};
  options.armature = [&](const std::string& joint) {
    return joint == "a" ? std::optional(rotors[0].second) : std::nullopt;
  };
  const ModelFile with_rotor(options);
  EXPECT_NEAR(JointLoads(with_rotor).inertias()[0], before + 0.3, 1e-9);
}

TEST_F(JointLoadsTest, MoveWhatFollows) {
  const ModelFile file = model(
      pendulums(R"(<equality><joint joint1="b" joint2="a" polycoef="0.1 2 0 0 0"/></equality>)"));
  JointLoads loads(file);
  const auto followers = loads.begin_at(0, 0.2);
  ASSERT_EQ(followers.size(), 1U);
  EXPECT_EQ(followers[0].first, "b");
  EXPECT_NEAR(followers[0].second, 0.5, 1e-12);
}

}  // namespace
}  // namespace trifinger::test
