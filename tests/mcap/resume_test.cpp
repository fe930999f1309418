// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "mcap/files.hpp"
#include "support/sanitizers.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/writer.hpp"

namespace trifinger::mcap::test {
namespace {

// Cuts the file, continues and finishes it. Returns what was written to it afterwards.
Everything go_on(std::span<const std::byte> cut, MemorySink& sink) {
  Reader reader = read_bytes(cut);
  Everything everything = read_everything(reader);
  sink = MemorySink(cut.first(reader.contents().complete_size));
  Writer writer(sink, {.profile = "ros2", .library = "sample"}, reader.contents());
  RecordingWriter recorder(writer);
  recorder.write("Step", 2'000'000'000'000'000'000, "continued");
  recorder.write("New", 2'000'000'000'000'000'001, "continued");
  recorder.write(Metadata{"continued", {{"a", "b"}}});
  recorder.write(Attachment{.name = "continued.txt", .data = "continued"});
  recorder.write("/bare", 2'000'000'000'000'000'002, "continued");
  writer.finish();
  const Everything& added = recorder.everything();
  everything.messages.insert(everything.messages.end(), added.messages.begin(),
                             added.messages.end());
  everything.metadata.insert(everything.metadata.end(), added.metadata.begin(),
                             added.metadata.end());
  everything.attachments.insert(everything.attachments.end(), added.attachments.begin(),
                                added.attachments.end());
  return everything;
}

// The index must be like that of a file written at once; otherwise viewers refuse the file.
void expect_whole(const MemorySink& sink, const Everything& everything) {
  for (const bool verify : {false, true}) {
    Reader reader = read_bytes(sink.bytes(), {.verify = verify});
    const Contents& contents = reader.contents();
    ASSERT_TRUE(contents.is_finished);
    ASSERT_TRUE(contents.damage.empty()) << contents.damage[0].reason;
    ASSERT_EQ(contents.message_count, everything.messages.size());
    ASSERT_EQ(contents.profile, "ros2");
    ASSERT_EQ(read_everything(reader), everything);
    ASSERT_TRUE(contents.damage.empty()) << contents.damage[0].reason;
    for (std::size_t i = 0; i < contents.chunks.size(); ++i) {
      std::set<std::uint16_t> used;
      const auto messages = reader.read_chunk(i).value();
      for (const Message& message : messages) used.insert(message.channel_id);
      std::set<std::uint16_t> indexed;
      for (const auto& [channel, offset] : contents.chunks[i].indexes) indexed.insert(channel);
      ASSERT_EQ(indexed, used) << "chunk " << i;
    }
  }
}

TEST(Resuming, fault_24_FinishesAFileThatWasCutAnywhereAsIfItHadNotBeen) {
  constexpr std::size_t kStride = trifinger::test::kHasSanitizer ? 5 : 1;
  for (const Compression compression : kCompressions) {
    const Sample sample = make_sample(compression, true);
    for (std::size_t size = 1; size < sample.bytes.size(); size += kStride) {
      SCOPED_TRACE(std::string(name_of(compression)) + " " + std::to_string(size) + " bytes");
      MemorySink sink;
      const Everything everything = go_on(std::span(sample.bytes).first(size), sink);
      ASSERT_NO_FATAL_FAILURE(expect_whole(sink, everything));
    }
  }
}

TEST(Resuming, CanBeDoneAgainAndAgain) {
  const Sample sample = make_sample(Compression::kZstd, false);
  Everything everything;
  std::vector<std::byte> bytes = sample.bytes;
  for (int i = 0; i < 5; ++i) {
    // Half of the summary is cut off each time, so all of it is lost.
    MemorySink sink;
    everything = go_on(bytes, sink);
    expect_whole(sink, everything);
    bytes.assign(sink.bytes().begin(), sink.bytes().end() - 100);
  }
  EXPECT_EQ(everything.metadata.size(), 3U + 5U);
  EXPECT_EQ(everything.messages.size(), sample.everything.messages.size() + 5 * 3);
}

TEST(Resuming, KeepsTheIdsOfChannels) {
  const Sample sample = make_sample(Compression::kZstd, false);
  const Reader before = read_bytes(sample.bytes);
  MemorySink sink;
  static_cast<void>(go_on(sample.bytes, sink));
  const Reader after = read_bytes(sink.bytes());
  for (const auto& [id, channel] : before.contents().channels) {
    EXPECT_EQ(after.contents().channels.at(id), channel);
  }
  EXPECT_EQ(after.contents().channels.size(), before.contents().channels.size() + 1);
}

TEST(Resuming, LeavesDamageInTheMiddleWhereItIs) {
  Sample sample = make_sample(Compression::kZstd, false);
  const Reader whole = read_bytes(sample.bytes);
  const ChunkPlace place = whole.contents().chunks.at(2);
  sample.bytes[place.offset + 1] ^= std::byte{4};  // its length
  MemorySink sink;
  const Everything everything = go_on(sample.bytes, sink);
  EXPECT_EQ(everything.messages.size(), sample.everything.messages.size() - 5 + 3);

  Reader reader = read_bytes(sink.bytes());
  EXPECT_TRUE(reader.contents().is_finished);
  EXPECT_EQ(reader.contents().message_count, everything.messages.size());
  EXPECT_EQ(read_everything(reader), everything);
  ASSERT_EQ(reader.contents().damage.size(), 1U);
  EXPECT_EQ(reader.contents().damage[0].offset, place.offset);
}

TEST(Resuming, IsRefusedWhenTheFileIsFinishedOrOfAnotherSize) {
  const Sample finished = make_sample(Compression::kZstd, true);
  MemorySink sink(finished.bytes);
  EXPECT_THROW(Writer(sink, {}, read_bytes(finished.bytes).contents()), InvalidArgument);

  const Sample sample = make_sample(Compression::kZstd, false);
  MemorySink longer(finished.bytes);
  EXPECT_THROW(Writer(longer, {}, read_bytes(sample.bytes).contents()), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::mcap::test
