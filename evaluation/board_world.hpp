// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/emulator.hpp"
#include "can/memory_bus.hpp"
#include "sim/simulated_plant.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/realtime/clock.hpp"

namespace trifinger::evaluation {

// A TriFinger on emulated motor boards with its table, in one thread and in time of its own: each
// action takes a millisecond of the clock. Equal options give equal series.
class BoardWorld final : public UntypedDriver {
 public:
  // `boards` is how the robot is driven, `simulation` what it and its objects are.
  BoardWorld(const boards::BoardRobotOptions& boards, const SimulationOptions& simulation);

  [[nodiscard]] ManualClock& clock() noexcept { return clock_; }
  [[nodiscard]] SimulatedPlant& plant() noexcept { return plant_; }

  [[nodiscard]] const RobotTypes& description() const noexcept override {
    return robot_->description();
  }
  // The objects are where they were in the beginning once the robot is ready.
  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override;
  [[nodiscard]] DriverReport hold(const void* observation, void* action) noexcept override;
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override;
  void cut() noexcept override {}
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override;
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override;
  [[nodiscard]] std::string_view fault_text(std::int32_t fault_code) const noexcept override;
  [[nodiscard]] std::string_view rejection_text() const noexcept override;

 private:
  void pass() noexcept;

  ManualClock clock_;
  SimulatedPlant plant_;
  std::vector<std::unique_ptr<can::MemoryBus>> buses_;
  std::optional<boards::Emulator> emulator_;
  std::optional<boards::BoardRobot> robot_;
  std::vector<CompanionDescription> companions_;
  bool is_seen_{false};  // poses of this millisecond have been handed over
};

}  // namespace trifinger::evaluation
