// SPDX-License-Identifier: BSD-3-Clause
// What holds for the nodes of every bus.
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <string>
#include <vector>

#include "can/nodes.hpp"
#include "support/allocation_counter.hpp"
#include "support/child_process.hpp"

namespace trifinger::can::test {
namespace {

// A frame that can be told from others.
Frame numbered(std::uint32_t number) {
  Frame frame{.id = 0x123, .dlc = 4};
  for (std::size_t i = 0; i < 4; ++i) frame.data[i] = static_cast<std::uint8_t>(number >> (8 * i));
  return frame;
}

std::uint32_t number_of(const Frame& frame) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 4; ++i) number |= std::uint32_t{frame.data[i]} << (8 * i);
  return number;
}

void send(Bus& bus, const Frame& frame) {
  const SendResult result = bus.send({&frame, 1});
  ASSERT_EQ(result.sent, 1U);
  ASSERT_EQ(result.refusal, Refusal::kNone);
}

// Receives all that waits.
std::vector<Frame> drain(Bus& bus) {
  std::vector<Frame> all;
  std::array<Frame, 100> budget;
  while (true) {
    const auto part = bus.receive(budget);
    if (part.empty()) return all;
    all.insert(all.end(), part.begin(), part.end());
  }
}

std::vector<std::uint32_t> numbers(const std::vector<Frame>& frames) {
  std::vector<std::uint32_t> result;
  result.reserve(frames.size());
  for (const Frame& frame : frames) result.push_back(number_of(frame));
  return result;
}

template <class Nodes>
class BusContract : public ::testing::Test {
 protected:
  void SetUp() override {
    try {
      for (auto& bus : buses_) bus = nodes_.connect();
    } catch (const BusUnavailable& error) {
      if (std::getenv("TRIFINGER_TEST_CAN") != nullptr) throw;  // somebody knows that it is there
      GTEST_SKIP() << error.what();
    }
    // Nodes take note of each other.
    for (auto& bus : buses_) static_cast<void>(drain(*bus));
  }

  Nodes nodes_;
  std::array<std::unique_ptr<Bus>, 3> buses_;
  std::unique_ptr<Bus>& a_ = buses_[0];
  std::unique_ptr<Bus>& b_ = buses_[1];
  std::unique_ptr<Bus>& c_ = buses_[2];
};

using AllNodes = ::testing::Types<MemoryNodes, UnixNodes, SocketPairNodes, SocketCanNodes>;
class NameOfNodes {
 public:
  template <class Nodes>
  static const char* GetName(int) {  // NOLINT(readability-identifier-naming): GoogleTest's name
    if constexpr (std::is_same_v<Nodes, MemoryNodes>) return "Memory";
    if constexpr (std::is_same_v<Nodes, UnixNodes>) return "Unix";
    if constexpr (std::is_same_v<Nodes, SocketPairNodes>) return "SocketPair";
    return "SocketCan";
  }
};
TYPED_TEST_SUITE(BusContract, AllNodes, NameOfNodes);

TYPED_TEST(BusContract, CarriesEachFrameToAllOthers) {
  std::vector<Frame> frames;
  for (std::uint8_t dlc = 0; dlc <= Frame::kMaxData; ++dlc) {
    Frame frame{.id = dlc * 255U, .dlc = dlc};
    for (std::uint8_t i = 0; i < dlc; ++i) frame.data[i] = static_cast<std::uint8_t>(0xF0 + i);
    frames.push_back(frame);
  }
  frames.push_back({.id = Frame::kMaxId});
  const SendResult result = this->a_->send(frames);
  EXPECT_EQ(result.sent, frames.size());
  EXPECT_EQ(result.refusal, Refusal::kNone);
  for (Bus* const bus : {this->b_.get(), this->c_.get()}) {
    const auto received = drain(*bus);
    ASSERT_EQ(received.size(), frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      EXPECT_TRUE(is_same_on_wire(received[i], frames[i])) << i;
    }
    EXPECT_EQ(bus->state().received, frames.size());
  }
  EXPECT_TRUE(drain(*this->a_).empty());
  EXPECT_EQ(this->a_->state().sent, frames.size());
}

TYPED_TEST(BusContract, KeepsTheOrderOfEachSender) {
  std::vector<std::uint32_t> even;
  std::vector<std::uint32_t> odd;
  for (std::uint32_t i = 0; i < 100; i += 2) {
    send(*this->a_, numbered(i));
    send(*this->b_, numbered(i + 1));
    even.push_back(i);
    odd.push_back(i + 1);
  }
  std::vector<std::uint32_t> received_even;
  std::vector<std::uint32_t> received_odd;
  for (const std::uint32_t number : numbers(drain(*this->c_))) {
    (number % 2 == 0 ? received_even : received_odd).push_back(number);
  }
  EXPECT_EQ(received_even, even);
  EXPECT_EQ(received_odd, odd);
}

TYPED_TEST(BusContract, TellsWhenAFrameArrivedAndNotWhenItWasRead) {
  const Instant before = this->nodes_.now();
  EXPECT_TRUE(drain(*this->b_).empty());
  this->nodes_.pass();
  send(*this->a_, numbered(1));
  const Instant sent = this->nodes_.now();
  this->nodes_.pass();
  const auto frames = drain(*this->b_);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_GE(frames[0].time, before);
  EXPECT_LE(frames[0].time, sent);
}

