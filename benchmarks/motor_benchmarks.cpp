// SPDX-License-Identifier: BSD-3-Clause
// D'Claw's motors at a pseudo-terminal, with its simulation behind them.
#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "dynamixel/emulator.hpp"
#include "dynamixel/motor_loop.hpp"
#include "dynamixel/port.hpp"
#include "harness.hpp"
#include "sim/servo_plant.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/realtime/thread.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::benchmarks {
namespace {

using namespace std::chrono_literals;
using dynamixel::MotorSnapshot;

constexpr int kBaud = 4'000'000;

// A file that has D'Claw's motors, without the one of its valve.
RobotConfig nine_motors(bool is_fast) {
  auto config = load_robot_config(
      "dclaw_dynamixel", {"dynamixel.port=emulated", "dynamixel.baud=" + std::to_string(kBaud)});
  servos::ServoConfig servos = *config.servos;
  servos.group.watchdog = 2s;
  servos.group.silent_after = 2s;
  servos.group.is_fast = is_fast;
  servos.slack = 100ms;
  config.servos = std::make_shared<const servos::ServoConfig>(servos);
  return config;
}

MotorSnapshot wait_for(dynamixel::MotorLoop& loop, std::uint64_t request) {
  MotorSnapshot snapshot;
  while (!loop.read(snapshot) || snapshot.request < request ||
         snapshot.phase == MotorSnapshot::Phase::kStarting) {
    std::this_thread::sleep_for(1ms);
  }
  if (snapshot.phase != MotorSnapshot::Phase::kRunning) {
    throw Error(std::string(snapshot.failure.view()));
  }
  return snapshot;
}

// Cycles per second of a loop at this terminal, in windows of a second.
void measure(const std::string& path, const RobotConfig& config, const Effort& effort,
             Samples& rates, std::uint64_t& missing) {
  auto port =
      std::make_unique<dynamixel::SerialPort>(path, dynamixel::SerialOptions{.baud = kBaud});
  dynamixel::MotorLoop loop(
      std::make_unique<dynamixel::MotorGroup>(
          std::move(port), servos::group_options(config.servos->robot, config.servos->group),
          config.servos->slack),
      {.goal_timeout = 1s, .realtime = {.demand = Demand::kTry, .priority = 80, .cpu = 1}});
  MotorSnapshot before = wait_for(loop, loop.request_start());
  for (int i = 0; i < effort.windows; ++i) {
    report_progress(i, effort.windows);
    const auto begin = Clock::now();
    std::this_thread::sleep_for(std::chrono::duration<double>(effort.window_time));
    MotorSnapshot after;
    static_cast<void>(loop.read(after));
    rates.add(static_cast<double>(after.cycles - before.cycles) / seconds_since(begin));
    if (after.phase != MotorSnapshot::Phase::kRunning) {
      throw Error(std::string(after.failure.view()));
    }
    missing += after.counts.missing - before.counts.missing;
    before = after;
  }
}

}  // namespace

std::vector<Row> motor_bus(const Effort& effort) {
  struct Case {
    const char* name;
    bool is_fast;
    double arithmetic;  // cycles per second that the bytes allow
  };
  std::vector<Row> rows;
  for (const Case& bus : {Case{"sync read", false, 1476.0}, Case{"fast sync read", true, 1852.0}}) {
    const RobotConfig config = nine_motors(bus.is_fast);
    ServoPlant plant(config.simulation, *config.servos);
    static_cast<void>(enter_realtime({.demand = Demand::kTry, .priority = 82}));
    Samples rates;
    std::uint64_t missing = 0;
    {
      const dynamixel::Emulator emulator(servos::emulated_motors(*config.servos), plant);
      measure(emulator.path(), config, effort, rates, missing);
    }
    Row row = make_row(
        fmt::format("nine Dynamixel motors at 4 Mbaud and a pseudo-terminal, {}", bus.name),
        "cycles/s", rates, "the arithmetic of the bytes within 10 %",
        rates.median() >= 0.9 * bus.arithmetic && rates.median() <= 1.1 * bus.arithmetic,
        fmt::format("{} answers missing", missing));
    row.reference = "the arithmetic of the bytes";
    row.reference_value = bus.arithmetic;
    row.ratio = row.value / bus.arithmetic;
    rows.push_back(row);
  }
  return rows;
}

}  // namespace trifinger::benchmarks
