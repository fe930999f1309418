// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/model/robot_model.hpp"

struct mjSpec_;

namespace trifinger {

/// Which robot to make of a file.
struct ModelFileOptions {
  std::filesystem::path path;  ///< MJCF or URDF.
  /// Folder with the meshes. A mesh is looked for by the longest end of its path that is there, so
  /// that for "package://arm/meshes/link.stl" it may be the folder of "arm", "meshes" or
  /// "link.stl". Default: as the file says.
  std::optional<std::filesystem::path> mesh_folder{};
  /// Names of the joints that motors drive, in this order: hinges, slides, and fixed tendons, which
  /// couple some of these. Default: what the actuators of the file drive; if it has none, every
  /// hinge and slide.
  std::vector<std::string> joints{};
  /// Length of a step of the robot. The physics does the smallest number of steps in it of which
  /// none is longer than the file's `timestep`. Default: the file's `timestep`.
  std::optional<Nanoseconds> period{};
  /// The inertia of its rotor at a hinge or slide of this name [kgm^2], [kg], instead of `armature`
  /// of the joint and its actuators in the file. Many files leave it out, although behind a gear it
  /// is most of what a motor feels.
  std::function<std::optional<double>(const std::string& joint)> armature{};
  /// Objects in addition to those of the file. Each needs a position and a name that no body of the
  /// file has.
  std::vector<ObjectDescription> objects{};
};

/// What a file says about one driven joint. Nothing where it says nothing, or nothing that one
/// motor could obey.
struct FileJoint {
  std::string name;      ///< Of the joint or of the tendon.
  bool is_slide{false};  ///< It slides: metres and newtons instead of radians and newton metres.
  std::optional<std::array<double, 2>> range{};  ///< Where its stops are [rad], [m].
  std::optional<double> max_torque{};            ///< [Nm], [N]
  std::optional<double> kp{};                    ///< Stiffness of its position actuator [Nm/rad].
  std::optional<double> kd{};                    ///< Its damping [Nms/rad].
};

/// A hinge or a slide of the model, driven or not.
struct ModelJoint {
  std::string name;
  bool is_slide{false};
};

/// The robot and the scene of an MJCF or URDF file as a MuJoCo model. It is immutable, so any
/// number of threads may simulate it.
///
/// Each driven joint has one motor, `ctrl`, which gives the joint exactly this torque. So whatever
/// its actuators were in the file (motors, position or velocity controllers, with gears or
/// without), the torque that the safety chain allows is the torque that acts. Actuators of joints
/// that are not driven do nothing.
class ModelFile {
 public:
  /// Reads the file and what it includes.
  /// @throws InvalidArgument that names the file and what is wrong with it, or the joint that
  /// cannot be driven
  explicit ModelFile(ModelFileOptions options);
  ModelFile(ModelFile&&) noexcept;
  ModelFile& operator=(ModelFile&&) noexcept;
  ~ModelFile();

  [[nodiscard]] const ModelFileOptions& options() const noexcept { return options_; }
  /// The name of the model in the file; that of the file if it has none.
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

  /// The `mjModel`, for those who include MuJoCo's own header. It is valid as long as this object.
  [[nodiscard]] const mjModel_* mujoco() const noexcept { return model_.get(); }
  /// The `mjData` of one simulation.
  /// @throws Error if there is no memory for it
  [[nodiscard]] RobotModel::Data make_data() const;

  /// Length of a step of the robot.
  [[nodiscard]] Nanoseconds period() const noexcept { return period_; }
  /// Steps of the physics in one step of the robot.
  [[nodiscard]] int substeps() const noexcept { return substeps_; }

  /// The driven joints.
  [[nodiscard]] const std::vector<FileJoint>& joints() const noexcept { return joints_; }
  /// All hinges and slides, driven or not, in the order of the model.
  [[nodiscard]] const std::vector<ModelJoint>& model_joints() const noexcept {
    return model_joints_;
  }
  /// True if the driven joints are exactly these, in this order.
  [[nodiscard]] bool drives_all() const noexcept { return drives_all_; }
  /// Bodies that float freely, with all that hangs at them: objects, and the base of a robot that
  /// walks or flies. Names are as in the file, with '_' for spaces; "body3" for a body without one.
  [[nodiscard]] const std::vector<ObjectAddress>& free_bodies() const noexcept {
    return free_bodies_;
  }

  /// @name One driven joint of a simulation
  /// Nothing here allocates or throws.
  /// @{
  [[nodiscard]] double position(std::size_t joint, const mjData_& data) const noexcept;
  [[nodiscard]] double velocity(std::size_t joint, const mjData_& data) const noexcept;
  /// Moves the joint there; coupled joints share the way as the torque of their motor would.
  void set_position(std::size_t joint, double position, mjData_& data) const noexcept;
  /// Moves the joint in `configuration`, positions in the order of MuJoCo's `qpos`.
  void set_position(std::size_t joint, double position,
                    std::span<double> configuration) const noexcept;
  /// Sets the torque of its motor.
  void set_torque(std::size_t joint, double torque, mjData_& data) const noexcept;
  /// The torque that acts on this joint if `force` acts on the model's degrees of freedom.
  [[nodiscard]] double torque_of(std::size_t joint, const double* force) const noexcept;
  /// @}
  /// Position and velocity of an entry of `model_joints`.
  [[nodiscard]] double model_position(std::size_t joint, const mjData_& data) const noexcept;
  [[nodiscard]] double model_velocity(std::size_t joint, const mjData_& data) const noexcept;
  void set_model_position(std::size_t joint, double position, mjData_& data) const noexcept;
  void set_model_position(std::size_t joint, double position,
                          std::span<double> configuration) const noexcept;

  /// The model in MuJoCo's format. It needs no other file: meshes are part of the text. Meshes that
  /// only look are made coarser where nobody can see it, and pictures on surfaces become their mean
  /// colour. It has the motors of this object, not the actuators of the file.
  /// @throws Error if MuJoCo cannot write it
  [[nodiscard]] std::string mjcf() const;

 private:
  struct DeleteSpec {
    void operator()(mjSpec_* spec) const noexcept;
  };
  // A share of a joint of the model in a driven joint: 1, or the coefficient in a tendon.
  struct Part {
    int position;  // in qpos
    int velocity;  // in qvel
    double share;
  };
  struct Motor {
    int actuator{-1};
    int ctrl{-1};  // its input
    std::vector<Part> parts{};
    double sum_of_squares{1.0};  // of the shares
  };

  bool name_joints();
  void find_joints();
  void add_motors();
  void set_step();

  ModelFileOptions options_;
  std::string name_;
  std::unique_ptr<mjSpec_, DeleteSpec> spec_;
  RobotModel::Compiled model_;
  Nanoseconds period_{0};
  int substeps_{1};
  std::vector<FileJoint> joints_;
  std::vector<Motor> motors_;
  std::vector<ModelJoint> model_joints_;
  std::vector<Part> model_parts_;
  bool drives_all_{false};
  std::vector<ObjectAddress> free_bodies_;
};

}  // namespace trifinger
