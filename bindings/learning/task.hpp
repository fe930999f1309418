// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include "trifinger/learning/task.hpp"

namespace trifinger::bindings {

/// A task by its name, or an object of Python's class `trifinger.tasks.Task`. That object must
/// outlive what is made of the description: the garbage collector does not see this reference.
/// @throws InvalidArgument that names the attribute that does not fit
[[nodiscard]] learning::TaskDescription describe_task(nanobind::handle task);

/// Adds the class of the random numbers that tasks in Python draw with.
void bind_random(nanobind::module_& m);

}  // namespace trifinger::bindings
