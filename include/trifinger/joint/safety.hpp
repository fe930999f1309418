// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/reasons.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

/// The memory of the checks for one joint, from one step to the next.
struct JointMemory {
  double accepted_position{kNotGiven};  ///< Target of the last accepted action; NaN for none [rad].
  double asked_torque{0.0};             ///< Torque of the last action before damping [Nm].
  double applied_torque{0.0};           ///< Torque applied in the last step [Nm].
  double heat{0.0};                     ///< 0 when cold; 1 after continuous torque for ever.
  double position{kNotGiven};           ///< Last measured position; NaN for none [rad].
  double velocity{kNotGiven};           ///< Last measured velocity; NaN for none [rad/s].
  double velocity_error{0.0};           ///< Filtered [rad/s].
  // Range of the torques since the measurements changed; empty at first [Nm].
  double least_torque{std::numeric_limits<double>::infinity()};
  double most_torque{-std::numeric_limits<double>::infinity()};
  double still_time{0.0};  ///< Time since this range is wider than `stuck_torque` [s].
};

/// Everything that the checks remember from one step to the next. It is plain data: save it,
/// restore it, keep thousands of them.
template <std::size_t N>
struct SafetyState {
  std::array<JointMemory, N> joints{};
};

/// Why the checks want the robot to stop. The values are stable, because drivers use them as fault
/// codes.
enum class SafetyFault : std::int32_t {
  kNone = 0,
  kHardLimit = 1,         ///< A joint is beyond its hard limit.
  kBadMeasurement = 2,    ///< A measured number is not finite or beyond `kPlausible`.
  kOwnCheck = 3,          ///< An added check has thrown an exception.
  kPositionJumped = 4,    ///< A position changed faster than `max_position_rate`.
  kVelocityMismatch = 5,  ///< Velocity and change of position differ by `max_velocity_error`.
  kStuck = 6,             ///< Nothing moved for `stuck_time` while the torque varied.
  kOverheated = 7,        ///< A motor is warmer than an obedient motor can be.
  kInterrupted = 8,       ///< No fault: an added check has thrown `Interrupted`.
};

/// A sentence without the joint, for example "a joint is beyond its hard limit".
[[nodiscard]] std::string_view describe(SafetyFault fault) noexcept;

/// The findings of the checks in one step. The reasons of the applied action tell which joint and
/// which field are concerned.
struct SafetyReport {
  SafetyFault fault{SafetyFault::kNone};
  std::int32_t joint{-1};       ///< The first joint at fault; -1 if no single joint is.
  bool action_rejected{false};  ///< The action was rejected at some joint.
};

/// The fault code that a driver reports: the fault in the lowest 8 bits, and above them the joint
/// counted from 1. A driver's own codes must have 64 or more in the lowest 8 bits.
[[nodiscard]] constexpr std::int32_t fault_code_of(const SafetyReport& report) noexcept {
  return static_cast<std::int32_t>(report.fault) + ((report.joint + 1) << 8);
}
/// The text of such a code, for example "joint 4 is beyond its hard limit"; empty if `fault_code`
/// is not from `fault_code_of`. The text is valid for ever. Do not call this first in the loop: the
/// first call makes the texts.
[[nodiscard]] std::string_view fault_text_of(std::int32_t fault_code) noexcept;

/// Larger measured positions [rad], velocities [rad/s] and torques [Nm] are not plausible. The
/// bound also keeps every sum below finite for any action.
inline constexpr double kPlausible = 1e6;

// The checks for one joint. They are pure functions, in the order in which the chain calls them.

/// The command for one joint. After `accept_command` all numbers are finite, except for the three
/// NaN that mean "no target".
struct JointCommand {
  double torque{0.0};
  double position{kNotGiven};
  double position_kp{kNotGiven};
  double position_kd{kNotGiven};
};

/// A command and the reasons for which it was changed.
struct CheckedCommand {
  JointCommand command;
  std::uint64_t reasons{0};
};

