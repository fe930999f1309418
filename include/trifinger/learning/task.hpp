// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/learning/environment.hpp"
#include "trifinger/learning/environment_options.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::learning {

inline constexpr double kDegree = std::numbers::pi / 180.0;

/// What a task knows of the robot.
struct Workspace {
  const Kinematics* kinematics;
  std::vector<double> low;  ///< Lowest joint positions that actions can ask for [rad].
  std::vector<double> high;
};

/// What a task sees at one instant, as it was measured.
struct View {
  TipPositions tips;  ///< [m]
  ObjectPose object;
  double time;  ///< Since the episode began [s].
};

/// What is to be done with a robot: starts, goals, reward, success. An environment asks it, in
/// threads that share it, once it is constant; so it takes no memory from the heap then, and keeps
/// what it has to remember in `Episode::memory`.
///
/// docs/environments.md has a task of one's own, step by step.
class Task {
 public:
  Task() = default;
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;
  virtual ~Task() = default;

  /// Name of the object that the task is about, in the robot's configuration; empty for none.
  [[nodiscard]] virtual std::string_view object_name() const noexcept { return ""; }
  /// True if each finger has a goal of its own, of three numbers.
  [[nodiscard]] virtual bool has_goals_of_fingers() const noexcept { return false; }
  /// Unit and bounds of goals: up to `kMaxGoal` numbers.
  [[nodiscard]] virtual Entry goal() const = 0;

  /// Fills in the joints and the object of a start. The joints are at the robot's usual position
  /// and the object at zero before.
  virtual void draw_start(const Workspace& workspace, Random& random,
                          Start& start) const noexcept = 0;
  virtual void draw_goal(const Workspace& workspace, Random& random,
                         std::span<double> goal) const noexcept = 0;
  /// Number of goals that an episode has had until `time` [s].
  [[nodiscard]] virtual std::int64_t num_goals(double /*time*/) const noexcept { return 1; }

  /// Says what is achieved, in the numbers of goals, each time the robot was looked at.
  virtual void achieve(const View& view, Episode& episode,
                       std::span<double> achieved) const noexcept = 0;
  [[nodiscard]] virtual double reward(std::span<const double> achieved,
                                      std::span<const double> desired) const noexcept = 0;
  [[nodiscard]] virtual bool is_success(std::span<const double> achieved,
                                        std::span<const double> desired,
                                        const Episode& episode) const noexcept = 0;
  /// True if nothing can follow: the episode is terminated.
  [[nodiscard]] virtual bool has_ended(const View& /*view*/,
                                       const Episode& /*episode*/) const noexcept {
    return false;
  }
};

/// A task with its name and what it needs.
struct TaskDescription {
  std::string name{};
  /// Options that this task has by default.
  EnvironmentOptions options{};
  /// What the configuration of a simulated robot must say, as in "boundary=false": a key and JSON.
  std::vector<std::string> config_overrides{"objects=[]"};
  int num_fingers{3};  ///< Number of fingers that a robot must have.
  std::function<std::unique_ptr<const Task>(const RobotDescription&)> make{};
};

/// Makes a task known by its name: environments, vector environments and Python's classes find it.
/// @throws InvalidArgument if another task has this name
void add_task(TaskDescription task);

/// Finds a task by its name.
/// @throws InvalidArgument naming the tasks there are
[[nodiscard]] TaskDescription find_task(std::string_view name);

/// What the configuration of a simulated robot must say for this task with these options: a key and
/// JSON each.
[[nodiscard]] std::vector<std::string> config_overrides(const TaskDescription& task,
                                                        const EnvironmentOptions& options);

}  // namespace trifinger::learning
