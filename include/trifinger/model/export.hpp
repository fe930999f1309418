// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "trifinger/model/robot_description.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger {

/// The whole scene in MuJoCo's own format, with objects, cameras and lights. Needs no other file.
///
/// MuJoCo writes six digits, so a model read back agrees with the built one to about 1e-6 m.
/// @throws InvalidArgument if the description cannot be built.
[[nodiscard]] std::string export_mjcf(const RobotDescription& description,
                                      Detail detail = Detail::kPictures);

/// The robot alone as URDF: links with the source's inertias, joints with limits, tips and cameras
/// as frames (cameras as `NAME_optical_frame`: x right, y down, z forward). Table, boundary and
/// objects are no part of it. Gravity points along the root link's -z, flipped or not.
/// @throws InvalidArgument if the description cannot be built.
[[nodiscard]] std::string export_urdf(const RobotDescription& description);

}  // namespace trifinger
