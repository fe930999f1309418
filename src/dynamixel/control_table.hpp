// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace trifinger::dynamixel {

/// The loop that a motor closes by itself.
enum class OperatingMode : std::uint8_t {
  kCurrent = 0,
  kVelocity = 1,
  kPosition = 3,
  kExtendedPosition = 4,      ///< Position over many turns.
  kCurrentBasedPosition = 5,  ///< Position; the goal current is the most that it uses.
  kPwm = 16,
};

/// The words of a mode, such as "current-based position"; "unknown" if there is none.
[[nodiscard]] std::string_view name_of(OperatingMode mode) noexcept;
/// True for a mode whose goal is a current, or is reached with no more than one.
[[nodiscard]] bool needs_current(OperatingMode mode) noexcept;

/// A number in the memory of a motor of the X series.
struct Register {
  enum class Access : std::uint8_t { kRead, kReadWrite };

  std::string_view name;
  std::uint16_t address{0};
  std::uint8_t size{0};  ///< [bytes]
  bool is_signed{false};
  Access access{Access::kReadWrite};
  std::int64_t initial{0};  ///< Value of a new XM430-W210.
  std::int64_t lowest{0};   ///< What may be written.
  std::int64_t highest{0};
  std::string_view unit{};  ///< Of `scale`; empty for a plain number.
  double scale{1.0};        ///< What a step is worth. Currents: see `MotorModel::current_unit`.

  /// True if the motor keeps it without supply. It can be written only while torque is off.
  [[nodiscard]] constexpr bool is_kept() const noexcept { return address < 64; }
  [[nodiscard]] constexpr std::size_t end() const noexcept { return address + std::size_t{size}; }
};

/// Steps of a position per turn. The encoder is absolute within one turn: a motor that has just
/// been switched on knows no whole turns.
inline constexpr std::int32_t kStepsPerTurn = 4096;
/// What a step of a position is worth [rad].
inline constexpr double kPositionUnit = 2.0 * std::numbers::pi / kStepsPerTurn;
/// A step of the register bus_watchdog.
inline constexpr std::chrono::milliseconds kWatchdogUnit{20};
/// The position in the middle of the range, which counts as 0 rad.
inline constexpr std::int32_t kPositionMiddle = 2048;
/// What a step of a velocity is worth [rad/s]: 0.229 revolutions per minute.
inline constexpr double kVelocityUnit = 0.229 * 2.0 * std::numbers::pi / 60.0;
/// PWM at which the motor gets its whole supply.
inline constexpr int kFullPwm = 885;

