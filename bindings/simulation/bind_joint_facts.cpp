// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <Eigen/Core>
#include <algorithm>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "simulation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/read_limits.hpp"
#include "trifinger/model/kinematics.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

// All limits: by the names of their keys in `safety`, a number for each joint.
nb::dict dict_of(const std::vector<JointLimit>& limits) {
  nb::dict values;
  for (const JointLimitField& field : JointLimit::fields()) {
    Array<Eigen::VectorXd> of_joints{Eigen::VectorXd(std::ssize(limits))};
    std::ranges::transform(limits, of_joints.value.begin(), field.value);
    const std::string_view name = field.name.substr(field.name.find('.') + 1);
    values[nb::str(name.data(), name.size())] = nb::cast(of_joints);
  }
  return values;
}

using Facts = std::tuple<std::string, nb::typed<nb::tuple, nb::str, nb::ellipsis>,
                         nb::typed<nb::dict, nb::str, ShownArray>>;

Facts facts_of(const std::string& robot, const std::vector<std::string>& joints,
               const std::vector<JointLimit>& limits) {
  nb::list names;
  for (const std::string& name : joints) names.append(to_message(name));
  return {robot, nb::tuple(names), dict_of(limits)};
}

// What the text of a robot from a file says of joints with these names. What only its file says
// counts as no limit.
std::vector<JointLimit> limits_in(const config::File& file,
                                  const std::vector<std::string>& joints) {
  std::vector<NamedJoint> named;
  named.reserve(joints.size());
  for (const std::string& name : joints) {
    named.push_back({.name = name,
                     .kind = JointKind::kHinge,
                     .known = {.max_torque = kLargestJointLimit,
                               .hard_lower = -kLargestJointLimit,
                               .hard_upper = kLargestJointLimit,
                               .default_kp = 0.0,
                               .default_kd = 0.0}});
  }
  return read_limits_by_name(file.root(), named);
}

Facts read_facts(const std::string& text, const std::string& robot,
                 const std::vector<std::string>& joints, bool opens_file) {
  const config::File file = config::File::parse(text, "configuration.yml");
  if (is_from_file(file) && !opens_file) {
    detail::require(!joints.empty(),
                    "the robot is from a file, which is not opened here: say which configuration "
                    "it has (JointFacts.load, --config)");
    return facts_of(robot, joints, limits_in(file, joints));
  }
  const SimulationOptions options = read_robot_config(file).simulation;
  if (options.file != nullptr) {
    return facts_of(robot_types_of(options).type, options.file->joint_names(),
                    options.limits.value());
  }
  return facts_of("trifinger-" + std::string(figures(options.description).name),
                  joint_names(options.description),
                  options.limits.value_or(default_limits(options.description)));
}

}  // namespace

void bind_joint_facts(nb::module_& m) {
  m.def(
      "configuration_text",
      [](const std::string& config, const Overrides& overrides) {
        return load_config(config, overrides).session.documents.at(0).text;
      },
      "config"_a = "sim", "overrides"_a = nb::dict(),
      "The whole configuration of that name, or in that file, as a session's document\n"
      "\"configuration.yml\" has it.");
  m.def(
      "read_joint_facts", &read_facts, "configuration"_a, "robot"_a = "", "joints"_a = nb::tuple(),
      "opens_file"_a = false,
      "Name of the robot, names of its joints and the limits in the section `safety` of the text\n"
      "of a configuration. A robot from a file is named like the type of its sessions. It has the\n"
      "names that are given here, and what only its file says counts as no limit and no gain, "
      "unless\n"
      "`opens_file`: an untrusted text must open no file. Raises InvalidArgument at the value that "
      "is\n"
      "wrong.");
  m.def(
      "named_joints",
      [](const std::string& text) -> nb::typed<nb::tuple, nb::str, nb::ellipsis> {
        const config::File file = config::File::parse(text, "configuration.yml");
        return nb::tuple(nb::cast(
            file.root().section("robot").optional<std::vector<std::string>>("joints", {})));
      },
      "configuration"_a,
      "The joints that the text of a configuration of a robot from a file names; empty if it "
      "leaves\n"
      "them to the file.");
  m.def(
      "kinematics_of",
      [](const std::string& text) -> std::optional<Kinematics> {
        const config::File file = config::File::parse(text, "configuration.yml");
        // Before it is read: an untrusted text must open no file.
        if (is_from_file(file)) return std::nullopt;
        return Kinematics(description_of(read_robot_config(file)));
      },
      "configuration"_a,
      "The kinematics of the robot in the text of a configuration; None for a robot from a file,\n"
      "which is not opened.");
}

}  // namespace trifinger::bindings
