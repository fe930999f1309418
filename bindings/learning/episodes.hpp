// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "session/frontend.hpp"
#include "simulation/simulation.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/learning/environment.hpp"
#include "trifinger/learning/task.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::bindings {

/// `Environment`, one episode of it on a robot, and what was seen last.
class Episodes {
 public:
  Episodes(const learning::TaskDescription& task, const learning::EnvironmentOptions& options,
           RobotConfig config);

  /// What is known after an action.
  struct Seen {
    TimeIndex time_index{-1};  ///< Step at which the observation was measured.
    TimeIndex object_age{-1};  ///< Of the object's pose [steps]; -1 if it was not found yet.
  };

  /// Draws the beginning of an episode.
  void begin(std::uint64_t seed, std::uint64_t number);
  /// Where the hinges and slides of a robot from a file begin.
  [[nodiscard]] std::vector<double> model_positions() const;
  /// Appends an action for all its steps, waits for its observation, and looks at it.
  Seen step(PythonFrontend& robot, std::span<const float> numbers, const PythonFrontend* poses,
            const PythonSimulation* simulation);
  /// Looks at what the robot measured at step `t`. `poses` is the companion with the poses of
  /// objects, and `simulation` knows where they really are, if that counts.
  Seen look(PythonFrontend& robot, TimeIndex t, const PythonFrontend* poses,
            const PythonSimulation* simulation);
  /// Refuses another robot than that of the configuration, by `actual` if that is known, and takes
  /// the age of its poses from there.
  void check_robot(const std::optional<std::string>& actual);

  learning::Environment environment;
  RobotConfig config;
  TimeIndex oldest_sure_age;            // of a pose [steps]
  std::vector<camera::Camera> cameras;  // that are observed
  learning::Start start;
  learning::Episode episode;
  learning::Outcome outcome;
  TimeIndex last_step{-1};  // of the robot, after an action
  std::vector<float> observation;
  std::vector<double> achieved;
  std::vector<double> desired;

 private:
  [[nodiscard]] Seen judge(const ElementDescription& type, std::span<const std::byte> element,
                           TimeIndex t, const PythonFrontend* poses,
                           const PythonSimulation* simulation);

  std::vector<std::byte> burst_;  // the actions that a step appends
  std::vector<std::byte> element_;
};

}  // namespace trifinger::bindings
