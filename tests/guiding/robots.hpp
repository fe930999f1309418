// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <optional>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/guiding/guide_controller.hpp"
#include "trifinger/guiding/guided_robot.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::test {

template <class R>
SimulationOptions guided_options() {
  SimulationOptions options;
  if constexpr (R::kTips == 1) options.description.arrangement = Arrangement::kSingleFinger;
  options.description.objects.clear();
  // Pro has the tightest limits.
  options.description.variant = Variant::kPro;
  return options;
}

template <class R>
guiding::MeasuredJoints measured(const typename R::Observation& observation) {
  return {.position = joint_values(observation.position),
          .velocity = joint_values(observation.velocity)};
}

template <class R>
typename R::Action action_of(const guiding::GuideCommand& command) {
  typename R::Action action;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    action.torque[i] = command.torque[static_cast<Eigen::Index>(i)];
    action.position[i] = command.position[static_cast<Eigen::Index>(i)];
  }
  return action;
}

/// A simulated robot without a table or objects in its way, driven step by step by a controller.
template <class R>
class GuidedSimulation {
 public:
  explicit GuidedSimulation(std::optional<JointVector<R::kJoints>> begin = {},
                            const guiding::GuideSpeeds& speeds = {})
      : controller(guiding::guided_robot(guided_options<R>().description), speeds) {
    if (begin) robot.reset(*begin, Random{1});
    frontend.emplace(backend);
    observation = frontend->latest_observation();
    EXPECT_TRUE(controller.begin(measured<R>(observation)));
  }

  void step() {
    command = controller.update(measured<R>(observation));
    time = frontend->append_desired_action(action_of<R>(command));
    observation = frontend->get_observation(time);
  }
  /// Does steps until the robot has arrived. Returns false if it has not after `most` steps.
  [[nodiscard]] bool arrive(int most = 20000) {
    for (int i = 0; i < most; ++i) {
      step();
      if (controller.state().has_arrived) return true;
    }
    return false;
  }

  SimulatedRobot robot{guided_options<R>()};
  SessionHost host{SessionHost::anonymous()};
  Backend backend{robot, host};
  std::optional<Frontend<R>> frontend;
  guiding::GuideController controller;
  guiding::GuideCommand command{};
  typename R::Observation observation{};
  TimeIndex time{-1};
};

}  // namespace trifinger::test
