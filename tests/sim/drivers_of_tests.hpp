// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <memory>
#include <string_view>

#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::test {

template <class R>
SimulationOptions<R> options_of_tests() {
  SimulationOptions<R> options;
  if constexpr (R::kTips == 1) options.description.arrangement = Arrangement::kSingleFinger;
  options.object_period = 4;
  options.object_delay = 2;
  options.object_position_noise = 1e-3;
  return options;
}

template <class R>
struct SimulatedRobotTraits {
  static constexpr std::string_view kName =
      R::kTips == 1 ? "SimulatedFinger" : "SimulatedTriFinger";
  using Robot = R;

  static std::unique_ptr<UntypedDriver> make_driver() {
    return std::make_unique<SimulatedRobot<R>>(options_of_tests<R>());
  }
  static typename R::Action action(TimeIndex k) {
    typename R::Action action;
    for (std::size_t joint = 0; joint < R::kJoints; ++joint) {
      action.torque[joint] =
          0.2 * std::sin(static_cast<double>(k + 1) + static_cast<double>(joint));
    }
    return action;
  }
};

}  // namespace trifinger::test
