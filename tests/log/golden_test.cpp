// SPDX-License-Identifier: BSD-3-Clause
// A log that was written by version 0.1.0 stays readable. A new format gets a file of its own:
//
//     TRIFINGER_WRITE_GOLDEN=tests/log/data/format_2.mcap log_test --gtest_filter='GoldenLog.*'
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <vector>

#include "core/odd_robot.hpp"
#include "log/log_writer.hpp"
#include "log/repair.hpp"
#include "recordings.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::test {
namespace {

constexpr std::int64_t kCreated = 1'795'168'679'000'000'000;
constexpr std::int64_t kMillisecond = 1'000'000;
constexpr TimeIndex kGoldenSteps = 50;
constexpr TimeIndex kGapFirst = 20;
constexpr TimeIndex kGapLast = 29;
constexpr Fault kFault{.code = Fault::Code::kActionLate, .detail = 0, .time_index = kGoldenSteps};

// What was measured, asked, applied and reported at step t. These are formulas, so that only this
// file must stay unchanged.

OddObservation observation_at(TimeIndex t) {
  const auto x = static_cast<float>(t);
  return {.left = {.angle = 0.5F * x, .speed = -x},
          .right = {.angle = 0.25F * x, .speed = 2.0F * x},
          .gears = {{{1, 2}, {3, static_cast<std::int8_t>(t)}}}};
}
OddAction desired_at(TimeIndex t) {
  return {.speed = {0.125F * static_cast<float>(t), 7.0F},
          .gear = {-1, 4},
          .colour = static_cast<std::uint16_t>(1000 + t)};
}
OddAppliedAction applied_at(TimeIndex t) {
  return {.gear = {-1, 3}, .was_clipped = static_cast<std::uint8_t>(t % 2)};
}
std::int64_t time_at(TimeIndex t) { return (100 + t) * kMillisecond + t; }
Status status_at(TimeIndex t) {
  Status status;
  status.time = time_at(t);
  status.tick = t;
  status.lateness = t;
  if (t == kGoldenSteps) {
    status.flags = Status::kEnd;
    status.fault_code = static_cast<std::int32_t>(kFault.code);
  }
  return status;
}
OddLampReading reading_at(TimeIndex i) {
  return {.stamp = {.arrival_index = 3 * i,
                    .capture_index = 3 * i - 2,
                    .arrival_time = time_at(3 * i),
                    .capture_time = time_at(3 * i) - kMillisecond},
          .colour = {static_cast<std::uint16_t>(i), 2, 3},
          .gear = {4, 5}};
}

template <class T>
std::vector<T> range(T (*at)(TimeIndex), TimeIndex first, TimeIndex last) {
  std::vector<T> elements;
  for (TimeIndex t = first; t < last; ++t) elements.push_back(at(t));
  return elements;
}

void write_steps(log::LogWriter& writer, std::size_t session, TimeIndex first, TimeIndex last) {
  const auto desired = range(desired_at, first, last);
  const auto applied = range(applied_at, first, last);
  const auto observations = range(observation_at, first, last);
  const auto statuses = range(status_at, first, last);
  writer.write_steps(session, {.first = first,
                               .count = desired.size(),
                               .desired_actions = desired.data(),
                               .applied_actions = applied.data(),
                               .observations = observations.data(),
                               .statuses = statuses.data()});
}

void write_golden(const std::filesystem::path& path) {
  mcap::FileSink sink = mcap::FileSink::create(path);
  log::LogOptions options;
  options.recording = "golden";
  log::LogWriter writer(sink, options);
  const std::size_t session = writer.begin_session(
      {.name = "odd",
       .session_id = 42,
       .is_real_time = true,
       .period = Nanoseconds(kMillisecond),
       .created = kCreated,
       .time_offset = kCreated,
       .host = "host",
       .backend_pid = 4711,
       .types = describe_robot<OddRobot>(),
       .companions = {{"odd.lamp", "odd_lamp", describe<OddLampReading>()}},
       .documents = {{"configuration.yml", "application/yaml", "colour: red\n"}},
       .first_index = 0});
  write_steps(writer, session, 0, kGapFirst);
  writer.flush();
  writer.write_gap(session, kGapFirst, kGapLast, "the disk was full");
  write_steps(writer, session, kGapLast + 1, kGoldenSteps);
  const auto readings = range(reading_at, 0, 10);
  writer.write_companion(session, 0, 0, readings.size(), readings.data());
  writer.write_event(log::Level::kWarning, "recorder", "the disk is full",
                     kCreated + time_at(kGapFirst));
  const OddObservation last = observation_at(kGoldenSteps);
  writer.write_end(session, kGoldenSteps, &last, status_at(kGoldenSteps));
  writer.end_session(session, kGoldenSteps, kFault, "the action for step 50 came too late");
  writer.finish();
}

std::string bytes_of(const auto& element) {
  return {reinterpret_cast<const char*>(&element), sizeof element};
}

class GoldenLog : public testing::TestWithParam<const char*> {
 protected:
  static void SetUpTestSuite() {
    if (const char* const path = std::getenv("TRIFINGER_WRITE_GOLDEN")) write_golden(path);
  }

