// SPDX-License-Identifier: BSD-3-Clause
#include "simulation.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "conversion/numbers.hpp"
#include "conversion/text.hpp"
#include "session/checks.hpp"
#include "trifinger/rendering/simulation_with_cameras.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

template <std::size_t N>
std::array<double, N> to_array(const std::vector<double>& values, const char* what) {
  require_length(what, values.size(), N);
  std::array<double, N> array{};
  std::copy(values.begin(), values.end(), array.begin());
  return array;
}

// The texts of overrides on the command line.
std::vector<std::string> texts_of(const nb::dict& overrides) {
  // JSON is YAML, and Python writes it.
  const nb::object dumps = nb::module_::import_("json").attr("dumps");
  std::vector<std::string> texts;
  for (const auto& [key, value] : overrides) {
    try {
      texts.push_back(text_of(key) + "=" + text_of(dumps(value)));
    } catch (const nb::python_error& error) {
      if (!error.matches(PyExc_TypeError)) throw;
      throw InvalidArgument("the override of " + text_of(key) + " is " + text_of(nb::repr(value)) +
                            ", must be a number, a text, True, False or a list of them");
    }
  }
  return texts;
}

nb::bytes to_bytes(const SimulationState& state) { return nb::bytes(state.data(), state.size()); }

}  // namespace

RobotConfig load_config(const std::string& name, const nb::dict& overrides) {
  return load_robot_config(name, texts_of(overrides));
}

bool is_robot_from_file(const std::string& name, const nb::dict& overrides) {
  return is_from_file(load_config_file(name, texts_of(overrides)));
}

Pull to_pull(const Vector3& target, const Vector3& point, double stiffness) {
  Pull pull{.stiffness = stiffness};
  Eigen::Vector3d::Map(pull.target.data()) = target.value;
  Eigen::Vector3d::Map(pull.point.data()) = point.value;
  return pull;
}

PythonSimulation::PythonSimulation(const RobotConfig& config)
    : name_(config.name),
      checks_(nb::cast(new Checks, nb::rv_policy::take_ownership)),
      simulation_(rendering::make_simulation(config)) {}

std::unique_ptr<PythonFrontend> PythonSimulation::connect(bool strict) const {
  return std::make_unique<PythonFrontend>(simulation_.connect_untyped({.strict = strict}),
                                          PythonFrontend::Role{.controls = true, .is_inline = true},
                                          checks_);
}

void PythonSimulation::reset(const std::optional<std::vector<double>>& position,
                             std::optional<std::uint64_t> seed, std::uint64_t episode,
                             const std::optional<std::vector<double>>& joints) const {
  if (joints && robot().options().file == nullptr) {
    throw InvalidArgument("joints are for robots from files");
  }
  robot().reset(position.value_or(robot().initial_position()),
                Random{.seed = seed.value_or(robot().options().seed), .episode = episode},
                joints.value_or(std::vector<double>()));
}

void PythonSimulation::place_object(const std::string& name, const std::vector<double>& position,
                                    const std::vector<double>& orientation) const {
  const ObjectPose pose{.position = to_array<3>(position, "position"),
                        .orientation = to_array<4>(orientation, "orientation")};
  robot().place_object(name, pose);
}

void PythonSimulation::vary(const Variation& variation) const { robot().vary(variation); }

void PythonSimulation::push_object(const std::string& name,
                                   const std::vector<double>& force) const {
  const auto newtons = to_array<3>(force, "force");
  robot().push_object(name, newtons);
}

void PythonSimulation::pull(const std::variant<std::int64_t, std::string>& body,
                            const Pull& pull) const {
  std::visit([&](const auto& which) { robot().pull(which, pull); }, body);
}

void PythonSimulation::let_go() const { robot().let_go(); }

std::vector<std::string> PythonSimulation::bodies() const {
  return pullable_bodies(robot().model());
}

void PythonSimulation::set_object_velocity(const std::string& name,
                                           const std::vector<double>& linear,
                                           const std::vector<double>& angular) const {
  const ObjectVelocity velocity{.linear = to_array<3>(linear, "linear"),
                                .angular = to_array<3>(angular, "angular")};
  robot().set_object_velocity(name, velocity);
}

ObjectVelocity PythonSimulation::object_velocity(const std::string& name) const {
  return robot().object_velocity(name);
}

ObjectPose PythonSimulation::object_pose(const std::string& name) const {
  return robot().object_pose(name);
}

ObjectPose PythonSimulation::observed_object_pose(const std::string& name) const {
  return robot().observed_object_pose(name);
}

nb::bytes PythonSimulation::save() const { return to_bytes(robot().save()); }

void PythonSimulation::restore(const nb::bytes& state) const {
  const std::span bytes(static_cast<const std::byte*>(state.data()), state.size());
  robot().restore(bytes);
}

nb::bytes PythonSimulation::state_before_divergence() const {
  return to_bytes(robot().state_before_divergence());
}

std::vector<double> PythonSimulation::configuration() const { return robot().configuration(); }

std::shared_ptr<log::RecorderThread> PythonSimulation::record(const std::filesystem::path& folder,
                                                              const std::string& precision,
                                                              const std::string& images) const {
  auto recorder = start_recorder(name_, folder, precision, images);
  simulation_.follow(recorder);
  return recorder;
}

void PythonSimulation::add_check(nb::object function) {
  auto& checks = nb::cast<Checks&>(checks_);
  const RobotTypes& types = robot().description();
  robot().add_check(
      [check = checks.add(std::move(function), types.observation, types.action)](
          const void* observation, void* action) { check->call(observation, action); });
}

std::string PythonSimulation::mjcf() const { return robot().model().mjcf(); }

}  // namespace trifinger::bindings
