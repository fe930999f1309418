// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <vector>

#include "trifinger/core/session.hpp"

namespace trifinger::bindings {

/// Converts to a trifinger.SessionInfo.
[[nodiscard]] nanobind::object to_python(const SessionInfo& info);
/// Converts to a dict of texts by name.
[[nodiscard]] nanobind::object to_python(const std::vector<Document>& documents);

}  // namespace trifinger::bindings
