// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "can/bus.hpp"
#include "can/motor_board.hpp"
#include "can/position_unwrapper.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::boards {

/// What a board has last measured at one of its motors.
struct MotorReading {
  double revolutions{0.0};  ///< Turns of the motor since the board was switched on.
  double kilo_rpm{0.0};     ///< [1000 revolutions per minute]
  double amperes{0.0};
  Instant position_time{};  ///< When its message arrived.
  Instant velocity_time{};
  Instant current_time{};
  std::optional<double> index{};  ///< Position of the newest index pulse [revolutions].
  std::uint64_t index_pulses{0};  ///< Number of index pulses.
};

/// Why a board cannot be used.
enum class BoardFault : std::uint8_t {
  kNone,
  kInterfaceDown,  ///< Its CAN interface was taken down.
  kInterfaceGone,  ///< Its CAN interface was removed.
  kBusOff,         ///< The CAN controller has left the bus.
  kSilent,         ///< No measurements came for `BoardOptions::silent_after`.
  kSecondHost,     ///< Somebody else sends commands on its bus.
  kSendRefused,    ///< The bus takes no frames: nobody acknowledges them.
  kError,          ///< It reports an error: `Board::error`.
  kRestarted,      ///< It has lost its supply: motors that were enabled are not any more.
  kNoCurrent,      ///< A motor gets no current, although it should.
  kNotReady,       ///< It did not become ready within `BoardOptions::start_timeout`.
};

struct BoardOptions {
  Nanoseconds silent_after{std::chrono::milliseconds(5)};
  Nanoseconds no_current_after{std::chrono::milliseconds(8)};
  /// How long starting may take; motors align themselves for some seconds.
  Nanoseconds start_timeout{std::chrono::seconds(20)};
  /// The board lets its motors go when no currents came for so long. A whole number of ms.
  Nanoseconds receive_timeout{std::chrono::milliseconds(10)};
  double max_speed{95.0};    ///< Speed that a motor cannot exceed [revolutions/s].
  double max_current{40.0};  ///< Current that a motor cannot have, in either direction [A].
};

/// The host's side of one motor board, for a loop at 1 kHz: no call blocks, allocates or throws.
///
/// In each tick call `receive` and then, once the board is ready, `drive`.
class Board {
 public:
  /// Numbers since the object was made.
  struct Counts {
    std::uint64_t missing{0};   ///< Positions that did not come.
    std::uint64_t outdated{0};  ///< Measurements that were older than the one before.
    /// Positions that no motor can reach so fast, currents that no motor can have.
    std::uint64_t implausible{0};
    std::uint64_t invalid{0};  ///< Frames that are no message of a board.
  };

  explicit Board(std::unique_ptr<can::Bus> bus, const BoardOptions& options = {}) noexcept;

  /// Asks the board to switch its motors on. Forgets all faults, and where the motors were: it
  /// may have been without supply. `receive` then goes on until the board is ready: its motors have
  /// aligned themselves, which takes seconds.
  void start(Instant now) noexcept TRIFINGER_REALTIME;

  /// Goes on after a pause in which nobody called `receive`. What came in it is read and forgotten.
  void resume(Instant now) noexcept TRIFINGER_REALTIME;

  /// Reads what the board has sent.
  void receive(Instant now) noexcept TRIFINGER_REALTIME;

  /// Sends the currents of the next tick [A]. Without effect unless the board is ready.
  void drive(const can::MotorPair& amperes) noexcept TRIFINGER_REALTIME;

  /// Lets the motors go. The board stays ready.
  void release() noexcept TRIFINGER_REALTIME;

  /// Switches the motors off, if this object has switched them on. `start` does so again.
  void switch_off() noexcept TRIFINGER_REALTIME;

  [[nodiscard]] bool is_ready() const noexcept { return phase_ == Phase::kReady; }
  /// False while the newest measurements are not known, as after a pause.
  [[nodiscard]] bool is_current() const noexcept { return !has_more_ && is_fresh(); }
  /// When the oldest of the newest measurements arrived.
  [[nodiscard]] Instant oldest_measurement() const noexcept;
  /// The first fault since `start`; it stays.
  [[nodiscard]] BoardFault fault() const noexcept { return fault_; }
  /// What the board reported, for BoardFault::kError.
  [[nodiscard]] can::BoardError error() const noexcept { return error_; }

  /// False after any fault: the board may have been without supply since. Positions then count
  /// from another place, so the motors must be homed again.
  [[nodiscard]] bool keeps_positions() const noexcept { return keeps_positions_; }
  /// Call this after homing.
  void trust_positions() noexcept { keeps_positions_ = true; }

  [[nodiscard]] const std::array<MotorReading, 2>& motors() const noexcept { return motors_; }
  /// Inputs A and B, 0 to 1.
  [[nodiscard]] const std::array<double, 2>& analog_inputs() const noexcept {
    return analog_inputs_;
  }
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }
  [[nodiscard]] const can::BusState& bus() const noexcept { return bus_->state(); }

 private:
  enum class Phase : std::uint8_t { kOff, kStarting, kReady };

  static constexpr std::size_t kBudget = 64;  // frames per tick; a board sends 4 to 7

  [[nodiscard]] bool is_fresh() const noexcept { return is_fresh_[0] && is_fresh_[1]; }
  void read_all() noexcept;
  void take(const can::Frame& frame) noexcept;
  void take(const can::BoardStatus& status, Instant time) noexcept;
  void take(const can::MotorCurrents& currents, Instant time) noexcept;
  void take(const can::MotorPositions& positions, Instant time) noexcept;
  void take(const can::MotorVelocities& velocities, Instant time) noexcept;
  void take(const can::AnalogInputs& inputs, Instant time) noexcept;
  void take(const can::IndexPulse& pulse, Instant time) noexcept;
  void take(can::Rejection rejection, Instant time) noexcept;
  // True unless the measurement is older than the one before, whose time is `newest`.
  bool is_newer(Instant time, Instant& newest) noexcept;
  [[nodiscard]] BoardFault find_fault(Instant now) const noexcept;
  void watch_currents(Instant now) noexcept;
  void send_start(Instant now) noexcept;
  void send(std::span<const can::Frame> frames) noexcept;
  [[nodiscard]] can::Frame time_limit() const noexcept;

  std::unique_ptr<can::Bus> bus_;
  BoardOptions options_;
  Phase phase_{Phase::kOff};
  BoardFault fault_{BoardFault::kNone};
  can::BoardError error_{can::BoardError::kNone};
  bool keeps_positions_{false};
  bool is_driven_{false};  // currents are being sent
  int drives_{0};          // since the time limit was sent
  int refusals_{0};        // ticks in a row in which the bus took nothing
  int foreign_{0};         // commands of somebody else in this second
  Instant foreign_since_{};
  std::array<bool, 2> is_fresh_{};  // the position of a motor came since the start or the pause
  bool was_start_sent_{false};      // the bus has accepted the whole start sequence
  bool has_lost_motors_{false};
  bool has_more_{false};  // frames were left on the bus
  Instant started_{};
  Instant start_sent_{};
  std::array<MotorReading, 2> motors_{};
  std::array<can::PositionUnwrapper, 2> unwrappers_{};
  std::array<int, 2> implausible_in_a_row_{};
  std::array<int, 2> implausible_currents_in_a_row_{};
  std::array<double, 2> analog_inputs_{};
  can::MotorPair sent_{};                  // currents sent last [A]
  std::array<Instant, 2> current_seen_{};  // when the current of a motor was last right
  Counts counts_{};
  std::array<can::Frame, kBudget> frames_{};
};

}  // namespace trifinger::boards
