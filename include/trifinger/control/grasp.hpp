// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

#include "trifinger/model/robot_description.hpp"

/// \file
/// What forces at the tips do to an object. Positions, normals, forces and wrenches are all in one
/// frame of the caller's choice: that of the object, as in the paper, or that of the world.

namespace trifinger::control {

inline constexpr int kContacts = kMaxFingers;

/// Three numbers per contact: those of contact 0 first.
using ContactForces = Eigen::Matrix<double, 3 * kContacts, 1>;

/// Rows: force, then moment. Columns: the contact forces.
using GraspMap = Eigen::Matrix<double, 6, 3 * kContacts>;

/// A force and a moment about a point that goes with it.
struct Wrench {
  Eigen::Vector3d force{Eigen::Vector3d::Zero()};   ///< [N]
  Eigen::Vector3d moment{Eigen::Vector3d::Zero()};  ///< [Nm]
};

/// A point at which a tip touches an object and pushes, with friction and without adhesion.
///
/// A tip that does not touch is a contact with `max_normal_force` 0: it gets no force.
struct Contact {
  Eigen::Vector3d position{Eigen::Vector3d::Zero()};  ///< [m]
  /// Into the object, of any length but zero: the direction in which the tip can push.
  Eigen::Vector3d normal{Eigen::Vector3d::UnitX()};
  /// What a controller relies on; less than what there is.
  double friction{0.5};
  double min_normal_force{0.0};   ///< [N], not negative.
  double max_normal_force{10.0};  ///< [N], not below the smallest.
};

/// The contacts of all fingers, finger 0 first.
using Grasp = std::array<Contact, kContacts>;

/// Columns: two tangents and `normal`, orthonormal and right-handed. The first tangent is normal to
/// z, or to x where the normal is nearly along z.
[[nodiscard]] Eigen::Matrix3d contact_frame(const Eigen::Vector3d& normal) noexcept;

/// Turns contact forces into the wrench on the object about `centre` [m]. It is 6 x 9 of rank 6 if
/// the contacts do not lie on one line.
[[nodiscard]] GraspMap grasp_map(const Grasp& grasp, const Eigen::Vector3d& centre) noexcept;

/// What `forces` [N] at the contacts amount to about `centre` [m].
[[nodiscard]] Wrench wrench_of(const Grasp& grasp, const Eigen::Vector3d& centre,
                               const ContactForces& forces) noexcept;

/// The forces that a contact with friction can bear, as a pyramid inside Coulomb's cone: whatever
/// lies in the pyramid does not slip.
///
/// With four sides it is the paper's: `|tangential_i| <= friction / sqrt(2) * normal` for both
/// tangents. Its edges lie on the cone, so more sides waste less of it.
class FrictionPyramid {
 public:
  static constexpr int kMinSides = 3;
  static constexpr int kMaxSides = 8;

  /// @throws InvalidArgument if `sides` is not 3 to 8.
  explicit FrictionPyramid(int sides = 4);

  [[nodiscard]] int sides() const noexcept { return sides_; }

  /// Points inward from side `i`, in the contact frame: forces with `side.dot(force) >= 0` are on
  /// its inner side. Its tangential part has the length 1.
  [[nodiscard]] Eigen::Vector3d side(int i, double friction) const noexcept {
    return {-directions_(0, i), -directions_(1, i), friction * apothem_};
  }

  /// How much more tangential force fits into the pyramid beside `force` [N], in the direction with
  /// the least room; negative outside. `force` is in the contact frame.
  [[nodiscard]] double margin(const Eigen::Vector3d& force, double friction) const noexcept;

 private:
  int sides_;
  double apothem_;  // Of the polygon with corners on the unit circle.
  Eigen::Matrix<double, 2, kMaxSides> directions_;
};

}  // namespace trifinger::control
