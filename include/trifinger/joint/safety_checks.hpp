// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/reasons.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/realtime/annotations.hpp"

/// \file
/// The safety checks for one joint, in the order in which the chain in safety.hpp calls them. They
/// are pure functions: numbers in, numbers out. Each says what it does, its equation, and the
/// reason that it gives when it changes or refuses something.
///
/// In the equations q, v and τ are the joint's measured position [rad], velocity [rad/s] and torque
/// [Nm]; Δ is `elapsed`, the time since the previous step [s]. Names in `code` are fields of
/// `JointLimit`.

namespace trifinger {

/// The measurements of one joint.
struct JointMeasurement {
  double position{0.0};
  double velocity{0.0};
  double torque{0.0};
};

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

/// A torque and the reasons for which it was changed.
struct CheckedTorque {
  double torque{0.0};
  std::uint64_t reasons{0};
};

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

/// Larger measured positions [rad], velocities [rad/s] and torques [Nm] are not plausible. The
/// bound also keeps every sum below finite for any action.
inline constexpr double kPlausible = 1e6;
/// Heat above which the torque is limited.
inline constexpr double kHeatOfDerating = 0.8;
/// Heat that counts as a fault. A motor that obeys stays below 1, so this one has given more torque
/// than was commanded.
inline constexpr double kHeatOfFault = 1.2;

/// @name Is the measurement true, and is the joint where it may be?
/// Each returns 0 or the reason of a fault.
/// @{

/// Finds measurements that are no plausible numbers, and joints beyond a hard limit.
///
///     |q|, |v|, |τ| <= kPlausible      otherwise kBadMeasurement
///     hard_lower <= q <= hard_upper    otherwise kHardLimit
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

/// Finds a position that changed faster than a joint can move. `before` may be NaN.
///
///     |q - before| <= max_position_rate Δ    otherwise kPositionJumped
[[nodiscard]] inline std::uint64_t check_jump(double position, double before, double elapsed,
                                              const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  const bool has_jumped = std::abs(position - before) > limit.max_position_rate * elapsed;
  return has_jumped ? bit(Reason::kPositionJumped) : 0U;
}

/// The difference between velocity and change of position, low-pass filtered. `check_velocity`
/// judges it.
///
///     e' = e + Δ / (velocity_error_time + Δ) ((v + v before) / 2 - (q - q before) / Δ - e)
///
/// With the mean of both velocities, steady acceleration gives no error. A step longer than a tenth
/// of `velocity_error_time` changes nothing: too much may have happened during the step.
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

/// Finds a velocity that is not that of the position.
///
///     |e| <= max_velocity_error    otherwise kVelocityMismatch
[[nodiscard]] inline std::uint64_t check_velocity(
    double velocity_error, const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  // The comparison is written so that NaN fails.
  const bool agrees = std::abs(velocity_error) <= limit.max_velocity_error;
  return agrees ? 0U : bit(Reason::kVelocityMismatch);
}

/// Remembers the range of applied torques during which q and v have stayed exactly the same, and
/// for how long this range has been wider than `stuck_torque`. `check_stuck` judges this time.
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

/// Finds a joint that does not move while its torque changes. A joint that is pressed against a
/// wall is still, too, but it moves when the torque changes.
///
///     still time < stuck_time    otherwise kStuck
[[nodiscard]] inline std::uint64_t check_stuck(double still_time, const JointLimit& limit) noexcept
    TRIFINGER_REALTIME {
  return still_time >= limit.stuck_time ? bit(Reason::kStuck) : 0U;
}

/// The heat of a motor after `elapsed` with `torque`, the larger of applied and measured torque. It
/// is one implicit Euler step of
///
///     heat' = ((torque / continuous_torque)^2 - heat) / thermal_time
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

/// Finds a motor that is warmer than an obedient motor can be.
///
///     heat <= kHeatOfFault    otherwise kOverheated
[[nodiscard]] inline std::uint64_t check_heat(double heat) noexcept TRIFINGER_REALTIME {
  return heat <= kHeatOfFault ? 0U : bit(Reason::kOverheated);
}

/// 1 - `heat`, rounded down to multiples of 1/256, so that logs stay small.
[[nodiscard]] inline double thermal_margin_of(double heat) noexcept TRIFINGER_REALTIME {
  constexpr double kParts = 256.0;
  // The number is positive, so cutting off its fraction rounds down.
  return static_cast<double>(static_cast<int>((2.0 - heat) * kParts)) / kParts - 1.0;
}

/// @}
/// @name Which command is accepted?
/// @{

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
///
///     torque is finite              otherwise kTorqueNotFinite
///     position is finite            otherwise kPositionNotFinite
///     0 <= position_kp <= max_kp    otherwise kKpOutOfBounds
///     0 <= position_kd <= max_kd    otherwise kKdOutOfBounds
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

/// Keeps a joint within its soft limits.
///
///     position' = clamp(position, soft_lower, soft_upper)    changed: kTargetClamped
///
/// A joint beyond a soft limit moves back with the default gains, to the limit or to the user's
/// target inside it. Torque that pushes further outward is removed (`kPushedBack`).
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

/// @}
/// @name Which torque follows?
/// @{

/// The torque of an accepted command: its own torque and, with a target, that of the PD.
///
///     torque + position_kp (position - q) - position_kd v
[[nodiscard]] inline double torque_of(const JointCommand& command, double position,
                                      double velocity) noexcept TRIFINGER_REALTIME {
  if (std::isnan(command.position)) return command.torque;
  return command.torque +
         (command.position_kp * (command.position - position) - command.position_kd * velocity);
}

/// Limits the change of the requested torque since `before`.
///
///     clamp(torque, before - max_torque_rate Δ, before + max_torque_rate Δ)
///                                               changed: kTorqueRateLimited
///
/// The result is a torque that the user could have requested, so guarantees that hold for all
/// requests do not depend on this limit. Damping comes later and is never delayed. The way back
/// from beyond a soft limit is not delayed either.
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

/// The torque that a motor of this heat may give: `max_torque` up to heat 0.8, then on a straight
/// line to `continuous_torque` at heat 1.
[[nodiscard]] inline double derated_torque(double heat,
                                           const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  const double least = std::min(limit.continuous_torque, limit.max_torque);
  // The comparison is written so that NaN gives the smallest torque.
  const double share = heat <= 1.0 ? std::min((1.0 - heat) / (1.0 - kHeatOfDerating), 1.0) : 0.0;
  return least + (limit.max_torque - least) * share;
}

/// Clips the torque, damps it, and clips it again. `max_torque` is that of a cold motor or less.
///
///     clip(clip(torque) - safety_kd v), where clip is to ± max_torque
///
/// The first clip gives `kTorqueClipped`, or `kDerated` if the motor is warm; the damping gives
/// `kDamped`.
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

/// Brakes a joint that is faster than `max_velocity`, or too fast to stop at the next soft limit,
/// at distance d, with the deceleration `braking`. No torque accelerates it further.
///
///     excess = |v| - min(max_velocity, √(2 braking d))
///     torque along v <= -max_torque min(excess / (1 rad/s), 1)    changed: kTooFast
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

/// @}

}  // namespace trifinger
