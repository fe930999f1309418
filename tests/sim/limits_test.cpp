// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "sim/bare_driver.hpp"
#include "sim/robots.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

using testing::HasSubstr;

// --- Limits one by one

template <class R>
class Limits : public testing::Test {};
using Robots = testing::Types<TriFinger, Finger>;
TYPED_TEST_SUITE(Limits, Robots);

TYPED_TEST(Limits, fault_11_SoftLimitsKeepTheJointOffTheHardOnes) {
  using R = TypeParam;
  for (const Variant variant : kVariants) {
    SimulationOptions options = options_of<R>(variant);
    options.description.objects.clear();
    const std::vector<JointLimit> limits = default_limits(options.description);
    for (const double sign : {-1.0, 1.0}) {
      BareDriver<R> driver(options);
      typename R::Action action;
      // Pushes with full force, but with the default gains: users cannot override the push back.
      for (double& torque : action.torque) torque = sign * 1e3;
      const DriverReport report = driver.fault_after(action, 2000);
      EXPECT_EQ(report.state, DriverReport::State::kReady) << label(options) << ' ' << sign;
      for (std::size_t i = 0; i < R::kJoints; ++i) {
        EXPECT_GT(driver.observation.position[i], limits[i].hard_lower) << label(options);
        EXPECT_LT(driver.observation.position[i], limits[i].hard_upper) << label(options);
      }
    }
  }
}

// Soft limits so far out that a joint can run into a hard one.
template <class R>
SimulationOptions without_soft_limits(Variant variant) {
  SimulationOptions options = options_of<R>(variant);
  options.limits = default_limits(options.description);
  for (JointLimit& limit : *options.limits) {
    limit.soft_lower = limit.hard_lower;
    limit.soft_upper = limit.hard_upper;
    limit.safety_kd = 0.0;
    limit.braking = std::numeric_limits<double>::infinity();
  }
  return options;
}

TYPED_TEST(Limits, fault_12_AHardLimitIsAFault) {
  using R = TypeParam;
  for (const Variant variant : kVariants) {
    const Simulation simulation(without_soft_limits<R>(variant));
    Frontend<R> robot = simulation.connect<R>();
    typename R::Action action = hold_position(robot.latest_observation());
    action.position[0] = kNotGiven;
    action.torque[0] = -1e3;
    try {
      for (int i = 0; i < 5000; ++i) {
        (void)robot.get_observation(robot.append_desired_action(action));
      }
      FAIL() << "no fault with variant " << static_cast<int>(variant);
    } catch (const RobotStopped& stopped) {
      EXPECT_EQ(stopped.fault().code, Fault::Code::kDriver);
      EXPECT_EQ(stopped.fault().detail,
                fault_code_of({.fault = SafetyFault::kHardLimit, .joint = 0}));
      EXPECT_THAT(stopped.what(),
                  HasSubstr("joint 0 (" + simulation.robot().model().joints()[0].name +
                            ") is beyond its hard limit"));
      const auto last = robot.get_observation(stopped.fault().time_index);
      EXPECT_LT(last.position[0], figures(simulation.robot().options().description).hard_lower[0]);
    }
  }
}

// --- Divergence

// Returns a saved state with one enormous speed of the cube.
SimulationState tampered(SimulatedRobot& robot, double speed) {
  const ObjectPose pose{.position = {0.05, 0.04, 0.0625}};
  robot.place_object("cube", pose);
  SimulationState state = robot.save();
  // The pose is found by its bytes. The speeds come after all positions.
  const auto* const bytes = reinterpret_cast<const std::byte*>(pose.position.data());
  const auto place = std::search(state.begin(), state.end(), bytes, bytes + sizeof(pose.position));
  EXPECT_NE(place, state.end());
  constexpr std::ptrdiff_t kNumbersOfPose = 7;
  constexpr std::ptrdiff_t kJoints = 9;
  std::memcpy(&*(place + (kNumbersOfPose + kJoints) * 8), &speed, sizeof(speed));
  return state;
}

TEST(Divergence, fault_61_IsAFaultWithTheStateBefore) {
  const Simulation simulation;
  SimulatedRobot& driver = simulation.robot();
  EXPECT_TRUE(driver.state_before_divergence().empty());
  driver.restore(tampered(driver, 1e300));

  Frontend<TriFinger> robot = simulation.connect();
  try {
    (void)robot.get_observation(robot.append_desired_actions(std::vector<JointAction<9>>(100)));
    FAIL() << "it did not diverge";
  } catch (const RobotStopped& stopped) {
    EXPECT_EQ(stopped.fault().code, Fault::Code::kDriver);
    EXPECT_EQ(stopped.fault().detail, SimulatedRobot::kDiverged);
    EXPECT_THAT(stopped.what(), HasSubstr("the simulation diverged"));
  }
  EXPECT_FALSE(driver.state_before_divergence().empty());
}

TEST(Divergence, HappensAgainFromTheStateBefore) {
  // With this speed, it takes a few steps until numbers are no longer finite.
  BareDriver<TriFinger> driver({});
  driver.robot.restore(tampered(driver.robot, 3e9));
  const DriverReport first = driver.fault_after({}, 1000);
  ASSERT_EQ(first.fault_code, SimulatedRobot::kDiverged);

  BareDriver<TriFinger> other({});
  other.robot.restore(driver.robot.state_before_divergence());
  const SimulationState before = other.robot.save();
  EXPECT_EQ(other.step({}).fault_code, SimulatedRobot::kDiverged);
  EXPECT_TRUE(other.robot.state_before_divergence() == before);
}

TEST(Divergence, TakesNoMemory) {
  BareDriver<TriFinger> driver({});
  driver.robot.restore(tampered(driver.robot, 1e300));
  const AllocationCounter allocations;
  ASSERT_EQ(driver.fault_after({}, 1000).fault_code, SimulatedRobot::kDiverged);
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(Divergence, IsOverAfterAReset) {
  BareDriver<TriFinger> driver({});
  driver.robot.restore(tampered(driver.robot, 1e300));
  ASSERT_EQ(driver.fault_after({}, 1000).fault_code, SimulatedRobot::kDiverged);
  driver.robot.reset();
  EXPECT_EQ(driver.fault_after({}, 100).state, DriverReport::State::kReady);
}

TEST(Divergence, fault_61_DoesNotStopTheNextSession) {
  const Simulation simulation;
  simulation.robot().restore(tampered(simulation.robot(), 1e300));
  {
    Frontend<TriFinger> robot = simulation.connect();
    EXPECT_THROW((void)robot.get_observation(robot.append_desired_action({}) + 1), RobotStopped);
    robot.recover();
  }
  simulation.robot().reset();
  Frontend<TriFinger> robot = simulation.connect();
  EXPECT_NO_THROW((void)robot.get_observation(robot.append_desired_action({})));
}

TEST(Divergence, DoesNotComeFromAnObjectInsideTheTable) {
  BareDriver<TriFinger> driver({});
  driver.robot.place_object("cube", {.position = {0.0, 0.0, 0.0}});
  EXPECT_EQ(driver.fault_after({}, 1000).state, DriverReport::State::kReady);
}

}  // namespace
}  // namespace trifinger::test
