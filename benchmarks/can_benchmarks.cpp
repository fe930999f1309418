// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <vector>

#include "boards/rig.hpp"
#include "can/memory_bus.hpp"
#include "can/motor_board.hpp"
#include "harness.hpp"
#include "support/allocation_counter.hpp"

namespace trifinger::benchmarks {
namespace {

constexpr std::size_t kBoards = 6;
constexpr std::size_t kTicks = 200;  // The inboxes hold so many.

// A board and its host on their bus.
struct Pair {
  can::MemoryBus bus{MonotonicClock::instance()};
  std::unique_ptr<can::Bus> host{bus.connect()};
  std::unique_ptr<can::Bus> board{bus.connect()};

  void send_measurements() const {
    const std::array frames{encode(can::MotorCurrents{}), encode(can::MotorPositions{{0.5, -0.5}}),
                            encode(can::MotorVelocities{}), encode(can::AnalogInputs{})};
    static_cast<void>(board->send(frames));
  }
  void clear() const {
    std::array<can::Frame, 64> frames;
    while (!board->receive(frames).empty()) {
    }
  }
};

// One tick of a host. Returns something that depends on all that was received.
double tick(const Pair& pair, double current) {
  std::array<can::Frame, 8> budget;
  double sum = 0.0;
  for (const can::Frame& frame : pair.host->receive(std::span(budget).first(4))) {
    const can::FromBoard message = decode_from_board(frame);
    if (const auto* const positions = std::get_if<can::MotorPositions>(&message)) {
      sum += positions->revolutions[0];
    }
  }
  const can::Frame frame = encode(can::DesiredCurrents{{current, -current}});
  static_cast<void>(pair.host->send({&frame, 1}));
  return sum;
}

// A tick of the driver of a TriFinger on emulated boards, without the emulator's part.
class DriverTick {
 public:
  DriverTick() { is_ready_ = rig_.prepare().state == DriverReport::State::kReady; }

  // Returns the time of a tick [ns].
  double operator()() {
    double time = 0.0;
    for (std::size_t i = 0; i < kTicks; ++i) {
      rig_.pass();
      const test::AllocationCounter counter;
      const auto begin = Clock::now();
      static_cast<void>(rig_.robot->get_latest_observation(&rig_.observation));
      const DriverReport report = rig_.robot->apply_action(&action_, &rig_.applied);
      time += 1e9 * seconds_since(begin);
      allocations_ += counter.count();
      is_ready_ = is_ready_ && report.state == DriverReport::State::kReady;
    }
    return time / kTicks;
  }
  // True if it has always worked and has never allocated.
  [[nodiscard]] bool is_clean() const { return is_ready_ && allocations_ == 0; }

 private:
  boards::test::Rig<TriFinger> rig_;
  TriFinger::Action action_{hold_position(TriFinger::Observation{.position = positions()})};
  std::size_t allocations_{0};
  bool is_ready_{false};

  static JointVector<9> positions() {
    JointVector<9> values{};
    values.fill(0.3);
    return values;
  }
};

}  // namespace

std::vector<Row> can_frames(const Effort& effort) {
  const std::array<Pair, kBoards> pairs;
  std::size_t allocations = 0;
  const auto exchange = [&] {
    for (const Pair& pair : pairs) {
      pair.clear();
      for (std::size_t i = 0; i < kTicks; ++i) pair.send_measurements();
    }
    const test::AllocationCounter counter;
    double current = 0.0;
    const auto begin = Clock::now();
    for (std::size_t i = 0; i < kTicks; ++i) {
      for (const Pair& pair : pairs) current = 0.1 * tick(pair, current);
    }
    const double time = 1e9 * seconds_since(begin) / kTicks;
    allocations += counter.count();
    return time;
  };
  std::array<can::Frame, 5 * kBoards> frames{};
  std::array<can::Frame, 5 * kBoards> copies{};
  const auto copy = [&] {
    const auto begin = Clock::now();
    for (std::size_t i = 0; i < kTicks; ++i) {
      std::memcpy(copies.data(), frames.data(), sizeof(frames));
      // Keeps the compiler from removing the copy.
      asm volatile("" : : "r"(copies.data()) : "memory");
    }
    return 1e9 * seconds_since(begin) / kTicks;
  };
  DriverTick driver_tick;
  const Paired driver = alternate(effort.rounds, [&] { return driver_tick(); }, copy);
  const Paired paired = alternate(effort.rounds, exchange, copy);
  return {make_row("driver of a TriFinger, a tick of six boards: 24 frames in, 6 out, all checks",
                   "ns", driver, "copy of the same frames", "<= 15 us, 0 allocations",
                   driver.measure.median() <= 15'000.0 && driver_tick.is_clean()),
          make_row("CAN in memory, a tick of six boards: 24 frames in, 6 out", "ns", paired,
                   "copy of the same frames", "<= 5 us, 0 allocations",
                   paired.measure.median() <= 5000.0 && allocations == 0)};
}

}  // namespace trifinger::benchmarks
