// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/emulated_fault.hpp"
#include "boards/emulator.hpp"
#include "can/memory_bus.hpp"
#include "sim/simulated_plant.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/realtime/clock.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger {

/// A robot on emulated motor boards in simulated time, in the thread of its back-end: each
/// measurement takes a millisecond of the clock. Equal options give equal series.
class SimulatedBoards : public UntypedDriver {
 public:
  /// `clock` must outlive the object.
  SimulatedBoards(boards::BoardRobotOptions boards, const SimulationOptions& simulation,
                  ManualClock& clock);

  /// Lets time pass while nobody drives the robot.
  void pass(Nanoseconds time) noexcept;
  /// The back-end was started anew.
  void restart();
  /// Lets something go wrong. @throws InvalidArgument
  void add(const boards::EmulatedFault& fault);
  [[nodiscard]] const boards::BoardRobotOptions& options() const noexcept { return options_; }
  [[nodiscard]] SimulatedPlant& plant() noexcept { return plant_; }

  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] const RobotTypes& description() const noexcept override;
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override;
  [[nodiscard]] DriverReport hold(const void* observation, void* action) noexcept override;
  void cut() noexcept override;
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override;
  [[nodiscard]] std::string_view fault_text(std::int32_t fault_code) const noexcept override;
  [[nodiscard]] std::string_view rejection_text() const noexcept override;

 private:
  void make();
  void tick() noexcept;

  boards::BoardRobotOptions options_;
  ManualClock& clock_;
  SimulatedPlant plant_;
  std::vector<std::unique_ptr<can::MemoryBus>> buses_;
  std::optional<boards::Emulator> emulator_;
  std::optional<boards::BoardRobot> robot_;
};

}  // namespace trifinger
