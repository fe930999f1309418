// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "core/drivers_of_tests.hpp"
#include "core/fault_of.hpp"
#include "core/named_robot.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "support/shared_value.hpp"

// The children are made by the system call itself, so the C library does not know of them and tells
// nobody. They keep all open files of their parent, including its locks, even after the parent's
// death.

namespace trifinger::test {
namespace {

using ::testing::HasSubstr;

class BareFork : public ::testing::Test {
 protected:
  ~BareFork() override {
    if (*heir_ > 0) ::kill(*heir_, SIGKILL);
  }

  // Runs `begin`, leaves a child that continues to live, and reports that.
  int run_and_fork(const std::function<void()>& begin) const {
    begin();
    const auto child = static_cast<pid_t>(::syscall(SYS_clone, SIGCHLD, nullptr, nullptr, 0, 0));
    if (child == 0) {
      while (true) ::pause();
    }
    heir_->store(child);
    while (true) ::pause();
  }
  void wait_for_heir() const {
    while (heir_->load() == 0) std::this_thread::yield();
  }
  [[nodiscard]] bool heir_lives() const { return ::kill(heir_->load(), 0) == 0; }

  static Frontend<FakeRobot> find() {
    const Deadline deadline(kLong);
    while (true) {
      try {
        return connect<FakeRobot>("robot", {.timeout = kLong});
      } catch (const SessionNotFound&) {
        if (deadline.passed()) throw;
      }
      std::this_thread::yield();
    }
  }
  static void run_backend() {
    FakeDriver driver({.sensor_period = 4, .sensor_delay = 2});
    SessionHost host = SessionHost::named("robot", {.history = 64, .queue = 64});
    Backend(driver, host).run();
  }

 private:
  SessionFolder folder_;
  SharedValue<std::atomic<pid_t>> heir_;
};

TEST_F(BareFork, fault_64_AChildDoesNotKeepTheControlOfADeadController) {
  ChildProcess controller([&] {
    std::unique_ptr<Frontend<FakeRobot>> robot;
    return run_and_fork([&] {
      robot = std::make_unique<Frontend<FakeRobot>>(find());
      run_steps<FakeDriverTraits>(*robot, 0, 4);
    });
  });
  ChildProcess backend([] {
    run_backend();
    return 0;
  });
  wait_for_heir();
  const auto observer = observe<FakeRobot>("robot");
  EXPECT_EQ(observer.session().info().controller.pid, controller.pid());
  controller.kill();
  EXPECT_EQ(code_of([&] { return observer.get_observation(1000, kLong); }),
            Fault::Code::kControllerDied);
  auto next = find();
  run_steps<FakeDriverTraits>(next, 0, 4);
  EXPECT_EQ(next.session().info().controller.pid, ::getpid());
  EXPECT_TRUE(heir_lives());
}

TEST_F(BareFork, fault_64_AChildDoesNotKeepTheControlOfAControllerThatDiedBeforeItsFirstAction) {
  ChildProcess controller([&] {
    std::unique_ptr<Frontend<FakeRobot>> robot;
    return run_and_fork([&] { robot = std::make_unique<Frontend<FakeRobot>>(find()); });
  });
  ChildProcess backend([] {
    run_backend();
    return 0;
  });
  wait_for_heir();
  EXPECT_THROW(static_cast<void>(connect<FakeRobot>("robot")), ControlHeld);
  controller.kill();
  EXPECT_EQ(Session::open("robot").info().controller.pid, 0);
  auto next = find();
  run_steps<FakeDriverTraits>(next, 0, 4);
  EXPECT_TRUE(heir_lives());
}

TEST_F(BareFork, fault_64_AChildDoesNotKeepTheNameOfADeadBackend) {
  ChildProcess backend([&] {
    std::unique_ptr<NamedRobot> robot;
    return run_and_fork([&] { robot = std::make_unique<NamedRobot>(); });
  });
  wait_for_heir();
  EXPECT_THROW(static_cast<void>(SessionHost::named("robot")), RobotOwned);
  const auto observer = observe<FakeRobot>("robot");
  backend.kill();
  EXPECT_EQ(code_of([&] { return observer.get_observation(1000, kLong); }),
            Fault::Code::kBackendDied);
  EXPECT_FALSE(Session::open("robot").info().backend_is_alive);
  EXPECT_THAT(message_of<SessionNotFound>([] { return connect<FakeRobot>("robot"); }),
              HasSubstr("is gone"));
  const NamedRobot next;
  auto user = find();
  run_steps<FakeDriverTraits>(user, 0, 4);
  EXPECT_TRUE(heir_lives());
  // The new lock counts, which replaced the old one.
  EXPECT_THROW(static_cast<void>(SessionHost::named("robot")), RobotOwned);
}

}  // namespace
}  // namespace trifinger::test
