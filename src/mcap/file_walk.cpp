// SPDX-License-Identifier: BSD-3-Clause
#include "file_walk.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <set>
#include <string_view>

#include "damage_list.hpp"
#include "memory_use.hpp"

namespace trifinger::mcap {
namespace {

// Messages outside of chunks are returned in runs of at most this size [bytes].
constexpr std::uint64_t kMaxRunSize = std::uint64_t{1} << 20;
constexpr std::string_view kNonsense = "A record makes no sense.";
constexpr std::string_view kTooLong =
    "A record is longer than what is left: it was cut off, or its length is damaged.";
constexpr std::string_view kWrongIndex = "A message index does not fit its chunk.";

std::uint64_t end_of(const ChunkPlace& place) noexcept {
  return place.offset + place.length + place.index_length;
}

}  // namespace

FileWalk::FileWalk(const Source& source, const ReaderOptions& options)
    : options_(options),
      window_(source, options.max_record_size),
      loader_(source, options.max_record_size) {
  // More than any honest file needs: the search costs each byte once, plus some for each chunk that
  // is found.
  constexpr std::uint64_t kMaxSize = std::numeric_limits<std::uint64_t>::max() / 32;
  search_budget_ =
      16 * std::min(window_.size(), kMaxSize) + std::min(options.max_record_size, kMaxSize);
}

// ---- record by record ----

std::uint64_t FileWalk::walk(std::uint64_t begin, std::uint64_t end) {
  std::uint64_t offset = begin;
  std::uint64_t whole_end = begin;
  while (offset < end) {
    const auto header = window_.header_at(offset, end);
    if (header && header->opcode != Opcode::kMessageIndex) settle_chunk();
    const Step step = header ? visit(offset, *header, end) : Step::kLost;
    if (step == Step::kGoOn) {
      offset += header->record_length();
      whole_end = offset;
    } else if (step == Step::kDataEnd) {
      add_damage(offset, end - offset, "The file has an end, but its summary is not whole.");
      return offset;
    } else {
      must_look_inside_ = true;  // the record may have been a message index
      settle_chunk();
      const auto next = find_record(offset + 1, end);
      add_damage(offset, next.value_or(end) - offset, std::string(header ? kNonsense : kTooLong));
      offset = next.value_or(end);
    }
  }
  settle_chunk();
  return whole_end;
}

FileWalk::Step FileWalk::visit(std::uint64_t offset, const RecordHeader& header,
                               std::uint64_t end) {
  const auto skip = [&](std::string reason) {
    add_damage(offset, header.record_length(), std::move(reason));
    return Step::kGoOn;
  };
  switch (header.opcode) {
    case Opcode::kHeader: {
      const auto decoded = decode_header(window_.content_at(offset, header));
      if (!decoded) return Step::kLost;
      if (offset != kMagic.size()) return skip("A second header.");
      contents_.profile = decoded->profile;
      contents_.library = decoded->library;
      return Step::kGoOn;
    }
    case Opcode::kSchema:
    case Opcode::kChannel: {
      std::string reason = define(header.opcode, window_.content_at(offset, header));
      if (reason == kNonsense) return Step::kLost;
      return reason.empty() ? Step::kGoOn : skip(std::move(reason));
    }
    case Opcode::kMessage:
      return visit_message(offset, header);
    case Opcode::kChunk:
      return visit_chunk(offset, header);
    case Opcode::kMessageIndex:
      return visit_message_index(offset, header);
    case Opcode::kAttachment:
      return visit_checked(offset, header, decode_attachment(window_.content_at(offset, header)),
                           contents_.attachments, contents_.attachment_places,
                           is_proven_attachment_);
    case Opcode::kMetadata:
      return visit_checked(offset, header, decode_metadata(window_.content_at(offset, header)),
                           contents_.metadata, contents_.metadata_places, is_proven_metadata_);
    case Opcode::kDataEnd:
      return header.length == kDataEndSize - kRecordHeaderSize ? Step::kDataEnd : Step::kLost;
    case Opcode::kNone:
    case Opcode::kFooter:
    case Opcode::kChunkIndex:
    case Opcode::kAttachmentIndex:
    case Opcode::kStatistics:
    case Opcode::kMetadataIndex:
    case Opcode::kSummaryOffset:
      return Step::kLost;  // these records belong to the summary
  }
  // The type may be new or damaged. If it is damaged, the length may be wrong, too.
  if (!is_boundary(offset + header.record_length(), end)) return Step::kLost;
  return skip("A record of a type that this version does not know.");
}

FileWalk::Step FileWalk::visit_message(std::uint64_t offset, const RecordHeader& header) {
  const std::uint64_t length = header.record_length();
  const auto message = decode_message(window_.at(offset + kRecordHeaderSize, kMessageHeaderSize));
  if (!message || header.length < kMessageHeaderSize || length > options_.max_record_size) {
    return Step::kLost;
  }
  if (has_chunk_) {
    // The message has no checksum. Programs that write chunks put all messages into them, so this
    // is more likely a message index whose first byte is damaged.
    add_damage(offset, length, "A message outside of the chunks.");
    return Step::kGoOn;
  }
  auto& chunks = contents_.chunks;
  if (chunks.empty() || end_of(chunks.back()) != offset ||
      chunks.back().length + length > std::max(kMaxRunSize, length)) {
    chunks.push_back({.offset = offset,
                      .first_time = message->log_time,
                      .last_time = message->log_time,
                      .is_chunk = false});
    counts_.emplace_back();
  }
  ChunkPlace& run = chunks.back();
  run.length += length;
  run.uncompressed_size = run.length;
  run.first_time = std::min(run.first_time, message->log_time);
  run.last_time = std::max(run.last_time, message->log_time);
  ++counts_.back()[message->channel_id];
  return Step::kGoOn;
}

std::optional<ChunkPlace> FileWalk::describe_chunk(std::uint64_t offset,
                                                   const RecordHeader& header) {
  constexpr std::uint64_t kMaxHeaderSize = 64;  // large enough for all known compressions
  const auto chunk = decode_chunk_header(
      window_.at(offset + kRecordHeaderSize, std::min(kMaxHeaderSize, header.length)),
      header.length);
  if (!chunk) return std::nullopt;
  writes_checksums_ |= chunk->uncompressed_checksum != 0;
  return ChunkPlace{.offset = offset,
                    .length = header.record_length(),
                    .first_time = chunk->first_time,
                    .last_time = chunk->last_time,
                    .uncompressed_size = chunk->uncompressed_size,
                    // An unknown compression is reported when the chunk is read.
                    .compression = compression_of(chunk->compression).value_or(Compression::kNone)};
}

FileWalk::Step FileWalk::visit_chunk(std::uint64_t offset, const RecordHeader& header) {
  auto place = describe_chunk(offset, header);
  if (!place) return Step::kLost;
  has_chunk_ = true;
  is_chunk_open_ = true;
  must_look_inside_ = options_.verify || (place->compression == Compression::kNone &&
                                          place->length != chunk_header_size(Compression::kNone) +
                                                               place->uncompressed_size);
  contents_.chunks.push_back(std::move(*place));
  counts_.emplace_back();
  return Step::kGoOn;
}

FileWalk::Step FileWalk::visit_message_index(std::uint64_t offset, const RecordHeader& header) {
  constexpr std::size_t kPrefixSize = 6;
  const std::uint64_t begin = offset + kRecordHeaderSize;
  Decoder decoder(window_.at(begin, kPrefixSize));
  const auto channel = decoder.number<std::uint16_t>();
  const auto size = decoder.number<std::uint32_t>();
  if (!decoder.is_whole() || header.length != kPrefixSize + std::uint64_t{size} ||
      size % sizeof(MessageIndexEntry) != 0) {
    return Step::kLost;
  }
  // The index of a damaged chunk is useless.
  if (!is_chunk_open_) return Step::kGoOn;
  ChunkPlace& place = contents_.chunks.back();
  place.indexes.emplace_back(channel, offset);
  place.index_length += header.record_length();
  const std::uint64_t num_entries = size / sizeof(MessageIndexEntry);
  if (num_entries == 0) return Step::kGoOn;

  const auto time_at = [&](std::uint64_t i) {
    return Decoder(window_.at(begin + kPrefixSize + i * sizeof(MessageIndexEntry), 8))
        .number<std::uint64_t>();
  };
  const std::uint64_t first = time_at(0);
  const std::uint64_t last = time_at(num_entries - 1);
  auto& counts = counts_.back();
  first_indexed_time_ = counts.empty() ? first : std::min(first_indexed_time_, first);
  last_indexed_time_ = counts.empty() ? last : std::max(last_indexed_time_, last);
  counts[channel] += num_entries;
  return Step::kGoOn;
}

template <class T>
FileWalk::Step FileWalk::visit_checked(std::uint64_t offset, const RecordHeader& header,
                                       std::optional<Checked<T>> decoded, std::vector<T>& list,
                                       std::vector<RecordPlace>& places,
                                       std::vector<bool>& is_proven) {
  if (!decoded) return Step::kLost;
  const RecordPlace place{.offset = offset, .length = header.record_length()};
  if (!decoded->is_right) {
    add_damage(place.offset, place.length, "The checksum of attached data is wrong.");
  } else if (!keep(memory_of(decoded->record))) {
    add_damage(place.offset, place.length, "There is more attached data than allowed.");
  } else {
    list.push_back(std::move(decoded->record));
    places.push_back(place);
    is_proven.push_back(decoded->has_checksum);
  }
  return Step::kGoOn;
}

void FileWalk::settle_chunk() {
  if (!is_chunk_open_) return;
  is_chunk_open_ = false;
  ChunkPlace& place = contents_.chunks.back();
  MessageCounts& counts = counts_.back();
  const bool knows_all = std::ranges::all_of(
      counts, [&](const auto& count) { return contents_.channels.contains(count.first); });
  if (!must_look_inside_ && !counts.empty() && knows_all &&
      place.first_time == first_indexed_time_ && place.last_time == last_indexed_time_) {
    return;
  }
  std::string reason = load(place);
  if (!reason.empty()) {
    add_damage(place.offset, place.length + place.index_length, std::move(reason));
    contents_.chunks.pop_back();
    counts_.pop_back();
    return;
  }
  counts = count_messages();
  correct_times(place);
  if (!options_.verify) return;
  for (const auto& index : place.indexes) {
    if (is_right_index(index)) continue;
    const auto header = window_.header_at(index.second, window_.size()).value_or(RecordHeader());
    add_damage(index.second, header.record_length(), std::string(kWrongIndex));
  }
}

FileWalk::MessageCounts FileWalk::count_messages() const {
  MessageCounts counts;
  for (const Message& message : loader_.messages()) ++counts[message.channel_id];
  return counts;
}

// ---- lost ----

std::optional<std::uint64_t> FileWalk::find_record(std::uint64_t begin, std::uint64_t end) {
  while (begin < end && end - begin > kRecordHeaderSize) {
    const auto bytes = window_.from(begin, kRecordHeaderSize);
    if (bytes.size() < kRecordHeaderSize) break;
    std::size_t i = 0;
    for (; i + kRecordHeaderSize <= bytes.size(); ++i) {
      const auto opcode = static_cast<Opcode>(bytes[i]);
      if (opcode != Opcode::kChunk && opcode != Opcode::kAttachment &&
          opcode != Opcode::kMetadata) {
        continue;
      }
      std::uint64_t length = 0;
      std::memcpy(&length, bytes.data() + i + 1, sizeof(length));
      const std::uint64_t offset = begin + i;
      if (offset >= end || end - offset < kRecordHeaderSize ||
          length > end - offset - kRecordHeaderSize || length > options_.max_record_size) {
        continue;
      }
      if (is_proven(offset, {.opcode = opcode, .length = length})) return offset;
      ++i;
      break;  // the window has moved
    }
    begin += i;
  }
  return std::nullopt;
}

bool FileWalk::is_proven(std::uint64_t offset, const RecordHeader& header) {
  const std::uint64_t length = header.record_length();
  switch (header.opcode) {
    case Opcode::kChunk: {
      const auto place = describe_chunk(offset, header);
      return place && place->uncompressed_size <= options_.max_record_size &&
             spend(length + place->uncompressed_size) && load(*place).empty() &&
             !(loader_.messages().empty() && loader_.definitions().empty());
    }
    case Opcode::kAttachment: {
      if (!spend(length)) return false;
      const auto attachment = decode_attachment(window_.content_at(offset, header));
      return attachment && attachment->has_checksum && attachment->is_right;
    }
    case Opcode::kMetadata: {
      if (!spend(length)) return false;
      const auto metadata = decode_metadata(window_.content_at(offset, header));
      return metadata && metadata->has_checksum && metadata->is_right;
    }
    default:
      return false;
  }
}

bool FileWalk::is_boundary(std::uint64_t offset, std::uint64_t end) {
  if (offset == end) return true;
  const auto header = window_.header_at(offset, end);
  return header && header->opcode >= Opcode::kHeader && header->opcode <= Opcode::kDataEnd;
}

bool FileWalk::spend(std::uint64_t cost) noexcept {
  if (cost > search_budget_) return false;
  search_budget_ -= cost;
  return true;
}

// ---- after the last record ----

void FileWalk::leave_out_unproven() {
  // Only our writer adds checksums to metadata. Other programs add them to attachments, too.
  const bool is_ours = std::ranges::find(is_proven_metadata_, true) != is_proven_metadata_.end();
  if (is_ours) {
    leave_out_unproven(contents_.metadata, contents_.metadata_places, is_proven_metadata_);
  }
  if (is_ours || writes_checksums_) {
    leave_out_unproven(contents_.attachments, contents_.attachment_places, is_proven_attachment_);
  }
}

template <class T>
void FileWalk::leave_out_unproven(std::vector<T>& list, std::vector<RecordPlace>& places,
                                  const std::vector<bool>& is_proven) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (!is_proven[i]) {
      add_damage(places[i].offset, places[i].length, "The checksum of attached data is missing.");
      continue;
    }
    if (kept != i) list[kept] = std::move(list[i]);
    places[kept++] = places[i];
  }
  list.resize(kept);
  places.resize(kept);
}

