// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/job_limits.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <set>
#include <string_view>

namespace trifinger::apps {
namespace {

JobUsage all_of(const JobLimits& limits) {
  return {.time = limits.time,
          .cpu_time = limits.cpu_time,
          .memory = limits.memory,
          .processes = limits.processes,
          .files = limits.files,
          .file_count = limits.file_count};
}

TEST(JobLimits, MayBeUsedUpToTheLast) {
  EXPECT_EQ(exceeded(all_of(JobLimits{}), JobLimits{}), Limit::kNone);
}

TEST(JobLimits, NameTheOneThatIsExceeded) {
  const JobLimits limits;
  JobUsage usage = all_of(limits);
  usage.time += Nanoseconds(1);
  EXPECT_EQ(exceeded(usage, limits), Limit::kTime);
  usage.cpu_time += Nanoseconds(1);
  EXPECT_EQ(exceeded(usage, limits), Limit::kCpuTime);
  ++usage.file_count;
  EXPECT_EQ(exceeded(usage, limits), Limit::kFiles);
  usage.file_count = 0;
  usage.hides_files = true;
  EXPECT_EQ(exceeded(usage, limits), Limit::kFiles);
  usage.hides_files = false;
  ++usage.files;
  EXPECT_EQ(exceeded(usage, limits), Limit::kFiles);
  ++usage.memory;
  EXPECT_EQ(exceeded(usage, limits), Limit::kMemory);
  ++usage.processes;
  EXPECT_EQ(exceeded(usage, limits), Limit::kProcesses);
}

TEST(JobLimits, HaveNamesThatDiffer) {
  std::set<std::string_view> names;
  for (const Limit limit : {Limit::kNone, Limit::kTime, Limit::kCpuTime, Limit::kMemory,
                            Limit::kProcesses, Limit::kFiles}) {
    EXPECT_TRUE(names.insert(name_of(limit)).second);
  }
}

TEST(JobUsage, KeepsTheLargestOfEachKind) {
  JobUsage most{.time = std::chrono::seconds(1), .memory = 5, .processes = 1};
  raise_to(most, {.time = std::chrono::seconds(2), .memory = 3, .processes = 1, .files = 7});
  EXPECT_EQ(most.time, std::chrono::seconds(2));
  EXPECT_EQ(most.memory, 5U);
  EXPECT_EQ(most.processes, 1U);
  EXPECT_EQ(most.files, 7U);
}

}  // namespace
}  // namespace trifinger::apps
