// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/model/frames.hpp"
#include "trifinger/model/scene_model.hpp"

namespace trifinger {

/// Where a joint may be [rad], [m].
struct JointRange {
  double lower;
  double upper;
};

/// A result of the inverse kinematics. It is always finite and within the ranges.
struct JointSolution {
  Eigen::VectorXd position;  ///< One for each driven joint [rad], [m].
  double distance{0.0};      ///< From the frame to its goal [m].
  double angle{0.0};         ///< Between their orientations [rad]; 0 if none was asked for.
  bool is_reached{false};    ///< Both are at most 1e-6.
};

/// Kinematics and dynamics of any robot, from the model of its file or description: where named
/// frames are, how joints move them, and what torques carry it. Contacts are left out.
///
/// Everything is in the world frame: z up. Joints are the driven ones, in the order of actions
/// [rad], [Nm]; a joint that slides has m and N. Joints that follow one by an equality go with it.
/// All others, and bodies that float, stay where sessions begin.
///
/// Only the constructor and `inverse_kinematics` allocate memory. What a function returns by
/// reference is valid until it is called again. One object must not be used by several threads at
/// once: make one for each.
class ModelKinematics {
 public:
  using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

  /// `frames` are names as for `Frames`; none: `end_frames` of the model.
  /// @throws InvalidArgument that names the frames there are
  explicit ModelKinematics(std::shared_ptr<const SceneModel> model,
                           std::span<const std::string> frames = {});

  [[nodiscard]] int num_joints() const noexcept { return static_cast<int>(ranges_.size()); }
  [[nodiscard]] const std::vector<std::string>& frames() const noexcept { return names_; }
  /// Place of a frame in `frames`.
  /// @throws InvalidArgument if there is none
  [[nodiscard]] std::size_t frame(const std::string& name) const;
  /// Where the stops of each joint are by the model; infinite without a stop.
  [[nodiscard]] const std::vector<JointRange>& ranges() const noexcept { return ranges_; }

  /// Sets the pose for the functions below: one position for each joint.
  void update(const Eigen::Ref<const Eigen::VectorXd>& position) noexcept;

  /// The positions of the pose; before the first `update` those where sessions begin.
  [[nodiscard]] Eigen::VectorXd position() const;

  [[nodiscard]] Eigen::Isometry3d pose(std::size_t frame) const noexcept;
  /// Linear velocity of a frame, above its angular velocity, for a velocity of 1 of each joint: 6
  /// rows, `num_joints` columns.
  [[nodiscard]] const Jacobian& jacobian(std::size_t frame) noexcept;
  /// Torques that hold the pose against gravity and springs.
  [[nodiscard]] const Eigen::VectorXd& gravity_torques() noexcept;
  /// Torques that keep joints at their `velocity` [rad/s], [m/s] without acceleration, against
  /// gravity, springs, Coriolis and centrifugal forces. Damping and friction are not included.
  [[nodiscard]] const Eigen::VectorXd& bias_torques(
      const Eigen::Ref<const Eigen::VectorXd>& velocity) noexcept;
  /// Inertia at the joints, including that of the rotors [kg m^2], [kg].
  [[nodiscard]] const Eigen::MatrixXd& mass_matrix() noexcept;

  /// The part of `torques` that does not accelerate a frame, only the joints around it:
  /// (1 - J' (J M^-1 J')^-1 J M^-1) torques. With it an arm of seven joints keeps its elbow where
  /// it should be. O. Khatib: A unified approach for motion and force control of robot
  /// manipulators. IEEE Journal on Robotics and Automation, 1987.
  [[nodiscard]] const Eigen::VectorXd& null_space_torques(
      std::size_t frame, const Eigen::Ref<const Eigen::VectorXd>& torques) noexcept;

  /// Finds positions within `ranges` that bring a frame to `point` [m], with this orientation if
  /// one is given: damped least squares from `near`, then from poses drawn from a fixed series.
  /// Joints that do not move the frame stay as in `near`. If nothing reaches it, the nearest pose
  /// that was found. `ranges` are by default those of the model. It takes some milliseconds, so it
  /// is not for a control loop.
  /// @throws InvalidArgument for a wrong number of joints, or numbers that are not finite
  [[nodiscard]] JointSolution inverse_kinematics(
      std::size_t frame, const Eigen::Vector3d& point,
      const std::optional<Eigen::Quaterniond>& orientation,
      const Eigen::Ref<const Eigen::VectorXd>& near, std::span<const JointRange> ranges = {});

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  [[nodiscard]] std::span<const double> configuration() const noexcept;
  void weigh(Eigen::VectorXd& torques) noexcept;
  [[nodiscard]] JointSolution search(std::size_t frame, const Eigen::Vector3d& point,
                                     const std::optional<Eigen::Quaterniond>& orientation,
                                     const Eigen::VectorXd& begin,
                                     std::span<const JointRange> ranges);

  std::shared_ptr<const SceneModel> model_;
  std::vector<std::string> names_;
  Frames frames_;
  std::vector<JointRange> ranges_;
  SceneModel::Data data_;   // the pose
  Eigen::MatrixXd speeds_;  // of the model's degrees of freedom, for a velocity of 1 of each joint
  RowMajor rows_;           // a Jacobian by the model's degrees of freedom
  Jacobian jacobian_;
  Eigen::VectorXd gravity_, bias_;
  RowMajor inertia_;  // by the model's degrees of freedom
  Eigen::MatrixXd moved_, mass_;
  Eigen::LDLT<Eigen::MatrixXd> solver_;
  Eigen::Matrix<double, Eigen::Dynamic, 6> inverse_;  // of the mass, times J'
  Eigen::VectorXd free_;
};

}  // namespace trifinger
