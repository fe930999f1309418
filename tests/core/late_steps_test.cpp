// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <concepts>
#include <cstdint>
#include <string>

#include "core/drivers_of_tests.hpp"
#include "core/fault_of.hpp"
#include "core/named_robot.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/message_of.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/timing.hpp"

// Who is to blame for a late step, what is recorded of it, and when it ends a session.

namespace trifinger::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Traits = FakeDriverTraits;

template <class Transport>
class LateSteps : public ::testing::Test {
 protected:
  using Rig = typename Transport::template Rig<Traits>;
};
TYPED_TEST_SUITE(LateSteps, TransportsWithDeadlines, TransportName);

// Lets the tick that is due begin `lateness` after its deadline.
template <class Rig>
void tick_late(Rig& rig, Nanoseconds lateness) {
  rig.clock().wait_for_sleeper();
  rig.clock().advance(kPeriod + lateness);
  rig.clock().wait_for_sleeper();
}
// Makes up for the lateness: the next period is shorter by it.
template <class Rig>
void catch_up(Rig& rig, Nanoseconds lateness) {
  rig.clock().wait_for_sleeper();
  rig.clock().advance(kPeriod - lateness);
  rig.clock().wait_for_sleeper();
}

TYPED_TEST(LateSteps, OfABackendThatWokeLateAreTheSchedulers) {
  typename TestFixture::Rig rig(with_deadlines());
  auto robot = rig.connect();
  rig.tick();
  append_ahead<Traits>(robot, 0, 19);
  rig.tick(3);
  tick_late(rig, kPeriod * 6 / 10);  // step 3
  catch_up(rig, kPeriod * 6 / 10);
  tick_late(rig, kPeriod * 4 / 10);  // step 5: less than half a period
  catch_up(rig, kPeriod * 4 / 10);
  tick_late(rig, kPeriod * 21 / 10);  // step 7, after two skipped steps
  for (TimeIndex t = 0; t <= 7; ++t) {
    EXPECT_EQ(has_flag(robot, t, Status::kSchedulerLate), t == 3 || t == 7) << t;
    EXPECT_FALSE(has_flag(robot, t, Status::kDriverLate)) << t;
  }
  const auto timing = robot.timing();
  ASSERT_TRUE(timing.has_value());
  EXPECT_EQ(timing->steps(), 8U);
  EXPECT_EQ(timing->late_steps(), 2U);
  EXPECT_EQ(timing->late_steps(LateCause::kScheduler), 2U);
  EXPECT_DOUBLE_EQ(timing->success_rate(), 6.0 / 8.0);
  ASSERT_EQ(timing->worst().size(), 2U);
  EXPECT_EQ(timing->worst()[0].time_index, 7);
  EXPECT_EQ(timing->worst()[0].lateness, kPeriod * 21 / 10);
  EXPECT_EQ(timing->worst()[1].time_index, 3);
}

TYPED_TEST(LateSteps, BeginWhereTheOptionsSay) {
  Plan plan = with_deadlines();
  plan.backend.late_after = kPeriod / 10;
  typename TestFixture::Rig rig(plan);
  auto robot = rig.connect();
  rig.tick();
  append_ahead<Traits>(robot, 0, 19);
  rig.tick(2);
  tick_late(rig, kPeriod / 10);
  catch_up(rig, kPeriod / 10);
  tick_late(rig, kPeriod / 10 + Nanoseconds(1));
  for (TimeIndex t = 0; t <= 4; ++t) {
    EXPECT_EQ(has_flag(robot, t, Status::kSchedulerLate), t == 4) << t;
  }
}

// A robot in its first steps. Its driver needs a long time for one of them.
class SlowDriver : public ::testing::Test {
 protected:
  SlowDriver() {
    rig_.tick();
    append_ahead<Traits>(robot_, 0, 19);
  }
  ~SlowDriver() override { slow_clock = nullptr; }

  // Runs four ticks. In the last one the measurement takes `time`.
  void tick_with_slow_measurement(Nanoseconds time) {
    measurements = 0;
    slow_time = time;
    slow_clock = &rig_.clock();
    rig_.tick(4);
  }

 private:
  static Plan plan() {
    Plan plan = with_deadlines();
    plan.injection.on_observation = [] {
      if (slow_clock != nullptr && ++measurements == 4) slow_clock->advance(slow_time);
    };
    return plan;
  }

  // The loop's thread reads them while it has the clock's time.
  static inline ManualClock* slow_clock{nullptr};
  static inline Nanoseconds slow_time{0};
  static inline int measurements{0};

 protected:
  InProcess::Rig<Traits> rig_{plan()};
  Frontend<FakeRobot> robot_{rig_.connect()};
};

