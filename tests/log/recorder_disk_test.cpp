// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/named_robot.hpp"
#include "log/recorder.hpp"
#include "log/recorder_under_test.hpp"
#include "log/recordings.hpp"
#include "support/child_process.hpp"
#include "support/interruptions.hpp"
#include "support/session_folder.hpp"

// What a disk can do to a recorder (fault_21, fault_22, fault_23). In each test the robot
// continues.

namespace trifinger::test {
namespace {

using log::RecorderOptions;
using Range = std::pair<TimeIndex, TimeIndex>;
using ::testing::IsEmpty;

RecorderOptions options_for(const std::filesystem::path& folder) {
  RecorderOptions options;
  options.folder = folder;
  options.keep_free = 0;
  return options;
}

// A robot in real time, and a recorder that writes it to a disk of the tests.
class RecorderDisk : public ::testing::Test {
 protected:
  // The history is long enough for half a minute in which the machine does something else.
  void start(std::size_t history = 131072) {
    backend_.emplace("robot", SessionOptions{.history = history}, kRealTime);
    robot_.emplace(backend_->host());
    robot_->append_desired_action({});
    RecorderOptions options = options_for(logs_.path());
    options.open_file = disk_.opener();
    options.rotate_size = rotate_size_;
    recorder_.emplace(std::vector<std::string>{"robot"}, options);
    recorder_->wait_for_step(10);
  }
  // Lets the robot make that many more steps.
  void go_on(TimeIndex steps) {
    robot_->wait_until_time_index(robot_->current_time_index() + steps);
  }
  // Waits until the recorder has reached the robot's current step.
  void catch_up() { recorder_->wait_for_step(robot_->current_time_index()); }

