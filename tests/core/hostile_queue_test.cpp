// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <random>

#include "core/drivers_of_tests.hpp"
#include "core/fault_of.hpp"
#include "core/intruder.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/session_folder.hpp"
#include "support/soak.hpp"

// The queue of actions belongs to the user, who may write anything into it. So the back-end must
// not trust it. These tests write to places that only the layout of the session knows.

namespace trifinger {
namespace {

using test::action_path;
using test::FakeDriverTraits;
using Intruder = test::Intruder<FakeAction>;
using Rig = test::AcrossProcesses::Rig<FakeDriverTraits>;

TEST(HostileQueue, fault_32_CutOffWhileTheRobotHoldsItIsAFault) {
  Rig rig;
  auto robot = rig.connect();
  static_cast<void>(robot.latest_observation());
  ASSERT_EQ(::truncate(action_path().c_str(), 1), 0);
  const auto code = test::code_of([&] {
    robot.append_desired_action({});
    static_cast<void>(robot.get_observation(0));
  });
  EXPECT_EQ(code, Fault::Code::kMemoryDamaged);
  // The robot can be used again.
  robot.recover();
  auto next = rig.connect();
  test::run_steps<FakeDriverTraits>(next, 0, 5);
}

TEST(HostileQueue, fault_32_CutOffBetweenTwoActionsItIsAFault) {
  Rig rig;
  auto robot = rig.connect();
  test::run_steps<FakeDriverTraits>(robot, 0, 4);
  robot.wait_until_time_index(5);
  ASSERT_EQ(::truncate(action_path().c_str(), 1), 0);
  test::expect_end(robot, 5, {.code = Fault::Code::kMemoryDamaged});
}

TEST(HostileQueue, fault_32_CutOffInRealTimeItIsAFault) {
  Rig rig(test::with_deadlines(1000));
  auto robot = rig.connect();
  rig.tick();
  test::append_ahead<FakeDriverTraits>(robot, 0, 4);
  rig.tick(5);
  ASSERT_EQ(::truncate(action_path().c_str(), 1), 0);
  rig.tick();
  test::expect_end(robot, 5, {.code = Fault::Code::kMemoryDamaged});
}

TEST(HostileQueue, fault_29_WithoutItsMagicItIsAFault) {
  Rig rig;
  auto robot = rig.connect();
  test::run_steps<FakeDriverTraits>(robot, 0, 4);
  robot.wait_until_time_index(5);
  Intruder().header().magic = 0;
  test::expect_end(robot, 5, {.code = Fault::Code::kMemoryDamaged});
}

TEST(HostileQueue, fault_29_AnActionFromTheFutureIsAFault) {
  Rig rig(test::with_deadlines(1000));
  auto robot = rig.connect();
  rig.tick();
  test::append_ahead<FakeDriverTraits>(robot, 0, 4);
  const Intruder intruder;
  // An action a whole queue ahead takes the place of action 3.
  intruder.put(3 + static_cast<TimeIndex>(intruder.queue().shape().capacity), {});
  rig.tick(4);
  test::expect_end(robot, 3, {.code = Fault::Code::kMemoryDamaged});
}

TEST(HostileQueue, AnActionFromTheFutureBeforeStepZeroIsAFault) {
  Rig rig;
  const auto robot = rig.connect();
  static_cast<void>(robot.latest_observation());
  const Intruder intruder;
  intruder.put(static_cast<TimeIndex>(intruder.queue().shape().capacity), {});
  EXPECT_EQ(test::code_of([&] { return robot.get_observation(0); }), Fault::Code::kMemoryDamaged);
}

TEST(HostileQueue, AnActionForAClosedStepIsDiscardedAndCounted) {
  Rig rig(test::with_deadlines(1000));
  auto robot = rig.connect();
  rig.tick();
  test::append_ahead<FakeDriverTraits>(robot, 0, 0);
  rig.tick(3);
  // This action was under way when its step was closed, like an append that is a moment too late.
  Intruder().put(2, {.setpoint = 77.0});
  rig.tick(2);
  for (TimeIndex t = 0; t <= 4; ++t) {
    EXPECT_EQ(robot.get_status(t).discarded_actions, t < 3 ? 0U : 1U) << t;
    EXPECT_EQ(robot.get_desired_action(t).setpoint, FakeDriverTraits::action(0).setpoint);
  }
  EXPECT_EQ(robot.append_desired_action(FakeDriverTraits::action(1)), 5);
  rig.tick();
  EXPECT_EQ(robot.get_status(5).flags, 0U);
}

TEST(HostileQueue, fault_29_RandomBytesEndNoBackendAndHangNobody) {
  std::mt19937 random(1);
  Rig rig({.backend = {.max_rejected_actions = 1'000'000}});
  int ends = 0;
  int waits = 0;
  test::Rounds rounds(40, std::chrono::minutes(2));
  while (rounds.next()) {
    const auto round = rounds.index();
    try {
      auto robot = rig.connect();
      const Intruder intruder;
      for (TimeIndex t = 0; t < 20; ++t) {
        intruder.scribble(random, 1 << (round % 8));
        const TimeIndex step = robot.append_desired_action({}, test::kLong);
        if (!test::observes(robot, intruder, step)) {
          ++waits;
          break;
        }
      }
    } catch (const RobotStopped&) {
      ++ends;
    } catch (const HistoryLost&) {
      // The random bytes have made more actions than this test has appended.
    } catch (const TimedOut& error) {
      FAIL() << "round " << round << ": " << error.what();
    }
    recover("robot", test::kLong);
  }
  EXPECT_GT(ends, 0) << "the bytes did no harm; is the intruder at the right place?";
  std::printf("%lld sessions with random bytes, %d ended by a fault, %d with an action destroyed\n",
              static_cast<long long>(rounds.index()), ends, waits);
  // The back-end has survived the damage.
  auto robot = rig.connect();
  test::run_steps<FakeDriverTraits>(robot, 0, 9);
  robot.finish();
  test::expect_end(robot, 10, {.code = Fault::Code::kFinished});
}

// Conditions that the watchdog checks.
TEST(ControllerDied, IsTrueOnlyOnceActionsAreApplied) {
  const test::SessionFolder folder;
  FakeDriver driver;
  SessionHost host = SessionHost::named("robot");
  const auto writers = host.place().begin(driver, false, test::kPeriod);
  detail::SessionWriter& robot = *writers.robot;
  robot.set_phase(detail::Phase::kHolding);
  EXPECT_FALSE(robot.controller_died()) << "nobody came";

  const Intruder controller;
  controller.header().controller_pid = 4711;  // its lock is free, so it has died
  EXPECT_FALSE(robot.controller_died()) << "the next one may take its place";
  robot.set_phase(detail::Phase::kRunning);
  EXPECT_TRUE(robot.controller_died());
  controller.header().requests |= detail::kDetach;
  EXPECT_FALSE(robot.controller_died()) << "it said good-bye";
}

// --- A driver that hangs
// ----------------------------------------------------------------------------------

// Hangs in its fifth action until it is released.
class HangingDriver final : public test::IdleDriver {
 public:
  using IdleDriver::apply_action;

