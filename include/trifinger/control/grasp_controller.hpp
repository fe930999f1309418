// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "trifinger/control/force_optimizer.hpp"
#include "trifinger/control/grasp_planner.hpp"
#include "trifinger/control/impedance.hpp"
#include "trifinger/control/motion.hpp"
#include "trifinger/control/safety_limits.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::control {

/// Settings of a `GraspController`. docs/control.md explains the gains.
struct GraspControllerConfig {
  ObjectGains object{};               ///< How stiffly the object is held.
  TipGains tips{.stiffness = 300.0};  ///< How stiffly each tip is held.
  double friction{0.45};              ///< Friction coefficient that the holding forces rely on.
  int friction_sides{4};              ///< Sides of its friction pyramids, 3 to 8.
  double slip_friction{0.55};    ///< Largest ratio of tangential to normal force of holding tips.
  double min_normal_force{0.9};  ///< Smallest normal force of each holding tip [N].
  double max_normal_force{5.0};  ///< Largest normal force of each holding tip [N].
  double touch_force{0.3};       ///< Force that counts as a touch [N].
  double approach_speed{0.15};   ///< Average speed of the tips on the way [m/s].
  double closing_speed{0.02};    ///< Speed of tips that search for the faces [m/s].
  double penetration{0.006};   ///< Depth inside the object up to which tips search for a face [m].
  Seconds closing_time{4.0};   ///< Time in which all tips must have felt their faces [s].
  Seconds engage_time{0.5};    ///< Time in which a touch becomes a hold [s].
  Seconds roll_time{0.3};      ///< Time constant with which targets follow rolling tips [s].
  double slip_speed{0.03};     ///< Speed of a tip along its face above which it slips [m/s].
  Seconds lost_time{0.1};      ///< Time without touch after which the object is lost [s].
  double lost_distance{0.03};  ///< Distance from its target at which the object is lost [m].
  std::optional<SafetyLimits> limits{};  ///< Default: the limits of the variant.
};

/// The phase of a `GraspController`.
enum class GraspPhase {
  kIdle,      ///< The tips stay where they are.
  kApproach,  ///< The tips go to the object without touching it.
  kClose,     ///< The tips move towards the faces until all of them feel a touch.
  kEngage,    ///< The forces grow until they hold the object.
  kHold,      ///< The object follows the desired motion.
  kRelease,   ///< The tips move off the faces, and then up.
  kLost,      ///< The object slipped away or was not at its place. The tips stay; release them.
};

/// Measurements of the nine joints, finger 0 first, from the base to the tip.
struct JointState {
  JointValues position;  ///< [rad]
  JointValues velocity;  ///< [rad/s]
  JointValues torque;    ///< [Nm]
};

/// The state of a `GraspController`: its phase and its forces.
struct GraspState {
  GraspPhase phase{GraspPhase::kIdle};
  /// The wanted contact forces while the object is held, in the world frame.
  ForceDistribution wanted{};
  /// Forces with which the three tips press along their faces' normals [N], computed from the
  /// joints' torques.
  Eigen::Vector3d normal_forces{Eigen::Vector3d::Zero()};
  /// Forces with which the three tips press across their faces' normals [N], computed from the
  /// joints' torques.
  Eigen::Vector3d tangential_forces{Eigen::Vector3d::Zero()};
  /// How far each of the three tips has moved along its face by rolling and slipping, since all
  /// tips touched [m].
  Eigen::Vector3d travel{Eigen::Vector3d::Zero()};
  /// Speeds of `travel`, low-pass filtered at 5 Hz [m/s].
  Eigen::Vector3d slip_speeds{Eigen::Vector3d::Zero()};
  /// The motion of the held object as the tips feel it: they roll on its faces without slipping.
  /// Zero while it is not held.
  Twist felt{};
  /// True if a tip moves along its face faster than tips roll.
  bool is_slipping{false};
  /// The largest ratio of a requested torque to its joint's limit. The safety checks cut off
  /// everything above 1.
  double torque_share{0.0};
};

/// The paper's controller (docs/control.md): it grasps an object with three tips, makes it follow a
/// motion, and releases it.
///
/// The object's impedance gives the wrench that the object needs. The force optimization gives the
/// contact forces that make this wrench. The joint torques are
///
///     torque = J' (forces + tip impedance) + M J^-1 (a - dJ/dt dq) + bias + damping dq
///
/// where `a` is the desired acceleration of the tips. The last term compensates the damping that
/// the robot's safety checks add. A round tip rolls on its face. Each contact is therefore at the
/// measured tip, and the target of the tip's impedance follows it slowly.
///
/// Call `update` once per step. Memory is allocated only during construction. One object must not
/// be used by several threads at once.
class GraspController {
 public:
  /// `body` is the object. @throws InvalidArgument if the robot does not have three fingers, or
  /// with the name of the first value of `config` that makes no sense.
  GraspController(const RobotDescription& description, const RigidBody& body,
                  const GraspControllerConfig& config = {});
  GraspController(GraspController&&) noexcept;
  GraspController& operator=(GraspController&&) noexcept;
  ~GraspController();

  /// Goes to the object, which rests at the pose `object`, and grasps it at three `touches`, finger
  /// 0 first.
  void grasp(const Touches& touches, const Pose& object) noexcept;

  /// Releases the object in any phase.
  void release() noexcept;

  /// Returns the nine joint torques for the next step [Nm], `elapsed` [s] after the previous step.
  /// `object` is the object's pose and motion. `desired` is its desired motion while it is held;
  /// before that, pass the pose where it rests.
  [[nodiscard]] const JointValues& update(Seconds elapsed, const JointState& joints,
                                          const Motion& object, const Motion& desired) noexcept;

  /// The state after the last `update`.
  [[nodiscard]] const GraspState& state() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::control
