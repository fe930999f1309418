// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/emulated_motor.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger::dynamixel {
namespace {

namespace regs = registers;

constexpr std::int32_t kStopped = -1;  // what the watchdog reads as after it has stopped the motor

bool is_same(const Register& a, const Register& b) noexcept { return a.address == b.address; }

bool is_goal(const Register& which) noexcept {
  return is_same(which, regs::kGoalPwm) || is_same(which, regs::kGoalCurrent) ||
         is_same(which, regs::kGoalVelocity) || is_same(which, regs::kGoalPosition);
}

// The value of bytes as the register understands them.
std::int64_t value_in(const Register& which, std::span<const std::uint8_t> bytes) noexcept {
  if (which.is_signed) return signed_number_in(bytes);
  return number_in(bytes);
}

}  // namespace

EmulatedMotor::EmulatedMotor(const EmulatedMotorOptions& options)
    : options_(options),
      supply_(options.supply.value_or(options.model != nullptr ? options.model->voltage : 0.0)),
      temperature_(options.temperature) {
  using trifinger::detail::require;
  const std::string name = "emulated motor " + std::to_string(options.id);
  require(options.id <= kMaxId, name + " must have a number from 0 to 252");
  require(options.model != nullptr, name + " has no model");
  const auto* const rate = std::ranges::find(kBaudRates, options.baud);
  require(rate != kBaudRates.end(), name + " cannot have " + std::to_string(options.baud) +
                                        " baud, only 9600, 57600, 115200, 1, 2, 3, 4 or 4.5 M");
  const auto delay = options.return_delay / std::chrono::microseconds(2);
  require(delay >= 0 && delay <= regs::kReturnDelay.highest,
          name + " has a return delay of " + duration_text(options.return_delay) +
              ", must be 0 to 508 µs");
  table_ = control_table_of(*options.model);
  std::ranges::copy_if(options.model->series->indirect_blocks, std::back_inserter(indirect_blocks_),
                       [&](const IndirectBlock& block) {
                         return options.firmware >= block.first_firmware &&
                                options.firmware <= block.last_firmware;
                       });
  for (const Register& which : table_) {
    set_value(which, static_cast<std::int32_t>(which.initial));
  }
  set_value(regs::kFirmwareVersion, options.firmware);
  set_value(regs::kId, options.id);
  set_value(regs::kBaudRate, static_cast<std::int32_t>(rate - kBaudRates.begin()));
  set_value(regs::kReturnDelay, static_cast<std::int32_t>(delay));
  begin();
}

std::int32_t EmulatedMotor::value(const Register& which) const noexcept {
  return static_cast<std::int32_t>(
      value_in(which, std::span(memory_).subspan(which.address, which.size)));
}

void EmulatedMotor::set_value(const Register& which, std::int32_t value) noexcept {
  put_number(std::span(memory_).subspan(which.address), static_cast<std::uint32_t>(value),
             which.size);
}

MotorId EmulatedMotor::id() const noexcept { return memory_[regs::kId.address]; }

int EmulatedMotor::baud() const noexcept {
  return kBaudRates[memory_[regs::kBaudRate.address] % kBaudRates.size()];
}

Nanoseconds EmulatedMotor::return_delay() const noexcept {
  return value(regs::kReturnDelay) * std::chrono::microseconds(2);
}

OperatingMode EmulatedMotor::mode() const noexcept {
  return static_cast<OperatingMode>(memory_[regs::kOperatingMode.address]);
}

// Only the place within one turn is known.
void EmulatedMotor::forget_turns() noexcept {
  forgotten_ = std::floor((std::round(turned_) + kPositionMiddle) / kStepsPerTurn) * kStepsPerTurn;
  const double sign = (value(regs::kDriveMode) & kReversed) != 0 ? -1.0 : 1.0;
  shaft_ = sign * (turned_ - forgotten_) + kPositionMiddle + value(regs::kHomingOffset);
}

