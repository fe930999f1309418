// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/drivers_of_tests.hpp"
#include "core/fault_of.hpp"
#include "core/named_robot.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "support/shared_value.hpp"
#include "trifinger/core/errors.hpp"

// If one party stops, dies or hangs, the others notice, nobody waits for ever, and the robot can be
// used again.

namespace trifinger::test {
namespace {

using ::testing::HasSubstr;
using Traits = FakeDriverTraits;

void wait_until(const std::function<bool()>& holds) {
  const Deadline deadline(kLong);
  while (!holds()) {
    if (deadline.passed()) throw TimedOut("what a test waits for does not happen");
    std::this_thread::yield();
  }
}

// --- The user ---

class StoppedUser : public ::testing::Test {
 protected:
  // A user in a separate process appends the actions of steps 0 to 4 and is stopped. When it
  // continues, `then(robot)` returns whether it finds what it should.
  template <class Then>
  void stop_after_step_4(std::uint32_t max_action_repeats, const Then& then) {
    rig_.emplace(with_deadlines(max_action_repeats));
    observer_.emplace(rig_->observe());
    rig_->tick();
    user_.emplace([&] {
      auto robot = rig_->connect();
      append_ahead<Traits>(robot, 0, 4);
      has_appended_->store(true);
      while (!may_go_on_->load()) std::this_thread::yield();
      return then(robot) ? 0 : 1;
    });
    wait_until([&] { return has_appended_->load(); });
    user_->stop();
  }
  void go_on() {
    may_go_on_->store(true);
    user_->send(SIGCONT);
    EXPECT_EQ(user_->wait(), 0) << "the exit of the user";
  }

  std::optional<AcrossProcesses::Rig<Traits>> rig_;
  std::optional<Frontend<FakeRobot>> observer_;

