// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/counted_chain.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/orderly_stop.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

/// What a driver of hardware must know of its robot, whatever kind of motors it has.
struct CountedDriverOptions {
  /// The elements of its sessions, as from `describe_counted`.
  RobotTypes types{};
  /// The names of its joints. Texts call a joint whose name is empty by its number only.
  std::vector<std::string> names{};
  std::vector<JointLimit> limits{};
  std::vector<double> initial_position{};  ///< Where sessions begin [rad], [m].
  /// If the observation also has "joint_position" and "joint_velocity": which of the joints,
  /// followed by the driver's other sensors, is each of these; nothing: nobody measures it, and it
  /// is not a number.
  std::vector<std::optional<std::size_t>> all_joints{};
  /// Number of "tip_force" in the observation. They are not numbers unless the driver measures
  /// them.
  std::size_t num_tips{0};
  OrderlyStopOptions stop{};                         ///< What happens after a session.
  Nanoseconds period{std::chrono::milliseconds(1)};  ///< Period of the back-end.
  /// Writes the torques that carry the weight of the joints at a position; default: none. It runs
  /// in the loop.
  std::function<void(std::span<const double> position, std::span<double> torque)> weight{};

  /// Checks that each joint has what these options and `num_motors` count, that limits make sense,
  /// and that sessions begin within them.
  /// @throws InvalidArgument that names the option, the value found and the values allowed
  void validate_joints(std::size_t num_motors) const;
  /// "joint 3 (elbow)", or "joint 3" if it has no name.
  [[nodiscard]] FixedText joint_text(std::size_t joint) const noexcept TRIFINGER_REALTIME;
};

/// What drivers of hardware with counted joints have in common: safety chain, holding, orderly
/// stop, texts. A driver fills in `observation_` before it calls `apply` or `apply_stop`, and then
/// sends `chain_.applied()` to its motors.
class CountedDriver : public UntypedDriver {
 public:
  /// Adds a check after the existing ones, before the first session.
  void add_check(CountedChain::Check check);

  [[nodiscard]] const RobotTypes& description() const noexcept final { return chain_.types(); }
  [[nodiscard]] DriverReport hold(const void* observation, void* action) noexcept final;
  [[nodiscard]] std::string_view fault_text(std::int32_t fault_code) const noexcept final;
  [[nodiscard]] std::string_view rejection_text() const noexcept final;

 protected:
  /// `limits` are those of the safety chain, where motors give less than `options` allow.
  /// @throws InvalidArgument
  CountedDriver(const CountedDriverOptions& options, const std::vector<JointLimit>& limits);

  [[nodiscard]] std::size_t num_joints() const noexcept { return chain_.size(); }
  /// Writes the newest observation as an element.
  void write_observation(void* element) const noexcept TRIFINGER_REALTIME;
  /// Shows what was measured of driven joints among all joints, too.
  void copy_to_all_joints() noexcept TRIFINGER_REALTIME;
  /// Passes an action through the safety chain.
  [[nodiscard]] DriverReport apply(const CountedAction& action) noexcept TRIFINGER_REALTIME {
    return chain_.apply(action, observation_, period_);
  }
  /// Writes the torques that carry the weight at the newest position; 0 if nobody knows it.
  void write_weight(const PerJoint<double>& position,
                    PerJoint<double>& torque) const noexcept TRIFINGER_REALTIME;
  /// One period of the orderly stop. False: it is over, and nothing was applied. If `is_broken()`,
  /// which is asked unless it is over, joints are only damped.
  template <class IsBroken>
  [[nodiscard]] bool apply_stop(TimeIndex step, const IsBroken& is_broken) noexcept {
    PerJoint<double> target(num_joints(), kNotGiven);
    OrderlyStop::Phase phase = stop_.next(step, observation_.position, target);
    if (phase == OrderlyStop::Phase::kOver) return false;
    // What has ended the session may not be found again.
    if (is_broken() || (step == 0 && has_fault_)) {
      stop_.give_up(step);
      phase = OrderlyStop::Phase::kDamp;
    }
    CountedAction action(num_joints());
    if (phase == OrderlyStop::Phase::kMove) {
      action.position = target;
      write_weight(observation_.position, action.torque);
    }
    if (apply(action).state != DriverReport::State::kReady) stop_.give_up(step);
    return true;
  }

  CountedChain chain_;
  CountedObservation observation_;      // the newest one
  std::vector<double> all_positions_;   // of `all_joints`; NaN where nobody measures
  std::vector<double> all_velocities_;  // the same
  std::vector<double> tip_force_;       // NaN where nobody measures
  bool has_fault_{false};               // A fault has ended the session.
  /// As in the options.
  std::function<void(std::span<const double> position, std::span<double> torque)> weight_;

 private:
  std::vector<std::optional<std::size_t>> all_joints_;
  OrderlyStop stop_;
  Nanoseconds period_;
  CountedObservation held_;
};

}  // namespace trifinger
