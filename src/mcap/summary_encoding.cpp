// SPDX-License-Identifier: BSD-3-Clause
#include "summary_encoding.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>

#include "encoding.hpp"

namespace trifinger::mcap {
namespace {

void encode_statistics(Encoder& encoder, const WrittenRecords& records) {
  std::uint64_t message_count = 0;
  std::uint32_t num_used = 0;
  for (const auto& [id, entry] : records.channels) {
    message_count += entry.message_count;
    if (entry.message_count > 0) ++num_used;
  }
  std::uint64_t first_time = 0;
  std::uint64_t last_time = 0;
  std::uint32_t chunk_count = 0;
  bool is_first = true;
  for (const ChunkPlace& place : records.chunks) {
    if (place.is_chunk) ++chunk_count;
    if (place.last_time == 0) continue;  // a chunk without messages
    first_time = is_first ? place.first_time : std::min(first_time, place.first_time);
    last_time = std::max(last_time, place.last_time);
    is_first = false;
  }
  const std::size_t record = encoder.begin(Opcode::kStatistics);
  encoder.number(message_count);
  encoder.number(static_cast<std::uint16_t>(records.schemas.size()));
  encoder.number(static_cast<std::uint32_t>(records.channels.size()));
  encoder.number(static_cast<std::uint32_t>(records.attachments.size()));
  encoder.number(static_cast<std::uint32_t>(records.metadata.size()));
  encoder.number(chunk_count);
  encoder.number(first_time);
  encoder.number(last_time);
  encoder.number(num_used * 10U);
  for (const auto& [id, entry] : records.channels) {
    if (entry.message_count == 0) continue;
    encoder.number(id);
    encoder.number(entry.message_count);
  }
  encoder.end(record);
}

void encode_index(Encoder& encoder, const ChunkPlace& place) {
  if (!place.is_chunk) return;
  const std::size_t record = encoder.begin(Opcode::kChunkIndex);
  encoder.number(place.first_time);
  encoder.number(place.last_time);
  encoder.number(place.offset);
  encoder.number(place.length);
  encoder.number(static_cast<std::uint32_t>(place.indexes.size() * 10));
  for (const auto& [id, offset] : place.indexes) {
    encoder.number(id);
    encoder.number(offset);
  }
  encoder.number(place.index_length);
  encoder.string(name_of(place.compression));
  encoder.number(place.length - chunk_header_size(place.compression));
  encoder.number(place.uncompressed_size);
  encoder.end(record);
}

void encode_index(Encoder& encoder, const AttachmentEntry& entry) {
  const std::size_t record = encoder.begin(Opcode::kAttachmentIndex);
  encoder.number(entry.place.offset);
  encoder.number(entry.place.length);
  encoder.number(entry.log_time);
  encoder.number(entry.create_time);
  encoder.number(entry.data_size);
  encoder.string(entry.name);
  encoder.string(entry.media_type);
  encoder.end(record);
}

void encode_index(Encoder& encoder, const MetadataEntry& entry) {
  const std::size_t record = encoder.begin(Opcode::kMetadataIndex);
  encoder.number(entry.place.offset);
  encoder.number(entry.place.length);
  encoder.string(entry.name);
  encoder.end(record);
}

}  // namespace

void encode_data_end(Buffer& output, std::uint32_t data_checksum) {
  Encoder encoder(output);
  const std::size_t record = encoder.begin(Opcode::kDataEnd);
  encoder.number(data_checksum);
  encoder.end(record);
}

void encode_summary(Buffer& output, const WrittenRecords& records, std::uint64_t offset) {
  Encoder encoder(output);
  const std::size_t summary = output.size();
  Buffer groups;
  // Adds all records of one kind, if there are any, and the offset of their group.
  const auto group = [&](Opcode opcode, const auto& entries, const auto& encode) {
    const std::size_t begin = output.size();
    for (const auto& entry : entries) encode(entry);
    if (output.size() == begin) return;
    Encoder group_encoder(groups);
    const std::size_t record = group_encoder.begin(Opcode::kSummaryOffset);
    group_encoder.number(static_cast<std::uint8_t>(opcode));
    group_encoder.number(std::uint64_t{offset + begin});
    group_encoder.number(std::uint64_t{output.size() - begin});
    group_encoder.end(record);
  };
  const auto definition = [&](const auto& entry) {
    encoder.bytes(entry.second.definition.record.view());
  };
  const auto index = [&](const auto& entry) { encode_index(encoder, entry); };
  group(Opcode::kSchema, records.schemas, definition);
  group(Opcode::kChannel, records.channels, definition);
  group(Opcode::kStatistics, std::array{0}, [&](int) { encode_statistics(encoder, records); });
  group(Opcode::kChunkIndex, records.chunks, index);
  group(Opcode::kAttachmentIndex, records.attachments, index);
  group(Opcode::kMetadataIndex, records.metadata, index);
  const std::uint64_t groups_begin = offset + output.size();
  encoder.bytes(groups.view());

  const std::size_t footer = encoder.begin(Opcode::kFooter);
  encoder.number(offset + summary);
  encoder.number(groups_begin);
  // The checksum covers the footer up to the checksum itself, including the footer's length.
  encoder.number(std::uint32_t{0});
  encoder.end(footer);
  const std::size_t end = output.size() - sizeof(std::uint32_t);
  const std::uint32_t summary_checksum = checksum(output.view().subspan(summary, end - summary));
  std::memcpy(output.data() + end, &summary_checksum, sizeof(summary_checksum));
  encoder.bytes(kMagic);
}

}  // namespace trifinger::mcap
