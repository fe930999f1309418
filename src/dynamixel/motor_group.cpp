// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/motor_group.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::dynamixel {
namespace {

namespace regs = registers;
using trifinger::detail::require;
using trifinger::detail::text_of;

constexpr Nanoseconds kReturnDelayUnit = std::chrono::microseconds(2);
// How long motors that do not confirm it are told again to switch torque off.
constexpr Nanoseconds kReleaseLimit = std::chrono::milliseconds(250);
// Current, velocity and position lie side by side.
constexpr std::uint16_t kPresent = regs::kPresentCurrent.address;
constexpr std::size_t kPresentSize = regs::kPresentPosition.end() - kPresent;

MotorGroupOptions checked(MotorGroupOptions options) {
  std::set<MotorId> ids(options.ids.begin(), options.ids.end());
  ids.insert(options.sensors.begin(), options.sensors.end());
  const std::size_t count = options.ids.size() + options.sensors.size();
  require(!options.ids.empty() && count <= kMaxMotors,
          text_of("a group has ", count, " motors, must have 1 to ", kMaxMotors));
  require(ids.size() == count, "a group has the same motor twice");
  require(*ids.rbegin() <= kMaxId,
          text_of("a group has motor ", int{*ids.rbegin()}, ", numbers are 0 to 252"));
  require(options.mode != OperatingMode::kPwm && name_of(options.mode) != "unknown",
          text_of("the mode of a group is ", name_of(options.mode),
                  ", must be current, velocity, position, extended position or current-based "
                  "position"));
  require(options.max_current > 0.0,  // false for NaN, too
          text_of("max_current of a group is ", options.max_current, " A, must be above 0"));
  const auto is_multiple = [](Nanoseconds value, Nanoseconds unit, std::int64_t most) {
    return value % unit == Nanoseconds::zero() && value >= Nanoseconds::zero() &&
           value / unit <= most;
  };
  require(is_multiple(options.return_delay, kReturnDelayUnit, regs::kReturnDelay.highest),
          "return_delay of a group is " + duration_text(options.return_delay) +
              ", must be a multiple of 2 µs up to 508 µs");
  require(is_multiple(options.watchdog, kWatchdogUnit, regs::kBusWatchdog.highest),
          "watchdog of a group is " + duration_text(options.watchdog) +
              ", must be a multiple of 20 ms up to 2.54 s");
  require(options.silent_after > Nanoseconds::zero(), "silent_after of a group must be above 0");
  require(options.cycles_between_looks >= 1, "cycles_between_looks of a group must be at least 1");
  require(options.attempts >= 1, "attempts of a group must be at least 1");
  return options;
}

std::string motor_text(MotorId id) { return text_of("motor ", int{id}); }

double position_of(std::int32_t raw) noexcept { return (raw - kPositionMiddle) * kPositionUnit; }

bool is_position(OperatingMode mode) noexcept {
  return mode == OperatingMode::kPosition || mode == OperatingMode::kExtendedPosition ||
         mode == OperatingMode::kCurrentBasedPosition;
}

}  // namespace

FixedText describe(const GroupFault& fault) noexcept {
  FixedText text("motor ");
  text.append(std::size_t{fault.motor}).append(" ");
  switch (fault.kind) {
    case MotorFault::kNone:
      return FixedText("the motors report no fault");
    case MotorFault::kLineGone:
      return FixedText(
          "the serial line to the motors has gone; check the adapter's plug, then recover");
    case MotorFault::kSilent:
      return text.append(
          "does not answer any more; check its supply and the cable in front of it, then recover");
    case MotorFault::kHardwareError:
      return text.append("has stopped: ").append(describe_hardware_errors(fault.detail).view());
    case MotorFault::kTorqueLost:
      return text.append(
          "has switched its torque off, as after a restart; check its supply under load, then "
          "recover");
    case MotorFault::kWatchdog:
      return text.append(
          "has stopped because it heard nothing for too long; check the load of this machine and "
          "the adapter, then recover");
    case MotorFault::kRefused: {
      const ErrorText& error = dynamixel::text_of(static_cast<StatusError>(fault.detail));
      return text.append("refuses: ").append(error.sentence).append("; ").append(error.remedy);
    }
  }
  return text;
}

