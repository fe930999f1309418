// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/limits.hpp"

#include <charconv>
#include <cmath>
#include <limits>

namespace trifinger::detail {
namespace {

// Indices into `joint_limit_fields`.
enum Index : std::size_t {
  kMaxTorque,
  kSafetyKd,
  kSoftLower,
  kSoftUpper,
  kHardLower,
  kHardUpper,
  kDefaultKp,
  kDefaultKd,
  kMaxKp,
  kMaxKd,
  kMaxVelocity,
  kBraking,
  kMaxTorqueRate,
  kContinuousTorque,
  kThermalTime,
  kMaxPositionRate,
  kMaxVelocityError,
  kVelocityErrorTime,
  kStuckTorque,
  kStuckTime
};

constexpr std::array<JointLimitField, kJointLimitFields> kFields{
    {{"max_torque", "Nm"},
     {"safety_kd", "Nms/rad"},
     {"soft_lower", "rad"},
     {"soft_upper", "rad"},
     {"hard_lower", "rad"},
     {"hard_upper", "rad"},
     {"default_kp", "Nm/rad"},
     {"default_kd", "Nms/rad"},
     {"max_kp", "Nm/rad"},
     {"max_kd", "Nms/rad"},
     {"max_velocity", "rad/s", true},
     {"braking", "rad/s^2", true},
     {"max_torque_rate", "Nm/s", true},
     {"continuous_torque", "Nm", true},
     {"thermal_time", "s", true},
     {"plausibility.max_position_rate", "rad/s", true},
     {"plausibility.max_velocity_error", "rad/s", true},
     {"plausibility.velocity_error_time", "s", true},
     {"plausibility.stuck_torque", "Nm", true},
     {"plausibility.stuck_time", "s", true}}};

// With plausible measurements (at most 1e6) no product or sum in the checks can overflow.
constexpr double kLargest = 1e6;
// With at least this continuous torque [Nm], no quotient can overflow either.
constexpr double kLeastContinuousTorque = 1e-6;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string text_of(double number, std::string_view unit) {
  std::array<char, 32> buffer{};
  const auto result = std::to_chars(buffer.begin(), buffer.end(), number);
  return std::string(buffer.begin(), result.ptr) + " " + std::string(unit);
}

}  // namespace

std::span<const JointLimitField, kJointLimitFields> joint_limit_fields() noexcept {
  return kFields;
}

JointLimit limit_of_joint(const JointLimitValues& values, std::size_t joint) noexcept {
  const auto value = [&](Index field) { return values[field][joint]; };
  return {.max_torque = value(kMaxTorque),
          .safety_kd = value(kSafetyKd),
          .soft_lower = value(kSoftLower),
          .soft_upper = value(kSoftUpper),
          .hard_lower = value(kHardLower),
          .hard_upper = value(kHardUpper),
          .default_kp = value(kDefaultKp),
          .default_kd = value(kDefaultKd),
          .max_kp = value(kMaxKp),
          .max_kd = value(kMaxKd),
          .max_velocity = value(kMaxVelocity),
          .braking = value(kBraking),
          .max_torque_rate = value(kMaxTorqueRate),
          .continuous_torque = value(kContinuousTorque),
          .thermal_time = value(kThermalTime),
          .max_position_rate = value(kMaxPositionRate),
          .max_velocity_error = value(kMaxVelocityError),
          .velocity_error_time = value(kVelocityErrorTime),
          .stuck_torque = value(kStuckTorque),
          .stuck_time = value(kStuckTime)};
}

std::optional<JointLimitProblem> find_problem(const JointLimitValues& values) {
  for (std::size_t joint = 0; joint < values[0].size(); ++joint) {
    const auto value = [&](std::size_t field) { return values[field][joint]; };
    const auto problem = [&](std::size_t field, const std::string& allowed) {
      return JointLimitProblem{
          .joint = joint,
          .field = kFields[field].name,
          .text = "is " + text_of(value(field), kFields[field].unit) + ", must be " + allowed};
    };
    const auto named = [&](std::size_t field) {
      return std::string(kFields[field].name) + " (" + text_of(value(field), kFields[field].unit) +
             ")";
    };

    for (std::size_t field = 0; field < kJointLimitFields; ++field) {
      if (kFields[field].may_be_infinite && value(field) == kInfinity) continue;
      // Written so that NaN fails.
      if (!(std::abs(value(field)) <= kLargest)) {
        return problem(field,
                       std::string(kFields[field].may_be_infinite ? "infinite or" : "finite and") +
                           " at most " + text_of(kLargest, kFields[field].unit));
      }
      if ((field == kMaxTorque || kFields[field].may_be_infinite) && value(field) <= 0.0) {
        return problem(field, "more than 0");
      }
    }
    for (const std::size_t field : {kSafetyKd, kDefaultKp, kDefaultKd, kMaxKp, kMaxKd}) {
      if (value(field) < 0.0) return problem(field, "at least 0");
    }
    if (value(kSoftLower) >= value(kSoftUpper)) {
      return problem(kSoftLower, "less than " + named(kSoftUpper));
    }
    if (value(kSoftLower) < value(kHardLower)) {
      return problem(kSoftLower, "at least " + named(kHardLower));
    }
    if (value(kSoftUpper) > value(kHardUpper)) {
      return problem(kSoftUpper, "at most " + named(kHardUpper));
    }
    if (value(kDefaultKp) > value(kMaxKp)) return problem(kDefaultKp, "at most " + named(kMaxKp));
    if (value(kDefaultKd) > value(kMaxKd)) return problem(kDefaultKd, "at most " + named(kMaxKd));
    if (value(kContinuousTorque) < kLeastContinuousTorque) {
      return problem(kContinuousTorque, "at least " + text_of(kLeastContinuousTorque, "Nm"));
    }
    // The derating must be faster than the warming, whatever the time between two steps.
    const double shortest = std::pow(value(kMaxTorque) / value(kContinuousTorque), 2);
    if (value(kThermalTime) < shortest) {
      return problem(kThermalTime, "at least (max_torque / continuous_torque)^2 s (" +
                                       text_of(shortest, kFields[kThermalTime].unit) + ")");
    }
  }
  return std::nullopt;
}

void throw_problem(const JointLimitProblem& problem) {
  throw InvalidArgument("limits of joint " + std::to_string(problem.joint) + ": " +
                        std::string(problem.field) + " " + problem.text);
}

}  // namespace trifinger::detail
