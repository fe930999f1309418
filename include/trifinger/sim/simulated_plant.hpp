// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "trifinger/boards/emulator.hpp"
#include "trifinger/model/robot_model.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger {

/// The simulated robot as what emulated motor boards move: torques act without any safety checks.
template <class R>
class SimulatedPlant final : public boards::Plant<R> {
 public:
  using typename boards::Plant<R>::Joints;

  /// The robot begins at rest at its initial position. @throws InvalidArgument
  explicit SimulatedPlant(SimulationOptions<R> options);

  [[nodiscard]] Joints position() const noexcept override { return state_.observation.position; }
  [[nodiscard]] Joints velocity() const noexcept override { return state_.observation.velocity; }
  [[nodiscard]] std::array<double, R::kTips> tip_force() const noexcept override {
    return state_.observation.tip_force;
  }
  void step(const Joints& torque) noexcept override;

  /// True if the simulation has diverged; then nothing moves any more.
  [[nodiscard]] bool has_diverged() const noexcept { return has_diverged_; }

 private:
  Simulator<R> simulator_;
  RobotModel::Data data_;
  typename Simulator<R>::State state_;
  bool has_diverged_{false};
};

extern template class SimulatedPlant<TriFinger>;
extern template class SimulatedPlant<Finger>;

}  // namespace trifinger