 private:
  SharedValue<std::atomic<bool>> has_appended_;
  SharedValue<std::atomic<bool>> may_go_on_;
  std::optional<ChildProcess> user_;
};

TEST_F(StoppedUser, fault_03_FindsTheRobotStoppedAndLearnsWhichActionWasLate) {
  const Fault late{.code = Fault::Code::kActionLate, .detail = 2, .time_index = 7};
  stop_after_step_4(2, [&](auto& robot) {
    return fault_of([&] { return robot.append_desired_action({}); }) == late;
  });
  rig_->tick(8);
  rig_->last_tick();  // for the orderly stop
  expect_end(*observer_, 7, late);
  go_on();
}

TEST_F(StoppedUser, fault_03_GoesOnWhereItsRobotIsIfThatHasRepeatedItsAction) {
  stop_after_step_4(1000, [](auto& robot) { return robot.append_desired_action({}) == 50; });
  rig_->tick(50);
  go_on();
  const auto timing = observer_->timing();
  ASSERT_TRUE(timing.has_value());
  EXPECT_EQ(timing->late_steps(LateCause::kUser), 45U);
}

// --- The back-end dies ---

TEST(DeadBackend, fault_15_IsKnownToWhoWaitsByTheirNextLook) {
  AcrossProcesses::Rig<Traits> rig;
  auto robot = rig.connect();
  run_steps<Traits>(robot, 0, 9);
  UntypedFrontend waiting("robot", {.control = false});
  std::atomic<int> looks{0};
  waiting.set_interrupt([&] { ++looks; });
  std::optional<Fault> fault;
  std::thread waiter(
      [&] { fault = fault_of([&] { waiting.wait_until_time_index(1000, kLong); }); });
  wait_until([&] { return looks > 0; });
  rig.kill();
  const int before = looks;
  waiter.join();
  EXPECT_EQ(fault.value_or(Fault{}).code, Fault::Code::kBackendDied);
  // Waiting users look every 100 ms.
  EXPECT_LE(looks - before, 1);
  for (TimeIndex t = 0; t < 10; ++t) static_cast<void>(robot.get_status(t));
}

TEST(DeadBackend, fault_17_LeavesHandlesThatNeverMixItWithTheNextOne) {
  AcrossProcesses::Rig<Traits> rig;
  auto old = rig.connect();
  run_steps<Traits>(old, 0, 5);
  old.wait_until_time_index(6);
  const auto old_looker = rig.observe();
  rig.kill();
  const std::uint64_t old_id = old.session().info().session_id;

  const NamedRobot next;
  auto robot = connect<FakeRobot>("robot");
  EXPECT_NE(robot.session().info().session_id, old_id);
  constexpr double kOther = 1000.0;
  for (TimeIndex t = 0; t < 20; ++t) {
    ASSERT_EQ(robot.append_desired_action({.setpoint = kOther + static_cast<double>(t)}), t);
    // The old handles show the old session, which ends with step 5, whatever the next back-end
    // does.
    ASSERT_EQ(code_of([&] { return old_looker.get_observation(7); }), Fault::Code::kBackendDied);
    ASSERT_EQ(code_of([&] { return old.get_observation(7); }), Fault::Code::kBackendDied);
    ASSERT_EQ(code_of([&] { return old.append_desired_action({}); }), Fault::Code::kBackendDied);
  }
  robot.wait_until_time_index(20);
  for (TimeIndex t = 0; t <= 5; ++t) {
    EXPECT_EQ(old.get_desired_action(t).setpoint, Traits::action(t).setpoint);
  }
  EXPECT_EQ(code_of([&] { old.finish(); }), Fault::Code::kBackendDied);
  EXPECT_EQ(code_of([&] { old.recover(); }), Fault::Code::kBackendDied);
  EXPECT_EQ(old.session().info().session_id, old_id);
  for (TimeIndex t = 0; t < 20; ++t) {
    EXPECT_EQ(robot.get_desired_action(t).setpoint, kOther + static_cast<double>(t));
  }
}

// --- Waits for what never comes ---

enum class End : std::uint8_t { kStopped, kKilled };

class Waiters : public ::testing::TestWithParam<End> {};

TEST_P(Waiters, fault_35_WakeWhateverTheyWaitFor) {
  AcrossProcesses::Rig<Traits> rig;
  auto robot = rig.connect();
  run_steps<Traits>(robot, 0, 9);
  const auto observer = rig.observe();
  const Companion<FakeSensorReading> sensor(robot.companion("sensor"));
  constexpr TimeIndex kNever = TimeIndex{1} << 40U;
  const std::vector<std::function<void()>> waits{
      [&] { static_cast<void>(robot.get_observation(kNever)); },
      [&] { static_cast<void>(robot.get_desired_action(kNever)); },
      [&] { static_cast<void>(observer.get_applied_action(kNever)); },
      [&] { static_cast<void>(observer.get_status(kNever)); },
      [&] { observer.wait_until_time_index(kNever); },
      [&] { static_cast<void>(sensor.get_latest_at(kNever)); }};
  std::vector<Fault::Code> codes(waits.size());
  std::vector<std::thread> threads;
  threads.reserve(waits.size());
  for (std::size_t i = 0; i < waits.size(); ++i) {
    threads.emplace_back([&, i] { codes[i] = code_of(waits[i]); });
  }
  const bool is_killed = GetParam() == End::kKilled;
  if (is_killed) {
    rig.kill();
  } else {
    rig.request_stop();
  }
  for (std::thread& thread : threads) thread.join();
  const Fault::Code expected = is_killed ? Fault::Code::kBackendDied : Fault::Code::kStopped;
  for (const Fault::Code code : codes) EXPECT_EQ(name_of(code), name_of(expected));
  // An observer learns it, too.
  EXPECT_THROW(static_cast<void>(observer.get_observation(kNever, Timeout::zero())), RobotStopped);
  EXPECT_THROW(robot.append_desired_action({}), RobotStopped);
}

INSTANTIATE_TEST_SUITE_P(Ends, Waiters, ::testing::Values(End::kStopped, End::kKilled),
                         [](const auto& test) {
                           return test.param == End::kKilled ? "Killed" : "Stopped";
                         });

// --- The back-end hangs ---

constexpr std::uint32_t kManySkipped = 1000;

// The back-end runs in real time, by the machine's clock.
int run_backend(UntypedDriver& driver) {
  SessionHost host = SessionHost::named("robot", {.history = 64, .queue = 64});
  Backend backend(driver, host,
                  {.mode = BackendOptions::Mode::kRealTime,
                   .period = kPeriod,
                   .max_action_repeats = 1'000'000'000,
                   .max_skipped_ticks = kManySkipped});
  backend.run();
  return 0;
}

Frontend<FakeRobot> connect_to_new_robot() {
  std::optional<Frontend<FakeRobot>> robot;
  wait_until([&] {
    try {
      robot.emplace("robot", FrontendOptions{.timeout = kLong});
    } catch (const SessionNotFound&) {
    }
    return robot.has_value();
  });
  return std::move(*robot);
}

// Waits until the back-end has been stopped for so long that others must notice.
void wait_for_many_periods(const Frontend<FakeRobot>& robot) {
  wait_until(
      [&] { return robot.session().info().since_heartbeat > 6 * kManySkipped / 5 * kPeriod; });
}

TEST(StoppedBackend, fault_56_IsSilentForThoseWhoLookAndAFaultWhenItGoesOn) {
  const SessionFolder folder;
  ChildProcess backend([] {
    FakeDriver driver;
    return run_backend(driver);
  });
  auto robot = connect_to_new_robot();
  robot.append_desired_action({});
  robot.wait_until_time_index(20);
  backend.stop();
  wait_for_many_periods(robot);
  // The back-end is not dead, and nobody can know what it will do, so waits end only at their
  // timeouts.
  EXPECT_FALSE(robot.fault().has_value());
  EXPECT_THROW(robot.wait_until_time_index(1'000'000, std::chrono::milliseconds(1)), TimedOut);
  EXPECT_TRUE(robot.session().info().backend_is_alive);

  backend.send(SIGCONT);
  const auto fault = fault_of([&] { robot.wait_until_time_index(1'000'000); });
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(name_of(fault->code), name_of(Fault::Code::kBackendLate));
  EXPECT_GT(fault->detail, static_cast<std::int32_t>(kManySkipped));
  const auto timing = robot.timing();
  ASSERT_TRUE(timing.has_value());
  ASSERT_FALSE(timing->worst().empty());
  EXPECT_EQ(timing->worst().front().time_index, fault->time_index);
  EXPECT_GT(timing->worst().front().lateness, kManySkipped * kPeriod);

  robot.recover();
  auto next = connect_to_new_robot();
  next.append_desired_action({});
  next.wait_until_time_index(5);
}

// Stops its own process in the fifth action of its user. The watchdog looks before and after that
// time.
class LingeringDriver final : public IdleDriver {
 public:
  // Tells a user's action from one that holds the robot before step 0.
  static constexpr FakeAction kOfTheUser{.setpoint = 1.0};

