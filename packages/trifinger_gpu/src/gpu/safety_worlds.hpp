// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "trifinger/joint/joint_chain.hpp"

namespace trifinger::gpu {

// The safety chains of many robots in plain arrays: what a kernel takes. Except for `limits` and
// `fault`, an array has a row for each robot and in it a number for each joint. Units are those of
// `JointMeasurement` and `JointCommand`.
struct SafetyWorlds {
  std::int32_t num_worlds{0};
  std::int32_t num_joints{0};
  double elapsed{0.0};                // since the previous step [s]
  const JointLimit* limits{nullptr};  // one for each joint
  const JointMeasurement* measured{nullptr};
  const JointCommand* desired{nullptr};
  JointMemory* memory{nullptr};
  CheckedCommand* applied{nullptr};
  // The first joint of each robot at which a fault was found; -1: none.
  std::int32_t* fault{nullptr};
};

// One step of the chain of one robot: as `SafetyChain::apply` without checks of users.
inline void apply_to_world(const SafetyWorlds& all, std::int32_t world) noexcept {
  const std::int64_t first = static_cast<std::int64_t>(world) * all.num_joints;
  const JointMeasurement* const measured = all.measured + first;
  const JointCommand* const desired = all.desired + first;
  JointMemory* const memory = all.memory + first;
  CheckedCommand* const applied = all.applied + first;
  std::int32_t fault = -1;
  for (std::int32_t i = 0; i < all.num_joints; ++i) {
    applied[i].reasons = remember_measurement(measured[i], all.elapsed, all.limits[i], memory[i]);
    if (applied[i].reasons != 0 && fault < 0) fault = i;
  }
  all.fault[world] = fault;
  for (std::int32_t i = 0; i < all.num_joints; ++i) {
    const JointLimit& limit = all.limits[i];
    if (fault >= 0) {
      applied[i] = brake_joint(measured[i].velocity, applied[i].reasons, limit, memory[i]);
    } else {
      const CheckedCommand accepted = accept_and_remember(desired[i], limit, memory[i]);
      applied[i] = limit_joint(desired[i], accepted, measured[i], all.elapsed, limit, memory[i]);
    }
  }
}

// One step of all of them, on a processor.
void apply_to_worlds(const SafetyWorlds& all) noexcept;

}  // namespace trifinger::gpu