/// The measurements of one joint.
struct JointMeasurement {
  double position{0.0};
  double velocity{0.0};
  double torque{0.0};
};

/// A torque and the reasons for which it was changed.
struct CheckedTorque {
  double torque{0.0};
  std::uint64_t reasons{0};
};

/// Adds default gains to a target without gains, and removes gains without a target.
[[nodiscard]] inline JointCommand with_default_gains(
    JointCommand command, const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  if (std::isnan(command.position)) {
    command.position_kp = kNotGiven;
    command.position_kd = kNotGiven;
  } else {
    if (std::isnan(command.position_kp)) command.position_kp = limit.default_kp;
    if (std::isnan(command.position_kd)) command.position_kd = limit.default_kd;
  }
  return command;
}

/// Checks a command. A command that must be rejected becomes "hold `accepted_position`", or "no
/// torque" if that position is NaN.
[[nodiscard]] inline CheckedCommand accept_command(
    const JointCommand& desired, double accepted_position,
    const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  const JointCommand command = with_default_gains(desired, limit);
  std::uint64_t reasons = 0;
  if (!std::isfinite(command.torque)) reasons |= bit(Reason::kTorqueNotFinite);
  if (!std::isnan(command.position)) {
    const auto is_gain = [](double gain, double max) { return gain >= 0.0 && gain <= max; };
    if (std::isinf(command.position)) reasons |= bit(Reason::kPositionNotFinite);
    if (!is_gain(command.position_kp, limit.max_kp)) reasons |= bit(Reason::kKpOutOfBounds);
    if (!is_gain(command.position_kd, limit.max_kd)) reasons |= bit(Reason::kKdOutOfBounds);
  }
  if (reasons == 0) return {command, 0};
  return {with_default_gains({.position = accepted_position}, limit), reasons};
}

/// Clamps the target to the soft limits. A joint beyond a soft limit moves back with the default
/// gains, to the limit or to the user's target inside it. Torque that pushes further outward is
/// removed.
[[nodiscard]] inline CheckedCommand stay_within_soft_limits(
    JointCommand command, double position, const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  std::uint64_t reasons = 0;
  if (!std::isnan(command.position)) {
    const double clamped = std::clamp(command.position, limit.soft_lower, limit.soft_upper);
    if (clamped != command.position) {
      command.position = clamped;
      reasons |= bit(Reason::kTargetClamped);
    }
  }
  if (position < limit.soft_lower || position > limit.soft_upper) {
    const bool is_below = position < limit.soft_lower;
    JointCommand back = command;
    back.torque = is_below ? std::max(command.torque, 0.0) : std::min(command.torque, 0.0);
    if (std::isnan(back.position)) back.position = is_below ? limit.soft_lower : limit.soft_upper;
    back.position_kp = limit.default_kp;
    back.position_kd = limit.default_kd;
    // Comparisons with the NaN of "no target" are unequal, which is correct here.
    if (back.torque != command.torque || back.position != command.position ||
        back.position_kp != command.position_kp || back.position_kd != command.position_kd) {
      reasons |= bit(Reason::kPushedBack);
    }
    command = back;
  }
  return {command, reasons};
}

/// The torque of an accepted command: its own torque and, with a target, that of the PD.
[[nodiscard]] inline double torque_of(const JointCommand& command, double position,
                                      double velocity) noexcept TRIFINGER_REALTIME {
  if (std::isnan(command.position)) return command.torque;
  return command.torque +
         (command.position_kp * (command.position - position) - command.position_kd * velocity);
}

/// Limits the change of the requested torque since `before` to `max_torque_rate`. The result is a
/// torque that the user could have requested, so guarantees that hold for all requests do not
/// depend on this limit. Damping comes later and is never delayed. The way back from beyond a soft
/// limit is not delayed either.
[[nodiscard]] inline CheckedTorque limit_torque_rate(
    double torque, double before, double position, double elapsed,
    const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  const double step = limit.max_torque_rate * elapsed;
  const bool is_above = position > limit.soft_upper;
  const bool is_below = position < limit.soft_lower;
  double limited = torque;
  if (!is_below) limited = std::min(limited, before + step);
  if (!is_above) limited = std::max(limited, before - step);
  return {limited, limited != torque ? bit(Reason::kTorqueRateLimited) : 0U};
}

