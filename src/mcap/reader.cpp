// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/mcap/reader.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <limits>
#include <string_view>
#include <utility>

#include "chunk_loader.hpp"
#include "encoding.hpp"
#include "trifinger/base/error.hpp"
#include "window.hpp"

namespace trifinger::mcap {
namespace {

// Messages outside of chunks are handed out in pieces of this size [bytes].
constexpr std::uint64_t kMaxRunSize = std::uint64_t{1} << 20;
// More pieces of damage are summed up: a hostile file could ask for any amount of memory.
constexpr std::size_t kMaxNumDamages = 1000;

constexpr std::string_view kNonsense = "A record makes no sense.";
constexpr std::string_view kNotBegun = "The file ends before it has begun.";

struct RecordHeader {
  Opcode opcode{};
  std::uint64_t length{0};  // of the content
};

// The summary of a finished file.
struct Summary {
  std::uint64_t begin{0};
  std::map<std::uint16_t, Schema> schemas{};
  std::map<std::uint16_t, Channel> channels{};
  std::optional<Statistics> statistics{};
  std::vector<ChunkPlace> chunks{};
  std::vector<RecordPlace> attachments{};
  std::vector<RecordPlace> metadata{};
};

// Channel, number of its messages.
using MessageCounts = std::vector<std::pair<std::uint16_t, std::uint64_t>>;

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
  // If we do not know it, that is told when the chunk is read.
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

// False if the record makes no sense.
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

std::uint64_t end_of(const ChunkPlace& place) noexcept {
  return place.offset + place.length + place.index_length;
}

std::uint64_t saturating_add(std::uint64_t a, std::uint64_t b) noexcept {
  constexpr auto kMax = std::numeric_limits<std::uint64_t>::max();
  return a > kMax - b ? kMax : a + b;
}

// About the bytes that something takes in memory.
constexpr std::uint64_t kNodeSize = 128;

std::uint64_t memory_of(const Entries& entries) {
  std::uint64_t size = 0;
  for (const auto& [key, value] : entries) size += key.size() + value.size() + kNodeSize;
  return size;
}

std::uint64_t memory_of(const Schema& schema) {
  return schema.name.size() + schema.encoding.size() + schema.data.size() + 2 * kNodeSize;
}

std::uint64_t memory_of(const Channel& channel) {
  return channel.topic.size() + channel.message_encoding.size() + memory_of(channel.metadata) +
         2 * kNodeSize;
}

std::uint64_t memory_of(const Metadata& metadata) {
  return metadata.name.size() + memory_of(metadata.entries) + kNodeSize;
}

std::uint64_t memory_of(const Attachment& attachment) {
  return attachment.name.size() + attachment.media_type.size() + attachment.data.size() + kNodeSize;
}

std::string hex_of(std::span<const std::byte> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::byte byte : bytes) {
    if (!text.empty()) text += ' ';
    text += kDigits[std::to_integer<std::size_t>(byte) >> 4U];
    text += kDigits[std::to_integer<std::size_t>(byte) & 15U];
  }
  return text;
}

}  // namespace

class Reader::Implementation {
 public:
  Implementation(std::unique_ptr<Source> source, const ReaderOptions& options,
                 const std::string& name);

  [[nodiscard]] const Contents& contents() const noexcept { return contents_; }
  [[nodiscard]] std::optional<std::span<const Message>> read_chunk(std::size_t index);

 private:
  // ---- opening ----

  // False if the file ends before it has begun.
  [[nodiscard]] bool has_magic(const std::string& name);
  [[nodiscard]] bool has_magic_at_end();
  // Nothing if the file is not finished, or the checksum of the summary is wrong.
  [[nodiscard]] std::optional<Footer> read_footer();
  [[nodiscard]] std::optional<Summary> read_summary(std::uint64_t begin);
  // False, and nothing was done, if the summary does not tell of all that there is.
  [[nodiscard]] bool open_by(Summary& summary);
  void walk_finished(std::uint64_t data_end);
  void walk_unfinished();
  // Returns where what is whole, or stands between what is whole, ends.
  [[nodiscard]] std::uint64_t cut_damaged_tail(std::uint64_t end);
  void find_missing_indexes();
  // Who writes one checksum writes all: where it is missing, it is damaged.
  void leave_out_unproven();
  template <class T>
  void leave_out_unproven(std::vector<T>& list, std::vector<RecordPlace>& places,
                          const std::vector<bool>& is_proven);
  void check_data_end(std::uint64_t offset);
  void check_message_count(const Summary& summary);

