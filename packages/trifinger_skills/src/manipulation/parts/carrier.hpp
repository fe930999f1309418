// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>

#include "manipulation/parts/manipulation.hpp"
#include "manipulation/parts/task.hpp"
#include "manipulation/parts/tip_trajectory.hpp"
#include "manipulation/parts/tips_drive.hpp"
#include "trifinger/control/grasp_planner.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// Settings of a `Carrier`.
struct CarrierConfig {
  GraspingConfig grasp;  // One grasp at a time.
  double middle;         // Where the object is flipped and turned: distance from the middle [m].
  double near_angle;     // Until it is so near its goal [rad]. Then it is carried.
  double drag_distance;  // An object farther away that no grasp carries is dragged [m].
  double height;         // Above the table, on the way [m].
  double speed;          // Mean speed of the object [m/s].
  double turn_speed;
  Seconds least_time;  // Least time of the trajectory.
  Seconds lower_time;
};

// Raises the tips, grasps a box that lies on the table with all three, carries it to another pose
// with the same side up, puts it down and releases it.
class Carrier {
 public:
  // Throws InvalidArgument.
  Carrier(const SkillContext& context, CarrierConfig config);

  // Finds a grasp and a way for a box that rests at `object`. False if no grasp reaches the whole
  // way. Another thread than that of the other functions may call it, as long as they are not
  // called with what it has found before. Allocates memory. May throw.
  [[nodiscard]] bool plan(const Pose& object, const Pose& goal);
  // Carries the box as planned. `step` is the present one.
  void begin(TimeIndex step) noexcept;

  void see(TimeIndex captured, const Pose& pose) noexcept;
  const TriFinger::Action& update(TimeIndex step, const control::JointState& joints) noexcept;
  // The action of the last step.
  [[nodiscard]] const TriFinger::Action& action() const noexcept { return action_; }
  // Puts the box down where it is.
  void stop() noexcept;
  [[nodiscard]] bool has_ended() const noexcept { return has_ended_; }
  // The object is held: tips feel where it is.
  [[nodiscard]] bool is_holding() const noexcept {
    return !is_rising_ && carry_->grasp().phase == control::GraspPhase::kHold;
  }
  [[nodiscard]] double torque_share() const noexcept { return torque_share_; }
  [[nodiscard]] const Motion& object() const noexcept { return carry_->object(); }

 private:
  const JointValues& rise(Seconds elapsed, const control::JointState& joints) noexcept;

  RobotDescription description_;
  CarrierConfig config_;
  Seconds period_;
  control::GraspPlanner planner_;
  std::unique_ptr<Manipulation> next_;  // Made by `plan`.
  std::unique_ptr<Manipulation> carry_;
  TipsDrive drive_;
  std::array<TipTrajectory, control::kContacts> trajectories_{};
  TimeIndex step_{0};
  TipVectors home_;  // Where the tips begin.
  bool is_rising_{false};
  bool has_trajectories_{false};
  bool has_ended_{true};
  TimeIndex first_{0};  // Step at which `carry_` begins.
  double torque_share_{0.0};
  TriFinger::Action action_{};
};

}  // namespace trifinger::manipulation
