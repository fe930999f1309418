// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/model/identified.hpp"
#include "trifinger/model/robot_description.hpp"

struct mjData_;
struct mjModel_;

namespace trifinger {

/// The place of one loose object in the state of a `SceneModel`.
struct ObjectAddress {
  std::string name;
  int body;      ///< Index of the body.
  int position;  ///< First of 7 numbers in `qpos`: x y z, then the quaternion w x y z.
  int velocity;  ///< First of 6 numbers in `qvel`.
};

/// A hinge or a slide of a model, driven or not.
struct ModelJoint {
  std::string name;
  bool is_slide{false};  ///< It slides: metres and newtons instead of radians and newton metres.
};

/// A driven joint, and what a file says about it. Nothing where it says nothing, or nothing that
/// one motor could obey.
struct DrivenJoint {
  std::string name;                                   ///< That of the joint or of the tendon.
  bool is_slide{false};                               ///< See `ModelJoint`.
  std::optional<std::array<double, 2>> range{};       ///< Where its stops are [rad], [m].
  std::optional<std::array<double, 2>> soft_range{};  ///< `safety_controller` of a URDF [rad], [m].
  std::optional<double> max_torque{};                 ///< [Nm], [N]
  std::optional<double> max_velocity{};               ///< `velocity` of a URDF [rad/s], [m/s].
  std::optional<double> kp{};  ///< Stiffness of its position actuator [Nm/rad].
  std::optional<double> kd{};  ///< Its damping [Nms/rad].
};

/// A robot and its scene as a MuJoCo model. It has two makers: `RobotModel` makes it from a
/// description, `ModelFile` from an MJCF or URDF file.
///
/// Each driven joint has one motor, which gives the joint exactly the commanded torque. The
/// model is immutable, so any number of threads may simulate it. MuJoCo's automatic reset on
/// divergence is off: the simulation has to check for numbers that are not finite.
class SceneModel {
 public:
  struct Delete {
    void operator()(mjModel_* model) const noexcept;
    void operator()(mjData_* data) const noexcept;
  };
  using Compiled = std::unique_ptr<mjModel_, Delete>;
  using Data = std::unique_ptr<mjData_, Delete>;

  virtual ~SceneModel() = default;

  /// The `mjModel`, for those who include MuJoCo's own header. It is valid as long as this object.
  [[nodiscard]] const mjModel_* mujoco() const noexcept { return model_.get(); }
  /// A copy of the `mjModel`, for those who change it.
  /// @throws Error if there is no memory for it
  [[nodiscard]] Compiled copy() const;
  /// The `mjData` of one simulation of this model or of a copy.
  /// @throws Error if there is no memory for it
  [[nodiscard]] Data make_data() const;
  /// Makes `model`, a copy of this one, be like a robot that was measured.
  /// @throws InvalidArgument if that makes no sense, or if what a motor moves is not one joint
  void apply(const Identified& identified, mjModel_& model) const;
  /// Makes this model be so, before others share it.
  /// @throws InvalidArgument as above
  void adopt(const Identified& identified);
  /// Makes steps of the physics so long [s], before others share this model.
  void set_timestep(double seconds) noexcept;
  /// What this model says of a driven joint, by the name of a row of `Identified::fields()`.
  [[nodiscard]] double described(const char* field, std::size_t joint) const;
  /// Puts everything in a simulation of the model, or of a copy, where sessions begin.
  virtual void reset(mjData_& data) const noexcept = 0;

  /// The whole scene in MuJoCo's format, as one looks at it. It needs no other file, and has the
  /// motors of this model.
  /// @throws Error if MuJoCo cannot write it
  [[nodiscard]] virtual std::string mjcf() const = 0;

  /// The driven joints, in the order of the robot's actions.
  [[nodiscard]] const std::vector<DrivenJoint>& joints() const noexcept { return joints_; }
  /// Their names.
  [[nodiscard]] std::vector<std::string> joint_names() const;
  /// All hinges and slides, driven or not, in the order of the model.
  [[nodiscard]] const std::vector<ModelJoint>& model_joints() const noexcept {
    return model_joints_;
  }
  /// Those of them that follow a driven joint by an equality (`mimic` of a URDF).
  [[nodiscard]] std::vector<std::size_t> followers(std::size_t joint) const;
  /// True if the driven joints are exactly these, in this order.
  [[nodiscard]] bool drives_all() const noexcept { return drives_all_; }

