// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/reasons.hpp"

#include <array>

namespace trifinger {
namespace {

constexpr std::array kAllReasons{Reason::kTorqueNotFinite,  Reason::kPositionNotFinite,
                                 Reason::kKpOutOfBounds,    Reason::kKdOutOfBounds,
                                 Reason::kOwnCheck,         Reason::kTargetClamped,
                                 Reason::kPushedBack,       Reason::kTorqueClipped,
                                 Reason::kDamped,           Reason::kHardLimit,
                                 Reason::kBadMeasurement,   Reason::kOwnCheckFailed,
                                 Reason::kBraking,          Reason::kTorqueRateLimited,
                                 Reason::kDerated,          Reason::kTooFast,
                                 Reason::kOverheated,       Reason::kPositionJumped,
                                 Reason::kVelocityMismatch, Reason::kStuck};

}  // namespace

std::span<const Reason> all_reasons() noexcept { return kAllReasons; }

std::string_view name_of(Reason reason) noexcept {
  switch (reason) {
    case Reason::kTorqueNotFinite:
      return "torque_not_finite";
    case Reason::kPositionNotFinite:
      return "position_not_finite";
    case Reason::kKpOutOfBounds:
      return "kp_out_of_bounds";
    case Reason::kKdOutOfBounds:
      return "kd_out_of_bounds";
    case Reason::kOwnCheck:
      return "own_check";
    case Reason::kTargetClamped:
      return "target_clamped";
    case Reason::kPushedBack:
      return "pushed_back";
    case Reason::kTorqueClipped:
      return "torque_clipped";
    case Reason::kDamped:
      return "damped";
    case Reason::kHardLimit:
      return "hard_limit";
    case Reason::kBadMeasurement:
      return "bad_measurement";
    case Reason::kOwnCheckFailed:
      return "own_check_failed";
    case Reason::kBraking:
      return "braking";
    case Reason::kTorqueRateLimited:
      return "torque_rate_limited";
    case Reason::kDerated:
      return "derated";
    case Reason::kTooFast:
      return "too_fast";
    case Reason::kOverheated:
      return "overheated";
    case Reason::kPositionJumped:
      return "position_jumped";
    case Reason::kVelocityMismatch:
      return "velocity_mismatch";
    case Reason::kStuck:
      return "stuck";
  }
  return "unknown";
}

std::string names_of(std::uint64_t reasons) {
  std::string names;
  for (const Reason reason : kAllReasons) {
    if (!has(reasons, reason)) continue;
    if (!names.empty()) names += ", ";
    names += name_of(reason);
  }
  return names;
}

std::string_view describe(Reason reason) noexcept {
  switch (reason) {
    case Reason::kTorqueNotFinite:
      return "the torque asked for is NaN or infinite; the joint holds its last accepted target";
    case Reason::kPositionNotFinite:
      return "the position asked for is infinite; the joint holds its last accepted target";
    case Reason::kKpOutOfBounds:
      return "position_kp is not between 0 and max_kp; the joint holds its last accepted target";
    case Reason::kKdOutOfBounds:
      return "position_kd is not between 0 and max_kd; the joint holds its last accepted target";
    case Reason::kOwnCheck:
      return "a check that was added for this robot or task changed the action";
    case Reason::kTargetClamped:
      return "the position asked for was beyond a soft limit and was moved to it";
    case Reason::kPushedBack:
      return "the joint is beyond a soft limit and is pushed back";
    case Reason::kTorqueClipped:
      return "the torque was clipped to the joint's maximum";
    case Reason::kDamped:
      return "the safety damping acts against the joint's velocity";
    case Reason::kHardLimit:
      return "the joint is beyond its hard limit";
    case Reason::kBadMeasurement:
      return "the measured position, velocity or torque is no plausible number";
    case Reason::kOwnCheckFailed:
      return "a check that was added for this robot or task threw an exception";
    case Reason::kBraking:
      return "the robot brakes because of a fault";
    case Reason::kTorqueRateLimited:
      return "the torque asked for changed faster than max_torque_rate and follows with delay";
    case Reason::kDerated:
      return "the motor is warm and the torque was clipped to what it can carry";
    case Reason::kTooFast:
      return "the joint is faster than max_velocity, or than it may be so near to a soft limit, "
             "and is braked";
    case Reason::kOverheated:
      return "the motor is too warm: it has given more torque than it was told";
    case Reason::kPositionJumped:
      return "the measured position changed faster than a joint can move";
    case Reason::kVelocityMismatch:
      return "the measured velocity is not that of the measured position";
    case Reason::kStuck:
      return "the measurements do not change at all, whatever the torque";
  }
  return "unknown reason";
}

}  // namespace trifinger
