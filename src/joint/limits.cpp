// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/limits.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

namespace trifinger {
namespace {

// With at least this continuous torque [Nm], no quotient can overflow.
constexpr double kMinContinuousTorque = 1e-6;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string text_of(double number, std::string_view unit) {
  std::array<char, 32> buffer{};
  const auto result = std::to_chars(buffer.begin(), buffer.end(), number);
  return std::string(buffer.begin(), result.ptr) + " " + std::string(unit);
}

const JointLimitField& field_of(double JointLimit::* value) {
  return *std::ranges::find(JointLimit::fields(), value, &JointLimitField::value);
}

// What is allowed where `value` is not; empty where it is.
std::string allowed_instead_of(double value, const JointLimitField& field) {
  if (field.may_be_infinite() && value == kInfinity) return {};
  // Written so that NaN fails.
  if (!(std::abs(value) <= kLargestJointLimit)) {
    return std::string(field.may_be_infinite() ? "infinite or" : "finite and") + " at most " +
           text_of(kLargestJointLimit, field.unit);
  }
  const bool is_positive = field.allowed == JointLimitField::kPositive || field.may_be_infinite();
  if (is_positive && value <= 0.0) return "more than 0";
  if (field.allowed == JointLimitField::kNotNegative && value < 0.0) return "at least 0";
  return {};
}

// The limits of one joint that have to fit each other.
class Relations {
 public:
  explicit Relations(const JointLimit& limit) : limit_(limit) {}

  void less(double JointLimit::* one, double JointLimit::* other) {
    if (limit_.*one >= limit_.*other) report(one, "less than " + named(other));
  }
  void at_least(double JointLimit::* one, double JointLimit::* other) {
    if (limit_.*one < limit_.*other) report(one, "at least " + named(other));
  }
  void at_most(double JointLimit::* one, double JointLimit::* other) {
    if (limit_.*one > limit_.*other) report(one, "at most " + named(other));
  }
  void at_least(double JointLimit::* one, double least, const std::string& text) {
    if (limit_.*one < least) report(one, "at least " + text);
  }
  void report(double JointLimit::* value, const std::string& allowed) {
    if (problem_) return;
    const JointLimitField& field = field_of(value);
    problem_ = {.field = field.name,
                .text = "is " + text_of(limit_.*value, field.unit) + ", must be " + allowed};
  }
  [[nodiscard]] const std::optional<JointLimitProblem>& problem() const { return problem_; }

 private:
  [[nodiscard]] std::string named(double JointLimit::* value) const {
    const JointLimitField& field = field_of(value);
    return std::string(field.name) + " (" + text_of(limit_.*value, field.unit) + ")";
  }

  const JointLimit& limit_;
  std::optional<JointLimitProblem> problem_;
};

std::optional<JointLimitProblem> find_problem_of_joint(const JointLimit& limit) {
  Relations limits(limit);
  for (const JointLimitField& field : JointLimit::fields()) {
    const std::string allowed = allowed_instead_of(limit.*field.value, field);
    if (!allowed.empty()) limits.report(field.value, allowed);
  }
  limits.less(&JointLimit::soft_lower, &JointLimit::soft_upper);
  limits.at_least(&JointLimit::soft_lower, &JointLimit::hard_lower);
  limits.at_most(&JointLimit::soft_upper, &JointLimit::hard_upper);
  limits.at_most(&JointLimit::default_kp, &JointLimit::max_kp);
  limits.at_most(&JointLimit::default_kd, &JointLimit::max_kd);
  limits.at_least(&JointLimit::continuous_torque, kMinContinuousTorque,
                  text_of(kMinContinuousTorque, "Nm"));
  // The derating must be faster than the warming, whatever the time between two steps.
  const double shortest = std::pow(limit.max_torque / limit.continuous_torque, 2);
  limits.at_least(&JointLimit::thermal_time, shortest,
                  "(max_torque / continuous_torque)^2 s (" + text_of(shortest, "s") + ")");
  return limits.problem();
}

}  // namespace

void detail::require_count(std::size_t found, std::size_t expected) {
  require(found == expected, "there are limits for " + std::to_string(found) +
                                 " joints, the robot has " + std::to_string(expected));
}

std::optional<JointLimitProblem> find_problem(std::span<const JointLimit> limits) {
  for (std::size_t joint = 0; joint < limits.size(); ++joint) {
    auto problem = find_problem_of_joint(limits[joint]);
    if (!problem) continue;
    problem->joint = joint;
    return problem;
  }
  return std::nullopt;
}

void validate(std::span<const JointLimit> limits) {
  if (const auto problem = find_problem(limits)) {
    throw InvalidArgument("limits of joint " + std::to_string(problem->joint) + ": " +
                          std::string(problem->field) + " " + problem->text);
  }
}

}  // namespace trifinger
