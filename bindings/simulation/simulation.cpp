// SPDX-License-Identifier: BSD-3-Clause
#include "simulation.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "conversion/text.hpp"
#include "session/checks.hpp"
#include "trifinger/model/export.hpp"
#include "trifinger/rendering/simulation_that_sees.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

template <std::size_t N>
std::array<double, N> to_array(const std::vector<double>& values, const char* what) {
  if (values.size() != N) {
    throw InvalidArgument(std::string(what) + " has " + std::to_string(values.size()) +
                          " numbers, must have " + std::to_string(N));
  }
  std::array<double, N> array{};
  std::copy(values.begin(), values.end(), array.begin());
  return array;
}

nb::bytes to_bytes(const SimulationState& state) { return nb::bytes(state.data(), state.size()); }

}  // namespace

RobotConfig load_config(const std::string& name, const nb::dict& overrides) {
  // JSON is YAML, and Python writes it.
  const nb::object dumps = nb::module_::import_("json").attr("dumps");
  std::vector<std::string> texts;
  for (const auto& [key, value] : overrides) {
    texts.push_back(text_of(key) + "=" + text_of(dumps(value)));
  }
  return load_robot_config(name, texts);
}

RobotDescription description_of(const RobotConfig& config) {
  return std::visit([](const auto& options) { return options.description; }, config.simulation);
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
      simulation_(std::visit(
          [&]<class R>(const SimulationOptions<R>&) -> decltype(simulation_) {
            return rendering::make_simulation<R>(config);
          },
          config.simulation)) {}

std::unique_ptr<PythonFrontend> PythonSimulation::connect(bool strict) const {
  return std::visit(
      [&](const auto& simulation) {
        return std::make_unique<PythonFrontend>(
            simulation.connect_untyped({.strict = strict}),
            PythonFrontend::Role{.controls = true, .is_inline = true}, checks_);
      },
      simulation_);
}

void PythonSimulation::reset(const std::optional<std::vector<double>>& position,
                             std::optional<std::uint64_t> seed, std::uint64_t episode) const {
  std::visit(
      [&]<class R>(const Simulation<R>& simulation) {
        SimulatedRobot<R>& robot = simulation.robot();
        robot.reset(
            position ? to_array<R::kJoints>(*position, "position") : robot.initial_position(),
            Random{.seed = seed.value_or(robot.options().seed), .episode = episode});
      },
      simulation_);
}

void PythonSimulation::place_object(const std::string& name, const std::vector<double>& position,
                                    const std::vector<double>& orientation) const {
  const ObjectPose pose{.position = to_array<3>(position, "position"),
                        .orientation = to_array<4>(orientation, "orientation")};
  std::visit([&](const auto& simulation) { simulation.robot().place_object(name, pose); },
             simulation_);
}

void PythonSimulation::vary(const Variation& variation) const {
  std::visit([&](const auto& simulation) { simulation.robot().vary(variation); }, simulation_);
}

void PythonSimulation::push_object(const std::string& name,
                                   const std::vector<double>& force) const {
  const auto newtons = to_array<3>(force, "force");
  std::visit([&](const auto& simulation) { simulation.robot().push_object(name, newtons); },
             simulation_);
}

void PythonSimulation::pull(const std::variant<std::int64_t, std::string>& body,
                            const Pull& pull) const {
  std::visit(
      [&](const auto& simulation, const auto& which) { simulation.robot().pull(which, pull); },
      simulation_, body);
}

void PythonSimulation::let_go() const {
  std::visit([](const auto& simulation) { simulation.robot().let_go(); }, simulation_);
}

std::vector<std::string> PythonSimulation::bodies() const {
  return std::visit(
      [](const auto& simulation) {
        return pullable_bodies(simulation.robot().options().description);
      },
      simulation_);
}

void PythonSimulation::set_object_velocity(const std::string& name,
                                           const std::vector<double>& linear,
                                           const std::vector<double>& angular) const {
  const ObjectVelocity velocity{.linear = to_array<3>(linear, "linear"),
                                .angular = to_array<3>(angular, "angular")};
  std::visit(
      [&](const auto& simulation) { simulation.robot().set_object_velocity(name, velocity); },
      simulation_);
}

ObjectVelocity PythonSimulation::object_velocity(const std::string& name) const {
  return std::visit(
      [&](const auto& simulation) { return simulation.robot().object_velocity(name); },
      simulation_);
}

ObjectPose PythonSimulation::object_pose(const std::string& name) const {
  return std::visit([&](const auto& simulation) { return simulation.robot().object_pose(name); },
                    simulation_);
}

ObjectPose PythonSimulation::observed_object_pose(const std::string& name) const {
  return std::visit(
      [&](const auto& simulation) { return simulation.robot().observed_object_pose(name); },
      simulation_);
}

nb::bytes PythonSimulation::save() const {
  return std::visit([](const auto& simulation) { return to_bytes(simulation.robot().save()); },
                    simulation_);
}

void PythonSimulation::restore(const nb::bytes& state) const {
  const std::span bytes(static_cast<const std::byte*>(state.data()), state.size());
  std::visit([&](const auto& simulation) { simulation.robot().restore(bytes); }, simulation_);
}

nb::bytes PythonSimulation::state_before_divergence() const {
  return std::visit(
      [](const auto& simulation) { return to_bytes(simulation.robot().state_before_divergence()); },
      simulation_);
}

std::vector<double> PythonSimulation::configuration() const {
  return std::visit([](const auto& simulation) { return simulation.robot().configuration(); },
                    simulation_);
}

std::shared_ptr<log::RecorderThread> PythonSimulation::record(const std::filesystem::path& folder,
                                                              const std::string& precision,
                                                              const std::string& images) const {
  auto recorder = start_recorder(name_, folder, precision, images);
  std::visit([&](const auto& simulation) { simulation.follow(recorder); }, simulation_);
  return recorder;
}

void PythonSimulation::add_check(nb::object function) {
  std::visit(
      [&]<class R>(const Simulation<R>& simulation) {
        auto check =
            nb::cast<Checks&>(checks_).add(std::move(function), describe<typename R::Observation>(),
                                           describe<typename R::Action>());
        simulation.robot().safety().add_check(
            [check = std::move(check)](const typename R::Observation& y,
                                       typename R::Action& action) { check->call(&y, &action); });
      },
      simulation_);
}

std::string PythonSimulation::mjcf() const {
  return std::visit(
      [](const auto& simulation) { return export_mjcf(simulation.robot().options().description); },
      simulation_);
}

}  // namespace trifinger::bindings