namespace registers {

namespace detail {
inline constexpr auto kReadOnly = Register::Access::kRead;
inline constexpr auto kWritable = Register::Access::kReadWrite;
inline constexpr std::int64_t kFullCurrent = 1193;
inline constexpr double kAcceleration = 214.577 * 2.0 * std::numbers::pi / 3600.0;
}  // namespace detail

// clang-format off
inline constexpr Register kModelNumber{"model_number", 0, 2, false, detail::kReadOnly, 1030};
inline constexpr Register kModelInformation{"model_information", 2, 4, false, detail::kReadOnly, 0};
inline constexpr Register kFirmwareVersion{"firmware_version", 6, 1, false, detail::kReadOnly, 45};
inline constexpr Register kId{"id", 7, 1, false, detail::kWritable, 1, 0, 252};
inline constexpr Register kBaudRate{"baud_rate", 8, 1, false, detail::kWritable, 1, 0, 7};
inline constexpr Register kReturnDelay{"return_delay_time", 9, 1, false, detail::kWritable, 250, 0, 254, "us", 2.0};
inline constexpr Register kDriveMode{"drive_mode", 10, 1, false, detail::kWritable, 0, 0, 13};
inline constexpr Register kOperatingMode{"operating_mode", 11, 1, false, detail::kWritable, 3, 0, 16};
inline constexpr Register kSecondaryId{"secondary_id", 12, 1, false, detail::kWritable, 255, 0, 255};
inline constexpr Register kProtocolType{"protocol_type", 13, 1, false, detail::kWritable, 2, 1, 2};
inline constexpr Register kHomingOffset{"homing_offset", 20, 4, true, detail::kWritable, 0, -1044479, 1044479, "rad", kPositionUnit};
inline constexpr Register kMovingThreshold{"moving_threshold", 24, 4, false, detail::kWritable, 10, 0, 1023, "rad/s", kVelocityUnit};
inline constexpr Register kTemperatureLimit{"temperature_limit", 31, 1, false, detail::kWritable, 80, 0, 100, "degC", 1.0};
inline constexpr Register kMaxVoltageLimit{"max_voltage_limit", 32, 2, false, detail::kWritable, 160, 95, 160, "V", 0.1};
inline constexpr Register kMinVoltageLimit{"min_voltage_limit", 34, 2, false, detail::kWritable, 95, 95, 160, "V", 0.1};
inline constexpr Register kPwmLimit{"pwm_limit", 36, 2, false, detail::kWritable, 885, 0, 885, "", 1.0};
inline constexpr Register kCurrentLimit{"current_limit", 38, 2, false, detail::kWritable, 1193, 0, detail::kFullCurrent, "A", 2.69e-3};
inline constexpr Register kVelocityLimit{"velocity_limit", 44, 4, false, detail::kWritable, 330, 0, 1023, "rad/s", kVelocityUnit};
inline constexpr Register kMaxPositionLimit{"max_position_limit", 48, 4, false, detail::kWritable, 4095, 0, 4095, "rad", kPositionUnit};
inline constexpr Register kMinPositionLimit{"min_position_limit", 52, 4, false, detail::kWritable, 0, 0, 4095, "rad", kPositionUnit};
inline constexpr Register kShutdown{"shutdown", 63, 1, false, detail::kWritable, 52, 0, 61};
inline constexpr Register kTorqueEnable{"torque_enable", 64, 1, false, detail::kWritable, 0, 0, 1};
inline constexpr Register kLed{"led", 65, 1, false, detail::kWritable, 0, 0, 1};
inline constexpr Register kStatusReturnLevel{"status_return_level", 68, 1, false, detail::kWritable, 2, 0, 2};
inline constexpr Register kRegisteredInstruction{"registered_instruction", 69, 1, false, detail::kReadOnly, 0};
inline constexpr Register kHardwareErrorStatus{"hardware_error_status", 70, 1, false, detail::kReadOnly, 0};
inline constexpr Register kVelocityIGain{"velocity_i_gain", 76, 2, false, detail::kWritable, 1920, 0, 16383};
inline constexpr Register kVelocityPGain{"velocity_p_gain", 78, 2, false, detail::kWritable, 100, 0, 16383};
inline constexpr Register kPositionDGain{"position_d_gain", 80, 2, false, detail::kWritable, 0, 0, 16383};
inline constexpr Register kPositionIGain{"position_i_gain", 82, 2, false, detail::kWritable, 0, 0, 16383};
inline constexpr Register kPositionPGain{"position_p_gain", 84, 2, false, detail::kWritable, 800, 0, 16383};
inline constexpr Register kFeedforward2ndGain{"feedforward_2nd_gain", 88, 2, false, detail::kWritable, 0, 0, 16383};
inline constexpr Register kFeedforward1stGain{"feedforward_1st_gain", 90, 2, false, detail::kWritable, 0, 0, 16383};
/// After so long without an instruction the motor stops (×20 ms). It then reads as -1 and refuses
/// goals until somebody writes 0.
inline constexpr Register kBusWatchdog{"bus_watchdog", 98, 1, true, detail::kWritable, 0, 0, 127, "ms", 20.0};
inline constexpr Register kGoalPwm{"goal_pwm", 100, 2, true, detail::kWritable, 885, -885, 885, "", 1.0};
inline constexpr Register kGoalCurrent{"goal_current", 102, 2, true, detail::kWritable, 0, -detail::kFullCurrent, detail::kFullCurrent, "A", 2.69e-3};
inline constexpr Register kGoalVelocity{"goal_velocity", 104, 4, true, detail::kWritable, 0, -1023, 1023, "rad/s", kVelocityUnit};
inline constexpr Register kProfileAcceleration{"profile_acceleration", 108, 4, false, detail::kWritable, 0, 0, 32767, "rad/s^2", detail::kAcceleration};
inline constexpr Register kProfileVelocity{"profile_velocity", 112, 4, false, detail::kWritable, 0, 0, 32767, "rad/s", kVelocityUnit};
inline constexpr Register kGoalPosition{"goal_position", 116, 4, true, detail::kWritable, 2048, -1048575, 1048575, "rad", kPositionUnit};
inline constexpr Register kRealtimeTick{"realtime_tick", 120, 2, false, detail::kReadOnly, 0, 0, 32767, "ms", 1.0};
inline constexpr Register kMoving{"moving", 122, 1, false, detail::kReadOnly, 0};
inline constexpr Register kMovingStatus{"moving_status", 123, 1, false, detail::kReadOnly, 0};
inline constexpr Register kPresentPwm{"present_pwm", 124, 2, true, detail::kReadOnly, 0, 0, 0, "", 1.0};
inline constexpr Register kPresentCurrent{"present_current", 126, 2, true, detail::kReadOnly, 0, 0, 0, "A", 2.69e-3};
inline constexpr Register kPresentVelocity{"present_velocity", 128, 4, true, detail::kReadOnly, 0, 0, 0, "rad/s", kVelocityUnit};
inline constexpr Register kPresentPosition{"present_position", 132, 4, true, detail::kReadOnly, 2048, 0, 0, "rad", kPositionUnit};
inline constexpr Register kVelocityTrajectory{"velocity_trajectory", 136, 4, true, detail::kReadOnly, 0, 0, 0, "rad/s", kVelocityUnit};
inline constexpr Register kPositionTrajectory{"position_trajectory", 140, 4, true, detail::kReadOnly, 2048, 0, 0, "rad", kPositionUnit};
inline constexpr Register kPresentInputVoltage{"present_input_voltage", 144, 2, false, detail::kReadOnly, 120, 0, 0, "V", 0.1};
inline constexpr Register kPresentTemperature{"present_temperature", 146, 1, false, detail::kReadOnly, 30, 0, 0, "degC", 1.0};
// clang-format on

}  // namespace registers

