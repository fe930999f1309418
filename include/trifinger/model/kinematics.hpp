// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <iterator>
#include <memory>
#include <span>

#include "trifinger/model/robot_description.hpp"

namespace trifinger {

/// One number per joint of the whole robot. They are stored in place, never on the heap.
using JointValues = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxJoints, 1>;
using TipJacobian = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxJoints>;
using JointMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxJoints, kMaxJoints>;
/// Three numbers per finger, one tip after the other, finger 0 first.
using TipPositions = JointValues;

/// The numbers of a measurement as one vector.
template <std::size_t N>
[[nodiscard]] JointValues joint_values(const std::array<double, N>& numbers) noexcept {
  static_assert(N <= kMaxJoints);
  return JointValues::Map(numbers.data(), N);
}
/// There must be at most `kMaxJoints` numbers.
[[nodiscard]] inline JointValues joint_values(std::span<const double> numbers) noexcept {
  return JointValues::Map(numbers.data(), std::ssize(numbers));
}

/// Whether a finger can bring its tip to a point.
enum class Reach {
  kYes,
  kTooFar,         ///< Beyond the stretched finger.
  kTooClose,       ///< Closer to the joint-0 axis than the tip's sideways offset.
  kOutsideLimits,  ///< Needs joints beyond their hard limits.
};

/// A result of the inverse kinematics. It is always finite. If the point cannot be reached,
/// `position` is a pose within the hard limits whose tip is near the point.
struct FingerPose {
  Eigen::Vector3d position;  ///< [rad]
  Reach reach;

  explicit operator bool() const noexcept { return reach == Reach::kYes; }
};

/// Kinematics and dynamics of the fingers, without contacts and objects. Everything is in the world
/// frame: z up, origin on the table, whether or not the platform is flipped.
/// Positions of joints are in rad.
///
/// One object must not be used by several threads at once: make one for each.
class Kinematics {
 public:
  /// Starts in the initial pose.
  /// @throws InvalidArgument if the description cannot be built.
  explicit Kinematics(RobotDescription description = {});
  Kinematics(Kinematics&&) noexcept;
  Kinematics& operator=(Kinematics&&) noexcept;
  ~Kinematics();

  [[nodiscard]] const RobotDescription& description() const noexcept;
  /// Number of fingers: 1 or 3.
  [[nodiscard]] int num_fingers() const noexcept;
  /// Number of joints: three for each finger.
  [[nodiscard]] int num_joints() const noexcept;

  /// Sets the pose for the other functions: `num_joints` positions. Only the constructor allocates
  /// memory.
  void update(const JointValues& position) noexcept;

  /// Centre of the tip sphere of one finger [m].
  [[nodiscard]] Eigen::Vector3d tip_position(int finger) const noexcept;

  /// Centres of all tip spheres: x, y, z for each finger [m].
  [[nodiscard]] TipPositions tip_positions() const noexcept;

  /// Centres of all tip spheres with the joints at `position` [m], independent of `update`. Any
  /// number of threads may call it at once.
  [[nodiscard]] TipPositions tip_positions(const JointValues& position) const noexcept;

  /// Direction in which a finger extends from the centre: the angle from x towards y [rad].
  [[nodiscard]] double finger_azimuth(int finger) const noexcept;

  /// Derivative of one tip's position by all joints [m/rad]: 3 rows, `num_joints` columns.
  [[nodiscard]] TipJacobian tip_jacobian(int finger) const noexcept;

  /// The angular velocity of one tip per velocity of each joint: 3 rows, `num_joints` columns. It
  /// tells how a round tip rolls on what it touches.
  [[nodiscard]] TipJacobian tip_rotation_jacobian(int finger) const noexcept;

  /// The Jacobians of all tips, one below the other [m/rad]: square, `num_joints` rows and columns.
  [[nodiscard]] JointMatrix tip_jacobians() const noexcept;

  /// Accelerations of the tips when joints move with constant `velocity` [rad/s]: x, y, z
  /// for each finger [m/s^2].
  [[nodiscard]] TipPositions tip_accelerations(const JointValues& velocity) const noexcept;

  /// Torques that hold the pose against gravity [Nm].
  [[nodiscard]] JointValues gravity_torques() const noexcept;

  /// Torques that keep joints at their `velocity` [rad/s] without acceleration, against gravity,
  /// Coriolis and centrifugal forces [Nm]. Friction is not included.
  [[nodiscard]] JointValues bias_torques(const JointValues& velocity) const noexcept;

  /// Inertia at the joints, including that of the rotors [kg m^2].
  [[nodiscard]] JointMatrix mass_matrix() const noexcept;

  /// Joint positions of `finger` that bring its tip to `tip` [m], and whether it can reach it. If
  /// it cannot, they are a pose within the hard limits whose tip is near the point. Among up to
  /// four poses it takes the one within the hard limits that is nearest to `near`.
  [[nodiscard]] FingerPose inverse_kinematics(int finger, const Eigen::Vector3d& tip,
                                              const Eigen::Vector3d& near) const noexcept;

  /// Joint positions that bring the tip to `tip` and are nearest to the initial pose.
  [[nodiscard]] FingerPose inverse_kinematics(int finger,
                                              const Eigen::Vector3d& tip) const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger
