// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/mcap/writer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mcap/chunk_loader.hpp"
#include "mcap/files.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::mcap::test {
namespace {

TEST(Writer, GivesTheSameIdForTheSameSchema) {
  MemorySink sink;
  Writer writer(sink, {});
  const std::uint16_t id = writer.add_schema("a/msg/B", "ros2msg", "int32 x");
  EXPECT_GT(id, 0);
  EXPECT_EQ(writer.add_schema("a/msg/B", "ros2msg", "int32 x"), id);
  EXPECT_NE(writer.add_schema("a/msg/B", "ros2msg", "int64 x"), id);
}

TEST(Writer, GivesTheSameIdForTheSameChannel) {
  MemorySink sink;
  Writer writer(sink, {});
  const Channel channel{.topic = "/a", .message_encoding = "cdr", .metadata = {{"k", "v"}}};
  const std::uint16_t id = writer.add_channel(channel);
  EXPECT_EQ(writer.add_channel(channel), id);
  EXPECT_NE(writer.add_channel({.topic = "/a", .message_encoding = "cdr"}), id);
}

TEST(Writer, fault_82_ThatWasMovedFromSaysSo) {
  MemorySink sink;
  Writer moved(sink, {});
  Writer writer(std::move(moved));
  // NOLINTNEXTLINE(bugprone-use-after-move): this is what the test is about
  EXPECT_THROW(moved.flush(), InvalidArgument);
  writer.finish();
}

TEST(Writer, RefusesWhatMakesNoSense) {
  MemorySink sink;
  Writer writer(sink, {});
  EXPECT_THROW(writer.add_channel({.schema_id = 7, .topic = "/a"}), InvalidArgument);
  EXPECT_THROW(writer.add_channel({.topic = "\xFF"}), InvalidArgument);
  EXPECT_THROW(writer.write({.channel_id = 1}), InvalidArgument);
  EXPECT_THROW(writer.write(Metadata{"m", {{"crc32", "0"}}}), InvalidArgument);
  EXPECT_THROW(writer.write(Metadata{"\xC3", {}}), InvalidArgument);
  EXPECT_THROW(Writer(sink, {}), InvalidArgument) << "the sink is not empty";
  MemorySink empty;
  EXPECT_THROW(Writer(empty, {.level = 20}), InvalidArgument);
  EXPECT_THROW(Writer(empty, {.compression = Compression::kLz4, .level = 0}), InvalidArgument);
}

TEST(Writer, CanWriteAnySchemaData) {
  MemorySink sink;
  Writer writer(sink, {});
  const std::string data("\xFF\x00\x80", 3);
  const std::uint16_t schema = writer.add_schema("a", "protobuf", data);
  writer.write({.channel_id = writer.add_channel({.schema_id = schema, .topic = "/a"})});
  writer.finish();
  EXPECT_EQ(read_bytes(sink.bytes()).contents().schemas.at(schema).data, data);
}

TEST(Writer, WritesNothingAfterTheEnd) {
  MemorySink sink;
  Writer writer(sink, {});
  const std::uint16_t channel = writer.add_channel({.topic = "/a"});
  writer.finish();
  const std::uint64_t size = sink.size();
  EXPECT_THROW(writer.write({.channel_id = channel}), InvalidArgument);
  EXPECT_THROW(writer.write(Metadata{}), InvalidArgument);
  EXPECT_THROW(writer.flush(), InvalidArgument);
  EXPECT_THROW(writer.finish(), InvalidArgument);
  EXPECT_EQ(sink.size(), size);
}

TEST(Writer, LeavesAnUnfinishedFileReadable) {
  MemorySink sink;
  {
    Writer writer(sink, {});
    RecordingWriter recorder(writer);
    recorder.write("/a", 1, "written");
    writer.flush();
    recorder.write("/a", 2, "lost");
  }
  Reader reader = read_bytes(sink.bytes());
  EXPECT_EQ(read_everything(reader).messages.size(), 1U);
  EXPECT_FALSE(reader.contents().is_finished);
}

TEST(Writer, ClosesAChunkBeforeItIsTooLarge) {
  MemorySink sink;
  Writer writer(sink, {.compression = Compression::kNone, .max_chunk_size = 1000});
  RecordingWriter recorder(writer);
  for (std::uint64_t i = 0; i < 100; ++i) {
    recorder.write("/a", i, std::string(i == 50 ? 5000 : 100, 'x'));
    EXPECT_LE(writer.open_chunk_size(), i == 50 ? 6000U : 1000U);
  }
  writer.finish();
  Reader reader = read_bytes(sink.bytes());
  EXPECT_GT(reader.contents().chunks.size(), 10U);
  for (const ChunkPlace& place : reader.contents().chunks) {
    EXPECT_TRUE(place.uncompressed_size <= 1000 || place.uncompressed_size > 5000);
  }
  EXPECT_EQ(read_everything(reader), recorder.everything());
}

TEST(Writer, RepeatsSchemasAndChannelsInTheNextAndInEveryHundredthChunk) {
  MemorySink sink;
  Writer writer(sink, {});
  RecordingWriter recorder(writer);
  for (std::uint64_t chunk = 0; chunk < 250; ++chunk) {
    recorder.write("Common", chunk, "c");
    if (chunk == 5) recorder.write("Rare", chunk, "r");
    writer.flush();
  }
  const auto source = open_memory(sink.bytes());
  ChunkLoader loader(*source, 1 << 20);
  const Reader reader = read_bytes(sink.bytes());
  ASSERT_EQ(reader.contents().chunks.size(), 250U);
  for (std::size_t chunk = 0; chunk < 250; ++chunk) {
    ASSERT_EQ(loader.load(reader.contents().chunks[chunk]), "");
    const bool is_first = chunk == 0 || chunk == 5;
    const bool is_next = chunk == 1 || chunk == 6;
    EXPECT_EQ(loader.definitions().size(), is_first || is_next ? 2U
                                           : chunk % 100 == 0  ? 4U
                                                               : 0U)
        << "chunk " << chunk;
  }
}

TEST(Writer, LetsTheChannelsOfAFileWithoutBeginningAndSummaryBeFound) {
  MemorySink sink;
  Writer writer(sink, {});
  RecordingWriter recorder(writer);
  for (std::uint64_t chunk = 0; chunk < 150; ++chunk) {
    recorder.write("Step", chunk, std::to_string(chunk));
    writer.flush();
  }
  std::vector<std::byte> bytes = sink.bytes();
  const Reader whole = read_bytes(bytes);
  const std::uint64_t begin = whole.contents().chunks.at(0).offset;
  const std::uint64_t end = whole.contents().chunks.at(2).offset;
  std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(begin), end - begin, std::byte{0});

  Reader reader = read_bytes(bytes);
  EXPECT_EQ(reader.contents().channels, whole.contents().channels);
  EXPECT_EQ(reader.contents().schemas, whole.contents().schemas);
  EXPECT_EQ(read_everything(reader).messages.size(), 148U);
}

TEST(Writer, AllocatesNothingPerMessage) {
  MemorySink sink;
  Writer writer(sink, {});
  const std::uint16_t channel = writer.add_channel({.topic = "/a"});
  const std::string data(500, 'x');
  const auto write_messages = [&] {
    for (std::uint64_t i = 0; i < 1000; ++i) {
      writer.write({.channel_id = channel, .log_time = i, .data = bytes_of(data)});
    }
  };
  write_messages();
  writer.flush();
  const trifinger::test::AllocationCounter allocations;
  write_messages();
  EXPECT_EQ(allocations.count(), 0U);
}

}  // namespace
}  // namespace trifinger::mcap::test
