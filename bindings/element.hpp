// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include "trifinger/core/session.hpp"

namespace trifinger::python {

/// Makes the class Element and one for each series: NumPy's record with attributes of its own.
/// numpy.record prefers what every scalar has, so that the field `flags` of a status could not be
/// read, and takes three times as long.
void bind_element(nanobind::module_& m);

/// What the class for elements of `series` is called.
[[nodiscard]] const char* class_of(Series series) noexcept;

}  // namespace trifinger::python
