// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

#include "trifinger/control/motion.hpp"
#include "trifinger/model/robot_description.hpp"

/// \file
/// The effect of forces at the tips on an object. Positions, normals, forces and wrenches are all
/// in one frame, which the caller chooses: the object's frame, as in the paper, or the world frame.

namespace trifinger::control {

inline constexpr int kContacts = kMaxFingers;

/// Three numbers per contact, beginning with contact 0.
using ContactForces = Eigen::Matrix<double, 3 * kContacts, 1>;

/// Rows: force, then moment. Columns: the contact forces.
using GraspMap = Eigen::Matrix<double, 6, 3 * kContacts>;

/// A force and a moment. The moment is about a point that is stated with each use.
struct Wrench {
  Eigen::Vector3d force{Eigen::Vector3d::Zero()};   ///< [N]
  Eigen::Vector3d moment{Eigen::Vector3d::Zero()};  ///< [Nm]
};

/// A point at which a tip touches an object and pushes, with friction and without adhesion.
///
/// A tip that does not touch is a contact whose `max_normal_force` is 0. It gets no force.
struct Contact {
  Eigen::Vector3d position{Eigen::Vector3d::Zero()};  ///< [m]
  /// Direction in which the tip can push, into the object; its length must not be zero.
  Eigen::Vector3d normal{Eigen::Vector3d::UnitX()};
  /// Coefficient that a controller relies on; it should be lower than the real one.
  double friction{0.5};
  double min_normal_force{0.0};   ///< [N], not negative.
  double max_normal_force{10.0};  ///< [N], at least `min_normal_force`.
};

/// The contacts of all fingers, finger 0 first.
using Grasp = std::array<Contact, kContacts>;

/// A matrix whose columns are two tangents and `normal`, orthonormal and right-handed. The first
/// tangent is perpendicular to z, or to x if the normal is nearly along z.
[[nodiscard]] Eigen::Matrix3d contact_frame(const Eigen::Vector3d& normal) noexcept;

/// The map from contact forces to the wrench on the object about `centre` [m]. It has 6 rows, force
/// and moment, and 9 columns, three for each of the three contacts. Its rank is 6 if the contacts
/// do not lie on one line.
[[nodiscard]] GraspMap grasp_map(const Grasp& grasp, const Eigen::Vector3d& centre) noexcept;

/// The total wrench of nine `forces` [N] at the three contacts, about `centre` [m].
[[nodiscard]] Wrench wrench_of(const Grasp& grasp, const Eigen::Vector3d& centre,
                               const ContactForces& forces) noexcept;

/// The motion of the rigid body whose points at the three contacts move with `velocities` [m/s],
/// x, y, z for each contact: the twist about `centre` [m] that explains them best, by least
/// squares. Contacts that do not move with one body leave a rest, which is not returned. The
/// contacts must not lie on one line.
[[nodiscard]] Twist twist_of(const Grasp& grasp, const Eigen::Vector3d& centre,
                             const ContactForces& velocities) noexcept;

/// A pyramid of 3 to 8 sides inside Coulomb's friction cone: a contact whose force lies in the
/// pyramid does not slip.
///
/// With four sides it is the paper's pyramid: `|tangential_i| <= friction / sqrt(2) * normal` for
/// both tangents. Its edges lie on the cone, so more sides use more of the cone.
class FrictionPyramid {
 public:
  static constexpr int kMinSides = 3;
  static constexpr int kMaxSides = 8;

  /// @throws InvalidArgument if `sides` is not 3 to 8.
  explicit FrictionPyramid(int sides = 4);

  [[nodiscard]] int sides() const noexcept { return sides_; }

  /// Points inward from side `i`, in the contact frame: forces with `side.dot(force) >= 0` are on
  /// its inner side. Its tangential part has length 1.
  [[nodiscard]] Eigen::Vector3d side(int i, double friction) const noexcept {
    return {-directions_(0, i), -directions_(1, i), friction * apothem_};
  }

  /// Tangential force that could be added to `force` [N] before it leaves the pyramid, in the
  /// direction with the least room. Negative outside. `force` is in the contact frame.
  [[nodiscard]] double margin(const Eigen::Vector3d& force, double friction) const noexcept;

 private:
  int sides_;
  double apothem_;  // Apothem of the polygon whose corners lie on the unit circle.
  Eigen::Matrix<double, 2, kMaxSides> directions_;
};

}  // namespace trifinger::control
