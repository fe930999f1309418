// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/reasons.hpp"
#include "trifinger/joint/safety_checks.hpp"
#include "trifinger/realtime/annotations.hpp"

/// \file
/// The safety chain of one joint, made of the checks in safety_checks.hpp. `SafetyChain` calls
/// these functions for each joint of a robot; src/gpu/safety_worlds.cpp of the package
/// trifinger_gpu calls them for thousands of robots, also on a GPU. So they use no heap, no
/// exceptions and no library but the functions of cmath.
///
/// A step of a robot is `remember_measurement` for all joints. If it finds a fault anywhere, all
/// joints `brake_joint`. Otherwise each joint has its command accepted, by `accept_and_remember`,
/// and limited, by `limit_joint`.

namespace trifinger {

/// Compares a measurement with the memory, updates the memory, and warms the motor. Returns 0 or
/// the reasons of a fault.
[[nodiscard]] inline std::uint64_t remember_measurement(
    const JointMeasurement& measured, double elapsed, const JointLimit& limit,
    JointMemory& memory) noexcept TRIFINGER_REALTIME {
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
  return reasons | check_heat(memory.heat);
}

/// Checks a command as data, and remembers its target. A rejected command becomes the last accepted
/// target.
[[nodiscard]] inline CheckedCommand accept_and_remember(
    const JointCommand& desired, const JointLimit& limit,
    JointMemory& memory) noexcept TRIFINGER_REALTIME {
  const CheckedCommand checked = accept_command(desired, memory.accepted_position, limit);
  memory.accepted_position = checked.command.position;
  return checked;
}

namespace detail {

// True if the values are equal or both "not given".
[[nodiscard]] inline bool is_same(double a, double b) noexcept {
  return a == b || (std::isnan(a) && std::isnan(b));
}
[[nodiscard]] inline bool is_same(const JointCommand& a, const JointCommand& b) noexcept {
  return is_same(a.torque, b.torque) && is_same(a.position, b.position) &&
         is_same(a.position_kp, b.position_kp) && is_same(a.position_kd, b.position_kd);
}

// True if nothing differs, in the sense that AppliedJointAction promises.
[[nodiscard]] inline bool is_as_asked(const JointCommand& desired, const JointCommand& result,
                                      double position, double velocity,
                                      const JointLimit& limit) noexcept {
  JointCommand asked = with_default_gains(desired, limit);
  asked.torque = torque_of(asked, position, velocity);
  return is_same(asked, result);
}

}  // namespace detail

/// Applies soft limits, finds the torque and limits it. `accepted` is the accepted command with the
/// reasons so far. The result is the command that acts: its torque has that of its target.
[[nodiscard]] inline CheckedCommand limit_joint(const JointCommand& desired,
                                                const CheckedCommand& accepted,
                                                const JointMeasurement& measured, double elapsed,
                                                const JointLimit& limit,
                                                JointMemory& memory) noexcept TRIFINGER_REALTIME {
  const double position = measured.position;
  const double velocity = measured.velocity;
  const CheckedCommand inside = stay_within_soft_limits(accepted.command, position, limit);
  const CheckedTorque asked = limit_torque_rate(torque_of(inside.command, position, velocity),
                                                memory.asked_torque, position, elapsed, limit);
  const double max_torque = derated_torque(memory.heat, limit);
  const CheckedTorque damped = limit_torque(asked.torque, velocity, max_torque, limit);
  const CheckedTorque safe = limit_velocity(damped.torque, position, velocity, max_torque, limit);
  memory.asked_torque = std::clamp(asked.torque, -limit.max_torque, limit.max_torque);
  memory.applied_torque = safe.torque;

  CheckedCommand result{inside.command, accepted.reasons | inside.reasons | asked.reasons |
                                            damped.reasons | safe.reasons};
  result.command.torque = safe.torque;
  // Two changes may cancel each other; then nothing is left to explain. A rejected command stays
  // visible.
  if (result.reasons != 0 && (result.reasons & kRejected) == 0 &&
      detail::is_as_asked(desired, result.command, position, velocity, limit)) {
    result.reasons = 0;
  }
  return result;
}

/// Damps the joint after a fault of the robot and applies no other torque. `reasons` are what was
/// found at this joint.
[[nodiscard]] inline CheckedCommand brake_joint(double velocity, std::uint64_t reasons,
                                                const JointLimit& limit,
                                                JointMemory& memory) noexcept TRIFINGER_REALTIME {
  // A velocity that is not plausible damps nothing.
  const bool is_known = (reasons & kImplausible) == 0;
  memory.asked_torque = 0.0;
  memory.applied_torque =
      limit_torque(0.0, is_known ? velocity : 0.0, derated_torque(memory.heat, limit), limit)
          .torque;
  return {{.torque = memory.applied_torque}, reasons | bit(Reason::kBraking)};
}

}  // namespace trifinger
