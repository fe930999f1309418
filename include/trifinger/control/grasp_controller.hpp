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

/// How a `GraspController` works. The gains are those of docs/control.md.
struct GraspControllerConfig {
  ObjectGains object{};
  TipGains tips{.stiffness = 300.0};
  double friction{0.45};         ///< On which the forces that hold the object rely.
  int friction_sides{4};         ///< Of its pyramids, 3 to 8.
  double slip_friction{0.55};    ///< Tangential forces of tips that hold never exceed this share.
  double min_normal_force{0.9};  ///< Of each tip while it holds [N].
  double max_normal_force{5.0};  ///< Likewise [N].
  double touch_force{0.3};       ///< What is felt as a touch [N].
  double approach_speed{0.15};   ///< Of the tips, on average [m/s].
  double closing_speed{0.02};    ///< With which tips look for the faces [m/s].
  double penetration{0.006};     ///< How far behind a face they look for it [m].
  Seconds closing_time{4.0};     ///< In which all tips must have felt their faces.
  Seconds engage_time{0.5};      ///< In which touching becomes holding.
  Seconds roll_time{0.3};        ///< In which the tips' targets follow tips that roll.
  double slip_speed{0.03};       ///< Of a tip along its face, above which it slips [m/s].
  Seconds lost_time{0.1};        ///< Without touch, after which the object is lost.
  double lost_distance{0.03};    ///< From where it should be, likewise [m].
  std::optional<SafetyLimits> limits{};  ///< Default: those of the variant.
};

enum class GraspPhase {
  kIdle,      ///< The tips stay where they are.
  kApproach,  ///< On the way to the object, without touching it.
  kClose,     ///< Towards the faces, until all tips feel them.
  kEngage,    ///< Forces grow until they hold the object.
  kHold,      ///< The object follows the desired motion.
  kRelease,   ///< Off the faces, and up.
  kLost,      ///< It slipped away, or was not where it should be. The tips stay: release them.
};

/// What the joints measure.
struct JointState {
  JointValues position;  ///< [rad]
  JointValues velocity;  ///< [rad/s]
  JointValues torque;    ///< [Nm]
};

/// What a `GraspController` feels and does.
struct GraspState {
  GraspPhase phase{GraspPhase::kIdle};
  /// Wanted of the contacts while the object is held, in the world frame.
  ForceDistribution wanted{};
  /// What the tips press with, from the joints' torques: along their faces' normals and across [N].
  Eigen::Vector3d normal_forces{Eigen::Vector3d::Zero()};
  Eigen::Vector3d tangential_forces{Eigen::Vector3d::Zero()};
  /// How far each tip has moved along its face since all of them touched, by rolling and slipping
  /// [m].
  Eigen::Vector3d travel{Eigen::Vector3d::Zero()};
  /// How fast they do so, without what is faster than 5 Hz [m/s].
  Eigen::Vector3d slip_speeds{Eigen::Vector3d::Zero()};
  /// A tip moves along its face faster than tips roll.
  bool is_slipping{false};
  /// The largest share of a joint's torque limit that is asked for; what is above 1 the safety
  /// checks cut off.
  double torque_share{0.0};
};

/// The paper's controller: grasps an object with three tips, makes it follow a motion, and lets it
/// go.
///
/// The wrench that the object needs comes from its impedance, the forces that make it from the
/// force optimisation, and the joint torques from
///
///     torque = J' (forces + tip impedance) + M J^-1 (a - dJ/dt dq) + bias + damping dq
///
/// where `a` is the desired acceleration of the tips, and the last term makes up for what the
/// robot's safety checks take away. A round tip rolls on its face, so each contact is where the tip
/// is measured, and the target of the tip's impedance follows it slowly.
///
/// Call `update` once per step. Allocates only while it is constructed. Not for several threads at
/// once.
class GraspController {
 public:
  /// `body` is the object. @throws InvalidArgument if the robot has not three fingers, or naming
  /// the first value of `config` that makes no sense.
  GraspController(const RobotDescription& description, const RigidBody& body,
                  const GraspControllerConfig& config = {});
  GraspController(GraspController&&) noexcept;
  GraspController& operator=(GraspController&&) noexcept;
  ~GraspController();

  /// Goes to the object, which rests at `object`, and takes it at `touches`.
  void grasp(const Touches& touches, const Pose& object) noexcept;

  /// Lets the object go, whatever the phase.
  void release() noexcept;

  /// The torques for the next step [Nm], `elapsed` after the step before. `object` is where the
  /// object is and how it moves, `desired` how it should while it is held; until it is, `desired`
  /// should be where it rests.
  [[nodiscard]] const JointValues& update(Seconds elapsed, const JointState& joints,
                                          const Motion& object, const Motion& desired) noexcept;

  [[nodiscard]] const GraspState& state() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::control