/// Clips the torque, damps it, and clips it again. `max_torque` is that of a cold motor or less.
[[nodiscard]] inline CheckedTorque limit_torque(double torque, double velocity, double max_torque,
                                                const JointLimit& limit) noexcept
    TRIFINGER_REALTIME {
  // Without the clip before damping, a huge request would outweigh the brake.
  const double clipped = std::clamp(torque, -max_torque, max_torque);
  const double damped = std::clamp(clipped - limit.safety_kd * velocity, -max_torque, max_torque);
  std::uint64_t reasons = 0;
  if (std::abs(torque) > limit.max_torque) reasons |= bit(Reason::kTorqueClipped);
  if (clipped != torque && max_torque < limit.max_torque) reasons |= bit(Reason::kDerated);
  if (damped != clipped) reasons |= bit(Reason::kDamped);
  return {damped, reasons};
}

/// Brakes a joint that is faster than `max_velocity`, or too fast to stop at the next soft limit
/// with the deceleration `braking`. No torque accelerates it further. The brake grows with the
/// excess speed and reaches `max_torque` at 1 rad/s.
[[nodiscard]] inline CheckedTorque limit_velocity(
    double torque, double position, double velocity, double max_torque,
    const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  constexpr double kBand = 1.0;
  const double distance =
      velocity > 0.0 ? limit.soft_upper - position : position - limit.soft_lower;
  // If `braking` is infinite, this is infinite or NaN, and std::min never takes it.
  const double stoppable = std::sqrt(2.0 * limit.braking * std::max(distance, 0.0));
  const double excess = std::abs(velocity) - std::min(limit.max_velocity, stoppable);
  if (!(excess > 0.0)) return {torque, 0};
  const double brake = max_torque * std::min(excess / kBand, 1.0);
  const double braked = velocity > 0.0 ? std::min(torque, -brake) : std::max(torque, brake);
  return {braked, braked != torque ? bit(Reason::kTooFast) : 0U};
}

/// Heat that counts as a fault. A motor that obeys stays below 1, so this one has given more torque
/// than it was told.
inline constexpr double kHeatOfFault = 1.2;
/// Heat above which the torque is limited.
inline constexpr double kHeatOfDerating = 0.8;

/// The heat of a motor after `elapsed` seconds with `torque`, the larger of applied and measured
/// torque. It is one implicit Euler step of heat' = ((torque / continuous_torque)^2 - heat) /
/// thermal_time.
[[nodiscard]] inline double heat_after(double heat, double torque, double elapsed,
                                       const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  // A larger value would say nothing more and would take long to decay.
  constexpr double kMost = 2.0;
  const double load = torque / limit.continuous_torque;
  const double share = elapsed / (limit.thermal_time + elapsed);
  const double after = heat + share * (load * load - heat);
  // The comparison is written so that NaN gives the largest heat.
  return after <= kMost ? std::max(after, 0.0) : kMost;
}

/// The torque that a motor of this heat may give: `max_torque` up to heat 0.8, then on a straight
/// line to `continuous_torque` at heat 1.
[[nodiscard]] inline double derated_torque(double heat,
                                           const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  const double least = std::min(limit.continuous_torque, limit.max_torque);
  // The comparison is written so that NaN gives the smallest torque.
  const double share = heat <= 1.0 ? std::min((1.0 - heat) / (1.0 - kHeatOfDerating), 1.0) : 0.0;
  return least + (limit.max_torque - least) * share;
}

/// 1 - `heat`, rounded down to multiples of 1/256, so that logs stay small.
[[nodiscard]] inline double thermal_margin_of(double heat) noexcept TRIFINGER_REALTIME {
  constexpr double kParts = 256.0;
  // The number is positive, so cutting off its fraction rounds down.
  return static_cast<double>(static_cast<int>((2.0 - heat) * kParts)) / kParts - 1.0;
}

