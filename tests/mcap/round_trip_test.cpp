// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "mcap/files.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/writer.hpp"

namespace trifinger::mcap::test {
namespace {

// One operation on a writer.
struct Action {
  enum class Kind { kMessage, kMetadata, kAttachment, kFlush };

  Kind kind{Kind::kMessage};
  int topic{0};
  std::uint64_t time{0};
  std::string data;
};

std::ostream& operator<<(std::ostream& stream, const Action& action) {
  return stream << "{kind " << static_cast<int>(action.kind) << ", topic " << action.topic
                << ", time " << action.time << ", " << action.data.size() << " bytes}";
}

rc::Gen<std::vector<Action>> any_actions() {
  using Kind = Action::Kind;
  return rc::gen::container<std::vector<Action>>(rc::gen::build<Action>(
      rc::gen::set(&Action::kind, rc::gen::weightedElement<Kind>({{20, Kind::kMessage},
                                                                  {1, Kind::kMetadata},
                                                                  {1, Kind::kAttachment},
                                                                  {2, Kind::kFlush}})),
      rc::gen::set(&Action::topic, rc::gen::inRange(0, 6)), rc::gen::set(&Action::time),
      rc::gen::set(&Action::data)));
}

WriterOptions any_options() {
  return {
      .profile = "test",
      .library = "round trip",
      .compression = *rc::gen::element(Compression::kNone, Compression::kLz4, Compression::kZstd),
      .level = *rc::gen::inRange(1, 8),
      .max_chunk_size = *rc::gen::element<std::size_t>(1, 100, 1000, std::size_t{1} << 20)};
}

void act(const Action& action, Writer& writer, RecordingWriter& recorder) {
  static const std::string topics[] = {"A", "B", "C", "/a", "/b", "/c"};
  switch (action.kind) {
    case Action::Kind::kMessage:
      recorder.write(topics[action.topic], action.time, action.data);
      break;
    case Action::Kind::kMetadata:
      recorder.write(Metadata{.name = topics[action.topic],
                              .entries = {{"time", std::to_string(action.time)}}});
      break;
    case Action::Kind::kAttachment:
      recorder.write(Attachment{.log_time = action.time,
                                .create_time = action.time / 2,
                                .name = topics[action.topic],
                                .media_type = "application/octet-stream",
                                .data = action.data});
      break;
    case Action::Kind::kFlush:
      writer.flush();
      break;
  }
}

void require_consistent(Reader& reader, const Everything& everything) {
  const Contents& contents = reader.contents();
  RC_ASSERT(contents.damage.empty());
  RC_ASSERT(contents.profile == "test");
  RC_ASSERT(contents.library == "round trip");
  RC_ASSERT(contents.message_count == everything.messages.size());
  std::map<std::string, std::uint64_t> counts;
  for (const StoredMessage& message : everything.messages) ++counts[message.topic];
  RC_ASSERT(contents.channels.size() == counts.size());
  for (const auto& [id, channel] : contents.channels) {
    RC_ASSERT(contents.channel_message_counts.at(id) == counts.at(channel.topic));
    RC_ASSERT(channel.metadata.at("topic") == channel.topic);
    if (channel.schema_id != 0) {
      RC_ASSERT(contents.schemas.at(channel.schema_id).name == "test_msgs/msg/" + channel.topic);
    }
  }
  RC_ASSERT(read_everything(reader) == everything);
  RC_ASSERT(contents.damage.empty());
}

TEST(RoundTrip, GivesBackAllThatWasWritten) {
  EXPECT_TRUE(rc::check([](bool finishes, bool verifies) {
    MemorySink sink;
    Writer writer(sink, any_options());
    RecordingWriter recorder(writer);
    for (const Action& action : *any_actions()) act(action, writer, recorder);
    finishes ? writer.finish() : writer.flush();

    Reader reader = read_bytes(sink.bytes(), {.verify = verifies});
    RC_ASSERT(reader.contents().is_finished == finishes);
    RC_ASSERT(reader.contents().complete_size == sink.size());
    require_consistent(reader, recorder.everything());
  }));
}

TEST(RoundTrip, TellsTheTimesAndChannelsOfEachChunk) {
  EXPECT_TRUE(rc::check([](bool finishes) {
    MemorySink sink;
    Writer writer(sink, any_options());
    RecordingWriter recorder(writer);
    for (const Action& action : *any_actions()) act(action, writer, recorder);
    finishes ? writer.finish() : writer.flush();

    Reader reader = read_bytes(sink.bytes());
    for (std::size_t i = 0; i < reader.contents().chunks.size(); ++i) {
      const ChunkPlace place = reader.contents().chunks[i];
      std::uint64_t first_time = UINT64_MAX;
      std::uint64_t last_time = 0;
      std::set<std::uint16_t> channels;
      const auto messages = reader.read_chunk(i).value();
      for (const Message& message : messages) {
        first_time = std::min(first_time, message.log_time);
        last_time = std::max(last_time, message.log_time);
        channels.insert(message.channel_id);
      }
      std::set<std::uint16_t> indexed;
      for (const auto& [channel, offset] : place.indexes) indexed.insert(channel);
      RC_ASSERT(place.first_time == first_time);
      RC_ASSERT(place.last_time == last_time);
      RC_ASSERT(indexed == channels);
    }
  }));
}

// fault_23: refusals of the sink do not change the bytes.
TEST(RoundTrip, fault_23_WritesTheSameBytesHoweverOftenTheSinkRefusesThem) {
  EXPECT_TRUE(rc::check([](bool finishes) {
    const WriterOptions options = any_options();
    const auto actions = *any_actions();
    const auto refusals = *rc::gen::container<std::vector<bool>>(rc::gen::arbitrary<bool>());

    const auto write = [&](MemorySink& sink, const auto& until_done) {
      Writer writer(sink, options);
      RecordingWriter recorder(writer);
      for (const Action& action : actions) until_done([&] { act(action, writer, recorder); });
      if (finishes) until_done([&] { writer.finish(); });
      until_done([&] {
        if (!finishes) writer.flush();
      });
    };
    MemorySink good;
    write(good, [](const auto& step) { step(); });

    MemorySink bad;
    std::size_t num_appends = 0;
    bad.before_append = [&] {
      ++num_appends;
      // The first append writes the header.
      if (num_appends > 1 && num_appends < refusals.size() && refusals[num_appends]) {
        throw SystemError("write to a log", ENOSPC);
      }
    };
    write(bad, [](const auto& step) {
      for (;;) {
        try {
          return step();
        } catch (const SystemError&) {
        }
      }
    });
    RC_ASSERT(bad.bytes() == good.bytes());
  }));
}

// fault_22: nothing is lost either if the caller continues without trying again.
TEST(RoundTrip, fault_22_LosesNothingIfMessagesFollowAFlushThatFailed) {
  EXPECT_TRUE(rc::check([] {
    MemorySink sink;
    Writer writer(sink, any_options());
    RecordingWriter recorder(writer);
    int num_failures = 0;
    for (const Action& action : *any_actions()) {
      const bool fails = *rc::gen::arbitrary<bool>();
      sink.before_append = [fails] {
        if (fails) throw SystemError("write to a log", EIO);
      };
      try {
        act(action, writer, recorder);
      } catch (const SystemError&) {
        ++num_failures;
      }
    }
    sink.before_append = nullptr;
    writer.finish();
    Reader reader = read_bytes(sink.bytes());
    RC_CLASSIFY(num_failures > 0);
    RC_ASSERT(read_everything(reader) == recorder.everything());
  }));
}

}  // namespace
}  // namespace trifinger::mcap::test