  // ---- record by record ----

  enum class Step : std::uint8_t {
    kGoOn,     // the record was understood, or its damage was named
    kLost,     // it makes no sense: perhaps its length does not either
    kDataEnd,  // what follows is the summary
  };

  // Takes in the records from `begin` to `end`; returns the end of the last one that is whole.
  std::uint64_t walk(std::uint64_t begin, std::uint64_t end);
  [[nodiscard]] Step visit(std::uint64_t offset, const RecordHeader& header, std::uint64_t end);
  [[nodiscard]] Step visit_message(std::uint64_t offset, const RecordHeader& header);
  [[nodiscard]] Step visit_chunk(std::uint64_t offset, const RecordHeader& header);
  [[nodiscard]] std::optional<ChunkPlace> describe_chunk(std::uint64_t offset,
                                                         const RecordHeader& header);
  [[nodiscard]] Step visit_message_index(std::uint64_t offset, const RecordHeader& header);
  template <class T>
  [[nodiscard]] Step visit_checked(std::uint64_t offset, const RecordHeader& header,
                                   std::optional<Checked<T>> decoded, std::vector<T>& list,
                                   std::vector<RecordPlace>& places, std::vector<bool>& is_proven);
  // All message indexes of the newest chunk were visited.
  void settle_chunk();
  // Of the chunk that was loaded last.
  [[nodiscard]] bool is_right_index(const std::pair<std::uint16_t, std::uint64_t>& index);

  // The next record from `begin` on that proves by a checksum to be one.
  [[nodiscard]] std::optional<std::uint64_t> find_record(std::uint64_t begin, std::uint64_t end);
  [[nodiscard]] bool is_proven(std::uint64_t offset, const RecordHeader& header);
  // True if a record could begin here.
  [[nodiscard]] bool is_boundary(std::uint64_t offset, std::uint64_t end);
  // False if the search has cost too much already.
  [[nodiscard]] bool spend(std::uint64_t cost) noexcept;

  // ---- tools ----

  [[nodiscard]] std::optional<RecordHeader> read_header(std::uint64_t offset);
  // The content of a record, until the next look at the file; less if it is larger than allowed.
  [[nodiscard]] std::span<const std::byte> content(std::uint64_t offset,
                                                   const RecordHeader& header);
  [[nodiscard]] std::uint32_t checksum_between(std::uint64_t begin, std::uint64_t end);
  void add_damage(std::uint64_t offset, std::uint64_t size, std::string reason);
  // False if there is too much already.
  [[nodiscard]] bool keep(std::uint64_t memory) noexcept;
  // These return why not, as a sentence; empty if it was done.
  [[nodiscard]] std::string define(Opcode opcode, std::span<const std::byte> content);
  template <class T>
  [[nodiscard]] std::string define_in(std::map<std::uint16_t, T>& known, const T& definition,
                                      const char* what);
  [[nodiscard]] std::string load(const ChunkPlace& place);
  // The messages are right even if the times in the header of their chunk are not.
  void correct_times(ChunkPlace& place);
  [[nodiscard]] MessageCounts count_messages() const;
  void sum_up_counts();

  std::unique_ptr<Source> source_;
  ReaderOptions options_;
  std::uint64_t size_;
  Window window_;
  ChunkLoader loader_;
  Contents contents_;
  std::vector<bool> is_damaged_;  // for each chunk
  std::uint64_t kept_{0};         // memory of what `contents_` owns
  std::uint64_t search_budget_;   // bytes

  // Of the walk.
  bool has_header_{false};
  bool has_chunk_{false};
  bool is_chunk_open_{false};     // message indexes may follow
  bool must_look_inside_{false};  // the open chunk is not described well enough from outside
  std::uint64_t first_indexed_time_{0};
  std::uint64_t last_indexed_time_{0};
  std::vector<MessageCounts> counts_;  // for each chunk of the walk
  bool writes_checksums_{false};       // whoever wrote the file
  std::vector<bool> is_proven_metadata_;
  std::vector<bool> is_proven_attachment_;
};

// ---- opening ----

