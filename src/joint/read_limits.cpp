// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/read_limits.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "joint/every_joint.hpp"
#include "joint/limit_text.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::detail {
namespace {

// Lists the lengths that can be repeated to `size` entries, as in "1, 3 or 9".
std::string allowed_lengths(std::size_t size) {
  std::string text;
  for (std::size_t length = 1; length <= size; ++length) {
    if (size % length != 0) continue;
    if (!text.empty()) text += length == size ? " or " : ", ";
    text += std::to_string(length);
  }
  return text;
}

// Returns the value under a key, which may name a member of a section: "plausibility.x".
config::Node node_of(const config::Node& section, std::string_view key, std::string_view unit) {
  const std::size_t dot = key.find('.');
  if (dot == std::string_view::npos) return section.at(key, unit);
  return section.section(key.substr(0, dot)).at(key.substr(dot + 1), unit);
}

config::Range range_of(const JointLimitField& field) {
  using enum JointLimitField::Allowed;
  config::Range range{.unit = field.unit, .max = kLargestJointLimit};
  range.min = field.allowed == kAny ? -kLargestJointLimit : 0.0;
  range.above_min = field.allowed == kPositive || field.may_be_infinite();
  if (field.may_be_infinite()) {
    range.allow_infinite = true;
    range.max = std::numeric_limits<double>::infinity();
  }
  return range;
}

// Tells the section that it knows this key.
void announce(const config::Node& section, std::string_view key) {
  const std::size_t dot = key.find('.');
  if (dot == std::string_view::npos) {
    (void)section.find(key);
  } else if (const auto inner = section.optional_section(key.substr(0, dot))) {
    (void)inner->find(key.substr(dot + 1));
  }
}

}  // namespace

void require_other_name(std::string_view joint) {
  if (joint != kEveryJoint) return;
  throw InvalidArgument(
      "no joint can be called 'every_joint', which is the key for all joints that do not say "
      "otherwise; give it another name");
}

void read_repeated(const config::Node& node, const config::Range& range, std::span<double> values) {
  const std::vector<double> given =
      node.is_list() ? node.as<std::vector<double>>(range) : std::vector{node.as<double>(range)};
  if (given.empty() || values.size() % given.size() != 0) {
    node.fail("has " + std::to_string(given.size()) + " entries, must have " +
              allowed_lengths(values.size()));
  }
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = given[i % given.size()];
}

}  // namespace trifinger::detail

