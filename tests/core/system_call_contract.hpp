// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <optional>

#include "core/fault_of.hpp"
#include "core/transports.hpp"
#include "support/allocation_counter.hpp"
#include "support/child_process.hpp"
#include "support/session_folder.hpp"
#include "support/shared_value.hpp"

// Checks the loop of every driver in real-time mode. It may only make system calls to sleep until
// its deadline, to wake those who wait for it, and to read its clock if that takes a call. It takes
// no memory from the heap. The test program is built with support/allocation_counter.cpp:
//
//     using Drivers = ::testing::Types<SimDriverTraits>;
//     INSTANTIATE_TYPED_TEST_SUITE_P(Sim, SystemCallContract, Drivers);

namespace trifinger::test {

/// From now on the kernel ends this process with SIGSYS if the calling thread makes any other
/// system call. Returns false if the kernel refuses to watch.
[[nodiscard]] inline bool allow_only_what_the_loop_needs() noexcept {
  constexpr auto kLoad = static_cast<std::uint16_t>(BPF_LD | BPF_W | BPF_ABS);
  constexpr auto kJumpIfEqual = static_cast<std::uint16_t>(BPF_JMP | BPF_JEQ | BPF_K);
  constexpr auto kReturn = static_cast<std::uint16_t>(BPF_RET | BPF_K);
  std::array program{
      sock_filter{kLoad, 0, 0, offsetof(seccomp_data, nr)},
      sock_filter{kJumpIfEqual, 3, 0, SYS_futex},
      sock_filter{kJumpIfEqual, 2, 0, SYS_clock_nanosleep},
      sock_filter{kJumpIfEqual, 1, 0, SYS_clock_gettime},
      sock_filter{kReturn, 0, 0, SECCOMP_RET_KILL_PROCESS},
      sock_filter{kReturn, 0, 0, SECCOMP_RET_ALLOW},
  };
  const sock_fprog filter{.len = program.size(), .filter = program.data()};
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

/// What the loop's thread does at every observation.
class LoopGuard {
 public:
  /// Number of heap allocations since the first observation, for the test's process to read. Set
  /// before the fork.
  static inline std::atomic<std::size_t>* allocations{nullptr};
  /// A file that a driver of the tests writes to, which is not allowed.
  static inline int file{-1};

  static void watch() {
    if (is_watching) {
      // relaxed: it is read after the process has ended.
      allocations->store(allocation_counter->count(), std::memory_order_relaxed);
      return;
    }
    is_watching = allow_only_what_the_loop_needs();
    allocation_counter.emplace();
  }
  static void watch_and_write() {
    watch();
    if (++num_observations < 50) return;
    static_cast<void>(::write(file, "", 1));
  }

 private:
  static inline thread_local bool is_watching{false};
  static inline thread_local std::optional<AllocationCounter> allocation_counter;
  static inline thread_local int num_observations{0};
};

/// The back-end in a process of its own, in real time, with everything that the machine grants.
template <class Traits>
class GuardedBackend {
 public:
  explicit GuardedBackend(void (*on_observation)())
      : process_([=] { return run(on_observation); }) {}

  [[nodiscard]] Frontend<typename Traits::Robot> connect() const {
    const Deadline deadline(kLong);
    while (true) {
      try {
        return Frontend<typename Traits::Robot>("robot", {.timeout = kLong});
      } catch (const SessionNotFound&) {
        if (deadline.passed()) throw;
      }
      std::this_thread::yield();
    }
  }
  [[nodiscard]] ChildProcess& process() noexcept { return process_; }

 private:
  static int run(void (*on_observation)()) {
    CallLog log;
    DriverUnderTest driver(Traits::make_driver(), {.on_observation = on_observation}, log);
    SessionHost host = SessionHost::named("robot");
    Backend backend(driver, host, kTolerantDeadlines);
    const BackendThread thread(backend, {.demand = Demand::kTry});
    while (true) ::pause();
  }

  SessionFolder folder_;
  ChildProcess process_;
};

template <class T>
class SystemCallContract : public ::testing::Test {
 protected:
  void SetUp() override {
    // The end of a process is a system call, too.
    ChildProcess watched([] { return allow_only_what_the_loop_needs() ? 0 : 1; });
    if (watched.wait() != -SIGSYS) GTEST_SKIP() << "this kernel does not watch system calls";
    LoopGuard::allocations = &*allocations_;
  }

  SharedValue<std::atomic<std::size_t>> allocations_;
};
TYPED_TEST_SUITE_P(SystemCallContract);

TYPED_TEST_P(SystemCallContract, InRealTimeTheLoopOnlySleepsAndWakes) {
  GuardedBackend<TypeParam> backend(&LoopGuard::watch);
  // It stays connected until the back-end is killed: when it leaves, the loop is over, and the end
  // of a session takes system calls.
  auto robot = backend.connect();
  const auto end = fault_of([&] {
    constexpr TimeIndex kSteps = 2000;
    TimeIndex t = robot.append_desired_action(TypeParam::action(0));
    while (t < kSteps) {
      // Waits, so that the loop has somebody to wake.
      static_cast<void>(robot.get_observation(t, kLong));
      t = robot.append_desired_action(TypeParam::action(t + 1));
    }
  });
  EXPECT_FALSE(end.has_value());
  backend.process().send(SIGKILL);
  EXPECT_EQ(backend.process().wait(), -SIGKILL) << "SIGSYS is " << -SIGSYS;
  EXPECT_EQ(this->allocations_->load(), 0U);
}

TYPED_TEST_P(SystemCallContract, ADriverThatWritesToAFileIsFound) {
  LoopGuard::file = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  ASSERT_GE(LoopGuard::file, 0);
  GuardedBackend<TypeParam> backend(&LoopGuard::watch_and_write);
  EXPECT_EQ(backend.process().wait(), -SIGSYS);
  ::close(LoopGuard::file);
}

REGISTER_TYPED_TEST_SUITE_P(SystemCallContract, InRealTimeTheLoopOnlySleepsAndWakes,
                            ADriverThatWritesToAFileIsFound);

}  // namespace trifinger::test