  using IdleDriver::apply_action;

  [[nodiscard]] DriverReport apply_action(const FakeAction& desired,
                                          FakeAction& applied) noexcept override {
    if (desired.setpoint == kOfTheUser.setpoint && ++actions_ == 5) {
      stay();
      // Nobody else could do this in time on a busy machine: until then the call does hang.
      ::raise(SIGSTOP);
      stay();
    }
    return IdleDriver::apply_action(desired, applied);
  }

 private:
  static void stay() noexcept {
    const Deadline end(std::chrono::milliseconds(100));
    while (!end.passed()) std::this_thread::yield();
  }

  int actions_{0};
};

TEST(StoppedBackend, fault_56_DoesNotTakeItsOwnStopForADriverThatHangs) {
  const SessionFolder folder;
  ChildProcess backend([] {
    LingeringDriver driver;
    return run_backend(driver);
  });
  auto robot = connect_to_new_robot();
  robot.append_desired_action(LingeringDriver::kOfTheUser);
  backend.wait_until_stopped();
  wait_for_many_periods(robot);
  backend.send(SIGCONT);
  const auto fault = fault_of([&] { robot.wait_until_time_index(1'000'000); });
  EXPECT_EQ(name_of(fault.value_or(Fault{}).code), name_of(Fault::Code::kBackendLate));
}

// --- Back to work ---

struct Break {
  Fault::Code code;
  Plan plan;
  // Makes a running robot reach its fault. Afterwards the orderly stop is over.
  std::function<void(InProcess::Rig<Traits>&, Frontend<FakeRobot>&)> provoke;
};

std::vector<Break> breaks() {
  const auto go_on = [](InProcess::Rig<Traits>& rig, Frontend<FakeRobot>& robot) {
    append_ahead<Traits>(robot, 0, 29);
    while (!robot.fault()) rig.tick();
    rig.last_tick();
  };
  const auto stall = [](Nanoseconds lateness) {
    return [lateness](InProcess::Rig<Traits>& rig, Frontend<FakeRobot>& robot) {
      append_ahead<Traits>(robot, 0, 29);
      rig.tick(2);
      rig.clock().advance(kPeriod + lateness);
      rig.clock().wait_for_sleeper();
      while (!robot.fault()) rig.tick();
      rig.last_tick();
    };
  };
  std::vector<Break> all;
  all.push_back({Fault::Code::kDriver, with_deadlines(0, {.observation_fault_at = 5}), go_on});
  all.push_back({Fault::Code::kDriver, with_deadlines(0, {.action_fault_at = 5}), go_on});
  all.push_back({Fault::Code::kActionsRejected, with_deadlines(0, {.reject_from = 3}), go_on});
  all.push_back({Fault::Code::kActionLate, with_deadlines(), go_on});
  all.push_back({Fault::Code::kBackendLate, with_deadlines(), stall(9 * kPeriod)});
  Plan strict = with_deadlines();
  strict.backend.max_late_steps = 2;
  all.push_back({Fault::Code::kBackendLate, strict, stall(kPeriod * 7 / 10)});
  all.push_back({Fault::Code::kMachineSuspended, with_deadlines(),
                 [go_on](InProcess::Rig<Traits>& rig, Frontend<FakeRobot>& robot) {
                   rig.clock().suspend(std::chrono::seconds(1));
                   go_on(rig, robot);
                 }});
  return all;
}

class LatchedFault : public ::testing::TestWithParam<Break> {};

TEST_P(LatchedFault, KeepsTheRobotUntilItIsRecoveredWithoutANewProcess) {
  InProcess::Rig<Traits> rig(GetParam().plan);
  auto broken = rig.connect();
  rig.tick();
  GetParam().provoke(rig, broken);
  EXPECT_EQ(name_of(broken.fault().value_or(Fault{}).code), name_of(GetParam().code));
  EXPECT_EQ(name_of(code_of([&] { return rig.connect(); })), name_of(GetParam().code))
      << "nobody gets the robot before someone has looked at it";
  broken.recover();
  auto robot = rig.connect();
  rig.tick();
  append_ahead<Traits>(robot, 0, 2);
  rig.tick(3);
  EXPECT_EQ(robot.current_time_index(), 2);
  EXPECT_FALSE(robot.fault().has_value());
  EXPECT_EQ(name_of(broken.fault().value_or(Fault{}).code), name_of(GetParam().code));
}

INSTANTIATE_TEST_SUITE_P(OfEveryKind, LatchedFault, ::testing::ValuesIn(breaks()),
                         [](const auto& test) {
                           return "No" + std::to_string(test.index) + "_" +
                                  std::string(name_of(test.param.code));
                         });

// Has a condition like a pressed emergency stop.
class PressedDriver final : public IdleDriver {
 public:
  static constexpr std::int32_t kPressed = 7;

