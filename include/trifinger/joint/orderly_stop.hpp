// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>

#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

namespace detail {

// The movement of least jerk, from 0 to 1, at rest at both ends.
[[nodiscard]] constexpr double smooth(double x) noexcept {
  return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
}

}  // namespace detail

/// How a robot of N joints comes to rest after the end of a session.
template <std::size_t N>
struct OrderlyStopOptions {
  Nanoseconds damping_time{0};                     ///< How long joints are only damped.
  std::optional<JointVector<N>> rest_position{};   ///< Where it then moves; default: nowhere [rad].
  Nanoseconds move_time{std::chrono::seconds(3)};  ///< Duration of that movement.

  /// The shortest `move_time` in which every joint can follow, from any position within its soft
  /// limits.
  [[nodiscard]] Nanoseconds shortest_move_time(const JointLimits<N>& limits) const noexcept {
    // A movement of least jerk is faster in its middle than on average, by this factor.
    constexpr double kPeak = 1.875;
    // Part of the torque that the safety damping may use. The rest carries and accelerates.
    constexpr double kDamping = 0.5;
    double shortest = 0.0;
    for (std::size_t i = 0; rest_position && i < N; ++i) {
      const double rest = (*rest_position)[i];
      const double way = std::max(limits[i].soft_upper - rest, rest - limits[i].soft_lower);
      shortest =
          std::max(shortest, kPeak * way * limits[i].safety_kd / (kDamping * limits[i].max_torque));
    }
    return std::chrono::ceil<Nanoseconds>(std::chrono::duration<double>(shortest));
  }

  /// `limits` must be valid.
  /// @throws InvalidArgument that names the option, the value found and the values allowed
  void validate(const JointLimits<N>& limits) const {
    if (damping_time < Nanoseconds::zero()) throw InvalidArgument("damping_time is negative");
    if (!rest_position) return;
    for (std::size_t i = 0; i < N; ++i) {
      const double rest = (*rest_position)[i];
      // The comparison is written so that NaN fails.
      if (rest >= limits[i].soft_lower && rest <= limits[i].soft_upper) continue;
      throw InvalidArgument("rest_position of joint " + std::to_string(i) + " is " +
                            std::to_string(rest) + " rad, must be within its soft limits, " +
                            std::to_string(limits[i].soft_lower) + " to " +
                            std::to_string(limits[i].soft_upper) + " rad");
    }
    const auto in_seconds = [](Nanoseconds time) {
      return std::to_string(std::chrono::duration<double>(time).count());
    };
    if (const Nanoseconds shortest = shortest_move_time(limits);
        move_time < shortest || move_time <= Nanoseconds::zero()) {
      throw InvalidArgument("move_time is " + in_seconds(move_time) + " s, must be at least " +
                            in_seconds(shortest) + " s, or the joints cannot follow");
    }
  }
};

/// The orderly stop, as actions that a user could send. First the joints get no torque, so that the
/// safety chain damps them. Then they move smoothly to the rest position. The number of steps is
/// bounded.
///
/// A driver passes every action through its safety chain and cuts the torque at the end.
template <class R>
class OrderlyStop {
 public:
  using Action = typename R::Action;
  using Observation = typename R::Observation;
  using Options = OrderlyStopOptions<R::kJoints>;

  /// `options` must be valid. Without damping time and rest position the stop ends at once.
  OrderlyStop(const Options& options, Nanoseconds period) noexcept
      : damping_steps_(steps_in(options.damping_time, period)),
        move_steps_(options.rest_position ? steps_in(options.move_time, period) : 0),
        rest_(options.rest_position.value_or(JointVector<R::kJoints>{})) {}

  /// Number of periods of the stop if it is not given up.
  [[nodiscard]] TimeIndex num_steps() const noexcept { return damping_steps_ + move_steps_; }

  /// Writes the action for period `step`, counted from 0 after the end of the session. Returns
  /// false once the stop is over.
  [[nodiscard]] bool next(TimeIndex step, const Observation& observation,
                          Action& action) noexcept TRIFINGER_REALTIME {
    if (step == 0) {
      end_ = num_steps();
      is_given_up_ = false;
    }
    if (step >= end_) return false;
    action = Action{};
    if (step < damping_steps_ || is_given_up_) return true;
    if (step == damping_steps_) start_ = observation.position;
    const double done = detail::smooth(static_cast<double>(step - damping_steps_ + 1) /
                                       static_cast<double>(move_steps_));
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      action.position[i] = start_[i] + done * (rest_[i] - start_[i]);
    }
    return true;
  }

  /// Call this when the safety chain has found a fault in period `step`. From then on the joints
  /// are only damped: for the rest of the damping time, or for a whole damping time if the movement
  /// had begun.
  void give_up(TimeIndex step) noexcept TRIFINGER_REALTIME {
    if (is_given_up_) return;
    is_given_up_ = true;
    end_ = step < damping_steps_ ? damping_steps_ : step + 1 + damping_steps_;
  }

 private:
  [[nodiscard]] static TimeIndex steps_in(Nanoseconds time, Nanoseconds period) noexcept {
    return (time + period - Nanoseconds(1)) / period;
  }

  TimeIndex damping_steps_;
  TimeIndex move_steps_;
  JointVector<R::kJoints> rest_;
  JointVector<R::kJoints> start_{};
  TimeIndex end_{0};
  bool is_given_up_{false};
};

}  // namespace trifinger
