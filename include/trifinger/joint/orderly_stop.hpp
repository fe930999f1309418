// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

namespace detail {

// The movement of least jerk, from 0 to 1, at rest at both ends.
[[nodiscard]] constexpr double smooth(double x) noexcept {
  return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
}

}  // namespace detail

/// How a robot comes to rest after the end of a session.
struct OrderlyStopOptions {
  Nanoseconds damping_time{0};  ///< How long joints are only damped.
  /// Where each joint then moves [rad], [m]; default: nowhere.
  std::optional<std::vector<double>> rest_position{};
  Nanoseconds move_time{std::chrono::seconds(3)};  ///< Duration of that movement.

  /// The shortest `move_time` in which every joint can follow, from any position within its soft
  /// limits. Joints without ends are left out, because they may be anywhere.
  [[nodiscard]] Nanoseconds shortest_move_time(std::span<const JointLimit> limits) const noexcept;

  /// `limits` must be valid.
  /// @throws InvalidArgument that names the option, the value found and the values allowed
  void validate(std::span<const JointLimit> limits) const;
};

/// The orderly stop, as commands that a user could send. First the joints get no torque, so that
/// the safety chain damps them. Then they move smoothly to the rest position. The number of steps
/// is bounded.
///
/// A driver passes every command through its safety chain and cuts the torque at the end.
class OrderlyStop {
 public:
  /// What to do in a period of the stop.
  enum class Phase : std::uint8_t {
    kDamp,  ///< Ask for no torque.
    kMove,  ///< Go to the target.
    kOver,  ///< Nothing: the stop is over.
  };

  /// `options` must be valid. Without damping time and rest position the stop ends at once.
  OrderlyStop(const OrderlyStopOptions& options, Nanoseconds period);

  /// Number of periods of the stop if it is not given up.
  [[nodiscard]] TimeIndex num_steps() const noexcept { return damping_steps_ + move_steps_; }

  /// Says what to do in period `step`, counted from 0 after the end of the session. `position` are
  /// the measured positions. Fills in `target` for `kMove`.
  [[nodiscard]] Phase next(TimeIndex step, std::span<const double> position,
                           std::span<double> target) noexcept TRIFINGER_REALTIME;

  /// Call this when the safety chain has found a fault in period `step`. From then on the joints
  /// are only damped: for the rest of the damping time, or for a whole damping time if the movement
  /// had begun.
  void give_up(TimeIndex step) noexcept TRIFINGER_REALTIME;

 private:
  TimeIndex damping_steps_;
  TimeIndex move_steps_;
  std::vector<double> rest_;
  std::vector<double> start_;
  TimeIndex end_{0};
  bool is_given_up_{false};
};

}  // namespace trifinger