std::uint64_t FileWalk::cut_damaged_tail(std::uint64_t end) {
  auto& chunks = contents_.chunks;
  for (;;) {
    const auto damage = std::ranges::find_if(contents_.damage, [end](const Damage& piece) {
      return piece.offset >= kMagic.size() && piece.offset < end &&
             piece.offset + piece.size >= end;
    });
    if (damage != contents_.damage.end()) {
      end = damage->offset;
      continue;
    }
    if (chunks.empty() || !chunks.back().is_chunk || end_of(chunks.back()) != end) return end;
    // After a loss of power, a file may have the right size and wrong bytes. So the last chunk is
    // checked.
    ChunkPlace& place = chunks.back();
    if (std::string reason = load(place); !reason.empty()) {
      add_damage(place.offset, place.length + place.index_length, std::move(reason));
      chunks.pop_back();
      counts_.pop_back();
      continue;
    }
    correct_times(place);
    counts_.back() = count_messages();
    const auto wrong = std::ranges::find_if_not(
        place.indexes, [this](const auto& index) { return is_right_index(index); });
    if (wrong != place.indexes.end()) {
      add_damage(wrong->second, end - wrong->second, std::string(kWrongIndex));
      end = wrong->second;
      place.index_length = end - place.offset - place.length;
      place.indexes.erase(wrong, place.indexes.end());
    }
    find_missing_indexes(place);
    return end;
  }
}

