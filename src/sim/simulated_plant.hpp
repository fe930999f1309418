// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "boards/emulator.hpp"
#include "trifinger/core/sensor.hpp"
#include "trifinger/model/scene_model.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger {

/// Any simulated robot as what emulated motor boards move: torques act without any safety checks.
class SimulatedPlant final : public boards::Plant {
 public:
  /// The robot begins at rest at its initial position. @throws InvalidArgument
  explicit SimulatedPlant(SimulationOptions options);

  [[nodiscard]] std::span<const double> position() const noexcept override {
    return state_.observation.position;
  }
  [[nodiscard]] std::span<const double> velocity() const noexcept override {
    return state_.observation.velocity;
  }
  [[nodiscard]] std::span<const double> tip_force() const noexcept override {
    return state_.tip_force;
  }
  void step(std::span<const double> torque) noexcept override;

  [[nodiscard]] const SimulationOptions& options() const noexcept { return simulator_.options(); }
  [[nodiscard]] const SceneModel& model() const noexcept { return simulator_.model(); }
  /// The poses of all objects that arrive from the cameras now; nullptr if none do. Call it once
  /// after each step. Steps count from 1.
  [[nodiscard]] const Simulator::Capture* receive_poses() noexcept;
  /// The number of steps so far.
  [[nodiscard]] TimeIndex step_count() const noexcept { return state_.memory.counters.step; }
  /// The object's pose now, without delay and noise.
  /// @throws InvalidArgument that names the existing objects
  [[nodiscard]] ObjectPose object_pose(const std::string& name) const;
  /// Positions and velocities of joints and objects in MuJoCo's layout: `qpos`, and `qvel`.
  [[nodiscard]] std::span<const double> configuration_position() const noexcept;
  [[nodiscard]] std::span<const double> configuration_velocity() const noexcept;
  /// Places all objects where they were in the beginning, at rest.
  void reset_objects() noexcept;

  /// True if the simulation has diverged; then nothing moves any more.
  [[nodiscard]] bool has_diverged() const noexcept { return has_diverged_; }

 private:
  Simulator simulator_;
  SceneModel::Data data_;
  Simulator::State state_;
  std::vector<ObjectPose> initial_poses_;
  bool has_diverged_{false};
};

/// The cameras above a plant: a sensor that tells a robot where its objects are, with the rate,
/// delay and noise of the plant's options.
class SimulatedTracker {
 public:
  /// @throws InvalidArgument if the plant has no objects, SystemError, Error if another process
  /// tracks the objects of `robot`
  SimulatedTracker(const std::string& robot, SimulatedPlant& plant);

  /// Call it after each step of the plant, at `now` of the monotonic clock.
  void tick(Instant now) noexcept;

 private:
  SimulatedPlant& plant_;
  std::vector<std::byte> element_;
  std::vector<Instant> times_;  // of the plant's last steps, in a ring
  UntypedSensorWriter writer_;
};

/// Says where everything above a plant really is: the sensor "scene" of a robot, for cameras that
/// are drawn and for evaluations.
class SimulatedScene {
 public:
  /// `period` is the time between two elements, in whole steps of the plant.
  /// @throws SystemError, InvalidArgument, Error if another process writes the scene of `robot`
  SimulatedScene(const std::string& robot, const SimulatedPlant& plant, Nanoseconds period);

  /// Call it after each step of the plant, at `now` of the monotonic clock.
  void tick(Instant now) noexcept;

 private:
  const SimulatedPlant& plant_;
  TimeIndex period_;
  TimeIndex next_{0};
  std::vector<std::byte> element_;
  UntypedSensorWriter writer_;
};

}  // namespace trifinger
