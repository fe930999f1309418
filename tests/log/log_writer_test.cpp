// SPDX-License-Identifier: BSD-3-Clause
#include "log/log_writer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/odd_robot.hpp"
#include "log/message_layout.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::test {
namespace {

using log::Level;
using log::LogWriter;
using log::SessionHeader;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Pair;

// A file in memory that can refuse to be written.
class MemorySink final : public mcap::Sink {
 public:
  void append(std::span<const std::byte> more) override {
    if (refuse && refuse()) throw SystemError("write to a sink of the tests", ENOSPC);
    bytes.insert(bytes.end(), more.begin(), more.end());
  }
  void sync() override {}
  [[nodiscard]] std::uint64_t size() const noexcept override { return bytes.size(); }

  std::vector<std::byte> bytes;
  std::function<bool()> refuse;
};

// Repeats the call until the sink accepts it.
template <class Call>
auto insist(const Call& call) {
  while (true) {
    try {
      return call();
    } catch (const SystemError& error) {
      EXPECT_EQ(error.error_number(), ENOSPC);
    }
  }
}

SessionHeader odd_header(std::uint64_t id = 7) {
  SessionHeader header;
  header.name = "odd";
  header.session_id = id;
  header.period = std::chrono::milliseconds(2);
  header.created = 1'700'000'000'000'000'000;
  header.time_offset = header.created;
  header.host = "here";
  header.types = describe_robot<OddRobot>();
  header.companions = {
      {.name = "odd.lamp", .type = "odd_lamp", .element = describe<OddLampReading>()}};
  header.documents = {{"model.xml", "application/xml", "<mujoco/>"}};
  return header;
}

// The content of a session of a few steps.
struct OddSteps {
  static constexpr std::size_t kCount = 40;
  std::array<OddAction, kCount> actions{};
  std::array<OddAppliedAction, kCount> applied{};
  std::array<OddObservation, kCount> observations{};
  std::array<Status, kCount> statuses{};
  std::array<OddLampReading, kCount / 4> lamp{};