  [[nodiscard]] DriverReport apply_action(const FakeAction& desired,
                                          FakeAction& applied) noexcept override {
    if (++actions_ == 5) released_.wait(false);
    return IdleDriver::apply_action(desired, applied);
  }
  void cut() noexcept override { ++cuts_; }

  void release() {
    released_ = true;
    released_.notify_all();
  }
  [[nodiscard]] int cuts() const noexcept { return cuts_; }

 private:
  int actions_{0};
  std::atomic<bool> released_{false};
  std::atomic<int> cuts_{0};
};

TEST(HangingDriver, IsCutAndNobodyWaitsForIt) {
  HangingDriver driver;
  ManualClock clock;
  SessionHost host = SessionHost::anonymous({.history = 64, .queue = 64});
  Backend backend(driver, host,
                  {.mode = BackendOptions::Mode::kRealTime,
                   .max_action_repeats = 1'000'000,
                   .max_skipped_ticks = 1'000'000,
                   .driver_timeout = std::chrono::milliseconds(1)},
                  clock);
  const BackendThread thread(backend);
  Frontend<FakeRobot> robot(host);
  // Few calls are made, so that hardly any of them can be so long because the machine is busy. The
  // first one holds the robot.
  clock.wait_for_sleeper();
  robot.append_desired_action({});
  clock.tick(test::kPeriod, 3);
  clock.advance(test::kPeriod);
  const auto fault = test::fault_of([&] { return robot.get_status(1000); });
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->code, Fault::Code::kDriverHangs);
  EXPECT_EQ(driver.cuts(), 1);
  const TimeIndex last = robot.current_time_index();
  EXPECT_EQ(test::fault_of([&] { robot.append_desired_action({}); }), fault);

  driver.release();
  robot.recover();
  // The call that returned late added nothing to the session that had ended.
  EXPECT_EQ(robot.current_time_index(), last);
  EXPECT_EQ(test::fault_of([&] { return robot.get_status(last + 1); }), fault);
  Frontend<FakeRobot> next(host);
  clock.wait_for_sleeper();
  next.append_desired_action({});
  clock.tick(test::kPeriod, 11);
  EXPECT_EQ(next.current_time_index(), 10);
  clock.run_free();
}

}  // namespace
}  // namespace trifinger