Reader::Implementation::Implementation(std::unique_ptr<Source> source, const ReaderOptions& options,
                                       const std::string& name)
    : source_(std::move(source)),
      options_(options),
      size_(source_->size()),
      window_(*source_),
      loader_(*source_, options.max_record_size),
      // Enough for any honest file: each byte is looked at, and a few chunks are decompressed.
      search_budget_(saturating_add(size_ > std::numeric_limits<std::uint64_t>::max() / 16
                                        ? std::numeric_limits<std::uint64_t>::max()
                                        : size_ * 16,
                                    options.max_record_size)) {
  if (!has_magic(name)) return;
  const auto footer = read_footer();
  std::optional<Summary> summary;
  if (footer && footer->summary_start != 0) summary = read_summary(footer->summary_start);
  if (summary) {
    if (options_.verify || !open_by(*summary)) walk_finished(summary->begin - kDataEndSize);
    check_message_count(*summary);
  } else if (footer && footer->summary_start == 0) {
    walk_finished(size_ - kMagic.size() - kFooterSize - kDataEndSize);
  } else {
    walk_unfinished();
  }
  is_damaged_.resize(contents_.chunks.size());
}

bool Reader::Implementation::has_magic(const std::string& name) {
  const auto bytes = window_.at(0, kMagic.size());
  if (std::equal(bytes.begin(), bytes.end(), kMagic.begin())) {
    if (bytes.size() == kMagic.size()) return true;
    add_damage(0, size_, std::string(kNotBegun));
    return false;
  }
  if (bytes.size() < kMagic.size()) throw FormatError(name + " is no MCAP file: it is too short");
  std::array<std::byte, kMagic.size()> magic{};
  std::ranges::copy(bytes, magic.begin());
  std::array<std::byte, kMagic.size()> of_version_0 = magic;
  of_version_0[kVersionByte] = kMagic[kVersionByte];
  const bool ends_well = has_magic_at_end();
  if (of_version_0 == kMagic && !ends_well) {
    throw FormatError(name + " is an MCAP file of version '" +
                      std::to_integer<char>(magic[kVersionByte]) +
                      "', which a later version of this program may read; this one reads '0'");
  }
  // A damaged byte should not cost the file.
  const auto header = read_header(kMagic.size());
  const bool has_header = header && header->opcode == Opcode::kHeader &&
                          decode_header(content(kMagic.size(), *header)).has_value();
  if (!ends_well && !has_header) {
    throw FormatError(name + " is no MCAP file: it begins with the bytes " + hex_of(magic) +
                      ", not with " + hex_of(kMagic));
  }
  add_damage(0, kMagic.size(), "The file does not begin as MCAP files do.");
  return true;
}

bool Reader::Implementation::has_magic_at_end() {
  return size_ >= 2 * kMagic.size() &&
         std::ranges::equal(window_.at(size_ - kMagic.size(), kMagic.size()), kMagic);
}

std::optional<Footer> Reader::Implementation::read_footer() {
  if (size_ < 2 * kMagic.size() + kDataEndSize + kFooterSize || !has_magic_at_end()) {
    return std::nullopt;
  }
  const std::uint64_t offset = size_ - kMagic.size() - kFooterSize;
  const auto header = read_header(offset);
  if (!header || header->opcode != Opcode::kFooter ||
      header->length != kFooterSize - kRecordHeaderSize) {
    return std::nullopt;
  }
  const auto footer = decode_footer(content(offset, *header));
  if (!footer) return std::nullopt;
  const std::uint64_t begin = footer->summary_start == 0 ? offset : footer->summary_start;
  if (begin < kMagic.size() + kDataEndSize || begin > offset) return std::nullopt;
  if (footer->summary_checksum != 0 &&
      footer->summary_checksum !=
          checksum_between(begin, size_ - kMagic.size() - sizeof(footer->summary_checksum))) {
    return std::nullopt;
  }
  return footer;
}

std::optional<Summary> Reader::Implementation::read_summary(std::uint64_t begin) {
  const std::uint64_t end = size_ - kMagic.size() - kFooterSize;
  if (end - begin > options_.max_record_size) return std::nullopt;
  Summary summary{.begin = begin};
  for (std::uint64_t offset = begin; offset < end;) {
    const auto header = read_header(offset);
    if (!header || end - offset < kRecordHeaderSize ||
        header->length > end - offset - kRecordHeaderSize ||
        !add_to(summary, header->opcode, content(offset, *header))) {
      return std::nullopt;
    }
    offset += kRecordHeaderSize + header->length;
  }
  return summary;
}