  OddSteps() {
    for (std::size_t i = 0; i < kCount; ++i) {
      actions[i].colour = static_cast<std::uint16_t>(i);
      observations[i].left.angle = static_cast<float>(i) * 0.5F;
      statuses[i].time = static_cast<std::int64_t>(i) * 1000;
    }
    for (std::size_t i = 0; i < lamp.size(); ++i) {
      lamp[i].stamp = {.arrival_index = static_cast<TimeIndex>(4 * i + 2),
                       .capture_index = static_cast<TimeIndex>(4 * i)};
    }
  }
  [[nodiscard]] LogWriter::Steps steps(std::size_t first, std::size_t count) const {
    return {.first = static_cast<TimeIndex>(first),
            .count = count,
            .desired_actions = &actions[first],
            .applied_actions = &applied[first],
            .observations = &observations[first],
            .statuses = &statuses[first]};
  }
};

// Writes a whole session in which everything happens that may happen.
void write_session(LogWriter& writer, const SessionHeader& header) {
  const OddSteps odd;
  const std::size_t session = insist([&] { return writer.begin_session(header); });
  writer.write_companion(session, 0, 0, odd.lamp.size(), odd.lamp.data());
  writer.write_steps(session, odd.steps(0, 20));
  insist([&] { writer.flush(); });
  insist([&] { writer.write_gap(session, 20, 24, "for a test"); });
  insist([&] { writer.write_companion_gap(session, 0, 10, 11, "for another"); });
  writer.write_event(Level::kWarning, "odd", "a gap", 1'700'000'001'000'000'002);
  writer.write_steps(session, odd.steps(25, 15));
  writer.write_end(session, 40, odd.observations.data(), odd.statuses[0]);
  insist([&] {
    writer.end_session(session, 40, {.code = Fault::Code::kStopped, .time_index = 40}, "stopped");
  });
}

struct Content {
  std::vector<std::string> messages;  // topics, times and bytes
  std::vector<mcap::Metadata> metadata;
  std::vector<mcap::Attachment> attachments;
  bool is_finished{false};
};

Content content_of(const MemorySink& sink) {
  mcap::Reader reader(mcap::open_memory(sink.bytes));
  Content content;
  for (std::size_t i = 0; i < reader.contents().chunks.size(); ++i) {
    const auto messages = reader.read_chunk(i);
    for (const mcap::Message& message : messages.value()) {
      content.messages.push_back(
          reader.contents().channels.at(message.channel_id).topic + " " +
          std::to_string(message.log_time) + " " + std::to_string(message.publish_time) + " " +
          std::string(reinterpret_cast<const char*>(message.data.data()), message.data.size()));
    }
  }
  content.metadata = reader.contents().metadata;
  for (mcap::Metadata& record : content.metadata) record.entries.erase("created");
  content.attachments = reader.contents().attachments;
  for (mcap::Attachment& attachment : content.attachments) attachment.log_time = 0;
  content.is_finished = reader.contents().is_finished;
  EXPECT_TRUE(reader.contents().damage.empty());
  return content;
}

const mcap::Metadata& record_of(const Content& content, const std::string& name) {
  for (const mcap::Metadata& record : content.metadata) {
    if (record.name == name) return record;
  }
  throw Error("there is no record " + name);
}

TEST(LogWriter, WritesTheSameHoweverOftenTheSinkRefuses) {
  MemorySink patient;
  LogWriter plain(patient, {.recording = "r"});
  write_session(plain, odd_header());
  plain.finish();
  const Content expected = content_of(patient);
  EXPECT_EQ(expected.messages.size(), 20 + 15 + 10 + 1 + 1);

  for (unsigned seed = 0; seed < 50; ++seed) {
    std::mt19937 random(seed);
    MemorySink moody;
    // If the first bytes of a file fail, the caller has to try again.
    LogWriter writer(moody, {.recording = "r"});
    moody.refuse = [&random] { return random() % 2 == 0; };
    write_session(writer, odd_header());
    insist([&] { writer.finish(); });
    const Content found = content_of(moody);
    EXPECT_EQ(found.messages, expected.messages);
    EXPECT_EQ(found.metadata, expected.metadata);
    EXPECT_EQ(found.attachments, expected.attachments);
    EXPECT_TRUE(found.is_finished);
  }
}

TEST(LogWriter, GoesOnWithAFileWithoutSayingAnythingTwice) {
  MemorySink whole;
  LogWriter plain(whole, {.recording = "r"});
  const std::size_t first = plain.begin_session(odd_header());
  const OddSteps odd;
  plain.write_steps(first, odd.steps(0, 10));
  plain.flush();

  const mcap::Reader reader(mcap::open_memory(whole.bytes));
  MemorySink rest;
  rest.bytes.assign(
      whole.bytes.begin(),
      whole.bytes.begin() + static_cast<std::ptrdiff_t>(reader.contents().complete_size));
  LogWriter again(rest, {.recording = "other"}, reader.contents());
  const std::size_t session = again.begin_session(odd_header());
  again.write_steps(session, odd.steps(10, 10));
  again.finish();

  const Content found = content_of(rest);
  EXPECT_EQ(found.messages.size(), 20);
  EXPECT_EQ(found.metadata.size(), 2);  // the file and the session, once each
  EXPECT_THAT(record_of(found, "trifinger.log").entries, Contains(Pair("recording", "r")));
  EXPECT_EQ(found.attachments.size(), 1);
  EXPECT_TRUE(found.is_finished);
}

TEST(LogWriter, TellsOfASessionWhatTheFormatSays) {
  MemorySink sink;
  LogWriter writer(sink, {.precision = log::Precision::kSingle, .recording = "r", .part = 3});
  write_session(writer, odd_header());
  writer.finish();
  const Content found = content_of(sink);
  const auto& file = record_of(found, "trifinger.log").entries;
  EXPECT_THAT(file, Contains(Pair("format_version", "1")));
  EXPECT_THAT(file, Contains(Pair("part", "3")));
  EXPECT_THAT(file, Contains(Pair("precision", "single")));
  const auto& session = record_of(found, "trifinger.session").entries;
  EXPECT_THAT(session, Contains(Pair("name", "odd")));
  EXPECT_THAT(session, Contains(Pair("type", "odd")));
  EXPECT_THAT(session, Contains(Pair("session_id", "7")));
  EXPECT_THAT(session, Contains(Pair("is_real_time", "0")));
  EXPECT_THAT(session, Contains(Pair("period", "2000000")));
  EXPECT_THAT(session, Contains(Pair("companions", "odd.lamp")));
  EXPECT_THAT(session, Contains(Pair("companion_first_indices", "0")));
  const auto& gap = record_of(found, "trifinger.gap").entries;
  EXPECT_THAT(gap, ElementsAre(Pair("first", "20"), Pair("last", "24"), Pair("name", "odd"),
                               Pair("reason", "for a test"), Pair("session_id", "7")));
  const auto& end = record_of(found, "trifinger.end").entries;
  EXPECT_THAT(end, Contains(Pair("steps", "40")));
  EXPECT_THAT(end, Contains(Pair("observations", "41")));
  EXPECT_THAT(end, Contains(Pair("fault", "stopped")));
  EXPECT_EQ(found.attachments.at(0).name, "odd.model.xml");
  EXPECT_EQ(found.attachments.at(0).data, "<mujoco/>");
}

TEST(LogWriter, WritesADocumentAgainOnlyIfItHasChanged) {
  MemorySink sink;
  LogWriter writer(sink, {});
  write_session(writer, odd_header(1));
  write_session(writer, odd_header(2));
  SessionHeader changed = odd_header(3);
  changed.documents[0].text = "<mujoco model='new'/>";
  write_session(writer, changed);
  writer.finish();
  EXPECT_EQ(content_of(sink).attachments.size(), 2);
}

TEST(LogWriter, GivesSimulatedStepsTheirSimulatedTimes) {
  MemorySink sink;
  LogWriter writer(sink, {});
  const std::size_t session = writer.begin_session(odd_header());
  writer.write_steps(session, OddSteps().steps(5, 1));
  writer.finish();
  EXPECT_THAT(content_of(sink).messages.at(0),
              testing::StartsWith("/odd/step 1700000000010000000 1700000000010000000 "));
}

TEST(LogWriter, GivesRealStepsTheTimeAtWhichTheyWereMeasured) {
  MemorySink sink;
  LogWriter writer(sink, {});
  SessionHeader header = odd_header();
  header.is_real_time = true;
  header.time_offset = 1'000'000;
  const std::size_t session = writer.begin_session(header);
  writer.write_steps(session, OddSteps().steps(5, 1));
  writer.finish();
  EXPECT_THAT(content_of(sink).messages.at(0), testing::StartsWith("/odd/step 1005000 1005000 "));
}

TEST(LogWriter, WritesNotANumberWhereTheLastObservationIsMissing) {
  MemorySink sink;
  LogWriter writer(sink, {});
  const std::size_t session = writer.begin_session(odd_header());
  writer.write_end(session, 0, nullptr, {});
  writer.end_session(session, 0, {.code = Fault::Code::kDriver}, "");
  writer.finish();
  EXPECT_THAT(record_of(content_of(sink), "trifinger.end").entries,
              Contains(Pair("observations", "0")));
  mcap::Reader reader(mcap::open_memory(sink.bytes));
  const auto messages = reader.read_chunk(0);
  const log::MessageLayout layout =
      log::end_layout(describe_robot<OddRobot>(), describe<Status>(), log::Precision::kDouble);
  OddObservation observation;
  layout.decode(messages.value().front().data, log::kObservation, &observation);
  EXPECT_TRUE(std::isnan(observation.left.angle));
  EXPECT_EQ(observation.gears[0][0], 0);
}

TEST(LogWriter, RefusesNamesThatALogCannotHaveAndGoesOn) {
  MemorySink sink;
  LogWriter writer(sink, {});
  SessionHeader header = odd_header();
  header.types.type = "1";
  EXPECT_THROW(writer.begin_session(header), InvalidArgument);
  write_session(writer, odd_header());
  writer.finish();
  EXPECT_EQ(record_of(content_of(sink), "trifinger.session").entries.at("type"), "odd");
}

TEST(LogWriter, RefusesStepsOfASessionThatHasEnded) {
  MemorySink sink;
  LogWriter writer(sink, {});
  const std::size_t session = writer.begin_session(odd_header());
  writer.end_session(session, 0, {}, "");
  EXPECT_THROW(writer.write_steps(session, OddSteps().steps(0, 1)), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::test
