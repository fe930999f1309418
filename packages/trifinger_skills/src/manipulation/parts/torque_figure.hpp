// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// The figure `torque_share` of a report: over all steps.
[[nodiscard]] inline Figure torque_share_figure(const SkillTrace& trace) {
  double share = 0.0;
  for (const SkillStep& step : trace.steps) share = std::max(share, step.torque_share);
  return {.name = "torque_share",
          .value = share,
          .unit = "1",
          .meaning = "largest requested torque, as a share of its limit"};
}

}  // namespace trifinger::manipulation
