// SPDX-License-Identifier: BSD-3-Clause
#include "simulation.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <type_traits>
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

// Calls `use` with a simulation that has fingers.
template <class AnySimulation, class Use>
auto with_fingers(const AnySimulation& simulation, const std::string& what, const Use& use) {
  using Result = std::invoke_result_t<Use, const Simulation<TriFinger>&>;
  return std::visit(
      [&]<class Which>(const Which& which) -> Result {
        if constexpr (std::is_same_v<Which, FileSimulation>) {
          throw InvalidArgument(what +
                                " is for a TriFinger or one of its fingers; this robot is "
                                "from a file");
        } else {
          return use(which);
        }
      },
      simulation);
}

nb::bytes to_bytes(const SimulationState& state) { return nb::bytes(state.data(), state.size()); }

}  // namespace

RobotConfig load_config(const std::string& name, const nb::dict& overrides) {
  return load_robot_config(name, texts_of(overrides));
}

AnyRobotConfig load_any_config(const std::string& name, const nb::dict& overrides) {
  return load_any_robot_config(name, texts_of(overrides));
}

bool is_robot_from_file(const std::string& name, const nb::dict& overrides) {
  return is_from_file(load_config_file(name, texts_of(overrides)));
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

PythonSimulation::PythonSimulation(const AnyRobotConfig& config)
    : name_(std::visit([](const auto& robot) { return robot.name; }, config)),
      checks_(nb::cast(new Checks, nb::rv_policy::take_ownership)),
      simulation_(make(config)) {}

auto PythonSimulation::make(const AnyRobotConfig& config) -> AnySimulation {
  if (const auto* const file = std::get_if<FileRobotConfig>(&config)) {
    return FileSimulation(file->robot, file->session, file->backend, file->name);
  }
  const auto& robot = std::get<RobotConfig>(config);
  return std::visit(
      [&]<class R>(const SimulationOptions<R>&) -> AnySimulation {
        return rendering::make_simulation<R>(robot);
      },
      robot.simulation);
}

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
                             std::optional<std::uint64_t> seed, std::uint64_t episode,
                             const std::optional<std::vector<double>>& joints) const {
  if (const auto* const file = std::get_if<FileSimulation>(&simulation_)) {
    // Nothing in it is random.
    file->robot().reset(position ? *position : file->robot().initial_position(),
                        joints ? *joints : std::vector<double>());
    return;
  }
  if (joints) throw InvalidArgument("joints are for robots from files");
  with_fingers(simulation_, "reset", [&]<class R>(const Simulation<R>& simulation) {
    SimulatedRobot<R>& robot = simulation.robot();
    robot.reset(position ? to_array<R::kJoints>(*position, "position") : robot.initial_position(),
                Random{.seed = seed.value_or(robot.options().seed), .episode = episode});
  });
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
  with_fingers(simulation_, "pull", [&](const auto& simulation) {
    std::visit([&](const auto& which) { simulation.robot().pull(which, pull); }, body);
  });
}

void PythonSimulation::let_go() const {
  with_fingers(simulation_, "let_go", [](const auto& simulation) { simulation.robot().let_go(); });
}

std::vector<std::string> PythonSimulation::bodies() const {
  // Nothing of a robot from a file can be pulled.
  if (std::holds_alternative<FileSimulation>(simulation_)) return {};
  return with_fingers(simulation_, "bodies", [](const auto& simulation) {
    return pullable_bodies(simulation.robot().options().description);
  });
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
  auto& checks = nb::cast<Checks&>(checks_);
  if (const auto* const file = std::get_if<FileSimulation>(&simulation_)) {
    const RobotTypes& types = file->robot().description();
    file->robot().add_check(
        [check = checks.add(std::move(function), types.observation, types.action)](
            const void* observation, void* action) { check->call(observation, action); });
    return;
  }
  with_fingers(simulation_, "add_check", [&]<class R>(const Simulation<R>& simulation) {
    auto check = checks.add(std::move(function), describe<typename R::Observation>(),
                            describe<typename R::Action>());
    simulation.robot().safety().add_check(
        [check = std::move(check)](const typename R::Observation& y, typename R::Action& action) {
          check->call(&y, &action);
        });
  });
}

std::string PythonSimulation::mjcf() const {
  if (const auto* const file = std::get_if<FileSimulation>(&simulation_)) {
    return file->robot().model().mjcf();
  }
  return with_fingers(simulation_, "mjcf", [](const auto& simulation) {
    return export_mjcf(simulation.robot().options().description);
  });
}

}  // namespace trifinger::bindings
