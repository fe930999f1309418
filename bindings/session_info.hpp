// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include "trifinger/core/session.hpp"

namespace trifinger::python {

/// As trifinger.SessionInfo.
[[nodiscard]] nanobind::object to_python(const SessionInfo& info);

}  // namespace trifinger::python
