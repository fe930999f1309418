// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/drivers_of_tests.hpp"
#include "core/intruder.hpp"
#include "core/named_robot.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"

// Another user of the machine may write to the folder of sessions, like everybody to /dev/shm, and
// puts files there under our names. The watchdog of the suite ends a hang.

namespace trifinger::test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

enum class Thing : std::uint8_t { kFifo, kLinkToFifo, kLinkToDevice, kFolder, kOtherUsersFile };

class HostileFiles : public ::testing::TestWithParam<Thing> {
 protected:
  void SetUp() override {
    if (GetParam() == Thing::kOtherUsersFile && ::geteuid() != 0) {
      GTEST_SKIP() << "only the administrator can make files of somebody else";
    }
  }

  [[nodiscard]] fs::path path(const std::string& name) const { return folder_.path() / name; }

  void put(const std::string& name) const {
    switch (GetParam()) {
      case Thing::kFifo:
        ASSERT_EQ(::mkfifo(path(name).c_str(), 0666), 0);
        break;
      case Thing::kLinkToFifo:
        ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0666), 0);
        fs::create_symlink("pipe", path(name));
        break;
      case Thing::kLinkToDevice:
        fs::create_symlink("/dev/zero", path(name));
        break;
      case Thing::kFolder:
        fs::create_directory(path(name));
        break;
      case Thing::kOtherUsersFile:
        std::ofstream(path(name)) << std::string(100'000, 'x');
        fs::permissions(path(name), fs::perms::all);
        ASSERT_EQ(::chown(path(name).c_str(), 12345, 12345), 0);
        break;
    }
  }

  SessionFolder folder_;
};

TEST_P(HostileFiles, fault_73_InThePlaceOfASessionHoldNobodyUp) {
  put("trifinger.x.state");
  const NamedRobot robot;
  EXPECT_THAT(message_of<SystemError>([] { return Session::open("x"); }),
              AllOf(HasSubstr("trifinger.x.state, which is "), HasSubstr(" of user ")));
  EXPECT_THROW(static_cast<void>(connect<FakeRobot>("x", {.timeout = kLong})), SystemError);
  EXPECT_THROW(recover("x"), SystemError);
  // The other sessions are unchanged.
  EXPECT_EQ(list_sessions().size(), 2U);
  EXPECT_THAT(message_of<SessionNotFound>([] { return Session::open("missing"); }),
              HasSubstr("running: robot"));
  auto user = connect<FakeRobot>("robot", {.timeout = kLong});
  run_steps<FakeDriverTraits>(user, 0, 4);
}

TEST_P(HostileFiles, fault_73_InThePlaceOfASessionAreReplacedOrNamed) {
  put("trifinger.robot.state");
  if (GetParam() == Thing::kFolder) {
    EXPECT_THAT(message_of<SystemError>([] {
                  FakeDriver driver;
                  SessionHost host = SessionHost::named("robot");
                  Backend(driver, host).begin_session();
                  return 0;
                }),
                AllOf(HasSubstr("trifinger.robot.state, which is a folder"),
                      HasSubstr("remove it, or choose another name")));
    return;
  }
  const NamedRobot robot;
  auto user = connect<FakeRobot>("robot", {.timeout = kLong});
  run_steps<FakeDriverTraits>(user, 0, 4);
}

TEST_P(HostileFiles, fault_73_InThePlaceOfALockAreNamed) {
  put("trifinger.robot.lock");
  EXPECT_THAT(message_of<SystemError>([] { return SessionHost::named("robot"); }),
              AllOf(HasSubstr("trifinger.robot.lock, which is "), HasSubstr("remove it, or")));
  EXPECT_NO_THROW(static_cast<void>(SessionHost::named("other")));
}

TEST_P(HostileFiles, fault_73_InThePlaceOfAQueueAreNamed) {
  const NamedRobot robot;
  const std::string action = action_path().filename();
  fs::remove(path(action));
  put(action);
  EXPECT_THAT(message_of<SystemError>([] { return connect<FakeRobot>("robot"); }),
              HasSubstr(action + ", which is "));
  EXPECT_TRUE(Session::open("robot").info().backend_is_alive);
}

constexpr std::array kNames{"Fifo", "LinkToFifo", "LinkToDevice", "Folder", "OtherUsersFile"};
INSTANTIATE_TEST_SUITE_P(Things, HostileFiles,
                         ::testing::Values(Thing::kFifo, Thing::kLinkToFifo, Thing::kLinkToDevice,
                                           Thing::kFolder, Thing::kOtherUsersFile),
                         [](const auto& test) {
                           return kNames.at(static_cast<std::size_t>(test.param));
                         });

}  // namespace
}  // namespace trifinger::test
