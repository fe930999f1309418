// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>
#include <utility>
#include <vector>

#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/reasons.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

/// All that the checks remember from one step to the next. Plain data: save it, restore it, hold a
/// thousand of them.
template <std::size_t N>
struct SafetyState {
  /// The target of the last action that was accepted; NaN where it had none [rad].
  JointVector<N> accepted_position{detail::filled<N>(kNotGiven)};

  friend bool operator==(const SafetyState&, const SafetyState&) = default;
};

/// Why the checks want the robot to stop. The values are stable: drivers use them as their fault
/// code.
enum class SafetyFault : std::int32_t {
  kNone = 0,
  kHardLimit = 1,       ///< A joint is beyond its hard limit.
  kBadMeasurement = 2,  ///< A position or velocity is not finite or beyond `kPlausible`.
  kOwnCheck = 3,        ///< A check that was added has thrown.
};

/// A sentence without the joint, as in "a joint is beyond its hard limit".
[[nodiscard]] std::string_view describe(SafetyFault fault) noexcept;

/// What the checks found in one step. Which joint and which field is in the reasons of the applied
/// action.
struct SafetyReport {
  SafetyFault fault{SafetyFault::kNone};
  std::int32_t joint{-1};       ///< The first joint at fault, -1 if it is none in particular.
  bool action_rejected{false};  ///< The action was not fit to apply at some joint.
};

/// What a driver reports as its fault code: the fault and, above the lowest 8 bits, the joint
/// counted from 1. The driver's own codes need the lowest 8 bits to be 64 or more.
[[nodiscard]] constexpr std::int32_t fault_code_of(const SafetyReport& report) noexcept {
  return static_cast<std::int32_t>(report.fault) + ((report.joint + 1) << 8);
}
/// "joint 4 is beyond its hard limit"; empty if `fault_code` is not from `fault_code_of`. Lives for
/// ever. Not for the loop: the first call makes the texts.
[[nodiscard]] std::string_view fault_text_of(std::int32_t fault_code) noexcept;

/// Larger measured positions [rad] and velocities [rad/s] are no measurements. The bound also keeps
/// every sum below finite, whatever is asked.
inline constexpr double kPlausible = 1e6;

// The checks, one joint at a time. Pure functions, in the order in which the chain calls them.

/// The limits of one joint.
struct JointLimit {
  double max_torque;
  double safety_kd;
  double soft_lower;
  double soft_upper;
  double hard_lower;
  double hard_upper;
  double default_kp;
  double default_kd;
  double max_kp;
  double max_kd;
};

/// What one joint is asked to do. After `accept_command` all of it is finite, but for the three NaN
/// of "no target".
struct JointCommand {
  double torque{0.0};
  double position{kNotGiven};
  double position_kp{kNotGiven};
  double position_kd{kNotGiven};
};

/// A command and why it is no longer the one that came in.
struct CheckedCommand {
  JointCommand command;
  std::uint64_t reasons{0};
};

/// A torque and why it is no longer the one that came in.
struct CheckedTorque {
  double torque{0.0};
  std::uint64_t reasons{0};
};

/// The command with default gains where a target has none, and without gains where there is no
/// target.
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

/// Takes a command as data. One that is not fit to apply becomes "hold `accepted_position`", or "no
/// torque" if that is NaN.
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

/// Clamps the target to the soft limits. A joint beyond one of them goes back with the default
/// gains, to the limit or to the user's target inside; torque that pushes further out is taken
/// away.
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
    // Comparisons with the NaN of "no target" are unequal, as they should be.
    if (back.torque != command.torque || back.position != command.position ||
        back.position_kp != command.position_kp || back.position_kd != command.position_kd) {
      reasons |= bit(Reason::kPushedBack);
    }
    command = back;
  }
  return {command, reasons};
}

/// The torque of an accepted command: its own and, with a target, that of the PD.
[[nodiscard]] inline double torque_of(const JointCommand& command, double position,
                                      double velocity) noexcept TRIFINGER_REALTIME {
  if (std::isnan(command.position)) return command.torque;
  return command.torque +
         (command.position_kp * (command.position - position) - command.position_kd * velocity);
}

