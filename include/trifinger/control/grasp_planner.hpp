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

/// Where one tip touches an object, in the object's frame.
struct Touch {
  Eigen::Vector3d point{Eigen::Vector3d::Zero()};    ///< On the surface, from the centre [m].
  Eigen::Vector3d normal{Eigen::Vector3d::UnitX()};  ///< Into the object, of unit length.
};

/// Where the tips touch, finger 0 first.
using Touches = std::array<Touch, kContacts>;

/// How a tip comes to its touch: through these points, for the centre of its sphere, in the world
/// frame [m].
struct Approach {
  Eigen::Vector3d above;
  Eigen::Vector3d beside;
};

/// From how far tips close in on a face [m].
inline constexpr double kStandoff = 0.035;
/// How high above the table they come [m].
inline constexpr double kApproachHeight = 0.085;

/// The approach of a tip of `tip_radius` [m] to an object at rest.
[[nodiscard]] Approach approach_to(const Touch& touch, const Pose& object,
                                   double tip_radius) noexcept;

/// Among what a planner looks, and what it asks for.
struct GraspPlannerConfig {
  std::vector<double> offsets{0.0, 0.009, 0.018};    ///< To both sides of a face's middle [m].
  std::vector<double> heights{0.0, -0.010, -0.020};  ///< Above the object's centre [m].
  double friction{0.45};                             ///< On which the forces rely.
  int friction_sides{4};                             ///< Of its pyramids, 3 to 8.
  double min_normal_force{0.9};                      ///< [N]
  double clearance{0.0005};    ///< Of fingers from all they do not touch with their tips [m].
  double limit_margin{0.03};   ///< Of joints from their soft limits [rad].
  double largest_torque{1.0};  ///< Share of the motors' torque that carrying may take.
  std::optional<SafetyLimits> limits{};  ///< Default: those of the variant.
};

/// What a planner has chosen.
struct PlannedGrasp {
  Touches touches;
  /// The largest share of a motor's torque that carrying the object takes, anywhere on the way.
  double torque_share;
};

/// Chooses which finger touches which side face of a box, and where. The fingers reach the whole
/// way, touch nothing but the box with nothing but their tips, carry it within friction, also where
/// it is accelerated upwards, and ask for as little torque as can be.
class GraspPlanner {
 public:
  /// @throws InvalidArgument if the robot has not three fingers or its scene no box of this name,
  /// or naming the first value of `config` that makes no sense.
  explicit GraspPlanner(const RobotDescription& description, const std::string& object = "cube",
                        GraspPlannerConfig config = {});
  GraspPlanner(GraspPlanner&&) noexcept;
  GraspPlanner& operator=(GraspPlanner&&) noexcept;
  ~GraspPlanner();

  /// The best grasp for leading the object along `way`, which begins where it is grasped; nothing
  /// if there is none. The object is as upright on all of the way as where it begins. Takes some
  /// milliseconds and memory.
  [[nodiscard]] std::optional<PlannedGrasp> plan(std::span<const Motion> way);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::control
