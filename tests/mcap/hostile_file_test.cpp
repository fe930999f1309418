// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdint>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "mcap/compression.hpp"
#include "mcap/encoding.hpp"
#include "mcap/files.hpp"
#include "support/child_process.hpp"
#include "support/sanitizers.hpp"
#include "trifinger/mcap/reader.hpp"

// fault_26: files made to do harm.
namespace trifinger::mcap::test {
namespace {

using testing::HasSubstr;

constexpr std::uint64_t kLimit = 1 << 20;

// A file with a valid beginning.
class HostileFile {
 public:
  HostileFile() {
    encoder.bytes(kMagic);
    encoder.header("", "");
  }

  // Adds a chunk whose header may contain anything.
  void add_chunk(Compression compression, std::span<const std::byte> records,
                 std::uint64_t uncompressed_size, std::uint32_t sum) {
    const std::size_t record = encoder.begin(Opcode::kChunk);
    encoder.number(std::uint64_t{1});
    encoder.number(std::uint64_t{1});
    encoder.number(uncompressed_size);
    encoder.number(sum);
    encoder.string(name_of(compression));
    Buffer compressed;
    Compressor(compression, 1).compress(records, compressed);
    encoder.number(std::uint64_t{compressed.size()});
    encoder.bytes(compressed.view());
    encoder.end(record);
  }

  [[nodiscard]] Reader read() const {
    return read_bytes(bytes.view(), {.max_record_size = kLimit});
  }
  // Returns the only damage known after the first chunk was read.
  [[nodiscard]] std::string damage() const {
    Reader reader = read();
    if (!reader.contents().chunks.empty()) static_cast<void>(reader.read_chunk(0));
    EXPECT_EQ(reader.contents().damage.size(), 1U);
    return reader.contents().damage.empty() ? "none" : reader.contents().damage[0].reason;
  }