/// Checks one joint's measurement. Returns 0, `kBadMeasurement` or `kHardLimit`.
[[nodiscard]] inline std::uint64_t check_measurement(
    const JointMeasurement& measured, const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  // The comparisons are written so that NaN fails.
  const bool is_plausible = std::abs(measured.position) <= kPlausible &&
                            std::abs(measured.velocity) <= kPlausible &&
                            std::abs(measured.torque) <= kPlausible;
  if (!is_plausible) return bit(Reason::kBadMeasurement);
  if (measured.position < limit.hard_lower || measured.position > limit.hard_upper) {
    return bit(Reason::kHardLimit);
  }
  return 0;
}

/// Returns `kPositionJumped` if the joint seems to have moved faster than `max_position_rate` since
/// `before`, otherwise 0. `before` may be NaN.
[[nodiscard]] inline std::uint64_t check_jump(double position, double before, double elapsed,
                                              const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  const bool has_jumped = std::abs(position - before) > limit.max_position_rate * elapsed;
  return has_jumped ? bit(Reason::kPositionJumped) : 0U;
}

/// The difference between the velocity and the change of position since the last measurement,
/// low-pass filtered with `velocity_error_time`. It compares the mean of both velocities, so steady
/// acceleration gives no error. A step longer than a tenth of this time changes nothing: too much
/// may have happened during the step.
[[nodiscard]] inline double velocity_error_after(
    const JointMemory& memory, const JointMeasurement& measured, double elapsed,
    const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  constexpr double kLongest = 0.1;
  const bool is_too_long = elapsed > kLongest * limit.velocity_error_time;
  if (std::isnan(memory.position) || is_too_long) return memory.velocity_error;
  const double error =
      0.5 * (measured.velocity + memory.velocity) - (measured.position - memory.position) / elapsed;
  const double share = elapsed / (limit.velocity_error_time + elapsed);
  return memory.velocity_error + share * (error - memory.velocity_error);
}

/// Returns 0 or `kVelocityMismatch`.
[[nodiscard]] inline std::uint64_t check_velocity(
    double velocity_error, const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  // The comparison is written so that NaN fails.
  const bool agrees = std::abs(velocity_error) <= limit.max_velocity_error;
  return agrees ? 0U : bit(Reason::kVelocityMismatch);
}

/// Remembers the range of torques during which the measurements have stayed exactly the same. Also
/// counts for how long this range has been wider than `stuck_torque`.
[[nodiscard]] inline JointMemory with_stillness(
    JointMemory memory, const JointMeasurement& measured, double elapsed,
    const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  if (measured.position != memory.position || measured.velocity != memory.velocity) {
    memory.least_torque = JointMemory{}.least_torque;
    memory.most_torque = JointMemory{}.most_torque;
    memory.still_time = 0.0;
    return memory;
  }
  memory.least_torque = std::min(memory.least_torque, memory.applied_torque);
  memory.most_torque = std::max(memory.most_torque, memory.applied_torque);
  if (memory.most_torque - memory.least_torque > limit.stuck_torque) memory.still_time += elapsed;
  return memory;
}

/// Returns `kStuck` if the joint is stuck, otherwise 0. A joint that is pressed against a wall is
/// still, too, but it moves when the torque changes.
[[nodiscard]] inline std::uint64_t check_stuck(double still_time, const JointLimit& limit) noexcept
    TRIFINGER_REALTIME {
  return still_time >= limit.stuck_time ? bit(Reason::kStuck) : 0U;
}

/// Returns 0 or `kOverheated`.
[[nodiscard]] inline std::uint64_t check_heat(double heat) noexcept TRIFINGER_REALTIME {
  return heat <= kHeatOfFault ? 0U : bit(Reason::kOverheated);
}

