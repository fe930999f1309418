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
#include <utility>
#include <vector>

#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/joint/joint_chain.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/reasons.hpp"
#include "trifinger/joint/safety_checks.hpp"  // IWYU pragma: export
#include "trifinger/joint/safety_report.hpp"  // IWYU pragma: export
#include "trifinger/joint/types.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

/// Everything that the checks remember from one step to the next. It is plain data: save it,
/// restore it, keep thousands of them.
template <std::size_t N>
struct SafetyState {
  std::array<JointMemory, N> joints{};
};

namespace detail {

// Where the chain of a robot keeps the limits and the memory of its joints. A robot whose joints
// are counted at run time names its own types.
template <class R>
struct SafetyTypes {
  using Limits = JointLimits<R::kJoints>;
  using State = SafetyState<R::kJoints>;
};
template <class R>
  requires requires { typename R::SafetyState; }
struct SafetyTypes<R> {
  using Limits = typename R::Limits;
  using State = typename R::SafetyState;
};

}  // namespace detail

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
/// safety_checks.hpp has the checks with their equations, joint_chain.hpp their order,
/// docs/safety.md the proof.
///
/// A chain is constant once set up. Threads may share one, each with its own `SafetyState`.
template <class R>
class SafetyChain {
 public:
  using Action = typename R::Action;
  using Observation = typename R::Observation;
  using AppliedAction = typename R::AppliedAction;
  using Limits = typename detail::SafetyTypes<R>::Limits;
  using State = typename detail::SafetyTypes<R>::State;

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
                                   FixedText* thrown = nullptr) const noexcept TRIFINGER_REALTIME;

  /// Describes why `apply` rejected `desired`. `applied` is the answer of that call.
  [[nodiscard]] RejectedCommand find_rejected(
      const Action& desired, const AppliedAction& applied) const noexcept TRIFINGER_REALTIME;

 private:
  // The parts of `apply`, in this order. Each writes what it finds to `applied`.
  [[nodiscard]] SafetyReport check_measurements(const Observation& observation, double elapsed,
                                                State& state,
                                                AppliedAction& applied) const noexcept;
  [[nodiscard]] Action accept(const Action& desired, State& state,
                              AppliedAction& applied) const noexcept;
  [[nodiscard]] SafetyFault run_own_checks(const Observation& observation, Action& accepted,
                                           const State& state, AppliedAction& applied,
                                           FixedText* thrown) const noexcept;
  void limit(std::size_t joint, const Action& desired, const Action& accepted,
             const Observation& observation, double elapsed, JointMemory& memory,
             AppliedAction& applied) const noexcept;
  // Instead of the rest, after a fault: damps every joint and applies no other torque.
  void brake(const Observation& observation, State& state, AppliedAction& applied) const noexcept;

  Limits limits_;
  std::vector<Check> checks_;
};

namespace detail {

template <class Action>
[[nodiscard]] JointCommand command_of(const Action& action, std::size_t joint) noexcept {
  return {action.torque[joint], action.position[joint], action.position_kp[joint],
          action.position_kd[joint]};
}

template <class Observation>
[[nodiscard]] JointMeasurement measurement_of(const Observation& observation,
                                              std::size_t joint) noexcept {
  return {observation.position[joint], observation.velocity[joint], observation.torque[joint]};
}

template <class Action>
void set_command(Action& action, std::size_t joint, const JointCommand& command) noexcept {
  action.torque[joint] = command.torque;
  action.position[joint] = command.position;
  action.position_kp[joint] = command.position_kp;
  action.position_kd[joint] = command.position_kd;
}

}  // namespace detail

