// SPDX-License-Identifier: BSD-3-Clause
#include "can/scripted_bus.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "can/unix_bus.hpp"
#include "support/allocation_counter.hpp"
#include "support/session_folder.hpp"

namespace trifinger::can::test {
namespace {

using namespace std::chrono_literals;
using Kind = BusFault::Kind;

// A board whose bus has a script, and a host, on a bus between processes.
class ScriptedBusTest : public ::testing::Test {
 protected:
  static std::vector<int> received(Bus& bus) {
    std::vector<int> numbers;
    std::array<Frame, 64> budget;
    for (const Frame& frame : bus.receive(budget)) numbers.push_back(frame.data[0]);
    return numbers;
  }
  static SendResult send(Bus& bus, const std::vector<std::uint8_t>& numbers) {
    std::vector<Frame> frames;
    frames.reserve(numbers.size());
    for (const std::uint8_t number : numbers) {
      frames.push_back({.id = 0x20, .dlc = 1, .data = {number}});
    }
    return bus.send(frames);
  }
  // Lets the board's node do its work at this time.
  std::vector<int> tick(Nanoseconds time) {
    board_.set_time(start_ + time);
    std::vector<int> numbers = received(board_);
    static_cast<void>(board_.send({}));
    return numbers;
  }

  trifinger::test::SessionFolder folder_;
  Instant start_{10s};
  std::unique_ptr<UnixBus> host_ = join_unix_bus(folder_.path() / "bus");
  ScriptedBus board_{join_unix_bus(folder_.path() / "bus")};
};

TEST_F(ScriptedBusTest, WithoutFaultsEveryFramePassesInBothDirectionsAndInOrder) {
  board_.set_time(start_);
  EXPECT_EQ(send(board_, {1, 2, 3}).sent, 3U);
  EXPECT_EQ(received(*host_), (std::vector{1, 2, 3}));
  EXPECT_EQ(send(*host_, {4, 5}).sent, 2U);
  EXPECT_EQ(tick(1ms), (std::vector{4, 5}));
}

TEST_F(ScriptedBusTest, fault_37_LosesWhatTheBoardOrTheOthersSend) {
  board_.add({.kind = Kind::kLose, .begin = start_, .end = start_ + 1ms, .node = 0});
  board_.add({.kind = Kind::kLose, .begin = start_ + 2ms, .end = start_ + 3ms, .node = 1});
  board_.set_time(start_);
  send(board_, {1});
  send(*host_, {2});
  EXPECT_EQ(tick(0ms), std::vector{2});
  EXPECT_TRUE(received(*host_).empty());
  board_.set_time(start_ + 2ms);
  send(board_, {3});
  send(*host_, {4});
  EXPECT_TRUE(tick(2ms).empty());
  EXPECT_EQ(received(*host_), std::vector{3});
}

TEST_F(ScriptedBusTest, fault_38_WhatIsDelayedComesInALaterTick) {
  board_.add({.kind = Kind::kDelay, .begin = start_, .end = start_ + 1ms, .delay = 3ms});
  board_.set_time(start_);
  send(board_, {1, 2, 3, 4, 5, 6, 7, 8});
  std::vector<int> all = received(*host_);
  EXPECT_LT(all.size(), 8U);
  tick(3ms);
  const std::vector<int> late = received(*host_);
  EXPECT_EQ(all.size() + late.size(), 8U);
}

TEST_F(ScriptedBusTest, fault_40_TheOthersLearnWhatHasBecomeOfTheirLink) {
  const std::array cases{std::pair{Kind::kBusOff, std::pair{Link::kBusOff, Refusal::kBusOff}},
                         std::pair{Kind::kDown, std::pair{Link::kDown, Refusal::kDown}}};
  Nanoseconds time{};
  for (const auto& [kind, expected] : cases) {
    board_.add({.kind = kind, .begin = start_ + time, .end = start_ + time + 2ms});
    tick(time);
    EXPECT_TRUE(received(*host_).empty());
    EXPECT_EQ(host_->state().link, expected.first);
    EXPECT_EQ(send(*host_, {1}).refusal, expected.second);
    // Whoever comes now learns it, too.
    const auto newcomer = join_unix_bus(folder_.path() / "bus");
    tick(time + 1ms);
    static_cast<void>(received(*newcomer));
    EXPECT_EQ(newcomer->state().link, expected.first);
    time += 2ms;
    tick(time);
    static_cast<void>(received(*host_));
    EXPECT_EQ(host_->state().link, Link::kUp);
    EXPECT_EQ(send(*host_, {1}).refusal, Refusal::kNone);
    EXPECT_EQ(tick(time), std::vector{1});
  }
  EXPECT_EQ(host_->state().bus_offs, 1U);
  EXPECT_EQ(host_->state().restarts, 1U);
  EXPECT_EQ(host_->state().invalid, 0U);
}

TEST_F(ScriptedBusTest, AllocatesNothing) {
  board_.add({.kind = Kind::kDuplicate, .begin = start_, .probability = 0.5});
  board_.set_time(start_);
  std::array<Frame, 64> budget;
  const Frame frame{.id = 1};
  const trifinger::test::AllocationCounter counter;
  for (int i = 0; i < 50; ++i) {
    board_.set_time(start_ + i * 1ms);
    static_cast<void>(board_.send({&frame, 1}));
    static_cast<void>(host_->receive(budget));
    static_cast<void>(host_->send({&frame, 1}));
    static_cast<void>(board_.receive(budget));
  }
  EXPECT_EQ(counter.count(), 0U);
}

}  // namespace
}  // namespace trifinger::can::test
