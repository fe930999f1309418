// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manipulation/parts/task.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// Where on the table an object may be brought before it is carried to a goal in the air.
// config/skills/carry.yml documents them as a file.
struct RestConfig {
  double largest_tilt;         // Largest tilt of the goal from the resting object [rad].
  std::vector<double> turns;   // From the resting object to the goal, about the vertical [rad].
  std::vector<double> places;  // Distances from the arena's centre, as shares of the goal's.
  double farthest;             // Largest of these distances [m].
  double spare_turn;  // How far the resting object may be turned from where it should be [rad].
};

// A pose of an object on the table, and what it costs to bring the object there and to the goal.
struct Rest {
  Pose pose{};
  double cost{0.0};
};

// Finds how an object on the table gets to a goal in the air: with one grasp from where it lies,
// or from another pose on the table, to which it has to be brought first.
//
// A goal is in reach if `find_rest` finds such a pose.
class CarryPlanner {
 public:
  // `config` has a `CarryTask`.
  // Throws InvalidArgument
  CarryPlanner(const RobotDescription& description, const ManipulationConfig& config,
               RestConfig rests);

  // The best way to the goal for an object that rests at `start`; nothing if no grasp reaches it
  // but those in `tried`, which have failed.
  [[nodiscard]] std::optional<Plan> plan(const Pose& start,
                                         std::span<const control::Touches> tried = {}) {
    return planner_.plan(start, tried);
  }

  // The pose on the table from which the goal is reached, and to which an object that rests at
  // `now` is brought most easily; nothing if the goal is out of reach. Takes up to some seconds.
  [[nodiscard]] std::optional<Rest> find_rest(const Pose& now,
                                              std::span<const control::Touches> tried = {});

  // All poses that `find_rest` tries, the easiest first.
  [[nodiscard]] std::vector<Rest> rests(const Pose& now) const;

 private:
  Pose goal_;
  Eigen::Vector3d half_size_;
  RestConfig rests_;
  TaskPlanner planner_;
};

// The planner of the skill `carry` with its shipped configuration, or with some of its values
// replaced: "goal.position=[0, 0, 0.1]".
// Throws config::ConfigError, InvalidArgument, SystemError
[[nodiscard]] CarryPlanner load_carry_planner(const SkillContext& context,
                                              const std::vector<std::string>& overrides = {});

}  // namespace trifinger::manipulation
