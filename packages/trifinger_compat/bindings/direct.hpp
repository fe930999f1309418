// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <deque>
#include <utility>

#include "direct_simulation.hpp"

namespace trifinger::bindings {

/// A DirectSimulation with the memory of its newest step and, if asked, of all steps.
template <class R>
class DirectSteps {
 public:
  using Robot = R;
  using Direct = DirectSimulation<R>;
  using Action = typename R::Action;
  using Observation = typename R::Observation;
  using Joints = typename Direct::Joints;
  /// What is kept of a step: torque and position that were asked for, then its observation.
  static constexpr std::size_t kRow = 5 * R::kJoints + R::kTips;

  explicit DirectSteps(SimulationOptions options) : simulation(std::move(options)) {}

  void desire(const Action& asked, const typename Direct::Control& control) noexcept {
    desired = asked;
    simulation.apply_control(asked, control, applied);
  }
  /// Moves on by one step with the applied torque. False if the simulation has diverged.
  [[nodiscard]] bool step() {
    before = simulation.observation();
    before.torque = applied.torque;
    const bool is_finite = simulation.step(applied.torque);
    if (is_kept) keep();
    return is_finite;
  }

  /// Continues where `other` is, see DirectSimulation.
  void continue_from(const DirectSteps& other) {
    simulation.continue_from(other.simulation);
    desired = other.desired;
    applied = other.applied;
    before = other.before;
    is_kept = other.is_kept;
    rows = other.rows;
  }

  Direct simulation;
  Action desired{};
  Action applied{};
  Observation before{};  ///< Of the newest step, with its torque.
  bool is_kept{false};
  std::deque<std::array<double, kRow>> rows;

 private:
  void keep() {
    auto* next = rows.emplace_back().data();
    const auto add = [&next](const auto& values) { next = std::ranges::copy(values, next).out; };
    add(desired.torque);
    add(desired.position);
    add(before.position);
    add(before.velocity);
    add(before.torque);
    add(before.tip_force);
  }
};

}  // namespace trifinger::bindings