// What a motor does when its firmware starts.
void EmulatedMotor::begin() noexcept {
  for (const Register& which : table_) {
    if (!which.is_kept()) set_value(which, static_cast<std::int32_t>(which.initial));
  }
  for (const IndirectBlock& block : indirect_blocks_) {
    for (std::size_t i = 0; i < block.count(); ++i) {
      put_number(std::span(memory_).subspan(block.first_address + 2 * i),
                 static_cast<std::uint32_t>(block.first_data + i), 2);
    }
  }
  is_shut_down_ = false;
  quiet_ = uptime_ = Nanoseconds::zero();
  registered_ = {};
  torque_ = current_ = 0.0;
  forget_turns();
  set_value(regs::kPresentPosition, static_cast<std::int32_t>(std::lround(shaft_)));
  reset_goals();
}

void EmulatedMotor::reset_goals() noexcept {
  set_value(regs::kGoalPwm, value(regs::kPwmLimit));
  const bool is_limited = mode() == OperatingMode::kCurrentBasedPosition;
  set_value(regs::kGoalCurrent, is_limited ? value(regs::kCurrentLimit) : 0);
  set_value(regs::kGoalVelocity, 0);
  set_value(regs::kGoalPosition, static_cast<std::int32_t>(std::lround(shaft_)));
  trajectory_ = shaft_;
  trajectory_velocity_ = velocity_integral_ = position_integral_ = 0.0;
}

void EmulatedMotor::factory_reset(std::uint8_t what) noexcept {
  const std::int32_t id = value(regs::kId);
  const std::int32_t rate = value(regs::kBaudRate);
  for (const Register& which : table_) {
    if (which.access == Register::Access::kReadWrite) {
      set_value(which, static_cast<std::int32_t>(which.initial));
    }
  }
  if (what != 0xFF) set_value(regs::kId, id);
  if (what == 0x02) set_value(regs::kBaudRate, rate);
  begin();
}

void EmulatedMotor::set_power(bool is_on) noexcept {
  if (is_on && !is_on_) begin();
  is_on_ = is_on;
  torque_ = current_ = 0.0;
}

void EmulatedMotor::fail(HardwareError error) noexcept {
  const int bits = value(regs::kHardwareErrorStatus) | bit_of(error);
  set_value(regs::kHardwareErrorStatus, bits);
  if ((bits & value(regs::kShutdown)) == 0) return;
  is_shut_down_ = true;
  set_value(regs::kTorqueEnable, 0);
}

bool EmulatedMotor::is_indirect_address(std::size_t address) const noexcept {
  return std::ranges::any_of(indirect_blocks_, [address](const IndirectBlock& block) {
    return address >= block.first_address &&
           address < block.first_address + std::size_t{2} * block.count();
  });
}

// The place of a byte: an indirect one is somewhere else.
std::size_t EmulatedMotor::resolve(std::size_t address) const noexcept {
  const auto block = std::ranges::find_if(indirect_blocks_, [address](const IndirectBlock& each) {
    return address >= each.first_data && address < std::size_t{each.first_data} + each.count();
  });
  if (block == indirect_blocks_.end()) return address;
  const std::size_t entry = block->first_address + 2 * (address - block->first_data);
  const std::size_t target = number_in(std::span(memory_).subspan(entry, 2));
  return target < memory_.size() ? target : address;
}

