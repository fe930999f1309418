// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/planning_task.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

double distance(const double* one, const double* other) noexcept {
  const double x = one[0] - other[0];
  const double y = one[1] - other[1];
  const double z = one[2] - other[2];
  return std::sqrt(x * x + y * y + z * z);
}

// The smaller angle between two orientations; MuJoCo's has any length.
double angle(const double* quaternion, const Eigen::Quaterniond& goal) noexcept {
  const Eigen::Quaterniond actual(quaternion[0], quaternion[1], quaternion[2], quaternion[3]);
  const Eigen::Quaterniond difference = goal.conjugate() * actual;
  return 2.0 * std::atan2(difference.vec().norm(), std::abs(difference.w()));
}

template <class Number>
double length(int count, const Number& number) noexcept {
  double sum = 0.0;
  for (int i = 0; i < count; ++i) sum += number(i) * number(i);
  return std::sqrt(sum);
}

double quantity(const CostTerm& term, const CostInput& input) noexcept {
  const mjData& data = input.data;
  const PlanningModel& model = input.model;
  const int joints = model.num_joints();
  const auto index = static_cast<std::size_t>(term.index);
  const auto object = [&]() -> const ObjectAddress& { return model.objects()[index]; };
  const auto tip = [&](std::size_t finger) {
    return data.site_xpos + std::ptrdiff_t{3} * model.tip_sites()[finger];
  };
  switch (term.kind) {
    case CostKind::kObjectPosition:
      return distance(data.qpos + object().position, term.goal.position.data());
    case CostKind::kObjectOrientation:
      return angle(data.qpos + object().position + 3, term.goal.orientation);
    case CostKind::kObjectVelocity:
      return length(3, [v = data.qvel + object().velocity](int i) { return v[i]; });
    case CostKind::kObjectRotation:
      return length(3, [v = data.qvel + object().velocity + 3](int i) { return v[i]; });
    case CostKind::kTipObject: {
      double sum = 0.0;
      for (std::size_t i = 0; i < model.tip_sites().size(); ++i)
        sum += std::max(0.0, distance(tip(i), data.qpos + object().position) - term.distance);
      return sum;
    }
    case CostKind::kTipPosition:
      return distance(tip(index), term.goal.position.data());
    case CostKind::kJointPosition:
      return length(joints,
                    [&](int i) { return data.qpos[i] - term.joints[static_cast<std::size_t>(i)]; });
    case CostKind::kJointVelocity:
      return length(joints, [&](int i) { return data.qvel[i]; });
    case CostKind::kEffort:
      return length(joints, [&](int i) { return data.ctrl[i]; });
    case CostKind::kTargetDistance:
      if (!input.has_position_targets) return 0.0;
      return length(
          joints, [&](int i) { return data.qpos[i] - input.target[static_cast<std::size_t>(i)]; });
  }
  return 0.0;
}

bool has_finite_numbers(const CostTerm& term) noexcept {
  const auto is_finite = [](double value) { return std::isfinite(value); };
  return is_finite(term.weight) && is_finite(term.end_weight) && is_finite(term.distance) &&
         is_finite(term.smoothing) && term.goal.position.allFinite() &&
         term.goal.orientation.coeffs().allFinite() && std::ranges::all_of(term.joints, is_finite);
}

bool is_for_an_object(const CostTerm& term) noexcept {
  return term.kind == CostKind::kObjectPosition || term.kind == CostKind::kObjectOrientation ||
         term.kind == CostKind::kObjectVelocity || term.kind == CostKind::kObjectRotation ||
         term.kind == CostKind::kTipObject;
}

bool is_for_a_finger(const CostTerm& term) noexcept { return term.kind == CostKind::kTipPosition; }

std::size_t count_of_parts(const CostTerm& term, const PlanningModel& model) noexcept {
  return is_for_a_finger(term) ? model.tip_sites().size() : model.objects().size();
}

bool names_a_part(const CostTerm& term, const PlanningModel& model) noexcept {
  if (!is_for_an_object(term) && !is_for_a_finger(term)) return true;
  return term.index >= 0 && std::cmp_less(term.index, count_of_parts(term, model));
}

bool suits_the_joints(const CostTerm& term, const PlanningModel& model) noexcept {
  return term.kind != CostKind::kJointPosition || model.num_joints() <= kMaxJoints;
}

}  // namespace

double value_of(const CostTerm& term, const CostInput& input) noexcept {
  const double value = quantity(term, input);
  switch (term.shape) {
    case CostShape::kLinear:
      return value;
    case CostShape::kSquare:
      return value * value;
    case CostShape::kSmooth:
      return std::hypot(value, term.smoothing) - term.smoothing;
  }
  return value;
}

bool is_valid(const CostTerm& term, const PlanningModel& model) noexcept {
  return has_finite_numbers(term) && names_a_part(term, model) && suits_the_joints(term, model);
}

void validate(const PlanningTask& task, const PlanningModel& model) {
  for (std::size_t i = 0; i < task.terms.size(); ++i) {
    const CostTerm& term = task.terms[i];
    // Texts are made only for errors, because terms change between plans.
    const auto refuse = [i](const std::string& reason) {
      throw InvalidArgument("term " + std::to_string(i) + " of the cost " + reason);
    };
    if (!has_finite_numbers(term)) refuse("has a number that is not finite");
    if (!names_a_part(term, model)) {
      refuse("is for " + std::string(is_for_a_finger(term) ? "finger" : "object") + " " +
             std::to_string(term.index) + ", the model has " +
             std::to_string(count_of_parts(term, model)));
    }
    if (!suits_the_joints(term, model))
      refuse("is for robots of up to " + std::to_string(kMaxJoints) + " joints");
  }
  const bool is_share = task.late_share >= 0.0 && task.late_share <= 1.0;
  if (!is_share) {
    throw InvalidArgument("late_share is " + std::to_string(task.late_share) + ", must be 0 to 1");
  }
  detail::require_not_negative("late_factor", task.late_factor);
}

}  // namespace trifinger::control