  const log::Log log_{std::filesystem::path(TRIFINGER_TEST_DATA) / GetParam()};
  const log::LoggedRobot<OddRobot> robot_{log_, "odd"};
};

TEST_P(GoldenLog, IsWholeAndFinished) {
  EXPECT_TRUE(log::check(log_.files().at(0)).is_whole());
  EXPECT_EQ(log_.lost_bytes(), 0U);
}

TEST_P(GoldenLog, fault_27_HasEveryStepThatWasWritten) {
  for (TimeIndex t = 0; t < kGoldenSteps; ++t) {
    if (t >= kGapFirst && t <= kGapLast) continue;
    SCOPED_TRACE(t);
    EXPECT_EQ(bytes_of(robot_.get_observation(t)), bytes_of(observation_at(t)));
    EXPECT_EQ(bytes_of(robot_.get_desired_action(t)), bytes_of(desired_at(t)));
    EXPECT_EQ(bytes_of(robot_.get_applied_action(t)), bytes_of(applied_at(t)));
  }
  EXPECT_EQ(bytes_of(robot_.get_observation(kGoldenSteps)), bytes_of(observation_at(kGoldenSteps)));
}

TEST_P(GoldenLog, HasTheStatusByTheNamesOfItsFields) {
  // The status may get new fields. The old fields keep their names.
  const log::Column column{.series = Series::kStatus, .fields = {"time", "tick", "lateness"}};
  for (const TimeIndex t : {TimeIndex{0}, kGapFirst - 1, kGapLast + 1, kGoldenSteps}) {
    std::array<std::int64_t, 3> values{};
    robot_.session().get(column, t, 1, values.data());
    EXPECT_EQ(values, (std::array{time_at(t), t, t}));
  }
}

TEST_P(GoldenLog, SaysWhatIsMissing) {
  EXPECT_EQ(robot_.session().gaps(),
            (std::vector<log::Gap>{{kGapFirst, kGapLast, "the disk was full"}}));
  EXPECT_THROW(static_cast<void>(robot_.get_observation(kGapFirst)), log::NotInLog);
}

TEST_P(GoldenLog, SaysWhyTheSessionEnded) {
  EXPECT_EQ(robot_.session().steps(), kGoldenSteps);
  EXPECT_EQ(robot_.session().fault(), kFault);
  EXPECT_EQ(robot_.session().fault_text(), "the action for step 50 came too late");
}

TEST_P(GoldenLog, HasTheCompanionTheDocumentAndTheEvent) {
  const log::LoggedCompanion<OddLampReading> lamp(robot_.companion("lamp"));
  const auto reading = lamp.get_latest_at(10);
  ASSERT_TRUE(reading);
  EXPECT_EQ(bytes_of(*reading), bytes_of(reading_at(3)));

  const log::SessionHeader& header = robot_.session().header();
  EXPECT_EQ(header.documents,
            (std::vector<Document>{{"configuration.yml", "application/yaml", "colour: red\n"}}));
  EXPECT_EQ(header.session_id, 42U);
  EXPECT_EQ(header.created, kCreated);

  ASSERT_EQ(log_.events().size(), 1U);
  EXPECT_EQ(log_.events()[0].text, "the disk is full");
  EXPECT_EQ(log_.events()[0].time, kCreated + time_at(kGapFirst));
}

INSTANTIATE_TEST_SUITE_P(Files, GoldenLog, testing::Values("format_1.mcap"));

TEST(GoldenLogOfToday, IsWrittenByThisVersion) {
  // The expected values describe the files above. This test writes them again, which keeps the
  // values honest.
  const Folder folder;
  write_golden(folder / "golden.mcap");
  const log::LoggedRobot<OddRobot> robot(log::Log(folder / "golden.mcap"));
  EXPECT_EQ(bytes_of(robot.get_observation(kGoldenSteps)), bytes_of(observation_at(kGoldenSteps)));
}

}  // namespace
}  // namespace trifinger::test
