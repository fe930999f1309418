// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/process_tree.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

namespace trifinger::apps {
namespace {

TEST(ParseStat, ReadsAProcessWhateverItIsCalled) {
  for (const std::string name : {"sh", ") R 1 1", "a b", "(((", "", "\n"}) {
    const ProcessEntry process =
        parse_stat("4711 (" + name +
                   ") S 42 4711 4711 0 -1 4194560 1 2 3 4 250 50 1000 500 20 0 7 0 123456 1 2 3\n");
    EXPECT_EQ(process.pid, 4711);
    EXPECT_EQ(process.parent, 42);
    EXPECT_FALSE(process.has_ended);
    EXPECT_EQ(process.threads, 7U);
    const auto ticks = ::sysconf(_SC_CLK_TCK);
    EXPECT_EQ(process.cpu_time, Nanoseconds(std::chrono::seconds(300)) / ticks);
    EXPECT_EQ(process.children_cpu_time, Nanoseconds(std::chrono::seconds(1500)) / ticks);
  }
}

TEST(ParseStat, FindsNothingInOtherTexts) {
  EXPECT_TRUE(rc::check([](const std::string& text) {
    const ProcessEntry process = parse_stat(text);
    RC_ASSERT(process.pid == 0 || text.find(')') != std::string::npos);
  }));
}

TEST(AllProcesses, ContainThisOne) {
  const std::vector<ProcessEntry> all = all_processes();
  const auto own = std::ranges::find(all, ::getpid(), &ProcessEntry::pid);
  ASSERT_NE(own, all.end());
  EXPECT_EQ(own->parent, ::getppid());
  EXPECT_GE(own->threads, 1U);
  EXPECT_GT(memory_of({*own}, 0), 10'000U);
  EXPECT_GE(threads_of(::geteuid()), own->threads);
}

// True if a chain of parents leads from `process` to `ancestor`.
bool descends(pid_t process, pid_t ancestor, const std::vector<ProcessEntry>& all) {
  for (std::size_t steps = 0; steps <= all.size(); ++steps) {
    const auto entry = std::ranges::find(all, process, &ProcessEntry::pid);
    if (entry == all.end()) return false;
    process = entry->parent;
    if (process == ancestor) return true;
  }
  return false;
}

TEST(DescendantsOf, AreAllWhoseChainOfParentsLeadsThere) {
  EXPECT_TRUE(rc::check([] {
    const auto size = *rc::gen::inRange<pid_t>(1, 30);
    std::vector<ProcessEntry> all;
    for (pid_t pid = 1; pid <= size; ++pid) {
      all.push_back({.pid = pid, .parent = *rc::gen::inRange<pid_t>(0, size + 1)});
    }
    const std::vector<ProcessEntry> found = descendants_of(1, all);
    for (const ProcessEntry& process : all) {
      if (process.pid == 1) continue;
      const bool is_found =
          std::ranges::find(found, process.pid, &ProcessEntry::pid) != found.end();
      RC_ASSERT(is_found == descends(process.pid, 1, all));
    }
  }));
}

}  // namespace
}  // namespace trifinger::apps
