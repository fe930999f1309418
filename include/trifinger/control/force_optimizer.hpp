// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>

#include "trifinger/control/grasp.hpp"

namespace trifinger::control {

/// The weights of the force optimization and its friction cones. The weights may differ by a factor
/// of at most 100.
struct ForceOptimizerConfig {
  int friction_sides{4};          ///< Sides of each friction pyramid, 3 to 8.
  double normal_weight{1.0};      ///< Weight of squared normal forces; above zero.
  double tangential_weight{1.0};  ///< Weight of squared tangential forces; above zero.
};

/// The torques that the joints can give to press with the tips. Row i of the Jacobian tells how
/// coordinate i of the contacts' positions changes when the joints move.
struct TorqueLimits {
  /// Jacobians of the contacts in the frame of the grasp, 9 x 9 [m/rad]. For the world frame this
  /// is `Kinematics::tip_jacobians`.
  Eigen::Matrix<double, 3 * kContacts, kMaxJoints> jacobians;
  /// Torques that the joints need without any contact [Nm]: `Kinematics::bias_torques`.
  Eigen::Matrix<double, kMaxJoints, 1> bias;
  Eigen::Matrix<double, kMaxJoints, 1> limits;  ///< [Nm], not negative.
};

/// Quality of a result of the force optimization, best first.
enum class ForceStatus {
  kExact,          ///< The forces make exactly the wanted wrench.
  kClosestWrench,  ///< No allowed forces make the wanted wrench; these come closest to it.
  /// Even the smallest normal forces need more torque than the limits allow. The torque limits were
  /// ignored. Friction and normal forces are within their limits, and the wrench is the closest
  /// possible.
  kTorqueLimitsExceeded,
  kInvalid,  ///< A number was not finite or out of its range. All forces are zero.
};

/// A result of the force optimization.
struct ForceDistribution {
  /// Forces of the tips on the object [N], in the frame of the grasp: three numbers for each of the
  /// three contacts.
  ContactForces forces{ContactForces::Zero()};
  Wrench wrench{};  ///< The wrench that the forces make.
  ForceStatus status{ForceStatus::kInvalid};

  explicit operator bool() const noexcept { return status == ForceStatus::kExact; }
};

/// Finds the contact forces that make a wanted wrench, with the paper's quadratic program.
///
///     minimise    1/2 f' W f
///     subject to  G f = wrench                      (grasp map)
///                 f_i in the friction pyramid of contact i
///                 min_normal_force <= normal part of f_i <= max_normal_force
///                 |J' f + bias| <= limits           (where torque limits are given)
///
/// If the program has no solution, this minimizes `|G f - wrench|` instead. A small part of the
/// objective above is added, so that the solution is unique. To compare moments with forces, a
/// moment is divided by the contacts' mean distance (r.m.s.) from `centre`.
///
/// Memory is allocated only during construction, and `solve` always ends. One object must not be
/// used by several threads at once.
class ForceOptimizer {
 public:
  /// @throws InvalidArgument that names the first value that makes no sense.
  explicit ForceOptimizer(const ForceOptimizerConfig& config = {});
  ForceOptimizer(ForceOptimizer&&) noexcept;
  ForceOptimizer& operator=(ForceOptimizer&&) noexcept;
  ~ForceOptimizer();

  /// Distributes `wrench`, which is given about `centre` [m], over the three contacts. If that is
  /// impossible, the result comes closest to it and its `status` says so.
  [[nodiscard]] ForceDistribution solve(const Grasp& grasp, const Eigen::Vector3d& centre,
                                        const Wrench& wrench) noexcept;

  /// Distributes `wrench`, as above, within the torques that the joints can give.
  [[nodiscard]] ForceDistribution solve(const Grasp& grasp, const Eigen::Vector3d& centre,
                                        const Wrench& wrench, const TorqueLimits& torques) noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::control
