// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/job_limits.hpp"

#include <algorithm>

namespace trifinger::apps {

std::string_view name_of(Limit limit) noexcept {
  switch (limit) {
    case Limit::kNone:
      break;
    case Limit::kTime:
      return "time";
    case Limit::kCpuTime:
      return "cpu_time";
    case Limit::kMemory:
      return "memory";
    case Limit::kProcesses:
      return "processes";
    case Limit::kFiles:
      return "files";
  }
  return "";
}

Limit exceeded(const JobUsage& usage, const JobLimits& limits) noexcept {
  if (usage.processes > limits.processes) return Limit::kProcesses;
  if (usage.memory > limits.memory) return Limit::kMemory;
  if (usage.files > limits.files || usage.file_count > limits.file_count || usage.hides_files) {
    return Limit::kFiles;
  }
  if (usage.cpu_time > limits.cpu_time) return Limit::kCpuTime;
  if (usage.time > limits.time) return Limit::kTime;
  return Limit::kNone;
}

void raise_to(JobUsage& most, const JobUsage& now) noexcept {
  most.time = std::max(most.time, now.time);
  most.cpu_time = std::max(most.cpu_time, now.cpu_time);
  most.memory = std::max(most.memory, now.memory);
  most.processes = std::max(most.processes, now.processes);
  most.files = std::max(most.files, now.files);
  most.file_count = std::max(most.file_count, now.file_count);
  most.hides_files = most.hides_files || now.hides_files;
}

}  // namespace trifinger::apps
