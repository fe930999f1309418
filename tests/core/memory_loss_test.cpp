// SPDX-License-Identifier: BSD-3-Clause
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <string>
#include <system_error>
#include <thread>
#include <tuple>
#include <vector>

#include "core/drivers_of_tests.hpp"
#include "core/intruder.hpp"
#include "core/named_robot.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/message_of.hpp"

// Shared memory that disappears, or that was never large enough.

namespace trifinger::test {
namespace {

using ::testing::HasSubstr;
using FakeRig = AcrossProcesses::Rig<FakeDriverTraits>;

std::filesystem::path state_path() { return session_folder() / detail::state_file("robot"); }

TEST(MemoryLoss, fault_32_FilesThatAreUnlinkedServeThoseWhoHaveThem) {
  FakeRig rig;
  auto robot = rig.connect();
  const auto observer = rig.observe();
  run_steps<FakeDriverTraits>(robot, 0, 4);
  // systemd-logind does this when a user logs out.
  std::filesystem::remove(action_path());
  std::filesystem::remove(state_path());
  std::filesystem::remove(state_path().parent_path() / "trifinger.robot.lock");
  run_steps<FakeDriverTraits>(robot, 5, 9);
  EXPECT_EQ(bytes_of(observer.get_desired_action(9)), bytes_of(FakeDriverTraits::action(9)));
  // A long wait does not take the robot for dead either.
  EXPECT_THROW(static_cast<void>(observer.get_observation(1000, std::chrono::milliseconds(250))),
               TimedOut);
  // A new user does not find the robot, and gets an error that says so.
  EXPECT_THROW(static_cast<void>(Session::open("robot")), SessionNotFound);
  robot.finish();
  expect_end(robot, 10, {.code = Fault::Code::kFinished});
  // The next session has its own files and the name again.
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
  // Only that session has ended. Its file has the name until the back-end has noticed it.
  std::optional<Frontend<FakeRobot>> next;
  while (!next) {
    try {
      next.emplace(rig.connect());
    } catch (const IncompatibleSession&) {
      std::this_thread::yield();
    }
  }
  run_steps<FakeDriverTraits>(*next, 0, 4);
}

// ---- files that are removed, cut off or overwritten ----

enum class Loss : std::uint8_t { kRemoved, kCut, kOverwritten };

void lose(const std::filesystem::path& path, Loss loss) {
  switch (loss) {
    case Loss::kRemoved:
      std::filesystem::remove(path);
      break;
    case Loss::kCut:
      std::filesystem::resize_file(path, 0);
      break;
    case Loss::kOverwritten: {
      std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
      std::mt19937 random(1);
      const auto size = std::filesystem::file_size(path);
      for (std::uintmax_t i = 0; i < size; ++i) file.put(static_cast<char>(random()));
      break;
    }
  }
}

class LostFiles : public ::testing::TestWithParam<std::tuple<Loss, bool>> {
 protected:
  [[nodiscard]] static Loss loss() { return std::get<0>(GetParam()); }

  // Returns all files of the robot: a user's, the back-end's and the lock.
  static std::vector<std::filesystem::path> paths() {
    const std::filesystem::path folder = session_folder();
    std::vector<std::filesystem::path> paths{folder / "trifinger.robot.lock"};
    if (std::get<1>(GetParam())) {
      paths.push_back(folder / "trifinger.robot.state");
      paths.push_back(action_path());
    }
    return paths;
  }
};

TEST_P(LostFiles, fault_18_LetNoSecondBackendIn) {
  FakeRig rig;
  {
    auto robot = rig.connect();
    run_steps<FakeDriverTraits>(robot, 0, 4);
    for (const auto& path : paths()) lose(path, loss());
    const std::string message = message_of<RobotOwned>([] { return SessionHost::named("robot"); });
    EXPECT_THAT(message, HasSubstr("(process " + std::to_string(rig.process().pid()) + ")"));
    EXPECT_THAT(message, HasSubstr("'trifinger stop robot'"));
  }
  // The next attempt finds what the first one has left, and fails as well.
  EXPECT_THROW(static_cast<void>(SessionHost::named("robot")), RobotOwned);
}

TEST_P(LostFiles, fault_32_TheBackendIsFoundAndTheErrorSaysHowToEndIt) {
  FakeRig rig;
  auto robot = rig.connect();
  run_steps<FakeDriverTraits>(robot, 0, 4);
  for (const auto& path : paths()) lose(path, loss());
  const auto backend = find_backend("robot");
  ASSERT_TRUE(backend);
  EXPECT_EQ(backend->pid, rig.process().pid());
  try {
    EXPECT_TRUE(Session::open("robot").info().backend_is_alive);
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("'trifinger stop robot' brings the robot to rest"));
  }
  EXPECT_FALSE(find_backend("other"));
}

constexpr std::array kLossNames{"Removed", "Cut", "Overwritten"};
INSTANTIATE_TEST_SUITE_P(
    Losses, LostFiles,
    ::testing::Combine(::testing::Values(Loss::kRemoved, Loss::kCut, Loss::kOverwritten),
                       ::testing::Bool()),
    [](const auto& test) {
      return std::string(kLossNames.at(static_cast<std::size_t>(std::get<0>(test.param)))) +
             (std::get<1>(test.param) ? "All" : "Lock");
    });

TEST(MemoryLoss, fault_18_ALockThatIsRemovedChangesNothingForUsers) {
  FakeRig rig;
  auto robot = rig.connect();
  run_steps<FakeDriverTraits>(robot, 0, 4);
  std::filesystem::remove(session_folder() / "trifinger.robot.lock");
  const auto observer = rig.observe();
  EXPECT_TRUE(observer.session().info().backend_is_alive);
  robot.finish();
  auto next = rig.connect();
  run_steps<FakeDriverTraits>(next, 0, 4);
  EXPECT_TRUE(std::filesystem::exists(session_folder() / "trifinger.robot.lock"));
}

// Removes the file of its session as soon as it exists.
class RemovingDriver final : public IdleDriver {
 public:
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override {
    // Called before the file is created, and when it has its name.
    std::error_code ignored;
    std::filesystem::remove(state_path(), ignored);
    return {};
  }
};

class CountingFollower final : public Follower {
 public:
  void begin_session(const Session&, const std::vector<Session>&) noexcept override { ++sessions_; }
  [[nodiscard]] TimeIndex next_step() const noexcept override { return 0; }
  [[nodiscard]] int sessions() const noexcept { return sessions_; }

