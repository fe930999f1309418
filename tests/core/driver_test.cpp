// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/driver.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "core/fault_of.hpp"
#include "core/steps.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/fake_robot.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger {
namespace {

// The paper's two functions, no more.
class TwoFunctions {
 public:
  explicit TwoFunctions(int fails_after = 1'000'000) : fails_after_(fails_after) {}

  FakeObservation get_latest_observation() {
    return {.setpoint = last_, .applied_actions = count_};
  }
  FakeAction apply_action(const FakeAction& desired) {
    if (count_ == fails_after_) throw std::runtime_error("out of order");
    ++count_;
    last_ = desired.setpoint;
    return desired;
  }

 private:
  int fails_after_;
  std::int64_t count_{0};
  double last_{0.0};
};
static_assert(SimpleDriverOf<TwoFunctions, FakeRobot>);

TEST(SimpleDriver, MakesARobotOfThePapersTwoFunctions) {
  SimpleDriver<FakeRobot, TwoFunctions> driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<FakeRobot> robot(backend);
  for (TimeIndex t = 0; t < 5; ++t) {
    robot.append_desired_action({.setpoint = 10.0 * static_cast<double>(t)});
  }
  EXPECT_EQ(robot.get_observation(5).applied_actions, 5);
  EXPECT_EQ(robot.get_observation(5).setpoint, 40.0);
  EXPECT_EQ(robot.get_applied_action(4).setpoint, 40.0);
}

TEST(SimpleDriver, fault_16_TurnsAnExceptionIntoAFault) {
  SimpleDriver<FakeRobot, TwoFunctions> driver(3);
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<FakeRobot> robot(backend);
  for (TimeIndex t = 0; t < 4; ++t) robot.append_desired_action({});
  test::expect_end(robot, 3, {.code = Fault::Code::kDriver, .detail = 1});
}

// The fake robot's own injections, for the tests of users.
TEST(FakeDriver, FaultsAndRejectsWhereItIsTold) {
  const auto end_with = [](const FakeDriver::Options& options) {
    FakeDriver driver(options);
    SessionHost host = SessionHost::anonymous();
    Backend backend(driver, host, {.max_rejected_actions = 1});
    Frontend<FakeRobot> robot(backend);
    for (TimeIndex t = 0; t < 10; ++t) {
      robot.append_desired_action({.setpoint = t < 5 ? 0.0 : 1.0});
    }
    return test::fault_of([&] { return robot.get_status(100); }).value_or(Fault{});
  };
  EXPECT_EQ(
      end_with({.observation_fault_after = 4}),
      (Fault{.code = Fault::Code::kDriver, .detail = FakeDriver::kInjectedFault, .time_index = 4}));
  EXPECT_EQ(
      end_with({.action_fault_after = 6}),
      (Fault{.code = Fault::Code::kDriver, .detail = FakeDriver::kInjectedFault, .time_index = 6}));
  EXPECT_EQ(end_with({.rejected_setpoint = 1.0}),
            (Fault{.code = Fault::Code::kActionsRejected, .detail = 2, .time_index = 7}));
}

TEST(FakeDriver, HasASensorWithARateAndADelay) {
  FakeDriver driver({.sensor_period = 4, .sensor_delay = 2});
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<FakeRobot> robot(backend);
  const Companion<FakeSensorReading> sensor(robot.companion("sensor"));
  for (TimeIndex t = 0; t < 20; ++t) robot.append_desired_action({});
  EXPECT_FALSE(sensor.get_latest_at(1).has_value());
  for (TimeIndex t = 2; t < 20; ++t) {
    const auto reading = sensor.get_latest_at(t);
    ASSERT_TRUE(reading.has_value());
    const TimeIndex captured = (t - 2) / 4 * 4;
    EXPECT_EQ(reading->stamp.capture_index, captured);
    EXPECT_EQ(reading->stamp.arrival_index, captured + 2);
    EXPECT_EQ(reading->applied_actions, captured);
  }
}

}  // namespace
}  // namespace trifinger
