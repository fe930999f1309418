// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/grasp_planner.hpp"
#include "trifinger/control/trajectories.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// Lifts the object along a vertical line, holds it, and lowers it.
struct LiftTask {
  double height;       // [m]
  Seconds lift_time;   // Time from rest to rest.
  Seconds hold_time;   // Time at the top.
  Seconds lower_time;  // Time back to the table.
};

// Slides the object over the table on a circle about the arena's centre.
struct SlideTask {
  double radius;       // [m]
  double turns;        // Negative: clockwise.
  Seconds period;      // Time of one turn.
  Seconds ramp_time;   // Time from rest to full speed, and back.
  double table_share;  // Share of the object's weight that stays on the table.
  int start_angles;    // Number of possible beginnings, evenly spread on the circle.
};

// Carries the object to a pose in the air, holds it there, and brings it back.
struct CarryTask {
  Pose goal;
  double speed;       // Mean speed on the way [m/s].
  double turn_speed;  // Mean angular speed, if that takes longer [rad/s].
  double clearance;   // Distance of the object from the table while it is turned [m].
  Seconds hold_time;  // Time at the goal.
};

using Task = std::variant<LiftTask, SlideTask, CarryTask>;

// Where the object may be led, in the grasp of the task, before a lift or a slide begins. From some
// places no grasp reaches the whole trajectory.
struct LeadConfig {
  std::vector<double> turns;  // Angles by which it may be turned about the vertical [rad].
  // For a lift: distances from the arena's centre at which it may begin, as shares of the distance
  // at which the object lies.
  std::vector<double> distances;
  double turn_cost;  // Cost of a turn by 1 rad, in shares of the motors' torque.
  Seconds time;
};

// How an object is grasped with three tips and held. config/skills/grasping.yml explains it.
struct GraspingConfig {
  std::string object;  // A box.
  Seconds look_time;
  double pose_bandwidth;
  double error_gain;  // Of the integral of the object's error [1/s].
  int max_grasps;
  Seconds max_duration;
  control::GraspPlannerConfig planner;
  control::GraspControllerConfig controller;
};

// All settings of a manipulation: those of config/skills/lift.yml, slide.yml, or carry.yml.
struct ManipulationConfig : GraspingConfig {
  Task task;
  LeadConfig lead;
};

// The parts of the object's way, one after the other.
enum class Leg {
  kLead,    // To where the task begins; may take no time.
  kFollow,  // The task's line or circle, or the way to its goal.
  kHold,    // At rest at the end of the line or at the goal; not in a slide.
  kLower,   // Back to the table; not in a slide.
  kRest,    // After the end.
};

// The desired motion of the object from being held until its release, as a function of time.
class ObjectTrajectory {
 public:
  // The way leads in `lead_time` from `start`, where the object is held, to `begin` and through the
  // task. A slide
  // begins at `start_angle` of its circle, and `begin` must be there. `radius` is that of the
  // sphere around the object, which tells how high it must be to be tilted [m].
  // Throws InvalidArgument if a number makes no sense
  ObjectTrajectory(const Task& task, Seconds lead_time, const Pose& start, const Pose& begin,
                   double start_angle = 0.0, double radius = 0.0);

  [[nodiscard]] Motion at(Seconds time) const noexcept;
  [[nodiscard]] Leg leg_at(Seconds time) const noexcept;
  // Time when a leg begins and the previous one ends.
  [[nodiscard]] Seconds begin_of(Leg leg) const noexcept;
  [[nodiscard]] Seconds duration() const noexcept { return begin_of(Leg::kRest); }

  // Changes the rest of the way for an early end: from now on the object moves down to the table,
  // or rests if it is already there. One that is being carried goes back to its start. `time` is
  // the time since the beginning of the way; the changed way counts from the same beginning.
  void give_up(Seconds time);

 private:
  Pose start_;
  Pose begin_;
  double weight_share_{1.0};  // Share of the weight that the tips carry.
  std::optional<CarryTask> carry_;
  double safe_height_{0.0};  // Height of a carried object's centre where it is turned [m].
  std::optional<control::PoseTrajectory> lead_;
  std::variant<control::PoseSequence, control::CircleTrajectory> follow_;
  std::optional<control::PoseSequence> lower_;
  Seconds follow_begin_;
  Seconds hold_begin_;
  Seconds lower_begin_;
  Seconds end_;
};

// The pose turned by the smallest angle that makes one of its axes vertical. It turns a pose
// measured with an error into that of a box at rest on a table.
[[nodiscard]] Pose upright(const Pose& pose) noexcept;

// How an object is grasped and where it is then led.
struct Plan {
  control::Touches touches;
  double torque_share;  // Largest share of a motor's torque on the whole trajectory.
  Pose start;           // Where the object is grasped.
  ObjectTrajectory trajectory;
};

// Finds grasps that reach the whole way of a task.
class TaskPlanner {
 public:
  // Throws InvalidArgument if the robot does not have three fingers or its scene has no such box
  TaskPlanner(const RobotDescription& description, ManipulationConfig config);

  // The best plan for an object that rests at `start`; nothing if there is none. Takes up to some
  // seconds and allocates memory. Its grasp is none of those in `tried`, which have failed.
  [[nodiscard]] std::optional<Plan> plan(const Pose& start,
                                         std::span<const control::Touches> tried = {});

 private:
  struct Place {
    Pose begin;
    double start_angle;
    double cost;
  };

  [[nodiscard]] std::vector<Place> places(const Pose& start) const;

  ManipulationConfig config_;
  double radius_;  // Radius of the sphere around the object [m].
  control::GraspPlanner planner_;
};

// The largest height to which a lift brings an object in the arena's centre can be lifted, however
// it is turned, in steps of 5 mm [m]. 0 if it cannot be lifted at all.
[[nodiscard]] double reachable_height(const RobotDescription& description,
                                      ManipulationConfig config);

}  // namespace trifinger::manipulation