MotorGroup::MotorGroup(std::unique_ptr<Port> port, MotorGroupOptions options, Nanoseconds slack)
    : options_(checked(std::move(options))),
      ids_(options_.ids),
      bus_(std::move(port), {.slack = slack}) {
  ids_.insert(ids_.end(), options_.sensors.begin(), options_.sensors.end());
  // Until they are found, motors are what most people have.
  models_.fill(&kXm430W210);
}

const Register& MotorGroup::goal_register() const noexcept {
  switch (options_.mode) {
    case OperatingMode::kCurrent:
      return regs::kGoalCurrent;
    case OperatingMode::kVelocity:
      return regs::kGoalVelocity;
    default:
      return regs::kGoalPosition;
  }
}

template <class Exchange>
Answer MotorGroup::try_often(const Exchange& exchange) {
  for (int i = 1;; ++i) {
    // Motors with torque hear nothing else meanwhile, and their watchdogs count.
    if (num_watched_ > 0) static_cast<void>(send_goals(num_watched_));
    const Answer answer = exchange();
    if (answer || i >= options_.attempts) return answer;
    bus_.drop_late_answers();
  }
}

std::int32_t MotorGroup::get(std::size_t motor, const Register& which) {
  std::int32_t value = 0;
  const Answer answer = try_often([&] { return bus_.read(ids_[motor], which, value); });
  if (answer) return value;
  throw Error(text_of(
      motor_text(ids_[motor]), " does not let ", which.name, " be read: ", name_of(answer.outcome),
      answer.outcome == Outcome::kRefused ? text_of(", ", dynamixel::text_of(answer.error).sentence)
                                          : std::string(),
      "; check its cable and its supply"));
}

void MotorGroup::set(std::size_t motor, const Register& which, std::int32_t value) {
  const Answer answer = try_often([&] { return bus_.write(ids_[motor], which, value); });
  if (answer) return;
  const std::string what =
      text_of(motor_text(ids_[motor]), " does not take ", value, " as ", which.name);
  if (answer.outcome != Outcome::kRefused) {
    throw Error(text_of(what, ": ", name_of(answer.outcome), "; check its cable and its supply"));
  }
  const ErrorText& error = dynamixel::text_of(answer.error);
  throw Error(text_of(what, ": ", error.sentence, "; ", error.remedy));
}

void MotorGroup::set_if_different(std::size_t motor, const Register& which, std::int32_t value) {
  if (get(motor, which) != value) set(motor, which, value);
}

void MotorGroup::identify(std::size_t motor) {
  const MotorId id = ids_[motor];
  Identity identity;
  const Answer answer = try_often([&] { return bus_.ping(id, identity); });
  if (!answer) {
    throw Error(text_of(motor_text(id), " does not answer at ", bus_.port().baud(),
                        " baud: ", name_of(answer.outcome),
                        "; check its supply and cable, its number, and its register baud_rate"));
  }
  const MotorModel* const model = find_model(identity.model_number);
  if (model == nullptr) {
    throw Error(text_of(motor_text(id), " is of model ", identity.model_number,
                        ", which is not known; use one of these: ", names_of_models()));
  }
  const MotorModel* const expected =
      motor < options_.models.size() ? options_.models[motor] : nullptr;
  if (expected != nullptr && expected != model) {
    throw Error(text_of(motor_text(id), " is of model ", model->name, ", but must be of model ",
                        expected->name, "; correct the model, or exchange the motor"));
  }
  if (motor < num_driven() && !model->has(options_.mode)) {
    throw Error(text_of(motor_text(id), " (", model->name,
                        ") neither measures nor limits its "
                        "current, so it has no mode \"",
                        name_of(options_.mode), "\"; set mode: position and max_current: .inf"));
  }
  models_[motor] = model;
  if (options_.is_fast && identity.firmware < kFastSyncReadFirmware) {
    throw Error(text_of(motor_text(id), " has firmware ", int{identity.firmware},
                        ", but fast sync read needs ", kFastSyncReadFirmware,
                        "; set fast_sync_read: false, or update the firmware"));
  }
}