/// Bits of the register "drive_mode".
inline constexpr std::int32_t kReversed = 1;          ///< The motor turns the other way.
inline constexpr std::int32_t kTimeBasedProfile = 4;  ///< Profiles are times instead of speeds.

/// The first firmware that answers a fast sync read.
inline constexpr int kFastSyncReadFirmware = 45;

/// All registers by address, without the indirect ones below.
inline constexpr std::array kControlTable{
    registers::kModelNumber,
    registers::kModelInformation,
    registers::kFirmwareVersion,
    registers::kId,
    registers::kBaudRate,
    registers::kReturnDelay,
    registers::kDriveMode,
    registers::kOperatingMode,
    registers::kSecondaryId,
    registers::kProtocolType,
    registers::kHomingOffset,
    registers::kMovingThreshold,
    registers::kTemperatureLimit,
    registers::kMaxVoltageLimit,
    registers::kMinVoltageLimit,
    registers::kPwmLimit,
    registers::kCurrentLimit,
    registers::kVelocityLimit,
    registers::kMaxPositionLimit,
    registers::kMinPositionLimit,
    registers::kShutdown,
    registers::kTorqueEnable,
    registers::kLed,
    registers::kStatusReturnLevel,
    registers::kRegisteredInstruction,
    registers::kHardwareErrorStatus,
    registers::kVelocityIGain,
    registers::kVelocityPGain,
    registers::kPositionDGain,
    registers::kPositionIGain,
    registers::kPositionPGain,
    registers::kFeedforward2ndGain,
    registers::kFeedforward1stGain,
    registers::kBusWatchdog,
    registers::kGoalPwm,
    registers::kGoalCurrent,
    registers::kGoalVelocity,
    registers::kProfileAcceleration,
    registers::kProfileVelocity,
    registers::kGoalPosition,
    registers::kRealtimeTick,
    registers::kMoving,
    registers::kMovingStatus,
    registers::kPresentPwm,
    registers::kPresentCurrent,
    registers::kPresentVelocity,
    registers::kPresentPosition,
    registers::kVelocityTrajectory,
    registers::kPositionTrajectory,
    registers::kPresentInputVoltage,
    registers::kPresentTemperature,
};

