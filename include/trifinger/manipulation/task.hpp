// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/grasp_planner.hpp"
#include "trifinger/control/motion.hpp"
#include "trifinger/control/trajectories.hpp"

namespace trifinger::manipulation {

using control::Motion;
using control::Pose;
using control::Seconds;

/// Lift the object along a vertical line, hold it, lower it.
struct LiftTask {
  double height{0.2};       ///< [m]
  Seconds lift_time{3.0};   ///< From rest to rest.
  Seconds hold_time{15.0};  ///< At the top.
  Seconds lower_time{3.0};  ///< Back to the table.
};

/// Slide the object over the table on a circle about the arena's centre.
struct SlideTask {
  double radius{0.05};     ///< [m]
  double turns{3.0};       ///< Below zero: clockwise.
  Seconds period{4.0};     ///< Of one turn.
  Seconds ramp_time{1.0};  ///< From rest to full speed, and back.
  /// Of the object's weight, what stays on the table; the tips carry the rest.
  double table_share{0.2};
  int start_angles{12};  ///< Where on the circle it may begin, evenly spread.
};

using Task = std::variant<LiftTask, SlideTask>;

/// Where the object may be led, in the grasp of the task, before the task begins: from some places
/// no grasp reaches all of the way.
struct LeadConfig {
  std::vector<double> turns{0.0};  ///< By how much it may be turned about the vertical [rad].
  /// For a lift: how far from the arena's centre it may begin, as a share of how far it lies.
  std::vector<double> distances{1.0};
  double height{0.003};  ///< For a lift: above the table at the end of its way [m].
  Seconds time{1.5};
  double turn_cost{0.3};  ///< What a turn by 1 rad is worth, in shares of the motors' torque.
};

/// All that a manipulation is made of. config/manipulate/edu.yml documents it as a file.
struct ManipulationConfig {
  std::string object{"cube"};  ///< A box.
  Task task{};
  LeadConfig lead{};
  control::GraspPlannerConfig planner{};
  control::GraspControllerConfig controller{};
  double pose_bandwidth{1.5};   ///< With which the object's pose is estimated while it is led [Hz].
  Seconds look_time{0.3};       ///< In which poses of the resting object are averaged.
  int max_grasps{3};            ///< How often it is grasped if it gets lost.
  Seconds max_duration{120.0};  ///< Of all, after which it is given up.
};

/// The ways that an object is led on, one after the other.
enum class Leg {
  kLead,    ///< To where the task begins; may take no time.
  kFollow,  ///< The task's line or circle.
  kHold,    ///< At rest at its end; of a lift only.
  kLower,   ///< Back to the table; of a lift only.
  kRest,    ///< Behind the end.
};

/// How the object shall move from being held until it is let go, as a function of time.
class ObjectWay {
 public:
  /// From `start`, where it is held, to `begin` and through the task. A slide begins at
  /// `start_angle` of its circle, and `begin` has to be there.
  /// @throws InvalidArgument if a number makes no sense
  ObjectWay(const Task& task, const LeadConfig& lead, const Pose& start, const Pose& begin,
            double start_angle = 0.0);

  [[nodiscard]] Motion at(Seconds time) const noexcept;
  [[nodiscard]] Leg leg_at(Seconds time) const noexcept;
  /// When a leg begins and the one before ends.
  [[nodiscard]] Seconds begin_of(Leg leg) const noexcept;
  [[nodiscard]] Seconds duration() const noexcept { return begin_of(Leg::kRest); }

  /// From now on down to the table, or at rest if it is there: what is left of the way where all is
  /// to end. `time` is that since the begin, for the result too.
  void give_up(Seconds time);

 private:
  Pose start_;
  Pose begin_;
  double weight_share_{1.0};  // That the tips carry.
  std::optional<control::PoseTrajectory> lead_;
  std::variant<control::PoseTrajectory, control::CircleTrajectory> follow_;
  std::optional<control::PoseTrajectory> lower_;
  Seconds follow_begin_;
  Seconds hold_begin_;
  Seconds lower_begin_;
  Seconds end_;
};

/// The same body turned by the smallest angle that makes one of its axes vertical: a box at rest on
/// a table, from a pose that was measured with an error.
[[nodiscard]] Pose upright(const Pose& pose) noexcept;

/// How an object is taken, and where it is led then.
struct Plan {
  control::Touches touches;
  double torque_share;  ///< The largest share of a motor's torque on all of the way.
  Pose start;           ///< Where the object is grasped.
  ObjectWay way;
};

/// Finds grasps that reach all of a task.
class TaskPlanner {
 public:
  /// @throws InvalidArgument if the robot has not three fingers or its scene no such box
  TaskPlanner(const RobotDescription& description, ManipulationConfig config);

  /// The best plan for an object that rests at `start`; nothing if there is none. Takes up to some
  /// seconds, and memory.
  [[nodiscard]] std::optional<Plan> plan(const Pose& start);

 private:
  struct Place {
    Pose begin;
    double start_angle;
    double cost;
  };

  [[nodiscard]] std::vector<Place> places(const Pose& start) const;

  ManipulationConfig config_;
  control::GraspPlanner planner_;
};

/// The largest height to which a lift reaches however the object is turned where it lies in the
/// arena's centre, in steps of 5 mm [m]; 0 if it cannot be lifted at all.
[[nodiscard]] double reachable_height(const RobotDescription& description,
                                      ManipulationConfig config);

}  // namespace trifinger::manipulation