StatusError EmulatedMotor::check(const Register& which, std::int64_t value) const noexcept {
  if (which.access == Register::Access::kRead) return StatusError::kAccess;
  const bool has_torque = this->value(regs::kTorqueEnable) != 0;
  if (which.is_kept() && has_torque) return StatusError::kAccess;
  if (is_goal(which) && this->value(regs::kBusWatchdog) == kStopped) return StatusError::kDataRange;
  if (value < which.lowest || value > which.highest) return StatusError::kDataRange;
  if (is_same(which, regs::kOperatingMode) && !model().has(static_cast<OperatingMode>(value))) {
    return StatusError::kDataRange;
  }
  const auto is_beyond = [&](const Register& limit) {
    return std::abs(value) > this->value(limit);
  };
  if ((is_same(which, regs::kGoalCurrent) && is_beyond(regs::kCurrentLimit)) ||
      (is_same(which, regs::kGoalVelocity) && is_beyond(regs::kVelocityLimit)) ||
      (is_same(which, regs::kGoalPwm) && is_beyond(regs::kPwmLimit))) {
    return StatusError::kDataLimit;
  }
  if (is_same(which, regs::kGoalPosition) && mode() == OperatingMode::kPosition &&
      (value < this->value(regs::kMinPositionLimit) ||
       value > this->value(regs::kMaxPositionLimit))) {
    return StatusError::kDataLimit;
  }
  // After a shutdown only a reboot gives torque again.
  if (is_same(which, regs::kTorqueEnable) && value != 0 && is_shut_down_) {
    return StatusError::kResultFail;
  }
  return StatusError::kNone;
}

void EmulatedMotor::commit(const Register& which, std::int64_t value) noexcept {
  const std::int32_t before = this->value(which);
  set_value(which, static_cast<std::int32_t>(value));
  if (is_same(which, regs::kOperatingMode) && before != value) reset_goals();
  if (is_same(which, regs::kTorqueEnable) && before == 0 && value != 0) {
    trajectory_ = shaft_;
    trajectory_velocity_ = velocity_integral_ = position_integral_ = 0.0;
  }
}

// Checks all registers first, so that a refused write changes nothing.
StatusError EmulatedMotor::write_now(std::size_t address, std::span<const std::uint8_t> data,
                                     bool is_trial) noexcept {
  for (std::size_t i = 0; i < data.size();) {
    if (address + i >= memory_.size()) return StatusError::kDataRange;
    const std::size_t place = resolve(address + i);
    if (is_indirect_address(place)) {
      if (i + 2 > data.size() || (place % 2) != 0) return StatusError::kDataLength;
      const std::uint32_t target = number_in(data.subspan(i, 2));
      const bool is_allowed = target >= 64 && target < memory_.size();
      if (!is_allowed) return StatusError::kDataRange;
      if (!is_trial) put_number(std::span(memory_).subspan(place), target, 2);
      i += 2;
      continue;
    }
    const Register* const which = register_at(table_, place);
    if (which == nullptr) {  // a gap, or indirect data that shows itself
      ++i;
      continue;
    }
    if (place != which->address || i + which->size > data.size()) return StatusError::kDataLength;
    for (std::size_t k = 1; k < which->size; ++k) {
      if (resolve(address + i + k) != place + k) return StatusError::kDataLength;
    }
    const std::int64_t value = value_in(*which, data.subspan(i, which->size));
    if (is_trial) {
      if (const StatusError error = check(*which, value); error != StatusError::kNone) return error;
    } else {
      commit(*which, value);
    }
    i += which->size;
  }
  return StatusError::kNone;
}

StatusError EmulatedMotor::write(std::size_t address, std::span<const std::uint8_t> data) noexcept {
  quiet_ = Nanoseconds::zero();
  if (data.empty()) return StatusError::kDataLength;
  const StatusError error = write_now(address, data, true);
  return error == StatusError::kNone ? write_now(address, data, false) : error;
}

EmulatedMotor::Reply EmulatedMotor::answer(StatusError error, bool is_read) const noexcept {
  const bool has_alert = value(regs::kHardwareErrorStatus) != 0;
  const int level = value(regs::kStatusReturnLevel);
  return {.is_sent = is_on_ && level >= (is_read ? 1 : 2),
          .error = static_cast<std::uint8_t>(static_cast<unsigned>(error) |
                                             (has_alert ? kAlertBit : 0U))};
}

