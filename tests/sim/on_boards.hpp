// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/emulator.hpp"
#include "can/memory_bus.hpp"
#include "trifinger/realtime/clock.hpp"

namespace trifinger::test {

/// A robot on emulated boards, with time of its own.
struct OnBoards {
  /// Switches the boards on. They move `plant` in each `pass`.
  void switch_on(const boards::BoardRobotOptions& options, boards::Plant& plant) {
    std::vector<std::unique_ptr<can::Bus>> of_boards;
    for (std::size_t i = 0; i < options.interfaces.size(); ++i) {
      buses.push_back(std::make_unique<can::MemoryBus>(clock));
      of_robot.push_back(buses.back()->connect());
      of_boards.push_back(buses.back()->connect());
    }
    emulator.emplace(
        options, std::move(of_boards), plant, clock.now(),
        boards::EmulatedBoardOptions{.alignment_time = std::chrono::milliseconds(100)});
  }
  void start(const boards::BoardRobotOptions& options) {
    driver.emplace(options, std::move(of_robot), clock);
  }

  /// The boards' millisecond.
  void pass() {
    clock.advance(std::chrono::milliseconds(1));
    emulator->tick(clock.now());
  }
  /// Prepares until the robot is ready or at fault; busy if it takes too long.
  DriverReport prepare() {
    DriverReport report = DriverReport::busy();
    for (TimeIndex step = 0; step < 200'000 && report.state == DriverReport::State::kBusy; ++step) {
      pass();
      report = driver->prepare(step);
    }
    return report;
  }

  ManualClock clock;
  std::vector<std::unique_ptr<can::MemoryBus>> buses;
  std::vector<std::unique_ptr<can::Bus>> of_robot;  ///< Until it starts.
  std::optional<boards::Emulator> emulator;
  std::optional<boards::BoardRobot> driver;
};

}  // namespace trifinger::test