  /// Bodies that float freely, with all that hangs at them: objects, and the base of a robot that
  /// walks or flies.
  [[nodiscard]] const std::vector<ObjectAddress>& objects() const noexcept { return objects_; }
  /// @throws InvalidArgument that names the existing objects.
  [[nodiscard]] const ObjectAddress& object(const std::string& name) const;

  /// Sets an object of a simulation in motion from where it is, in the world frame: velocity of its
  /// centre [m/s] and angular velocity [rad/s].
  static void set_velocity(const ObjectAddress& object, const std::array<double, 3>& linear,
                           const std::array<double, 3>& angular, mjData_& data) noexcept;

  /// Index of the geom with which the tip of each finger touches, to find its contacts. Files have
  /// no tips.
  [[nodiscard]] const std::vector<int>& tip_geoms() const noexcept { return tip_geoms_; }
  /// Index of the site at the tip of each finger.
  [[nodiscard]] const std::vector<int>& tip_sites() const noexcept { return tip_sites_; }

  /// @name One driven joint of a simulation
  /// Nothing here allocates or throws.
  /// @{
  [[nodiscard]] double position(std::size_t joint, const mjData_& data) const noexcept;
  [[nodiscard]] double velocity(std::size_t joint, const mjData_& data) const noexcept;
  [[nodiscard]] double acceleration(std::size_t joint, const mjData_& data) const noexcept;
  /// What its motor alone adds to the joint's inertia in `model`, a copy of this one [kg m^2].
  [[nodiscard]] double rotor_inertia(std::size_t joint, const mjModel_& model) const noexcept;
  /// Moves the joint there; coupled joints share the way as the torque of their motor would, and
  /// joints that follow by an equality go where it says.
  void set_position(std::size_t joint, double position, mjData_& data) const noexcept;
  /// Moves the joint in `configuration`, positions in the order of MuJoCo's `qpos`.
  void set_position(std::size_t joint, double position,
                    std::span<double> configuration) const noexcept;
  void set_velocity(std::size_t joint, double velocity, mjData_& data) const noexcept;
  /// Sets the torque of its motor.
  void set_torque(std::size_t joint, double torque, mjData_& data) const noexcept;
  /// The torque that acts on this joint if `force` acts on the model's degrees of freedom. What
  /// acts on joints that follow it counts, by how fast they are at the beginning.
  [[nodiscard]] double torque_of(std::size_t joint, const double* force) const noexcept;
  /// @}
  /// Position and velocity of an entry of `model_joints`.
  [[nodiscard]] double model_position(std::size_t joint, const mjData_& data) const noexcept;
  [[nodiscard]] double model_velocity(std::size_t joint, const mjData_& data) const noexcept;
  void set_model_position(std::size_t joint, double position, mjData_& data) const noexcept;
  void set_model_position(std::size_t joint, double position,
                          std::span<double> configuration) const noexcept;

  /// False if a simulation has diverged.
  [[nodiscard]] static bool is_finite(const mjModel_& model, const mjData_& data) noexcept;
  /// Computes the torques that keep the driven joints at rest where they are, against gravity and
  /// what else acts on them. `model` is this model or a copy. Changes no position, no velocity and
  /// not the solver's warm start.
  void compute_weight(const mjModel_& model, mjData_& data,
                      std::span<double> torque) const noexcept;

 protected:
  // A share of a joint of the model in a driven joint: 1, or the coefficient in a tendon.
  struct Part {
    int position;  // in qpos
    int velocity;  // in qvel
    double share;
  };
  // A joint that an equality couples to a joint of a motor: `factors` are its polynomial.
  struct Follower {
    int position;  // in qpos
    int velocity;  // in qvel
    double start;  // in qpos0
    int leader;    // in qpos
    double leader_start;
    std::array<double, 5> factors;
    double speed;  // for a velocity of 1 of the driven joint
  };
  struct Motor {
    int actuator{-1};
    int ctrl{-1};  // its input
    std::vector<Part> parts{};
    std::vector<Follower> followers{};
    double sum_of_squares{1.0};  // of the shares
  };

  SceneModel() = default;
  // Finds the followers of all motors, whose parts are known.
  void find_followers();
  SceneModel(SceneModel&&) noexcept = default;
  SceneModel& operator=(SceneModel&&) noexcept = default;

  Compiled model_;
  std::vector<DrivenJoint> joints_;
  std::vector<Motor> motors_;
  std::vector<ModelJoint> model_joints_;
  std::vector<Part> model_parts_;
  bool drives_all_{true};
  std::vector<ObjectAddress> objects_;
  std::vector<int> tip_geoms_;
  std::vector<int> tip_sites_;
};

}  // namespace trifinger