bool Reader::Implementation::open_by(Summary& summary) {
  const auto& statistics = summary.statistics;
  if (!statistics || statistics->chunk_count != summary.chunks.size() ||
      statistics->attachment_count != summary.attachments.size() ||
      statistics->metadata_count != summary.metadata.size()) {
    return false;
  }
  for (const auto& [id, count] : statistics->channel_message_counts) {
    const auto channel = summary.channels.find(id);
    if (channel == summary.channels.end()) return false;
    const std::uint16_t schema = channel->second.schema_id;
    if (schema != 0 && !summary.schemas.contains(schema)) return false;
  }
  std::uint64_t memory = 0;
  for (const auto& [id, schema] : summary.schemas) memory += memory_of(schema);
  for (const auto& [id, channel] : summary.channels) memory += memory_of(channel);
  if (memory > options_.max_record_size) return false;

  struct IndexedRecord {
    RecordPlace place;  // with the message indexes of a chunk
    bool is_chunk;
  };
  std::vector<IndexedRecord> records;
  for (const ChunkPlace& place : summary.chunks) {
    records.push_back({{place.offset, saturating_add(place.length, place.index_length)}, true});
  }
  for (const RecordPlace& place : summary.attachments) records.push_back({place, false});
  for (const RecordPlace& place : summary.metadata) records.push_back({place, false});
  std::ranges::sort(records, {}, [](const IndexedRecord& record) { return record.place.offset; });
  std::ranges::sort(summary.chunks, {}, &ChunkPlace::offset);
  const std::uint64_t data_end = summary.begin - kDataEndSize;
  std::uint64_t end = kMagic.size();
  for (const IndexedRecord& record : records) {
    // Nothing twice, nothing beyond the end.
    if (record.place.offset < end || record.place.length < kRecordHeaderSize ||
        record.place.offset > data_end || record.place.length > data_end - record.place.offset) {
      return false;
    }
    end = record.place.offset + record.place.length;
  }

  contents_.schemas = std::move(summary.schemas);
  contents_.channels = std::move(summary.channels);
  kept_ = memory;
  // What lies between the records of the index, as the header of the file, is looked at.
  end = kMagic.size();
  std::size_t num_chunks = 0;
  for (const IndexedRecord& record : records) {
    if (end < record.place.offset) walk(end, record.place.offset);
    end = record.place.offset + record.place.length;
    if (record.is_chunk) {
      has_chunk_ = true;
      contents_.chunks.push_back(std::move(summary.chunks[num_chunks++]));
    } else {
      walk(record.place.offset, end);
    }
  }
  if (end < data_end) walk(end, data_end);
  leave_out_unproven();
  check_data_end(data_end);
  contents_.message_count = statistics->message_count;
  contents_.channel_message_counts = statistics->channel_message_counts;
  contents_.complete_size = size_;
  contents_.is_finished = true;
  return true;
}

void Reader::Implementation::walk_finished(std::uint64_t data_end) {
  walk(kMagic.size(), data_end);
  leave_out_unproven();
  check_data_end(data_end);
  sum_up_counts();
  contents_.complete_size = size_;
  contents_.is_finished = true;
}

void Reader::Implementation::walk_unfinished() {
  const std::uint64_t walked_end = walk(kMagic.size(), size_);
  leave_out_unproven();
  const std::uint64_t end = cut_damaged_tail(walked_end);
  if (end == kMagic.size() && !has_header_) {
    contents_.damage = {{.offset = 0, .size = size_, .reason = std::string(kNotBegun)}};
    return;
  }
  contents_.complete_size = end;
  find_missing_indexes();
  sum_up_counts();
}

std::uint64_t Reader::Implementation::cut_damaged_tail(std::uint64_t end) {
  // A loss of power may leave the right size and the wrong bytes: what was written last is looked
  // at.
  auto& chunks = contents_.chunks;
  for (;;) {
    const auto last = std::ranges::find_if(contents_.damage, [end](const Damage& damage) {
      return damage.offset >= kMagic.size() && damage.offset < end &&
             damage.offset + damage.size >= end;
    });
    if (last != contents_.damage.end()) {
      end = last->offset;
      continue;
    }
    if (chunks.empty() || !chunks.back().is_chunk || end_of(chunks.back()) != end) return end;
    ChunkPlace& place = chunks.back();
    std::string reason = load(place);
    if (!reason.empty()) {
      add_damage(place.offset, place.length + place.index_length, std::move(reason));
      chunks.pop_back();
      counts_.pop_back();
      continue;
    }
    correct_times(place);
    const auto wrong = std::ranges::find_if_not(
        place.indexes, [this](const auto& index) { return is_right_index(index); });
    if (wrong == place.indexes.end()) return end;
    add_damage(wrong->second, end - wrong->second, "A message index does not fit its chunk.");
    place.index_length = wrong->second - place.offset - place.length;
    place.indexes.erase(wrong, place.indexes.end());
  }
}