/// A block of addresses (2 bytes each) says what a block of data (1 byte each) shows. With it one
/// packet reads or writes registers that do not lie side by side. The data begin where the
/// addresses end.
struct IndirectBlock {
  std::uint16_t first_address{0};
  std::uint16_t first_data{0};
  std::uint8_t first_firmware{0};  ///< Motors with older firmware do not have this block.
  std::uint8_t last_firmware{255};

  [[nodiscard]] constexpr std::size_t count() const noexcept {
    return (std::size_t{first_data} - first_address) / 2;
  }
};
inline constexpr std::array kIndirectBlocks{IndirectBlock{168, 224}, IndirectBlock{578, 634}};
/// Number of bytes in a motor's memory.
inline constexpr std::size_t kTableSize = 662;

/// The register that has this byte; null if there is none.
[[nodiscard]] const Register* register_at(std::span<const Register> table,
                                          std::size_t address) noexcept;

/// The rates of the register "baud_rate" [bit/s].
inline constexpr std::array kBaudRates{9'600,     57'600,    115'200,   1'000'000,
                                       2'000'000, 3'000'000, 4'000'000, 4'500'000};

/// What models of the same build have in common.
struct MotorSeries {
  /// Registers that are not as in `kControlTable`. One of size 0 is not there.
  std::span<const Register> registers{};
  std::span<const IndirectBlock> indirect_blocks{kIndirectBlocks};
};

namespace detail {
using registers::detail::kReadOnly;
using registers::detail::kWritable;

// clang-format off
inline constexpr std::array kRegistersOfXl430{
    Register{"temperature_limit", 31, 1, false, kWritable, 72, 0, 100, "degC", 1.0},
    Register{"", 38, 0},
    Register{"velocity_i_gain", 76, 2, false, kWritable, 1000, 0, 16383},
    Register{"position_d_gain", 80, 2, false, kWritable, 4000, 0, 16383},
    Register{"position_p_gain", 84, 2, false, kWritable, 640, 0, 16383},
    Register{"", 102, 0},
    // The part of the stall torque that the firmware takes the load to be.
    Register{"present_load", 126, 2, true, kReadOnly, 0, 0, 0, "", 1e-3},
};
inline constexpr std::array kRegistersOfX330{
    Register{"temperature_limit", 31, 1, false, kWritable, 70, 0, 100, "degC", 1.0},
    Register{"velocity_limit", 44, 4, false, kWritable, 445, 0, 2047, "rad/s", kVelocityUnit},
    Register{"pwm_slope", 62, 1, false, kWritable, 140, 1, 255},
    Register{"shutdown", 63, 1, false, kWritable, 53, 0, 61},
    Register{"velocity_i_gain", 76, 2, false, kWritable, 1600, 0, 16383},
    Register{"velocity_p_gain", 78, 2, false, kWritable, 180, 0, 16383},
    Register{"position_p_gain", 84, 2, false, kWritable, 400, 0, 16383},
    Register{"goal_velocity", 104, 4, true, kWritable, 0, -2047, 2047, "rad/s", kVelocityUnit},
};
// clang-format on
inline constexpr std::array kIndirectBlocksOfX330{
    IndirectBlock{.first_address = 168, .first_data = 224, .last_firmware = 51},
    IndirectBlock{.first_address = 168, .first_data = 208, .first_firmware = 52}};
inline constexpr MotorSeries kX430;  // XM540, too
inline constexpr MotorSeries kXl430{.registers = kRegistersOfXl430};
inline constexpr MotorSeries kX330{kRegistersOfX330, kIndirectBlocksOfX330};

inline constexpr double kRpm = 2.0 * std::numbers::pi / 60.0;  // [rad/s]
inline constexpr double kNoCurrent = std::numeric_limits<double>::quiet_NaN();

}  // namespace detail

/// What one type of motor is.
struct MotorModel {
  std::string_view name;
  std::uint16_t number{0};
  const MotorSeries* series{nullptr};
  double current_unit{2.69e-3};  ///< What a step of a current is worth [A]; NaN: see `has_current`.
  std::int32_t current_limit{0};   ///< The largest "current_limit", also that of a new motor.
  std::int32_t velocity_limit{0};  ///< "velocity_limit" of a new motor.
  std::array<std::int32_t, 2> supply_limits{};  ///< Lowest and highest supply of a new one [0.1 V].
  double voltage{12.0};                         ///< Supply of the figures below [V].
  double stall_torque{0.0};                     ///< [Nm]
  double stall_current{0.0};                    ///< [A]
  double no_load_speed{0.0};                    ///< [rad/s]

