// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <tuple>

#include "boards/board.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::boards {

/// The running hours of a robot on motor boards: what each joint has done since the robot was
/// built. No number ever decreases. An element of its companion "wear", which has one for every
/// second of a session.
template <std::size_t N>
struct Wear {
  Stamp stamp;
  /// Number of starts of the back-end. 0 if the file of the running hours cannot be used: all
  /// numbers then count from the last start.
  std::uint64_t starts{0};
  std::uint64_t homings{0};          ///< Number of times that all joints have found their homes.
  std::uint64_t faults{0};           ///< Number of faults of boards, homing and measurements.
  JointVector<N> powered_time{};     ///< Time in sessions with the motor switched on [s].
  JointVector<N> revolutions{};      ///< Travel of the motor, forth and back [revolutions].
  JointVector<N> work{};             ///< Mechanical work of the motor, given or taken [J].
  JointVector<N> squared_current{};  ///< Integral over time [A^2s]; the heat in a winding is this
                                     ///< times its resistance.
  /// Number of index pulses that were not a whole number of revolutions from the one before: the
  /// encoder or its disk has slipped.
  std::array<std::uint64_t, N> index_slips{};

  static constexpr auto fields() {
    return std::tuple{field("stamp", &Wear::stamp),
                      field("starts", &Wear::starts),
                      field("homings", &Wear::homings),
                      field("faults", &Wear::faults),
                      field("powered_time", &Wear::powered_time, "s"),
                      field("revolutions", &Wear::revolutions),
                      field("work", &Wear::work, "J"),
                      field("squared_current", &Wear::squared_current, "A^2s"),
                      field("index_slips", &Wear::index_slips)};
  }
};

/// A robot that counts its running hours, for those who keep them. The bytes are a `Wear`.
class WearMeter {
 public:
  virtual ~WearMeter() = default;

  /// The companion "wear": its type and its elements.
  [[nodiscard]] virtual const CompanionDescription& wear_description() const noexcept = 0;
  /// What is counted now. Call this only while nobody runs the robot.
  [[nodiscard]] virtual std::span<const std::byte> wear_bytes() const noexcept = 0;
  /// Goes on counting from what was kept. No bytes: from zero. Call it once, before the robot runs:
  /// it counts a start.
  virtual void continue_wear(std::span<const std::byte> kept) = 0;
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
