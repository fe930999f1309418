// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace trifinger::manipulation {

// Plans an attempt with `plan`, which leaves out all grasps in the list `tried`: what has failed
// fails again. If nothing else is possible, the list is emptied and all grasps count again.
template <class List, class Function>
[[nodiscard]] auto plan_untried(List& tried, const Function& plan) {
  auto planned = plan();
  if (!planned && !tried.empty()) {
    tried.clear();
    planned = plan();
  }
  return planned;
}

}  // namespace trifinger::manipulation
