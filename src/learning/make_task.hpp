// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "trifinger/learning/task.hpp"

namespace trifinger::learning {

// Makes the task for this robot.
// @throws InvalidArgument if they do not suit each other
[[nodiscard]] std::unique_ptr<const AnyTask> make_task(const TaskDescription& description,
                                                       Workspace& robot);

}  // namespace trifinger::learning
