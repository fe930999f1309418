// SPDX-License-Identifier: BSD-3-Clause
#include "can/memory_bus.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "can/motor_board.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::can::test {
namespace {

using std::chrono::milliseconds;
using Kind = BusFault::Kind;

class MemoryBusFaults : public ::testing::Test {
 protected:
  // Sends one frame with number `i`.
  SendResult send(std::uint8_t i, std::uint32_t id = 0x20) {
    const Frame frame{.id = id, .dlc = 1, .data = {i}};
    return board_->send({&frame, 1});
  }
  std::vector<int> received() {
    std::vector<int> numbers;
    std::array<Frame, 64> budget;
    for (const Frame& frame : host_->receive(budget)) numbers.push_back(frame.data[0]);
    return numbers;
  }

  ManualClock clock_;
  MemoryBus bus_{clock_, {.queue = 32, .seed = 1}};
  std::unique_ptr<Bus> host_ = bus_.connect();
  std::unique_ptr<Bus> board_ = bus_.connect();
};

TEST_F(MemoryBusFaults, fault_37_LosesFramesOnlyWhileTheFaultLasts) {
  const Instant start = clock_.now();
  bus_.add({.kind = Kind::kLose, .begin = start + milliseconds(2), .end = start + milliseconds(4)});
  for (std::uint8_t i = 0; i < 6; ++i) {
    send(i);
    clock_.advance(milliseconds(1));
  }
  EXPECT_EQ(received(), (std::vector{0, 1, 4, 5}));
}

TEST_F(MemoryBusFaults, fault_37_SilencesOneNodeAndOneId) {
  bus_.add({.kind = Kind::kLose, .node = 1, .id = 0x20});
  send(1, 0x20);
  send(2, 0x30);
  const Frame command{.id = 0x20};
  static_cast<void>(host_->send({&command, 1}));
  EXPECT_EQ(received(), std::vector{2});
  std::array<Frame, 4> budget;
  EXPECT_EQ(board_->receive(budget).size(), 1U);
}

TEST_F(MemoryBusFaults, fault_38_DeliversFramesTwice) {
  bus_.add({.kind = Kind::kDuplicate});
  send(1);
  send(2);
  EXPECT_EQ(received(), (std::vector{1, 1, 2, 2}));
}

TEST_F(MemoryBusFaults, fault_38_DelaysFramesPastLaterOnes) {
  bus_.add({.kind = Kind::kDelay, .id = 0x20, .delay = milliseconds(5)});
  send(1, 0x20);
  send(2, 0x30);
  EXPECT_EQ(received(), std::vector{2});
  clock_.advance(milliseconds(5));
  EXPECT_EQ(received(), std::vector{1});
}

TEST_F(MemoryBusFaults, fault_39_CorruptFramesAreStillFrames) {
  bus_.add({.kind = Kind::kCorrupt});
  const Frame sent = encode(MotorPositions{{1.0, -1.0}});
  std::array<Frame, 1> budget;
  int rejected = 0;
  for (int i = 0; i < 1000; ++i) {
    static_cast<void>(board_->send({&sent, 1}));
    const auto received = host_->receive(budget);
    ASSERT_EQ(received.size(), 1U);
    EXPECT_TRUE(received[0].is_valid());
    EXPECT_FALSE(is_same_on_wire(received[0], sent));
    const FromBoard message = decode_from_board(received[0]);
    if (std::holds_alternative<Rejection>(message)) ++rejected;
  }
  // Only ids of other messages of this length and wrong bits of data look like messages.
  EXPECT_GT(rejected, 500);
}

TEST_F(MemoryBusFaults, fault_40_RefusesWhileOffDownOrFullAndGoesOnAfterThat) {
  const Instant start = clock_.now();
  const auto during = [start](Kind kind, int begin) {
    return BusFault{.kind = kind,
                    .begin = start + milliseconds(begin),
                    .end = start + milliseconds(begin + 1),
                    .node = 1};
  };
  bus_.add(during(Kind::kBusOff, 1));
  bus_.add(during(Kind::kDown, 3));
  bus_.add(during(Kind::kQueueFull, 5));
  const std::array expected{Refusal::kNone, Refusal::kBusOff,    Refusal::kNone, Refusal::kDown,
                            Refusal::kNone, Refusal::kQueueFull, Refusal::kNone};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(send(static_cast<std::uint8_t>(i)).refusal, expected[i]) << i;
    clock_.advance(milliseconds(1));
  }
  EXPECT_EQ(received(), (std::vector{0, 2, 4, 6}));
  EXPECT_EQ(board_->state().bus_offs, 1U);
  EXPECT_EQ(board_->state().restarts, 1U);
  EXPECT_EQ(board_->state().link, Link::kUp);
  EXPECT_EQ(host_->state().bus_offs, 0U);
}

