// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "dynamixel/emulated_bus.hpp"
#include "servos/read_options.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/model/scene_model.hpp"
#include "trifinger/sim/simulation_options.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger {

/// The torques that carry the weight of a robot at a position of its driven joints, for
/// `servos::ServoRobotOptions::weight`. All other joints are where sessions begin.
[[nodiscard]] std::function<void(std::span<const double> position, std::span<double> torque)>
weight_of(std::shared_ptr<const SceneModel> model);

/// A simulated robot as what emulated Dynamixel motors move: torques act without any safety checks.
/// Sensors measure their joints and move nothing.
class ServoPlant final : public dynamixel::Plant {
 public:
  /// It begins at rest where sessions begin. Motors and sensors are those of `servos`.
  /// @throws InvalidArgument
  ServoPlant(SimulationOptions options, const servos::ServoConfig& servos);
  ~ServoPlant() override;

  [[nodiscard]] double position(std::size_t motor) const noexcept override;
  [[nodiscard]] double velocity(std::size_t motor) const noexcept override;
  void step(std::span<const double> torque, Nanoseconds duration) noexcept override;

  /// Puts a driven joint somewhere else, at rest [rad], [m].
  void set_position(std::size_t joint, double position) noexcept;
  /// Puts everything where sessions begin.
  void reset() noexcept;
  [[nodiscard]] const SceneModel& model() const noexcept { return simulator_.model(); }
  /// The state of the simulation, for those who include MuJoCo's own header.
  [[nodiscard]] const mjData_& data() const noexcept { return *data_; }
  /// True if the simulation has diverged; then nothing moves any more.
  [[nodiscard]] bool has_diverged() const noexcept { return has_diverged_; }

 private:
  Simulator simulator_;
  std::vector<servos::Servo> servos_;
  std::vector<std::size_t> sensed_;  // the model's joint of each sensor
  SceneModel::Data data_;
  Nanoseconds step_{0};  // of the physics
  Nanoseconds rest_{0};  // of the time that has passed
  bool has_diverged_{false};
};

}  // namespace trifinger
