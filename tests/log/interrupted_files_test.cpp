// SPDX-License-Identifier: BSD-3-Clause
#include "support/interrupted_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <optional>
#include <random>
#include <span>

#include "core/named_robot.hpp"
#include "log/recorder_under_test.hpp"
#include "log/recordings.hpp"
#include "support/session_folder.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/sink.hpp"

namespace trifinger::test {
namespace {

using ::testing::IsEmpty;

TEST(InterruptedFiles, fault_23_HoldEveryByte) {
  const Folder folder;
  const InterruptedFiles interruptions;
  std::mt19937 random(1);
  Bytes written;
  std::optional<mcap::FileSink> sink = mcap::FileSink::create(folder / "a");
  for (int i = 0; i < 50; ++i) {
    const Bytes part(random() % 10'000, static_cast<char>(i));
    sink->append(std::as_bytes(std::span(part)));
    sink->sync();
    written.insert(written.end(), part.begin(), part.end());
    if (i % 10 != 9) continue;
    // Continues in the middle of what was written.
    written.resize(random() % written.size());
    sink.reset();
    sink = mcap::FileSink::resume(folder / "a", written.size());
  }
  EXPECT_EQ(read_file(folder / "a"), written);
  EXPECT_GT(interruptions.count(), 100);
}

TEST(InterruptedFiles, fault_23_AreReadToTheLastStep) {
  const OddSession session = random_session(2, 500);
  const Folder folder;
  const InterruptedFiles interruptions;
  write_log(folder / "a.mcap", {session});
  const log::Log log(folder / "a.mcap");
  EXPECT_TRUE(log.is_finished());
  EXPECT_THAT(log.damage(), IsEmpty());
  const FoundSteps found = read_steps(log.session());
  EXPECT_EQ(found.indices.size(), 500U);
  EXPECT_TRUE(is_true(found, session));
  EXPECT_GT(interruptions.count(), 10);
}

TEST(InterruptedFiles, fault_23_CostARecorderNothing) {
  const SessionFolder sessions;
  const Folder logs;
  const InterruptedFiles interruptions;
  const NamedRobot backend("robot", {.history = 131072}, kRealTime);
  Frontend<FakeRobot> robot(backend.host());
  robot.append_desired_action({});
  for (int round = 1; round <= 2; ++round) {  // the second round continues after the first
    RecorderUnderTest recorder({"robot"}, {.folder = logs.path(),
                                           .rotate_size = 100'000,
                                           .keep_free = 0,
                                           .sync_period = std::chrono::milliseconds(10)});
    recorder.wait_for_step(round * 1000);
    recorder.stop();
    EXPECT_EQ(recorder.count_events("cannot"), 0U) << recorder.all_events();
  }
  EXPECT_GT(interruptions.count(), 10);
  const Recorded log(logs.path());
  EXPECT_GT(log.files.size(), 1U);
  EXPECT_GE(log.first().steps.size(), 2000U);
  EXPECT_THAT(log.first().holes(), IsEmpty());
  EXPECT_TRUE(log.first().is_ordered());
  EXPECT_EQ(log.damages, 0U);
}

}  // namespace
}  // namespace trifinger::test
