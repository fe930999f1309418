// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "trifinger/model/identified.hpp"
#include "trifinger/model/scene_model.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger {

// Pieces of a log, one after the other. Before each is a lead, in which the motors come to where
// they are in their play.
struct LoggedPieces {
  // Measured at two steps, where the lead begins and where the piece begins: pieces x 2 x joints.
  std::span<const double> position;    // [rad], [m]
  std::span<const double> velocity;    // [rad/s], [m/s]
  std::span<const std::size_t> begin;  // the step in `torque` with which a piece begins
  std::span<const double> torque;      // commanded in each step [Nm], [N]; steps x joints
  std::size_t lead{0};                 // [steps]
  std::size_t length{0};               // of each piece [steps]
};

// Moves a simulated robot by the torques of a log, without the safety chain, without objects and
// without contacts: what it would have measured if it were like this. Threads may share one.
class FreeRun {
 public:
  // @throws InvalidArgument
  explicit FreeRun(SimulationOptions options);

  [[nodiscard]] const SceneModel& model() const noexcept { return *model_; }
  [[nodiscard]] std::size_t num_joints() const noexcept { return model_->joints().size(); }
  // What the robot's configuration says, by the name of a row of `Identified::fields()`.
  [[nodiscard]] std::vector<double> described(const IdentifiedField& field) const;
  // How late torques and measurements are by the configuration, which does not count in `run`.
  [[nodiscard]] TimeIndex torque_delay() const noexcept { return torque_delay_; }
  [[nodiscard]] TimeIndex measurement_delay() const noexcept { return measurement_delay_; }
  // Joints with the same number move each other.
  [[nodiscard]] std::vector<int> trees() const;

  // Writes the positions that are measured after each step: pieces x length x n. All figures of
  // `robot` are absolute; its delays do not count. What has diverged stays where it is.
  // @throws InvalidArgument
  void run(const Identified& robot, const LoggedPieces& pieces, std::span<double> position) const;

 private:
  TimeIndex torque_delay_;
  TimeIndex measurement_delay_;
  SimulationOptions options_;
  std::shared_ptr<const SceneModel> model_;
};

}  // namespace trifinger