void MotorGroup::clear_errors(std::size_t motor) {
  const MotorId id = ids_[motor];
  auto bits = static_cast<std::uint8_t>(get(motor, regs::kHardwareErrorStatus));
  if (bits != 0 && options_.reboot_after_error) {
    static_cast<void>(bus_.reboot(id));
    // The firmware needs a part of a second.
    const Instant end = bus_.port().now() + std::chrono::seconds(2);
    Identity identity;
    do {
      bus_.port().sleep_until(bus_.port().now() + std::chrono::milliseconds(100));
    } while (!bus_.ping(id, identity) && bus_.port().now() < end);
    bits = static_cast<std::uint8_t>(get(motor, regs::kHardwareErrorStatus));
  }
  if (bits != 0) {
    throw Error(
        text_of(motor_text(id), " cannot be started: ", describe_hardware_errors(bits).view()));
  }
}

void MotorGroup::set_up(std::size_t motor) {
  set(motor, regs::kBusWatchdog, 0);
  set(motor, regs::kTorqueEnable, 0);
  set_if_different(motor, regs::kReturnDelay,
                   static_cast<std::int32_t>(options_.return_delay / kReturnDelayUnit));
  readings_[motor] = {};
  if (motor >= num_driven()) return;
  if ((get(motor, regs::kDriveMode) & kTimeBasedProfile) != 0) {
    throw Error(text_of(motor_text(ids_[motor]),
                        " has a time-based profile in its register drive_mode, but profiles must "
                        "be based on velocity; take ",
                        kTimeBasedProfile, " off the value of drive_mode"));
  }
  const auto mode = static_cast<std::int32_t>(options_.mode);
  set_if_different(motor, regs::kOperatingMode, mode);
  // In another mode, goals would have another meaning.
  if (const std::int32_t found = get(motor, regs::kOperatingMode); found != mode) {
    throw Error(text_of(motor_text(ids_[motor]), " is in mode ", found, ", but was set to mode ",
                        mode, "; recover to set it again"));
  }
  limits_[motor] = read_limits(motor);
  // Another program may have left these.
  set(motor, regs::kGoalPwm, get(motor, regs::kPwmLimit));
  set(motor, regs::kProfileVelocity, 0);
  set(motor, regs::kProfileAcceleration, 0);
  if (options_.position_gains && is_position(options_.mode)) {
    set(motor, regs::kPositionPGain, options_.position_gains->p);
    set(motor, regs::kPositionIGain, options_.position_gains->i);
    set(motor, regs::kPositionDGain, options_.position_gains->d);
  }
  if (options_.mode == OperatingMode::kCurrentBasedPosition) {
    set(motor, regs::kGoalCurrent, read_largest_current(motor));
  }
}

void MotorGroup::give_torque(std::size_t motor) {
  std::int32_t goal = 0;
  if (is_position(options_.mode)) {
    goal = std::clamp(get(motor, regs::kPresentPosition), limits_[motor].lowest,
                      limits_[motor].highest);
  }
  set(motor, goal_register(), goal);
  last_goals_[motor] = goal;
  set(motor, regs::kTorqueEnable, 1);
  set(motor, regs::kBusWatchdog, static_cast<std::int32_t>(options_.watchdog / kWatchdogUnit));
  num_watched_ = motor + 1;
  readings_[motor].has_torque = true;
}

void MotorGroup::start() {
  is_started_ = false;
  num_watched_ = 0;
  fault_ = {};
  // Reading shows whether the line has gone while nobody used it.
  bus_.drop_late_answers();
  if (!bus_.port().is_open()) bus_.port().reopen();
  bus_.set_return_delay(kReturnDelayUnit * regs::kReturnDelay.highest);
  for (std::size_t i = 0; i < size(); ++i) identify(i);
  // Before anything is read: a motor may have been told to answer nothing but pings.
  for (std::size_t i = 0; i < size(); ++i) set(i, regs::kStatusReturnLevel, 2);
  for (std::size_t i = 0; i < size(); ++i) clear_errors(i);
  for (std::size_t i = 0; i < size(); ++i) set_up(i);
  bus_.set_return_delay(options_.return_delay);
  // All motors are set up by now, so that little time passes from here on.
  for (std::size_t i = 0; i < num_driven(); ++i) give_torque(i);
  for (std::size_t i = 0; i < size(); ++i) {
    // One by one: a motor whose answer to the common read is lost must not seem to be at 0 rad.
    readings_[i].measured = bus_.port().now();
    readings_[i].position = position_of(get(i, regs::kPresentPosition));
  }
  is_started_ = true;
  read_all();
}

