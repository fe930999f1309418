// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/throw/stroke.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {

StrokeTargets targets_at(const Stroke& stroke, Seconds time) noexcept {
  const auto rest = [](const JointValues& target) {
    return StrokeTargets{target, JointValues::Zero(target.size())};
  };
  if (time < Seconds(0)) return rest(stroke.targets.front());
  const double place = time / stroke.spacing;
  const auto before = static_cast<std::size_t>(std::min(place, 1e6));
  if (before + 1 >= stroke.targets.size()) return rest(stroke.targets.back());
  const JointValues& from = stroke.targets[before];
  const JointValues displacement = stroke.targets[before + 1] - from;
  return {from + (place - static_cast<double>(before)) * displacement,
          displacement / stroke.spacing.count()};
}

void follow(const Stroke& stroke, const StrokeTargets& targets, const control::SafetyLimits& limits,
            const JointValues& torque, TriFinger::Action& action) noexcept {
  for (std::size_t i = 0; i < TriFinger::kJoints; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    action.position[i] = targets.position[k];
    action.position_kp[i] = stroke.stiffness;
    action.position_kd[i] = stroke.damping;
    action.torque[i] = torque[k] + (stroke.damping + limits.safety_kd[i]) * targets.velocity[k];
  }
}

void brake(const JointValues& position, const control::SafetyLimits& limits,
           const JointValues& torque, TriFinger::Action& action) noexcept {
  // The lower links have much room and swing out: what stopped them at once would drive the middle
  // links beyond their limits.
  constexpr std::array<double, 3> kStiffness{3.0, 3.0, 0.05};   // [Nm/rad]
  constexpr std::array<double, 3> kDamping{0.15, 0.15, 0.003};  // [Nms/rad]
  constexpr double kMargin = 0.2;                               // From the soft limits [rad].
  for (std::size_t i = 0; i < TriFinger::kJoints; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    action.position[i] =
        std::clamp(position[k], limits.soft_lower[i] + kMargin, limits.soft_upper[i] - kMargin);
    action.position_kp[i] = kStiffness[i % kStiffness.size()];
    action.position_kd[i] = kDamping[i % kDamping.size()];
    action.torque[i] = torque[k];
  }
}

void validate(const Stroke& stroke, const control::SafetyLimits& limits) {
  const auto reject = [](const auto&... parts) {
    throw InvalidArgument(detail::text_of("a stroke's ", parts...));
  };
  if (!(stroke.spacing > Seconds(0))) reject("spacing is not above zero");
  if (!(stroke.stiffness > 0.0)) reject("stiffness is not above zero");
  if (!(stroke.damping >= 0.0)) reject("damping is below zero");
  if (stroke.targets.size() < 2) reject("targets are fewer than two");
  for (const JointValues& target : stroke.targets) {
    if (target.size() != static_cast<Eigen::Index>(TriFinger::kJoints))
      reject("target has ", target.size(), " numbers, must have ", TriFinger::kJoints);
    for (std::size_t i = 0; i < TriFinger::kJoints; ++i) {
      const double value = target[static_cast<Eigen::Index>(i)];
      const bool is_within = value >= limits.soft_lower[i] && value <= limits.soft_upper[i];
      if (!is_within) {
        reject("target of joint ", i, " is ", value, " rad, its soft limits are ",
               limits.soft_lower[i], " and ", limits.soft_upper[i], " rad");
      }
    }
  }
}

}  // namespace trifinger::manipulation
