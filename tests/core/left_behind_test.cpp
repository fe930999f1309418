// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "core/drivers_of_tests.hpp"
#include "core/fault_of.hpp"
#include "core/named_robot.hpp"
#include "core/session_layout.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "ipc/shared_memory.hpp"
#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "support/soak.hpp"

// What remains of a back-end that did not end properly: its files, and the number of its process,
// which the system may give to another process later.

namespace trifinger::test {
namespace {

using ::testing::HasSubstr;

int run_backend(const std::string& name, UntypedDriver& driver) {
  SessionHost host = SessionHost::named(name, {.history = 64, .queue = 64});
  Backend(driver, host).run();
  return 0;
}

int run_fake(const std::string& name) {
  FakeDriver driver({.sensor_period = 4, .sensor_delay = 2});
  return run_backend(name, driver);
}

// Returns the robot `name` as soon as it exists.
Frontend<FakeRobot> find(const std::string& name) {
  const Deadline deadline(kLong);
  while (true) {
    try {
      return connect<FakeRobot>(name);
    } catch (const SessionNotFound&) {
      if (deadline.passed()) throw;
    }
    std::this_thread::yield();
  }
}

void leave_a_dead_robot(const std::string& name) {
  ChildProcess backend([&] { return run_fake(name); });
  auto robot = find(name);
  run_steps<FakeDriverTraits>(robot, 0, 9);
  robot.wait_until_time_index(10);
  backend.kill();
}

// Returns the files in the folder, and which file each name refers to.
std::map<std::string, ino_t> files_in(const std::filesystem::path& folder) {
  std::map<std::string, ino_t> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    struct ::stat status{};
    if (::stat(entry.path().c_str(), &status) == 0) {
      files[entry.path().filename().string()] = status.st_ino;
    }
  }
  return files;
}

class LeftBehind : public ::testing::Test {
 protected:
  SessionFolder folder_;
};

TEST_F(LeftBehind, fault_18_TheNumberOfADeadBackendMayBelongToALivingProcess) {
  leave_a_dead_robot("robot");
  {
    ipc::SharedMemory memory =
        ipc::SharedMemory::open(folder_.path() / "trifinger.robot.state", ipc::Access::kReadWrite);
    reinterpret_cast<detail::StateHeader*>(memory.data())->backend_pid = ::getpid();
  }
  EXPECT_FALSE(Session::open("robot").info().backend_is_alive);
  EXPECT_THAT(message_of<SessionNotFound>([] { return connect<FakeRobot>("robot"); }),
              HasSubstr("is gone"));
  const NamedRobot next("robot");
  auto robot = find("robot");
  run_steps<FakeDriverTraits>(robot, 0, 9);
}

TEST_F(LeftBehind, fault_28_IsRemovedByTheNextBackendAndNothingElseIs) {
  leave_a_dead_robot("robot");
  // A back-end made this file and was killed before it could publish it.
  const std::string unpublished = ".trifinger.robot.state.4711";
  ipc::SharedMemory::create_file(folder_.path(), unpublished, 1, 0600).publish();
  const auto dead = files_in(folder_.path());
  ASSERT_TRUE(dead.contains(unpublished));
  // The files are held open, so that no other file gets the number of one of them.
  std::vector<std::ifstream> held;
  held.reserve(dead.size());
  for (const auto& [file, inode] : dead) held.emplace_back(folder_.path() / file);
  const NamedRobot longer("robot2");
  const NamedRobot other("other");
  auto user = find("robot2");
  run_steps<FakeDriverTraits>(user, 0, 3);
  auto living = files_in(folder_.path());
  for (const auto& [file, inode] : dead) living.erase(file);

  const NamedRobot next("robot");
  const auto after = files_in(folder_.path());
  for (const auto& [file, inode] : living) {
    ASSERT_TRUE(after.contains(file)) << file;
    EXPECT_EQ(after.at(file), inode) << file;
  }
  for (const auto& [file, inode] : dead) {
    // The lock stays, because replacing it would be a race.
    const bool is_kept = after.contains(file) && after.at(file) == inode;
    EXPECT_EQ(is_kept, file == "trifinger.robot.lock") << file;
  }
  run_steps<FakeDriverTraits>(user, 4, 9);
  EXPECT_FALSE(user.fault().has_value());
}

TEST_F(LeftBehind, fault_28_IsNothingHoweverEarlyABackendIsKilled) {
  std::mt19937 random(1);
  const std::int64_t kills = repetitions(40, 2000);
  ProgressLine progress(kills);
  for (std::int64_t i = 0; i < kills; ++i) {
    progress.update(i);
    ChildProcess backend([] { return run_fake("robot"); });
    const auto end = std::chrono::steady_clock::now() + std::chrono::microseconds(random() % 3000);
    while (std::chrono::steady_clock::now() < end) std::this_thread::yield();
    backend.kill();
  }
  const auto names = [this](const char* beginning) {
    std::set<std::string> files;
    for (const auto& [file, inode] : files_in(folder_.path())) {
      if (file.starts_with(beginning)) files.insert(file);
    }
    return files;
  };
  {
    const NamedRobot robot("robot");
    const std::string action =
        "trifinger.robot." + std::to_string(Session::open("robot").info().session_id) + ".action";
    EXPECT_EQ(names("trifinger"),
              (std::set<std::string>{action, "trifinger.robot.lock", "trifinger.robot.sensor.state",
                                     "trifinger.robot.state"}));
    // These three files each have another name, and there is their reserve.
    EXPECT_EQ(names(".").size(), 6U);
  }
  EXPECT_EQ(names(""), std::set<std::string>{});
}

enum class Death : std::uint8_t { kAbort, kCrash, kUncaughtException, kExit };

void die(Death death) {
  switch (death) {
    case Death::kAbort:
      std::abort();
    case Death::kCrash:
      std::raise(SIGSEGV);
      return;
    case Death::kUncaughtException:
      throw std::runtime_error("on purpose, in a call that is noexcept");
    case Death::kExit:
      ::_exit(3);
  }
}

// Kills its own process in the sixth action.
class DeadlyDriver final : public IdleDriver {
 public:
  using IdleDriver::apply_action;
  using IdleDriver::get_latest_observation;