TEST_F(SlowDriver, IsToBlameForTheStepAfterATickThatItTookUp) {
  tick_with_slow_measurement(kPeriod * 17 / 10);
  catch_up(rig_, kPeriod * 7 / 10);
  rig_.tick(2);
  for (TimeIndex t = 0; t <= 7; ++t) {
    EXPECT_EQ(has_flag(robot_, t, Status::kDriverLate), t == 4) << t;
    EXPECT_FALSE(has_flag(robot_, t, Status::kSchedulerLate)) << t;
  }
  const auto timing = robot_.timing();
  ASSERT_TRUE(timing.has_value());
  EXPECT_EQ(timing->late_steps(LateCause::kDriver), 1U);
  EXPECT_EQ(timing->worst().front().lateness, kPeriod * 7 / 10);
}

TEST_F(SlowDriver, IsNotToBlameForTheStepAfterATickThatItLeftInTime) {
  tick_with_slow_measurement(kPeriod * 3 / 10);
  catch_up(rig_, kPeriod * 3 / 10 - kPeriod * 6 / 10);
  EXPECT_TRUE(has_flag(robot_, 4, Status::kSchedulerLate));
  EXPECT_FALSE(has_flag(robot_, 4, Status::kDriverLate));
}

TYPED_TEST(LateSteps, WithoutAnActionAreTheUsers) {
  typename TestFixture::Rig rig(with_deadlines(2));
  auto robot = rig.connect();
  rig.tick();
  append_ahead<Traits>(robot, 0, 4);
  rig.tick(7);
  rig.last_tick();
  expect_end(robot, 7, {.code = Fault::Code::kActionLate, .detail = 2});
  const auto timing = robot.timing();
  ASSERT_TRUE(timing.has_value());
  EXPECT_EQ(timing->steps(), 8U) << "the one that ended the session counts";
  EXPECT_EQ(timing->late_steps(), 3U);
  EXPECT_EQ(timing->late_steps(LateCause::kUser), 3U);
  ASSERT_EQ(timing->worst().size(), 1U);
  EXPECT_EQ(timing->worst()[0].time_index, 7);
  EXPECT_EQ(timing->worst()[0].lateness, 3 * kPeriod);
  EXPECT_THAT(message_of<RobotStopped>([&] { return robot.get_status(8); }),
              HasSubstr("; 3 of 8 steps were late (user 3), the worst by 3 ms at step 7"));
}

TYPED_TEST(LateSteps, AreToldOnlyWhereTimeWasTheReason) {
  typename TestFixture::Rig rig(with_deadlines(0, {.action_fault_at = 3}));
  auto robot = rig.connect();
  rig.tick();
  append_ahead<Traits>(robot, 0, 9);
  rig.tick(2);
  rig.last_tick();
  EXPECT_THAT(message_of<RobotStopped>([&] { return robot.get_status(8); }),
              ::testing::Not(HasSubstr("were late")));
}

TYPED_TEST(LateSteps, InARowEndTheSessionWhereThatIsWanted) {
  Plan plan = with_deadlines();
  plan.backend.max_late_steps = 2;
  typename TestFixture::Rig rig(plan);
  auto robot = rig.connect();
  rig.tick();
  append_ahead<Traits>(robot, 0, 19);
  rig.tick(2);
  const Nanoseconds lateness = kPeriod * 6 / 10;
  const auto go_on_late = [&](int count) {
    for (int i = 0; i < count; ++i) {
      rig.clock().wait_for_sleeper();
      rig.clock().advance(kPeriod);
    }
    rig.clock().wait_for_sleeper();
  };
  tick_late(rig, lateness);  // steps 2 and 3, then one in time
  go_on_late(1);
  catch_up(rig, lateness);
  EXPECT_FALSE(robot.fault().has_value());
  tick_late(rig, lateness);  // steps 5 to 7
  go_on_late(2);
  expect_end(robot, 7, {.code = Fault::Code::kBackendLate, .detail = -3});
  EXPECT_THAT(message_of<RobotStopped>([&] { return robot.get_status(8); }),
              AllOf(HasSubstr("late in 3 steps in a row"), HasSubstr("trifinger doctor"),
                    HasSubstr("5 of 8 steps were late (scheduler 5)")));
}

TYPED_TEST(LateSteps, CanBeReadWhenTheBackendIsDead) {
  if constexpr (std::same_as<TypeParam, AcrossProcesses>) {
    typename TestFixture::Rig rig(with_deadlines(5));
    auto robot = rig.connect();
    rig.tick();
    append_ahead<Traits>(robot, 0, 3);
    rig.tick(6);
    rig.kill();
    const auto timing = robot.timing();
    ASSERT_TRUE(timing.has_value());
    EXPECT_EQ(timing->steps(), 6U);
    EXPECT_EQ(timing->late_steps(LateCause::kUser), 2U);
  }
}

