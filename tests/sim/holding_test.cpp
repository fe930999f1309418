// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/transports.hpp"
#include "sim/robots.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

template <class R>
double largest_difference(const typename R::Observation& a, const typename R::Observation& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    largest = std::max(largest, std::abs(a.position[i] - b.position[i]));
  }
  return largest;
}

template <class R>
class Holding : public testing::Test {};
using Robots = testing::Types<TriFinger, Finger>;
TYPED_TEST_SUITE(Holding, Robots);

TYPED_TEST(Holding, KeepsThePoseInRealTimeMode) {
  using R = TypeParam;
  for (const SimulationOptions& options : all_variants<R>()) {
    ManualClock clock;
    SimulatedRobot driver(options);
    SessionHost host = SessionHost::anonymous();
    Backend backend(driver, host, {.mode = BackendOptions::Mode::kRealTime}, clock);
    const BackendThread thread(backend);
    clock.wait_for_sleeper();
    const Frontend<R> robot(host, {.control = false});
    const auto begin = robot.latest_observation();
    clock.tick(std::chrono::milliseconds(1), 2000);
    const auto end = robot.latest_observation();
    clock.run_free();

    EXPECT_NE(end.torque, begin.torque) << label(options) << ": it does not hold";
    EXPECT_LT(largest_difference<R>(begin, end), 1e-3) << label(options);
    for (const double velocity : end.velocity) EXPECT_LT(std::abs(velocity), 1e-2);
  }
}

TYPED_TEST(Holding, TimeStandsStillWithoutDeadlines) {
  using R = TypeParam;
  SimulatedRobot driver(options_of<R>());
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<R> robot(backend);
  const auto begin = robot.latest_observation();
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(backend.advance(), Progress::kWaiting);
  const SimulationState before = driver.save();
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(backend.advance(), Progress::kWaiting);
  EXPECT_EQ(driver.save(), before);

  const TimeIndex t = robot.append_desired_action(hold_position(begin));
  EXPECT_EQ(robot.get_observation(t).position, begin.position);
}

TYPED_TEST(Holding, TimeStandsStillWhileAnActionIsMissing) {
  using R = TypeParam;
  SimulatedRobot driver(options_of<R>());
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<R> robot(backend);
  for (int i = 0; i < 100; ++i) (void)robot.append_desired_action({});
  (void)robot.get_observation(100);
  const SimulationState before = driver.save();
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(backend.advance(), Progress::kWaiting);
  EXPECT_EQ(driver.save(), before);
}

}  // namespace
}  // namespace trifinger::test