  Buffer bytes;
  Encoder encoder{bytes};
};

Buffer some_message() {
  Buffer records;
  Encoder encoder(records);
  encoder.channel({.id = 1, .topic = "/a"});
  encoder.message({.channel_id = 1, .log_time = 1, .data = bytes_of("hello")});
  return records;
}

class HostileChunk : public testing::TestWithParam<Compression> {};

INSTANTIATE_TEST_SUITE_P(AllCompressions, HostileChunk, testing::ValuesIn(kCompressions),
                         [](const auto& param_info) {
                           const std::string name(name_of(param_info.param));
                           return name.empty() ? "None" : name;
                         });

TEST_P(HostileChunk, fault_26_ThatLiesAboutItsSizeIsDamage) {
  const Buffer records = some_message();
  const std::uint32_t sum = checksum(records.view());
  const std::uint64_t size = records.size();
  for (const std::uint64_t lie : {size - 1, size + 1, std::uint64_t{0}, kLimit, kLimit + 1,
                                  std::uint64_t{1} << 40U, std::uint64_t{1} << 63U, UINT64_MAX}) {
    HostileFile file;
    file.add_chunk(GetParam(), records.view(), lie, sum);
    EXPECT_NE(file.damage(), "none") << lie;
  }
  HostileFile file;
  file.add_chunk(GetParam(), records.view(), size, sum);
  EXPECT_EQ(file.read().read_chunk(0).value().size(), 1U);
}

TEST_P(HostileChunk, fault_26_ThatBecomesLargerThanAllowedIsDamage) {
  const std::vector<std::byte> bomb(kLimit * 16);
  HostileFile file;
  file.add_chunk(GetParam(), bomb, bomb.size(), checksum(bomb));
  EXPECT_THAT(file.damage(), HasSubstr("more than the 1048576 allowed"));
  // Now the header lies.
  HostileFile liar;
  liar.add_chunk(GetParam(), bomb, kLimit, checksum(bomb));
  EXPECT_NE(liar.damage(), "none");
}

TEST_P(HostileChunk, fault_26_WithRecordsThatMakeNoSenseIsDamage) {
  for (const std::size_t cut : {std::size_t{1}, std::size_t{10}}) {
    Buffer records = some_message();
    records.resize(records.size() - cut);
    HostileFile file;
    file.add_chunk(GetParam(), records.view(), records.size(), checksum(records.view()));
    EXPECT_EQ(file.damage(), "The chunk holds records that make no sense.");
  }
}

TEST(HostileFiles, fault_26_CannotNameALengthThatIsBelieved) {
  for (const Opcode opcode : {Opcode::kHeader, Opcode::kSchema, Opcode::kChannel, Opcode::kMessage,
                              Opcode::kChunk, Opcode::kMessageIndex, Opcode::kAttachment,
                              Opcode::kMetadata, Opcode::kDataEnd, Opcode{0x80}}) {
    for (const std::uint64_t length :
         {UINT64_MAX, UINT64_MAX - 8, std::uint64_t{1} << 63U, std::uint64_t{1} << 32U}) {
      HostileFile file;
      file.encoder.number(static_cast<std::uint8_t>(opcode));
      file.encoder.number(length);
      for (int i = 0; i < 16; ++i) file.encoder.number(UINT64_MAX);
      const Reader reader = file.read();
      EXPECT_EQ(reader.contents().damage.size(), 1U);
      EXPECT_TRUE(reader.contents().chunks.empty());
    }
  }
}

TEST(HostileFiles, fault_26_CannotNameLengthsOfTextsThatAreBelieved) {
  for (const Opcode opcode : {Opcode::kSchema, Opcode::kChannel, Opcode::kMetadata}) {
    HostileFile file;
    const std::size_t record = file.encoder.begin(opcode);
    file.encoder.number(std::uint32_t{1});
    for (int i = 0; i < 4; ++i) file.encoder.number(UINT32_MAX);
    file.encoder.end(record);
    EXPECT_EQ(file.damage(), "A record makes no sense.");
  }
}

TEST(HostileFiles, fault_26_CannotHaveNamesThatAreNotUtf8) {
  for (const std::string name : {"\xFF", "\xC0\x80", "\xED\xA0\x80", "\xF5\x80\x80\x80", "\xC3"}) {
    HostileFile file;
    const std::size_t record = file.encoder.begin(Opcode::kMetadata);
    file.encoder.blob(name);
    file.encoder.map({});
    file.encoder.end(record);
    EXPECT_EQ(file.damage(), "A record makes no sense.");
  }
  HostileFile file;
  file.encoder.metadata({.name = "größer als 𝄞 €"});
  EXPECT_EQ(file.read().contents().metadata.at(0).name, "größer als 𝄞 €");
}

TEST(HostileFiles, fault_26_CannotDefineAChannelTwice) {
  Buffer records = some_message();
  HostileFile file;
  file.add_chunk(Compression::kZstd, records.view(), records.size(), checksum(records.view()));
  records.clear();
  Encoder encoder(records);
  encoder.channel({.id = 1, .topic = "/b"});
  encoder.message({.channel_id = 1, .log_time = 1});
  file.add_chunk(Compression::kZstd, records.view(), records.size(), checksum(records.view()));
  Reader reader = file.read();
  ASSERT_EQ(reader.contents().chunks.size(), 1U);
  EXPECT_EQ(reader.contents().channels.at(1).topic, "/a");
  ASSERT_EQ(reader.contents().damage.size(), 1U);
  EXPECT_EQ(reader.contents().damage[0].reason,
            "The channel 1 is defined anew, otherwise than before.");
}

TEST(HostileFiles, fault_26_CannotFillTheMemoryWithWhatIsKept) {
  HostileFile file;
  const std::string data(100'000, 'x');
  for (std::uint16_t i = 1; i <= 100; ++i) {
    Buffer records;
    Encoder(records).schema({.id = i, .name = "s", .data = data});
    file.add_chunk(Compression::kZstd, records.view(), records.size(), checksum(records.view()));
    file.encoder.attachment({.name = "a", .data = data});
  }
  const Reader reader = file.read();
  std::size_t size = 0;
  for (const auto& [id, schema] : reader.contents().schemas) size += schema.data.size();
  for (const Attachment& attachment : reader.contents().attachments) size += attachment.data.size();
  EXPECT_GT(size, kLimit / 2);
  EXPECT_LE(size, kLimit);
  EXPECT_FALSE(reader.contents().damage.empty());
}

TEST(HostileFiles, fault_26_CannotFillTheMemoryWithDamage) {
  HostileFile file;
  for (int i = 0; i < 20'000; ++i) {
    file.encoder.end(file.encoder.begin(i % 2 == 0 ? Opcode{0x80} : Opcode{0x81}));
    file.encoder.metadata({.name = "m"});
  }
  const std::uint64_t size = file.bytes.size();
  const Reader reader = file.read();
  const auto& damage = reader.contents().damage;
  EXPECT_LE(damage.size(), 1000U);
  EXPECT_EQ(damage.back().offset + damage.back().size, size);
}

// Every chunk in this index is one and the same: reading a file of a few hundred bytes would take
// hours.
TEST(HostileFiles, fault_26_CannotIndexAChunkTwice) {
  const Buffer records = some_message();
  HostileFile file;
  const std::uint64_t offset = file.bytes.size();
  file.add_chunk(Compression::kNone, records.view(), records.size(), checksum(records.view()));
  const std::uint64_t length = file.bytes.size() - offset;
  std::size_t record = file.encoder.begin(Opcode::kDataEnd);
  file.encoder.number(std::uint32_t{0});
  file.encoder.end(record);
  const std::uint64_t summary = file.bytes.size();
  for (int i = 0; i < 100; ++i) {
    record = file.encoder.begin(Opcode::kChunkIndex);
    for (const std::uint64_t value : {std::uint64_t{1}, std::uint64_t{1}, offset, length}) {
      file.encoder.number(value);
    }
    file.encoder.map({});
    file.encoder.number(std::uint64_t{0});
    file.encoder.string("");
    file.encoder.number(std::uint64_t{records.size()});
    file.encoder.number(std::uint64_t{records.size()});
    file.encoder.end(record);
  }
  record = file.encoder.begin(Opcode::kStatistics);
  file.encoder.number(std::uint64_t{100});
  file.encoder.number(std::uint16_t{0});
  for (const std::uint32_t count : {1U, 0U, 0U, 100U}) file.encoder.number(count);
  for (const std::uint64_t time : {std::uint64_t{1}, std::uint64_t{1}}) file.encoder.number(time);
  file.encoder.map({});
  file.encoder.end(record);
  record = file.encoder.begin(Opcode::kFooter);
  file.encoder.number(summary);
  file.encoder.number(std::uint64_t{0});
  file.encoder.number(std::uint32_t{0});
  file.encoder.end(record);
  file.encoder.bytes(kMagic);

  Reader reader = file.read();
  EXPECT_EQ(reader.contents().chunks.size(), 1U);
  EXPECT_EQ(reader.contents().message_count, 1U);
  EXPECT_EQ(reader.read_chunk(0).value().size(), 1U);
}

// Wherever the reader searches for the next record, another chunk seems to begin.
TEST(HostileFiles, fault_26_CannotMakeTheSearchForAChunkEndless) {
  constexpr std::size_t kNumChunks = 20'000;
  HostileFile file;
  file.encoder.number(std::uint8_t{0});
  file.encoder.number(UINT64_MAX);
  constexpr std::size_t kHeader = 49;
  const std::size_t begin = file.bytes.size();
  const std::uint64_t end = begin + kNumChunks * kHeader + 1000;
  for (std::size_t i = 0; i < kNumChunks; ++i) {
    const std::uint64_t length = end - file.bytes.size() - kRecordHeaderSize;
    file.encoder.number(static_cast<std::uint8_t>(Opcode::kChunk));
    file.encoder.number(length);
    file.encoder.number(std::uint64_t{1});
    file.encoder.number(std::uint64_t{1});
    file.encoder.number(length - 40);
    file.encoder.number(std::uint32_t{1});
    file.encoder.number(std::uint32_t{0});
    file.encoder.number(length - 40);
  }
  const std::vector<std::byte> rest(1000);
  file.encoder.bytes(rest);
  auto source = std::make_unique<CountingSource>(file.bytes.view());
  const CountingSource& counted = *source;
  const Reader reader(std::move(source), {.max_record_size = kLimit});
  EXPECT_LT(counted.num_bytes, 20 * (file.bytes.size() + kLimit));
  EXPECT_TRUE(reader.contents().chunks.empty());
  ASSERT_EQ(reader.contents().damage.size(), 1U);
  EXPECT_EQ(reader.contents().damage[0].size, file.bytes.size() - begin + kRecordHeaderSize);
}

TEST(HostileFiles, fault_26_CannotTakeMoreMemoryThanAllowed) {
  if (trifinger::test::kHasSanitizer)
    GTEST_SKIP() << "a sanitizer takes more addresses than are allowed here";
  const std::vector<std::byte> bomb(std::size_t{512} << 20U);
  HostileFile file;
  file.add_chunk(Compression::kZstd, bomb, bomb.size(), checksum(bomb));
  file.add_chunk(Compression::kLz4, bomb, kLimit, checksum(bomb));
  trifinger::test::ChildProcess child([&] {
    rlimit limit{};
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    limit.rlim_cur = limit.rlim_max = std::size_t{1200} << 20U;
    if (::setrlimit(RLIMIT_AS, &limit) != 0) return 2;
    Reader reader = file.read();
    for (std::size_t i = 0; i < reader.contents().chunks.size(); ++i) {
      if (reader.read_chunk(i)) return 3;
    }
    return reader.contents().damage.empty() ? 4 : 0;
  });
  EXPECT_EQ(child.wait(), 0);
}

}  // namespace
}  // namespace trifinger::mcap::test
