// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/fake_robot.hpp"
#include "support/child_process.hpp"
#include "support/session_folder.hpp"
#include "support/soak.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/sensor.hpp"
#include "trifinger/core/session.hpp"

// Files change in system calls alone, so a process that is stopped or killed between any two of
// them leaves every state of its files that there can be.

namespace trifinger::test {
namespace {

using ::testing::IsEmpty;

// A process that does `work` system call by system call.
class TracedProcess {
 public:
  // `prepare` comes before; it returns the work.
  explicit TracedProcess(const std::function<std::function<void()>()>& prepare)
      : child_([&] {
          const std::function<void()> work = prepare();
          if (::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) return 77;
          ::raise(SIGSTOP);
          work();
          ::raise(SIGSTOP);
          return 0;
        }),
        is_traced_(next_stop() == SIGSTOP) {}

  [[nodiscard]] bool is_traced() const noexcept { return is_traced_; }
  // Continues to the beginning or the end of the next system call. False once the work is done.
  [[nodiscard]] bool step() {
    return ::ptrace(PTRACE_SYSCALL, child_.pid(), nullptr, nullptr) == 0 && next_stop() == SIGTRAP;
  }
  void kill() noexcept { child_.kill(); }
  // Does the rest of the work and ends. The exit code is 1 if the work throws.
  [[nodiscard]] int finish() {
    ::ptrace(PTRACE_CONT, child_.pid(), nullptr, nullptr);
    if (next_stop() != SIGSTOP) return 1;
    ::ptrace(PTRACE_CONT, child_.pid(), nullptr, nullptr);
    return child_.wait();
  }

 private:
  [[nodiscard]] int next_stop() const {
    int status = 0;
    while (::waitpid(child_.pid(), &status, WUNTRACED) < 0 && errno == EINTR) {
    }
    return WIFSTOPPED(status) ? WSTOPSIG(status) : 0;
  }

  ChildProcess child_;
  bool is_traced_;
};

std::set<std::string> files_in(const std::filesystem::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.insert(entry.path().filename().string());
  }
  return names;
}

// The name, or nothing if another process has it.
std::optional<SessionHost> try_to_take() {
  try {
    return SessionHost::named("robot");
  } catch (const RobotOwned&) {
    return std::nullopt;
  }
}

std::function<void()> take_name() {
  return [] { static_cast<void>(try_to_take().has_value()); };
}

std::function<void()> give_name_back() {
  auto host = std::make_shared<std::optional<SessionHost>>(SessionHost::named("robot"));
  return [host] { *host = std::nullopt; };
}

using Work = std::function<std::function<void()>()>;

// The numbers of steps after which something is tried: the last ones, in which files are removed,
// and some of those before, most of which look at the processes of the machine.
std::vector<std::int64_t> stops_of(const Work& work) {
  std::int64_t steps = 0;
  {
    TracedProcess process(work);
    if (!process.is_traced()) return {};
    while (process.step()) ++steps;
  }
  const std::int64_t last = is_soak() ? steps : std::min<std::int64_t>(steps, 45);
  const std::int64_t stride = 1 + (steps - last) / 15;
  std::vector<std::int64_t> stops;
  for (std::int64_t step = 0; step < steps - last; step += stride) stops.push_back(step);
  for (std::int64_t step = steps - last; step <= steps; ++step) stops.push_back(step);
  std::printf("%lld stops, tried at %zu\n", static_cast<long long>(steps), stops.size());
  return stops;
}

// The number of steps in which a process makes a lock, and some more.
constexpr std::int64_t kBeginning = 60;

class KillAtSystemCall : public ::testing::TestWithParam<Work> {
 protected:
  SessionFolder folder_;
};

TEST_P(KillAtSystemCall, fault_80_LeavesTheNameFreeAndNoFileAfterItsNextOwner) {
  const auto stops = stops_of(GetParam());
  if (stops.empty()) GTEST_SKIP() << "this machine does not allow ptrace";
  for (const std::int64_t stop : stops) {
    TracedProcess process(GetParam());
    for (std::int64_t i = 0; i < stop && process.step(); ++i) {
    }
    process.kill();
    ASSERT_TRUE(try_to_take().has_value()) << "after stop " << stop;
    ASSERT_THAT(files_in(folder_.path()), IsEmpty()) << "after stop " << stop;
  }
}

// The lock of a sensor has a hidden name only at the beginning.
TEST(KillAtSystemCallOfASensor, fault_80_LeavesNoFileAfterItsNextOwner) {
  const SessionFolder folder;
  const Work work = [] {
    return [] { const SensorWriter<FakeSensorReading> sensor("robot", "object"); };
  };
  if (!TracedProcess(work).is_traced()) GTEST_SKIP() << "this machine does not allow ptrace";
  bool has_left_a_hidden_lock = false;
  for (std::int64_t stop = 0; stop < kBeginning; ++stop) {
    TracedProcess process(work);
    for (std::int64_t i = 0; i < stop && process.step(); ++i) {
    }
    process.kill();
    for (const std::string& name : files_in(folder.path())) {
      has_left_a_hidden_lock |= name.starts_with(".trifinger-sensor.robot.object.lock.");
    }
    work()();
    ASSERT_THAT(files_in(folder.path()), IsEmpty()) << "after stop " << stop;
  }
  EXPECT_TRUE(has_left_a_hidden_lock);
}

TEST(StopAtSystemCall, fault_80_WhileALockIsMadeLetsAnotherComeAndGo) {
  const SessionFolder folder;
  if (!TracedProcess(take_name).is_traced()) GTEST_SKIP() << "this machine does not allow ptrace";
  int tried = 0;
  for (std::int64_t stop = 0; stop < kBeginning; ++stop) {
    TracedProcess process(take_name);
    for (std::int64_t i = 0; i < stop && process.step(); ++i) {
    }
    const std::set<std::string> files = files_in(folder.path());
    if (std::ranges::any_of(files, [](const std::string& name) {
          return name.starts_with(".trifinger.robot.lock.");
        })) {
      ++tried;
      // It removes what killed processes have left; the one that is stopped lives.
      try_to_take().reset();
    }
    ASSERT_EQ(process.finish(), 0) << "after stop " << stop;
    ASSERT_THAT(files_in(folder.path()), IsEmpty()) << "after stop " << stop;
  }
  EXPECT_GT(tried, 0);
}

INSTANTIATE_TEST_SUITE_P(Names, KillAtSystemCall, ::testing::Values(take_name, give_name_back),
                         [](const auto& test) {
                           return test.index == 0 ? "WhileItIsTaken" : "WhileItIsGivenBack";
                         });

TEST(StopAtSystemCall, fault_80_WhileANameIsGivenBackLetsNoTwoHaveIt) {
  const SessionFolder folder;
  const auto stops = stops_of(give_name_back);
  if (stops.empty()) GTEST_SKIP() << "this machine does not allow ptrace";
  std::int64_t taken = 0;
  for (const std::int64_t stop : stops) {
    TracedProcess process(give_name_back);
    for (std::int64_t i = 0; i < stop && process.step(); ++i) {
    }
    // Another process arrives meanwhile, and gets the name or not.
    std::optional<SessionHost> host = try_to_take();
    EXPECT_EQ(process.finish(), 0);
    if (host) {
      ++taken;
      ASSERT_FALSE(try_to_take()) << "two have the name after stop " << stop;
    }
    host.reset();
    ASSERT_THAT(files_in(folder.path()), IsEmpty()) << "after stop " << stop;
  }
  EXPECT_GT(taken, 0);
}

}  // namespace
}  // namespace trifinger::test
