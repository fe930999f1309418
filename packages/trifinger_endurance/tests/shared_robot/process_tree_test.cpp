// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/process_tree.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
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

// A child that does `work` and then waits until it is killed. It is made when that is done.
class Child {
 public:
  explicit Child(const std::function<void()>& work) {
    std::array<int, 2> done{};
    EXPECT_EQ(::pipe(done.data()), 0);
    pid_ = ::fork();
    if (pid_ == 0) {
      work();
      tell(done[1]);
      for (;;) ::pause();
    }
    ::close(done[1]);
    char nothing = 0;
    EXPECT_EQ(::read(done[0], &nothing, 1), 1);
    ::close(done[0]);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }

  static void tell(int pipe) { static_cast<void>(::write(pipe, "x", 1)); }
  [[nodiscard]] ProcessEntry entry() const {
    const std::vector<ProcessEntry> all = all_processes();
    const auto found = std::ranges::find(all, pid_, &ProcessEntry::pid);
    return found == all.end() ? ProcessEntry{} : *found;
  }

 private:
  pid_t pid_;
};

constexpr std::size_t kMuch = 100'000'000;

TEST(MemoryOf, fault_79_SeesAProcessWhoseFirstThreadHasEnded) {
  std::array<int, 2> has_filled{};
  ASSERT_EQ(::pipe(has_filled.data()), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    std::thread([&has_filled] {
      std::vector<char> memory(kMuch, 'x');
      Child::tell(has_filled[1]);
      for (;;) ::pause();
    }).detach();
    ::syscall(SYS_exit, 0);  // this thread alone
  }
  char nothing = 0;
  ASSERT_EQ(::read(has_filled[0], &nothing, 1), 1);
  const auto entry = [child] {
    const std::vector<ProcessEntry> all = all_processes();
    return *std::ranges::find(all, child, &ProcessEntry::pid);
  };
  while (entry().live_thread == child) std::this_thread::yield();  // until it has ended
  EXPECT_FALSE(entry().has_ended);
  EXPECT_EQ(entry().threads, 2U);
  for (const std::uint64_t enough : {std::uint64_t{0}, std::uint64_t{kMuch} * 10}) {
    EXPECT_GT(memory_of({entry()}, enough), kMuch);
  }
  // It is killed like others, although it looks as if it had ended.
  EXPECT_TRUE(end_descendants());
  const std::vector<ProcessEntry> left = all_processes();
  EXPECT_EQ(std::ranges::find(left, child, &ProcessEntry::pid), left.end());
  for (const int end : has_filled) ::close(end);
}

TEST(MemoryOf, fault_79_CountsPageTables) {
  // Pages that were only read are one page of zeros, which is nobody's memory. Their tables are.
  constexpr std::size_t kTable = std::size_t{2} << 20;  // what one page of a table describes
  constexpr std::size_t kPages = 4000;
  const Child child([] {
    const auto* const at = static_cast<const volatile char*>(
        ::mmap(nullptr, kPages * kTable, PROT_READ | PROT_WRITE,
               MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0));
    ::madvise(const_cast<char*>(at), kPages * kTable, MADV_NOHUGEPAGE);
    for (std::size_t i = 0; i < kPages; ++i) static_cast<void>(at[i * kTable]);
  });
  for (const std::uint64_t enough : {std::uint64_t{0}, std::uint64_t{kMuch} * 10}) {
    EXPECT_GT(memory_of({child.entry()}, enough), kPages * 4096);
  }
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