  explicit DeadlyDriver(Death death) : death_(death) {}

  [[nodiscard]] DriverReport get_latest_observation(
      FakeObservation& observation) noexcept override {
    observation = {.applied_actions = actions_};
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport apply_action(const FakeAction& desired,
                                          FakeAction& applied) noexcept override {
    if (++actions_ == 6) die(death_);
    return IdleDriver::apply_action(desired, applied);
  }

 private:
  Death death_;
  std::int64_t actions_{0};
};

class BackendThatDies : public ::testing::TestWithParam<Death> {
 protected:
  SessionFolder folder_;
};

TEST_P(BackendThatDies, fault_16_IsNoticedAndLeavesEveryStepBefore) {
  ChildProcess backend([] {
    DeadlyDriver driver(GetParam());
    return run_backend("robot", driver);
  });
  auto robot = find("robot");
  run_steps<FakeDriverTraits>(robot, 0, 5);
  EXPECT_EQ(code_of([&] { return robot.get_observation(6, kLong); }), Fault::Code::kBackendDied);
  EXPECT_NE(backend.wait(), 0);
  for (TimeIndex t = 0; t < 5; ++t) {
    EXPECT_EQ(robot.get_desired_action(t).setpoint, FakeDriverTraits::action(t).setpoint);
    EXPECT_EQ(robot.get_observation(t).applied_actions, t);
    EXPECT_EQ(robot.get_status(t).flags & Status::kEnd, 0U);
  }
  // The robot can be used again.
  const NamedRobot next("robot");
  auto user = find("robot");
  run_steps<FakeDriverTraits>(user, 0, 9);
}

constexpr std::array kDeathNames{"Abort", "Crash", "UncaughtException", "Exit"};
INSTANTIATE_TEST_SUITE_P(Deaths, BackendThatDies,
                         ::testing::Values(Death::kAbort, Death::kCrash, Death::kUncaughtException,
                                           Death::kExit),
                         [](const auto& test) {
                           return kDeathNames.at(static_cast<std::size_t>(test.param));
                         });

}  // namespace
}  // namespace trifinger::test