/// The most significant fault in the reasons of one joint; `kNone` without any. Implausible
/// measurements come first: if they cannot be true, the joint may not be where it seems to be.
[[nodiscard]] SafetyFault fault_of(std::uint64_t reasons) noexcept TRIFINGER_REALTIME;

/// Describes a rejected action: the first joint whose command was rejected.
struct RejectedCommand {
  std::size_t joint{0};
  std::uint64_t reasons{0};   ///< The bits of `kRejected` in the joint's reasons.
  JointCommand command;       ///< The command that was desired.
  bool is_own_check{false};   ///< The desired command was acceptable, but a check made it invalid.
  std::size_t num_values{0};  ///< Number of rejected values in the whole action.
};

/// Describes a rejection, for example "position_kd of joint 1 (finger_upper_to_middle_joint_0) is 1
/// Nms/rad, allowed are 0 to 0.5 (safety.max_kd)". `joint_name` may be empty. Needs no memory from
/// the heap.
[[nodiscard]] FixedText describe(const RejectedCommand& rejected, std::string_view joint_name,
                                 const JointLimit& limit) noexcept;

/// The checks between a desired action and the motors of the robot R. They are the same in
/// simulation and on hardware:
///
/// 1. Measurements that cannot be true, joints beyond a hard limit, and motors that are too warm
/// are faults. Every joint is then only damped.
/// 2. The action is checked as data. Joints whose command is rejected hold their last accepted
/// target.
/// 3. Checks that were added for this robot or task may change the action.
/// 4. Soft limits apply. Nothing above can override them.
/// 5. The torque follows: PD, limit of the torque rate, clip to what the heat allows, damp, clip.
/// 6. The velocity is limited.
///
/// docs/safety.md has the equation of each.
///
/// A chain is constant once set up. Threads may share one, each with its own `SafetyState`.
template <class R>
class SafetyChain {
 public:
  static constexpr std::size_t kJoints = R::kJoints;

  using Action = typename R::Action;
  using Observation = typename R::Observation;
  using AppliedAction = typename R::AppliedAction;
  using Limits = JointLimits<kJoints>;
  using State = SafetyState<kJoints>;

  /// A user's own check. It may look at the observation and change the action. The action that it
  /// gets is finite and has all gains; the check cannot break a limit. It runs in the loop: it must
  /// not wait, must not allocate, and must give the same answer for the same arguments. An
  /// exception that it throws becomes a fault with the exception's text; `Interrupted` ends the
  /// session without a fault.
  using Check = std::function<void(const Observation&, Action&)>;

  /// @throws InvalidArgument if `limits` make no sense.
  explicit SafetyChain(const Limits& limits) : limits_(limits) { validate(limits); }

  /// Adds a check after the existing ones.
  void add_check(Check check) { checks_.push_back(std::move(check)); }

  [[nodiscard]] const Limits& limits() const noexcept { return limits_; }