void FileWalk::find_missing_indexes(const ChunkPlace& place) {
  std::set<std::uint16_t> indexed;
  for (const auto& [channel, offset] : place.indexes) indexed.insert(channel);
  for (const Message& message : loader_.messages()) {
    if (indexed.contains(message.channel_id)) continue;
    contents_.missing_indexes[message.channel_id].push_back(
        {.log_time = message.log_time, .offset = loader_.offset_of(message)});
  }
  for (auto& [channel, entries] : contents_.missing_indexes) sort_by_time(entries);
}

void FileWalk::sum_up_counts() {
  for (const MessageCounts& counts : counts_) {
    for (const auto& [channel, count] : counts) {
      contents_.message_count += count;
      contents_.channel_message_counts[channel] += count;
    }
  }
  counts_.clear();
}

// ---- chunks, schemas and channels ----

bool FileWalk::adopt(std::map<std::uint16_t, Schema> schemas,
                     std::map<std::uint16_t, Channel> channels) {
  std::uint64_t memory = 0;
  for (const auto& [id, schema] : schemas) memory += memory_of(schema);
  for (const auto& [id, channel] : channels) memory += memory_of(channel);
  if (!keep(memory)) return false;
  contents_.schemas = std::move(schemas);
  contents_.channels = std::move(channels);
  return true;
}

