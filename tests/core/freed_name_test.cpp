// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <grp.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "core/job_claim.hpp"
#include "core/named_robot.hpp"
#include "core/refused_sessions.hpp"
#include "core/transports.hpp"
#include "ipc/file_lock.hpp"
#include "support/message_of.hpp"
#include "support/nobody.hpp"
#include "support/shared_value.hpp"
#include "support/soak.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/payload.hpp"
#include "trifinger/core/sensor.hpp"

// A name without a living back-end belongs to nobody: not to the user who had it last either.

namespace trifinger::test {
namespace {

using std::filesystem::perms;
using ::testing::IsEmpty;

// Nothing can be opened as long as it lives.
class NoFiles {
 public:
  NoFiles() {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    rlimit none = before_;
    none.rlim_cur = 0;
    ::setrlimit(RLIMIT_NOFILE, &none);
  }
  NoFiles(const NoFiles&) = delete;
  NoFiles& operator=(const NoFiles&) = delete;
  ~NoFiles() { ::setrlimit(RLIMIT_NOFILE, &before_); }

 private:
  rlimit before_{};
};

class FreedName : public ::testing::Test {
 protected:
  void SetUp() override {
    // Open to everybody, and sticky like /dev/shm: nobody can remove the files of others.
    std::filesystem::permissions(folder_.path(), perms::all | perms::sticky_bit);
  }

  [[nodiscard]] std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      names.insert(entry.path().filename().string());
    }
    return names;
  }

  // Returns the exit code of `visit` as the user nobody.
  [[nodiscard]] static int as_nobody(const std::function<int()>& visit) {
    ChildProcess child([&] {
      become_nobody();
      return visit();
    });
    return child.wait();
  }

  // True if a text has all these parts; else they are printed.
  static bool says(const std::string& text, const std::vector<std::string>& parts) {
    return std::ranges::all_of(parts, [&text](const std::string& part) {
      const bool is_there = text.find(part) != std::string::npos;
      if (!is_there) std::fprintf(stderr, "'%s' is not in '%s'\n", part.c_str(), text.c_str());
      return is_there;
    });
  }

  SessionFolder folder_;
};

