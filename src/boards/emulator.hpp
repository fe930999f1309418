// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/emulated_board.hpp"
#include "boards/emulated_fault.hpp"
#include "can/bus.hpp"
#include "can/scripted_bus.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::boards {

/// What emulated motors move: a simulation, or a few equations.
class Plant {
 public:
  Plant() = default;
  Plant(const Plant&) = delete;
  Plant& operator=(const Plant&) = delete;
  virtual ~Plant() = default;

  /// Angles of the joints [rad].
  [[nodiscard]] virtual std::span<const double> position() const noexcept = 0;
  /// Velocities of the joints [rad/s].
  [[nodiscard]] virtual std::span<const double> velocity() const noexcept = 0;
  /// Forces at the tips [N].
  [[nodiscard]] virtual std::span<const double> tip_force() const noexcept = 0;
  /// Moves on by one millisecond with these torques at the joints [Nm].
  virtual void step(std::span<const double> torque) noexcept = 0;
};

/// A fault with its time.
struct ScheduledFault {
  enum class Phase : std::uint8_t { kWaits, kLasts, kIsOver };

  EmulatedFault fault;
  Instant begin;
  Instant end;
  Phase phase{Phase::kWaits};
};

/// All boards of a robot with what they move, each on a bus of its own.
class Emulator {
 public:
  /// `wiring` is the robot that the boards belong to; of it count wires, drive and tip sensors.
  /// `buses` has the bus of each board. The boards are on, and the plant is where it is.
  /// @throws InvalidArgument
  Emulator(const BoardRobotOptions& wiring, std::vector<std::unique_ptr<can::Bus>> buses,
           Plant& plant, Instant now, const EmulatedBoardOptions& options = {});

  /// One millisecond: frames are received, the plant moves, and frames are sent.
  void tick(Instant now) noexcept;

  /// Switches the supply of all boards on or off, as an emergency stop does.
  void set_power(bool is_on, Instant now) noexcept;
  /// Switches the supply of one board.
  void set_power(std::size_t board, bool is_on, Instant now) noexcept;

  /// Lets something go wrong. Its time counts from the beginning of the emulation; without one it
  /// begins with the next tick. Not for the loop. The end of a fault undoes it, except for errors,
  /// restarts and rollovers, and for an interface that is gone.
  /// @throws InvalidArgument if the robot has no such board or joint
  void add(const EmulatedFault& fault, Instant now);
  /// All faults so far, in the order in which they were added.
  [[nodiscard]] std::span<const ScheduledFault> faults() const noexcept { return faults_; }

  [[nodiscard]] EmulatedBoard& board(std::size_t number) noexcept { return boards_[number]; }
  [[nodiscard]] std::size_t num_boards() const noexcept { return boards_.size(); }

 private:
  // What is wrong at a joint, and where its motor is if it turns without it.
  struct JointFault {
    double jump{0.0};      // [rad]
    double noise{0.0};     // [rad]
    Terminal hot_motor{};  // the one that draws too much
    bool is_stuck{false};
    double stuck_at{0.0};  // [rad]
    bool is_loose{false};
    double loose_angle{0.0};  // [rad]
    double loose_speed{0.0};  // [rad/s]
  };

  void execute(Instant now) noexcept;
  // True unless a fault that lasts has switched the board off.
  [[nodiscard]] bool has_power(std::size_t board) const noexcept;
  void restore_power(Instant now) noexcept;
  void end_power_faults() noexcept;
  void begin(const EmulatedFault& fault, Instant now) noexcept;
  void end(const EmulatedFault& fault, Instant now) noexcept;
  void turn_loose_motor(std::size_t joint, double amperes) noexcept;
  // Where the motor of a joint seems to be.
  [[nodiscard]] double seen_angle(std::size_t joint) noexcept;
  [[nodiscard]] double seen_speed(std::size_t joint) const noexcept;
  void add_to_bus(const EmulatedFault& fault, Instant begin, Instant end);
  [[nodiscard]] can::ScriptedBus& scripted(std::size_t bus);
  [[nodiscard]] double holding_torque(std::size_t joint) const noexcept;
  [[nodiscard]] EmulatedBoard::Rotors rotors(std::size_t board) noexcept;
  [[nodiscard]] std::array<double, 2> analog_inputs(std::size_t board) const noexcept;

  BoardRobotOptions wiring_;
  std::vector<std::unique_ptr<can::Bus>> buses_;
  Plant& plant_;
  std::vector<double> torque_;  // memory for a tick
  std::vector<EmulatedBoard> boards_;
  std::vector<double> aligned_at_;  // where the joints were before their alignment
  std::array<can::Frame, 64> frames_{};
  Instant started_;
  std::vector<ScheduledFault> faults_;
  std::vector<can::ScriptedBus*> scripted_;  // of each board; null until its bus has a fault
  std::vector<JointFault> joint_faults_;
  Random random_{};
};

}  // namespace trifinger::boards
