// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/joint/types.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::manipulation {

// Makes an action ask for these torques, one for each joint [Nm].
inline void set_torques(TriFinger::Action& action, const JointValues& torques) noexcept {
  JointValues::Map(action.torque.data(), torques.size()) = torques;
}

}  // namespace trifinger::manipulation
