// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/confined_program.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>

#include "shared_robot/process_tree.hpp"
#include "support/folder.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::apps {
namespace {

// Programs run as nobody if the tests run as root.
class ConfinedProgramTest : public testing::TestWithParam<bool> {
 protected:
  ConfinedProgramTest() {
    std::filesystem::permissions(folder_.path(), std::filesystem::perms(0777));
    if (::geteuid() == 0) user_ = SystemUser::find("nobody");
  }

  Confinement shell(const std::string& script) {
    return {.words = {"/bin/sh", "-c", script},
            .folder = folder_.path(),
            .environment = {"PATH=/usr/bin:/bin", "GREETING=hello"},
            .user = user_,
            .limits = limits_,
            .writable = {},
            .with_namespaces = GetParam()};
  }

  // Returns what the program prints until all of it is gone.
  std::string output_of(ConfinedProgram& program) {
    program.start();
    std::string output;
    while (!program.is_gone()) output += program.take_output(std::chrono::milliseconds(20));
    EXPECT_TRUE(descendants_of(::getpid(), all_processes()).empty());
    return output;
  }

  test::Folder folder_;
  std::optional<SystemUser> user_;
  JobLimits limits_{};
};

TEST_P(ConfinedProgramTest, GetsItsFolderItsEnvironmentAndNothingElse) {
  ConfinedProgram program(shell("pwd; cat; env | sort; ls /proc/self/fd"));
  const std::string output = output_of(program);
  EXPECT_EQ(output, folder_.path().string() + "\nGREETING=hello\nPATH=/usr/bin:/bin\nPWD=" +
                        folder_.path().string() + "\n0\n1\n2\n3\n");
  ASSERT_TRUE(program.end());
  EXPECT_TRUE(WIFEXITED(program.end()->status));
  EXPECT_EQ(WEXITSTATUS(program.end()->status), 0);
}

TEST_P(ConfinedProgramTest, TellsHowItHasEnded) {
  ConfinedProgram exits(shell("exit 7"));
  output_of(exits);
  EXPECT_EQ(WEXITSTATUS(exits.end()->status), 7);
  ConfinedProgram killed(shell("kill -ABRT $$"));
  output_of(killed);
  EXPECT_EQ(WTERMSIG(killed.end()->status), SIGABRT);
}

TEST_P(ConfinedProgramTest, SaysWhyItCannotBeStarted) {
  Confinement missing = shell("");
  missing.words = {"/no/such/program"};
  ConfinedProgram program(missing);
  output_of(program);
  EXPECT_EQ(program.end()->start_error, ENOENT);
}

TEST_P(ConfinedProgramTest, LeavesNoProcessBehind) {
  // One that has left its session and group, one that ignores signals, one that has no parent.
  ConfinedProgram program(
      shell("setsid sleep 1000 & (trap '' TERM HUP; sleep 1000) & "
            "(setsid setsid sleep 1000 >/dev/null 2>&1 </dev/null &) ; sleep 0.1; echo done"));
  EXPECT_EQ(output_of(program), "done\n");
}

TEST_P(ConfinedProgramTest, IsKilledWithAllThatItHasStarted) {
  ConfinedProgram program(shell("trap '' TERM; (setsid sleep 1000 &); echo ready; sleep 1000"));
  program.start();
  std::string output;
  while (output != "ready\n") output += program.take_output(std::chrono::milliseconds(20));
  program.ask_to_end();
  program.kill();
  while (!program.is_gone()) static_cast<void>(program.take_output(std::chrono::milliseconds(20)));
  EXPECT_TRUE(descendants_of(::getpid(), all_processes()).empty());
  EXPECT_EQ(WTERMSIG(program.end()->status), SIGKILL);
}

TEST_P(ConfinedProgramTest, EndsWithThisProcess) {
  const pid_t between = ::fork();
  if (between == 0) {
    ConfinedProgram program(shell("echo $$ > started; exec sleep 1000"));
    program.start();
    while (!std::filesystem::exists(folder_ / "started")) ::usleep(1000);
    ::raise(SIGKILL);
  }
  ::waitpid(between, nullptr, 0);
  // Only now this process inherits what is left.
  const auto is_asleep = [this] {
    for (const ProcessEntry& process : all_processes()) {
      std::error_code ignored;
      const std::string place = "/proc/" + std::to_string(process.pid) + "/cwd";
      if (std::filesystem::read_symlink(place, ignored) == folder_.path()) return true;
    }
    return false;
  };
  while (is_asleep()) ::usleep(1000);
}

TEST_P(ConfinedProgramTest, CannotStartMoreProcessesThanItsLimit) {
  if (::geteuid() == 0 && !user_) GTEST_SKIP() << "the kernel does not limit root";
  limits_.processes = 20;
  // Others of the same user count as well, so there is room for some more.
  ConfinedProgram program(
      shell("i=0; while [ $i -lt 500 ]; do sleep 1000 & i=$((i+1)); done 2>/dev/null; echo all"));
  EXPECT_EQ(output_of(program), "");
}

TEST_P(ConfinedProgramTest, CannotWriteALargeFileNorGetMuchMemory) {
  limits_.file_size = 1'000'000;
  ConfinedProgram large(shell("exec head -c 2000000 /dev/zero > large"));
  output_of(large);
  EXPECT_EQ(WTERMSIG(large.end()->status), SIGXFSZ);
  EXPECT_EQ(std::filesystem::file_size(folder_ / "large"), 1'000'000U);
}

TEST_P(ConfinedProgramTest, CannotKeepAProcessorInRealTime) {
  ConfinedProgram limited(shell("grep timeout /proc/self/limits"));
  EXPECT_THAT(output_of(limited), testing::ContainsRegex("timeout +200000 +400000 +us"));
  ConfinedProgram permitted(shell("exec chrt -f 1 true"));
  output_of(permitted);
  if (permitted.end()->status != 0) GTEST_SKIP() << "this user has no real-time priority";
  ConfinedProgram high(shell("exec chrt -f 71 true"));
  output_of(high);
  EXPECT_NE(high.end()->status, 0);
  ConfinedProgram endless(shell("exec chrt -f 70 sh -c 'while :; do :; done'"));
  endless.start();
  const Deadline watchdog(std::chrono::seconds(60));
  while (!endless.end() && !watchdog.passed())
    static_cast<void>(endless.take_output(std::chrono::milliseconds(20)));
  endless.kill();
  while (!endless.is_gone()) static_cast<void>(endless.take_output(std::chrono::milliseconds(20)));
  EXPECT_EQ(WTERMSIG(endless.end()->status), SIGXCPU);
}

TEST_P(ConfinedProgramTest, IsWatchedInRealTimeButStartsOrdinarily) {
  ConfinedProgram program(shell("chrt -p $$; sleep 1000"));
  program.start();
  std::string output;
  while (output.find("priority: ") == std::string::npos)
    output += program.take_output(std::chrono::milliseconds(20));
  EXPECT_NE(output.find("SCHED_OTHER"), std::string::npos) << output;
  const int policy = ::sched_getscheduler(program.guard());
  const int own = watch_in_real_time();
  watch_ordinarily();
  EXPECT_EQ(policy, own > 0 ? SCHED_FIFO | SCHED_RESET_ON_FORK : SCHED_OTHER);
}

TEST_P(ConfinedProgramTest, CannotReachOtherProcessesNorWriteElsewhere) {
  if (!GetParam()) GTEST_SKIP() << "this takes namespaces";
  ConfinedProgram program(shell("kill -0 " + std::to_string(::getpid()) +
                                " 2>/dev/null && echo reached; : > own && echo own; "
                                "(: > /var/tmp/trifinger_escaped) 2>/dev/null && echo escaped"));
  if (!program.confined_by().own_processes) GTEST_SKIP() << "the kernel allows no namespaces";
  const bool is_read_only = program.confined_by().read_only;
  const std::string output = output_of(program);
  std::filesystem::remove("/var/tmp/trifinger_escaped");
  EXPECT_EQ(output, is_read_only ? "own\n" : "own\nescaped\n");
}

TEST_P(ConfinedProgramTest, SeesNothingOfOthersWhereEverybodyMayWrite) {
  if (!GetParam()) GTEST_SKIP() << "this takes namespaces";
  const test::Folder other;
  ConfinedProgram program(shell("pwd; ls -A " + folder_.path().parent_path().string() +
                                "; ls -A /var/tmp; : > own && echo own; : > /tmp/new"));
  if (!program.confined_by().hides_places) GTEST_SKIP() << "the kernel allows no such mounts";
  EXPECT_TRUE(program.confined_by().read_only);
  EXPECT_EQ(output_of(program), folder_.path().string() + "\n" +
                                    folder_.path().filename().string() +
                                    "\nown\n/bin/sh: 1: cannot create /tmp/new: Read-only file "
                                    "system\n");
  EXPECT_TRUE(std::filesystem::exists(folder_ / "own"));
  EXPECT_TRUE(std::filesystem::exists(other.path()));
}

TEST_P(ConfinedProgramTest, CannotHaveMemoryThatNobodySees) {
  ConfinedProgram program(
      shell("exec 2>/dev/null; (echo forks); unshare -U true && echo users; "
            "unshare -Um true && echo mounts; ipcmk -M 1000 && echo segment; "
            "ipcmk -Q && echo queue; echo end"));
  if (!program.confined_by().filters_calls) GTEST_SKIP() << "the kernel has no such filters";
  EXPECT_EQ(output_of(program), "forks\nend\n");
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutNamespaces, ConfinedProgramTest, testing::Bool());

}  // namespace
}  // namespace trifinger::apps
