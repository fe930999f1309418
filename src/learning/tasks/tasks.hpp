// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "trifinger/learning/task.hpp"

// The tasks that come with the library, each in a file of its own with its defaults on top.
namespace trifinger::learning {

[[nodiscard]] std::vector<TaskDescription> reach_tasks();
[[nodiscard]] std::vector<TaskDescription> move_cube_tasks();
[[nodiscard]] std::vector<TaskDescription> throw_tasks();
[[nodiscard]] std::vector<TaskDescription> dclaw_tasks();

}  // namespace trifinger::learning
