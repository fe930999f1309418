// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>

#include "trifinger/control/grasp.hpp"

namespace trifinger::control {

/// What the optimisation minimises, and its friction cones. The weights differ by a factor 100 at
/// most.
struct ForceOptimizerConfig {
  int friction_sides{4};          ///< Of the friction pyramids, 3 to 8.
  double normal_weight{1.0};      ///< Of squared normal forces; above zero.
  double tangential_weight{1.0};  ///< Of squared tangential forces; above zero.
};

/// The torques that joints can give, for tips that press: row i of the Jacobian is what coordinate
/// i of the contacts' positions does when the joints move.
struct TorqueLimits {
  /// Of the contacts in the frame of the grasp [m/rad]; `Kinematics::tip_jacobians` in the world's.
  Eigen::Matrix<double, 3 * kContacts, kMaxJoints> jacobians;
  /// What the joints need without any contact [Nm]; `Kinematics::bias_torques`.
  Eigen::Matrix<double, kMaxJoints, 1> bias;
  Eigen::Matrix<double, kMaxJoints, 1> limits;  ///< [Nm], not negative.
};

/// How good an answer of the force optimisation is, best first.
enum class ForceStatus {
  kExact,          ///< The wrench is the one wanted.
  kClosestWrench,  ///< No allowed forces make the wanted wrench; these come closest to it.
  /// Even the smallest normal forces ask for more torque than there is. The torque limits were left
  /// aside; friction and normal forces are as they should be and the wrench is the closest.
  kTorqueLimitsExceeded,
  kInvalid,  ///< A number was not finite or out of its range. All forces are zero.
};

struct ForceDistribution {
  ContactForces forces{
      ContactForces::Zero()};  ///< Of the tips on the object [N], in the frame of the grasp.
  Wrench wrench{};             ///< That they amount to.
  ForceStatus status{ForceStatus::kInvalid};

  explicit operator bool() const noexcept { return status == ForceStatus::kExact; }
};

/// Finds the contact forces that make a wanted wrench: the paper's quadratic program.
///
///     minimise    1/2 f' W f
///     subject to  G f = wrench                      (grasp map)
///                 f_i in the friction pyramid of contact i
///                 min_normal_force <= normal part of f_i <= max_normal_force
///                 |J' f + bias| <= limits           (where torque limits are given)
///
/// Where this has no solution, it minimises `|G f - wrench|` instead, with a little of the above so
/// that the answer is unique. There, a moment counts as much as the force that makes it at the
/// contacts' mean distance (r.m.s.) from `centre`.
///
/// Allocates only while it is constructed, and always ends. Not for several threads at once.
class ForceOptimizer {
 public:
  /// @throws InvalidArgument naming the first value that makes no sense.
  explicit ForceOptimizer(const ForceOptimizerConfig& config = {});
  ForceOptimizer(ForceOptimizer&&) noexcept;
  ForceOptimizer& operator=(ForceOptimizer&&) noexcept;
  ~ForceOptimizer();

  /// Distributes `wrench`, which is about `centre` [m], over the contacts.
  [[nodiscard]] ForceDistribution solve(const Grasp& grasp, const Eigen::Vector3d& centre,
                                        const Wrench& wrench) noexcept;

  /// The same within the torques that the joints have.
  [[nodiscard]] ForceDistribution solve(const Grasp& grasp, const Eigen::Vector3d& centre,
                                        const Wrench& wrench, const TorqueLimits& torques) noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::control
