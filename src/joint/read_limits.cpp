// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/read_limits.hpp"

#include <limits>
#include <string>
#include <string_view>
#include <vector>

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

void read_repeated(const config::Node& node, const config::Range& range, std::span<double> values) {
  const std::vector<double> given =
      node.is_list() ? node.as<std::vector<double>>(range) : std::vector{node.as<double>(range)};
  if (given.empty() || values.size() % given.size() != 0) {
    node.fail("has " + std::to_string(given.size()) + " entries, must have " +
              allowed_lengths(values.size()));
  }
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = given[i % given.size()];
}

void read_joint_limits(const config::Node& section, std::span<JointLimit> limits) {
  // All keys are looked up first, so that a missing key is not reported as a misspelling of its
  // neighbour.
  for (const JointLimitField& field : JointLimit::fields()) announce(section, field.name);
  std::vector<double> values(limits.size());
  for (const JointLimitField& field : JointLimit::fields()) {
    read_repeated(node_of(section, field.name, field.unit), range_of(field), values);
    for (std::size_t i = 0; i < limits.size(); ++i) limits[i].*field.value = values[i];
  }
  if (const auto problem = find_problem(limits)) {
    node_of(section, problem->field, "")
        .fail("of joint " + std::to_string(problem->joint) + " " + problem->text);
  }
}

}  // namespace trifinger::detail