namespace trifinger {

void read_joint_limits(const config::Node& section, std::span<JointLimit> limits) {
  // All keys are looked up first, so that a missing key is not reported as a misspelling of its
  // neighbour.
  for (const JointLimitField& field : JointLimit::fields()) detail::announce(section, field.name);
  std::vector<double> values(limits.size());
  for (const JointLimitField& field : JointLimit::fields()) {
    detail::read_repeated(detail::node_of(section, field.name, field.unit), detail::range_of(field),
                          values);
    for (std::size_t i = 0; i < limits.size(); ++i) limits[i].*field.value = values[i];
  }
  if (const auto problem = find_problem(limits)) {
    detail::node_of(section, problem->field, "")
        .fail("of joint " + std::to_string(problem->joint) + " " + problem->text);
  }
}

namespace {

using config::Node;
using detail::is_said;
using detail::kEveryJoint;

constexpr std::string_view kPlausibility = "plausibility.";

bool is_place(const JointLimitField& field) {
  return field.allowed == JointLimitField::kAny;  // A soft or a hard limit.
}

// The value under a key, which may name a member of a section, if it is there.
std::optional<Node> find_value(const std::optional<Node>& section, std::string_view key) {
  if (!section) return std::nullopt;
  const std::size_t dot = key.find('.');
  if (dot == std::string_view::npos) return section->find(key);
  const auto inner = section->optional_section(key.substr(0, dot));
  return inner ? inner->find(key.substr(dot + 1)) : std::nullopt;
}

// The unit of a value of a joint that slides.
std::string_view linear_unit(std::string_view unit) {
  constexpr auto kUnits =
      std::to_array<std::pair<std::string_view, std::string_view>>({{"Nm", "N"},
                                                                    {"Nm/s", "N/s"},
                                                                    {"Nm/rad", "N/m"},
                                                                    {"Nms/rad", "Ns/m"},
                                                                    {"rad", "m"},
                                                                    {"rad/s", "m/s"},
                                                                    {"rad/s^2", "m/s^2"}});
  const auto* const row = std::ranges::find(kUnits, unit, &decltype(kUnits)::value_type::first);
  return row != kUnits.end() ? row->second : unit;
}

double read_value(const Node& node, const JointLimitField& field, JointKind kind) {
  config::Range range = detail::range_of(field);
  if (kind == JointKind::kSlide) range.unit = linear_unit(range.unit);
  if (!is_place(field)) return node.as<double>(range);
  range.min = -std::numeric_limits<double>::infinity();
  range.max = std::numeric_limits<double>::infinity();
  range.allow_infinite = true;
  return std::clamp(node.as<double>(range), -kLargestJointLimit, kLargestJointLimit);
}

// What holds for a value that neither the configuration nor the robot's file says; NaN if somebody
// must say it. Nothing here is a guess: gains are at most the robot's own, or a check is off.
double fallback(const JointLimitField& field, const JointLimit& limit) {
  if (field.value == &JointLimit::max_kp) return limit.default_kp;
  if (field.value == &JointLimit::max_kd) return limit.default_kd;
  const bool may_be_off =
      field.name.starts_with(kPlausibility) || field.value == &JointLimit::max_torque_rate ||
      field.value == &JointLimit::continuous_torque || field.value == &JointLimit::thermal_time;
  return may_be_off ? std::numeric_limits<double>::infinity() : kNotGiven;
}

// True for a value that nobody has said. Missing gains are asked for as the default gains.
bool must_be_asked_for(const JointLimitField& field, double value) {
  const bool follows = field.value == &JointLimit::max_kp || field.value == &JointLimit::max_kd;
  return !is_said(value) && !follows;
}

// The values of each joint that nobody has said.
using Missing = std::vector<std::vector<const JointLimitField*>>;

bool is_missing(const std::vector<const JointLimitField*>& fields, const JointLimitField* field) {
  return std::ranges::find(fields, field) != fields.end();
}

// A text for the configuration, with places to be filled in.
std::string text_to_fill_in(std::span<const NamedJoint> joints, const Missing& missing) {
  const auto row = [](std::string_view name, const std::vector<const JointLimitField*>& fields) {
    std::string text = "  " + detail::key_of(name) + ": {";
    for (std::size_t i = 0; i < fields.size(); ++i) {
      text += (i > 0 ? ", " : "") + std::string(fields[i]->name) + ": FILL_IN";
    }
    return text + "}";
  };
  // What no joint has, and what may be the same for all, is asked for once.
  std::vector<const JointLimitField*> for_all;
  for (const JointLimitField& field : JointLimit::fields()) {
    const bool lacks_everywhere = std::ranges::all_of(
        missing, [&field](const auto& fields) { return is_missing(fields, &field); });
    const bool is_own = is_place(field) || field.value == &JointLimit::max_torque;
    if (lacks_everywhere && !is_own) for_all.push_back(&field);
  }
  std::string text = "safety:\n";
  if (!for_all.empty()) text += row(kEveryJoint, for_all) + "\n";
  for (std::size_t i = 0; i < joints.size(); ++i) {
    std::vector<const JointLimitField*> own = missing[i];
    std::erase_if(own, [&](const JointLimitField* field) { return is_missing(for_all, field); });
    if (own.empty()) continue;
    text += row(joints[i].name, own);
    const JointLimit& known = joints[i].known;
    const std::string_view unit = joints[i].kind == JointKind::kSlide ? " m" : " rad";
    if (is_said(known.hard_lower) && known.hard_lower > -kLargestJointLimit) {
      // In full, because a soft limit may be copied from here: a rounded one could be beyond.
      text += "  # its stops: " + detail::number_text(known.hard_lower) + " to " +
              detail::number_text(known.hard_upper) + std::string(unit);
    } else if (is_said(known.hard_lower)) {
      text += "  # it has no stops: -.inf and .inf are possible";
    }
    text += '\n';
  }
  return text;
}

}  // namespace

std::vector<JointLimit> read_limits_by_name(const Node& root, std::span<const NamedJoint> joints) {
  const auto safety = root.optional_section("safety");
  const auto every = safety ? safety->optional_section(kEveryJoint) : std::nullopt;
  for (const NamedJoint& joint : joints) detail::require_other_name(joint.name);
  std::vector<JointLimit> limits(joints.size());
  Missing missing(joints.size());
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const auto own = safety ? safety->optional_section(joints[i].name) : std::nullopt;
    for (const JointLimitField& field : JointLimit::fields()) {
      double& value = limits[i].*field.value;
      // Both are looked up, so that neither counts as an unknown key.
      const auto general = find_value(every, field.name);
      const auto special = find_value(own, field.name);
      if (special) {
        value = read_value(*special, field, joints[i].kind);
      } else if (general) {
        value = read_value(*general, field, joints[i].kind);
      } else {
        value = joints[i].known.*field.value;
      }
      if (!is_said(value)) value = fallback(field, limits[i]);
      if (must_be_asked_for(field, value)) missing[i].push_back(&field);
    }
  }
  const Node& place = safety ? *safety : root;
  if (std::ranges::any_of(missing, [](const auto& fields) { return !fields.empty(); })) {
    throw config::ConfigError(
        place.location(),
        "neither 'safety' nor the robot's file says all that the safety chain "
        "needs. Fill this in; 'every_joint' is for all joints that do not "
        "say otherwise:\n" +
            text_to_fill_in(joints, missing));
  }
  if (const auto problem = find_problem(limits)) {
    const std::string name = joints[problem->joint].name;
    const auto own = safety ? safety->find(name) : std::nullopt;
    (own ? *own : place)
        .fail(std::string(own ? "" : "of joint " + name + ": ") + std::string(problem->field) +
              " " + problem->text);
  }
  return limits;
}

}  // namespace trifinger
