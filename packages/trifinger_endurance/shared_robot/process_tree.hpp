// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"

namespace trifinger::apps {

// A process as /proc shows it.
struct ProcessEntry {
  pid_t pid{0};
  pid_t parent{0};
  bool has_ended{false};  // Only its parent has not noticed yet.
  std::uint64_t threads{0};
  // A thread of it that has not ended, usually the first one, which has the number of the process.
  // /proc shows neither memory nor files of a process whose first thread has ended.
  pid_t live_thread{0};
  Nanoseconds cpu_time{0};           // its own
  Nanoseconds children_cpu_time{0};  // of children that have ended and were waited for
};

// Returns what can be read of the file /proc/PID/`name`: the process may end meanwhile. Ends soon
// after `most` bytes.
[[nodiscard]] std::string proc_text(pid_t pid, const char* name,
                                    std::size_t most = std::numeric_limits<std::size_t>::max());

// Reads the text of a file /proc/PID/stat. Nothing useful in it: pid 0.
[[nodiscard]] ProcessEntry parse_stat(std::string_view text);

// All processes that can be seen.
[[nodiscard]] std::vector<ProcessEntry> all_processes();

// Those of `all` that descend from the process `ancestor`, which is left out itself.
[[nodiscard]] std::vector<ProcessEntry> descendants_of(pid_t ancestor,
                                                       const std::vector<ProcessEntry>& all);

// Calls `use(path)` for the folder /proc/PID/task/TID of each thread of a process. Each may have a
// table of open files of its own.
void for_each_thread(pid_t pid, const std::function<void(const std::filesystem::path&)>& use);

// Memory that only the `processes` have, or that they share with each other, with their page tables
// and what was swapped out [bytes]. Looks at it closely only if it could be more than `enough`, and
// for at most 0.2 s: pages that several share are counted again and again otherwise.
[[nodiscard]] std::uint64_t memory_of(const std::vector<ProcessEntry>& processes,
                                      std::uint64_t enough);

// Number of threads of all processes of a user.
[[nodiscard]] std::uint64_t threads_of(uid_t user);

// Kills all descendants of this process, also those that start others meanwhile, and waits for
// them. True if none is left.
bool end_descendants();

}  // namespace trifinger::apps
