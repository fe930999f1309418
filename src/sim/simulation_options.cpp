// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/simulation_options.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"

namespace trifinger {
namespace {

using detail::require;
using detail::text_of;

// Our own bounds for the gains that users may ask for; the sources have none. They are well inside
// the stable range at 1 kHz for the lightest link.
constexpr double kMaxKp = 50.0;
constexpr double kMaxKd = 0.5;

// Our own choice: a little more than the motors reach against the safety damping [rad/s].
constexpr FingerJoints kMaxVelocity{5.0, 5.0, 8.0};
// Limit for real joints: what a motor without load reaches, plus half of that for impacts on the
// arm [rad/s].
constexpr double kMaxPositionRate = 65.0;
// Our own choice: a velocity that is wrong by 1 rad/s for a tenth of a second, or a joint whose
// position stays exactly the same while its torque varies by half of its maximum.
constexpr double kMaxVelocityError = 1.0;   // [rad/s]
constexpr double kVelocityErrorTime = 0.1;  // [s]
constexpr double kStuckTime = 0.1;          // [s]
constexpr double kStuckShare = 0.5;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

template <class R>
JointLimits<R::kJoints> default_limits(const RobotDescription& description) {
  require(num_joints(description) == static_cast<int>(R::kJoints),
          "a robot of type '" + std::string(R::kType) + "' has " + std::to_string(R::kJoints) +
              " joints, this description has " + std::to_string(num_joints(description)));
  const VariantFigures& figures = trifinger::figures(description);
  JointLimits<R::kJoints> limits;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const std::size_t joint = i % kJointsPerFinger;
    limits[i] = {.max_torque = figures.actuator.torque_limit,
                 .safety_kd = figures.safety_kd[joint],
                 .soft_lower = figures.soft_lower[joint],
                 .soft_upper = figures.soft_upper[joint],
                 .hard_lower = figures.hard_lower[joint],
                 .hard_upper = figures.hard_upper[joint],
                 .default_kp = figures.kp[joint],
                 .default_kd = figures.kd[joint],
                 .max_kp = kMaxKp,
                 .max_kd = kMaxKd,
                 .max_velocity = kMaxVelocity[joint],
                 .braking = figures.braking[joint],
                 .max_torque_rate = kInfinity,
                 .continuous_torque = figures.actuator.continuous_torque,
                 .thermal_time = figures.actuator.thermal_time,
                 .max_position_rate = kMaxPositionRate,
                 .max_velocity_error = kMaxVelocityError,
                 .velocity_error_time = kVelocityErrorTime,
                 .stuck_torque = kStuckShare * figures.actuator.torque_limit,
                 .stuck_time = kStuckTime};
  }
  return limits;
}

template <class R>
void SimulationOptions<R>::validate() const {
  trifinger::validate(description);
  for (const ObjectDescription& object : description.objects) {
    // The names become names of fields in the session "object".
    const bool is_name = std::all_of(object.name.begin(), object.name.end(), [](char letter) {
      return std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '_';
    });
    require(is_name && object.name != "stamp",
            "an object cannot be called '" + object.name +
                "': names are letters, digits and '_', and 'stamp' is taken");
  }
  const auto used = limits ? *limits : default_limits<R>(description);
  require(num_joints(description) == static_cast<int>(R::kJoints),
          "a robot of type '" + std::string(R::kType) + "' has " + std::to_string(R::kJoints) +
              " joints, this description has " + std::to_string(num_joints(description)));
  trifinger::validate(used);
  stop.validate(used);
  require(period >= kPhysicsStep && period % kPhysicsStep == Nanoseconds::zero(),
          "period is " + std::to_string(period.count()) +
              " ns, must be a whole number of milliseconds");
  require(object_period >= 1,
          "object_period is " + std::to_string(object_period) + " steps, must be at least 1");
  constexpr TimeIndex kMaxDelay = 100000;
  require(object_delay >= 0 && object_delay <= kMaxDelay,
          "object_delay is " + std::to_string(object_delay) + " steps, must be 0 to " +
              std::to_string(kMaxDelay));
  for (const auto& [name, noise] :
       {std::pair{"object_position_noise", object_position_noise},
        std::pair{"object_orientation_noise", object_orientation_noise}}) {
    require(std::isfinite(noise) && noise >= 0.0,
            std::string(name) + " is " + text_of(noise) + ", must be at least 0");
  }
}

template JointLimits<TriFinger::kJoints> default_limits<TriFinger>(const RobotDescription&);
template JointLimits<Finger::kJoints> default_limits<Finger>(const RobotDescription&);
template struct SimulationOptions<TriFinger>;
template struct SimulationOptions<Finger>;

}  // namespace trifinger
