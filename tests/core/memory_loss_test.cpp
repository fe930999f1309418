// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <set>
#include <string>

#include "core/drivers_of_tests.hpp"
#include "core/intruder.hpp"
#include "core/named_robot.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/message_of.hpp"

// Shared memory that goes away, or never was enough.

namespace trifinger::test {
namespace {

using FakeRig = AcrossProcesses::Rig<FakeDriverTraits>;

std::filesystem::path state_path() { return session_folder() / detail::state_file("robot"); }

TEST(MemoryLoss, fault_32_FilesThatAreUnlinkedServeThoseWhoHaveThem) {
  FakeRig rig;
  auto robot = rig.connect();
  const auto observer = rig.observe();
  run_steps<FakeDriverTraits>(robot, 0, 4);
  // As systemd-logind does when a user logs out.
  std::filesystem::remove(action_path());
  std::filesystem::remove(state_path());
  std::filesystem::remove(state_path().parent_path() / "trifinger.robot.lock");
  run_steps<FakeDriverTraits>(robot, 5, 9);
  EXPECT_EQ(bytes_of(observer.get_desired_action(9)), bytes_of(FakeDriverTraits::action(9)));
  // Nor does a long wait take it for dead.
  EXPECT_THROW(static_cast<void>(observer.get_observation(1000, std::chrono::milliseconds(250))),
               TimedOut);
  // Somebody new does not find it, and is told so.
  EXPECT_THROW(static_cast<void>(Session::open("robot")), SessionNotFound);
  robot.finish();
  expect_end(robot, 10, {.code = Fault::Code::kFinished});
  // The next session has files of its own, and holds the name again.
  auto next = rig.connect();
  run_steps<FakeDriverTraits>(next, 0, 4);
  EXPECT_THROW(static_cast<void>(SessionHost::named("robot")), RobotOwned);
}

TEST(MemoryLoss, fault_32_AStateFileThatIsCutOffHangsNobody) {
  FakeRig rig;
  auto robot = rig.connect();
  const auto observer = rig.observe();
  run_steps<FakeDriverTraits>(robot, 0, 4);
  robot.wait_until_time_index(5);
  ASSERT_EQ(::truncate(state_path().c_str(), 0), 0);
  EXPECT_THROW(static_cast<void>(observer.get_observation(1000, kLong)), Error);
  EXPECT_THROW(
      {
        robot.append_desired_action({}, kLong);
        static_cast<void>(robot.get_observation(1000, kLong));
      },
      Error);
  // It was the end of that session alone.
  auto next = rig.connect();
  run_steps<FakeDriverTraits>(next, 0, 4);
}

// Becomes alone with a file system of 2 MiB for sessions. False where that is not allowed.
bool has_little_memory(const std::filesystem::path& folder) {
  return ::unshare(CLONE_NEWNS) == 0 &&
         ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
         ::mount("none", folder.c_str(), "tmpfs", 0, "size=2M") == 0;
}

std::set<std::string> names_in(const std::filesystem::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.insert(entry.path().filename().string());
  }
  return names;
}

TEST(MemoryLoss, fault_33_WithoutRoomASessionIsRefusedAndTheOthersGoOn) {
  const SessionFolder folder;
  constexpr int kNotAllowed = 77;
  ChildProcess child([&] {
    if (!has_little_memory(folder.path())) return kNotAllowed;
    const NamedRobot small("small");
    Frontend<FakeRobot> robot("small");
    run_steps<FakeDriverTraits>(robot, 0, 4);
    const std::set<std::string> before = names_in(folder.path());
    const std::string message = message_of<SystemError>([] {
      FakeDriver driver;
      SessionHost host = SessionHost::named("big");
      Backend(driver, host).begin_session();
      return 0;
    });
    if (message.find("reserve ") == std::string::npos ||
        message.find("/trifinger.big.") == std::string::npos ||
        message.find("No space left on device") == std::string::npos) {
      std::fprintf(stderr, "'%s' does not say what was to be had\n", message.c_str());
      return 2;
    }
    // Nothing of it stays but its lock, which may.
    std::set<std::string> after = names_in(folder.path());
    after.erase("trifinger.big.lock");
    if (after != before) return 3;
    run_steps<FakeDriverTraits>(robot, 5, 9);
    return robot.get_observation(9).applied_actions == 9 ? 0 : 4;
  });
  const int code = child.wait();
  if (code == kNotAllowed) GTEST_SKIP() << "only the administrator can mount a small file system";
  EXPECT_EQ(code, 0);
}

}  // namespace
}  // namespace trifinger::test