void Reader::Implementation::find_missing_indexes() {
  if (contents_.chunks.empty()) return;
  const ChunkPlace& place = contents_.chunks.back();
  if (!place.is_chunk || end_of(place) != contents_.complete_size || !load(place).empty()) return;
  for (const Message& message : loader_.messages()) {
    const bool is_indexed = std::ranges::any_of(
        place.indexes, [&](const auto& index) { return index.first == message.channel_id; });
    if (is_indexed) continue;
    contents_.missing_indexes[message.channel_id].push_back(
        {.log_time = message.log_time, .offset = loader_.offset_of(message)});
  }
  for (auto& [channel, entries] : contents_.missing_indexes) {
    sort_by_time(entries);
  }
  counts_.back() = count_messages();
}

void Reader::Implementation::leave_out_unproven() {
  // Only we write those of metadata; others write those of attachments.
  const bool is_ours = std::ranges::find(is_proven_metadata_, true) != is_proven_metadata_.end();
  if (is_ours) {
    leave_out_unproven(contents_.metadata, contents_.metadata_places, is_proven_metadata_);
  }
  if (is_ours || writes_checksums_) {
    leave_out_unproven(contents_.attachments, contents_.attachment_places, is_proven_attachment_);
  }
}

template <class T>
void Reader::Implementation::leave_out_unproven(std::vector<T>& list,
                                                std::vector<RecordPlace>& places,
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

void Reader::Implementation::check_data_end(std::uint64_t offset) {
  const auto header = read_header(offset);
  if (!header || header->opcode != Opcode::kDataEnd ||
      header->length != kDataEndSize - kRecordHeaderSize) {
    add_damage(offset, kDataEndSize, "The end of the data is not marked.");
    return;
  }
  if (!options_.verify || !contents_.damage.empty()) return;
  const auto written = Decoder(content(offset, *header)).number<std::uint32_t>();
  if (written != 0 && written != checksum_between(0, offset)) {
    add_damage(0, offset,
               "The checksum of all data is wrong, though that of no single piece is: the header, "
               "or what has no checksum of its own, may be damaged.");
  }
}

void Reader::Implementation::check_message_count(const Summary& summary) {
  if (!options_.verify || !contents_.damage.empty() || !summary.statistics) return;
  if (summary.statistics->message_count == contents_.message_count) return;
  add_damage(summary.begin, size_ - summary.begin,
             "The summary says that there are " +
                 std::to_string(summary.statistics->message_count) + " messages, there are " +
                 std::to_string(contents_.message_count) + ".");
}

// ---- record by record ----

std::uint64_t Reader::Implementation::walk(std::uint64_t begin, std::uint64_t end) {
  std::uint64_t offset = begin;
  std::uint64_t whole_end = begin;
  while (offset < end) {
    const auto header = end - offset < kRecordHeaderSize ? std::nullopt : read_header(offset);
    const bool fits = header && header->length <= end - offset - kRecordHeaderSize;
    if (is_chunk_open_ && (!fits || header->opcode != Opcode::kMessageIndex)) {
      must_look_inside_ |= !fits;
      settle_chunk();
    }
    const Step step = fits ? visit(offset, *header, end) : Step::kLost;
    if (step == Step::kGoOn) {
      offset += kRecordHeaderSize + header->length;
      whole_end = offset;
    } else if (step == Step::kDataEnd) {
      add_damage(offset, end - offset, "The file has an end, but its summary is not whole.");
      return offset;
    } else {
      must_look_inside_ = true;  // perhaps it was a message index
      settle_chunk();
      const auto next = find_record(offset + 1, end);
      add_damage(offset, next.value_or(end) - offset,
                 fits ? std::string(kNonsense)
                      : "A record is longer than what is left: it was cut off, or its length is "
                        "damaged.");
      offset = next.value_or(end);
    }
  }
  settle_chunk();
  return whole_end;
}

Reader::Implementation::Step Reader::Implementation::visit(std::uint64_t offset,
                                                           const RecordHeader& header,
                                                           std::uint64_t end) {
  const auto skip = [&](std::string reason) {
    add_damage(offset, kRecordHeaderSize + header.length, std::move(reason));
    return Step::kGoOn;
  };
  switch (header.opcode) {
    case Opcode::kHeader: {
      const auto decoded = decode_header(content(offset, header));
      if (!decoded) return Step::kLost;
      if (offset != kMagic.size()) return skip("A second header.");
      contents_.profile = decoded->profile;
      contents_.library = decoded->library;
      has_header_ = true;
      return Step::kGoOn;
    }
    case Opcode::kSchema:
    case Opcode::kChannel: {
      std::string reason = define(header.opcode, content(offset, header));
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
      return visit_checked(offset, header, decode_attachment(content(offset, header)),
                           contents_.attachments, contents_.attachment_places,
                           is_proven_attachment_);
    case Opcode::kMetadata:
      return visit_checked(offset, header, decode_metadata(content(offset, header)),
                           contents_.metadata, contents_.metadata_places, is_proven_metadata_);
    case Opcode::kDataEnd:
      return header.length == kDataEndSize - kRecordHeaderSize ? Step::kDataEnd : Step::kLost;
    case Opcode::kFooter:
    case Opcode::kChunkIndex:
    case Opcode::kAttachmentIndex:
    case Opcode::kStatistics:
    case Opcode::kMetadataIndex:
    case Opcode::kSummaryOffset:
      return Step::kLost;  // these are in the summary only
  }
  // Is it new, or damaged? Then its length may be too.
  if (!is_boundary(offset + kRecordHeaderSize + header.length, end)) return Step::kLost;
  return skip("A record of a type that this version does not know.");
}

Reader::Implementation::Step Reader::Implementation::visit_message(std::uint64_t offset,
                                                                   const RecordHeader& header) {
  const std::uint64_t length = kRecordHeaderSize + header.length;
  const auto message = decode_message(window_.at(offset + kRecordHeaderSize, kMessageHeaderSize));
  if (!message || header.length < kMessageHeaderSize || length > options_.max_record_size) {
    return Step::kLost;
  }
  if (has_chunk_) {
    // It has no checksum, and those who write chunks put all messages there: more likely it is a
    // message index with a damaged first byte.
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
  auto& counts = counts_.back();
  const auto count =
      std::ranges::find(counts, message->channel_id, [](const auto& pair) { return pair.first; });
  if (count == counts.end()) {
    counts.emplace_back(message->channel_id, 1);
  } else {
    ++count->second;
  }
  return Step::kGoOn;
}

std::optional<ChunkPlace> Reader::Implementation::describe_chunk(std::uint64_t offset,
                                                                 const RecordHeader& header) {
  constexpr std::uint64_t kMaxHeaderSize = 64;  // with a compression that we know
  const auto chunk = decode_chunk_header(
      window_.at(offset + kRecordHeaderSize, std::min(kMaxHeaderSize, header.length)),
      header.length);
  if (!chunk) return std::nullopt;
  writes_checksums_ |= chunk->uncompressed_checksum != 0;
  return ChunkPlace{.offset = offset,
                    .length = kRecordHeaderSize + header.length,
                    .first_time = chunk->first_time,
                    .last_time = chunk->last_time,
                    .uncompressed_size = chunk->uncompressed_size,
                    // If we do not know it, that is told when the chunk is read.
                    .compression = compression_of(chunk->compression).value_or(Compression::kNone)};
}

Reader::Implementation::Step Reader::Implementation::visit_chunk(std::uint64_t offset,
                                                                 const RecordHeader& header) {
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

Reader::Implementation::Step Reader::Implementation::visit_message_index(
    std::uint64_t offset, const RecordHeader& header) {
  constexpr std::size_t kPrefixSize = 6;
  const std::uint64_t begin = offset + kRecordHeaderSize;
  Decoder decoder(window_.at(begin, kPrefixSize));
  const auto channel = decoder.number<std::uint16_t>();
  const auto size = decoder.number<std::uint32_t>();
  if (!decoder.is_whole() || header.length != kPrefixSize + std::uint64_t{size} ||
      size % sizeof(MessageIndexEntry) != 0) {
    return Step::kLost;
  }
  // That of a damaged chunk is of no use.
  if (!is_chunk_open_) return Step::kGoOn;
  ChunkPlace& place = contents_.chunks.back();
  place.indexes.emplace_back(channel, offset);
  place.index_length += kRecordHeaderSize + header.length;
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
  counts.emplace_back(channel, num_entries);
  return Step::kGoOn;
}

template <class T>
Reader::Implementation::Step Reader::Implementation::visit_checked(
    std::uint64_t offset, const RecordHeader& header, std::optional<Checked<T>> decoded,
    std::vector<T>& list, std::vector<RecordPlace>& places, std::vector<bool>& is_proven) {
  if (!decoded) return Step::kLost;
  const RecordPlace place{.offset = offset, .length = kRecordHeaderSize + header.length};
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

void Reader::Implementation::settle_chunk() {
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
    const std::uint64_t length = kRecordHeaderSize + read_header(index.second).value().length;
    add_damage(index.second, length, "A message index does not fit its chunk.");
  }
}

bool Reader::Implementation::is_right_index(const std::pair<std::uint16_t, std::uint64_t>& index) {
  const auto [channel, offset] = index;
  const auto header = read_header(offset);
  const auto decoded = header ? decode_message_index(content(offset, *header)) : std::nullopt;
  if (!decoded) return false;
  const auto messages = loader_.messages();
  const auto offset_of = [this](const Message& message) { return loader_.offset_of(message); };
  for (std::size_t i = 0; i < decoded->entries.size() / sizeof(MessageIndexEntry); ++i) {
    const MessageIndexEntry entry = entry_of(*decoded, i);
    const auto message = std::ranges::lower_bound(messages, entry.offset, {}, offset_of);
    if (message == messages.end() || offset_of(*message) != entry.offset ||
        message->channel_id != channel || message->log_time != entry.log_time) {
      return false;
    }
  }
  return true;
}

// ---- lost ----

std::optional<std::uint64_t> Reader::Implementation::find_record(std::uint64_t begin,
                                                                 std::uint64_t end) {
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

bool Reader::Implementation::is_proven(std::uint64_t offset, const RecordHeader& header) {
  const std::uint64_t length = kRecordHeaderSize + header.length;
  switch (header.opcode) {
    case Opcode::kChunk: {
      const auto place = describe_chunk(offset, header);
      return place && place->uncompressed_size <= options_.max_record_size &&
             spend(length + place->uncompressed_size) && load(*place).empty() &&
             !(loader_.messages().empty() && loader_.definitions().empty());
    }
    case Opcode::kAttachment: {
      if (!spend(length)) return false;
      const auto attachment = decode_attachment(content(offset, header));
      return attachment && attachment->has_checksum && attachment->is_right;
    }
    case Opcode::kMetadata: {
      if (!spend(length)) return false;
      const auto metadata = decode_metadata(content(offset, header));
      return metadata && metadata->has_checksum && metadata->is_right;
    }
    default:
      return false;
  }
}

bool Reader::Implementation::is_boundary(std::uint64_t offset, std::uint64_t end) {
  if (offset == end) return true;
  if (end - offset < kRecordHeaderSize) return false;
  const auto header = read_header(offset);
  return header && header->length <= end - offset - kRecordHeaderSize &&
         header->opcode >= Opcode::kHeader && header->opcode <= Opcode::kDataEnd;
}

bool Reader::Implementation::spend(std::uint64_t cost) noexcept {
  if (cost > search_budget_) return false;
  search_budget_ -= cost;
  return true;
}

// ---- chunks ----

std::optional<std::span<const Message>> Reader::Implementation::read_chunk(std::size_t index) {
  if (index >= contents_.chunks.size()) {
    throw InvalidArgument("there is no chunk " + std::to_string(index) + ", only " +
                          std::to_string(contents_.chunks.size()));
  }
  if (is_damaged_[index]) return std::nullopt;
  ChunkPlace& place = contents_.chunks[index];
  std::string reason = load(place);
  if (!reason.empty()) {
    is_damaged_[index] = true;
    add_damage(place.offset, place.length, std::move(reason));
    return std::nullopt;
  }
  correct_times(place);
  return loader_.messages();
}

std::string Reader::Implementation::load(const ChunkPlace& place) {
  std::string reason = loader_.load(place);
  for (const ChunkLoader::DefinitionRecord& record : loader_.definitions()) {
    if (reason.empty()) reason = define(record.opcode, record.content);
  }
  return reason;
}

void Reader::Implementation::correct_times(ChunkPlace& place) {
  const auto messages = loader_.messages();
  if (messages.empty()) return;
  const auto [first, last] = std::ranges::minmax_element(messages, {}, &Message::log_time);
  if (place.first_time == first->log_time && place.last_time == last->log_time) return;
  place.first_time = first->log_time;
  place.last_time = last->log_time;
  add_damage(place.offset + kRecordHeaderSize, 2 * sizeof(std::uint64_t),
             "The times in the header of the chunk are wrong; its messages are right.");
}

MessageCounts Reader::Implementation::count_messages() const {
  std::map<std::uint16_t, std::uint64_t> counts;
  for (const Message& message : loader_.messages()) ++counts[message.channel_id];
  return {counts.begin(), counts.end()};
}

void Reader::Implementation::sum_up_counts() {
  for (const MessageCounts& counts : counts_) {
    for (const auto& [channel, count] : counts) {
      contents_.message_count += count;
      contents_.channel_message_counts[channel] += count;
    }
  }
  counts_.clear();
}

// ---- schemas and channels ----

std::string Reader::Implementation::define(Opcode opcode, std::span<const std::byte> content) {
  if (opcode == Opcode::kSchema) {
    const auto schema = decode_schema(content);
    return schema ? define_in(contents_.schemas, *schema, "schema") : std::string(kNonsense);
  }
  const auto channel = decode_channel(content);
  return channel ? define_in(contents_.channels, *channel, "channel") : std::string(kNonsense);
}

template <class T>
std::string Reader::Implementation::define_in(std::map<std::uint16_t, T>& known,
                                              const T& definition, const char* what) {
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

// ---- tools ----

std::optional<RecordHeader> Reader::Implementation::read_header(std::uint64_t offset) {
  Decoder decoder(window_.at(offset, kRecordHeaderSize));
  const auto opcode = decoder.number<std::uint8_t>();
  const auto length = decoder.number<std::uint64_t>();
  if (!decoder.is_whole()) return std::nullopt;
  return RecordHeader{.opcode = static_cast<Opcode>(opcode), .length = length};
}

std::span<const std::byte> Reader::Implementation::content(std::uint64_t offset,
                                                           const RecordHeader& header) {
  const std::uint64_t begin = offset + kRecordHeaderSize;
  const std::uint64_t rest = begin < size_ ? size_ - begin : 0;
  return window_.at(begin, std::min({header.length, options_.max_record_size, rest}));
}

std::uint32_t Reader::Implementation::checksum_between(std::uint64_t begin, std::uint64_t end) {
  std::uint32_t sum = 0;
  constexpr std::uint64_t kPiece = std::uint64_t{64} << 10;
  while (begin < end) {
    const auto bytes = window_.at(begin, std::min(kPiece, end - begin));
    if (bytes.empty()) break;
    sum = checksum(bytes, sum);
    begin += bytes.size();
  }
  return sum;
}

void Reader::Implementation::add_damage(std::uint64_t offset, std::uint64_t size,
                                        std::string reason) {
  auto& damage = contents_.damage;
  const auto next = std::ranges::upper_bound(damage, offset, {}, &Damage::offset);
  if (next != damage.begin()) {
    Damage& before = *std::prev(next);
    if (before.offset + before.size == offset && before.reason == reason) {
      before.size += size;
      return;
    }
  }
  if (damage.size() < kMaxNumDamages) {
    damage.insert(next, {.offset = offset, .size = size, .reason = std::move(reason)});
    return;
  }
  Damage& neighbour = next == damage.begin() ? *next : *std::prev(next);
  const std::uint64_t begin = std::min(neighbour.offset, offset);
  const std::uint64_t end = std::max(neighbour.offset + neighbour.size, offset + size);
  neighbour = {.offset = begin,
               .size = end - begin,
               .reason = "There is much damage from here on; some is not named."};
}

bool Reader::Implementation::keep(std::uint64_t memory) noexcept {
  if (memory > options_.max_record_size - kept_) return false;
  kept_ += memory;
  return true;
}

// ---- Reader ----

Reader::Reader(std::unique_ptr<Source> source, const ReaderOptions& options)
    : implementation_(std::make_unique<Implementation>(std::move(source), options, "this")) {}

Reader::Reader(const std::filesystem::path& path, const ReaderOptions& options)
    : implementation_(std::make_unique<Implementation>(open_file(path), options, path.string())) {}

Reader::Reader(Reader&&) noexcept = default;
Reader& Reader::operator=(Reader&&) noexcept = default;
Reader::~Reader() = default;

const Contents& Reader::contents() const noexcept { return implementation_->contents(); }

std::optional<std::span<const Message>> Reader::read_chunk(std::size_t index) {
  return implementation_->read_chunk(index);
}

}  // namespace trifinger::mcap
