// SPDX-License-Identifier: BSD-3-Clause
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
#include <cstring>

#include "core/drivers_of_tests.hpp"
#include "core/fault_of.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/child_process.hpp"
#include "support/soak.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::test {
namespace {

// The actions have several words, so that a torn action would be noticed.
using OddRig = AcrossProcesses::Rig<OddDriverTraits>;

// A controller that has appended `appended` actions. It is led through the next append instruction
// by instruction.
class TracedController {
 public:
  TracedController(OddRig& rig, TimeIndex appended)
      : child_([&rig, appended] {
          auto robot = rig.connect();
          run_steps<OddDriverTraits>(robot, 0, appended - 1);
          if (appended > 0) static_cast<void>(robot.get_observation(appended - 1));
          if (::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) return kMayNotBeTraced;
          ::raise(SIGSTOP);
          robot.append_desired_action(OddDriverTraits::action(appended));
          ::raise(SIGSTOP);
          while (true) ::pause();
          return 0;
        }),
        is_traced_(next_stop() == SIGSTOP) {}

  [[nodiscard]] bool is_traced() const noexcept { return is_traced_; }
  // Returns false once the append is over.
  [[nodiscard]] bool step() {
    if (::ptrace(PTRACE_SINGLESTEP, child_.pid(), nullptr, nullptr) != 0) {
      throw SystemError("step through a process", errno);
    }
    return next_stop() == SIGTRAP;
  }
  void kill() noexcept { child_.kill(); }

 private:
  static constexpr int kMayNotBeTraced = 77;

  // Returns the signal at which the child has stopped; 0 if it has ended.
  [[nodiscard]] int next_stop() const {
    int status = 0;
    while (::waitpid(child_.pid(), &status, WUNTRACED) < 0 && errno == EINTR) {
    }
    return WIFSTOPPED(status) ? WSTOPSIG(status) : 0;
  }

  ChildProcess child_;
  bool is_traced_;
};

void expect_action(const Frontend<OddRobot>& robot, TimeIndex t) {
  const OddAction desired = robot.get_desired_action(t);
  const OddAction expected = OddDriverTraits::action(t);
  EXPECT_EQ(std::memcmp(&desired, &expected, sizeof(desired)), 0) << "the action of step " << t;
}

class KillAtInstruction : public ::testing::TestWithParam<TimeIndex> {};

TEST_P(KillAtInstruction, fault_01_LeavesWholeActionsAndTheRobotToTheNext) {
  const TimeIndex appended = GetParam();
  OddRig rig;
  std::int64_t instructions = 0;
  {
    TracedController controller(rig, appended);
    if (!controller.is_traced()) GTEST_SKIP() << "this machine does not allow ptrace";
    while (controller.step()) ++instructions;
  }
  if (instructions == 0) GTEST_SKIP() << "this machine does not step through programs";
  // All instructions are tried, unless a sanitizer turns a few hundred into thousands: single steps
  // are slow.
  const std::int64_t most_kills = std::clamp<std::int64_t>(600'000 / instructions, 40, 300);
  const std::int64_t stride = is_soak() ? 1 : 1 + instructions / most_kills;
  std::int64_t kills = 0;
  std::int64_t with_action = 0;
  for (std::int64_t target = 0; target <= instructions; target += stride, ++kills) {
    TracedController controller(rig, appended);
    ASSERT_TRUE(controller.is_traced());
    const auto observer = rig.observe();
    // The append has some more instructions if the back-end sleeps, and some fewer if not.
    for (std::int64_t i = 0; i < target && controller.step(); ++i) {
    }
    controller.kill();

    // The next controller attaches at once, and the robot obeys it.
    auto next = rig.connect();
    run_steps<OddDriverTraits>(next, 0, 2);
    static_cast<void>(next.get_observation(3));
    for (TimeIndex t = 0; t < 3; ++t) expect_action(next, t);

    // The session of the dead controller has the whole action or nothing of it.
    if (next.session().info().session_id == observer.session().info().session_id) {
      ASSERT_EQ(appended, 0) << "a session that had begun went on after instruction " << target;
    } else {
      const auto fault = fault_of([&] { return observer.get_status(1LL << 40U); });
      ASSERT_TRUE(fault.has_value()) << "after instruction " << target;
      ASSERT_TRUE(fault->time_index == appended || fault->time_index == appended + 1);
      if (fault->time_index > appended) ++with_action;
      expect_end(observer, fault->time_index, {.code = Fault::Code::kControllerDied});
      for (TimeIndex t = 0; t < fault->time_index; ++t) expect_action(observer, t);
    }
    next.finish();
    if (HasFatalFailure() || HasNonfatalFailure()) FAIL() << "after instruction " << target;
  }
  EXPECT_GT(with_action, 0) << "no kill came after the commit";
  EXPECT_LT(with_action, kills) << "no kill came before the commit";
  std::printf("%lld instructions, killed after %lld of them; %lld times the action was there\n",
              static_cast<long long>(instructions), static_cast<long long>(kills),
              static_cast<long long>(with_action));
}

INSTANTIATE_TEST_SUITE_P(Append, KillAtInstruction, ::testing::Values(0, 3), [](const auto& test) {
  return test.param == 0 ? "OfTheFirstAction" : "OfALaterAction";
});

}  // namespace
}  // namespace trifinger::test
