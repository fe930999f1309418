// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <cstring>

#include "core/fake_robot.hpp"
#include "harness.hpp"
#include "ipc/futex.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"

namespace trifinger::benchmarks {
namespace {

// Elements with the size of a TriFinger's, and no robot that needs them.
struct NineJoints {
  static constexpr std::string_view kType = "nine_joints";
  using Action = JointAction<9>;
  using Observation = JointObservation<9, 3>;
};
struct NineJointsDriver {
  [[nodiscard]] NineJoints::Observation get_latest_observation() const { return {}; }
  [[nodiscard]] NineJoints::Action apply_action(const NineJoints::Action& action) const {
    return action;
  }
};

// Waits for a back-end that a child process is about to start.
template <class R>
Frontend<R> connect_to_child(const std::string& name) {
  while (true) {
    try {
      return connect<R>(name);
    } catch (const SessionNotFound&) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
}

// Both sides work alike. A loop with absolute deadlines on one processor notes the time and wakes a
// process that sleeps on the other processor. That process reports how long the wake-up took.
struct WakeBoard {
  std::atomic<std::uint32_t> word;
  std::atomic<std::int64_t> time;
  std::atomic<bool> done;
};
constexpr auto kWakePeriod = std::chrono::microseconds(500);
constexpr int kWakes = 600;

double futex_wake_latency(const WakeBoard& board) {
  Samples samples;
  std::uint32_t seen = board.word.load();
  for (int i = 0; i < kWakes; ++i) {
    while (board.word.load(std::memory_order_acquire) == seen) {
      ipc::futex_wait(board.word, seen, std::chrono::milliseconds(100));
    }
    const std::int64_t now = Clock::now().time_since_epoch().count();
    seen = board.word.load(std::memory_order_acquire);
    samples.add(1e-3 * static_cast<double>(now - board.time.load()));
  }
  return samples.median();
}

// A word that two processes pass back and forth.
struct PingPong {
  std::atomic<std::uint32_t> word;
};

void hand_over(PingPong& board, std::uint32_t from, std::uint32_t to) {
  while (board.word.load(std::memory_order_acquire) != from) {
    ipc::futex_wait(board.word, to, std::chrono::milliseconds(100));
  }
  board.word.store(to, std::memory_order_release);
  ipc::futex_wake_all(board.word);
}

}  // namespace

std::vector<Row> append(const Effort& effort) {
  constexpr std::size_t kBurst = 2048;
  const std::size_t bursts = static_cast<std::size_t>(effort.rounds) + 2;
  const Child backend([bursts] {
    pin(0);
    SimpleDriver<NineJoints, NineJointsDriver> driver;
    SessionHost host = SessionHost::named("benchmark-append", {.queue = 2 * bursts * kBurst});
    // In real-time mode the back-end never sleeps until an action comes, so nobody has to be woken.
    Backend(driver, host,
            {.mode = BackendOptions::Mode::kRealTime,
             .max_action_repeats = 1000000,
             .max_skipped_ticks = 1000000})
        .run();
  });
  pin(1);
  auto robot = connect_to_child<NineJoints>("benchmark-append");
  NineJoints::Action action;
  std::vector<NineJoints::Action> copies(kBurst);

  const auto append = [&] {
    const auto begin = Clock::now();
    for (std::size_t i = 0; i < kBurst; ++i) {
      action.torque[0] = static_cast<double>(i);
      robot.append_desired_action(action);
    }
    return 1e9 * seconds_since(begin) / static_cast<double>(kBurst);
  };
  const auto copy = [&] {
    const auto begin = Clock::now();
    for (std::size_t i = 0; i < kBurst; ++i) {
      action.torque[0] = static_cast<double>(i);
      std::memcpy(&copies[i], &action, sizeof(action));
      // Keeps the compiler from removing the copy.
      asm volatile("" : : "r"(copies.data()) : "memory");
    }
    return 1e9 * seconds_since(begin) / static_cast<double>(kBurst);
  };
  const Paired paired = alternate(effort.rounds, append, copy);
  return {make_row("append across processes, nobody waiting", "ns", paired, "copy of the element",
                   "<= 80 ns", paired.measure.median() <= 80.0)};
}

std::vector<Row> wake(const Effort& effort) {
  const Shared<WakeBoard> board;
  const Child waker([&board] {
    pin(0);
    auto deadline = Clock::now();
    while (true) {
      deadline += kWakePeriod;
      MonotonicClock::instance().sleep_until(deadline);
      board->time.store(Clock::now().time_since_epoch().count());
      board->word.fetch_add(1, std::memory_order_seq_cst);
      ipc::futex_wake_all(board->word);
    }
  });
  const Child backend([] {
    pin(0);
    SimpleDriver<NineJoints, NineJointsDriver> driver;
    SessionHost host = SessionHost::named("benchmark-wake");
    Backend(driver, host,
            {.mode = BackendOptions::Mode::kRealTime,
             .period = kWakePeriod,
             .max_action_repeats = 100000000,
             .max_skipped_ticks = 1000000})
        .run();
  });
  pin(1);
  auto robot = connect_to_child<NineJoints>("benchmark-wake");
  robot.append_desired_action({});
  const auto read = [&] {
    Samples samples;
    TimeIndex t = robot.current_time_index() + 1;
    for (int i = 0; i < kWakes; ++i, ++t) {
      static_cast<void>(robot.get_observation(t));
      const std::int64_t now = Clock::now().time_since_epoch().count();
      samples.add(1e-3 * static_cast<double>(now - robot.get_status(t).time));
    }
    return samples.median();
  };
  const Paired paired = alternate(effort.rounds, read, [&] { return futex_wake_latency(*board); });
  return {make_row("blocked reader wakes on the other CPU, p50", "us", paired, "bare shared futex",
                   "<= 1.15x", paired.ratio.median() <= 1.15)};
}

std::vector<Row> loop(const Effort& effort) {
  constexpr int kSteps = 40000;
  const Shared<PingPong> board;
  const Child partner([&board] {
    pin(1);
    while (true) hand_over(*board, 1, 0);
  });
  const Child backend([] {
    pin(1);
    FakeDriver driver;
    SessionHost host = SessionHost::named("benchmark-loop");
    Backend(driver, host).run();
  });
  pin(1);
  auto robot = connect_to_child<FakeRobot>("benchmark-loop");
  TimeIndex t = robot.append_desired_action({});
  const auto loop = [&] {
    const auto begin = Clock::now();
    for (int i = 0; i < kSteps; ++i) {
      const FakeObservation y = robot.get_observation(t);
      t = robot.append_desired_action({.setpoint = y.setpoint + 1.0});
    }
    return kSteps / seconds_since(begin);
  };
  const auto ping_pong = [&] {
    const auto begin = Clock::now();
    for (int i = 0; i < kSteps; ++i) hand_over(*board, 0, 1);
    return kSteps / seconds_since(begin);
  };
  const Paired paired = alternate(effort.rounds, loop, ping_pong);
  return {make_row("loop of the fake robot across processes, one CPU", "steps/s", paired,
                   "bare futex ping-pong", ">= 200 k steps/s or >= 0.6x",
                   paired.measure.median() >= 200000.0 || paired.ratio.median() >= 0.6)};
}

std::vector<Row> inline_loop(const Effort& effort) {
  constexpr int kSteps = 500000;
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<FakeRobot> robot(backend);
  TimeIndex t = robot.append_desired_action({});
  Samples samples;
  for (int round = 0; round < effort.rounds; ++round) {
    const auto begin = Clock::now();
    for (int i = 0; i < kSteps; ++i) {
      const FakeObservation y = robot.get_observation(t);
      t = robot.append_desired_action({.setpoint = y.setpoint + 1.0});
    }
    samples.add(kSteps / seconds_since(begin));
  }
  return {make_row("inline loop of the fake robot, C++", "steps/s", samples, ">= 5 M steps/s",
                   samples.median() >= 5e6)};
}

}  // namespace trifinger::benchmarks
