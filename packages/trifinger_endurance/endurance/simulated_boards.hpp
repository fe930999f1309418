// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
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

namespace trifinger::apps {

// What a back-end drives in simulated time, and what lives on while nobody drives it.
class SimulatedWorld {
 public:
  SimulatedWorld() = default;
  SimulatedWorld(const SimulatedWorld&) = delete;
  SimulatedWorld& operator=(const SimulatedWorld&) = delete;
  virtual ~SimulatedWorld() = default;

  [[nodiscard]] virtual UntypedDriver& driver() noexcept = 0;
  // Whether steps of the driver move the clock by themselves.
  [[nodiscard]] virtual bool moves_clock() const noexcept = 0;
  // Lets time pass while nobody drives the robot.
  virtual void pass(Nanoseconds time) = 0;
  // The back-end was started anew.
  virtual void restart() = 0;
  [[nodiscard]] virtual std::size_t num_boards() const noexcept = 0;
  [[nodiscard]] virtual std::size_t num_joints() const noexcept = 0;
  // Lets something go wrong. Throws InvalidArgument.
  virtual void add(const boards::EmulatedFault& fault) = 0;
};

// A robot on emulated motor boards: each measurement takes a millisecond of the clock.
class SimulatedBoards final : public SimulatedWorld, public UntypedDriver {
 public:
  // `clock` must outlive the object.
  SimulatedBoards(boards::BoardRobotOptions boards, const SimulationOptions& simulation,
                  ManualClock& clock);

  [[nodiscard]] UntypedDriver& driver() noexcept override { return *this; }
  [[nodiscard]] bool moves_clock() const noexcept override { return true; }
  void pass(Nanoseconds time) override;
  void restart() override;
  [[nodiscard]] std::size_t num_boards() const noexcept override;
  [[nodiscard]] std::size_t num_joints() const noexcept override;
  void add(const boards::EmulatedFault& fault) override;

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

}  // namespace trifinger::apps
