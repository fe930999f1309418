// SPDX-License-Identifier: BSD-3-Clause
#include "summary.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace trifinger::mcap {
namespace {

std::optional<ChunkPlace> decode_chunk_index(std::span<const std::byte> content) {
  Decoder decoder(content);
  ChunkPlace place;
  place.first_time = decoder.number<std::uint64_t>();
  place.last_time = decoder.number<std::uint64_t>();
  place.offset = decoder.number<std::uint64_t>();
  place.length = decoder.number<std::uint64_t>();
  Decoder indexes(decoder.array());
  while (indexes.is_whole() && !indexes.rest().empty()) {
    const auto channel = indexes.number<std::uint16_t>();
    place.indexes.emplace_back(channel, indexes.number<std::uint64_t>());
  }
  place.index_length = decoder.number<std::uint64_t>();
  // An unknown compression is reported when the chunk is read.
  place.compression = compression_of(decoder.string()).value_or(Compression::kNone);
  static_cast<void>(decoder.number<std::uint64_t>());  // compressed size
  place.uncompressed_size = decoder.number<std::uint64_t>();
  if (!decoder.is_whole() || !indexes.is_whole()) return std::nullopt;
  return place;
}

std::optional<RecordPlace> decode_place(std::span<const std::byte> content) {
  Decoder decoder(content);
  RecordPlace place;
  place.offset = decoder.number<std::uint64_t>();
  place.length = decoder.number<std::uint64_t>();
  if (!decoder.is_whole()) return std::nullopt;
  return place;
}

// Returns false if the record makes no sense.
bool add_to(Summary& summary, Opcode opcode, std::span<const std::byte> content) {
  const auto add = [](auto& list, auto record) {
    if (record) list.push_back(std::move(*record));
    return record.has_value();
  };
  switch (opcode) {
    case Opcode::kSchema: {
      const auto schema = decode_schema(content);
      return schema && summary.schemas.emplace(schema->id, *schema).second;
    }
    case Opcode::kChannel: {
      const auto channel = decode_channel(content);
      return channel && summary.channels.emplace(channel->id, *channel).second;
    }
    case Opcode::kStatistics:
      summary.statistics = decode_statistics(content);
      return summary.statistics.has_value();
    case Opcode::kChunkIndex:
      return add(summary.chunks, decode_chunk_index(content));
    case Opcode::kAttachmentIndex:
      return add(summary.attachments, decode_place(content));
    case Opcode::kMetadataIndex:
      return add(summary.metadata, decode_place(content));
    default:
      return true;
  }
}

std::uint64_t saturating_add(std::uint64_t a, std::uint64_t b) noexcept {
  constexpr auto kMax = std::numeric_limits<std::uint64_t>::max();
  return a > kMax - b ? kMax : a + b;
}

}  // namespace

bool ends_with_magic(Window& window) {
  return window.size() >= 2 * kMagic.size() &&
         std::ranges::equal(window.at(window.size() - kMagic.size(), kMagic.size()), kMagic);
}

std::optional<Summary> read_summary(Window& window) {
  if (window.size() < 2 * kMagic.size() + kDataEndSize + kFooterSize || !ends_with_magic(window)) {
    return std::nullopt;
  }
  const std::uint64_t footer_end = window.size() - kMagic.size();
  const std::uint64_t footer_begin = footer_end - kFooterSize;
  const auto header = window.header_at(footer_begin, footer_end);
  if (!header || header->opcode != Opcode::kFooter) return std::nullopt;
  const auto footer = decode_footer(window.content_at(footer_begin, *header));
  if (!footer) return std::nullopt;
  const std::uint64_t begin = footer->summary_start == 0 ? footer_begin : footer->summary_start;
  if (begin < kMagic.size() + kDataEndSize || begin > footer_begin) return std::nullopt;
  const std::uint64_t checksum_begin = footer_end - sizeof(footer->summary_checksum);
  if (footer->summary_checksum != 0 &&
      footer->summary_checksum != window.checksum_between(begin, checksum_begin)) {
    return std::nullopt;
  }

  Summary summary{.data_end = begin - kDataEndSize, .begin = begin};
  for (std::uint64_t offset = begin; offset < footer_begin;) {
    const auto record = window.header_at(offset, footer_begin);
    if (!record || !add_to(summary, record->opcode, window.content_at(offset, *record))) {
      return std::nullopt;
    }
    offset += record->record_length();
  }
  return summary;
}

std::optional<std::vector<IndexedRecord>> index_of(const Summary& summary) {
  const auto& statistics = summary.statistics;
  if (!statistics || statistics->chunk_count != summary.chunks.size() ||
      statistics->attachment_count != summary.attachments.size() ||
      statistics->metadata_count != summary.metadata.size()) {
    return std::nullopt;
  }
  for (const auto& [id, count] : statistics->channel_message_counts) {
    const auto channel = summary.channels.find(id);
    if (channel == summary.channels.end()) return std::nullopt;
    const std::uint16_t schema = channel->second.schema_id;
    if (schema != 0 && !summary.schemas.contains(schema)) return std::nullopt;
  }

  std::vector<IndexedRecord> records;
  records.reserve(summary.chunks.size() + summary.attachments.size() + summary.metadata.size());
  for (const ChunkPlace& place : summary.chunks) {
    const std::uint64_t length = saturating_add(place.length, place.index_length);
    records.push_back({.place = {.offset = place.offset, .length = length}, .is_chunk = true});
  }
  for (const RecordPlace& place : summary.attachments) records.push_back({.place = place});
  for (const RecordPlace& place : summary.metadata) records.push_back({.place = place});
  std::ranges::sort(records, {}, [](const IndexedRecord& record) { return record.place.offset; });
  std::uint64_t end = kMagic.size();
  for (const auto& [place, is_chunk] : records) {
    // Records must not overlap, and must lie before the end of the data.
    if (place.offset < end || place.offset > summary.data_end || place.length < kRecordHeaderSize ||
        place.length > summary.data_end - place.offset) {
      return std::nullopt;
    }
    end = place.offset + place.length;
  }
  return records;
}

}  // namespace trifinger::mcap
