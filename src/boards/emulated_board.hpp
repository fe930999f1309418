// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "can/frame.hpp"
#include "can/motor_board.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::boards {

/// Where a rotor is and how fast it turns, as an ideal encoder would see it.
struct RotorState {
  double revolutions{0.0};  ///< From any zero that stays the same.
  double kilo_rpm{0.0};     ///< [1000 revolutions per minute]
};

struct EmulatedBoardOptions {
  /// How long a motor aligns itself with its encoder when it is enabled for the first time.
  Nanoseconds alignment_time{std::chrono::seconds(2)};
  /// Where in each revolution the encoder of a motor has its index, 0 to 1.
  std::array<double, 2> index_places{0.25, 0.6};
  int encoder_counts{20000};   ///< Steps of a position per revolution, at least 1.
  double current_noise{0.0};   ///< Standard deviation of a measured current [A].
  double velocity_noise{0.0};  ///< Standard deviation of a measured velocity [krpm].
  std::uint64_t seed{0};       ///< Seed of the noise.
};

/// The firmware of a motor board: frames in, frames and currents out. It knows neither a bus nor a
/// robot; the caller moves the rotors with `currents` and passes the frames on.
///
/// It enables, aligns, measures and stops as the boards of the Open Dynamic Robot Initiative do.
/// What it leaves out: virtual springs, the filter of the velocities, and the time a current takes
/// to rise. It starts switched off. It does not allocate, so an emulator can run it at 1 kHz.
///
/// One thread uses a board. Times must not decrease from call to call.
class EmulatedBoard {
 public:
  using Rotors = std::array<RotorState, 2>;

  explicit EmulatedBoard(const EmulatedBoardOptions& options = {}) noexcept;

  /// Switches the supply on: positions count from where the rotors are, and the system is enabled
  /// but no motor is. The next tick sends the first status. Without effect if it is on. The
  /// positions begin at `first` instead of 0 [revolutions], as after long travel.
  void switch_on(Instant now, const Rotors& rotors, double first = 0.0) noexcept;
  /// Switches the supply off: nothing is sent, no current flows, and the board forgets everything.
  void switch_off() noexcept;
  [[nodiscard]] bool is_on() const noexcept { return state_.is_on; }

  /// A frame that has reached the board at `now`. Desired currents act from the next tick on.
  /// Everything that switches a motor off acts at once. A frame that no host sends has no effect.
  void receive(const can::Frame& frame, Instant now) noexcept;

  /// One millisecond of the firmware. Returns the frames that the board sends, valid until the next
  /// call. `analog_inputs` are A and B, 0 to 1.
  ///
  /// An encoder reports one index per tick. If a rotor has turned past several, it is the last.
  [[nodiscard]] std::span<const can::Frame> tick(
      Instant now, const Rotors& rotors, const std::array<double, 2>& analog_inputs) noexcept;

  /// The currents that flow in the motors [A]. Each is 0 unless its motor is enabled and ready.
  [[nodiscard]] const can::MotorPair& currents() const noexcept { return state_.currents; }
  /// True while that motor, 0 or 1, aligns itself and must be held where it is.
  [[nodiscard]] bool is_aligning(std::size_t motor) const noexcept;
  /// What a status frame would say now. All bits are 0 while the board is off.
  [[nodiscard]] can::BoardStatus status() const noexcept;

  /// Something goes wrong in the board, and it stops unless it is off or its system is disabled
  /// already. `kEncoder` stops it again each time the system is enabled, until it is switched off.
  /// Any other error has passed when the system is enabled again.
  void fail(can::BoardError error) noexcept;
  /// From now on this motor, 0 or 1, gets `factor` times the commanded current.
  void set_current_factor(std::size_t motor, double factor) noexcept {
    current_factors_[motor] = factor;
  }

 private:
  struct Motor {
    bool is_enabled{false};
    bool is_aligned{false};
    Instant enabled_at{};
    double zero_count{0.0};  // of the encoder at power-up
    double count{0.0};       // of the encoder at the last tick
  };

  // All that a board forgets without its supply.
  struct State {
    bool is_on{false};
    bool is_system_enabled{true};
    can::BoardError error{can::BoardError::kNone};
    std::array<bool, 5> sends{};  // in the order of Command::kSendCurrents and those after it
    Nanoseconds receive_timeout{0};
    bool is_rollover_an_error{false};
    bool has_bad_encoder{false};
    std::array<Motor, 2> motors{};
    can::MotorPair desired{};  // [A]
    Instant desired_at{};
    can::MotorPair currents{};  // [A]
    Instant next_status{};
  };

  // A status, four kinds of data, and an index pulse of each motor.
  static constexpr std::size_t kMaxFrames = 7;

  void execute(const can::BoardCommand& command, Instant now) noexcept;
  void enable_system(bool enable) noexcept;
  void enable_motor(std::size_t motor, bool enable, Instant now) noexcept;
  void disable_everything() noexcept;
  void stop(can::BoardError error) noexcept;

  // Steps of an encoder from the zero of `revolutions`, a whole number. It is a double, so that
  // nothing overflows wherever a rotor is.
  [[nodiscard]] double count_at(double revolutions) const noexcept;
  // How often the position of a motor has rolled over; negative if it turned backwards.
  [[nodiscard]] double rollovers(double count, const Motor& motor) const noexcept;
  [[nodiscard]] double position(double count, const Motor& motor) const noexcept;
  [[nodiscard]] can::BoardError find_error(Instant now) const noexcept;
  [[nodiscard]] bool is_sent(can::Command data) const noexcept;
  [[nodiscard]] double with_noise(double value, double deviation) noexcept;

  template <class Message>
  void send(const Message& message) noexcept;
  void send_data(const Rotors& rotors, const can::MotorPair& analog_inputs) noexcept;
  // Sends an index pulse if the motor has passed an index on its way from `before` to its count.
  void send_index_pulse(std::size_t motor, double before) noexcept;

  EmulatedBoardOptions options_;
  Random random_;
  State state_;
  can::MotorPair current_factors_{1.0, 1.0};
  std::array<can::Frame, kMaxFrames> frames_{};
  std::size_t frame_count_{0};
};

}  // namespace trifinger::boards
