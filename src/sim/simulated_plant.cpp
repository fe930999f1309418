// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/simulated_plant.hpp"

#include <utility>

namespace trifinger {
namespace {

// Boards live in milliseconds, whatever the period of the robot.
template <class R>
SimulationOptions<R> in_milliseconds(SimulationOptions<R> options) {
  options.period = kPhysicsStep;
  return options;
}

}  // namespace

template <class R>
SimulatedPlant<R>::SimulatedPlant(SimulationOptions<R> options)
    : simulator_(in_milliseconds(std::move(options))),
      data_(simulator_.model().make_data()),
      state_(simulator_.make_state()) {
  simulator_.reset(simulator_.initial_position(), Random{.seed = simulator_.options().seed},
                   *simulator_.model().mujoco(), *data_, state_);
  simulator_.observe(*data_, state_);
}

template <class R>
void SimulatedPlant<R>::step(const Joints& torque) noexcept {
  if (has_diverged_) return;
  has_diverged_ = !simulator_.move(torque, *simulator_.model().mujoco(), *data_, state_);
  if (!has_diverged_) simulator_.observe(*data_, state_);
}

template class SimulatedPlant<TriFinger>;
template class SimulatedPlant<Finger>;

}  // namespace trifinger
