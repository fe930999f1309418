// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/mcap/reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "mcap/encoding.hpp"
#include "mcap/files.hpp"
#include "support/allocation_counter.hpp"
#include "support/session_folder.hpp"

namespace trifinger::mcap::test {
namespace {

using testing::HasSubstr;

std::string refusal_of(const std::string& bytes) {
  try {
    static_cast<void>(read_bytes(bytes_of(bytes)));
  } catch (const FormatError& error) {
    return error.what();
  }
  return "not refused";
}

TEST(Reader, RefusesWhatIsNoMcapFile) {
  EXPECT_THAT(refusal_of("#ROSBAG V2.0\n and so on"),
              HasSubstr("no MCAP file: it begins with the bytes 23 52 4f 53 42 41 47 20"));
  EXPECT_THAT(refusal_of("abc"), HasSubstr("no MCAP file"));
}

TEST(Reader, fault_27_RefusesALaterVersion) {
  EXPECT_THAT(refusal_of("\x89MCAP1\r\n and so on"),
              HasSubstr("version '1', which a later version of this program may read"));
}

TEST(Reader, NamesTheFile) {
  const trifinger::test::SessionFolder folder;
  const auto path = folder.path() / "notes.txt";
  std::ofstream(path) << "These are notes, and no log.";
  try {
    const Reader reader(path);
    FAIL();
  } catch (const FormatError& error) {
    EXPECT_THAT(error.what(), HasSubstr(path.string()));
  }
  EXPECT_THROW(Reader(folder.path() / "nothing.mcap"), SystemError);
  EXPECT_THROW(Reader(folder.path()), SystemError) << "a folder";
}

TEST(Reader, ReadsFiles) {
  const trifinger::test::SessionFolder folder;
  const auto path = folder.path() / "log.mcap";
  const Sample sample = make_sample(Compression::kZstd, true);
  {
    FileSink sink = FileSink::create(path);
    sink.append(sample.bytes);
  }
  Reader reader(path);
  EXPECT_EQ(read_everything(reader), sample.everything);
}

TEST(Reader, KnowsNoOtherChunksThanThereAre) {
  const Sample sample = make_sample(Compression::kZstd, true);
  Reader reader = read_bytes(sample.bytes);
  EXPECT_THROW(static_cast<void>(reader.read_chunk(6)), InvalidArgument);
}

TEST(Reader, OpensAFinishedFileWithoutReadingItsChunks) {
  MemorySink sink;
  Writer writer(sink, {.compression = Compression::kNone});
  RecordingWriter recorder(writer);
  for (std::uint64_t i = 0; i < 100; ++i) recorder.write("Step", i, std::string(100'000, 'x'));
  writer.finish();
  auto source = std::make_unique<CountingSource>(sink.bytes());
  const CountingSource& counted = *source;
  const Reader reader(std::move(source));
  EXPECT_EQ(reader.contents().message_count, 100U);
  EXPECT_LT(counted.num_bytes, sink.size() / 20);
}

TEST(Reader, KnowsTheChannelsOfAnUnfinishedFileWhenItIsOpened) {
  const Sample sample = make_sample(Compression::kZstd, false);
  const Reader reader = read_bytes(sample.bytes);
  EXPECT_EQ(reader.contents().channels.size(), 3U);
  EXPECT_EQ(reader.contents().schemas.size(), 2U);
  EXPECT_EQ(reader.contents().message_count, sample.everything.messages.size());
}

TEST(Reader, AllocatesNothingPerChunk) {
  MemorySink sink;
  Writer writer(sink, {});
  RecordingWriter recorder(writer);
  for (std::uint64_t i = 0; i < 1000; ++i) {
    recorder.write("Step", i, std::string(300, 'x'));
    if (i % 100 == 99) writer.flush();
  }
  writer.finish();
  Reader reader = read_bytes(sink.bytes());
  static_cast<void>(reader.read_chunk(0));
  static_cast<void>(reader.read_chunk(1));
  const trifinger::test::AllocationCounter allocations;
  for (std::size_t i = 2; i < 10; ++i) EXPECT_EQ(reader.read_chunk(i).value().size(), 100U);
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(Reader, fault_75_SaysThatAFileIsEmpty) {
  try {
    static_cast<void>(read_bytes({}));
    FAIL() << "nothing thrown";
  } catch (const FormatError& error) {
    EXPECT_STREQ(error.what(), "this is empty");
  }
}

TEST(Reader, ReadsMessagesOutsideOfChunks) {
  Buffer buffer;
  Encoder encoder(buffer);
  encoder.bytes(kMagic);
  encoder.header("", "somebody else");
  encoder.schema({.id = 3, .name = "s", .encoding = "json", .data = "{}"});
  encoder.channel({.id = 9, .schema_id = 3, .topic = "/a", .message_encoding = "json"});
  for (std::uint64_t i = 0; i < 10; ++i) {
    encoder.message({.channel_id = 9, .log_time = 20 - i, .data = bytes_of("{}")});
  }
  Reader reader = read_bytes(buffer.view());
  EXPECT_TRUE(reader.contents().damage.empty());
  EXPECT_EQ(reader.contents().message_count, 10U);
  ASSERT_EQ(reader.contents().chunks.size(), 1U);
  EXPECT_FALSE(reader.contents().chunks[0].is_chunk);
  EXPECT_EQ(reader.contents().chunks[0].first_time, 11U);
  EXPECT_EQ(reader.contents().chunks[0].last_time, 20U);
  EXPECT_EQ(reader.read_chunk(0).value().size(), 10U);
}

TEST(Reader, LeavesOutRecordsOfOtherTypesAndNamesThem) {
  Buffer buffer;
  Encoder encoder(buffer);
  encoder.bytes(kMagic);
  encoder.header("", "");
  const std::size_t record = encoder.begin(Opcode{0x80});
  encoder.string("private");
  encoder.end(record);
  encoder.metadata({.name = "after"});
  const Reader reader = read_bytes(buffer.view());
  EXPECT_EQ(reader.contents().metadata.size(), 1U);
  ASSERT_EQ(reader.contents().damage.size(), 1U);
  EXPECT_EQ(reader.contents().damage[0].offset, record);
  EXPECT_EQ(reader.contents().damage[0].reason,
            "A record of a type that this version does not know.");
}

}  // namespace
}  // namespace trifinger::mcap::test
