// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>

#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::test {

/// Calls the driver like the back-end, without the back-end's own limits.
template <class R>
class BareDriver {
 public:
  explicit BareDriver(SimulationOptions options) : robot(std::move(options)) {
    (void)robot.prepare(0);
    (void)robot.get_latest_observation(&observation);
  }

  DriverReport step(const typename R::Action& desired) {
    const DriverReport report = robot.apply_action(&desired, &applied);
    (void)robot.get_latest_observation(&observation);
    return report;
  }
  DriverReport fault_after(const typename R::Action& desired, int max_steps) {
    for (int i = 0; i < max_steps; ++i) {
      const DriverReport report = step(desired);
      if (report.state == DriverReport::State::kFault) return report;
    }
    return {};
  }
  /// Returns to the beginning.
  void reset() {
    robot.reset();
    (void)robot.get_latest_observation(&observation);
  }

  SimulatedRobot robot;
  typename R::Observation observation;
  typename R::AppliedAction applied;
};

}  // namespace trifinger::test