template <class R>
SafetyReport SafetyChain<R>::apply(const Action& desired, const Observation& observation,
                                   Nanoseconds elapsed, State& state, AppliedAction& applied,
                                   FixedText* thrown) const noexcept TRIFINGER_REALTIME {
  // With an elapsed time of zero, every movement would be a jump.
  const double seconds = std::chrono::duration<double>(std::max(elapsed, Nanoseconds(1))).count();
  SafetyReport report = check_measurements(observation, seconds, state, applied);
  if (report.fault != SafetyFault::kNone) {
    brake(observation, state, applied);
    return report;
  }
  Action accepted = accept(desired, state, applied);
  if (!checks_.empty()) {
    report.fault = run_own_checks(observation, accepted, state, applied, thrown);
    if (report.fault != SafetyFault::kNone) {
      brake(observation, state, applied);
      return report;
    }
  }
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    report.action_rejected |= (applied.reasons[i] & kRejected) != 0;
    limit(i, desired, accepted, observation, seconds, state.joints[i], applied);
  }
  return report;
}

// Compares the measurements with the memory, then updates the memory.
template <class R>
SafetyReport SafetyChain<R>::check_measurements(const Observation& observation, double elapsed,
                                                State& state,
                                                AppliedAction& applied) const noexcept {
  SafetyReport report;
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    JointMemory& memory = state.joints[i];
    const std::uint64_t reasons =
        remember_measurement(detail::measurement_of(observation, i), elapsed, limits_[i], memory);
    applied.reasons[i] = reasons;
    applied.thermal_margin[i] = thermal_margin_of(memory.heat);
    if (reasons != 0 && report.fault == SafetyFault::kNone) {
      report.joint = static_cast<std::int32_t>(i);
      report.fault = fault_of(reasons);
    }
  }
  return report;
}

template <class R>
auto SafetyChain<R>::accept(const Action& desired, State& state,
                            AppliedAction& applied) const noexcept -> Action {
  Action accepted = desired;
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const CheckedCommand checked =
        accept_and_remember(detail::command_of(desired, i), limits_[i], state.joints[i]);
    applied.reasons[i] = checked.reasons;
    detail::set_command(accepted, i, checked.command);
  }
  return accepted;
}

// Returns the fault if a check has thrown.
template <class R>
SafetyFault SafetyChain<R>::run_own_checks(const Observation& observation, Action& accepted,
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
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const JointCommand after = detail::command_of(changed, i);
    if (detail::is_same(after, detail::command_of(accepted, i))) continue;
    // A check deserves no more trust than a user: its result is data to be checked.
    const CheckedCommand checked =
        accept_command(after, state.joints[i].accepted_position, limits_[i]);
    applied.reasons[i] |= checked.reasons | bit(Reason::kOwnCheck);
    detail::set_command(accepted, i, checked.command);
  }
  return SafetyFault::kNone;
}

template <class R>
void SafetyChain<R>::limit(std::size_t joint, const Action& desired, const Action& accepted,
                           const Observation& observation, double elapsed, JointMemory& memory,
                           AppliedAction& applied) const noexcept {
  const CheckedCommand result =
      limit_joint(detail::command_of(desired, joint),
                  {detail::command_of(accepted, joint), applied.reasons[joint]},
                  detail::measurement_of(observation, joint), elapsed, limits_[joint], memory);
  detail::set_command(applied, joint, result.command);
  applied.reasons[joint] = result.reasons;
}

template <class R>
void SafetyChain<R>::brake(const Observation& observation, State& state,
                           AppliedAction& applied) const noexcept {
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const CheckedCommand result =
        brake_joint(observation.velocity[i], applied.reasons[i], limits_[i], state.joints[i]);
    detail::set_command(applied, i, result.command);
    applied.reasons[i] = result.reasons;
  }
}

template <class R>
RejectedCommand SafetyChain<R>::find_rejected(
    const Action& desired, const AppliedAction& applied) const noexcept TRIFINGER_REALTIME {
  RejectedCommand found;
  // The loop runs backwards, so that the first joint remains.
  for (std::size_t i = limits_.size(); i-- > 0;) {
    const std::uint64_t reasons = applied.reasons[i] & kRejected;
    if (reasons == 0) continue;
    const JointCommand command = detail::command_of(desired, i);
    found = {.joint = i,
             .reasons = reasons,
             .command = command,
             .is_own_check = accept_command(command, kNotGiven, limits_[i]).reasons == 0,
             .num_values = found.num_values + static_cast<std::size_t>(std::popcount(reasons))};
  }
  return found;
}

}  // namespace trifinger
