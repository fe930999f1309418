// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "trifinger/realtime/annotations.hpp"

namespace trifinger::boards {

/// How a joint finds the place from which its angle counts, its home.
enum class HomingMethod : std::uint8_t {
  kEndStopIndex,     ///< Pushes to its end stop, then turns back to the next index of the encoder.
  kEndStop,          ///< Pushes to its end stop.
  kReleasedEndStop,  ///< Pushes to its end stop, then lets go: belts and stop relax.
  kNextIndex,        ///< Turns to the next index of the encoder.
  kHere,             ///< Its home is where it stands.
};

/// How one joint is homed.
struct HomingOptions {
  HomingMethod method{HomingMethod::kEndStopIndex};
  double torque{0.0};         ///< Torque towards the end stop, with its sign [Nm].
  double home_position{0.0};  ///< Angle of the joint at its home [rad]: the calibration.
};

/// True if the joint pushes to its end stop: where it begins does not count then.
[[nodiscard]] constexpr bool homes_at_end_stop(HomingMethod method) noexcept {
  return method == HomingMethod::kEndStop || method == HomingMethod::kEndStopIndex ||
         method == HomingMethod::kReleasedEndStop;
}

/// What homing knows of a joint in one step.
struct HomingMeasurement {
  double angle{0.0};     ///< From where the board was switched on [rad].
  double velocity{0.0};  ///< [rad/s]
  double index{0.0};     ///< Angle of the newest index pulse [rad].
  std::uint64_t index_pulses{0};
};

/// How a joint is driven during its homing.
struct HomingGains {
  double kp{0.0};          ///< [Nm/rad]
  double kd{0.0};          ///< Damping that always acts [Nms/rad].
  double max_torque{0.0};  ///< [Nm]
};

/// The homing of one joint, a step at a time. The caller ends a part for all joints at once: no
/// joint leaves its end stop while others still push.
class JointHoming {
 public:
  enum class Failure : std::uint8_t {
    kNone,
    kTooFar,   ///< No end stop within the largest travel.
    kNoIndex,  ///< No index within one and a half revolutions of the motor.
  };

  /// Begins at `measured`. `index_distance` is the angle of one revolution of the motor [rad].
  void begin(HomingMethod method, double torque, double index_distance,
             const HomingMeasurement& measured) noexcept TRIFINGER_REALTIME;

  /// Returns the torque of the next step [Nm]. `period` is the time between two steps [s].
  [[nodiscard]] double next(const HomingMeasurement& measured, const HomingGains& gains,
                            double period) noexcept TRIFINGER_REALTIME;

  /// True if the joint has done the current part.
  [[nodiscard]] bool is_part_done() const noexcept { return is_part_done_; }
  /// Begins the next part. Returns false if there is none: the joint is home.
  [[nodiscard]] bool next_part(const HomingMeasurement& measured) noexcept TRIFINGER_REALTIME;

  /// What has gone wrong in this part. `max_travel` is the longest travel of a joint [rad].
  [[nodiscard]] Failure failure(const HomingMeasurement& measured,
                                double max_travel) const noexcept TRIFINGER_REALTIME;
  /// Angle of the home, after the last part [rad].
  [[nodiscard]] double home() const noexcept { return home_; }

 private:
  enum class Part : std::uint8_t { kPush, kRelease, kIndex, kDone };

  void begin_part(Part part, const HomingMeasurement& measured) noexcept;
  [[nodiscard]] double push(const HomingMeasurement& measured, const HomingGains& gains,
                            double period) noexcept;
  [[nodiscard]] double search_index(const HomingMeasurement& measured, const HomingGains& gains,
                                    double period) noexcept;

  HomingMethod method_{HomingMethod::kHere};
  double torque_{0.0};
  double index_distance_{0.0};
  Part part_{Part::kDone};
  bool is_part_done_{false};
  bool is_home_{false};
  double time_{0.0};         // in this part [s]
  double start_{0.0};        // angle at its beginning [rad]
  double still_angle_{0.0};  // where the joint was when `still_time_` began
  double still_time_{0.0};   // for so long the joint has hardly moved [s]
  double target_{0.0};       // of the search for the index [rad]
  std::uint64_t pulses_{0};
  double home_{0.0};
};

}  // namespace trifinger::boards
