// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/control/motion.hpp"
#include "trifinger/control/safety_limits.hpp"
#include "trifinger/model/robot_model.hpp"

/// \file
/// Models for planning: they move almost like the robot, and are simulated many times faster.

namespace trifinger::control {

/// A state from which a plan may begin: everything that moves in a `PlanningModel`.
struct PlanningState {
  Seconds time{0};               ///< Time [s] on any clock; the same one for all states of a plan.
  std::vector<double> position;  ///< MuJoCo's `qpos`: the joints, then the objects.
  std::vector<double> velocity;  ///< MuJoCo's `qvel`.
};

/// What a `PlanningModel` leaves out. docs/planning.md says what each figure costs.
struct PlanningModelOptions {
  Seconds time_step{0.006};  ///< [s]; more than 6 ms lets fast tips sink into objects.
  int iterations{4};         ///< Iterations of the solver of contacts in a step, at most.
  /// Ratio of the stiffness of friction to that of normal forces; higher: held objects slip less.
  double impratio{10.0};
  /// The lower links touch objects, each as one capsule. Otherwise only the tips do.
  bool lower_links{true};
  /// The fingers touch each other, with tips and lower links.
  bool fingers_touch{true};
  /// Share of the largest torque that plans may use; the rest is for feedback.
  double torque_share{0.95};
  /// The limits of the robot's safety checks; default: those of the variant.
  std::optional<SafetyLimits> limits{};
};

/// A joint with a motor, as plans see it.
struct PlannedJoint {
  double lower;       ///< Range of targets [rad].
  double upper;       ///< [rad]
  double max_torque;  ///< Largest torque of a plan [Nm].
};

/// A model for planning, with the same joints and objects in the same order as a `RobotModel`.
///
/// Steps are long. Contacts have pyramids of friction and few iterations. The wall and all parts of
/// fingers but tips and lower links touch nothing. The damping of the safety checks is damping of
/// the joints. Fingers do not pass through the table, and joints stop at their limits.
class PlanningModel {
 public:
  /// @throws InvalidArgument that names the first value that makes no sense.
  explicit PlanningModel(const RobotDescription& description,
                         const PlanningModelOptions& options = {});
  /// Copies any MuJoCo model, for another robot. Its first joints must be `joints`: hinges or
  /// slides, with one motor each in the same order, whose control is the torque.
  /// @throws InvalidArgument if they are not.
  PlanningModel(const mjModel_& model, std::span<const PlannedJoint> joints,
                std::span<const int> tip_sites = {}, std::span<const ObjectAddress> objects = {});

  /// Joints that a plan may have.
  static constexpr int kMaxPlannedJoints = 32;

  [[nodiscard]] const mjModel_* mujoco() const noexcept { return model_.get(); }
  /// The model, for those who change masses or frictions before it is used.
  [[nodiscard]] mjModel_* mujoco() noexcept { return model_.get(); }
  [[nodiscard]] SceneModel::Compiled copy() const;

  [[nodiscard]] Seconds time_step() const noexcept;
  [[nodiscard]] int num_joints() const noexcept { return static_cast<int>(joints_.size()); }
  [[nodiscard]] int position_size() const noexcept;
  [[nodiscard]] int velocity_size() const noexcept;
  [[nodiscard]] const std::vector<PlannedJoint>& joints() const noexcept { return joints_; }
  /// Sites at the tips of the fingers.
  [[nodiscard]] const std::vector<int>& tip_sites() const noexcept { return tip_sites_; }
  [[nodiscard]] const std::vector<ObjectAddress>& objects() const noexcept { return objects_; }
  /// @throws InvalidArgument that names the existing objects.
  [[nodiscard]] const ObjectAddress& object(const std::string& name) const;

  /// The initial pose at rest, at time 0.
  [[nodiscard]] PlanningState initial_state() const;
  /// Sets positions [rad] and velocities [rad/s] of the joints. Does not allocate.
  void set_joints(std::span<const double> position, std::span<const double> velocity,
                  PlanningState& state) const noexcept;
  /// Sets pose and twist of an object, both in the world frame. Does not allocate.
  static void set_object(const ObjectAddress& object, const Pose& pose, const Twist& twist,
                         PlanningState& state) noexcept;
  /// Pose and twist of an object in the world frame.
  [[nodiscard]] static Pose object_pose(const ObjectAddress& object,
                                        std::span<const double> position) noexcept;
  [[nodiscard]] static Twist object_twist(const ObjectAddress& object,
                                          std::span<const double> position,
                                          std::span<const double> velocity) noexcept;
  /// @throws InvalidArgument if the numbers are too few, too many or not finite.
  void check(const PlanningState& state) const;

 private:
  SceneModel::Compiled model_;
  std::vector<PlannedJoint> joints_;
  std::vector<int> tip_sites_;
  std::vector<ObjectAddress> objects_;
};

}  // namespace trifinger::control