  using IdleDriver::apply_action;
  using IdleDriver::get_latest_observation;

  [[nodiscard]] DriverReport prepare(TimeIndex) noexcept override { return report(); }
  [[nodiscard]] DriverReport get_latest_observation(
      FakeObservation& observation) noexcept override {
    observation = {};
    return report();
  }
  [[nodiscard]] DriverReport apply_action(const FakeAction& desired,
                                          FakeAction& applied) noexcept override {
    ++actions_;
    return IdleDriver::apply_action(desired, applied);
  }
  [[nodiscard]] std::string_view fault_text(std::int32_t) const noexcept override {
    return "the emergency stop is pressed";
  }

  void press(bool is_pressed) noexcept { is_pressed_ = is_pressed; }
  [[nodiscard]] int actions() const noexcept { return actions_; }

 private:
  [[nodiscard]] DriverReport report() const noexcept {
    return is_pressed_ ? DriverReport::fault(kPressed) : DriverReport::ready();
  }

  std::atomic<bool> is_pressed_{false};
  std::atomic<int> actions_{0};
};

TEST(Recover, LeadsToTheSameFaultAsLongAsTheDriverStillHasItsReason) {
  const SessionFolder folder;
  PressedDriver driver;
  SessionHost host = SessionHost::named("robot", {.history = 64, .queue = 64});
  Backend backend(driver, host);
  const BackendThread thread(backend);
  Frontend<FakeRobot> robot(host);
  robot.append_desired_action({});
  robot.wait_until_time_index(1);
  driver.press(true);
  robot.append_desired_action({});
  EXPECT_EQ(code_of([&] { return robot.get_observation(3); }), Fault::Code::kDriver);

  // The stop is still pressed. The next session ends before its step 0, and the robot gets no
  // action.
  const int actions = driver.actions();
  for (int i = 0; i < 3; ++i) {
    recover("robot", kLong);
    const Session next = host.open();
    wait_until([&] { return next.info().is_at_rest; });
    EXPECT_EQ(next.info().fault,
              (Fault{.code = Fault::Code::kDriver, .detail = PressedDriver::kPressed}));
    EXPECT_THAT(message_of<RobotStopped>([&] { return connect<FakeRobot>("robot"); }),
                HasSubstr("the emergency stop is pressed"));
  }
  EXPECT_EQ(driver.actions(), actions);

  driver.press(false);
  recover("robot", kLong);
  auto next = connect<FakeRobot>("robot");
  next.append_desired_action({});
  next.wait_until_time_index(1);
  EXPECT_EQ(code_of([&] { return robot.get_observation(3); }), Fault::Code::kDriver);
}

}  // namespace
}  // namespace trifinger::test
