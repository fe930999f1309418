// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include "trifinger/core/session.hpp"

namespace trifinger::bindings {

/// Makes the class Element and one class for each series: a record of NumPy whose fields are
/// attributes. numpy.record cannot be used: its own attributes hide fields such as `flags` of a
/// status, and it takes three times as long.
void bind_element(nanobind::module_& m);

/// Returns the name of the class for elements of `series`.
[[nodiscard]] const char* class_of(Series series) noexcept;

}  // namespace trifinger::bindings