TEST_F(MemoryBusFaults, fault_40_ANodeThatIsOffHearsNothing) {
  bus_.add({.kind = Kind::kBusOff, .end = clock_.now() + milliseconds(1), .node = 0});
  send(1);
  clock_.advance(milliseconds(1));
  send(2);
  EXPECT_EQ(received(), std::vector{2});
}

TEST_F(MemoryBusFaults, fault_40_GoneIsForEver) {
  bus_.add({.kind = Kind::kGone, .begin = clock_.now(), .end = clock_.now(), .node = 1});
  clock_.advance(milliseconds(1));
  EXPECT_EQ(send(1).refusal, Refusal::kGone);
  EXPECT_EQ(board_->state().link, Link::kGone);
}

TEST_F(MemoryBusFaults, fault_41_FloodsAtItsRate) {
  bus_.add({.kind = Kind::kFlood,
            .begin = clock_.now(),
            .end = clock_.now() + milliseconds(10),
            .id = 0x555,
            .rate = 4000.0});
  std::array<Frame, 64> budget;
  clock_.advance(milliseconds(5));
  EXPECT_EQ(host_->receive(budget).size(), 20U);
  clock_.advance(milliseconds(50));
  const auto rest = host_->receive(budget);
  ASSERT_EQ(rest.size(), 20U);
  EXPECT_EQ(rest[0].id, 0x555U);
  EXPECT_EQ(host_->receive(budget).size(), 0U);
}

TEST_F(MemoryBusFaults, fault_41_CountsWhatAFloodCosts) {
  bus_.add({.kind = Kind::kFlood, .begin = clock_.now(), .rate = 1e6});
  clock_.advance(milliseconds(1000));
  std::array<Frame, 64> budget;
  const trifinger::test::AllocationCounter allocations;
  EXPECT_EQ(host_->receive(budget).size(), 32U);
  EXPECT_EQ(host_->state().lost, 1'000'000U - 32U);
  EXPECT_EQ(allocations.count(), 0U);
}

// Sends frames under every random fault and returns what arrives.
std::vector<Frame> random_run(std::uint64_t seed) {
  ManualClock clock;
  MemoryBus bus(clock, {.seed = seed});
  for (const Kind kind : {Kind::kLose, Kind::kDuplicate, Kind::kDelay, Kind::kCorrupt}) {
    bus.add({.kind = kind, .probability = 0.2, .delay = milliseconds(3)});
  }
  const auto host = bus.connect();
  const auto board = bus.connect();
  std::vector<Frame> all;
  std::array<Frame, 64> budget;
  for (std::uint8_t i = 0; i < 200; ++i) {
    const Frame frame{.id = i, .dlc = 8, .data = {i}};
    static_cast<void>(board->send({&frame, 1}));
    clock.advance(milliseconds(1));
    const auto received = host->receive(budget);
    all.insert(all.end(), received.begin(), received.end());
  }
  return all;
}

TEST(MemoryBus, IsTheSameAgainForTheSameSeed) {
  const auto same = [](const std::vector<Frame>& a, const std::vector<Frame>& b) {
    return std::ranges::equal(a, b, [](const Frame& x, const Frame& y) {
      return is_same_on_wire(x, y) && x.time == y.time;
    });
  };
  EXPECT_TRUE(same(random_run(1), random_run(1)));
  EXPECT_FALSE(same(random_run(1), random_run(2)));
}

TEST(MemoryBus, RefusesFaultsThatMakeNoSense) {
  ManualClock clock;
  MemoryBus bus(clock);
  EXPECT_THROW(bus.add({.begin = clock.now(), .end = clock.now() - milliseconds(1)}),
               InvalidArgument);
  EXPECT_THROW(bus.add({.probability = std::numeric_limits<double>::quiet_NaN()}), InvalidArgument);
  EXPECT_THROW(bus.add({.probability = 1.5}), InvalidArgument);
  EXPECT_THROW(bus.add({.kind = Kind::kDelay, .delay = milliseconds(-1)}), InvalidArgument);
  EXPECT_THROW(bus.add({.kind = Kind::kFlood, .begin = clock.now()}), InvalidArgument);
  EXPECT_THROW(bus.add({.kind = Kind::kFlood, .rate = 1.0}), InvalidArgument);
  EXPECT_THROW(MemoryBus(clock, {.queue = 0}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::can::test
