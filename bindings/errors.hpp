// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <optional>
#include <string>

#include "trifinger/core/fault.hpp"

namespace trifinger::python {

/// From now on C++ errors reach Python as the classes of trifinger.errors, with their text and
/// their data.
void register_errors();

/// The fault as trifinger.Fault; None for none.
[[nodiscard]] nanobind::object to_python(const std::optional<Fault>& fault);

}  // namespace trifinger::python