void FileWalk::adopt(ChunkPlace place) {
  has_chunk_ = true;
  contents_.chunks.push_back(std::move(place));
}

void FileWalk::add_damage(std::uint64_t offset, std::uint64_t size, std::string reason) {
  mcap::add_damage(contents_.damage, {.offset = offset, .size = size, .reason = std::move(reason)});
}

bool FileWalk::is_right_index(const std::pair<std::uint16_t, std::uint64_t>& index) {
  const auto header = window_.header_at(index.second, window_.size());
  const auto decoded =
      header ? decode_message_index(window_.content_at(index.second, *header)) : std::nullopt;
  return decoded && loader_.has_messages(index.first, *decoded);
}

std::string FileWalk::load(const ChunkPlace& place) {
  std::string reason = loader_.load(place);
  for (const ChunkLoader::DefinitionRecord& record : loader_.definitions()) {
    if (reason.empty()) reason = define(record.opcode, record.content);
  }
  return reason;
}

void FileWalk::correct_times(ChunkPlace& place) {
  const auto messages = loader_.messages();
  if (messages.empty()) return;
  const auto [first, last] = std::ranges::minmax_element(messages, {}, &Message::log_time);
  if (place.first_time == first->log_time && place.last_time == last->log_time) return;
  place.first_time = first->log_time;
  place.last_time = last->log_time;
  add_damage(place.offset + kRecordHeaderSize, 2 * sizeof(std::uint64_t),
             "The times in the header of the chunk are wrong; its messages are right.");
}

std::string FileWalk::define(Opcode opcode, std::span<const std::byte> content) {
  if (opcode == Opcode::kSchema) {
    const auto schema = decode_schema(content);
    return schema ? define_in(contents_.schemas, *schema, "schema") : std::string(kNonsense);
  }
  const auto channel = decode_channel(content);
  return channel ? define_in(contents_.channels, *channel, "channel") : std::string(kNonsense);
}

template <class T>
std::string FileWalk::define_in(std::map<std::uint16_t, T>& known, const T& definition,
                                const char* what) {
  const auto before = known.find(definition.id);
  if (before == known.end()) {
    if (!keep(memory_of(definition))) return "There are more schemas and channels than allowed.";
    known.emplace(definition.id, definition);
  } else if (before->second != definition) {
    return std::string("The ") + what + ' ' + std::to_string(definition.id) +
           " is defined anew, otherwise than before.";
  }
  return {};
}

bool FileWalk::keep(std::uint64_t memory) noexcept {
  if (memory > options_.max_record_size - kept_) return false;
  kept_ += memory;
  return true;
}

}  // namespace trifinger::mcap