EmulatedMotor::Reply EmulatedMotor::read(std::size_t address, std::size_t size,
                                         std::span<std::uint8_t> data) noexcept {
  quiet_ = Nanoseconds::zero();
  if (size == 0 || size > data.size()) return answer(StatusError::kDataLength, true);
  if (address + size > memory_.size()) return answer(StatusError::kDataRange, true);
  for (std::size_t i = 0; i < size; ++i) data[i] = memory_[resolve(address + i)];
  Reply reply = answer(StatusError::kNone, true);
  reply.size = size;
  return reply;
}

EmulatedMotor::Reply EmulatedMotor::ping(std::span<std::uint8_t> data) const noexcept {
  Reply reply = answer(StatusError::kNone, true);
  reply.is_sent = true;
  reply.size = 3;
  std::copy_n(memory_.begin() + regs::kModelNumber.address, 2, data.begin());
  data[2] = memory_[regs::kFirmwareVersion.address];
  return reply;
}

// Keeps a write until the action that carries it out.
EmulatedMotor::Reply EmulatedMotor::register_write(
    std::span<const std::uint8_t> parameters) noexcept {
  if (parameters.size() < 3 || parameters.size() - 2 > registered_.data.size()) {
    return answer(StatusError::kDataLength, false);
  }
  const std::size_t address = number_in(parameters.first(2));
  const auto bytes = parameters.subspan(2);
  const StatusError error = write_now(address, bytes, true);
  if (error == StatusError::kNone) {
    registered_.address = address;
    registered_.size = bytes.size();
    std::ranges::copy(bytes, registered_.data.begin());
    set_value(regs::kRegisteredInstruction, 1);
  }
  return answer(error, false);
}

EmulatedMotor::Reply EmulatedMotor::write_registered() noexcept {
  if (registered_.size == 0) return answer(StatusError::kInstruction, false);
  const StatusError error =
      write(registered_.address, std::span(registered_.data).first(registered_.size));
  registered_ = {};
  set_value(regs::kRegisteredInstruction, 0);
  return answer(error, false);
}

EmulatedMotor::Reply EmulatedMotor::execute(Instruction instruction,
                                            std::span<const std::uint8_t> parameters,
                                            std::span<std::uint8_t> data) noexcept {
  if (!is_on_) return {};
  quiet_ = Nanoseconds::zero();
  switch (instruction) {
    case Instruction::kPing:
      return ping(data);
    case Instruction::kRead:
      if (parameters.size() != 4) return answer(StatusError::kDataLength, true);
      return read(number_in(parameters.first(2)), number_in(parameters.subspan(2)), data);
    case Instruction::kWrite:
      if (parameters.size() < 3) return answer(StatusError::kDataLength, false);
      return answer(write(number_in(parameters.first(2)), parameters.subspan(2)), false);
    case Instruction::kRegWrite:
      return register_write(parameters);
    case Instruction::kAction:
      return write_registered();
    case Instruction::kFactoryReset: {
      const bool is_known =
          parameters.size() == 1 &&
          (parameters[0] == 0xFF || parameters[0] == 0x01 || parameters[0] == 0x02);
      if (!is_known) return answer(StatusError::kDataRange, false);
      const Reply reply = answer(StatusError::kNone, false);
      factory_reset(parameters[0]);
      return reply;
    }
    case Instruction::kReboot: {
      const Reply reply = answer(StatusError::kNone, false);
      begin();
      return reply;
    }
    case Instruction::kClear: {
      constexpr std::array<std::uint8_t, 5> kKey{0x01, 0x44, 0x58, 0x4C, 0x22};
      if (!std::ranges::equal(parameters, kKey)) return answer(StatusError::kDataRange, false);
      forget_turns();
      return answer(StatusError::kNone, false);
    }
    default:
      return answer(StatusError::kInstruction, false);
  }
}