  SessionFolder sessions_;
  Folder logs_;
  Disk disk_;
  std::uint64_t rotate_size_{std::uint64_t{1} << 30U};
  std::optional<NamedRobot> backend_;
  std::optional<Frontend<FakeRobot>> robot_;
  std::optional<RecorderUnderTest> recorder_;
};

// GoogleTest wants both bases.
// NOLINTNEXTLINE(misc-multiple-inheritance)
class RecorderDiskError : public RecorderDisk, public ::testing::WithParamInterface<int> {};

TEST_P(RecorderDiskError, fault_23_CostsNothingThatTheHistoryHolds) {
  start();
  disk_.set_error(GetParam());
  recorder_->wait_for_event("recorder: cannot write: ");
  go_on(500);
  disk_.set_error(0);
  recorder_->wait_for_event("; nothing was lost");
  catch_up();
  recorder_->stop();
  const Recorded log(logs_.path());
  EXPECT_GT(log.first().steps.size(), 500);
  EXPECT_THAT(log.first().holes(), IsEmpty());
  EXPECT_TRUE(log.first().is_ordered());
  EXPECT_THAT(log.first().gaps, IsEmpty());
  EXPECT_EQ(log.damages, 0);
  // The error is in the log, too.
  EXPECT_EQ(log.count_events("cannot write: "), 1);
  EXPECT_EQ(log.count_events("writes again after "), 1);
}

TEST_F(RecorderDisk, fault_23_GetsEveryStepHoweverOftenSignalsInterrupt) {
  rotate_size_ = 20'000;
  const std::int64_t before = Interruptions::count();
  Interruptions interruptions;
  interruptions.begin();
  start();
  go_on(2000);
  catch_up();
  recorder_->stop();
  EXPECT_GT(Interruptions::count(), before);
  const Recorded log(logs_.path());
  EXPECT_GT(log.files.size(), 1);
  EXPECT_GT(log.first().steps.size(), 2000);
  EXPECT_THAT(log.first().holes(), IsEmpty());
  EXPECT_TRUE(log.first().is_ordered());
  EXPECT_EQ(log.damages, 0);
  EXPECT_EQ(recorder_->count_events("cannot"), 0U) << recorder_->all_events();
}

TEST_P(RecorderDiskError, fault_21_IsAGapWhereTheHistoryIsTooShort) {
  start(256);
  disk_.set_error(GetParam());
  recorder_->wait_for_event("recorder: cannot write: ");
  // Wait until something is certainly lost.
  const UntypedFrontend observer(robot_->session());
  while (observer.range(Series::kStatus).first <= (*recorder_)->state().robots[0].next_step) {
    go_on(100);
  }
  disk_.set_error(0);
  recorder_->wait_for_event("writes again after ");
  catch_up();
  recorder_->stop();
  const Recorded log(logs_.path());
  // The steps that are missing are exactly those that the log reports as missing.
  EXPECT_EQ(log.first().holes(), log.first().reported_holes());
  ASSERT_FALSE(log.first().gaps.empty());
  std::int64_t lost = 0;
  for (const auto& [first, last] : log.first().gaps) lost += last - first + 1;
  EXPECT_EQ((*recorder_)->state().lost_steps, lost);
  EXPECT_TRUE(log.first().is_ordered());
  EXPECT_EQ(log.count_losses_of("robot"), log.first().gaps.size());
}

INSTANTIATE_TEST_SUITE_P(Errors, RecorderDiskError, ::testing::Values(ENOSPC, EIO, EDQUOT),
                         [](const auto& test) {
                           return std::string(::strerrorname_np(test.param));
                         });

TEST_F(RecorderDisk, fault_21_WarnsWhenHalfOfTheHistoryIsStillToBeWritten) {
  constexpr std::size_t kHistory = 8192;
  start(kHistory);
  go_on(kHistory);  // the whole history is in use
  catch_up();
  disk_.set_error(EIO);
  recorder_->wait_for_event("recorder: far behind robot");
  disk_.set_error(0);
  recorder_->wait_for_event("writes again after ");
  recorder_->stop();
  // On a busy machine, the recorder may return when the other half is used up as well. The warning
  // came before that.
  const Recorded log(logs_.path());
  EXPECT_EQ(log.first().holes(), log.first().reported_holes());
  const std::string events = recorder_->all_events();
  EXPECT_LT(events.find("far behind robot"), events.find("not in the log: overwritten before"));
}

TEST_F(RecorderDisk, fault_21_ThatHangsDelaysNobodyButTheRecorder) {
  start(256);
  disk_.hold();
  disk_.wait_for_append();
  go_on(2000);
  disk_.let_go();
  catch_up();
  recorder_->stop();
  const Recorded log(logs_.path());
  EXPECT_EQ(log.first().holes(), log.first().reported_holes());
  EXPECT_FALSE(log.first().gaps.empty());
}

TEST_F(RecorderDisk, fault_23_MayFailAtAnyMomentWithRotationToo) {
  rotate_size_ = 50'000;
  start();
  std::mt19937 random(1);
  for (int i = 0; i < 20; ++i) {
    disk_.set_error(random() % 2 == 0 ? ENOSPC : EIO);
    go_on(static_cast<TimeIndex>(random() % 300));
    disk_.set_error(0);
    go_on(static_cast<TimeIndex>(random() % 1000));
  }
  catch_up();
  recorder_->wait_until([](const auto& state) { return state.error.empty(); });
  recorder_->stop();
  const Recorded log(logs_.path());
  EXPECT_GT(log.files.size(), 2);
  EXPECT_EQ(log.damages, 0);
  EXPECT_THAT(log.first().holes(), IsEmpty());
  EXPECT_TRUE(log.first().is_ordered());
  EXPECT_THAT(log.first().gaps, IsEmpty());
}

TEST_F(RecorderDisk, ThatRefusesTheEndLeavesAFileToGoOnWith) {
  start();
  disk_.set_error(ENOSPC);
  recorder_->wait_for_event("cannot write: ");
  EXPECT_THROW(recorder_->stop(), SystemError);
  go_on(100);
  disk_.set_error(0);
  const TimeIndex step = robot_->current_time_index();
  recorder_.emplace(std::vector<std::string>{"robot"}, options_for(logs_.path()));
  recorder_->wait_for_step(step);
  recorder_->stop();
  const Recorded log(logs_.path());
  EXPECT_EQ(log.files.size(), 1);
  EXPECT_THAT(log.first().holes(), IsEmpty());
  EXPECT_TRUE(log.first().is_ordered());
}

// The kernel's own errors are tested in a separate process, whose exit code is the result.
constexpr int kPassed = 0;
constexpr int kFailed = 1;
constexpr int kNotPermitted = 77;

// Records while `spoil` makes the disk full and `repair` makes room again.
template <class Spoil, class Repair>
int record_on_full_disk(const std::filesystem::path& folder, const Spoil& spoil,
                        const Repair& repair) {
  const NamedRobot backend("robot", {.history = 131072}, kRealTime);
  Frontend<FakeRobot> robot(backend.host());
  robot.append_desired_action({});
  RecorderUnderTest recorder({"robot"}, options_for(folder));
  recorder.wait_for_step(10);
  spoil();
  recorder.wait_for_event("cannot write: ");
  robot.wait_until_time_index(robot.current_time_index() + 1000);
  repair();
  recorder.wait_for_event("; nothing was lost");
  recorder.wait_for_step(robot.current_time_index());
  recorder.stop();
  const Recorded log(folder);
  const bool is_whole = log.first().holes().empty() && log.first().is_ordered() &&
                        log.first().gaps.empty() && log.damages == 0 && log.is_finished.at(0);
  if (!is_whole) std::fprintf(stderr, "%s", recorder.all_events().c_str());
  return is_whole ? kPassed : kFailed;
}

TEST(RecorderOnAFullDisk, fault_23_GoesOnWhereAShortWriteWasCutOff) {
  const SessionFolder sessions;
  const Folder logs;
  ChildProcess child([&] {
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit limit{};
    ::getrlimit(RLIMIT_FSIZE, &limit);
    const auto allow = [&](rlim_t size) {
      limit.rlim_cur = size;
      ::setrlimit(RLIMIT_FSIZE, &limit);
    };
    // The kernel writes up to the limit, anywhere in a chunk, and refuses the rest.
    return record_on_full_disk(logs.path(), [&] { allow(20'011); }, [&] { allow(limit.rlim_max); });
  });
  EXPECT_EQ(child.wait(), kPassed);
}

TEST(RecorderOnAFullDisk, fault_22_GoesOnWhenThereIsRoomAgain) {
  const SessionFolder sessions;
  const Folder logs;
  ChildProcess child([&] {
    // A disk of one megabyte that only this process sees.
    if (::unshare(CLONE_NEWNS) != 0 ||
        ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        ::mount("tmpfs", logs.path().c_str(), "tmpfs", 0, "size=1m") != 0) {
      return kNotPermitted;
    }
    const auto filler = logs / "filler";
    return record_on_full_disk(
        logs.path(),
        [&] {
          // Write until the disk is full.
          std::FILE* const file = std::fopen(filler.c_str(), "wb");
          std::setvbuf(file, nullptr, _IONBF, 0);
          const Bytes page(4096);
          while (std::fwrite(page.data(), 1, page.size(), file) == page.size()) {
          }
          std::fclose(file);
        },
        [&] { std::filesystem::remove(filler); });
  });
  const int result = child.wait();
  if (result == kNotPermitted) GTEST_SKIP() << "this user may not mount a disk";
  EXPECT_EQ(result, kPassed);
}

}  // namespace
}  // namespace trifinger::test
