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
  std::vector<double> low;  // Of joint positions that actions ask for [rad].
  std::vector<double> high;
};

// What a task sees: measured.
struct View {
  TipPositions tips;  // [m]
  ObjectPose object;
  double time;  // Since the episode began [s].
};

// What is to be done with a robot. Constant, and free of memory from the heap once it exists.
class Task {
 public:
  Task() = default;
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;
  virtual ~Task() = default;

  // Empty without an object.
  [[nodiscard]] virtual std::string_view object_name() const noexcept { return ""; }
  // Whether each finger has a goal of its own: three numbers each.
  [[nodiscard]] virtual bool has_goals_of_fingers() const noexcept { return false; }
  [[nodiscard]] virtual Entry goal() const = 0;

  // Fills in joints and object.
  virtual void draw_start(const Workspace& workspace, Random& random,
                          Start& start) const noexcept = 0;
  virtual void draw_goal(const Workspace& workspace, Random& random,
                         std::span<double> goal) const noexcept = 0;
  // How many goals there have been at this time.
  [[nodiscard]] virtual std::int64_t num_goals(double /*time*/) const noexcept { return 1; }

  // What counts as achieved, after a look at the robot.
  virtual void achieve(const View& view, Episode& episode,
                       std::span<double> achieved) const noexcept = 0;
  [[nodiscard]] virtual double reward(std::span<const double> achieved,
                                      std::span<const double> desired) const noexcept = 0;
  [[nodiscard]] virtual bool is_success(std::span<const double> achieved,
                                        std::span<const double> desired,
                                        const Episode& episode) const noexcept = 0;
  // Whether nothing can follow.
  [[nodiscard]] virtual bool has_ended(const View& /*view*/,
                                       const Episode& /*episode*/) const noexcept {
    return false;
  }
};

// @throws InvalidArgument naming the tasks there are
[[nodiscard]] std::unique_ptr<const Task> make_task(std::string_view name,
                                                    const RobotDescription& description);

}  // namespace trifinger::learning
