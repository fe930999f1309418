// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/control/grasp.hpp"
#include "trifinger/control/motion.hpp"
#include "trifinger/control/safety_limits.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::control {

/// The place where one tip touches an object, in the object's frame.
struct Touch {
  Eigen::Vector3d point{Eigen::Vector3d::Zero()};    ///< Point on the surface, from the centre [m].
  Eigen::Vector3d normal{Eigen::Vector3d::UnitX()};  ///< Direction into the object, of unit length.
};

/// The places where the tips touch, finger 0 first.
using Touches = std::array<Touch, kContacts>;

/// The path of a tip to its touch. The centre of the tip's sphere passes these points, given in the
/// world frame.
struct Approach {
  Eigen::Vector3d above;   ///< [m]
  Eigen::Vector3d beside;  ///< [m]
};

/// Distance from a face at which tips begin to close in on it [m].
inline constexpr double kStandoff = 0.035;
/// Height above the table at which the tips approach [m].
inline constexpr double kApproachHeight = 0.085;

/// The approach of a tip with radius `tip_radius` [m] to an object that rests at the pose
/// `object`.
[[nodiscard]] Approach approach_to(const Touch& touch, const Pose& object,
                                   double tip_radius) noexcept;

/// The candidates that a planner compares, and its requirements.
struct GraspPlannerConfig {
  /// Candidate offsets to both sides of a face's middle [m].
  std::vector<double> offsets{0.0, 0.009, 0.018};
  /// Candidate heights above the object's centre [m].
  std::vector<double> heights{0.0, -0.010, -0.020};
  double friction{0.45};         ///< Friction coefficient that the forces rely on.
  int friction_sides{4};         ///< Sides of its friction pyramids, 3 to 8.
  double min_normal_force{0.9};  ///< [N]
  double clearance{0.0005};      ///< Distance that fingers keep, except at touching tips [m].
  double limit_margin{0.03};     ///< Distance that joints keep from their soft limits [rad].
  double largest_torque{1.0};    ///< Share of the motors' torque that carrying may need.
  bool shared_faces{false};      ///< Two tips may touch one face, as a long box needs.
  std::optional<SafetyLimits> limits{};  ///< Default: the limits of the variant.
};

/// The result of a planner.
struct PlannedGrasp {
  Touches touches;  ///< Touches of the three tips, finger 0 first.
  /// Largest share of a motor's torque that carrying the object needs anywhere on the way.
  double torque_share;
};

/// Chooses which finger touches which side face of a box, and where: a face that is upright at the
/// beginning of the trajectory. The fingers reach the whole trajectory. Only their tips touch
/// anything, and they touch only the box. They carry it within friction, also during upward
/// acceleration, with as little torque as possible. One object must not be used by several threads
/// at once.
class GraspPlanner {
 public:
  /// @throws InvalidArgument if the robot does not have three fingers, if its scene has no box of
  /// this name, or with the name of the first value of `config` that makes no sense.
  explicit GraspPlanner(const RobotDescription& description, const std::string& object = "cube",
                        GraspPlannerConfig config = {});
  GraspPlanner(GraspPlanner&&) noexcept;
  GraspPlanner& operator=(GraspPlanner&&) noexcept;
  ~GraspPlanner();

  /// The best grasp to lead the object along `trajectory`, which begins where it is grasped.
  /// Nothing if there is none. The object may be tilted on the way, which takes longer to plan: up
  /// to a second instead of some milliseconds. Allocates memory.
  [[nodiscard]] std::optional<PlannedGrasp> plan(std::span<const Motion> trajectory);
  /// The best grasp but those in `tried`, which have failed. The fewer of its tips touch where they
  /// did in one of them, the better it is.
  [[nodiscard]] std::optional<PlannedGrasp> plan(std::span<const Motion> trajectory,
                                                 std::span<const Touches> tried);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::control
