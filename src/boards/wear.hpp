// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "boards/board.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::boards {

/// The running hours of a robot on motor boards: what each joint has done since the robot was
/// built. No number ever decreases. As bytes it is an element of the robot's companion "wear",
/// which has one for every second of a session.
struct Wear {
  explicit Wear(std::size_t joints);

  /// Number of starts of the back-end. 0 if the file of the running hours cannot be used: all
  /// numbers then count from the last start.
  std::uint64_t starts{0};
  std::uint64_t homings{0};             ///< Number of times that all joints have found their homes.
  std::uint64_t faults{0};              ///< Number of faults of boards, homing and measurements.
  std::vector<double> powered_time;     ///< Time in sessions with the motor switched on [s].
  std::vector<double> revolutions;      ///< Travel of the motor, forth and back [revolutions].
  std::vector<double> work;             ///< Mechanical work of the motor, given or taken [J].
  std::vector<double> squared_current;  ///< Integral over time [A^2s]; the heat in a winding is
                                        ///< this times its resistance.
  /// Number of index pulses that were not a whole number of revolutions from the one before: the
  /// encoder or its disk has slipped.
  std::vector<std::uint64_t> index_slips;

  /// Describes an element.
  [[nodiscard]] static ElementDescription describe(std::size_t joints);
  /// Writes and reads an element.
  void write(const Stamp& stamp, void* element) const noexcept TRIFINGER_REALTIME;
  void read(const void* element) noexcept;
};

/// Counts what one motor does, for a loop at 1 kHz.
class MotorMeter {
 public:
  /// What a motor did since the call before.
  struct Step {
    double powered_time{0.0};     ///< [s]
    double revolutions{0.0};      ///< Way, at least 0.
    double work{0.0};             ///< [J], at least 0.
    double squared_current{0.0};  ///< [A^2s]
    bool has_slipped{false};
  };

  /// Measures `elapsed` [s], at whose end the motor is at `motor`. Travel of more than
  /// `most_revolutions` does not count: positions count from elsewhere then. Movements to and fro
  /// of less than 1/500 revolution do not count, because encoders are never quite still.
  [[nodiscard]] Step measure(const MotorReading& motor, double elapsed, double torque_constant,
                             double most_revolutions) noexcept TRIFINGER_REALTIME;

  /// The motor may have been moved meanwhile, by hand; its board was on.
  void skip_travel() noexcept TRIFINGER_REALTIME { place_.reset(); }
  /// The board may have been off: positions and indices count from elsewhere.
  void forget(const MotorReading& motor) noexcept TRIFINGER_REALTIME {
    place_.reset();
    index_.reset();
    pulses_ = motor.index_pulses;
  }

 private:
  std::optional<double> place_{};  // follows the position with some play [revolutions]
  std::optional<double> index_{};  // position of the newest index [revolutions]
  std::uint64_t pulses_{0};
};

}  // namespace trifinger::boards
