// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/model/robot_description.hpp"

struct mjData_;
struct mjModel_;

namespace trifinger {

/// The place of one loose object in the state of a `RobotModel`.
struct ObjectAddress {
  std::string name;
  int body;      ///< Index of the body.
  int position;  ///< First of 7 numbers in `qpos`: x y z, then the quaternion w x y z.
  int velocity;  ///< First of 6 numbers in `qvel`.
};

/// What a model is for. Both kinds move equally, bit for bit, and share the layout of the state.
/// Simulate a model of the first kind, and copy `qpos` to one of the second kind to draw it.
enum class Detail {
  kPhysics,   ///< Only what moves and touches.
  kPictures,  ///< Also frame, shells, colours, lights and cameras; a step takes about a third
              ///< longer.
};

/// A MuJoCo model built from a description. It is immutable, so any number of threads may simulate
/// it.
///
/// The joints come first: `qpos[i]`, `qvel[i]` and `ctrl[i]` belong to joint `i` of `joint_names`,
/// and `ctrl` is the joint's torque [Nm]. The objects follow. Key frame 0 is the initial pose.
/// MuJoCo's automatic reset on divergence is off: the simulation has to check for numbers that are
/// not finite.
class RobotModel {
 public:
  struct Delete {
    void operator()(mjModel_* model) const noexcept;
    void operator()(mjData_* data) const noexcept;
  };
  using Compiled = std::unique_ptr<mjModel_, Delete>;
  using Data = std::unique_ptr<mjData_, Delete>;

  /// @throws InvalidArgument if the description cannot be built.
  explicit RobotModel(RobotDescription description = {}, Detail detail = Detail::kPhysics);
  RobotModel(RobotModel&&) noexcept;
  RobotModel& operator=(RobotModel&&) noexcept;
  ~RobotModel();

  [[nodiscard]] const RobotDescription& description() const noexcept { return description_; }

  /// The `mjModel`, for those who include MuJoCo's own header. It is valid as long as this object.
  [[nodiscard]] const mjModel_* mujoco() const noexcept { return model_.get(); }
  /// A copy of the `mjModel`, for those who change it.
  /// @throws Error if there is no memory for it
  [[nodiscard]] Compiled copy() const;
  /// The `mjData` of one simulation of this model or of a copy, with all joints at zero.
  /// @throws Error if there is no memory for it
  [[nodiscard]] Data make_data() const;

  [[nodiscard]] int num_fingers() const noexcept { return static_cast<int>(tip_geoms_.size()); }
  [[nodiscard]] int num_joints() const noexcept { return num_fingers() * kJointsPerFinger; }

  /// The initial pose, one value per joint [rad].
  [[nodiscard]] const std::vector<double>& initial_position() const noexcept {
    return initial_position_;
  }

  /// Index of the geom with which the tip of each finger touches, to find its contacts.
  [[nodiscard]] const std::vector<int>& tip_geoms() const noexcept { return tip_geoms_; }

  /// The surface of each geom, by its index; nothing for geoms that touch nothing.
  [[nodiscard]] const std::vector<std::optional<Surface>>& surfaces() const noexcept {
    return surfaces_;
  }

  /// Index of the site at the tip of each finger.
  [[nodiscard]] const std::vector<int>& tip_sites() const noexcept { return tip_sites_; }

  /// The objects in the order of the description.
  [[nodiscard]] const std::vector<ObjectAddress>& objects() const noexcept { return objects_; }

  /// @throws InvalidArgument that names the existing objects.
  [[nodiscard]] const ObjectAddress& object(const std::string& name) const;

  /// Names of the cameras: those of `camera_figures` in a model for pictures, otherwise none.
  [[nodiscard]] std::vector<std::string> camera_names() const;

 private:
  RobotDescription description_;
  Detail detail_;
  Compiled model_;
  std::vector<double> initial_position_;
  std::vector<int> tip_geoms_;
  std::vector<int> tip_sites_;
  std::vector<std::optional<Surface>> surfaces_;
  std::vector<ObjectAddress> objects_;
};

}  // namespace trifinger
