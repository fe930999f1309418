// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <variant>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/text.hpp"
#include "simulation.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/model/kinematics.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

RobotConfig parse(const std::string& text) {
  return read_robot_config(config::File::parse(text, "configuration.yml"));
}

// All limits of the section `safety`: by the names of its keys, a number for each joint.
nb::dict limits_of(const RobotConfig& config) {
  const SimulationOptions& options = config.simulation;
  const std::vector<JointLimit> limits =
      options.limits.value_or(default_limits(options.description));
  nb::dict values;
  for (const JointLimitField& field : JointLimit::fields()) {
    Array<Eigen::VectorXd> of_joints{Eigen::VectorXd(std::ssize(limits))};
    std::ranges::transform(limits, of_joints.value.begin(), field.value);
    const std::string_view name = field.name.substr(field.name.find('.') + 1);
    values[nb::str(name.data(), name.size())] = nb::cast(of_joints);
  }
  return values;
}

nb::object facts_of(const std::string& text) {
  const RobotConfig config = parse(text);
  const RobotDescription description = description_of(config);
  nb::list joints;
  for (const std::string& name : joint_names(description)) joints.append(name);
  return nb::make_tuple("trifinger-" + std::string(figures(description).name), nb::tuple(joints),
                        limits_of(config));
}

}  // namespace

void bind_joint_facts(nb::module_& m) {
  m.def(
      "configuration_text",
      [](const std::string& config, const nb::dict& overrides) {
        return load_config(config, overrides).session.documents.at(0).text;
      },
      "config"_a = "sim", "overrides"_a = nb::dict(),
      nb::sig("def configuration_text(config: str = 'sim', overrides: dict[str, object] = {}) -> "
              "str"),
      "The whole configuration of that name, or in that file, as a session's document\n"
      "\"configuration.yml\" has it.");
  m.def(
      "read_joint_facts", &facts_of, "configuration"_a,
      nb::sig("def read_joint_facts(configuration: str) -> tuple[str, tuple[str, ...], dict[str, "
              "numpy.typing.NDArray[numpy.float64]]]"),
      "Name of the robot, names of its joints and the limits in the section `safety` of the text\n"
      "of a configuration. Raises InvalidArgument at the value that is wrong.");
  m.def(
      "kinematics_of",
      [](const std::string& text) { return Kinematics(description_of(parse(text))); },
      "configuration"_a, nb::sig("def kinematics_of(configuration: str) -> Kinematics"),
      "The kinematics of the robot in the text of a configuration.");
}

}  // namespace trifinger::bindings
