// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/base/time.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::detail {

// True if the section "robot" names a file with a model.
[[nodiscard]] bool is_from_file(const config::Node& root);

[[nodiscard]] Nanoseconds read_period(const config::Node& period);

// Reads the section "backend". The period must be a whole number of `step`.
[[nodiscard]] BackendOptions read_backend(const config::Node& section, SessionOptions& session,
                                          Nanoseconds step);

}  // namespace trifinger::detail
