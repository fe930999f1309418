// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <string>

#include "trifinger/core/session.hpp"

namespace trifinger::bindings {

/// Makes the class Element and one class for each series: a record of NumPy whose fields are
/// attributes. numpy.record cannot be used: its own attributes hide fields such as `flags` of a
/// status, and it takes three times as long.
void bind_element(nanobind::module_& m);

/// Says how the shape of `value` differs from that of the field `name`, whose type is `dtype`.
/// Empty if it does not.
[[nodiscard]] std::string wrong_shape(const nanobind::object& name, const nanobind::object& dtype,
                                      const nanobind::object& value);

/// Returns the name of the class for elements of `series`.
[[nodiscard]] const char* class_of(Series series) noexcept;

}  // namespace trifinger::bindings
