// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/simulation_options.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string>
#include <utility>

#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"

namespace trifinger {
namespace {

using detail::require;
using detail::text_of;

// Our own choice: a little more than the motors reach against the safety damping [rad/s].
constexpr FingerJoints kMaxVelocity{5.0, 5.0, 8.0};
// Our own choice: a joint is stuck that stays exactly the same while its torque varies by this
// share of its maximum.
constexpr double kStuckShare = 0.5;

template <class R>
void require_joints(const RobotDescription& description) {
  require(num_joints(description) == static_cast<int>(R::kJoints),
          text_of("a robot of type '", R::kType, "' has ", R::kJoints,
                  " joints, this description has ", num_joints(description)));
}

}  // namespace

template <class R>
JointLimits<R::kJoints> default_limits(const RobotDescription& description) {
  require_joints<R>(description);
  const VariantFigures& figures = trifinger::figures(description);
  JointLimits<R::kJoints> limits;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const std::size_t joint = i % kJointsPerFinger;
    JointLimit& limit = limits[i];
    for (const JointLimitField& field : JointLimit::fields()) limit.*field.value = field.usual;
    limit.max_torque = figures.actuator.torque_limit;
    limit.safety_kd = figures.safety_kd[joint];
    limit.soft_lower = figures.soft_lower[joint];
    limit.soft_upper = figures.soft_upper[joint];
    limit.hard_lower = figures.hard_lower[joint];
    limit.hard_upper = figures.hard_upper[joint];
    limit.default_kp = figures.kp[joint];
    limit.default_kd = figures.kd[joint];
    limit.max_velocity = kMaxVelocity[joint];
    limit.braking = figures.braking[joint];
    limit.continuous_torque = figures.actuator.continuous_torque;
    limit.thermal_time = figures.actuator.thermal_time;
    limit.stuck_torque = kStuckShare * figures.actuator.torque_limit;
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
  require_joints<R>(description);
  const auto used = limits ? *limits : default_limits<R>(description);
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
  require(scene_period >= 0, "scene_period is " + std::to_string(scene_period) +
                                 " steps, must be at least 0; 0 leaves the scene out");
  require(object_loss >= 0.0 && object_loss <= 1.0,
          "object_loss is " + text_of(object_loss) + ", must be 0 to 1");
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