TEST_F(FreedName, fault_80_AnOrderlyEndLeavesNothing) {
  {
    const NamedRobot robot;
  }
  EXPECT_THAT(files(), IsEmpty());
  {
    const SensorWriter<FakeSensorReading> sensor("robot", "object");
    const PayloadWriter payloads("robot", "camera", describe<FakeObservation>(), 4);
  }
  EXPECT_THAT(files(), IsEmpty());
  {
    std::optional<SessionHost> host(SessionHost::named("robot"));
    const auto claim = JobClaim::take("robot");
    ASSERT_TRUE(claim);
    host.reset();
    EXPECT_THAT(files(), ::testing::ElementsAre("trifinger.robot.lock")) << "it has the claim";
  }
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(FreedName, fault_80_AWithdrawnNameIsGivenUpAlsoIfSomebodyLooksAtItJustThen) {
  static const ipc::FileDescriptor* other = nullptr;  // a signal's handler has no other access
  SessionHost host = SessionHost::named("robot");
  const ipc::FileDescriptor lock = ipc::open_lock_file(folder_.path() / "trifinger.robot.lock");
  ASSERT_TRUE(ipc::try_lock(lock, ipc::Lock::kClaim));
  other = &lock;
  // The signal interrupts this thread, so it comes in time however busy the machine is.
  std::signal(SIGALRM, [](int) { ipc::unlock(*other, ipc::Lock::kClaim); });
  constexpr itimerval kOnce{.it_interval = {}, .it_value = {.tv_sec = 0, .tv_usec = 20'000}};
  ::setitimer(ITIMER_REAL, &kOnce, nullptr);
  host.withdraw();
  constexpr itimerval kNever{};
  ::setitimer(ITIMER_REAL, &kNever, nullptr);
  std::signal(SIGALRM, SIG_DFL);
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(FreedName, fault_80_ARefusedBackendLeavesNothing) {
  const NamedRobot robot;
  std::filesystem::remove(folder_.path() / "trifinger.robot.lock");
  EXPECT_THROW(static_cast<void>(SessionHost::named("robot")), RobotOwned);
  EXPECT_THAT(files(), ::testing::Not(::testing::Contains("trifinger.robot.lock")));
}

TEST_F(FreedName, fault_80_WithoutAFreeFileDescriptorIsNotCalledOwned) {
  const NamedRobot robot;
  ChildProcess child([] {
    const auto without_files = [] {
      const NoFiles none;
      return SessionHost::named("robot");
    };
    return says(message_of<SystemError>(without_files), {"Too many open files"}) ? 0 : 4;
  });
  EXPECT_EQ(child.wait(), 0);
}

TEST_F(FreedName, fault_80_IsFreeForEveryUserAfterAnOrderlyEnd) {
  if (!may_become_nobody()) GTEST_SKIP() << "only the administrator can become nobody";
  const auto run = [] {
    const NamedRobot robot;
    const SensorWriter<FakeSensorReading> sensor("robot", "object");
    Frontend<FakeRobot> user("robot");
    static_cast<void>(user.append_desired_action({.setpoint = 1.0}));
    return 0;
  };
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(run(), 0);
    EXPECT_EQ(as_nobody(run), 0);
  }
}

TEST_F(FreedName, fault_80_OfAKilledBackendIsRefusedToOthersWithItsOwnerAndTheRemedy) {
  if (!may_become_nobody()) GTEST_SKIP() << "only the administrator can become nobody";
  SharedValue<std::atomic<bool>> runs;
  ChildProcess backend([&] {
    const NamedRobot robot;
    const SensorWriter<FakeSensorReading> sensor("robot", "object");
    runs->store(true);
    while (true) ::pause();
    return 0;
  });
  while (!runs->load()) std::this_thread::yield();
  const std::string folder = folder_.path().string();
  const auto texts = [] {
    std::vector<std::string> all;
    try {
      static_cast<void>(SessionHost::named("robot"));
    } catch (const Error& error) {
      all.emplace_back(error.what());
    }
    all.push_back(message_of<SystemError>([] { return Session::open("robot"); }));
    all.push_back(message_of<SystemError>([] { return JobClaim::take("robot"); }));
    const std::vector<std::string> refused = refused_sessions();
    all.insert(all.end(), refused.begin(), refused.end());
    return all;
  };
  EXPECT_EQ(as_nobody([&] {
              const std::vector<std::string> all = texts();
              for (const std::string& text : all) {
                if (!says(text, {"user root", "its back-end runs", "root can stop it"})) return 1;
              }
              // The one who wants to run it learns the kind of the error, too.
              const std::string message =
                  message_of<RobotOwned>([] { return SessionHost::named("robot"); });
              return all.size() == 4 && says(message, {"is run by another user"}) ? 0 : 2;
            }),
            0);
  backend.kill();
  const std::string remedy = "'rm " + folder + "/trifinger.robot.*'";
  EXPECT_EQ(as_nobody([&] {
              const std::vector<std::string> all = texts();
              for (const std::string& text : all) {
                if (!says(text, {"user root", "was killed", remedy, "another name"})) return 1;
              }
              const std::string message = message_of<SystemError>(
                  [] { return SensorWriter<FakeSensorReading>("robot", "object"); });
              return all.size() == 4 && says(message, {"user root", "was killed", "rm "}) ? 0 : 2;
            }),
            0);
  // Only the state is left: whose the name is does not depend on which file is looked at first.
  std::filesystem::remove(folder_.path() / "trifinger.robot.lock");
  EXPECT_EQ(as_nobody([&] {
              return says(message_of<SystemError>([] { return SessionHost::named("robot"); }),
                          {"user root", "was killed", remedy})
                         ? 0
                         : 1;
            }),
            0);
  // Only the lock is left.
  {
    const NamedRobot robot;
  }
  std::ofstream(folder_.path() / "trifinger.robot.lock").put('x');
  std::filesystem::permissions(folder_.path() / "trifinger.robot.lock", perms::owner_read);
  EXPECT_EQ(as_nobody([&] {
              return says(message_of<SessionNotFound>([] { return Session::open("robot"); }),
                          {"user root", "was killed", remedy})
                         ? 0
                         : 1;
            }),
            0);
  // The owner's next back-end needs no help, and after it the name is free.
  {
    const NamedRobot robot;
  }
  EXPECT_EQ(as_nobody([] {
              const NamedRobot robot;
              return 0;
            }),
            0);
}

// Nobody else's file is removed, and there is one owner at a time, whoever comes, goes or is
// killed.
TEST_F(FreedName, fault_80_HasOneOwnerAtATimeHoweverManyComeAndGo) {
  SharedValue<std::atomic<int>> owners;
  SharedValue<std::atomic<int>> turns;
  SharedValue<std::atomic<bool>> has_two;
  const std::int64_t wanted = repetitions(60, 20'000);
  const auto compete = [&] {
    while (turns->load() < wanted) {
      try {
        const SessionHost host = SessionHost::named("robot");
        if (owners->fetch_add(1) != 0) has_two->store(true);
        const int turn = turns->fetch_add(1);
        owners->fetch_sub(1);
        if (turn % 3 == 0) static_cast<void>(JobClaim::take("robot"));
      } catch (const Error&) {
        // Another process has the name, or its turn.
      }
    }
    return 0;
  };
  {
    std::array<std::unique_ptr<ChildProcess>, 3> children;
    for (auto& child : children) child = std::make_unique<ChildProcess>(compete);
    for (const auto& child : children) EXPECT_EQ(child->wait(), 0);
  }
  EXPECT_FALSE(has_two->load());
  EXPECT_THAT(files(), IsEmpty());
}

// ---- the group that shares a robot ----

TEST_F(FreedName, fault_80_AGroupThatIsNotTheFirstOfTheUserSharesTheRobot) {
  constexpr int kNotAllowed = 77;
  constexpr gid_t kRobots = 4711;
  // What the administrator does with 'adduser alice trifinger'.
  const std::filesystem::path groups = folder_.path() / "group";
  std::ofstream(groups) << "root:x:0:\ntrifinger:x:4711:\n";
  std::filesystem::permissions(groups, perms::owner_all | perms::others_read);
  ChildProcess child([&] {
    if (::unshare(CLONE_NEWNS) != 0 ||
        ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        ::mount(groups.c_str(), "/etc/group", nullptr, MS_BIND, nullptr) != 0 ||
        ::setgroups(1, &kRobots) != 0 || ::setgid(kNobody) != 0 || ::setuid(kNobody) != 0) {
      return kNotAllowed;
    }
    const NamedRobot shared("shared", {.history = 64, .queue = 64, .mode = 0660});
    const NamedRobot own("own");
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      const std::string name = entry.path().filename().string();
      if (!name.starts_with("trifinger.")) continue;
      struct stat status{};
      if (::stat(entry.path().c_str(), &status) != 0) return 1;
      const gid_t expected = name.starts_with("trifinger.shared.") ? kRobots : kNobody;
      if (status.st_gid != expected) {
        std::fprintf(stderr, "%s belongs to group %u\n", name.c_str(), status.st_gid);
        return 2;
      }
    }
    return 0;
  });
  const int code = child.wait();
  if (code == kNotAllowed) GTEST_SKIP() << "only the administrator can change groups";
  EXPECT_EQ(code, 0);
}

}  // namespace
}  // namespace trifinger::test
