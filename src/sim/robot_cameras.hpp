// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "trifinger/camera/calibration.hpp"
#include "trifinger/core/document.hpp"
#include "trifinger/model/robot_description.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger {

/// The cameras of a robot's model: the published figures, with images of 540 x 540 pixels in a
/// Bayer mosaic. Those of a flipped platform turn with it. None if the description has none.
[[nodiscard]] camera::Calibration calibration_of_figures(const RobotDescription& description);

/// The cameras that stand in the scene of a file, with images in a Bayer mosaic; 540 pixels high
/// and wide unless the file says it (`resolution`). Left out are those without a name, those that
/// move, and those that are not said by their `fovy` alone.
[[nodiscard]] camera::Calibration calibration_of_file(const ModelFile& model);

/// The cameras of a configured robot whose session is called `robot`.
/// @throws InvalidArgument if it has none, or what `camera::resolve_calibration` throws
[[nodiscard]] camera::Calibration camera_calibration(const RobotConfig& config,
                                                     const std::string& robot);

/// True if the images of this robot are drawn: then its companion "scene" says what they show.
[[nodiscard]] bool has_simulated_cameras(const RobotConfig& config) noexcept;

/// True if a tracker finds the objects of this robot in images: that of `trifinger track`, or one
/// in the simulation's own process. False if a simulation says where they are.
[[nodiscard]] bool has_tracked_objects(const RobotConfig& config) noexcept;

/// The calibration as a document of the robot's sessions.
[[nodiscard]] Document camera_document(const camera::Calibration& calibration);

}  // namespace trifinger
