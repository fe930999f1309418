// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <optional>

namespace trifinger::apps {

// Returns the real-time priority of the loop in the back-end's process `pid`: the lowest of its
// real-time threads, because the watchdog's is one higher. Returns nothing if the process has no
// real-time thread.
[[nodiscard]] std::optional<int> realtime_priority(pid_t pid);

}  // namespace trifinger::apps