/// Clip, damp, clip.
[[nodiscard]] inline CheckedTorque limit_torque(
    double torque, double velocity, const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  const auto clip = [&](double value) {
    return std::clamp(value, -limit.max_torque, limit.max_torque);
  };
  // Clip before damping too, or a huge request would drown the brake.
  const double clipped = clip(torque);
  const double damped = clip(clipped - limit.safety_kd * velocity);
  std::uint64_t reasons = 0;
  if (clipped != torque) reasons |= bit(Reason::kTorqueClipped);
  if (damped != clipped) reasons |= bit(Reason::kDamped);
  return {damped, reasons};
}

/// Whether one joint's measurement lets the robot go on: 0, `kBadMeasurement` or `kHardLimit`.
[[nodiscard]] inline std::uint64_t check_measurement(
    double position, double velocity, const JointLimit& limit) noexcept TRIFINGER_REALTIME {
  // Written so that NaN fails.
  const bool is_plausible = std::abs(position) <= kPlausible && std::abs(velocity) <= kPlausible;
  if (!is_plausible) return bit(Reason::kBadMeasurement);
  if (position < limit.hard_lower || position > limit.hard_upper) return bit(Reason::kHardLimit);
  return 0;
}

/// The checks that stand between a desired action and the motors of the robot R, the same in
/// simulation and on hardware:
///
///  1. measurements that are no numbers, and joints beyond a hard limit: a fault, every joint is
///  damped only;
///  2. the action as data: joints whose command is not fit to apply hold their last accepted
///  target;
///  3. checks that were added for this robot or task;
///  4. soft limits, which nothing above can override;
///  5. PD, clip, damp, clip.
///
/// Constant once set up: threads may share one chain, each with its own `SafetyState`.
template <class R>
class SafetyChain {
 public:
  static constexpr std::size_t kJoints = R::kJoints;

  using Action = typename R::Action;
  using Observation = typename R::Observation;
  using AppliedAction = typename R::AppliedAction;
  using Limits = JointLimits<kJoints>;
  using State = SafetyState<kJoints>;

  /// A user's own check: looks at the observation and changes the action as it sees fit. It gets an
  /// action that is finite, with all gains filled in, and it cannot break a limit. It runs in the
  /// loop: no waiting, no memory from the heap, the same answer for the same arguments.
  using Check = std::function<void(const Observation&, Action&)>;

  /// @throws InvalidArgument if `limits` make no sense.
  explicit SafetyChain(const Limits& limits) : limits_(limits) {
    limits.validate();
    for (std::size_t i = 0; i < kJoints; ++i) {
      joint_limits_[i] = {limits.max_torque[i], limits.safety_kd[i],  limits.soft_lower[i],
                          limits.soft_upper[i], limits.hard_lower[i], limits.hard_upper[i],
                          limits.default_kp[i], limits.default_kd[i], limits.max_kp[i],
                          limits.max_kd[i]};
    }
  }

  /// Adds a check behind those that are there.
  void add_check(Check check) { checks_.push_back(std::move(check)); }

  [[nodiscard]] const Limits& limits() const noexcept { return limits_; }

