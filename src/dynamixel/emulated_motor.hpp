// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "dynamixel/control_table.hpp"
#include "dynamixel/packet.hpp"
#include "dynamixel/status.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::dynamixel {

/// What an emulated motor is when it is switched on for the first time.
struct EmulatedMotorOptions {
  MotorId id{1};
  const MotorModel* model{&kXm430W210};  ///< Must outlive the motor.
  int baud{1'000'000};                   ///< One of `kBaudRates`.
  /// A multiple of 2 µs up to 508 µs.
  Nanoseconds return_delay{std::chrono::microseconds(500)};
  std::uint8_t firmware{kFastSyncReadFirmware};
  std::optional<double> supply{};  ///< [V]; default: that of the model's figures.
  double temperature{30.0};        ///< [°C]
};

/// The firmware of a Dynamixel of the X series as a class: instructions in, answers and torque out.
/// It knows neither a line nor what it moves.
///
/// It has the whole control table with both indirect blocks, the lock of what is kept, limits, all
/// operating modes, profiles, the watchdog, and shutdown by hardware errors. Its motor gets
/// torque = constant × current, and current = stall current × (voltage / voltage of the model's
/// figures - speed / no-load speed). What it leaves out: backlash, cogging, warming, and the time a
/// current takes to rise.
///
/// It does not allocate. One thread uses it.
class EmulatedMotor {
 public:
  struct Reply {
    bool is_sent{false};
    std::uint8_t error{0};  ///< With the alert bit.
    std::size_t size{0};    ///< Number of bytes of data.
  };

  /// @throws InvalidArgument
  explicit EmulatedMotor(const EmulatedMotorOptions& options);

  /// Carries out an instruction that is for this motor alone, or for all. What it answers is
  /// written to `data`, which has room for `kTableSize` bytes.
  [[nodiscard]] Reply execute(Instruction instruction, std::span<const std::uint8_t> parameters,
                              std::span<std::uint8_t> data) noexcept;
  /// The part of a read of many that is for this motor.
  [[nodiscard]] Reply read(std::size_t address, std::size_t size,
                           std::span<std::uint8_t> data) noexcept;
  /// The part of a write of many that is for this motor.
  StatusError write(std::size_t address, std::span<const std::uint8_t> data) noexcept;

  /// A part of a millisecond of its firmware, while its shaft is at `position` [rad] and turns at
  /// `velocity` [rad/s]. 0 rad is the middle of its range.
  void tick(Nanoseconds duration, double position, double velocity) noexcept;
  /// The torque at its shaft from the last tick on [Nm].
  [[nodiscard]] double torque() const noexcept { return torque_; }
  /// The current from the last tick on [A].
  [[nodiscard]] double current() const noexcept { return current_; }

  /// The supply is switched: without it the motor is silent and without torque. Afterwards it has
  /// what is kept, and everything else is as new. It has forgotten whole turns: its position is
  /// within one turn.
  void set_power(bool is_on) noexcept;
  [[nodiscard]] bool is_on() const noexcept { return is_on_; }
  /// Sets a bit of the hardware error status until a reboot. If the register "shutdown" has the
  /// bit, too, torque is off until then.
  void fail(HardwareError error) noexcept;
  void set_supply(double volts) noexcept { supply_ = volts; }
  void set_temperature(double celsius) noexcept { temperature_ = celsius; }

  [[nodiscard]] MotorId id() const noexcept;
  [[nodiscard]] int baud() const noexcept;
  [[nodiscard]] Nanoseconds return_delay() const noexcept;
  [[nodiscard]] const MotorModel& model() const noexcept { return *options_.model; }
  /// The value of a register.
  [[nodiscard]] std::int32_t value(const Register& which) const noexcept;
  /// Changes a register, even one that can only be read. For tests.
  void set_value(const Register& which, std::int32_t value) noexcept;

 private:
  struct Pending {
    std::size_t address{0};
    std::size_t size{0};
    std::array<std::uint8_t, 64> data{};
  };

  [[nodiscard]] bool is_indirect_address(std::size_t address) const noexcept;
  [[nodiscard]] std::size_t resolve(std::size_t address) const noexcept;
  [[nodiscard]] StatusError check(const Register& which, std::int64_t value) const noexcept;
  void commit(const Register& which, std::int64_t value) noexcept;
  [[nodiscard]] StatusError write_now(std::size_t address, std::span<const std::uint8_t> data,
                                      bool is_trial) noexcept;
  [[nodiscard]] Reply answer(StatusError error, bool is_read) const noexcept;
  [[nodiscard]] Reply ping(std::span<std::uint8_t> data) const noexcept;
  [[nodiscard]] Reply register_write(std::span<const std::uint8_t> parameters) noexcept;
  [[nodiscard]] Reply write_registered() noexcept;
  void begin() noexcept;
  void forget_turns() noexcept;
  void reset_goals() noexcept;
  void factory_reset(std::uint8_t what) noexcept;
  [[nodiscard]] OperatingMode mode() const noexcept;
  void watch(Nanoseconds duration) noexcept;
  void follow_profile(double seconds) noexcept;
  double drive(double velocity, double seconds) noexcept;
  void show_state(double velocity, double pwm) noexcept;
  [[nodiscard]] double wanted_pwm(double position, double velocity, double seconds) noexcept;

  EmulatedMotorOptions options_;
  std::vector<Register> table_;                 // of its model
  std::vector<IndirectBlock> indirect_blocks_;  // of its firmware
  std::array<std::uint8_t, kTableSize> memory_{};
  bool is_on_{true};
  bool is_shut_down_{false};
  double supply_{0.0};
  double temperature_;
  double torque_{0.0};
  double current_{0.0};
  double turned_{0.0};             // of the shaft, from the middle of its range on [steps]
  double forgotten_{0.0};          // whole turns of it [steps]
  double shaft_{kPositionMiddle};  // where the firmware takes it to be [steps]
  double trajectory_{kPositionMiddle};
  double trajectory_velocity_{0.0};  // [steps/s]
  double velocity_integral_{0.0};
  double position_integral_{0.0};
  Nanoseconds quiet_{0};  // since the last instruction
  Nanoseconds uptime_{0};
  Pending registered_{};
};

}  // namespace trifinger::dynamixel
