// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <thread>

#include "core/named_robot.hpp"
#include "core/transports.hpp"
#include "support/nobody.hpp"
#include "trifinger/core/errors.hpp"

// Who may do what with a session: files of 0600 belong to their owner alone, others are shared on
// purpose.

namespace trifinger::test {
namespace {

using std::filesystem::perms;

// The robot "robot" of the administrator, with files of `mode`, and another user who uses it.
class Permission : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!may_become_nobody()) GTEST_SKIP() << "only the administrator can become nobody";
    // The folder is open to everybody, like /dev/shm.
    std::filesystem::permissions(folder_.path(), perms::all | perms::sticky_bit);
  }

  // Returns what `visit` returns when the user nobody calls it, as a member of `group`. The
  // sentence of an expected error goes through a file.
  [[nodiscard]] int as_nobody(unsigned mode, gid_t group, const std::function<int()>& visit) {
    // The child is made before the robot's threads, because a sanitizer needs that.
    ChildProcess child([&] {
      become_nobody(group);
      const Deadline deadline(kLong);
      while (!deadline.passed()) {
        try {
          return visit();
        } catch (const SessionNotFound&) {
          std::this_thread::yield();  // the robot does not exist yet
        }
      }
      return 99;
    });
    const NamedRobot robot("robot", {.history = 64, .queue = 64, .mode = mode});
    return child.wait();
  }

  // True if the text of `error` names the file that ends with `file`, its owner, its mode and the
  // remedy.
  static bool says_all(const SystemError& error, const std::string& file, const std::string& mode) {
    const std::string text = error.what();
    for (const std::string& part :
         {file, std::string("user root and group root"), "with mode " + mode,
          std::string("'backend.access: group'"), std::string("Permission denied")}) {
      if (text.find(part) != std::string::npos) continue;
      std::fprintf(stderr, "'%s' is not in '%s'\n", part.c_str(), text.c_str());
      return false;
    }
    return error.error_number() == EACCES;
  }

  static constexpr int kRefused = 3;
  static constexpr int kWrongText = 4;

  SessionFolder folder_;
};

TEST_F(Permission, fault_31_ByDefaultFilesAreTheirOwnersAlone) {
  const NamedRobot robot;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    EXPECT_EQ(entry.status().permissions(), perms::owner_read | perms::owner_write) << entry;
  }
}

TEST_F(Permission, fault_31_TheGroupMayWriteNothingButTheQueue) {
  const NamedRobot robot("robot", {.history = 64, .queue = 64, .mode = 0660});
  const auto mode_of = [&](const std::string& file) {
    return std::filesystem::status(folder_.path() / file).permissions();
  };
  const perms read_by_group = perms::owner_read | perms::owner_write | perms::group_read;
  EXPECT_EQ(mode_of("trifinger.robot.state"), read_by_group);
  EXPECT_EQ(mode_of("trifinger.robot.sensor.state"), read_by_group);
  const std::string id = std::to_string(Session::open("robot").info().session_id);
  EXPECT_EQ(mode_of("trifinger.robot." + id + ".action"), read_by_group | perms::group_write);
}

TEST_F(Permission, fault_31_ALockFromBeforeTheGroupWasLetInIsOpenedToIt) {
  // A back-end that was killed leaves its lock.
  const std::filesystem::path lock = folder_.path() / "trifinger.robot.lock";
  std::ofstream(lock).put('x');
  std::filesystem::permissions(lock, perms::owner_read | perms::owner_write);
  EXPECT_EQ(as_nobody(0660, 0,
                      [] {
                        Frontend<FakeRobot> robot("robot");
                        static_cast<void>(robot.append_desired_action({.setpoint = 1.0}));
                        robot.finish();
                        return 0;
                      }),
            0);
}

TEST_F(Permission, fault_31_AnotherUserIsToldWhoseTheRobotIsAndTheRemedy) {
  const auto visit = [] {
    for (const bool control : {true, false}) {
      try {
        const Frontend<FakeRobot> robot("robot", {.control = control});
        return 1;
      } catch (const SystemError& error) {
        if (!says_all(error, "/trifinger.robot.state", "0600")) return kWrongText;
      }
    }
    return kRefused;
  };
  EXPECT_EQ(as_nobody(0600, kNobody, visit), kRefused);
  EXPECT_EQ(as_nobody(0600, 0, visit), kRefused) << "the group has no rights either";
}

TEST_F(Permission, fault_31_OutsideTheGroupNothingIsShared) {
  EXPECT_EQ(as_nobody(0660, kNobody,
                      [] {
                        try {
                          const Frontend<FakeRobot> robot("robot", {.control = false});
                          return 1;
                        } catch (const SystemError& error) {
                          return says_all(error, "/trifinger.robot.state", "0640") ? kRefused
                                                                                   : kWrongText;
                        }
                      }),
            kRefused);
}

TEST_F(Permission, fault_31_WithGroupAccessAMemberControlsTheRobot) {
  EXPECT_EQ(as_nobody(0660, 0,
                      [] {
                        Frontend<FakeRobot> robot("robot");
                        TimeIndex t = 0;
                        for (int i = 0; i < 10; ++i) {
                          t = robot.append_desired_action({.setpoint = 2.0 * i});
                          static_cast<void>(robot.get_observation(t));
                        }
                        robot.finish();
                        return robot.get_desired_action(9).setpoint == 18.0 ? 0 : 1;
                      }),
            0);
}

TEST_F(Permission, fault_31_AnObserverWithoutWritePermissionReadsAllAndAppendsNothing) {
  if (!may_become_nobody()) GTEST_SKIP() << "only the administrator can become nobody";
  // The observer belongs to the group, which may only read.
  SharedValue<std::atomic<bool>> is_looking;
  ChildProcess observer([&] {
    become_nobody(0);
    const Deadline deadline(kLong);
    while (!deadline.passed()) {
      try {
        const Frontend<FakeRobot> robot("robot", {.control = false, .timeout = kLong});
        is_looking->store(true);
        // A wait without a file in which to announce it.
        if (robot.get_observation(5).applied_actions != 5) return 1;
        if (robot.get_desired_action(4).setpoint != 4.0) return 1;
        if (robot.get_applied_action(4).setpoint != 4.0) return 1;
        if (robot.get_status(4).flags != 0) return 1;
        static_cast<void>(robot.session().companion("sensor"));
        try {
          const Frontend<FakeRobot> controller("robot");
          return 2;
        } catch (const SystemError& error) {
          return says_all(error, ".action", "0640") ? kRefused : kWrongText;
        }
      } catch (const SessionNotFound&) {
        std::this_thread::yield();
      }
    }
    return 99;
  });
  const NamedRobot robot("robot", {.history = 64, .queue = 64, .mode = 0640});
  Frontend<FakeRobot> user("robot");
  const Deadline deadline(kLong);
  while (!is_looking->load() && !deadline.passed()) std::this_thread::yield();
  // Runs steps 0 to 5, and no end before the observer has finished.
  for (TimeIndex t = 0; t < 6; ++t) {
    static_cast<void>(user.append_desired_action({.setpoint = static_cast<double>(t)}));
  }
  EXPECT_EQ(observer.wait(), kRefused);
}

}  // namespace
}  // namespace trifinger::test
