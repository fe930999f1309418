// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/cameras_of.hpp"

#include "trifinger/sim/robot_cameras.hpp"

namespace trifinger::rendering {

camera::Calibration cameras_of(const RobotDescription& description) {
  return description.cameras ? calibration_of_figures(description) : camera::Calibration{};
}

}  // namespace trifinger::rendering