  /// False for a motor that neither measures nor limits its current. It has no mode with currents.
  [[nodiscard]] constexpr bool has_current() const noexcept { return current_unit > 0.0; }
  /// True if the motor knows this mode.
  [[nodiscard]] bool has(OperatingMode mode) const noexcept;
  /// Torque per ampere [Nm/A], from stall torque and stall current.
  [[nodiscard]] constexpr double torque_constant() const noexcept {
    return stall_torque / stall_current;
  }
};

/// All models that are known. Torques, currents and speeds are those of the maker's manual;
/// docs/dynamixel.md says which of them are not certain.
// clang-format off
inline constexpr std::array kMotorModels{
    MotorModel{"XM430-W210",   1030, &detail::kX430,  2.69e-3, 1193,            330,  {95, 160}, 12.0, 3.0,   2.3,  77.0 * detail::kRpm},
    MotorModel{"XM430-W350",   1020, &detail::kX430,  2.69e-3, 1193,            200,  {95, 160}, 12.0, 4.1,   2.3,  46.0 * detail::kRpm},
    MotorModel{"XH430-W210",   1010, &detail::kX430,  1.34e-3, 648,             330,  {95, 160}, 12.0, 2.5,   1.3,  50.0 * detail::kRpm},
    MotorModel{"XH430-W350",   1000, &detail::kX430,  1.34e-3, 648,             330,  {95, 160}, 12.0, 3.4,   1.3,  30.0 * detail::kRpm},
    MotorModel{"XL430-W250",   1060, &detail::kXl430, detail::kNoCurrent, 0,    265,  {60, 140}, 12.0, 1.5,   1.4,  61.0 * detail::kRpm},
    MotorModel{"2XL430-W250",  1090, &detail::kXl430, detail::kNoCurrent, 0,    265,  {60, 140}, 11.1, 1.4,   1.3,  57.0 * detail::kRpm},
    MotorModel{"XM540-W270",   1120, &detail::kX430,  2.69e-3, 2047,            128,  {95, 160}, 12.0, 10.6,  4.4,  30.0 * detail::kRpm},
    MotorModel{"XM540-W150",   1130, &detail::kX430,  2.69e-3, 2047,            230,  {95, 160}, 12.0, 7.3,   4.4,  53.0 * detail::kRpm},
    MotorModel{"XL330-M077",   1190, &detail::kX330,  1e-3,    1750,            1620, {35, 70},  5.0,  0.215, 1.47, 383.0 * detail::kRpm},
    MotorModel{"XL330-M288",   1200, &detail::kX330,  1e-3,    1750,            445,  {35, 70},  5.0,  0.52,  1.47, 103.0 * detail::kRpm},
    MotorModel{"XC330-T181",   1210, &detail::kX330,  1e-3,    910,             454,  {60, 140}, 11.1, 0.76,  0.8,  104.0 * detail::kRpm},
    MotorModel{"XC330-T288",   1220, &detail::kX330,  1e-3,    910,             283,  {60, 140}, 11.1, 0.92,  0.8,  65.0 * detail::kRpm},
    MotorModel{"XC330-M181",   1230, &detail::kX330,  1e-3,    2352,            563,  {35, 70},  5.0,  0.60,  1.8,  129.0 * detail::kRpm},
    MotorModel{"XC330-M288",   1240, &detail::kX330,  1e-3,    2352,            353,  {35, 70},  5.0,  0.93,  1.8,  81.0 * detail::kRpm},
};
// clang-format on
inline constexpr const MotorModel& kXm430W210 = kMotorModels[0];

/// The model of this name, such as "XM430-W210", or with this number; null if it is not known.
[[nodiscard]] const MotorModel* find_model(std::string_view name) noexcept;
[[nodiscard]] const MotorModel* find_model(std::uint16_t number) noexcept;
/// The names of all models, for sentences.
[[nodiscard]] std::string names_of_models();
/// The registers of a new motor of this model by address, without indirect ones.
[[nodiscard]] std::vector<Register> control_table_of(const MotorModel& model);

}  // namespace trifinger::dynamixel
