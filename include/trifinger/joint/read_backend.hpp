// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/base/time.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger {

/// Reads the length of a step: 0.1 ms to 0.1 s.
/// @throws config::ConfigError
[[nodiscard]] Nanoseconds read_period(const config::Node& period);

/// Reads the section "backend" of a robot's configuration: how its back-end keeps time, and how it
/// treats late users. config/trifinger_edu.yml explains the keys; none may be missing. `session`
/// receives the length of its history and who may connect. The period must be a whole number of
/// `step`.
/// @throws config::ConfigError at the value that is wrong
[[nodiscard]] BackendOptions read_backend(const config::Node& section, SessionOptions& session,
                                          Nanoseconds step = Nanoseconds(1));

}  // namespace trifinger
