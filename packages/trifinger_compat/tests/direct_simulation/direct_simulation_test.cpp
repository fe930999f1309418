// SPDX-License-Identifier: BSD-3-Clause
#include "direct_simulation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "sim/robots.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::test {
namespace {

using bindings::DirectSimulation;

using testing::DoubleEq;
using testing::DoubleNear;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
using Direct = DirectSimulation<TriFinger>;
using Action = TriFinger::Action;

JointVector<9> all(double value) {
  JointVector<9> values{};
  values.fill(value);
  return values;
}

TEST(DirectSimulation, BeginsAtRestInTheInitialPoseOfEachVariant) {
  for (const SimulationOptions& options : all_variants<Finger>()) {
    const DirectSimulation<Finger> direct(options);
    EXPECT_THAT(direct.observation().velocity, Each(0.0)) << label(options);
    EXPECT_THAT(direct.observation().torque, Each(0.0)) << label(options);
    EXPECT_EQ(direct.configuration_position().front(), direct.observation().position[0]);
  }
}

TEST(DirectSimulation, AppliesGainsOfItsOwnerWhereTheActionHasNone) {
  Direct direct({});
  JointVector<9> position = all(0.1);
  direct.set_joints(position, all(0.5));
  Action action;
  action.torque = all(0.01);
  action.position = all(0.2);
  action.position_kp = all(kNaN);
  action.position_kp[0] = 2.0;
  action.position_kd = all(kNaN);
  Action applied;
  direct.apply_control(action, {.kp = all(1.0), .kd = all(0.1), .max_torque = 1.0}, applied);
  EXPECT_DOUBLE_EQ(applied.torque[0], 0.01 + 2.0 * 0.1 - 0.1 * 0.5);
  EXPECT_DOUBLE_EQ(applied.torque[1], 0.01 + 1.0 * 0.1 - 0.1 * 0.5);
  EXPECT_EQ(applied.position_kp[0], 2.0);
  EXPECT_EQ(applied.position_kp[1], 1.0);
}

TEST(DirectSimulation, ClipsBeforeAndAfterDamping) {
  Direct direct({});
  direct.set_joints(direct.observation().position, all(2.0));
  Action action;
  action.torque = all(1e9);
  action.position = all(kNaN);
  Action applied;
  direct.apply_control(action, {.damping = all(0.1), .max_torque = 0.3}, applied);
  EXPECT_THAT(applied.torque, Each(DoubleEq(0.3 - 0.1 * 2.0)));
  action.torque = all(-1e9);
  direct.apply_control(action, {.damping = all(0.1), .max_torque = 0.3}, applied);
  EXPECT_THAT(applied.torque, Each(-0.3));
}

TEST(DirectSimulation, MeasuresTheTorqueOfTheLastStep) {
  Direct direct({});
  EXPECT_TRUE(direct.step(all(0.05)));
  EXPECT_THAT(direct.observation().torque, Each(DoubleEq(0.05)));
}

TEST(DirectSimulation, SaysThatItHasDivergedAfterATorqueThatIsNotANumber) {
  Direct direct({});
  JointVector<9> torque{};
  torque[4] = kNaN;
  EXPECT_FALSE(direct.step(torque));
}

TEST(DirectSimulation, IsEqualBitForBitInEachRun) {
  Direct first({});
  Direct second({});
  for (int i = 0; i < 200; ++i) {
    const JointVector<9> torque = all(0.1 * std::sin(0.1 * i));
    ASSERT_TRUE(first.step(torque));
    ASSERT_TRUE(second.step(torque));
  }
  EXPECT_EQ(first.observation().position, second.observation().position);
  EXPECT_EQ(first.observation().velocity, second.observation().velocity);
}

TEST(DirectSimulation, PlacesMovesAndPushesObjects) {
  Direct direct({});
  direct.place_object("cube", {.position = {0, 0, 0.6}, .orientation = {0, 0, 0, 1}});
  EXPECT_THAT(direct.object_pose("cube").position, ElementsAre(0, 0, 0.6));
  EXPECT_THAT(direct.object_pose("cube").orientation, ElementsAre(0, 0, 0, 1));
  direct.set_object_velocity("cube", {.linear = {0.1, 0, 0}, .angular = {0, 0, 1}});
  EXPECT_THAT(direct.object_velocity("cube").linear, ElementsAre(0.1, 0, 0));
  EXPECT_THAT(direct.object_velocity("cube").angular, ElementsAre(0, 0, 1));
  const double weight = 0.094 * 9.81;
  direct.push_object("cube", {0, 0, weight / 2}, {0, 0, 0});
  direct.push_object("cube", {0, 0, weight / 2}, {0, 0, 0});
  ASSERT_TRUE(direct.step({}));
  EXPECT_NEAR(direct.object_velocity("cube").linear[2], 0.0, 1e-4);
  ASSERT_TRUE(direct.step({}));  // a push lasts for one step
  EXPECT_NEAR(direct.object_velocity("cube").linear[2], -9.81e-3, 2e-4);
}

TEST(DirectSimulation, MovesAHeavierObjectLess) {
  std::array<double, 2> speeds{};
  for (std::size_t i = 0; i < 2; ++i) {
    Direct direct({});
    direct.place_object("cube", {.position = {0, 0, 0.6}});
    direct.set_object_mass("cube", i == 0 ? 0.1 : 0.2);
    direct.push_object("cube", {1, 0, 0}, {0, 0, 0.001});
    ASSERT_TRUE(direct.step({}));
    speeds[i] = direct.object_velocity("cube").linear[0];
  }
  EXPECT_NEAR(speeds[0], 0.01, 1e-4);
  EXPECT_NEAR(speeds[1], 0.005, 1e-4);
}

TEST(DirectSimulation, ContinuesFromAnotherOneWithTheObjectsThatBothHave) {
  Direct first({});
  first.place_object("cube", {.position = {0.02, 0, 0.3}});
  first.set_object_mass("cube", 0.5);
  ASSERT_TRUE(first.step(all(0.1)));
  SimulationOptions options;
  options.description.objects.push_back(ball());
  options.description.objects.back().position = {{0, 0, 0.7}};
  Direct second(options);
  second.continue_from(first);
  EXPECT_EQ(second.observation().position, first.observation().position);
  EXPECT_EQ(second.observation().velocity, first.observation().velocity);
  EXPECT_EQ(second.observation().torque, first.observation().torque);
  EXPECT_EQ(second.object_pose("cube").position, first.object_pose("cube").position);
  EXPECT_THAT(second.object_pose("ball").position, ElementsAre(0, 0, DoubleNear(0.7, 1e-12)));
}

Direct::Physics stops_at(const JointVector<9>& lower, const JointVector<9>& upper) {
  return {.stop_lower = lower, .stop_upper = upper};
}

// Stops that hold the fingers where they are.
Direct::Physics locked(const Direct& direct) {
  JointVector<9> lower = direct.observation().position;
  JointVector<9> upper = lower;
  for (double& angle : lower) angle -= 1e-3;
  for (double& angle : upper) angle += 1e-3;
  return stops_at(lower, upper);
}

constexpr double kDieMass = 0.05;  // [kg]

// A cube of 20 mm.
SimulationOptions with_die() {
  SimulationOptions options;
  ObjectDescription& die = options.description.objects.front();
  die.size = {0.02, 0.02, 0.02};
  die.mass = kDieMass;
  return options;
}

TEST(DirectSimulation, StopsJointsWhereAnotherSimulatorDoes) {
  for (const double torque : {0.3, -0.3}) {
    Direct direct({});
    JointVector<9> lower = direct.observation().position;
    JointVector<9> upper = lower;
    for (double& angle : lower) angle -= 0.1;
    for (double& angle : upper) angle += 0.2;
    direct.use_physics(stops_at(lower, upper));
    for (int i = 0; i < 1000; ++i) ASSERT_TRUE(direct.step(all(torque)));
    const JointVector<9>& stops = torque > 0.0 ? upper : lower;
    for (std::size_t i = 0; i < 9; ++i) {
      EXPECT_NEAR(direct.observation().position[i], stops[i], 0.03) << "joint " << i;
    }
  }
}

TEST(DirectSimulation, LetsBodiesTouchFromTheirMarginsAway) {
  constexpr double kMargin = 0.001;
  Direct direct({});
  direct.set_object_margin("cube", kMargin);
  direct.use_physics(locked(direct));
  direct.place_object("cube", {.position = {0, 0, 0.04}});
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(direct.step({}));
  EXPECT_NEAR(direct.object_pose("cube").position[2], 0.0325 + kMargin, 1.5e-4);

  // Below the tip of finger 0, a gap below the two margins is a contact, and a wider one is none.
  const SimulationOptions options = with_die();
  const double radius = figures(options.description).tip_radius;
  const Eigen::Vector3d tip = Kinematics(options.description).tip_positions().head<3>();
  for (const double gap : {2 * kMargin - 1e-4, 2 * kMargin + 1e-4}) {
    Direct above(options);
    Direct::Physics physics = locked(above);
    physics.margin = kMargin;
    above.use_physics(physics);
    above.set_object_margin("cube", kMargin);
    above.place_object("cube", {.position = {tip[0], tip[1], tip[2] - radius - gap - 0.01}});
    ASSERT_TRUE(above.step({}));
    EXPECT_EQ(above.observation().tip_force[0] > 0.0, gap < 2 * kMargin) << gap;
  }
}

// A body slides if what pulls it is more than friction times what presses it.
TEST(DirectSimulation, RubsAtLinksAndBoundaryAsAnotherSimulatorDoes) {
  constexpr double kWeight = kDieMass * 9.81;
  for (const double friction : {0.1, 0.4}) {
    Direct direct(with_die());
    Direct::Physics physics = locked(direct);
    physics.link_friction = physics.boundary_friction = friction;
    direct.use_physics(physics);
    const auto speed_after = [&](const std::array<double, 3>& force, std::size_t axis) {
      for (int i = 0; i < 50; ++i) {
        direct.push_object("cube", force, {});
        EXPECT_TRUE(direct.step({}));
      }
      return std::abs(direct.object_velocity("cube").linear[axis]);
    };
    // On the upper link of finger 0, which is 37 mm thick and points away from the middle.
    direct.place_object("cube", {.position = {0, 0.11, 0.283 + 0.0185 + 0.01}});
    EXPECT_EQ(speed_after({0, 0.2 * kWeight, 0}, 1) > 0.02, friction < 0.2);
    // At the wall, which has a radius of 242 mm.
    direct.place_object("cube", {.position = {0.242 - 0.01, 0, 0.15}});
    EXPECT_EQ(speed_after({5 * kWeight, 0, 0}, 2) > 0.02, friction < 0.2);
  }
}

TEST(DirectSimulation, RefusesPhysicsThatCannotBe) {
  Direct direct({});
  const auto refuses = [&](auto change, const std::string& text) {
    Direct::Physics physics = stops_at(all(-1.0), all(1.0));
    change(physics);
    EXPECT_THAT([&] { direct.use_physics(physics); },
                ThrowsMessage<InvalidArgument>(HasSubstr(text)));
  };
  refuses([](auto& physics) { physics.stop_lower[3] = 1.0; }, "stops of joint 3 are 1 and 1 rad");
  refuses([](auto& physics) { physics.stop_upper[8] = kNaN; }, "stops of joint 8");
  refuses([](auto& physics) { physics.margin = kNaN; }, "margin is nan m, must be 0 to 0.01");
  refuses([](auto& physics) { physics.link_friction = 0.0; }, "link_friction is 0, must be 0.001");
  refuses([](auto& physics) { physics.boundary_friction = kNaN; }, "boundary_friction is nan");
  EXPECT_THAT([&] { direct.set_object_margin("cube", 0.02); },
              ThrowsMessage<InvalidArgument>(HasSubstr("margin is 0.02 m")));
  EXPECT_THAT([&] { direct.set_object_margin("dog", 0.001); },
              ThrowsMessage<InvalidArgument>(HasSubstr("cube")));
}

TEST(DirectSimulation, RefusesWhatItsObjectsCannotBe) {
  Direct direct({});
  const auto refuses = [](auto work, const std::string& text) {
    EXPECT_THAT(work, ThrowsMessage<InvalidArgument>(HasSubstr(text)));
  };
  refuses([&] { direct.place_object("dog", {}); }, "cube");
  refuses([&] { static_cast<void>(direct.object_pose("dog")); }, "cube");
  refuses([&] { direct.place_object("cube", {.orientation = {0, 0, 0, 0}}); }, "quaternion");
  refuses([&] { direct.place_object("cube", {.position = {0, kNaN, 0}}); }, "finite");
  refuses([&] { direct.set_object_mass("cube", 0.0); }, "above 0");
  refuses([&] { direct.push_object("cube", {kNaN, 0, 0}, {}); }, "force");
  refuses([&] { direct.set_object_velocity("cube", {.linear = {kNaN, 0, 0}}); }, "linear");
  refuses([&] { direct.set_joints(all(kNaN), {}); }, "position");
}

}  // namespace
}  // namespace trifinger::test
