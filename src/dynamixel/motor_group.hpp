// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "dynamixel/bus.hpp"
#include "dynamixel/control_table.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::dynamixel {

/// The most motors of one group.
inline constexpr std::size_t kMaxMotors = 32;

/// How motors follow positions, in the units of their registers "position_p_gain" and so on.
struct PositionGains {
  std::int32_t p{0};
  std::int32_t i{0};
  std::int32_t d{0};
};

struct MotorGroupOptions {
  std::vector<MotorId> ids{};  ///< In the order of readings and goals.
  /// Motors that only measure angles: they get no torque. Their readings follow those of `ids`.
  std::vector<MotorId> sensors{};
  /// What the motors of `ids` and then of `sensors` must be. Missing or null: any known model.
  std::vector<const MotorModel*> models{};
  /// What goals are: currents [A], velocities [rad/s], or positions [rad]. `kPwm` is not possible.
  OperatingMode mode{OperatingMode::kCurrent};
  /// No goal asks for more [A]. In `kCurrentBasedPosition` it is the current that positions use.
  /// Infinite: as much as is stored in each motor; otherwise all motors must allow this much.
  double max_current{std::numeric_limits<double>::infinity()};
  /// Written to the motors in modes with positions, because they keep none without supply. Nothing:
  /// they stay as they are.
  std::optional<PositionGains> position_gains{};
  /// Reads with "fast sync read"; needs `kFastSyncReadFirmware` or later in all motors.
  bool is_fast{true};
  Nanoseconds return_delay{0};  ///< Written to the motors. A multiple of 2 µs up to 508 µs.
  /// The motors stop by themselves when they hear nothing for so long: a multiple of 20 ms up to
  /// 2.54 s. 0: never; then they keep their last goals when the host has died.
  Nanoseconds watchdog{std::chrono::milliseconds(100)};
  /// A motor that has not answered for so long has a fault.
  Nanoseconds silent_after{std::chrono::milliseconds(50)};
  /// Between two looks at torque, hardware errors, supply and temperature of one motor, in turn.
  int cycles_between_looks{20};
  /// `start` reboots a motor that reports a hardware error, once.
  bool reboot_after_error{true};
  int attempts{5};  ///< How often `start` tries each exchange.
};

/// What is known of a motor.
struct MotorReading {
  double position{0.0};     ///< [rad]; 0 is the middle of its range.
  double velocity{0.0};     ///< [rad/s]
  double current{0.0};      ///< [A]; NaN of a motor without currents: `MotorModel::has_current`.
  double supply{0.0};       ///< [V]; 0 until the first look.
  double temperature{0.0};  ///< [°C]; 0 until the first look.
  /// No value above is older, except for supply and temperature: when the motor was asked.
  Instant measured{};
  std::uint8_t hardware_errors{0};  ///< Bits of `HardwareError`.
  bool has_torque{false};
  std::uint64_t missing{0};  ///< Answers that did not come.
};

/// Why a group cannot be used.
enum class MotorFault : std::uint8_t {
  kNone,
  kLineGone,       ///< The adapter was unplugged.
  kSilent,         ///< A motor has not answered for too long.
  kHardwareError,  ///< A motor reports a hardware error.
  kTorqueLost,     ///< A motor has switched its torque off, as after a restart.
  kWatchdog,       ///< A motor has stopped because it heard nothing for too long.
  kRefused,        ///< A motor refuses to be read.
};

struct GroupFault {
  MotorFault kind{MotorFault::kNone};
  MotorId motor{0};        ///< Which one, unless the line has gone.
  std::uint8_t detail{0};  ///< Bits of `HardwareError`, or a `StatusError`.
};

/// A sentence on what is wrong, and what to do.
[[nodiscard]] FixedText describe(const GroupFault& fault) noexcept;

/// Motors on one bus that are read and driven together. Calls wait for the bus: see `MotorLoop`.
class MotorGroup {
 public:
  /// @throws InvalidArgument
  MotorGroup(std::unique_ptr<Port> port, MotorGroupOptions options,
             Nanoseconds slack = BusOptions{}.slack);

