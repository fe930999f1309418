// SPDX-License-Identifier: BSD-3-Clause
#include "log/repair.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "log/copy.hpp"
#include "log/recordings.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/writer.hpp"

namespace trifinger::log {
namespace {

using test::Folder;
using test::OddLampReading;
using test::OddSession;
using test::random_session;
using test::same_bytes;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

std::vector<Gap> gaps_of(const Log& log) { return log.sessions().front().gaps(); }

// ---- check ----

TEST(Check, FindsAWholeFileWhole) {
  const Folder folder;
  test::write_log(folder / "a.mcap", {random_session(1, 60)});
  const FileReport report = check(folder / "a.mcap");
  EXPECT_TRUE(report.is_whole());
  EXPECT_EQ(report.size, std::filesystem::file_size(folder / "a.mcap"));
  EXPECT_EQ(report.messages, 60U + 20U + 1U + 1U);  // steps, readings, the end, an event
}

TEST(Check, fault_25_FindsEveryFlippedBit) {
  const Folder folder;
  test::write_log(folder / "a.mcap", {random_session(1, 60)});
  const test::Bytes whole = test::read_file(folder / "a.mcap");
  std::mt19937 random(1);
  for (int i = 0; i < 500; ++i) {
    test::Bytes damaged = whole;
    const std::size_t place = test::flip(damaged, random);
    test::write_file(folder / "b.mcap", damaged);
    EXPECT_FALSE(check(folder / "b.mcap").is_whole()) << place;
  }
}

// ---- recover ----

TEST(Recover, KeepsAllOfAWholeFile) {
  const Folder folder;
  const OddSession written = random_session(1, 60);
  test::write_log(folder / "a.mcap", {written, random_session(2, 30)});
  const FileReport report = recover(folder / "a.mcap", folder / "b.mcap");
  EXPECT_EQ(report.lost_bytes, 0U);
  EXPECT_TRUE(check(folder / "b.mcap").is_whole());
  const Log log(folder / "b.mcap");
  ASSERT_THAT(log.sessions(), SizeIs(2));
  EXPECT_EQ(test::read_steps(log.sessions()[0]).indices.size(), 60U);
  EXPECT_TRUE(test::is_true(test::read_steps(log.sessions()[0]), written));
  EXPECT_EQ(log.sessions()[0].steps(), 60);
  EXPECT_EQ(log.sessions()[0].header().documents, written.header.documents);
  EXPECT_THAT(log.events(), SizeIs(2));
}

TEST(Recover, fault_24_MakesAWholeFileOfEveryDamagedOneAndWritesDownWhatIsMissing) {
  const Folder folder;
  const OddSession written = random_session(1, 100);
  test::write_log(folder / "whole.mcap", {written}, {}, 10);
  const test::Bytes whole = test::read_file(folder / "whole.mcap");
  std::mt19937 random(1);
  for (int i = 0; i < 100; ++i) {
    test::Bytes damaged = whole;
    if (i % 2 == 0) damaged.resize(whole.size() / 2 + random() % (whole.size() / 2));
    for (int k = 0; k < 2; ++k) (void)test::flip(damaged, random);
    test::write_file(folder / "a.mcap", damaged);
    std::filesystem::remove(folder / "b.mcap");
    const FileReport report = recover(folder / "a.mcap", folder / "b.mcap");
    EXPECT_FALSE(report.is_whole());
    EXPECT_TRUE(check(folder / "b.mcap").is_whole());

    // The gap is written down, and not only detected again.
    std::ptrdiff_t num_records = 0;
    const mcap::Reader recovered(folder / "b.mcap");
    for (const mcap::Metadata& record : recovered.contents().metadata) {
      num_records += record.name == "trifinger.gap" ? 1 : 0;
    }
    const Log before(folder / "a.mcap");
    const LoggedSession broken = before.session();
    EXPECT_EQ(num_records, std::ssize(broken.gaps()) + std::ssize(broken.companion("lamp").gaps()));
    const Log after(folder / "b.mcap");
    ASSERT_THAT(after.sessions(), SizeIs(1));
    const test::FoundSteps found = test::read_steps(after.session());
    EXPECT_EQ(found.indices, test::read_steps(before.session()).indices);
    EXPECT_TRUE(test::is_true(found, written));
    EXPECT_EQ(gaps_of(after), gaps_of(before));
    EXPECT_EQ(after.session().companion("lamp").gaps(), before.session().companion("lamp").gaps());
  }
}

TEST(Recover, WorksForOtherMcapFiles) {
  const Folder folder;
  {
    mcap::FileSink sink = mcap::FileSink::create(folder / "a.mcap");
    mcap::Writer writer(sink, {.profile = "x", .library = "another", .max_chunk_size = 1024});
    const std::uint16_t schema = writer.add_schema("T", "jsonschema", "{}");
    const std::uint16_t channel = writer.add_channel(
        {.schema_id = schema, .topic = "/t", .message_encoding = "json", .metadata = {}});
    const std::vector<std::byte> text(100);
    for (std::uint64_t t = 0; t < 100; ++t) {
      writer.write(mcap::Message{channel, static_cast<std::uint32_t>(t), t, t, text});
    }
    writer.flush();
  }  // no summary
  EXPECT_EQ(recover(folder / "a.mcap", folder / "b.mcap").messages, 100U);
  const mcap::Reader reader(folder / "b.mcap");
  EXPECT_EQ(reader.contents().library, "another");
  EXPECT_EQ(reader.contents().profile, "x");
  EXPECT_EQ(reader.contents().message_count, 100U);
}

TEST(Recover, NeverOverwritesAFileAndLeavesNoneBehindWhenItFails) {
  const Folder folder;
  test::write_log(folder / "a.mcap", {random_session(1, 5)});
  test::write_file(folder / "b.mcap", test::Bytes{'b'});
  EXPECT_THROW(recover(folder / "a.mcap", folder / "b.mcap"), SystemError);
  EXPECT_EQ(test::read_file(folder / "b.mcap"), test::Bytes{'b'});
  EXPECT_THROW(recover(folder / "b.mcap", folder / "c.mcap"), mcap::FormatError);
  EXPECT_FALSE(std::filesystem::exists(folder / "c.mcap"));
}

// ---- copy ----

TEST(Copy, KeepsEverything) {
  const Folder folder;
  for (const bool is_real_time : {true, false}) {
    const OddSession written = random_session(1, 100, is_real_time);
    const std::string name = is_real_time ? "real" : "other";
    test::write_log(folder / (name + ".mcap"), {written, random_session(2, 0)});
    const Log log(folder / (name + ".mcap"));
    copy(log, folder / (name + "2.mcap"));
    EXPECT_TRUE(check(folder / (name + "2.mcap")).is_whole());
    const Log copied(folder / (name + "2.mcap"));
    ASSERT_THAT(copied.sessions(), SizeIs(2));
    const LoggedSession session = copied.sessions()[0];
    const test::FoundSteps found = test::read_steps(session);
    EXPECT_EQ(found.indices.size(), 100U);
    EXPECT_EQ(found.times, test::read_steps(log.sessions()[0]).times);
    EXPECT_TRUE(test::is_true(found, written));
    EXPECT_EQ(session.fault(), log.sessions()[0].fault());
    EXPECT_EQ(session.range(Series::kObservation).second, 101);
    EXPECT_EQ(session.companion("lamp").range(Series::kObservation).second,
              static_cast<TimeIndex>(written.lamp.size()));
    EXPECT_EQ(session.header().documents, written.header.documents);
    EXPECT_THAT(copied.events(), SizeIs(2));
  }
}

TEST(Copy, TakesAPartInWhichEveryReadingIsKnown) {
  const Folder folder;
  const OddSession written = random_session(1, 200);
  const OddSession other = random_session(1, 200, true, "other");  // at an overlapping time
  test::write_log(folder / "a.mcap", {random_session(0, 50), written, other});
  const Log log(folder / "a.mcap");
  std::mt19937 random(1);
  for (int i = 0; i < 20; ++i) {
    const auto first = static_cast<TimeIndex>(random() % 150);
    const auto last = first + 1 + static_cast<TimeIndex>(random() % 50);
    std::filesystem::remove(folder / "b.mcap");
    copy(log, folder / "b.mcap", {.session = "odd", .first = first, .last = last});
    const Log part(folder / "b.mcap");
    ASSERT_THAT(part.sessions(), SizeIs(2));
    const LoggedSession session = part.session("odd");
    const test::FoundSteps found = test::read_steps(session);
    ASSERT_THAT(found.indices, SizeIs(static_cast<std::size_t>(last - first)));
    EXPECT_EQ(found.indices.front(), first);
    EXPECT_TRUE(test::is_true(found, written));
    EXPECT_THAT(session.gaps(), IsEmpty());
    EXPECT_EQ(session.steps(), std::nullopt);

    const LoggedCompanion<OddLampReading> lamp(session.companion("lamp"));
    const LoggedCompanion<OddLampReading> whole(log.session("odd.lamp"));
    for (TimeIndex t = first; t < last; ++t) {
      const std::optional<OddLampReading> expected = whole.get_latest_at(t);
      const std::optional<OddLampReading> reading = lamp.get_latest_at(t);
      ASSERT_EQ(reading.has_value(), expected.has_value()) << t;
      EXPECT_TRUE(!expected || same_bytes(*reading, *expected)) << t;
    }
    // The part contains the other robot's steps from that time, up to the lateness.
    const auto [other_first, other_end] = part.session("other").range(Series::kAppliedAction);
    EXPECT_LE(std::abs(other_first - first), 1);
    EXPECT_LE(std::abs(other_end - last), 1);
  }
}

TEST(Copy, KeepsGapsAndTheEnd) {
  const Folder folder;
  const OddSession written = random_session(1, 100);
  test::write_log_with_gap(folder / "a.mcap", written, 30, 49);
  copy(Log(folder / "a.mcap"), folder / "b.mcap", {.session = "odd", .first = 40, .last = 1000});
  const LoggedSession session = Log(folder / "b.mcap").session();
  EXPECT_THAT(session.gaps(), ElementsAre(Gap{40, 49, "the disk was full"}));
  EXPECT_EQ(session.steps(), 100);
  EXPECT_EQ(session.range(Series::kStatus), std::pair(TimeIndex{40}, TimeIndex{101}));
}

TEST(Copy, WritesSinglePrecisionWhereItIsAskedTo) {
  const Folder folder;
  const OddSession written = random_session(1, 10);
  test::write_log(folder / "a.mcap", {written});
  CopyOptions options;
  options.precision = Precision::kSingle;
  copy(Log(folder / "a.mcap"), folder / "b.mcap", options);
  // The odd robot has no double numbers, so nothing is lost.
  EXPECT_EQ(Log(folder / "b.mcap").origin().at("precision"), "single");
  EXPECT_TRUE(test::is_true(test::read_steps(Log(folder / "b.mcap").session()), written));
}

TEST(Copy, RefusesWhatLeavesNothing) {
  const Folder folder;
  test::write_log(folder / "a.mcap", {random_session(1, 10)});
  const Log log(folder / "a.mcap");
  EXPECT_THROW(copy(log, folder / "b.mcap", {.session = "odd", .first = 20, .last = {}}),
               InvalidArgument);
  EXPECT_THROW(copy(log, folder / "b.mcap", {.session = "odd.lamp"}), InvalidArgument);
  EXPECT_THROW(copy(log, folder / "a.mcap"), SystemError);
  EXPECT_FALSE(std::filesystem::exists(folder / "b.mcap"));
}

}  // namespace
}  // namespace trifinger::log
