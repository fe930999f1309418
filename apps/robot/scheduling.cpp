// SPDX-License-Identifier: BSD-3-Clause
#include "robot/scheduling.hpp"

#include <sched.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>

namespace trifinger::apps {

std::optional<int> realtime_priority(pid_t pid) {
  std::optional<int> lowest;
  std::error_code ignored;
  const std::filesystem::path threads = "/proc/" + std::to_string(pid) + "/task";
  for (const auto& entry : std::filesystem::directory_iterator(threads, ignored)) {
    const auto thread =
        static_cast<pid_t>(std::strtol(entry.path().filename().c_str(), nullptr, 10));
    sched_param parameters{};
    // A thread that has ended meanwhile has no policy.
    if (::sched_getscheduler(thread) != SCHED_FIFO) continue;
    if (::sched_getparam(thread, &parameters) != 0) continue;
    lowest = std::min(lowest.value_or(parameters.sched_priority), parameters.sched_priority);
  }
  return lowest;
}

}  // namespace trifinger::apps