  /// Finds the action to apply instead of `desired`. `observation` is the newest one, `elapsed` the
  /// time since the previous step. If an added check throws, `thrown`, if given, receives the text,
  /// for example "a safety check threw an exception: too near".
  [[nodiscard]] SafetyReport apply(const Action& desired, const Observation& observation,
                                   Nanoseconds elapsed, State& state, AppliedAction& applied,
                                   FixedText* thrown = nullptr) const noexcept TRIFINGER_REALTIME {
    const double seconds = in_seconds(elapsed);
    SafetyReport report = check_measurements(observation, seconds, state, applied);
    if (report.fault != SafetyFault::kNone) {
      brake(observation, state, applied);
      return report;
    }

    Action accepted;
    for (std::size_t i = 0; i < kJoints; ++i) {
      double& accepted_position = state.joints[i].accepted_position;
      const CheckedCommand checked =
          accept_command(command_of(desired, i), accepted_position, limits_[i]);
      applied.reasons[i] = checked.reasons;
      // A rejected command becomes the last accepted target.
      accepted_position = checked.command.position;
      set_command(accepted, i, checked.command);
    }
    if (!checks_.empty()) {
      report.fault = run_own_checks(observation, accepted, state, applied, thrown);
      if (report.fault != SafetyFault::kNone) {
        brake(observation, state, applied);
        return report;
      }
    }

    for (std::size_t i = 0; i < kJoints; ++i) {
      const JointLimit& limit = limits_[i];
      JointMemory& memory = state.joints[i];
      const double position = observation.position[i];
      const double velocity = observation.velocity[i];
      std::uint64_t reasons = applied.reasons[i];
      report.action_rejected |= (reasons & kRejected) != 0;

      const CheckedCommand inside =
          stay_within_soft_limits(command_of(accepted, i), position, limit);
      const CheckedTorque asked = limit_torque_rate(torque_of(inside.command, position, velocity),
                                                    memory.asked_torque, position, seconds, limit);
      const double max_torque = derated_torque(memory.heat, limit);
      const CheckedTorque damped = limit_torque(asked.torque, velocity, max_torque, limit);
      const CheckedTorque safe =
          limit_velocity(damped.torque, position, velocity, max_torque, limit);
      reasons |= inside.reasons | asked.reasons | damped.reasons | safe.reasons;
      memory.asked_torque = std::clamp(asked.torque, -limit.max_torque, limit.max_torque);
      memory.applied_torque = safe.torque;

      JointCommand result = inside.command;
      result.torque = safe.torque;
      // Two changes may cancel each other; then nothing is left to explain. A rejected command
      // stays visible.
      if (reasons != 0 && (reasons & kRejected) == 0 &&
          is_as_asked(command_of(desired, i), result, position, velocity, limit)) {
        reasons = 0;
      }
      set_command(applied, i, result);
      applied.reasons[i] = reasons;
    }
    return report;
  }

  /// Describes why `apply` rejected `desired`. `applied` is the answer of that call.
  [[nodiscard]] RejectedCommand find_rejected(
      const Action& desired, const AppliedAction& applied) const noexcept TRIFINGER_REALTIME {
    RejectedCommand found;
    // The loop runs backwards, so that the first joint remains.
    for (std::size_t i = kJoints; i-- > 0;) {
      const std::uint64_t reasons = applied.reasons[i] & kRejected;
      if (reasons == 0) continue;
      const JointCommand command = command_of(desired, i);
      found = {.joint = i,
               .reasons = reasons,
               .command = command,
               .is_own_check = accept_command(command, kNotGiven, limits_[i]).reasons == 0,
               .num_values = found.num_values + static_cast<std::size_t>(std::popcount(reasons))};
    }
    return found;
  }

 private:
  template <class AnyAction>
  [[nodiscard]] static JointCommand command_of(const AnyAction& action,
                                               std::size_t joint) noexcept {
    return {action.torque[joint], action.position[joint], action.position_kp[joint],
            action.position_kd[joint]};
  }
  template <class AnyAction>
  static void set_command(AnyAction& action, std::size_t joint,
                          const JointCommand& command) noexcept {
    action.torque[joint] = command.torque;
    action.position[joint] = command.position;
    action.position_kp[joint] = command.position_kp;
    action.position_kd[joint] = command.position_kd;
  }

  // True if the values are equal or both "not given".
  [[nodiscard]] static bool is_same(double a, double b) noexcept {
    return a == b || (std::isnan(a) && std::isnan(b));
  }
  [[nodiscard]] static bool is_same(const JointCommand& a, const JointCommand& b) noexcept {
    return is_same(a.torque, b.torque) && is_same(a.position, b.position) &&
           is_same(a.position_kp, b.position_kp) && is_same(a.position_kd, b.position_kd);
  }

  // True if nothing differs, in the sense that AppliedJointAction promises.
  [[nodiscard]] static bool is_as_asked(const JointCommand& desired, const JointCommand& result,
                                        double position, double velocity,
                                        const JointLimit& limit) noexcept {
    JointCommand asked = with_default_gains(desired, limit);
    asked.torque = torque_of(asked, position, velocity);
    return is_same(asked, result);
  }

