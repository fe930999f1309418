// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/process.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdint>
#include <fstream>
#include <string>
#include <thread>

#include "support/child_process.hpp"
#include "support/shared_value.hpp"

namespace trifinger::ipc {
namespace {

TEST(ProcessIdentity, OfThisProcessIsAlive) {
  const auto self = ProcessIdentity::of_this_process();
  EXPECT_EQ(self.pid, ::getpid());
  EXPECT_TRUE(self.is_alive());
  EXPECT_EQ(self, ProcessIdentity::of_this_process());
}

TEST(ProcessIdentity, fault_18_IsNotAliveIfTheNumberBelongsToALaterProcess) {
  auto identity = ProcessIdentity::of_this_process();
  --identity.start_time;
  EXPECT_FALSE(identity.is_alive());
}

TEST(ProcessIdentity, OfNobodyIsNotAlive) {
  EXPECT_FALSE((ProcessIdentity{.pid = 0, .start_time = 0}.is_alive()));
  EXPECT_FALSE((ProcessIdentity{.pid = -5, .start_time = 7}.is_alive()));
  EXPECT_FALSE((ProcessIdentity{.pid = 1LL << 40U, .start_time = 7}.is_alive()));
}

TEST(ProcessIdentity, IsNotAliveOnceTheProcessIsAZombie) {
  test::SharedValue<ProcessIdentity> identity;
  const pid_t pid = ::fork();
  if (pid == 0) {
    *identity = ProcessIdentity::of_this_process();
    ::_exit(0);
  }
  // Waits for the end, but does not remove the zombie.
  siginfo_t info{};
  ASSERT_EQ(::waitid(P_PID, static_cast<id_t>(pid), &info, WEXITED | WNOWAIT), 0);
  EXPECT_EQ(identity->pid, pid);
  EXPECT_FALSE(identity->is_alive());
  ::waitpid(pid, nullptr, 0);
  EXPECT_FALSE(identity->is_alive());
}

TEST(ProcessIdentity, fault_18_KnowsThatAProcessIsKilledBeforeItIsGone) {
  EXPECT_FALSE(ProcessIdentity::of_this_process().is_ending());
  test::SharedValue<ProcessIdentity> identity;
  const pid_t pid = ::fork();
  if (pid == 0) {
    *identity = ProcessIdentity::of_this_process();
    ::raise(SIGSTOP);
    ::_exit(0);
  }
  siginfo_t info{};
  ASSERT_EQ(::waitid(P_PID, static_cast<id_t>(pid), &info, WSTOPPED), 0);
  EXPECT_FALSE(identity->is_ending()) << "a stopped process may go on";
  ASSERT_EQ(::kill(pid, SIGKILL), 0);
  // A zombie counts as ending, too, as long as nobody waits for it. The watchdog limits this loop.
  while (!identity->is_ending()) ::sched_yield();
  ::waitpid(pid, nullptr, 0);
  EXPECT_TRUE(identity->is_ending());
}

TEST(ProcessIdentity, fault_64_IsKnownDeadOnlyForCertain) {
  const auto self = ProcessIdentity::of_this_process();
  EXPECT_FALSE(self.is_known_dead());
  EXPECT_FALSE(ProcessIdentity::of(::getppid()).is_known_dead());
  ProcessIdentity later = self;
  ++later.start_time;
  EXPECT_TRUE(later.is_known_dead()) << "the number belongs to another process";
  later.number_space = 4711;
  EXPECT_FALSE(later.is_known_dead()) << "of another container";
  EXPECT_FALSE((ProcessIdentity{.pid = self.pid, .start_time = 1}.is_known_dead()));
  for (const std::int64_t pid : {std::int64_t{0}, std::int64_t{-5}, std::int64_t{1} << 40U}) {
    ProcessIdentity nonsense = self;
    nonsense.pid = pid;
    EXPECT_FALSE(nonsense.is_known_dead()) << pid;
  }

  test::SharedValue<ProcessIdentity> identity;
  test::ChildProcess child([&] {
    *identity = ProcessIdentity::of_this_process();
    return 0;
  });
  child.wait();
  EXPECT_TRUE(identity->is_known_dead());
}

TEST(ProcessIdentity, OfAProcessWhoseFirstThreadHasReturnedIsAlive) {
  test::SharedValue<std::atomic<bool>> has_returned;
  test::SharedValue<ProcessIdentity> identity;
  test::ChildProcess child([&] {
    *identity = ProcessIdentity::of_this_process();
    std::thread([&] {
      // The first thread is a zombie as long as others run.
      std::string state;
      while (state.find(" Z ") == std::string::npos) {
        std::ifstream file("/proc/self/stat");
        std::getline(file, state);
      }
      has_returned->store(true);
      while (true) ::pause();
    }).detach();
    ::syscall(SYS_exit, 0);  // ends this thread only
    return 1;
  });
  while (!has_returned->load()) std::this_thread::yield();
  EXPECT_TRUE(identity->is_alive());
  EXPECT_FALSE(identity->is_known_dead());
  child.kill();
}

TEST(ProcessIdentity, SurvivesANameThatLooksLikeTheEndOfIt) {
  // The kernel shows the name in parentheses without escaping it.
  test::ChildProcess child([] {
    ::prctl(PR_SET_NAME, ") R 1 2 (");
    const auto self = ProcessIdentity::of_this_process();
    return self.is_alive() && self.start_time > 1000 ? 0 : 2;
  });
  EXPECT_EQ(child.wait(), 0);
}

TEST(DescribeProcess, NamesTheProgramOfALivingProcess) {
  const auto self = ProcessIdentity::of_this_process();
  EXPECT_EQ(describe(self), "ipc_test (process " + std::to_string(::getpid()) + ")");
}

TEST(DescribeProcess, GivesTheNumberOfADeadProcess) {
  EXPECT_EQ(describe({.pid = 4711, .start_time = 1}), "process 4711");
}

}  // namespace
}  // namespace trifinger::ipc
