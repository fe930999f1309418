// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "mcap/files.hpp"
#include "support/sanitizers.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::mcap::test {
namespace {

// Number of bits to flip, in all parameters together.
constexpr int kNumFlips = trifinger::test::kHasSanitizer ? 3'000 : 100'000;

struct Case {
  Compression compression;
  bool is_finished;
  bool verify;
};

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  cases.reserve(4 * std::size(kCompressions));
  for (const Compression compression : kCompressions) {
    for (const bool is_finished : {false, true}) {
      for (const bool verify : {false, true}) cases.push_back({compression, is_finished, verify});
    }
  }
  return cases;
}

class FlippedBits : public testing::TestWithParam<Case> {};

INSTANTIATE_TEST_SUITE_P(All, FlippedBits, testing::ValuesIn(all_cases()),
                         [](const auto& param_info) {
                           const Case& param = param_info.param;
                           const std::string compression(name_of(param.compression));
                           return (compression.empty() ? "None" : compression) +
                                  (param.is_finished ? "Finished" : "Unfinished") +
                                  (param.verify ? "Verified" : "Opened");
                         });

bool is_covered(const Contents& contents, std::uint64_t offset, std::uint64_t length) {
  return std::ranges::any_of(contents.damage, [&](const Damage& damage) {
    return damage.offset <= offset && offset + length <= damage.offset + damage.size;
  });
}

// Removes `part` from the front of `whole`. Returns false if it is not there.
template <class T>
bool take(std::vector<T>& whole, const std::vector<T>& part) {
  if (part.size() > whole.size() || !std::equal(part.begin(), part.end(), whole.begin())) {
    return false;
  }
  whole.erase(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(part.size()));
  return true;
}

TEST_P(FlippedBits, fault_25_CostTheRecordTheyAreInWhichIsNamedAndNothingElse) {
  const Sample sample = make_sample(GetParam().compression, GetParam().is_finished);
  Reader whole = read_bytes(sample.bytes);
  const Contents places = whole.contents();
  std::vector<std::vector<StoredMessage>> chunks(places.chunks.size());
  for (std::size_t i = 0; i < chunks.size(); ++i) chunks[i] = read_messages(whole, i);

  std::mt19937 random(1);
  const std::size_t num_bits = sample.bytes.size() * 8;
  for (int i = 0; i < kNumFlips / 12; ++i) {
    const std::size_t bit = random() % num_bits;
    const std::size_t flipped = bit / 8;
    SCOPED_TRACE("bit " + std::to_string(bit));
    std::vector<std::byte> bytes = sample.bytes;
    bytes[flipped] ^= std::byte{1} << (bit % 8);
    const auto is_hit = [&](const auto& place) {
      return flipped >= place.offset && flipped < place.offset + place.length;
    };

    try {
      Reader reader = read_bytes(bytes, {.verify = GetParam().verify});
      Everything found = read_everything(reader);
      const Contents& contents = reader.contents();
      for (std::size_t k = 0; k < chunks.size(); ++k) {
        const ChunkPlace& place = places.chunks[k];
        if (take(found.messages, chunks[k])) continue;
        ASSERT_TRUE(is_hit(place)) << "chunk " << k << " is missing";
        ASSERT_TRUE(is_covered(contents, place.offset, place.length));
      }
      for (std::size_t k = 0; k < places.metadata.size(); ++k) {
        const RecordPlace& place = places.metadata_places[k];
        if (take(found.metadata, {places.metadata[k]})) continue;
        ASSERT_TRUE(is_hit(place)) << "metadata " << k << " is missing";
        ASSERT_TRUE(is_covered(contents, place.offset, place.length));
      }
      for (std::size_t k = 0; k < places.attachments.size(); ++k) {
        const RecordPlace& place = places.attachment_places[k];
        if (take(found.attachments, {places.attachments[k]})) continue;
        ASSERT_TRUE(is_hit(place)) << "attachment " << k << " is missing";
        ASSERT_TRUE(is_covered(contents, place.offset, place.length));
      }
      // Nothing is found that was not written.
      ASSERT_EQ(found, Everything());
      ASSERT_EQ(contents.schemas, places.schemas);
      ASSERT_EQ(contents.channels, places.channels);
      if (GetParam().verify) {
        // The texts of the header have a checksum only in the checksum of all data at the end.
        // Also, some changed compressed bytes have an unchanged meaning.
        const bool is_in_header = flipped >= 8 && flipped < 35;
        const bool is_compressed = GetParam().compression != Compression::kNone &&
                                   std::ranges::any_of(places.chunks, [&](const auto& place) {
                                     return flipped >= place.offset + 49 && is_hit(place);
                                   });
        ASSERT_TRUE(!contents.damage.empty() ||
                    (!GetParam().is_finished && (is_in_header || is_compressed)));
      }
    } catch (const FormatError&) {
      ASSERT_EQ(flipped, 5U) << "only a version that is not known may cost the file";
    }
  }
}

