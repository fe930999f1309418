// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <optional>

#include "shown.hpp"
#include "trifinger/core/fault.hpp"

namespace trifinger::bindings {

/// Makes C++ errors reach Python as the classes of trifinger.errors, with their text and
/// their data.
void register_errors();

/// Converts to a trifinger.Fault; nothing becomes None.
[[nodiscard]] Shown<"trifinger.session_info.Fault | None"> to_python(
    const std::optional<Fault>& fault);

}  // namespace trifinger::bindings