 private:
  int sessions_{0};
};

TEST(MemoryLoss, fault_32_ASessionThatIsLostBeforeItIsFollowedEndsNoBackend) {
  const SessionFolder folder;
  RemovingDriver driver;
  SessionHost host = SessionHost::named("robot", {.history = 64, .queue = 64});
  Backend backend(driver, host);
  CountingFollower follower;
  backend.follow(follower);
  EXPECT_NO_THROW(backend.begin_session());
  EXPECT_THROW(static_cast<void>(host.open()), SessionNotFound);
  EXPECT_EQ(follower.sessions(), 0);
}

// ---- memory that is full ----

// Moves to a private file system of 2 MiB for sessions. Returns false if that is not allowed.
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
        message.find("of 2 MiB are free") == std::string::npos ||
        message.find("'--shm-size=1g'") == std::string::npos ||
        message.find("No space left on device") == std::string::npos) {
      std::fprintf(stderr, "'%s' does not say what was to be had\n", message.c_str());
      return 2;
    }
    // Nothing of the session remains.
    if (names_in(folder.path()) != before) return 3;
    run_steps<FakeDriverTraits>(robot, 5, 9);
    return robot.get_observation(9).applied_actions == 9 ? 0 : 4;
  });
  const int code = child.wait();
  if (code == kNotAllowed) GTEST_SKIP() << "only the administrator can mount a small file system";
  EXPECT_EQ(code, 0);
}

// Takes all memory that is left in `folder`.
void fill(const std::filesystem::path& folder) {
  const ipc::FileDescriptor file([&] {
    return ::open((folder / "full").c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  });
  const std::array<char, 4096> page{};
  while (::write(file.get(), page.data(), page.size()) > 0) {
  }
}

TEST(MemoryLoss, fault_33_ARobotThatHasBegunOnceBeginsAgainHoweverFullTheMemoryIs) {
  const SessionFolder folder;
  constexpr int kNotAllowed = 77;
  ChildProcess child([&] {
    if (!has_little_memory(folder.path())) return kNotAllowed;
    const NamedRobot named("robot");
    std::uint64_t last = 0;
    for (int i = 0; i < 10; ++i) {
      fill(folder.path());
      Frontend<FakeRobot> robot("robot", {.timeout = kLong});
      if (robot.session().info().session_id == last) return 2;
      last = robot.session().info().session_id;
      if (robot.current_time_index() >= 0) return 3;  // the files from before
      run_steps<FakeDriverTraits>(robot, 0, 9);
      if (robot.get_observation(9).applied_actions != 9) return 4;
      robot.finish();
    }
    return 0;
  });
  const int code = child.wait();
  if (code == kNotAllowed) GTEST_SKIP() << "only the administrator can mount a small file system";
  EXPECT_EQ(code, 0);
}

TEST(MemoryLoss, fault_33_ARobotWaitsForMemoryThatObserversHoldAndSaysSo) {
  const SessionFolder folder;
  constexpr int kNotAllowed = 77;
  ChildProcess child([&] {
    if (!has_little_memory(folder.path())) return kNotAllowed;
    FakeDriver driver;
    SessionHost host = SessionHost::named("robot", {.history = 64, .queue = 64});
    Backend backend(driver, host);
    std::atomic<bool> is_waiting{false};
    backend.set_on_waiting([&](const std::string& problem) {
      if (problem.find("No space left on device") != std::string::npos) is_waiting = true;
    });
    BackendThread thread(backend);
    std::vector<Frontend<FakeRobot>> observers;
    const auto run_session = [&] {
      Frontend<FakeRobot> robot(host, {.timeout = kLong});
      observers.emplace_back(host, FrontendOptions{.control = false});
      run_steps<FakeDriverTraits>(robot, 0, 9);
      robot.finish();
    };
    run_session();
    {
      Frontend<FakeRobot> second(host, {.timeout = kLong});
      fill(folder.path());
      second.finish();
    }
    while (!is_waiting) std::this_thread::yield();
    // The elements that the observer maps are unchanged.
    if (observers.front().get_observation(9).applied_actions != 9) return 2;
    observers.clear();
    Frontend<FakeRobot> third(host, {.timeout = kLong});
    run_steps<FakeDriverTraits>(third, 0, 9);
    third.finish();
    thread.stop();
    return 0;
  });
  const int code = child.wait();
  if (code == kNotAllowed) GTEST_SKIP() << "only the administrator can mount a small file system";
  EXPECT_EQ(code, 0);
}

}  // namespace
}  // namespace trifinger::test
