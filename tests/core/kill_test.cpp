// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>

#include "core/fake_robot.hpp"
#include "core/transports.hpp"
#include "support/child_process.hpp"
#include "support/session_folder.hpp"
#include "support/shared_value.hpp"
#include "support/soak.hpp"

// Killing any process at any time never hangs another one. A back-end, a controller and observers
// run in separate processes; at random instants one of them is killed. If the back-end or the
// controller dies, the other one must notice by itself and continue with a new partner. Nobody
// notices the death of an observer. The time limits here only tell a hang from a slow machine.

namespace trifinger::test {
namespace {

int run_backend(bool has_deadlines, std::size_t history) {
  FakeDriver driver({.sensor_period = 4, .sensor_delay = 2});
  SessionHost host = SessionHost::named("robot", {.history = history, .queue = 16});
  BackendOptions options{.period = std::chrono::microseconds(200),
                         .max_action_repeats = 1'000'000'000,
                         .max_skipped_ticks = 1'000'000'000};
  if (has_deadlines) options.mode = BackendOptions::Mode::kRealTime;
  Backend backend(driver, host, options);
  backend.run();
  return 0;
}

// Controls the robot. When it stops, controls the next one of that name. Gives up only if it waits
// for longer than any machine needs.
int run_controller() {
  Deadline deadline(kLong);
  while (!deadline.passed()) {
    try {
      auto robot = connect<FakeRobot>("robot", {.timeout = kLong});
      TimeIndex t = robot.append_desired_action({}, kLong);
      while (true) {
        static_cast<void>(robot.get_observation(t, kLong));
        t = robot.append_desired_action({.setpoint = static_cast<double>(t)}, kLong);
        deadline = Deadline(kLong);
      }
    } catch (const RobotStopped&) {
    } catch (const HistoryLost&) {
      // Time passed faster than this controller could follow.
    } catch (const SessionNotFound&) {
      // The next back-end will come.
    }
    std::this_thread::yield();
  }
  return 1;
}

// Observes the robot in every possible way, and counts what it has seen.
int run_observer(std::atomic<std::int64_t>& seen) {
  const auto robot = observe<FakeRobot>("robot");
  const Companion<FakeSensorReading> sensor(robot.companion("sensor"));
  std::array<FakeObservation, 16> observations;
  while (true) {
    try {
      // Waits for future steps and reads existing ones.
      const TimeIndex t = robot.current_time_index() + 1;
      static_cast<void>(robot.get_observation(t, kLong));
      static_cast<void>(robot.get_status(t, kLong));
      static_cast<void>(robot.latest_observation(kLong));
      static_cast<void>(sensor.get_latest_at(t, kLong));
      if (t >= 16) robot.get_observations(t - 15, observations, kLong);
    } catch (const HistoryLost&) {
      // Time passed faster than this observer could follow.
    }
    ++seen;
  }
}

class KillTest : public ::testing::TestWithParam<bool> {
 protected:
  using Process = std::unique_ptr<ChildProcess>;

  [[nodiscard]] static Process start_backend(std::size_t history = 64) {
    return std::make_unique<ChildProcess>([history] { return run_backend(GetParam(), history); });
  }
  [[nodiscard]] static Process start_controller() {
    return std::make_unique<ChildProcess>([] { return run_controller(); });
  }
  [[nodiscard]] static Process start_observer(std::atomic<std::int64_t>& seen) {
    return std::make_unique<ChildProcess>([&seen] { return run_observer(seen); });
  }

  // Follows a session of `backend` up to its step t. If the session has ended, tries the next one.
  [[nodiscard]] static Frontend<FakeRobot> follow(const ChildProcess& backend, TimeIndex t) {
    const Deadline deadline(kLong);
    while (true) {
      try {
        auto observer = observe<FakeRobot>("robot");
        // Skip the remains of a dead back-end, which can be read, too.
        if (observer.session().info().backend.pid == backend.pid()) {
          observer.wait_until_time_index(t, kLong);
          return observer;
        }
      } catch (const SessionNotFound&) {
      } catch (const RobotStopped&) {
      }
      if (deadline.passed()) throw TimedOut("no session came to step " + std::to_string(t));
      std::this_thread::yield();
    }
  }

  // Waits for a random time, far below and far above a step.
  void dawdle() {
    const auto end = std::chrono::steady_clock::now() + std::chrono::microseconds(random_() % 2000);
    while (std::chrono::steady_clock::now() < end) std::this_thread::yield();
  }

  SessionFolder folder_;
  std::mt19937 random_{GetParam() ? 1U : 2U};
};

TEST_P(KillTest, fault_02_RandomKillsHangNobody) {
  const std::int64_t kills = repetitions(50, 500);
  int backends = 0;
  int controllers = 0;
  int early = 0;
  auto backend = start_backend();
  auto controller = start_controller();
  ProgressLine progress(kills);
  for (std::int64_t i = 0; i < kills; ++i) {
    progress.update(i);
    const bool is_backend = random_() % 2 == 0;
    std::optional<Frontend<FakeRobot>> observer;
    // Half of the kills hit a working robot. The others hit anything else: creating a session,
    // attaching.
    if (random_() % 2 == 0) {
      observer.emplace(follow(*backend, static_cast<TimeIndex>(random_() % 50)));
    } else {
      ++early;
    }
    dawdle();
    auto& victim = is_backend ? backend : controller;
    ++(is_backend ? backends : controllers);
    victim->kill();
    if (observer) {
      EXPECT_THROW(static_cast<void>(observer->get_status(1LL << 40U, kLong)), RobotStopped);
      const Fault::Code code = observer->fault().value_or(Fault{}).code;
      // The controller that was killed just before may have ended the session of this back-end. On
      // a busy machine, where time runs faster than the controller, the controller also leaves by
      // itself.
      EXPECT_TRUE(code == Fault::Code::kControllerDied ||
                  (is_backend && code == Fault::Code::kBackendDied) ||
                  (GetParam() && code == Fault::Code::kDetached))
          << name_of(code);
    }
    // The survivor continues with the new partner by itself.
    victim = is_backend ? start_backend() : start_controller();
  }
  // Everything works in the end.
  static_cast<void>(follow(*backend, 20));
  std::printf(
      "%lld kills: %d back-ends, %d controllers; %d of them before the robot was seen to work\n",
      static_cast<long long>(kills), backends, controllers, early);
}

// Waits until the controller has appended another action. Checks that all steps until then are
// there and contain what that controller sends.
void expect_whole_and_going_on(const Frontend<FakeRobot>& robot) {
  constexpr TimeIndex kCount = 32;
  const Deadline deadline(kLong);
  while (true) {
    try {
      const TimeIndex first = robot.current_time_index() + 1;
      std::array<FakeAction, kCount> desired;
      std::array<FakeAction, kCount> applied;
      std::array<FakeObservation, kCount> observations;
      std::array<Status, kCount> statuses;
      robot.get_statuses(first, statuses, kLong);
      robot.get_desired_actions(first, desired);
      robot.get_applied_actions(first, applied);
      robot.get_observations(first, observations);
      // Each action contains the step of the action before: see run_controller.
      std::optional<TimeIndex> appended;
      for (std::size_t i = 0; i < kCount; ++i) {
        const TimeIndex t = first + static_cast<TimeIndex>(i);
        const bool is_repeated = (statuses[i].flags & Status::kActionRepeated) != 0;
        EXPECT_EQ(applied[i].setpoint, desired[i].setpoint) << t;
        if (i > 0) {
          EXPECT_EQ(observations[i].setpoint, applied[i - 1].setpoint) << t;
          EXPECT_EQ(observations[i].applied_actions, observations[i - 1].applied_actions + 1) << t;
        }
        if (is_repeated && i > 0) {
          EXPECT_EQ(desired[i].setpoint, desired[i - 1].setpoint) << t;
        }
        if (is_repeated) continue;
        if (appended) {
          EXPECT_EQ(desired[i].setpoint, static_cast<double>(*appended)) << t;
        }
        appended = t;
      }
      if (appended) return;
    } catch (const HistoryLost&) {
      // This process did not run for the time of a whole history.
    }
    if (deadline.passed()) throw TimedOut("the controller appends no more");
  }
}

TEST_P(KillTest, KilledObserversDisturbNobody) {
  const std::int64_t kills = repetitions(50, 500);
  constexpr std::size_t kObservers = 3;
  SharedValue<std::array<std::atomic<std::int64_t>, kObservers>> seen;
  const auto backend = start_backend(1 << 14);
  const auto controller = start_controller();
  const Frontend<FakeRobot> robot = follow(*backend, 20);

  std::array<Process, kObservers> observers;
  for (std::size_t i = 0; i < kObservers; ++i) observers[i] = start_observer((*seen)[i]);
  int early = 0;
  ProgressLine progress(kills);
  for (std::int64_t i = 0; i < kills; ++i) {
    progress.update(i);
    const std::size_t place = random_() % kObservers;
    Process& victim = observers[place];
    std::atomic<std::int64_t>& count = (*seen)[place];
    // Half of the kills hit a working observer. The others hit anything else: an attach.
    if (random_() % 2 == 0) {
      const std::int64_t before = count;
      while (count == before) std::this_thread::yield();
    } else {
      ++early;
    }
    dawdle();
    victim->kill();
    EXPECT_EQ(victim->wait(), -SIGKILL) << "it had ended before, which only we may do";
    expect_whole_and_going_on(robot);
    victim = start_observer(count);
  }
  // It is one single session, from beginning to end.
  EXPECT_FALSE(robot.fault().has_value());
  std::printf(
      "%lld kills of observers, %d of them perhaps before it had seen anything; %lld steps\n",
      static_cast<long long>(kills), early, static_cast<long long>(robot.current_time_index()));
}

INSTANTIATE_TEST_SUITE_P(Deadlines, KillTest, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "With" : "Without"; });

}  // namespace
}  // namespace trifinger::test
