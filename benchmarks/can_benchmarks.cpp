// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <vector>

#include "harness.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/can/memory_bus.hpp"
#include "trifinger/can/motor_board.hpp"

namespace trifinger::benchmarks {
namespace {

constexpr std::size_t kBoards = 6;
constexpr std::size_t kTicks = 200;  // As many as the inboxes hold.

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
  const Paired paired = alternate(effort.rounds, exchange, copy);
  return {make_row("CAN in memory, a tick of six boards: 24 frames in, 6 out", "ns", paired,
                   "copy of the same frames", "<= 5 us, 0 allocations",
                   paired.measure.median() <= 5000.0 && allocations == 0)};
}

}  // namespace trifinger::benchmarks
