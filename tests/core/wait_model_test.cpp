// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <array>
#include <compare>
#include <cstdint>
#include <functional>
#include <set>
#include <vector>

// A model of who waits for whom in a session (docs/decisions/waiting.md). Two threads access shared
// memory, and every order of their accesses is tried. Stress tests check what orders the accesses
// on a machine: seq_cst.

namespace trifinger::test {
namespace {

constexpr std::int8_t kElements = 4;

// Everything that two threads share, and their positions. A waiter sleeps if and only if it is
// asleep.
struct State {
  std::int8_t end{0};     // elements written so far
  std::int8_t event{0};   // the word that the waiter sleeps on
  std::int8_t slot{0};    // the waiter has said that it waits
  std::int8_t seen{0};    // the waiter's own: value of the word before it looked
  std::int8_t read{0};    // the waiter's own: number of elements that it has
  std::int8_t waiter{0};  // next access of the waiter
  std::int8_t writer{0};  // next access of the writer
  bool is_asleep{false};

  friend auto operator<=>(const State&, const State&) = default;
};

// Does one access; returns false if the thread is at its end.
using Thread = std::function<bool(State&)>;

// Waits for every element. Readers look for it first and then say that they wait. Back-ends say
// that they wait for an action first, and look afterwards.
Thread wait(bool says_it_first) {
  return [says_it_first](State& state) {
    const auto look = [&] {
      if (state.end == state.read) return;
      ++state.read;
      state.slot = 0;
      state.waiter = -1;  // start over
    };
    switch (state.waiter) {
      case 0:
        if (state.read == kElements) return false;
        state.seen = state.event;
        break;
      case 1:
      case 2:
        if ((state.waiter == 1) == says_it_first) {
          state.slot = 1;
        } else {
          look();
        }
        break;
      case 3:  // the futex compares and sleeps in one operation
        state.is_asleep = state.event == state.seen;
        break;
      default:
        state.slot = 0;
        state.waiter = -1;
    }
    ++state.waiter;
    return true;
  };
}

enum class Access : std::uint8_t { kWrite, kCountUp, kLookAndWake };

// A writer that does these accesses for every element, in this order.
Thread write(const std::array<Access, 3>& order) {
  return [order](State& state) {
    constexpr auto kLast = static_cast<std::int8_t>(3 * kElements);
    if (state.writer == kLast) return false;
    switch (order[static_cast<std::size_t>(state.writer % 3)]) {
      case Access::kWrite:
        ++state.end;
        break;
      case Access::kCountUp:
        ++state.event;
        break;
      case Access::kLookAndWake:
        if (state.slot != 0) state.is_asleep = false;
        break;
    }
    ++state.writer;
    return true;
  };
}

// Number of states, and number of states from which the waiter can only stay asleep.
struct Found {
  std::size_t states{0};
  std::size_t lost_wakes{0};
};

Found try_every_order(const Thread& waiter, const Thread& writer) {
  Found found;
  std::set<State> known{State{}};
  std::vector<State> open{State{}};
  while (!open.empty()) {
    const State state = open.back();
    open.pop_back();
    ++found.states;
    const auto add = [&](const State& next) {
      if (known.insert(next).second) open.push_back(next);
    };
    State next = state;
    const bool has_writer_moved = writer(next);
    if (has_writer_moved) add(next);
    if (state.is_asleep) {
      if (!has_writer_moved) ++found.lost_wakes;
      continue;
    }
    next = state;
    if (waiter(next)) add(next);
  }
  return found;
}

class WaitModel : public ::testing::TestWithParam<bool> {};

TEST_P(WaitModel, fault_36_NoOrderOfAccessesLosesAWake) {
  const Found found = try_every_order(
      wait(GetParam()), write({Access::kWrite, Access::kCountUp, Access::kLookAndWake}));
  EXPECT_GT(found.states, 100U);
  EXPECT_EQ(found.lost_wakes, 0U);
}

TEST_P(WaitModel, FindsTheWakeThatAnotherProtocolLoses) {
  for (const auto& order : {std::array{Access::kWrite, Access::kLookAndWake, Access::kCountUp},
                            std::array{Access::kCountUp, Access::kLookAndWake, Access::kWrite}}) {
    EXPECT_GT(try_every_order(wait(GetParam()), write(order)).lost_wakes, 0U);
  }
}

INSTANTIATE_TEST_SUITE_P(Waiters, WaitModel, ::testing::Values(false, true),
                         [](const auto& test) { return test.param ? "Backend" : "Reader"; });

}  // namespace
}  // namespace trifinger::test
