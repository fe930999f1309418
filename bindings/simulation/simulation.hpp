// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "conversion/array.hpp"
#include "log/start_recorder.hpp"
#include "session/frontend.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::bindings {

/// The configuration `name`, with the value of each entry of a dict {"a.b": value}.
[[nodiscard]] RobotConfig load_config(const std::string& name, const nanobind::dict& overrides);

/// Whether the configuration `name` is that of a robot from a file.
[[nodiscard]] bool is_robot_from_file(const std::string& name, const nanobind::dict& overrides);

[[nodiscard]] Pull to_pull(const Vector3& target, const Vector3& point, double stiffness);

/// A simulated robot in this process, whatever it is.
class PythonSimulation {
 public:
  explicit PythonSimulation(const RobotConfig& config);

  /// Name of the robot in the configuration.
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] std::unique_ptr<PythonFrontend> connect(bool strict) const;
  void reset(const std::optional<std::vector<double>>& position, std::optional<std::uint64_t> seed,
             std::uint64_t episode, const std::optional<std::vector<double>>& joints) const;
  void vary(const Variation& variation) const;
  void place_object(const std::string& name, const std::vector<double>& position,
                    const std::vector<double>& orientation) const;
  void push_object(const std::string& name, const std::vector<double>& force) const;
  void set_object_velocity(const std::string& name, const std::vector<double>& linear,
                           const std::vector<double>& angular) const;
  void pull(const std::variant<std::int64_t, std::string>& body, const Pull& pull) const;
  void let_go() const;
  [[nodiscard]] std::vector<std::string> bodies() const;
  [[nodiscard]] ObjectPose object_pose(const std::string& name) const;
  [[nodiscard]] ObjectPose observed_object_pose(const std::string& name) const;
  [[nodiscard]] ObjectVelocity object_velocity(const std::string& name) const;
  [[nodiscard]] nanobind::bytes save() const;
  void restore(const nanobind::bytes& state) const;
  [[nodiscard]] nanobind::bytes state_before_divergence() const;
  [[nodiscard]] std::vector<double> configuration() const;
  [[nodiscard]] std::string mjcf() const;
  /// Records every session from the next one on.
  [[nodiscard]] std::shared_ptr<log::RecorderThread> record(const std::filesystem::path& folder,
                                                            const std::string& precision,
                                                            const std::string& images) const;
  /// Adds `function(observation, action)` to the safety checks; it changes the action in place.
  void add_check(nanobind::object function);

  /// For the garbage collector.
  int traverse(visitproc visit, void* arg) const noexcept {
    Py_VISIT(checks_.ptr());
    return 0;
  }
  void clear() noexcept { checks_.reset(); }

 private:
  [[nodiscard]] SimulatedRobot& robot() const noexcept { return simulation_.robot(); }

  std::string name_;
  nanobind::object checks_;  // Checks
  Simulation simulation_;
};

}  // namespace trifinger::bindings