TEST(LateStep, DoesNotExistOutsideRealTimeMode) {
  InProcess::Rig<Traits> rig;
  auto robot = rig.connect();
  run_steps<Traits>(robot, 0, 9);
  EXPECT_FALSE(robot.timing().has_value());
  EXPECT_FALSE(robot.companion("sensor").session().timing().has_value());
}

TEST(LateStep, IsCountedInARecordThatIsWholeWhileTheBackendWrites) {
  InProcess::Rig<Traits> rig(with_deadlines(1'000'000'000));
  auto robot = rig.connect();
  robot.append_desired_action({});
  rig.clock().run_free();
  std::uint64_t steps = 0;
  while (steps < 20'000) {
    const auto timing = robot.timing();
    if (!timing) continue;
    ASSERT_GE(timing->steps(), steps);
    steps = timing->steps();
    ASSERT_EQ(timing->lateness().count(), steps);
    ASSERT_EQ(timing->late_steps() + timing->late_steps(LateCause::kNone), steps);
    // All steps except the first are repeats, each later than the one before.
    ASSERT_EQ(timing->late_steps(LateCause::kUser), steps - 1);
    if (steps > 1) {
      ASSERT_EQ(timing->worst().front().time_index, static_cast<TimeIndex>(steps) - 1);
    }
  }
}

// --- What else ends a session because of time ---

// The measurements become older with every step.
class AgeingDriver final : public IdleDriver {
 public:
  using IdleDriver::apply_action;
  using IdleDriver::get_latest_observation;

  [[nodiscard]] DriverReport get_latest_observation(
      FakeObservation& observation) noexcept override {
    observation = {};
    DriverReport report = DriverReport::ready();
    report.measurement_age = age_.count();
    return report;
  }
  [[nodiscard]] DriverReport apply_action(const FakeAction& desired,
                                          FakeAction& applied) noexcept override {
    age_ += kPeriod;
    return IdleDriver::apply_action(desired, applied);
  }

 private:
  Nanoseconds age_{0};
};

TEST(StaleMeasurement, EndsTheSessionAtTheStepThatItBelongsTo) {
  AgeingDriver driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host, {.max_measurement_age = 3 * kPeriod});
  Frontend<FakeRobot> robot(backend);
  const auto fault = fault_of([&] {
    for (TimeIndex t = 0; t < 10; ++t) {
      robot.append_desired_action({});
      static_cast<void>(robot.get_observation(t));
    }
  });
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(*fault, (Fault{.code = Fault::Code::kMeasurementStale, .detail = 4, .time_index = 4}));
  EXPECT_TRUE(fault->needs_recovery());
  EXPECT_EQ(robot.get_status(4).measurement_age, (4 * kPeriod).count());
}

TEST(StaleMeasurement, IsNoMatterUnlessTheOptionsSaySo) {
  AgeingDriver driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<FakeRobot> robot(backend);
  for (TimeIndex t = 0; t < 100; ++t) robot.append_desired_action({});
  static_cast<void>(robot.get_observation(99));
}

TYPED_TEST(LateSteps, fault_55_AMachineThatSleptEndsTheSession) {
  typename TestFixture::Rig rig(with_deadlines());
  auto robot = rig.connect();
  rig.tick();
  append_ahead<Traits>(robot, 0, 19);
  rig.tick(3);
  rig.clock().suspend(std::chrono::seconds(7));
  rig.tick();
  rig.last_tick();  // for the orderly stop
  expect_end(robot, 3, {.code = Fault::Code::kMachineSuspended, .detail = 7000});
  EXPECT_THAT(message_of<RobotStopped>([&] { return robot.get_status(4); }),
              HasSubstr("suspended for 7000 ms"));

  // The fault does not affect the next session, which begins awake.
  robot.recover();
  auto next = rig.connect();
  rig.tick();
  append_ahead<Traits>(next, 0, 9);
  rig.tick(4);
  EXPECT_FALSE(next.fault().has_value());
}

TYPED_TEST(LateSteps, fault_55_AMachineThatSleptBeforeStepZeroEndsTheSessionToo) {
  typename TestFixture::Rig rig(with_deadlines());
  auto robot = rig.connect();
  rig.tick(2);
  rig.clock().suspend(std::chrono::minutes(1));
  rig.last_tick();
  const auto fault = fault_of([&] { return robot.get_status(0); });
  EXPECT_EQ(fault, (Fault{.code = Fault::Code::kMachineSuspended, .detail = 60'000}));
}

}  // namespace
}  // namespace trifinger::test
