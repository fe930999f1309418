// SPDX-License-Identifier: BSD-3-Clause
#include "encoding.hpp"

#include <libdeflate.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <tuple>

#include "trifinger/base/error.hpp"
#include "trifinger/base/text.hpp"

namespace trifinger::mcap {
namespace {

std::span<const std::byte> bytes_of(std::string_view text) noexcept {
  return std::as_bytes(std::span(text));
}

std::string_view text_of(std::span<const std::byte> bytes) noexcept {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::uint32_t length_of(std::size_t size) {
  if (size > std::numeric_limits<std::uint32_t>::max()) {
    throw InvalidArgument("a text of " + std::to_string(size) +
                          " bytes is too long for MCAP, at most 4294967295 are possible");
  }
  return static_cast<std::uint32_t>(size);
}

bool is_checksum(std::string_view text) noexcept {
  return text.size() == 8 && std::ranges::all_of(text, [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

}  // namespace

std::uint32_t checksum(std::span<const std::byte> bytes, std::uint32_t before) {
  if (bytes.empty()) return before;  // libdeflate would return its initial value for nullptr
  return libdeflate_crc32(before, bytes.data(), bytes.size());
}

std::optional<Compression> compression_of(std::string_view name) noexcept {
  for (const Compression compression :
       {Compression::kNone, Compression::kLz4, Compression::kZstd}) {
    if (name == name_of(compression)) return compression;
  }
  return std::nullopt;
}

std::string checksum_of(const Metadata& metadata) {
  Buffer buffer;
  Encoder encoder(buffer);
  encoder.string(metadata.name);
  for (const auto& [key, value] : metadata.entries) {
    if (key == kChecksumEntry) continue;
    encoder.string(key);
    encoder.string(value);
  }
  std::array<char, 9> digits{};
  std::snprintf(digits.data(), digits.size(), "%08x", checksum(buffer.view()));
  return digits.data();
}

void sort_by_time(std::span<MessageIndexEntry> entries) noexcept {
  std::ranges::sort(entries, [](const MessageIndexEntry& a, const MessageIndexEntry& b) {
    return std::tie(a.log_time, a.offset) < std::tie(b.log_time, b.offset);
  });
}

// ---- Encoder ----

void Encoder::string(std::string_view text) {
  if (!is_utf8(text)) {
    throw InvalidArgument("a text that is not UTF-8 cannot be written: '" + std::string(text) +
                          "'");
  }
  blob(text);
}

void Encoder::blob(std::string_view bytes) {
  number(length_of(bytes.size()));
  this->bytes(bytes_of(bytes));
}

void Encoder::map(const Entries& entries) {
  std::size_t size = 0;
  for (const auto& [key, value] : entries) size += 8 + key.size() + value.size();
  number(length_of(size));
  for (const auto& [key, value] : entries) {
    string(key);
    string(value);
  }
}

std::size_t Encoder::begin(Opcode opcode) {
  const std::size_t begin = buffer_.size();
  number(static_cast<std::uint8_t>(opcode));
  number(std::uint64_t{0});
  return begin;
}

void Encoder::end(std::size_t begin) {
  const std::uint64_t length = buffer_.size() - begin - kRecordHeaderSize;
  std::memcpy(buffer_.data() + begin + 1, &length, sizeof(length));
}

void Encoder::header(std::string_view profile, std::string_view library) {
  const std::size_t record = begin(Opcode::kHeader);
  string(profile);
  string(library);
  end(record);
}

void Encoder::schema(const Schema& schema) {
  const std::size_t record = begin(Opcode::kSchema);
  number(schema.id);
  string(schema.name);
  string(schema.encoding);
  blob(schema.data);
  end(record);
}

void Encoder::channel(const Channel& channel) {
  const std::size_t record = begin(Opcode::kChannel);
  number(channel.id);
  number(channel.schema_id);
  string(channel.topic);
  string(channel.message_encoding);
  map(channel.metadata);
  end(record);
}

void Encoder::message(const Message& message) {
  buffer_.reserve(buffer_.size() + kRecordHeaderSize + kMessageHeaderSize + message.data.size());
  number(static_cast<std::uint8_t>(Opcode::kMessage));
  number(std::uint64_t{kMessageHeaderSize + message.data.size()});
  number(message.channel_id);
  number(message.sequence);
  number(message.log_time);
  number(message.publish_time);
  bytes(message.data);
}

void Encoder::message_index(std::uint16_t channel, std::span<const MessageIndexEntry> entries) {
  static_assert(sizeof(MessageIndexEntry) == 16, "an entry is copied as it is");
  const std::size_t record = begin(Opcode::kMessageIndex);
  number(channel);
  number(length_of(entries.size_bytes()));
  bytes(std::as_bytes(entries));
  end(record);
}

void Encoder::metadata(const Metadata& metadata) {
  Entries entries = metadata.entries;
  if (!entries.emplace(kChecksumEntry, checksum_of(metadata)).second) {
    throw InvalidArgument("metadata '" + metadata.name + "' has an entry '" + kChecksumEntry +
                          "', which is added when it is written");
  }
  const std::size_t record = begin(Opcode::kMetadata);
  string(metadata.name);
  map(entries);
  end(record);
}

void Encoder::attachment(const Attachment& attachment) {
  buffer_.reserve(buffer_.size() + attachment.data.size() + attachment.name.size() +
                  attachment.media_type.size() + 64);
  const std::size_t record = begin(Opcode::kAttachment);
  number(attachment.log_time);
  number(attachment.create_time);
  string(attachment.name);
  string(attachment.media_type);
  number(std::uint64_t{attachment.data.size()});
  bytes(bytes_of(attachment.data));
  number(checksum(buffer_.view().subspan(record + kRecordHeaderSize)));
  end(record);
}

// ---- Decoder ----

std::span<const std::byte> Decoder::take(std::uint64_t size) noexcept {
  if (!is_whole_ || size > rest_.size()) {
    is_whole_ = false;
    return {};
  }
  const auto bytes = rest_.first(size);
  rest_ = rest_.subspan(size);
  return bytes;
}

std::string_view Decoder::blob() noexcept { return text_of(array()); }

std::string_view Decoder::string() noexcept {
  const std::string_view text = blob();
  if (is_utf8(text)) return text;
  is_whole_ = false;
  return {};
}

Entries Decoder::map() {
  // An entry takes at least 8 bytes in a file and about 100 in memory.
  constexpr std::size_t kMaxNumEntries = 100'000;
  Entries entries;
  Decoder decoder(array());
  while (is_whole_ && !decoder.rest().empty()) {
    const std::string_view key = decoder.string();
    const std::string_view value = decoder.string();
    is_whole_ =
        decoder.is_whole() && entries.size() < kMaxNumEntries && entries.emplace(key, value).second;
  }
  return entries;
}

// ---- records ----

std::optional<Header> decode_header(std::span<const std::byte> content) {
  Decoder decoder(content);
  Header header;
  header.profile = decoder.string();
  header.library = decoder.string();
  if (!decoder.is_exact()) return std::nullopt;
  return header;
}

std::optional<Schema> decode_schema(std::span<const std::byte> content) {
  Decoder decoder(content);
  Schema schema;
  schema.id = decoder.number<std::uint16_t>();
  schema.name = decoder.string();
  schema.encoding = decoder.string();
  schema.data = decoder.blob();
  if (!decoder.is_exact() || schema.id == 0) return std::nullopt;
  return schema;
}

std::optional<Channel> decode_channel(std::span<const std::byte> content) {
  Decoder decoder(content);
  Channel channel;
  channel.id = decoder.number<std::uint16_t>();
  channel.schema_id = decoder.number<std::uint16_t>();
  channel.topic = decoder.string();
  channel.message_encoding = decoder.string();
  channel.metadata = decoder.map();
  if (!decoder.is_exact()) return std::nullopt;
  return channel;
}

std::optional<Message> decode_message(std::span<const std::byte> content) noexcept {
  Decoder decoder(content);
  Message message;
  message.channel_id = decoder.number<std::uint16_t>();
  message.sequence = decoder.number<std::uint32_t>();
  message.log_time = decoder.number<std::uint64_t>();
  message.publish_time = decoder.number<std::uint64_t>();
  message.data = decoder.rest();
  if (!decoder.is_whole()) return std::nullopt;
  return message;
}

std::optional<ChunkHeader> decode_chunk_header(std::span<const std::byte> content,
                                               std::uint64_t length) {
  Decoder decoder(content);
  ChunkHeader header;
  header.first_time = decoder.number<std::uint64_t>();
  header.last_time = decoder.number<std::uint64_t>();
  header.uncompressed_size = decoder.number<std::uint64_t>();
  header.uncompressed_checksum = decoder.number<std::uint32_t>();
  header.compression = decoder.string();
  header.compressed_size = decoder.number<std::uint64_t>();
  header.size = content.size() - decoder.rest().size();
  if (!decoder.is_whole() || header.size > length ||
      header.compressed_size != length - header.size) {
    return std::nullopt;
  }
  return header;
}

std::optional<MessageIndex> decode_message_index(std::span<const std::byte> content) noexcept {
  Decoder decoder(content);
  MessageIndex index;
  index.channel = decoder.number<std::uint16_t>();
  index.entries = decoder.array();
  if (!decoder.is_exact() || index.entries.size() % sizeof(MessageIndexEntry) != 0) {
    return std::nullopt;
  }
  return index;
}

MessageIndexEntry entry_of(const MessageIndex& index, std::size_t i) noexcept {
  MessageIndexEntry entry;
  std::memcpy(&entry, index.entries.data() + i * sizeof(entry), sizeof(entry));
  return entry;
}

std::optional<Footer> decode_footer(std::span<const std::byte> content) noexcept {
  Decoder decoder(content);
  Footer footer;
  footer.summary_start = decoder.number<std::uint64_t>();
  footer.summary_offset_start = decoder.number<std::uint64_t>();
  footer.summary_checksum = decoder.number<std::uint32_t>();
  if (!decoder.is_exact()) return std::nullopt;
  return footer;
}

std::optional<Statistics> decode_statistics(std::span<const std::byte> content) {
  Decoder decoder(content);
  Statistics statistics;
  statistics.message_count = decoder.number<std::uint64_t>();
  statistics.schema_count = decoder.number<std::uint16_t>();
  statistics.channel_count = decoder.number<std::uint32_t>();
  statistics.attachment_count = decoder.number<std::uint32_t>();
  statistics.metadata_count = decoder.number<std::uint32_t>();
  statistics.chunk_count = decoder.number<std::uint32_t>();
  statistics.first_time = decoder.number<std::uint64_t>();
  statistics.last_time = decoder.number<std::uint64_t>();
  Decoder counts(decoder.array());
  while (counts.is_whole() && !counts.rest().empty()) {
    const auto channel = counts.number<std::uint16_t>();
    statistics.channel_message_counts[channel] = counts.number<std::uint64_t>();
  }
  if (!decoder.is_whole() || !counts.is_whole()) return std::nullopt;
  return statistics;
}

std::optional<Checked<Metadata>> decode_metadata(std::span<const std::byte> content) {
  Decoder decoder(content);
  Checked<Metadata> metadata;
  metadata.record.name = decoder.string();
  metadata.record.entries = decoder.map();
  if (!decoder.is_exact()) return std::nullopt;
  const auto entry = metadata.record.entries.find(kChecksumEntry);
  // Other programs may use this entry for something else.
  if (entry != metadata.record.entries.end() && is_checksum(entry->second)) {
    metadata.has_checksum = true;
    metadata.is_right = checksum_of(metadata.record) == entry->second;
    metadata.record.entries.erase(entry);
  }
  return metadata;
}

std::optional<Checked<Attachment>> decode_attachment(std::span<const std::byte> content) {
  Decoder decoder(content);
  Checked<Attachment> attachment;
  attachment.record.log_time = decoder.number<std::uint64_t>();
  attachment.record.create_time = decoder.number<std::uint64_t>();
  attachment.record.name = decoder.string();
  attachment.record.media_type = decoder.string();
  attachment.record.data = text_of(decoder.take(decoder.number<std::uint64_t>()));
  const auto written = decoder.number<std::uint32_t>();
  if (!decoder.is_exact()) return std::nullopt;
  attachment.has_checksum = written != 0;
  attachment.is_right =
      written == 0 || written == checksum(content.first(content.size() - sizeof(written)));
  return attachment;
}

}  // namespace trifinger::mcap
