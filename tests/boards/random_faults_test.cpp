// SPDX-License-Identifier: BSD-3-Clause
// Random faults of buses and boards beside hostile actions. Whatever happens, no joint is driven
// fast, every fault has a name, and the robot recovers.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "rig.hpp"
#include "support/soak.hpp"

namespace trifinger::boards::test {
namespace {

using namespace std::chrono_literals;
using State = DriverReport::State;
using Kind = can::BusFault::Kind;

class Chaos {
 public:
  explicit Chaos(unsigned seed) : random_(seed) {}

  // Does something bad that is over after a tenth of a second.
  void harm(Rig<TriFinger>& rig) {
    const std::size_t board = pick(6);
    const Instant now = rig.clock.now();
    const Instant end = now + 1ms * (1 + static_cast<int>(pick(100)));
    const Kind kinds[] = {Kind::kLose,  Kind::kDuplicate, Kind::kDelay,  Kind::kCorrupt,
                          Kind::kFlood, Kind::kQueueFull, Kind::kBusOff, Kind::kDown};
    const std::size_t choice = pick(std::size(kinds) + 3);
    if (choice < std::size(kinds)) {
      can::BusFault fault{.kind = kinds[choice], .begin = now, .end = end};
      if (pick(2) == 0) fault.probability = 0.3;
      if (fault.kind == Kind::kDelay) fault.delay = 4ms;
      // The checksum of CAN leaves only senders that are broken: a board.
      if (fault.kind == Kind::kCorrupt) fault.node = 1;
      if (fault.kind == Kind::kFlood) fault.rate = 20'000;
      rig.buses[board]->add(fault);
    } else if (choice == std::size(kinds)) {
      rig.emulator->set_power(board, false, now);
    } else if (choice == std::size(kinds) + 1) {
      rig.emulator->set_power(false, now);
    } else {
      rig.emulator->board(board).fail(static_cast<can::BoardError>(2 + pick(6)));
    }
  }

  TriFinger::Action action() {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const double values[] = {0.0, 0.36, -0.36, 1e9, -1e9, kInfinity, std::nan(""), 0.1};
    TriFinger::Action action;
    for (std::size_t i = 0; i < 9; ++i) {
      action.torque[i] = values[pick(std::size(values))];
      if (pick(3) == 0) action.position[i] = values[pick(std::size(values))];
    }
    return action;
  }

  std::size_t pick(std::size_t count) {
    return std::uniform_int_distribution<std::size_t>(0, count - 1)(random_);
  }

 private:
  std::mt19937 random_;
};

void expect_bounded(Rig<TriFinger>& rig) {
  for (std::size_t board = 0; board < rig.emulator->num_boards(); ++board) {
    for (const double current : rig.emulator->board(board).currents()) {
      ASSERT_LE(std::abs(current), rig.robot->options().max_current + 1e-6);
    }
  }
  for (const double velocity : rig.joints.velocity()) ASSERT_LT(std::abs(velocity), 10.0);
}

class RandomFaults : public ::testing::TestWithParam<unsigned> {};

TEST_P(RandomFaults, AreNamedAndTheRobotRecovers) {
  for (trifinger::test::Rounds rounds(10, 10min); rounds.next();) {
    Chaos chaos(GetParam() * 100'000 + static_cast<unsigned>(rounds.index()));
    SCOPED_TRACE(rounds.index());
    Rig<TriFinger> rig;
    ASSERT_EQ(rig.prepare().state, State::kReady);
    TriFinger::Action action;
    for (int i = 0; i < 400; ++i) {
      if (i == 100) chaos.harm(rig);
      if (i % 7 == 0) action = chaos.action();
      const DriverReport report = rig.step(action);
      ASSERT_NO_FATAL_FAILURE(expect_bounded(rig));
      if (report.state != State::kFault) continue;
      const std::string text(rig.robot->fault_text(report.fault_code));
      EXPECT_TRUE(text.starts_with("board ") || text.starts_with("joint ")) << text;
      break;
    }
    for (TimeIndex i = 0; rig.robot->stop(i).state == State::kBusy; ++i) {
      rig.pass();
      ASSERT_NO_FATAL_FAILURE(expect_bounded(rig));
    }
    // What was bad is over.
    for (int i = 0; i < 200; ++i) rig.pass();
    rig.emulator->set_power(true, rig.clock.now());
    // Whoever recovers at once meets what the boards have to say of before.
    DriverReport report = rig.prepare();
    for (int attempt = 0; attempt < 3 && report.state == State::kFault; ++attempt) {
      for (TimeIndex i = 0; rig.robot->stop(i).state == State::kBusy; ++i) rig.pass();
      report = rig.prepare();
    }
    ASSERT_EQ(report.state, State::kReady) << rig.robot->fault_text(report.fault_code);
    report = rig.step({});
    ASSERT_EQ(report.state, State::kReady) << rig.robot->fault_text(report.fault_code);
    const auto truth = rig.joints.position();
    for (std::size_t i = 0; i < 9; ++i) {
      EXPECT_NEAR(rig.observation.position[i], truth[i], 0.02) << "joint " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomFaults, ::testing::Range(1U, 5U));

}  // namespace
}  // namespace trifinger::boards::test
