// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <vector>

#include "conversion/shown.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::bindings {

/// Converts to a trifinger.SessionInfo.
[[nodiscard]] Shown<"trifinger.session_info.SessionInfo"> to_python(const SessionInfo& info);
/// Converts to a dict of texts by name.
[[nodiscard]] ShownTexts to_python(const std::vector<Document>& documents);

}  // namespace trifinger::bindings
