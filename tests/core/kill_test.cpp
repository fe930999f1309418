// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>

#include "core/transports.hpp"
#include "support/child_process.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/fake_robot.hpp"

// Killing any process at any time never hangs another one. A back-end and a controller run in
// processes of their own; at random instants one of them is killed, and whoever is left has to
// notice, by itself, and go on with a new partner. The time limits here are only to tell a hang
// from a slow machine.

namespace trifinger::test {
namespace {

int run_backend(bool has_deadlines) {
  FakeDriver driver({.sensor_period = 4, .sensor_delay = 2});
  SessionHost host = SessionHost::named("robot", {.history = 64, .queue = 16});
  BackendOptions options{.period = std::chrono::microseconds(200),
                         .max_action_repeats = 1'000'000'000,
                         .max_skipped_ticks = 1'000'000'000};
  if (has_deadlines) options.mode = BackendOptions::Mode::kRealTime;
  Backend backend(driver, host, options);
  backend.run();
  return 0;
}

// Controls the robot; where it stops, the next one of that name. Gives up only if it waits for
// longer than any machine needs.
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
      // Time was faster than we.
    } catch (const SessionNotFound&) {
      // The next back-end is on its way.
    }
    std::this_thread::yield();
  }
  return 1;
}

class KillTest : public ::testing::TestWithParam<bool> {
 protected:
  [[nodiscard]] std::unique_ptr<ChildProcess> start_backend() const {
    return std::make_unique<ChildProcess>([] { return run_backend(GetParam()); });
  }
  [[nodiscard]] static std::unique_ptr<ChildProcess> start_controller() {
    return std::make_unique<ChildProcess>([] { return run_controller(); });
  }

  // Follows a session of `backend` up to its step t; tries the next one where that has ended.
  [[nodiscard]] static Frontend<FakeRobot> follow(const ChildProcess& backend, TimeIndex t) {
    const Deadline deadline(kLong);
    while (true) {
      try {
        auto observer = observe<FakeRobot>("robot");
        // Not the remains of a dead back-end, which can be read, too.
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

  // A moment of random length, far below and far above a step.
  void dawdle() {
    const auto end = std::chrono::steady_clock::now() + std::chrono::microseconds(random_() % 2000);
    while (std::chrono::steady_clock::now() < end) std::this_thread::yield();
  }

  SessionFolder folder_;
  std::mt19937 random_{GetParam() ? 1U : 2U};
};

TEST_P(KillTest, FiftyRandomKillsHangNobody) {
  constexpr int kKills = 50;
  int backends = 0;
  int controllers = 0;
  int early = 0;
  auto backend = start_backend();
  auto controller = start_controller();
  for (int i = 0; i < kKills; ++i) {
    const bool is_backend = random_() % 2 == 0;
    std::optional<Frontend<FakeRobot>> observer;
    // Half of the kills strike a robot that works, the others whatever comes first: the making of a
    // session, an attach.
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
      // A controller that was killed a moment before may have ended the session of a back-end that
      // is killed now.
      EXPECT_TRUE(code == Fault::Code::kControllerDied ||
                  (is_backend && code == Fault::Code::kBackendDied))
          << name_of(code);
    }
    // Whoever is left goes on with the new partner by itself.
    victim = is_backend ? start_backend() : start_controller();
  }
  // All is well in the end.
  static_cast<void>(follow(*backend, 20));
  std::printf(
      "%d kills: %d back-ends, %d controllers; %d of them before the robot was seen to work\n",
      kKills, backends, controllers, early);
}

INSTANTIATE_TEST_SUITE_P(Deadlines, KillTest, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "With" : "Without"; });

}  // namespace
}  // namespace trifinger::test
