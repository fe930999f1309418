// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/learning/environment.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::learning {

inline constexpr double kDegree = std::numbers::pi / 180.0;

// What a task knows of the robot.
struct Workspace {
  const Kinematics* kinematics;
  std::vector<double> low;  // Lower bounds of the joint positions that actions ask for [rad].
  std::vector<double> high;
};

// What a task sees: measured values.
struct View {
  TipPositions tips;  // [m]
  ObjectPose object;
  double time;  // Time since the episode began [s].
};

// A task for a robot. It never changes, and takes no memory from the heap once it exists.
class Task {
 public:
  Task() = default;
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;
  virtual ~Task() = default;

  // Empty if the task has no object.
  [[nodiscard]] virtual std::string_view object_name() const noexcept { return ""; }
  // True if each finger has its own goal of three numbers.
  [[nodiscard]] virtual bool has_goals_of_fingers() const noexcept { return false; }
  [[nodiscard]] virtual Entry goal() const = 0;

  // Fills in the start of the joints and of the object.
  virtual void draw_start(const Workspace& workspace, Random& random,
                          Start& start) const noexcept = 0;
  virtual void draw_goal(const Workspace& workspace, Random& random,
                         std::span<double> goal) const noexcept = 0;
  // How many goals there have been up to this time.
  [[nodiscard]] virtual std::int64_t num_goals(double /*time*/) const noexcept { return 1; }

  // Computes what was achieved, from the newest measurement.
  virtual void achieve(const View& view, Episode& episode,
                       std::span<double> achieved) const noexcept = 0;
  [[nodiscard]] virtual double reward(std::span<const double> achieved,
                                      std::span<const double> desired) const noexcept = 0;
  [[nodiscard]] virtual bool is_success(std::span<const double> achieved,
                                        std::span<const double> desired,
                                        const Episode& episode) const noexcept = 0;
  // True if the episode is over and nothing more can be achieved.
  [[nodiscard]] virtual bool has_ended(const View& /*view*/,
                                       const Episode& /*episode*/) const noexcept {
    return false;
  }
};

// @throws InvalidArgument, which names the tasks that exist
[[nodiscard]] std::unique_ptr<const Task> make_task(std::string_view name,
                                                    const RobotDescription& description);

}  // namespace trifinger::learning
