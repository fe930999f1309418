// SPDX-License-Identifier: BSD-3-Clause
#include "can/unix_bus.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <fstream>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "support/nobody.hpp"
#include "support/session_folder.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::can::test {
namespace {

using ::testing::HasSubstr;
using trifinger::test::ChildProcess;
using trifinger::test::message_of;

class UnixBusTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<Bus> join() const { return join_unix_bus(path_); }
  [[nodiscard]] std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(path_)) {
      names.insert(entry.path().filename());
    }
    return names;
  }

  trifinger::test::SessionFolder folder_;
  // Longer than the address of a socket may be.
  std::filesystem::path path_ = folder_.path() / std::string(150, 'b');
};

// Receives until `count` frames have come.
std::vector<Frame> await(Bus& bus, std::size_t count) {
  std::vector<Frame> all;
  std::array<Frame, 64> budget;
  while (all.size() < count) {
    const auto part = bus.receive(budget);
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

// A process that joins the bus and sends back each frame that it receives, with another id.
class Echo {
 public:
  explicit Echo(const std::filesystem::path& path, std::uint32_t id)
      : child_([path, id] {
          const auto bus = join_unix_bus(path);
          const Frame hello{.id = id};
          static_cast<void>(bus->send({&hello, 1}));
          while (true) {
            Frame frame = await(*bus, 1).front();
            if (frame.id != 1) continue;
            frame.id = id;
            static_cast<void>(bus->send({&frame, 1}));
          }
          return 0;
        }) {}
  ChildProcess& process() noexcept { return child_; }

 private:
  ChildProcess child_;
};

TEST_F(UnixBusTest, CarriesFramesBetweenProcesses) {
  Echo first(path_, 0x10);
  Echo second(path_, 0x20);
  const auto bus = join();
  // Both may have joined before or after us. Each answers until it is heard.
  std::set<std::uint32_t> heard;
  std::array<Frame, 64> budget;
  while (heard.size() < 2) {
    const Frame frame{.id = 1, .dlc = 1, .data = {42}};
    static_cast<void>(bus->send({&frame, 1}));
    for (const Frame& answer : bus->receive(budget)) {
      if (answer.data[0] == 42) heard.insert(answer.id);
    }
  }
  EXPECT_EQ(heard, (std::set<std::uint32_t>{0x10, 0x20}));
}

TEST_F(UnixBusTest, fault_37_AStoppedOrKilledNodeCostsTheOthersNothing) {
  const auto host = join();
  const auto board = join();
  Echo other(path_, 0x10);
  EXPECT_EQ(await(*host, 1).front().id, 0x10U);
  EXPECT_EQ(await(*board, 1).front().id, 0x10U);
  other.process().send(SIGSTOP);
  constexpr int kCount = 3000;
  const Frame frame{.id = 5};
  for (int i = 0; i < kCount; ++i) {
    ASSERT_EQ(host->send({&frame, 1}).sent, 1U);
    ASSERT_EQ(await(*board, 1).size(), 1U);
    if (i == kCount / 2) other.process().kill();
  }
  EXPECT_EQ(board->state().lost, 0U);
}

TEST_F(UnixBusTest, WhatAKilledNodeLeavesIsReplacedByTheNext) {
  {
    Echo killed(path_, 0x10);
    const auto bus = join();
    const Frame frame{.id = 1};
    std::array<Frame, 4> budget;
    while (bus->receive(budget).empty()) static_cast<void>(bus->send({&frame, 1}));
  }
  EXPECT_EQ(files().size(), 2U);  // the lock and what the killed one left
  const auto bus = join();
  EXPECT_EQ(files(), (std::set<std::string>{"lock", "node.0"}));
}

TEST_F(UnixBusTest, fault_80_LeavesNothingWhenAllNodesHaveLeft) {
  for (int i = 0; i < 20; ++i) {
    auto first = join();
    auto second = join();
    first.reset();
    EXPECT_EQ(files(), (std::set<std::string>{"lock", "node.1"}));
    // Both orders, and both at once.
    std::thread other([&second] { second.reset(); });
    auto third = join();
    third.reset();
    other.join();
    EXPECT_FALSE(std::filesystem::exists(path_));
  }
}

TEST_F(UnixBusTest, HasRoomForManyNodesAndRefusesMore) {
  std::vector<std::unique_ptr<Bus>> nodes;
  nodes.reserve(kMaxUnixNodes);
  for (std::size_t i = 0; i < kMaxUnixNodes; ++i) nodes.push_back(join());
  EXPECT_THAT(message_of<InvalidArgument>([this] { return join(); }),
              HasSubstr("already has 64 nodes"));
  const Frame frame{.id = 7};
  static_cast<void>(nodes.front()->send({&frame, 1}));
  std::array<Frame, 4> budget;
  for (std::size_t i = 1; i < nodes.size(); ++i) EXPECT_EQ(nodes[i]->receive(budget).size(), 1U);
}

TEST_F(UnixBusTest, ANodeThatOnlySendsMeetsNewcomersForEver) {
  const auto sender = join();
  const Frame frame{.id = 7};
  std::array<Frame, 4> budget;
  for (std::size_t i = 0; i < 2 * kMaxUnixNodes; ++i) {
    const auto newcomer = join();
    static_cast<void>(sender->send({&frame, 1}));
    ASSERT_EQ(newcomer->receive(budget).size(), 1U) << i;
  }
}

TEST_F(UnixBusTest, RefusesAFolderInWhichOthersMayWrite) {
  std::filesystem::create_directory(path_);
  ASSERT_EQ(::chmod(path_.c_str(), 0777), 0);
  EXPECT_THAT(message_of<SystemError>([this] { return join(); }),
              HasSubstr("other users may write; change that with 'chmod go-w'"));
}

TEST_F(UnixBusTest, RefusesAFolderOfAnotherUser) {
  if (!trifinger::test::may_become_nobody()) GTEST_SKIP() << "needs the administrator";
  std::filesystem::create_directory(path_);
  ASSERT_EQ(::chown(path_.c_str(), trifinger::test::kNobody, trifinger::test::kNobody), 0);
  EXPECT_THAT(message_of<SystemError>([this] { return join(); }),
              HasSubstr("belongs to user nobody; let nobody or the administrator remove it"));
}

TEST_F(UnixBusTest, RefusesALinkInPlaceOfTheFolder) {
  const auto target = folder_.path() / "target";
  std::filesystem::create_directory(target);
  std::filesystem::create_directory_symlink(target, path_);
  EXPECT_THROW(static_cast<void>(join()), SystemError);
}

TEST_F(UnixBusTest, RemovesNoFileThatIsNotItsOwn) {
  std::filesystem::create_directory(path_);
  std::ofstream(path_ / "node.3") << "a letter";
  EXPECT_THROW(static_cast<void>(join()), SystemError);
  EXPECT_TRUE(std::filesystem::exists(path_ / "node.3"));
}

TEST_F(UnixBusTest, fault_80_IsRemovedByItsLastNodeAlsoFromAnotherFolder) {
  ChildProcess child([this] {
    std::filesystem::current_path(folder_.path());
    auto bus = join_unix_bus("bus");
    std::filesystem::current_path("/");
    bus.reset();
    return 0;
  });
  EXPECT_EQ(child.wait(), 0);
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "bus"));
}

TEST_F(UnixBusTest, LeavesTheFolderThatItHasNotMade) {
  std::filesystem::create_directory(path_);
  join().reset();
  EXPECT_TRUE(std::filesystem::exists(path_));
  EXPECT_TRUE(files().empty());
}

TEST_F(UnixBusTest, NobodyElseMayConnect) {
  const auto bus = join();
  struct stat status{};
  ASSERT_EQ(::stat((path_ / "node.0").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  ASSERT_EQ(::stat(path_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0700U);
}

}  // namespace
}  // namespace trifinger::can::test