TYPED_TEST(BusContract, fault_41_ReceivesNoMoreThanItsBudgetAndSaysSo) {
  for (std::uint32_t i = 0; i < 100; ++i) send(*this->a_, numbered(i));
  std::array<Frame, 70> budget;
  EXPECT_EQ(this->b_->receive(budget).size(), 70U);
  EXPECT_EQ(this->b_->state().overloads, 1U);
  const auto rest = this->b_->receive(budget);
  EXPECT_EQ(rest.size(), 30U);
  EXPECT_EQ(number_of(rest.front()), 70U);
  EXPECT_EQ(this->b_->state().overloads, 1U);
}

TYPED_TEST(BusContract, fault_41_HearsTheOthersInAFlood) {
  for (std::uint32_t i = 0; i < 200; ++i) send(*this->a_, numbered(i));
  send(*this->c_, numbered(1000));
  bool is_heard = false;
  std::array<Frame, 16> budget;
  for (int tick = 0; tick < 20 && !is_heard; ++tick) {
    // Each tick brings as many frames as the budget takes.
    for (std::uint32_t i = 0; i < budget.size(); ++i) send(*this->a_, numbered(i));
    for (const Frame& frame : this->b_->receive(budget)) is_heard |= number_of(frame) == 1000;
  }
  EXPECT_TRUE(is_heard);
}

TYPED_TEST(BusContract, fault_37_CountsWhatANodeLosesThatIsNotReceiving) {
  constexpr std::uint32_t kCount = 5000;
  std::uint32_t received_by_c = 0;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    send(*this->a_, numbered(i));
    if (i % 10 == 0) received_by_c += static_cast<std::uint32_t>(drain(*this->c_).size());
  }
  received_by_c += static_cast<std::uint32_t>(drain(*this->c_).size());
  // The slow node costs the others nothing.
  EXPECT_EQ(received_by_c, kCount);
  EXPECT_EQ(this->c_->state().lost, 0U);

  const auto first = drain(*this->b_);
  // The next frame tells how many are missing.
  send(*this->a_, numbered(kCount));
  const auto last = drain(*this->b_);
  ASSERT_EQ(last.size(), 1U);
  EXPECT_EQ(number_of(last[0]), kCount);
  EXPECT_GT(this->b_->state().lost, 0U);
  EXPECT_EQ(first.size() + 1 + this->b_->state().lost, kCount + 1);
  EXPECT_EQ(this->b_->state().received, first.size() + 1);
}

TYPED_TEST(BusContract, SendsNothingFromAnInvalidFrameOn) {
  const std::array too_high{numbered(1), Frame{.id = Frame::kMaxId + 1}, numbered(2)};
  const std::array too_long{Frame{.dlc = 9}, numbered(3)};
  SendResult result = this->a_->send(too_high);
  EXPECT_EQ(result.sent, 1U);
  EXPECT_EQ(result.refusal, Refusal::kInvalidFrame);
  result = this->a_->send(too_long);
  EXPECT_EQ(result.sent, 0U);
  EXPECT_EQ(result.refusal, Refusal::kInvalidFrame);
  EXPECT_EQ(numbers(drain(*this->b_)), std::vector<std::uint32_t>{1});
}

TYPED_TEST(BusContract, DoesNothingForNothing) {
  send(*this->a_, numbered(1));
  EXPECT_TRUE(this->b_->receive({}).empty());
  EXPECT_EQ(this->b_->state().overloads, 0U);
  const SendResult result = this->b_->send({});
  EXPECT_EQ(result.sent, 0U);
  EXPECT_EQ(result.refusal, Refusal::kNone);
  EXPECT_EQ(drain(*this->b_).size(), 1U);
}

TYPED_TEST(BusContract, NodesComeAndGo) {
  this->c_.reset();
  send(*this->a_, numbered(1));
  this->c_ = this->nodes_.connect();
  send(*this->a_, numbered(2));
  send(*this->c_, numbered(3));
  EXPECT_EQ(numbers(drain(*this->c_)), std::vector<std::uint32_t>{2});
  auto received = numbers(drain(*this->b_));
  std::ranges::sort(received);
  EXPECT_EQ(received, (std::vector<std::uint32_t>{1, 2, 3}));
  EXPECT_EQ(numbers(drain(*this->a_)), std::vector<std::uint32_t>{3});
}

TYPED_TEST(BusContract, WhatANodeSentBeforeItLeftArrives) {
  for (std::uint32_t i = 0; i < 100; ++i) send(*this->a_, numbered(i));
  this->a_.reset();
  send(*this->b_, numbered(1000));
  EXPECT_EQ(drain(*this->b_).size(), 100U);
  EXPECT_EQ(drain(*this->c_).size(), 101U);
}

TYPED_TEST(BusContract, AllocatesNothing) {
  std::array<Frame, 150> frames;
  frames.fill(numbered(7));
  const trifinger::test::AllocationCounter allocations;
  static_cast<void>(this->a_->send(frames));
  static_cast<void>(this->b_->receive(frames));
  static_cast<void>(this->b_->receive(frames));
  EXPECT_EQ(allocations.count(), 0U);
}

TYPED_TEST(BusContract, IsGoneForAForkedChild) {
  trifinger::test::ChildProcess child([this] {
    const Frame frame = numbered(1);
    const bool is_gone = this->a_->send({&frame, 1}).refusal == Refusal::kGone &&
                         drain(*this->a_).empty() && this->a_->state().link == Link::kGone;
    return is_gone ? 0 : 1;
  });
  EXPECT_EQ(child.wait(), 0);
  send(*this->a_, numbered(2));
  EXPECT_EQ(numbers(drain(*this->b_)), std::vector<std::uint32_t>{2});
}

}  // namespace
}  // namespace trifinger::can::test
