// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "trifinger/model/robot_description.hpp"
#include "trifinger/model/scene_model.hpp"

namespace trifinger {

/// What a model is for. Both kinds move equally, bit for bit, and share the layout of the state.
/// Simulate a model of the first kind, and copy `qpos` to one of the second kind to draw it.
enum class Detail {
  kPhysics,   ///< Only what moves and touches.
  kPictures,  ///< Also frame, shells, colours, lights and cameras; a step takes about a third
              ///< longer.
};

/// A MuJoCo model built from a description.
///
/// The joints come first: `qpos[i]`, `qvel[i]` and `ctrl[i]` belong to joint `i` of `joint_names`,
/// and `ctrl` is the joint's torque [Nm]. The objects follow, in the order of the description. Key
/// frame 0 is the initial pose.
class RobotModel final : public SceneModel {
 public:
  /// @throws InvalidArgument if the description cannot be built.
  explicit RobotModel(RobotDescription description = {}, Detail detail = Detail::kPhysics);

  [[nodiscard]] const RobotDescription& description() const noexcept { return description_; }

  void reset(mjData_& data) const noexcept override;
  [[nodiscard]] std::string mjcf() const override;

  [[nodiscard]] int num_fingers() const noexcept { return static_cast<int>(tip_geoms_.size()); }
  [[nodiscard]] int num_joints() const noexcept { return num_fingers() * kJointsPerFinger; }

  /// The initial pose, one value per joint [rad].
  [[nodiscard]] const std::vector<double>& initial_position() const noexcept {
    return initial_position_;
  }

  /// The surface of each geom, by its index; nothing for geoms that touch nothing.
  [[nodiscard]] const std::vector<std::optional<Surface>>& surfaces() const noexcept {
    return surfaces_;
  }

  /// Names of the cameras: those of `camera_figures` in a model for pictures, otherwise none.
  [[nodiscard]] std::vector<std::string> camera_names() const;

 private:
  RobotDescription description_;
  Detail detail_;
  std::vector<double> initial_position_;
  std::vector<std::optional<Surface>> surfaces_;
};

}  // namespace trifinger