  /// Finds the motors, sets them up, and switches torque on. Goals are then 0 A or 0 rad/s, or the
  /// positions where the motors are. The position of every motor is then known. What motors keep
  /// without supply is written only if it changes. Forgets all faults, and opens the line again
  /// if it had gone. Motors may have torque after an exception: see `release`.
  /// @throws Error that names the motor, what was expected and what to do
  void start();

  /// One cycle: reads all motors, then sends them the goals. A goal that is not a number becomes
  /// 0 A or 0 rad/s, or the last position. Goals stay within the limits that are stored in the
  /// motors. Without effect on the motors while there is a fault.
  void cycle(std::span<const double> goals) noexcept;

  /// Sets goal currents to 0 and switches torque off, until every motor confirms that it has none.
  /// Gives up after 0.25 s, or when the line has gone; motors then stop by their watchdogs. Returns
  /// the first motor that has not confirmed it.
  std::optional<MotorId> release() noexcept;

  /// The number of motors, sensors included.
  [[nodiscard]] std::size_t size() const noexcept { return ids_.size(); }
  /// The number of motors that are driven.
  [[nodiscard]] std::size_t num_driven() const noexcept { return options_.ids.size(); }
  [[nodiscard]] const MotorGroupOptions& options() const noexcept { return options_; }
  [[nodiscard]] std::span<const MotorReading> readings() const noexcept {
    return std::span(readings_).first(size());
  }
  /// The model of a motor, known from `start` on.
  [[nodiscard]] const MotorModel& model(std::size_t motor) const noexcept {
    return *models_[motor];
  }
  /// The first fault since `start`; it stays.
  [[nodiscard]] const GroupFault& fault() const noexcept { return fault_; }
  [[nodiscard]] std::uint64_t cycles() const noexcept { return cycles_; }
  [[nodiscard]] BusCounts counts() const noexcept { return bus_.counts(); }
  [[nodiscard]] Bus& bus() noexcept { return bus_; }

 private:
  enum class Look : std::uint8_t { kTorque, kWatchdog, kSupply };
  static constexpr std::size_t kLooks = 3;

  // What a motor takes as a goal, in its units.
  struct GoalLimits {
    std::int32_t lowest{0};
    std::int32_t highest{0};
  };

  [[nodiscard]] GoalLimits read_limits(std::size_t motor);
  [[nodiscard]] std::int32_t read_largest_current(std::size_t motor);
  // Tries an exchange until it succeeds, at most as often as the options say.
  template <class Exchange>
  [[nodiscard]] Answer try_often(const Exchange& exchange);
  [[nodiscard]] std::int32_t get(std::size_t motor, const Register& which);
  void set(std::size_t motor, const Register& which, std::int32_t value);
  // Writes only what is different, because the memory that is kept wears.
  void set_if_different(std::size_t motor, const Register& which, std::int32_t value);
  void identify(std::size_t motor);
  void clear_errors(std::size_t motor);
  // Everything but torque.
  void set_up(std::size_t motor);
  void give_torque(std::size_t motor);
  void read_all() noexcept;
  // Sends the last goals of the first `count` motors.
  Outcome send_goals(std::size_t count) noexcept;
  void write_all(std::span<const double> goals) noexcept;
  void look(std::size_t motor, Look what) noexcept;
  void note(MotorFault kind, std::size_t motor, std::uint8_t detail = 0) noexcept;
  [[nodiscard]] std::int32_t raw_goal(std::size_t motor, double goal) const noexcept;
  [[nodiscard]] const Register& goal_register() const noexcept;

  MotorGroupOptions options_;
  std::vector<MotorId> ids_;  // driven motors, then sensors
  Bus bus_;
  std::array<const MotorModel*, kMaxMotors> models_{};
  std::array<MotorReading, kMaxMotors> readings_{};
  std::array<std::int32_t, kMaxMotors> last_goals_{};
  std::array<GoalLimits, kMaxMotors> limits_{};
  std::size_t num_watched_{0};  // motors that `start` has given torque
  std::array<MotorAnswer, kMaxMotors> answers_{};
  std::array<std::uint8_t, 4 * kMaxMotors> data_{};
  GroupFault fault_{};
  std::uint64_t cycles_{0};
  std::uint64_t looks_{0};
  bool is_started_{false};
};

}  // namespace trifinger::dynamixel
