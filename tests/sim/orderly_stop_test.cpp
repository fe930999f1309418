// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <random>

#include "sim/robots.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::test {
namespace {

using std::chrono::milliseconds;

// Returns every variant with a rest position, on an empty table.
template <class R>
std::vector<SimulationOptions> all_with_rest_position() {
  std::vector<SimulationOptions> all = all_variants<R>();
  for (SimulationOptions& options : all) {
    options.description.objects.clear();
    options.limits = default_limits(options.description);
    options.stop.damping_time = milliseconds(100);
    options.stop.rest_position.emplace();
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      options.stop.rest_position->push_back(
          figures(options.description).initial_position[i % kJointsPerFinger]);
    }
    options.stop.move_time =
        std::chrono::ceil<milliseconds>(options.stop.shortest_move_time(*options.limits));
  }
  return all;
}

template <class R>
class SimulatedStop : public ::testing::Test {};
using Robots = ::testing::Types<TriFinger, Finger>;
TYPED_TEST_SUITE(SimulatedStop, Robots);

TYPED_TEST(SimulatedStop, EndsAtTheRestPositionAndNeverLeavesTheLimits) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> torque(-0.2, 0.2);
  for (const auto& options : all_with_rest_position<TypeParam>()) {
    SCOPED_TRACE(label(options));
    SimulatedRobot robot(options);
    ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
    typename TypeParam::Observation observation;
    typename TypeParam::Action holding;
    typename TypeParam::AppliedAction applied;
    static_cast<void>(robot.get_latest_observation(&observation));
    EXPECT_EQ(robot.hold(&observation, &holding).state, DriverReport::State::kReady);
    // The stop begins in the middle of a motion.
    typename TypeParam::Action action = holding;
    for (int step = 0; step < 200; ++step) {
      for (std::size_t i = 0; i < TypeParam::kJoints && step % 20 == 0; ++i) {
        action.torque[i] = holding.torque[i] + torque(random);
      }
      ASSERT_EQ(robot.apply_action(&action, &applied).state, DriverReport::State::kReady);
      static_cast<void>(robot.get_latest_observation(&observation));
    }
    const TimeIndex most = (options.stop.damping_time + options.stop.move_time) / options.period;
    TimeIndex step = 0;
    while (robot.stop(step).state == DriverReport::State::kBusy) {
      ++step;
      ASSERT_LE(step, most);
      static_cast<void>(robot.get_latest_observation(&observation));
      for (std::size_t i = 0; i < TypeParam::kJoints; ++i) {
        ASSERT_GE(observation.position[i], (*options.limits)[i].hard_lower) << step;
        ASSERT_LE(observation.position[i], (*options.limits)[i].hard_upper) << step;
        ASSERT_LE(std::abs(observation.torque[i]), (*options.limits)[i].max_torque) << step;
      }
    }
    EXPECT_EQ(step, most);
    for (std::size_t i = 0; i < TypeParam::kJoints; ++i) {
      EXPECT_NEAR(observation.position[i], (*options.stop.rest_position)[i], 0.05) << i;
      EXPECT_NEAR(observation.velocity[i], 0.0, 0.05) << i;
    }
  }
}

TYPED_TEST(SimulatedStop, IsMeasuredButNoPartOfTheSession) {
  const auto options = all_with_rest_position<TypeParam>().front();
  SimulatedRobot driver(options);
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<TypeParam> robot(backend);
  for (TimeIndex t = 0; t < 10; ++t) robot.append_desired_action({});
  robot.wait_until_time_index(9);
  robot.finish();
  while (backend.advance() != Progress::kEnded) {
  }
  EXPECT_EQ(robot.session().info().steps, 10);
  EXPECT_TRUE(robot.session().info().is_at_rest);
  // The next session begins where the owner has put the robot, not where the stop has left it.
  backend.begin_session();
  EXPECT_THAT(Frontend<TypeParam>(backend).latest_observation().position,
              ::testing::ElementsAreArray(driver.initial_position()));
}

TYPED_TEST(SimulatedStop, GoesNowhereAfterAFaultOfTheSafetyChain) {
  const auto options = all_with_rest_position<TypeParam>().front();
  SimulatedRobot robot(options);
  bool is_broken = true;
  robot.add_check<TypeParam>([&is_broken](const auto&, auto&) {
    if (is_broken) throw InvalidArgument("broken");
  });
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  typename TypeParam::Observation observation;
  typename TypeParam::AppliedAction applied;
  static_cast<void>(robot.get_latest_observation(&observation));
  const typename TypeParam::Action nothing;
  ASSERT_EQ(robot.apply_action(&nothing, &applied).state, DriverReport::State::kFault);
  // The cause of the fault does not show again.
  is_broken = false;
  TimeIndex step = 0;
  while (robot.stop(step).state == DriverReport::State::kBusy) ++step;
  EXPECT_EQ(step, options.stop.damping_time / options.period);
}

TYPED_TEST(SimulatedStop, IsOverAtOnceIfNoneIsConfigured) {
  SimulatedRobot robot(options_of<TypeParam>());
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  const SimulationState before = robot.save();
  EXPECT_EQ(robot.stop(0).state, DriverReport::State::kReady);
  EXPECT_EQ(robot.save(), before);
}

}  // namespace
}  // namespace trifinger::test