void EmulatedMotor::watch(Nanoseconds duration) noexcept {
  quiet_ += duration;
  const std::int32_t watchdog = value(regs::kBusWatchdog);
  if (watchdog <= 0 || quiet_ < watchdog * kWatchdogUnit) return;
  set_value(regs::kBusWatchdog, kStopped);
  set_value(regs::kGoalCurrent, 0);
  set_value(regs::kGoalVelocity, 0);
  set_value(regs::kGoalPwm, mode() == OperatingMode::kPwm ? 0 : value(regs::kPwmLimit));
  set_value(regs::kGoalPosition, static_cast<std::int32_t>(std::lround(shaft_)));
}

// A movement with limited acceleration and velocity; 0 is no limit.
void EmulatedMotor::follow_profile(double seconds) noexcept {
  constexpr double kStepsPerRadian = 1.0 / kPositionUnit;
  const double fastest =
      value(regs::kProfileVelocity) * regs::kProfileVelocity.scale * kStepsPerRadian;
  const double acceleration =
      value(regs::kProfileAcceleration) * regs::kProfileAcceleration.scale * kStepsPerRadian;
  const bool is_velocity = mode() == OperatingMode::kVelocity;
  const double goal = value(regs::kGoalPosition);
  double wanted = value(regs::kGoalVelocity) * kVelocityUnit * kStepsPerRadian;
  if (!is_velocity) {
    if (fastest == 0.0) {
      trajectory_ = goal;
      trajectory_velocity_ = 0.0;
      return;
    }
    const double left = goal - trajectory_;
    wanted = std::min(fastest, std::abs(left) / seconds);
    if (acceleration > 0.0)
      wanted = std::min(wanted, std::sqrt(2.0 * acceleration * std::abs(left)));
    wanted = std::copysign(wanted, left);
  }
  double change = wanted - trajectory_velocity_;
  if (acceleration > 0.0) {
    change = std::clamp(change, -acceleration * seconds, acceleration * seconds);
  }
  trajectory_velocity_ += change;
  trajectory_ = is_velocity ? shaft_ : trajectory_ + trajectory_velocity_ * seconds;
}

double EmulatedMotor::wanted_pwm(double position, double velocity, double seconds) noexcept {
  const double most = std::min(std::abs(value(regs::kGoalPwm)), value(regs::kPwmLimit));
  const double milliseconds = 1e3 * seconds;
  const double goal_velocity = trajectory_velocity_ * kPositionUnit / kVelocityUnit;
  switch (mode()) {
    case OperatingMode::kPwm:
      return value(regs::kGoalPwm);
    case OperatingMode::kVelocity: {
      const double error = goal_velocity - velocity / kVelocityUnit;
      const double ki = value(regs::kVelocityIGain) / 65536.0;
      velocity_integral_ = std::clamp(velocity_integral_ + ki * error * milliseconds, -most, most);
      return std::clamp(value(regs::kVelocityPGain) / 128.0 * error + velocity_integral_, -most,
                        most);
    }
    default: {
      const double error = trajectory_ - position;
      const double ki = value(regs::kPositionIGain) / 65536.0;
      position_integral_ = std::clamp(position_integral_ + ki * error * milliseconds, -most, most);
      const double kp = value(regs::kPositionPGain) / 128.0;
      // The derivative is that of the measured position, per millisecond.
      const double kd = value(regs::kPositionDGain) / 16.0;
      const double forward = value(regs::kFeedforward1stGain) / 4.0 * goal_velocity / kFullPwm;
      return std::clamp(
          kp * error + position_integral_ - kd * velocity / kPositionUnit * 1e-3 + forward, -most,
          most);
    }
  }
}