void MotorGroup::note(MotorFault kind, std::size_t motor, std::uint8_t detail) noexcept {
  if (fault_.kind != MotorFault::kNone) return;
  fault_ = {.kind = kind, .motor = ids_[motor], .detail = detail};
}

void MotorGroup::read_all() noexcept {
  bus_.sync_read(ids_, kPresent, kPresentSize, answers_, options_.is_fast);
  for (std::size_t i = 0; i < size(); ++i) {
    const MotorAnswer& answer = answers_[i];
    MotorReading& reading = readings_[i];
    switch (answer.answer.outcome) {
      case Outcome::kDone:
        break;
      case Outcome::kRefused:
        note(MotorFault::kRefused, i, static_cast<std::uint8_t>(answer.answer.error));
        continue;
      case Outcome::kLineGone:
        note(MotorFault::kLineGone, i);
        continue;
      default:
        ++reading.missing;
        continue;
    }
    const std::span data(answer.data);
    const auto value = [&](const Register& which) {
      return signed_number_in(data.subspan(which.address - kPresent, which.size));
    };
    reading.current = value(regs::kPresentCurrent) * models_[i]->current_unit;
    reading.velocity = value(regs::kPresentVelocity) * kVelocityUnit;
    reading.position = position_of(value(regs::kPresentPosition));
    reading.measured = answer.answer.asked;
    // The alert does not say which error it is.
    if (answer.answer.alert && fault_.kind == MotorFault::kNone) look(i, Look::kTorque);
  }
  const Instant now = bus_.port().now();
  for (std::size_t i = 0; i < size(); ++i) {
    if (now - readings_[i].measured > options_.silent_after) note(MotorFault::kSilent, i);
  }
}

std::int32_t MotorGroup::raw_goal(std::size_t motor, double goal) const noexcept {
  const bool is_position_goal = is_position(options_.mode);
  if (!std::isfinite(goal)) return is_position_goal ? last_goals_[motor] : 0;
  const bool is_current = options_.mode == OperatingMode::kCurrent;
  const double unit = is_current         ? models_[motor]->current_unit
                      : is_position_goal ? kPositionUnit
                                         : kVelocityUnit;
  const double raw = goal / unit + (is_position_goal ? kPositionMiddle : 0);
  const GoalLimits& limits = limits_[motor];
  return static_cast<std::int32_t>(std::lround(
      std::clamp(raw, static_cast<double>(limits.lowest), static_cast<double>(limits.highest))));
}

// The user must know which torque applies, so a motor that gives less than was asked for is an
// error.
std::int32_t MotorGroup::read_largest_current(std::size_t motor) {
  const std::int32_t stored = get(motor, regs::kCurrentLimit);
  if (std::isinf(options_.max_current)) return stored;
  const double unit = models_[motor]->current_unit;
  // Rounded towards 0, so that no goal is above the limit.
  const double wanted = std::floor(options_.max_current / unit);
  if (wanted <= stored) return static_cast<std::int32_t>(wanted);
  throw Error(text_of(
      motor_text(ids_[motor]), " (", models_[motor]->name, ") gives at most ", stored * unit,
      " A, as its register current_limit says, but max_current is ", options_.max_current,
      " A; lower max_current, or raise the register if the type of motor allows it"));
}

// A motor refuses a goal beyond its limits without a word, and keeps the one before.
MotorGroup::GoalLimits MotorGroup::read_limits(std::size_t motor) {
  switch (options_.mode) {
    case OperatingMode::kCurrent: {
      const std::int32_t most = read_largest_current(motor);
      return {.lowest = -most, .highest = most};
    }
    case OperatingMode::kVelocity: {
      const std::int32_t most = get(motor, regs::kVelocityLimit);
      return {.lowest = -most, .highest = most};
    }
    case OperatingMode::kPosition:
      return {.lowest = get(motor, regs::kMinPositionLimit),
              .highest = std::max(get(motor, regs::kMinPositionLimit),
                                  get(motor, regs::kMaxPositionLimit))};
    default:
      return {.lowest = static_cast<std::int32_t>(regs::kGoalPosition.lowest),
              .highest = static_cast<std::int32_t>(regs::kGoalPosition.highest)};
  }
}

