// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

#include "trifinger/base/time.hpp"

namespace trifinger::apps {

// What a job may use. All processes that its program has started count together, unless another
// thing is said.
struct JobLimits {
  Nanoseconds time{std::chrono::minutes(10)};      // from the start of the program to its end
  Nanoseconds grace{std::chrono::seconds(5)};      // from being asked to end to being killed
  Nanoseconds cpu_time{std::chrono::minutes(40)};  // of all processors
  std::uint64_t memory{4'000'000'000};             // [bytes]
  std::uint64_t address_space{16'000'000'000};     // of each process [bytes]
  std::uint64_t processes{256};                    // threads count as well
  std::uint64_t files{2'000'000'000};              // in its folder and in shared memory [bytes]
  std::uint64_t file_count{100'000};               // in its folder and in shared memory
  std::uint64_t file_size{1'000'000'000};          // of each file [bytes]
  std::uint64_t output{10'000'000};                // what is kept of its output [bytes]
  std::uint64_t log{2'000'000'000};                // of the robot's log [bytes]
};

// What a job uses at one moment.
struct JobUsage {
  Nanoseconds time{0};
  Nanoseconds cpu_time{0};
  std::uint64_t memory{0};  // [bytes]
  std::uint64_t processes{0};
  std::uint64_t files{0};  // [bytes]
  std::uint64_t file_count{0};
  bool hides_files{false};  // in folders that cannot be read, or too deep
};

enum class Limit : unsigned char { kNone, kTime, kCpuTime, kMemory, kProcesses, kFiles };
// The name in a report: "memory"; empty for kNone.
[[nodiscard]] std::string_view name_of(Limit limit) noexcept;

// Returns the limit that `usage` exceeds. If there are several, the one that harms the machine most
// comes first.
[[nodiscard]] Limit exceeded(const JobUsage& usage, const JobLimits& limits) noexcept;

// Takes over what is larger in `now`.
void raise_to(JobUsage& most, const JobUsage& now) noexcept;

}  // namespace trifinger::apps
