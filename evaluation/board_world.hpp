// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "sim/simulated_boards.hpp"

namespace trifinger::evaluation {

// A TriFinger on emulated motor boards with its table, and with cameras that see its objects.
class BoardWorld final : public SimulatedBoards {
 public:
  // `boards` is how the robot is driven, `simulation` what it and its objects are. `clock` must
  // outlive the object.
  BoardWorld(const boards::BoardRobotOptions& boards, const SimulationOptions& simulation,
             ManualClock& clock);

  // The objects are where they were in the beginning once the robot is ready.
  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override;
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override;

 private:
  ManualClock& clock_;
  std::vector<CompanionDescription> companions_;
  std::optional<Instant> seen_;  // when poses were handed over last
};

}  // namespace trifinger::evaluation
