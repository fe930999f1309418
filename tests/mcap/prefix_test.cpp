// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mcap/files.hpp"
#include "support/sanitizers.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::mcap::test {
namespace {

class Prefixes : public testing::TestWithParam<Compression> {};

INSTANTIATE_TEST_SUITE_P(AllCompressions, Prefixes, testing::ValuesIn(kCompressions),
                         [](const auto& param_info) {
                           const std::string name(name_of(param_info.param));
                           return name.empty() ? "None" : name;
                         });

template <class Place>
bool ends_within(const Place& place, std::size_t size) {
  return place.offset + place.length <= size;
}

// Returns what can be read from the first `size` bytes of a sample.
Everything expected_of(Reader& whole, std::size_t size) {
  Everything everything;
  const Contents& contents = whole.contents();
  for (std::size_t i = 0; i < contents.chunks.size(); ++i) {
    if (!ends_within(contents.chunks[i], size)) continue;
    for (auto& message : read_messages(whole, i)) everything.messages.push_back(message);
  }
  for (std::size_t i = 0; i < contents.metadata.size(); ++i) {
    if (ends_within(contents.metadata_places[i], size)) {
      everything.metadata.push_back(contents.metadata[i]);
    }
  }
  for (std::size_t i = 0; i < contents.attachments.size(); ++i) {
    if (ends_within(contents.attachment_places[i], size)) {
      everything.attachments.push_back(contents.attachments[i]);
    }
  }
  return everything;
}

TEST_P(Prefixes, fault_24_AreReadUpToTheLastWholeRecordAndTheLostBytesAreCounted) {
  constexpr std::size_t kStride = trifinger::test::kHasSanitizer ? 3 : 1;
  const Sample sample = make_sample(GetParam(), true);
  Reader whole = read_bytes(sample.bytes);
  // Ends of the records up to the summary.
  std::vector<std::uint64_t> ends{0};
  {
    const std::uint64_t header_size = 8 + 9 + 4 + 4 + 4 + 6;
    ends.push_back(header_size);
    const Contents& contents = whole.contents();
    for (const ChunkPlace& place : contents.chunks) {
      ends.push_back(place.offset + place.length);
      for (const auto& [channel, offset] : place.indexes) {
        if (offset > place.offset + place.length) ends.push_back(offset);
      }
      ends.push_back(place.offset + place.length + place.index_length);
    }
    for (const auto& place : contents.metadata_places) ends.push_back(place.offset + place.length);
    for (const auto& place : contents.attachment_places) {
      ends.push_back(place.offset + place.length);
    }
    std::ranges::sort(ends);
  }

  for (std::size_t size = 1; size < sample.bytes.size(); size += kStride) {
    for (const bool verify : {false, true}) {
      SCOPED_TRACE(std::to_string(size) + " bytes");
      Reader reader = read_bytes(std::span(sample.bytes).first(size), {.verify = verify});
      ASSERT_EQ(read_everything(reader), expected_of(whole, size));
      const Contents& contents = reader.contents();
      ASSERT_FALSE(contents.is_finished);
      ASSERT_EQ(contents.complete_size, *std::prev(std::ranges::upper_bound(ends, size)));
      if (size == contents.complete_size) {
        ASSERT_TRUE(contents.damage.empty());
      } else {
        ASSERT_EQ(contents.damage.size(), 1U);
        ASSERT_EQ(contents.damage[0].offset + contents.damage[0].size, size);
        // The magic bytes at the beginning are complete before the header is.
        ASSERT_LE(contents.damage[0].offset, std::max<std::uint64_t>(contents.complete_size, 8));
      }
      std::uint64_t count = 0;
      for (const auto& [channel, messages] : contents.channel_message_counts) count += messages;
      ASSERT_EQ(count, expected_of(whole, size).messages.size());
      ASSERT_EQ(contents.message_count, count);
    }
  }
}

TEST_P(Prefixes, NameTheMessageIndexesThatWereCutOff) {
  const Sample sample = make_sample(GetParam(), true);
  Reader whole = read_bytes(sample.bytes);
  const ChunkPlace place = whole.contents().chunks.at(3);
  ASSERT_EQ(place.indexes.size(), 3U);
  const auto messages = whole.read_chunk(3).value();

  Reader reader = read_bytes(std::span(sample.bytes).first(place.indexes[1].second));
  const auto& missing = reader.contents().missing_indexes;
  EXPECT_EQ(missing.size(), 2U);
  EXPECT_FALSE(missing.contains(place.indexes[0].first));
  for (const auto& [channel, entries] : missing) {
    std::vector<std::uint64_t> times;
    for (const Message& message : messages) {
      if (message.channel_id == channel) times.push_back(message.log_time);
    }
    ASSERT_EQ(entries.size(), times.size());
    for (std::size_t i = 0; i < times.size(); ++i) EXPECT_EQ(entries[i].log_time, times[i]);
  }
}

}  // namespace
}  // namespace trifinger::mcap::test
