// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/limits.hpp"

#include <charconv>
#include <cmath>

namespace trifinger::detail {
namespace {

// Positions in `joint_limit_fields`.
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
  kMaxKd
};

constexpr std::array<JointLimitField, kJointLimitFields> kFields{{{"max_torque", "Nm"},
                                                                  {"safety_kd", "Nms/rad"},
                                                                  {"soft_lower", "rad"},
                                                                  {"soft_upper", "rad"},
                                                                  {"hard_lower", "rad"},
                                                                  {"hard_upper", "rad"},
                                                                  {"default_kp", "Nm/rad"},
                                                                  {"default_kd", "Nms/rad"},
                                                                  {"max_kp", "Nm/rad"},
                                                                  {"max_kd", "Nms/rad"}}};

// With plausible measurements (at most 1e6) no product or sum in the checks can overflow.
constexpr double kLargest = 1e6;

std::string text_of(double number, std::string_view unit) {
  std::array<char, 32> buffer{};
  const auto result = std::to_chars(buffer.begin(), buffer.end(), number);
  return std::string(buffer.begin(), result.ptr) + " " + std::string(unit);
}

}  // namespace

std::span<const JointLimitField, kJointLimitFields> joint_limit_fields() noexcept {
  return kFields;
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
      // Written so that NaN fails.
      if (!(std::abs(value(field)) <= kLargest)) {
        return problem(field, "finite and at most " + text_of(kLargest, kFields[field].unit));
      }
    }
    if (value(kMaxTorque) <= 0.0) return problem(kMaxTorque, "more than 0");
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
  }
  return std::nullopt;
}

void throw_problem(const JointLimitProblem& problem) {
  throw InvalidArgument("limits of joint " + std::to_string(problem.joint) + ": " +
                        std::string(problem.field) + " " + problem.text);
}

}  // namespace trifinger::detail