TEST(Damage, fault_25_OfAnyRunOfBytesLeavesTheRecordsAroundIt) {
  const Sample sample = make_sample(Compression::kZstd, false);
  Reader whole = read_bytes(sample.bytes);
  const Contents places = whole.contents();
  std::mt19937 random(2);
  for (int i = 0; i < kNumFlips / 100; ++i) {
    std::vector<std::byte> bytes = sample.bytes;
    const std::size_t begin = 8 + random() % (bytes.size() - 8);
    const std::size_t end = std::min(bytes.size(), begin + 1 + random() % 600);
    for (std::size_t k = begin; k < end; ++k) bytes[k] = static_cast<std::byte>(random());
    SCOPED_TRACE("bytes " + std::to_string(begin) + " to " + std::to_string(end));

    Reader reader = read_bytes(bytes);
    const Everything found = read_everything(reader);
    for (std::size_t k = 0; k < places.chunks.size(); ++k) {
      const ChunkPlace& place = places.chunks[k];
      const bool is_hit = begin < place.offset + place.length && end > place.offset;
      for (const StoredMessage& message : read_messages(whole, k)) {
        // The channels themselves may be lost.
        const auto is_it = [&](const StoredMessage& m) {
          return m.log_time == message.log_time && m.data == message.data;
        };
        ASSERT_EQ(std::ranges::count_if(found.messages, is_it), is_hit ? 0 : 1);
      }
    }
    ASSERT_LE(found.messages.size(), sample.everything.messages.size());
  }
}

TEST(Damage, IsNamedWithItsPlaceAndReason) {
  Sample sample = make_sample(Compression::kZstd, true);
  Reader whole = read_bytes(sample.bytes);
  const ChunkPlace place = whole.contents().chunks.at(2);
  sample.bytes[place.offset + place.length - 1] ^= std::byte{1};

  Reader reader = read_bytes(sample.bytes);
  EXPECT_TRUE(reader.contents().damage.empty()) << "nobody has looked yet";
  EXPECT_FALSE(reader.read_chunk(2).has_value());
  EXPECT_FALSE(reader.read_chunk(2).has_value());
  ASSERT_EQ(reader.contents().damage.size(), 1U);
  const Damage& damage = reader.contents().damage[0];
  EXPECT_EQ(damage.offset, place.offset);
  EXPECT_EQ(damage.size, place.length);
  EXPECT_EQ(damage.reason, "The chunk cannot be decompressed.");
}

TEST(Damage, InTheTimesOfAChunkDoesNotCostItsMessages) {
  Sample sample = make_sample(Compression::kZstd, false);
  Reader whole = read_bytes(sample.bytes);
  const ChunkPlace place = whole.contents().chunks.at(2);
  sample.bytes[place.offset + 9] ^= std::byte{1};

  Reader reader = read_bytes(sample.bytes);
  EXPECT_EQ(reader.contents().chunks.at(2).first_time, place.first_time);
  EXPECT_EQ(read_everything(reader), sample.everything);
  ASSERT_EQ(reader.contents().damage.size(), 1U);
  EXPECT_EQ(reader.contents().damage[0].offset, place.offset + 9);
}

// After a loss of power, a file may have its full size and zeros at its end.
TEST(Damage, AtTheEndIsCutOffAsIfItWereNotThere) {
  const Sample sample = make_sample(Compression::kZstd, false);
  Reader whole = read_bytes(sample.bytes);
  const Contents& contents = whole.contents();
  for (std::size_t kept = 60; kept < sample.bytes.size(); kept += 7) {
    std::vector<std::byte> bytes = sample.bytes;
    std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(kept), bytes.end(), std::byte{0});
    const auto changed = std::ranges::mismatch(bytes, sample.bytes).in1 - bytes.begin();
    std::uint64_t whole_end = 0;
    for (const ChunkPlace& place : contents.chunks) {
      const std::uint64_t end = place.offset + place.length;
      if (std::cmp_less_equal(end, changed)) whole_end = end;
    }
    const Reader reader = read_bytes(bytes);
    ASSERT_GE(reader.contents().complete_size, whole_end);
    ASSERT_TRUE(std::cmp_less_equal(reader.contents().complete_size, changed)) << "cut at " << kept;
    const Damage& damage = reader.contents().damage.back();
    ASSERT_EQ(damage.offset + damage.size, bytes.size());
  }
}

}  // namespace
}  // namespace trifinger::mcap::test
