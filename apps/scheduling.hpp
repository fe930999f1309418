// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <optional>

namespace trifinger::apps {

// The real-time priority of the loop in the back-end's process `pid`: the lowest of its real-time
// threads, since the watchdog has one more. Nothing if it has none.
[[nodiscard]] std::optional<int> realtime_priority(pid_t pid);

}  // namespace trifinger::apps
