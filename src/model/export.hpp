// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "trifinger/model/robot_description.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger {

/// The whole scene in MuJoCo's own format, with objects, cameras and lights. It needs no other
/// file.
///
/// MuJoCo writes six digits, so a model that is read back agrees with the built one to about 1e-6
/// m.
/// @throws InvalidArgument if the description cannot be built.
[[nodiscard]] std::string export_mjcf(const RobotDescription& description,
                                      Detail detail = Detail::kPictures);

/// The robot as URDF, for planners and other simulations: links with the source's inertias, joints
/// with limits, tips and cameras as frames (cameras as `NAME_optical_frame`: x right, y down, z
/// forward). It has no boundary and needs no other file. Gravity points along the root link's -z,
/// flipped or not.
/// @throws InvalidArgument if the description cannot be built.
[[nodiscard]] std::string export_urdf(const RobotDescription& description);

/// The logged numbers that move the frames.
struct FrameSources {
  std::string joint_field;       ///< Field of the robot's observation with all joint angles [rad].
  std::string object_companion;  ///< It has OBJECT.position [m] and OBJECT.orientation (w x y z).
};

/// A scene for viewers.
struct ViewerScene {
  /// The robot, the table, fixed to the root, and the objects, on floating joints. It has no shapes
  /// for collisions.
  std::string urdf;
  /// Says as lines of text where the links of `urdf` are. Programs that know nothing about the
  /// robot can follow these lines; docs/log_format.md has the format.
  std::string frames;
};

/// The scene for viewers of sessions and logs.
/// @throws InvalidArgument if the description cannot be built.
[[nodiscard]] ViewerScene export_scene(const RobotDescription& description,
                                       const FrameSources& sources);

}  // namespace trifinger
