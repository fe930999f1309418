// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/model/robot_description.hpp"
#include "trifinger/model/scene_model.hpp"

struct mjSpec_;

namespace trifinger {

/// What the shapes of a URDF are for.
enum class UrdfCollision : std::uint8_t {
  kHull,    ///< Its `collision` shapes touch, meshes as their convex hulls.
  kVisual,  ///< Its `visual` shapes touch instead, likewise.
  kNone,    ///< Nothing of the robot touches anything.
};

/// The robot to make of a file.
struct ModelFileOptions {
  std::filesystem::path path;  ///< MJCF or URDF.
  /// Folder with the meshes. A mesh is looked for by the longest end of its path that is there, so
  /// that for "package://arm/meshes/link.stl" it may be the folder of "arm", "meshes" or
  /// "link.stl". Default: as the file says.
  std::optional<std::filesystem::path> mesh_folder{};
  UrdfCollision collision{UrdfCollision::kHull};
  /// Gives bodies with a mass or an inertia that no body can have the nearest that is possible.
  /// Otherwise they are errors: many files have such inertias, from rounding or from guessing.
  bool repair_inertia{false};
  /// Takes the angles of an MJCF that names no unit for radians. MuJoCo takes them for degrees.
  bool angle_in_radians{false};
  /// Lets bodies that overlap where sessions begin pass through each other, as those of a URDF
  /// always do. The author of an MJCF has usually said what touches.
  bool exclude_overlaps{false};
  /// Names of the joints that motors drive, in this order: hinges, slides, and fixed tendons, which
  /// couple some of these. Default: what the actuators of the file drive; if it has none, every
  /// hinge and slide that does not follow another one (`mimic` of a URDF, `equality` of MJCF).
  std::vector<std::string> joints{};
  /// Length of a step of the robot. The physics does the smallest number of steps in it of which
  /// none is longer than the file's `timestep`. Default: the file's `timestep`.
  std::optional<Nanoseconds> period{};
  /// The inertia of its rotor at a hinge or slide of this name [kgm^2], [kg], instead of `armature`
  /// of the joint and its actuators in the file. Many files leave it out, although behind a gear it
  /// is most of what a motor feels.
  std::function<std::optional<double>(const std::string& joint)> armature{};
  /// The key frame in which every session begins, by its name. Default: the file's first one; the
  /// zero pose of the model if it has none.
  std::optional<std::string> keyframe{};
  /// Joints that begin elsewhere, driven or not [rad], [m].
  std::function<std::optional<double>(const ModelJoint& joint)> initial_position{};
  /// Objects in addition to those of the file. Each needs a position and a name that no body of the
  /// file has.
  std::vector<ObjectDescription> objects{};
};

/// The robot and the scene of an MJCF or URDF file as a MuJoCo model.
///
/// Whatever the actuators of the driven joints were in the file (motors, position or velocity
/// controllers, with gears or without), the torque that the safety chain allows is the torque that
/// acts. Actuators of joints that are not driven do nothing. Names of objects are those of their
/// bodies, with '_' for spaces; "body3" for a body without one.
class ModelFile final : public SceneModel {
 public:
  /// Reads the file and what it includes.
  /// @throws InvalidArgument that names the file and what is wrong with it, or the joint that
  /// cannot be driven
  explicit ModelFile(ModelFileOptions options);
  ModelFile(ModelFile&&) noexcept;
  ModelFile& operator=(ModelFile&&) noexcept;
  ~ModelFile() override;

  [[nodiscard]] const ModelFileOptions& options() const noexcept { return options_; }
  /// What was repaired, a sentence for each body, if that was asked for.
  [[nodiscard]] const std::vector<std::string>& repairs() const noexcept { return repairs_; }
  /// The name of the model in the file; that of the file if it has none.
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

  void reset(mjData_& data) const noexcept override;

  /// Length of a step of the robot.
  [[nodiscard]] Nanoseconds period() const noexcept { return period_; }
  /// Steps of the physics in one step of the robot.
  [[nodiscard]] int substeps() const noexcept { return substeps_; }

  /// Meshes are part of the text. Meshes that only look are made coarser where nobody can see it,
  /// and pictures on surfaces become their mean colour.
  [[nodiscard]] std::string mjcf() const override;

 private:
  struct DeleteSpec {
    void operator()(mjSpec_* spec) const noexcept;
  };
  bool name_elements(int type, const std::string& word);
  void find_joints();
  void describe_joint(int id, DrivenJoint& joint, Motor& motor) const;
  void describe_tendon(int id, DrivenJoint& joint, Motor& motor) const;
  void add_motors();
  void set_step();
  void find_objects();
  void find_start();
  bool exclude_overlaps(bool is_urdf);

  ModelFileOptions options_;
  std::string name_;
  std::vector<std::string> repairs_;
  std::unique_ptr<mjSpec_, DeleteSpec> spec_;
  Nanoseconds period_{0};
  int substeps_{1};
  int key_{-1};  // the key frame in which sessions begin
  std::vector<std::pair<std::size_t, double>> initial_position_;        // of driven joints
  std::vector<std::pair<std::size_t, double>> initial_model_position_;  // of other ones
};

}  // namespace trifinger