  /// Finds what may be applied in place of `desired`, given the newest `observation`.
  [[nodiscard]] SafetyReport apply(const Action& desired, const Observation& observation,
                                   State& state,
                                   AppliedAction& applied) const noexcept TRIFINGER_REALTIME {
    SafetyReport report = check_measurements(observation, applied);
    if (report.fault != SafetyFault::kNone) {
      brake(observation, applied);
      return report;
    }

    Action accepted;
    for (std::size_t i = 0; i < kJoints; ++i) {
      const CheckedCommand checked =
          accept_command(command_of(desired, i), state.accepted_position[i], joint_limits_[i]);
      applied.reasons[i] = checked.reasons;
      // A rejected command is the last accepted target itself.
      state.accepted_position[i] = checked.command.position;
      set_command(accepted, i, checked.command);
    }
    if (!checks_.empty() && !run_own_checks(observation, accepted, state, applied)) {
      brake(observation, applied);
      report.fault = SafetyFault::kOwnCheck;
      return report;
    }

    for (std::size_t i = 0; i < kJoints; ++i) {
      const JointLimit& limit = joint_limits_[i];
      const double position = observation.position[i];
      const double velocity = observation.velocity[i];
      std::uint64_t reasons = applied.reasons[i];
      report.action_rejected |= (reasons & kRejected) != 0;

      const CheckedCommand inside =
          stay_within_soft_limits(command_of(accepted, i), position, limit);
      const CheckedTorque safe =
          limit_torque(torque_of(inside.command, position, velocity), velocity, limit);
      reasons |= inside.reasons | safe.reasons;

      JointCommand result = inside.command;
      result.torque = safe.torque;
      // Two changes may cancel each other; then there is nothing to explain. A command that was not
      // fit stays visible.
      if (reasons != 0 && (reasons & kRejected) == 0 &&
          is_as_asked(command_of(desired, i), result, position, velocity, limit)) {
        reasons = 0;
      }
      set_command(applied, i, result);
      applied.reasons[i] = reasons;
    }
    return report;
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

  // Equal, or both "not given".
  [[nodiscard]] static bool is_same(double a, double b) noexcept {
    return a == b || (std::isnan(a) && std::isnan(b));
  }
  [[nodiscard]] static bool is_same(const JointCommand& a, const JointCommand& b) noexcept {
    return is_same(a.torque, b.torque) && is_same(a.position, b.position) &&
           is_same(a.position_kp, b.position_kp) && is_same(a.position_kd, b.position_kd);
  }

  // The definition of "nothing differs" that AppliedJointAction promises.
  [[nodiscard]] static bool is_as_asked(const JointCommand& desired, const JointCommand& result,
                                        double position, double velocity,
                                        const JointLimit& limit) noexcept {
    JointCommand asked = with_default_gains(desired, limit);
    asked.torque = torque_of(asked, position, velocity);
    return is_same(asked, result);
  }

  [[nodiscard]] SafetyReport check_measurements(const Observation& observation,
                                                AppliedAction& applied) const noexcept {
    SafetyReport report;
    for (std::size_t i = 0; i < kJoints; ++i) {
      applied.reasons[i] =
          check_measurement(observation.position[i], observation.velocity[i], joint_limits_[i]);
      if (applied.reasons[i] != 0 && report.fault == SafetyFault::kNone) {
        report.joint = static_cast<std::int32_t>(i);
        report.fault = has(applied.reasons[i], Reason::kHardLimit) ? SafetyFault::kHardLimit
                                                                   : SafetyFault::kBadMeasurement;
      }
    }
    return report;
  }

  // Every joint is damped, as far as its velocity is known, and nothing else.
  void brake(const Observation& observation, AppliedAction& applied) const noexcept {
    for (std::size_t i = 0; i < kJoints; ++i) {
      const double velocity = observation.velocity[i];
      const bool is_known = std::abs(velocity) <= kPlausible;
      set_command(
          applied, i,
          {.torque = limit_torque(0.0, is_known ? velocity : 0.0, joint_limits_[i]).torque});
      applied.reasons[i] |= bit(Reason::kBraking);
    }
  }

  // Answers false if a check has thrown.
  [[nodiscard]] bool run_own_checks(const Observation& observation, Action& accepted,
                                    const State& state, AppliedAction& applied) const noexcept {
    Action changed = accepted;
    try {
      for (const Check& check : checks_) check(observation, changed);
    } catch (...) {
      for (std::uint64_t& reasons : applied.reasons) reasons |= bit(Reason::kOwnCheckFailed);
      return false;
    }
    for (std::size_t i = 0; i < kJoints; ++i) {
      const JointCommand after = command_of(changed, i);
      if (is_same(after, command_of(accepted, i))) continue;
      // A check is no better than a user: what it leaves behind is data to be checked.
      const CheckedCommand checked =
          accept_command(after, state.accepted_position[i], joint_limits_[i]);
      applied.reasons[i] |= checked.reasons | bit(Reason::kOwnCheck);
      set_command(accepted, i, checked.command);
    }
    return true;
  }

  Limits limits_;
  std::array<JointLimit, kJoints> joint_limits_{};
  std::vector<Check> checks_;
};

}  // namespace trifinger
