// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/camera/calibration.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::rendering {

/// The cameras of a robot as its description says, with images of 540 x 540 pixels. Those of a
/// flipped platform turn with it. None if the description has none.
[[nodiscard]] camera::Calibration cameras_of(const RobotDescription& description);

}  // namespace trifinger::rendering