void EmulatedMotor::tick(Nanoseconds duration, double position, double velocity) noexcept {
  turned_ = position / kPositionUnit;
  if (!is_on_) return;
  const double seconds = std::chrono::duration<double>(duration).count();
  uptime_ += duration;
  watch(duration);
  const double sign = (value(regs::kDriveMode) & kReversed) != 0 ? -1.0 : 1.0;
  shaft_ = sign * (turned_ - forgotten_) + kPositionMiddle + value(regs::kHomingOffset);
  velocity *= sign;

  const auto tenths = static_cast<std::int32_t>(std::lround(10.0 * supply_));
  if (tenths < value(regs::kMinVoltageLimit) || tenths > value(regs::kMaxVoltageLimit)) {
    fail(HardwareError::kInputVoltage);
  }
  if (temperature_ > value(regs::kTemperatureLimit)) fail(HardwareError::kOverheating);

  follow_profile(seconds);
  const double pwm = drive(velocity, seconds);
  torque_ = sign * current_ * model().torque_constant();
  show_state(velocity, pwm);
}

// Sets the current to what the mode asks for, and returns its PWM.
double EmulatedMotor::drive(double velocity, double seconds) noexcept {
  // The current that full PWM would give now in each direction.
  const MotorModel& motor = model();
  const double emf = motor.stall_current * velocity / motor.no_load_speed;
  const double full = motor.stall_current * supply_ / motor.voltage;
  double pwm = 0.0;
  current_ = 0.0;
  if (value(regs::kTorqueEnable) != 0) {
    const double unit = motor.current_unit;
    const double limit = motor.has_current() ? unit * value(regs::kCurrentLimit)
                                             : std::numeric_limits<double>::infinity();
    const double goal = unit * value(regs::kGoalCurrent);
    if (mode() == OperatingMode::kCurrent) {
      current_ = std::clamp(goal, -limit, limit);
    } else {
      current_ = wanted_pwm(shaft_, velocity, seconds) / kFullPwm * full - emf;
      if (mode() == OperatingMode::kCurrentBasedPosition) {
        current_ = std::clamp(current_, -std::abs(goal), std::abs(goal));
      }
      if (mode() != OperatingMode::kPwm) current_ = std::clamp(current_, -limit, limit);
    }
    current_ = std::clamp(current_, -full - emf, full - emf);
    pwm = std::clamp((current_ + emf) / full * kFullPwm, -1.0 * kFullPwm, 1.0 * kFullPwm);
  }
  return pwm;
}

// Writes what is measured into the registers.
void EmulatedMotor::show_state(double velocity, double pwm) noexcept {
  const auto set = [this](const Register& which, double number) {
    constexpr double kMost = 2147483647.0;
    set_value(which, static_cast<std::int32_t>(std::lround(std::clamp(number, -kMost, kMost))));
  };
  const double steps_per_second = kVelocityUnit / kPositionUnit;
  set(regs::kPresentPwm, pwm);
  const MotorModel& motor = model();
  set(regs::kPresentCurrent,
      current_ / (motor.has_current() ? motor.current_unit : 1e-3 * motor.stall_current));
  set(regs::kPresentVelocity, velocity / kVelocityUnit);
  set(regs::kPresentPosition, shaft_);
  set(regs::kVelocityTrajectory, trajectory_velocity_ / steps_per_second);
  set(regs::kPositionTrajectory, trajectory_);
  set(regs::kPresentInputVoltage, 10.0 * supply_);
  set(regs::kPresentTemperature, temperature_);
  set(regs::kRealtimeTick, static_cast<double>((uptime_ / std::chrono::milliseconds(1)) % 32768));
  const bool is_moving = std::abs(velocity) / kVelocityUnit > value(regs::kMovingThreshold);
  set(regs::kMoving, is_moving ? 1.0 : 0.0);
  const bool has_arrived = std::abs(value(regs::kGoalPosition) - shaft_) <= 20.0;
  const bool is_on_its_way = std::abs(value(regs::kGoalPosition) - trajectory_) > 0.5;
  set(regs::kMovingStatus, (has_arrived ? 1.0 : 0.0) + (is_on_its_way ? 2.0 : 0.0));
}

}  // namespace trifinger::dynamixel
