// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include "foreign_model.hpp"
#include "trifinger/model/model_file.hpp"

namespace trifinger::detail {

// Says which shapes of a robot from a URDF touch, and colours those whose colour is in the file of
// their mesh. MuJoCo has read the description into `spec`.
void finish_urdf(mjSpec* spec, const ForeignModel& source, UrdfCollision collision);

}  // namespace trifinger::detail