  // With an elapsed time of zero, every movement would be a jump.
  [[nodiscard]] static double in_seconds(Nanoseconds elapsed) noexcept {
    return std::chrono::duration<double>(std::max(elapsed, Nanoseconds(1))).count();
  }

  // Compares the measurements with the memory, then updates the memory.
  [[nodiscard]] SafetyReport check_measurements(const Observation& observation, double elapsed,
                                                State& state,
                                                AppliedAction& applied) const noexcept {
    SafetyReport report;
    for (std::size_t i = 0; i < kJoints; ++i) {
      const JointLimit& limit = limits_[i];
      JointMemory& memory = state.joints[i];
      const JointMeasurement measured{observation.position[i], observation.velocity[i],
                                      observation.torque[i]};
      std::uint64_t reasons = check_measurement(measured, limit);
      double torque = std::abs(memory.applied_torque);
      if (!has(reasons, Reason::kBadMeasurement)) {
        reasons |= check_jump(measured.position, memory.position, elapsed, limit);
        memory.velocity_error = velocity_error_after(memory, measured, elapsed, limit);
        reasons |= check_velocity(memory.velocity_error, limit);
        memory = with_stillness(memory, measured, elapsed, limit);
        reasons |= check_stuck(memory.still_time, limit);
        memory.position = measured.position;
        memory.velocity = measured.velocity;
        torque = std::max(torque, std::abs(measured.torque));
      }
      memory.heat = heat_after(memory.heat, torque, elapsed, limit);
      reasons |= check_heat(memory.heat);

      applied.reasons[i] = reasons;
      applied.thermal_margin[i] = thermal_margin_of(memory.heat);
      if (reasons != 0 && report.fault == SafetyFault::kNone) {
        report.joint = static_cast<std::int32_t>(i);
        report.fault = fault_of(reasons);
      }
    }
    return report;
  }

  // Damps every joint whose velocity is plausible, and applies no other torque.
  void brake(const Observation& observation, State& state, AppliedAction& applied) const noexcept {
    for (std::size_t i = 0; i < kJoints; ++i) {
      JointMemory& memory = state.joints[i];
      const bool is_known = (applied.reasons[i] & kImplausible) == 0;
      memory.asked_torque = 0.0;
      memory.applied_torque = limit_torque(0.0, is_known ? observation.velocity[i] : 0.0,
                                           derated_torque(memory.heat, limits_[i]), limits_[i])
                                  .torque;
      set_command(applied, i, {.torque = memory.applied_torque});
      applied.reasons[i] |= bit(Reason::kBraking);
    }
  }

  // Runs the added checks and returns the fault if one has thrown.
  [[nodiscard]] SafetyFault run_own_checks(const Observation& observation, Action& accepted,
                                           const State& state, AppliedAction& applied,
                                           FixedText* thrown) const noexcept {
    Action changed = accepted;
    const auto failed = [&](SafetyFault fault) {
      for (std::uint64_t& reasons : applied.reasons) reasons |= bit(Reason::kOwnCheckFailed);
      return fault;
    };
    try {
      for (const Check& check : checks_) check(observation, changed);
    } catch (const Interrupted&) {
      return failed(SafetyFault::kInterrupted);
    } catch (...) {
      if (thrown != nullptr) *thrown = FixedText("a safety check ").append_exception();
      return failed(SafetyFault::kOwnCheck);
    }
    for (std::size_t i = 0; i < kJoints; ++i) {
      const JointCommand after = command_of(changed, i);
      if (is_same(after, command_of(accepted, i))) continue;
      // A check deserves no more trust than a user: its result is data to be checked.
      const CheckedCommand checked =
          accept_command(after, state.joints[i].accepted_position, limits_[i]);
      applied.reasons[i] |= checked.reasons | bit(Reason::kOwnCheck);
      set_command(accepted, i, checked.command);
    }
    return SafetyFault::kNone;
  }

  Limits limits_;
  std::vector<Check> checks_;
};

}  // namespace trifinger