Outcome MotorGroup::send_goals(std::size_t count) noexcept {
  const Register& which = goal_register();
  for (std::size_t i = 0; i < count; ++i) {
    put_number(std::span(data_).subspan(i * which.size), static_cast<std::uint32_t>(last_goals_[i]),
               which.size);
  }
  return bus_.sync_write(std::span(options_.ids).first(count), which.address, which.size,
                         std::span(data_).first(count * which.size));
}

void MotorGroup::write_all(std::span<const double> goals) noexcept {
  for (std::size_t i = 0; i < num_driven(); ++i) {
    last_goals_[i] = raw_goal(i, i < goals.size() ? goals[i] : std::nan(""));
  }
  if (send_goals(num_driven()) == Outcome::kLineGone) note(MotorFault::kLineGone, 0);
}

void MotorGroup::look(std::size_t motor, Look what) noexcept {
  const MotorId id = ids_[motor];
  MotorReading& reading = readings_[motor];
  switch (what) {
    case Look::kTorque: {
      constexpr std::size_t kFirst = regs::kTorqueEnable.address;
      constexpr std::size_t kErrors = regs::kHardwareErrorStatus.address - kFirst;
      std::array<std::uint8_t, kErrors + 1> data{};
      if (!bus_.read(id, kFirst, data)) return;
      reading.has_torque = data[0] != 0;
      reading.hardware_errors = data[kErrors];
      if (reading.hardware_errors != 0) {
        note(MotorFault::kHardwareError, motor, reading.hardware_errors);
      } else if (!reading.has_torque && motor < num_driven()) {
        note(MotorFault::kTorqueLost, motor);
      }
      return;
    }
    case Look::kWatchdog: {
      std::int32_t value = 0;
      if (bus_.read(id, regs::kBusWatchdog, value) && value < 0) note(MotorFault::kWatchdog, motor);
      return;
    }
    case Look::kSupply: {
      std::array<std::uint8_t, 3> data{};
      if (!bus_.read(id, regs::kPresentInputVoltage.address, data)) return;
      reading.supply = number_in(std::span(data).first(2)) * regs::kPresentInputVoltage.scale;
      reading.temperature = data[2];
      return;
    }
  }
}

void MotorGroup::cycle(std::span<const double> goals) noexcept {
  ++cycles_;
  read_all();
  if (!is_started_ || fault_.kind != MotorFault::kNone) return;
  write_all(goals);
  if (cycles_ % static_cast<std::uint64_t>(options_.cycles_between_looks) != 0) return;
  look(looks_ / kLooks % size(), static_cast<Look>(looks_ % kLooks));
  ++looks_;
}

std::optional<MotorId> MotorGroup::release() noexcept {
  is_started_ = false;
  constexpr std::array<std::uint8_t, std::size_t{regs::kGoalCurrent.size} * kMaxMotors> kZeros{};
  const auto write_zeros = [&](const Register& which) {
    static_cast<void>(bus_.sync_write(options_.ids, which.address, which.size,
                                      std::span(kZeros).first(num_driven() * which.size)));
  };
  std::array<bool, kMaxMotors> is_off{};
  const auto find_on = [&] {
    return static_cast<std::size_t>(std::ranges::find(is_off, false) - is_off.begin());
  };
  const Instant end = bus_.port().now() + kReleaseLimit;
  do {
    // In modes with currents, a motor that hears only one of the two has no torque either.
    if (needs_current(options_.mode)) write_zeros(regs::kGoalCurrent);
    write_zeros(regs::kTorqueEnable);
    // An old answer must not pass for the confirmation.
    bus_.drop_late_answers();
    for (std::size_t i = 0; i < num_driven(); ++i) {
      if (is_off[i]) continue;
      std::int32_t torque = 0;
      is_off[i] = bus_.read(ids_[i], regs::kTorqueEnable, torque) && torque == 0;
      if (is_off[i]) readings_[i].has_torque = false;
    }
  } while (find_on() < num_driven() && bus_.port().is_open() && bus_.port().now() < end);
  return find_on() < num_driven() ? std::optional(ids_[find_on()]) : std::nullopt;
}

}  // namespace trifinger::dynamixel
