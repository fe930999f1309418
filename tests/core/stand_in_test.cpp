// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <thread>

#include "core/drivers_of_tests.hpp"
#include "core/named_robot.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"

// What a front-end does for a program that is late. On a clock that runs ahead of all threads, a
// back-end sometimes finds no action, so it may repeat the one before.

namespace trifinger::test {
namespace {

using ::testing::HasSubstr;
using Traits = FakeDriverTraits;

constexpr std::uint32_t kMany = 1'000'000'000;  // repeats that are allowed

FakeAction hold(const FakeObservation& observation) {
  return {.setpoint = 1000.0 + observation.setpoint};
}

template <class Transport>
class StandIn : public ::testing::Test {
 protected:
  using Rig = typename Transport::template Rig<Traits>;
};
TYPED_TEST_SUITE(StandIn, TransportsWithDeadlines, TransportName);

template <class Robot>
void wait_until_late(const Robot& robot) {
  const Deadline deadline(kLong);
  while (!robot.is_late()) {
    ASSERT_FALSE(deadline.passed()) << "nobody appends for the late program";
    std::this_thread::yield();
  }
}

// Appends the first action, lets it act and waits until the program is late.
template <class Rig, class Robot>
void be_late_after_one_action(Rig& rig, Robot& robot) {
  rig.tick();
  ASSERT_EQ(robot.append_desired_action(Traits::action(0)), 0);
  rig.tick();
  wait_until_late(robot);
}

TYPED_TEST(StandIn, HoldsTheRobotAsLongAsTheProgramThinks) {
  typename TestFixture::Rig rig(with_deadlines(kMany));
  auto robot = rig.connect();
  robot.set_on_late(OnLate::kHold, hold);
  be_late_after_one_action(rig, robot);
  const double before = Traits::action(0).setpoint;
  const double held = hold({.setpoint = before}).setpoint;
  const Deadline deadline(kLong);
  bool is_held = false;  // from some step on
  int count = 0;
  for (TimeIndex t = 1; count < 100; ++t) {
    ASSERT_FALSE(deadline.passed()) << count << " actions in " << t << " steps";
    rig.tick();
    const double setpoint = robot.get_desired_action(t, kLong).setpoint;
    is_held = is_held || setpoint != before;
    ASSERT_EQ(setpoint, is_held ? held : before) << t;
    if (is_held && !has_flag(robot, t, Status::kActionRepeated)) ++count;
  }
  EXPECT_TRUE(robot.is_late());
}

TYPED_TEST(StandIn, RepeatsTheLastActionIfToldSo) {
  typename TestFixture::Rig rig(with_deadlines(kMany));
  auto robot = rig.connect();
  robot.set_on_late(OnLate::kRepeat);
  be_late_after_one_action(rig, robot);
  const Deadline deadline(kLong);
  int count = 0;
  for (TimeIndex t = 1; count < 50; ++t) {
    ASSERT_FALSE(deadline.passed()) << count << " actions in " << t << " steps";
    rig.tick();
    ASSERT_EQ(robot.get_desired_action(t, kLong).setpoint, Traits::action(0).setpoint) << t;
    if (!has_flag(robot, t, Status::kActionRepeated)) ++count;
  }
}

TYPED_TEST(StandIn, HoldsTheRobotAlsoIfItIsToldSoLate) {
  typename TestFixture::Rig rig(with_deadlines(kMany));
  auto robot = rig.connect();
  robot.set_on_late(OnLate::kRepeat);
  be_late_after_one_action(rig, robot);
  for (TimeIndex t = 1; t <= 30; ++t) rig.tick();
  robot.set_on_late(OnLate::kHold, hold);
  const Deadline deadline(kLong);
  for (TimeIndex t = 31; robot.get_desired_action(t - 1, kLong).setpoint < 1000.0; ++t) {
    ASSERT_FALSE(deadline.passed()) << "the robot is not held";
    rig.tick();
  }
}

TYPED_TEST(StandIn, LetsTheProgramGoOnBehindItsActions) {
  typename TestFixture::Rig rig(with_deadlines());
  auto robot = rig.connect();
  robot.set_on_late(OnLate::kHold, hold);
  be_late_after_one_action(rig, robot);
  // It was late for a step, so it is by one step later.
  ASSERT_EQ(robot.append_desired_action(Traits::action(1)), 2);
  EXPECT_FALSE(robot.is_late());
  rig.tick(2);
  EXPECT_EQ(robot.get_desired_action(1, kLong).setpoint, Traits::action(0).setpoint);
  EXPECT_EQ(robot.get_desired_action(2, kLong).setpoint, Traits::action(1).setpoint);
}

TYPED_TEST(StandIn, AppendsNothingBeforeTheFirstActionAndAfterTheLast) {
  typename TestFixture::Rig rig(with_deadlines());
  auto robot = rig.connect();
  robot.set_on_late(OnLate::kHold, hold);
  rig.tick(5);
  EXPECT_EQ(robot.current_time_index(), -1);
  EXPECT_FALSE(robot.is_late());
  append_ahead<Traits>(robot, 0, 2);
  EXPECT_THROW(robot.finish(Timeout::zero()), TimedOut);  // it is asked for
  rig.clock().run_free();
  robot.finish(kLong);
  EXPECT_THROW(static_cast<void>(robot.get_desired_action(3)), RobotStopped);
}

TYPED_TEST(StandIn, LeavesTheRestToTheBackendIfToldSo) {
  typename TestFixture::Rig rig(with_deadlines());
  auto robot = rig.connect();
  robot.set_on_late(OnLate::kHold, hold);
  robot.set_on_late(OnLate::kNothing);
  rig.tick();
  ASSERT_EQ(robot.append_desired_action(Traits::action(0)), 0);
  rig.clock().run_free();
  EXPECT_THROW(static_cast<void>(robot.get_observation(1000, kLong)), RobotStopped);
  EXPECT_EQ(robot.fault()->code, Fault::Code::kActionLate);
  EXPECT_FALSE(robot.is_late());
}

TYPED_TEST(StandIn, EndsWithItsHandle) {
  typename TestFixture::Rig rig(with_deadlines());
  {
    auto robot = rig.connect();
    robot.set_on_late(OnLate::kHold, hold);
    be_late_after_one_action(rig, robot);
  }
  rig.clock().run_free();
  auto next = rig.connect();  // the session of the first handle has ended as "detached"
  EXPECT_EQ(next.current_time_index(), -1);
}

TYPED_TEST(StandIn, IsForControllersAndKnowsHowToHold) {
  typename TestFixture::Rig rig(with_deadlines());
  auto robot = rig.connect();
  auto observer = rig.observe();
  EXPECT_THAT(message_of<InvalidArgument>([&] { observer.set_on_late(OnLate::kRepeat); }),
              HasSubstr("only observes"));
  EXPECT_THAT(message_of<InvalidArgument>([&] { robot.set_on_late(OnLate::kHold); }),
              HasSubstr("needs a function"));
}

// On the clock of this machine. A step counts only if the machine gave the program its time.
TEST(StandInInRealTime, LeavesAProgramAloneThatIsInTime) {
  constexpr Nanoseconds kSlow = std::chrono::milliseconds(20);
  const SessionFolder folder;
  const NamedRobot fake("robot", {},
                        {.mode = BackendOptions::Mode::kRealTime,
                         .period = kSlow,
                         .max_action_repeats = kMany,
                         .max_skipped_ticks = kMany});
  Frontend<FakeRobot> robot(fake.host(), {.timeout = kLong});
  robot.set_on_late(OnLate::kHold, hold);
  TimeIndex t = robot.append_desired_action(Traits::action(0));
  int in_time = 0;
  for (int i = 0; in_time < 20 && i < 5000; ++i) {
    static_cast<void>(robot.get_observation(t));
    // A step that begins late ends no later: the next one begins a period after this should have.
    const Status status = robot.get_status(t);
    const Instant begun{Nanoseconds(status.time - status.lateness)};
    // It thinks for half of the period.
    while (std::chrono::steady_clock::now() < begun + kSlow / 2) std::this_thread::yield();
    const TimeIndex next = robot.append_desired_action(Traits::action(i));
    if (std::chrono::steady_clock::now() - begun < kSlow * 8 / 10) {
      ASSERT_EQ(next, t + 1);
      ++in_time;
    }
    t = next;
  }
  EXPECT_GT(in_time, 0);
}

TEST(StandInAcrossProcesses, DoesNotOutliveItsProgram) {
  AcrossProcesses::Rig<Traits> rig(with_deadlines(kMany));
  ChildProcess program([&] {
    auto robot = rig.connect();
    robot.set_on_late(OnLate::kHold, hold);
    robot.append_desired_action(Traits::action(0));
    while (true) ::pause();
    return 0;
  });
  auto observer = rig.observe();
  const Deadline deadline(kLong);
  while (observer.current_time_index() < 0) {
    ASSERT_FALSE(deadline.passed());
    rig.tick();
  }
  for (TimeIndex t = 0; observer.get_desired_action(t, kLong).setpoint < 1000.0; ++t) rig.tick();
  program.kill();
  rig.clock().run_free();
  EXPECT_THROW(static_cast<void>(observer.get_observation(1'000'000, kLong)), RobotStopped);
  EXPECT_EQ(observer.fault()->code, Fault::Code::kControllerDied);
}

}  // namespace
}  // namespace trifinger::test
