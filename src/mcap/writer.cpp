// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/mcap/writer.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "base/moved.hpp"
#include "buffer.hpp"
#include "compression.hpp"
#include "encoding.hpp"
#include "summary_encoding.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::mcap {
namespace {

// Schemas and channels are repeated in every chunk whose number is a multiple of this.
constexpr std::size_t kRepeatDefinitions = 100;

AttachmentEntry entry_for(const Attachment& attachment, RecordPlace place) {
  return {.place = place,
          .log_time = attachment.log_time,
          .create_time = attachment.create_time,
          .data_size = attachment.data.size(),
          .name = attachment.name,
          .media_type = attachment.media_type};
}

// Returns the smallest id above all ids in use.
template <class Map>
std::uint16_t next_id(const Map& map, const char* what) {
  if (map.empty()) return 1;
  const std::uint16_t last = map.rbegin()->first;
  if (last == std::numeric_limits<std::uint16_t>::max()) {
    throw InvalidArgument(std::string("an MCAP file has at most 65535 ") + what);
  }
  return static_cast<std::uint16_t>(last + 1);
}

}  // namespace

class Writer::Implementation {
 public:
  Implementation(Sink& sink, WriterOptions options) : sink_(sink), options_(std::move(options)) {
    set_compression(options_.compression);
    if (sink_.size() != 0) {
      throw InvalidArgument("a new MCAP file begins in an empty sink; this one has " +
                            std::to_string(sink_.size()) + " bytes");
    }
    begin_file();
  }

  Implementation(Sink& sink, WriterOptions options, const Contents& contents)
      : sink_(sink), options_(std::move(options)) {
    set_compression(options_.compression);
    if (contents.is_finished) {
      throw InvalidArgument("the MCAP file is finished; nothing can be added to it");
    }
    if (contents.complete_size != sink_.size()) {
      throw InvalidArgument("the MCAP file goes on at byte " +
                            std::to_string(contents.complete_size) + ", but the sink has " +
                            std::to_string(sink_.size()) + " bytes");
    }
    if (sink_.size() == 0) {
      begin_file();
    } else {
      resume(contents);
    }
  }

  std::uint16_t add_schema(std::string_view name, std::string_view encoding,
                           std::string_view data) {
    for (const auto& [id, entry] : records_.schemas) {
      const Schema& schema = entry.schema;
      if (schema.name == name && schema.encoding == encoding && schema.data == data) return id;
    }
    insert(Schema{.id = next_id(records_.schemas, "schemas"),
                  .name = std::string(name),
                  .encoding = std::string(encoding),
                  .data = std::string(data)});
    return records_.schemas.rbegin()->first;
  }

  std::uint16_t add_channel(Channel channel) {
    for (const auto& [id, entry] : records_.channels) {
      channel.id = id;
      if (channel == entry.channel) return id;
    }
    if (channel.schema_id != 0 && !records_.schemas.contains(channel.schema_id)) {
      throw InvalidArgument("the channel of '" + channel.topic + "' wants schema " +
                            std::to_string(channel.schema_id) + ", which was not added");
    }
    channel.id = next_id(records_.channels, "channels");
    insert(channel);
    return channel.id;
  }

  void write(const Message& message) {
    require_unfinished();
    ChannelEntry& entry = find_channel(message.channel_id);
    const std::size_t size = kRecordHeaderSize + kMessageHeaderSize + message.data.size();
    if (has_messages_ && chunk_.size() + size > options_.max_chunk_size) flush();

    // Operations that may throw come first.
    define(entry);
    chunk_.reserve(chunk_.size() + size);
    entry.entries.push_back({.log_time = message.log_time, .offset = chunk_.size()});
    Encoder(chunk_).message(message);
    if (entry.entries.size() > 1 && entry.entries.rbegin()[1].log_time > message.log_time) {
      entry.is_sorted = false;
    }
    first_time_ = has_messages_ ? std::min(first_time_, message.log_time) : message.log_time;
    last_time_ = has_messages_ ? std::max(last_time_, message.log_time) : message.log_time;
    has_messages_ = true;
  }

  void flush() {
    require_unfinished();
    if (!has_messages_) return;
    output_.clear();
    // The list is extended before the file is written, because nothing may throw afterwards.
    records_.chunks.push_back(encode_chunk());
    try {
      append_output();
    } catch (...) {
      records_.chunks.pop_back();
      throw;
    }
    for (auto& [id, entry] : records_.channels) {
      entry.message_count += entry.entries.size();
      entry.entries.clear();
      entry.is_sorted = true;
    }
    chunk_.clear();
    has_messages_ = false;
  }

  void write(const Metadata& metadata) {
    flush();
    output_.clear();
    Encoder(output_).metadata(metadata);
    add_record(records_.metadata, MetadataEntry{.place = place_of_output(), .name = metadata.name});
  }

  void write(const Attachment& attachment) {
    flush();
    output_.clear();
    Encoder(output_).attachment(attachment);
    add_record(records_.attachments, entry_for(attachment, place_of_output()));
  }

  void finish() {
    flush();
    output_.clear();
    encode_data_end(output_, has_data_checksum_ ? data_checksum_ : 0U);
    encode_summary(output_, records_, sink_.size());
    append_output();
    is_finished_ = true;
  }

  void set_compression(Compression compression) {
    // Compressors are kept: each has a megabyte of memory.
    compressors_.try_emplace(compression, compression, options_.level);
    options_.compression = compression;
  }

  [[nodiscard]] std::size_t open_chunk_size() const noexcept {
    return has_messages_ ? chunk_.size() : 0;
  }

 private:
  // ---- beginnings ----

  void begin_file() {
    Encoder encoder(output_);
    encoder.bytes(kMagic);
    encoder.header(options_.profile, options_.library);
    append_output();
  }

  void resume(const Contents& contents) {
    has_data_checksum_ = false;
    for (const auto& [id, schema] : contents.schemas) insert(schema);
    for (const auto& [id, channel] : contents.channels) insert(channel);
    for (const auto& [id, count] : contents.channel_message_counts) {
      if (const auto entry = records_.channels.find(id); entry != records_.channels.end()) {
        entry->second.message_count = count;
      }
    }
    records_.chunks = contents.chunks;
    for (std::size_t i = 0; i < contents.metadata.size(); ++i) {
      records_.metadata.push_back(
          {.place = contents.metadata_places.at(i), .name = contents.metadata[i].name});
    }
    for (std::size_t i = 0; i < contents.attachments.size(); ++i) {
      records_.attachments.push_back(
          entry_for(contents.attachments[i], contents.attachment_places.at(i)));
    }
    if (contents.missing_indexes.empty()) return;
    if (records_.chunks.empty())
      throw InvalidArgument("message indexes are missing, but there is no chunk");
    for (const auto& [id, entries] : contents.missing_indexes) {
      records_.chunks.back().indexes.emplace_back(id, sink_.size() + output_.size());
      Encoder(output_).message_index(id, entries);
    }
    records_.chunks.back().index_length += output_.size();
    append_output();
  }

  // ---- schemas and channels ----

  void insert(const Schema& schema) {
    SchemaEntry entry{.schema = schema};
    Encoder(entry.definition.record).schema(schema);
    records_.schemas.emplace(schema.id, std::move(entry));
  }

  void insert(const Channel& channel) {
    ChannelEntry entry{.channel = channel};
    Encoder(entry.definition.record).channel(channel);
    records_.channels.emplace(channel.id, std::move(entry));
  }

  ChannelEntry& find_channel(std::uint16_t id) {
    // Many messages of one channel often follow each other.
    if (newest_channel_ != nullptr && newest_channel_->channel.id == id) return *newest_channel_;
    const auto entry = records_.channels.find(id);
    if (entry == records_.channels.end()) {
      throw InvalidArgument("there is no channel " + std::to_string(id));
    }
    newest_channel_ = &entry->second;
    return entry->second;
  }

  void append_definition(Definition& definition) {
    chunk_.append(definition.record.data(), definition.record.size());
    ++definition.num_copies;
  }

  // Ensures that the open chunk or an earlier one contains the channel and its schema.
  void define(ChannelEntry& entry) {
    if (chunk_.size() == 0) {
      const bool repeats = records_.chunks.size() % kRepeatDefinitions == 0;
      const auto repeat = [&](Definition& definition) {
        // One copy is not enough, because its chunk may become damaged.
        if (definition.num_copies == 1 || (repeats && definition.num_copies > 0)) {
          append_definition(definition);
        }
      };
      for (auto& [id, schema] : records_.schemas) repeat(schema.definition);
      for (auto& [id, channel] : records_.channels) repeat(channel.definition);
    }
    if (entry.definition.num_copies > 0) return;
    if (const auto schema = records_.schemas.find(entry.channel.schema_id);
        schema != records_.schemas.end() && schema->second.definition.num_copies == 0) {
      append_definition(schema->second.definition);
    }
    append_definition(entry.definition);
  }

  // ---- the file ----

  void require_unfinished() const {
    if (is_finished_)
      throw InvalidArgument("the MCAP file is finished; nothing can be added to it");
  }

  void append_output() {
    sink_.append(output_.view());
    if (has_data_checksum_) data_checksum_ = checksum(output_.view(), data_checksum_);
  }

  // Returns where the record in `output_` will be in the file.
  [[nodiscard]] RecordPlace place_of_output() const {
    return {.offset = sink_.size(), .length = output_.size()};
  }

  template <class Entry>
  void add_record(std::vector<Entry>& entries, Entry entry) {
    entries.push_back(std::move(entry));
    try {
      append_output();
    } catch (...) {
      entries.pop_back();
      throw;
    }
  }

  // Encodes the open chunk and its message indexes into `output_`.
  ChunkPlace encode_chunk() {
    ChunkPlace place{.offset = sink_.size(),
                     .first_time = first_time_,
                     .last_time = last_time_,
                     .uncompressed_size = chunk_.size(),
                     .compression = options_.compression};
    Encoder encoder(output_);
    const std::size_t record = encoder.begin(Opcode::kChunk);
    encoder.number(place.first_time);
    encoder.number(place.last_time);
    encoder.number(place.uncompressed_size);
    encoder.number(checksum(chunk_.view()));
    encoder.string(name_of(options_.compression));
    const std::size_t length_place = output_.size();
    encoder.number(std::uint64_t{0});
    const std::size_t begin = output_.size();
    compressors_.at(options_.compression).compress(chunk_.view(), output_);
    const std::uint64_t length = output_.size() - begin;
    std::memcpy(output_.data() + length_place, &length, sizeof(length));
    encoder.end(record);
    place.length = output_.size();

    for (auto& [id, entry] : records_.channels) {
      if (entry.entries.empty()) continue;
      if (!entry.is_sorted) {
        sort_by_time(entry.entries);
        entry.is_sorted = true;
      }
      place.indexes.emplace_back(id, place.offset + output_.size());
      encoder.message_index(id, entry.entries);
    }
    place.index_length = output_.size() - place.length;
    return place;
  }

  Sink& sink_;
  WriterOptions options_;
  std::map<Compression, Compressor> compressors_;
  bool is_finished_{false};

  WrittenRecords records_;
  ChannelEntry* newest_channel_{nullptr};

  Buffer chunk_;  // records of the open chunk
  bool has_messages_{false};
  std::uint64_t first_time_{0};
  std::uint64_t last_time_{0};

  Buffer output_;                 // bytes that go to the sink next
  bool has_data_checksum_{true};  // false: the beginning of the file is not known
  std::uint32_t data_checksum_{0};
};

Writer::Writer(Sink& sink, WriterOptions options)
    : implementation_(std::make_unique<Implementation>(sink, std::move(options))) {}

Writer::Writer(Sink& sink, WriterOptions options, const Contents& contents)
    : implementation_(std::make_unique<Implementation>(sink, std::move(options), contents)) {}

Writer::Writer(Writer&&) noexcept = default;
Writer& Writer::operator=(Writer&&) noexcept = default;
Writer::~Writer() = default;

std::uint16_t Writer::add_schema(std::string_view name, std::string_view encoding,
                                 std::string_view data) {
  return checked(implementation_)->add_schema(name, encoding, data);
}

std::uint16_t Writer::add_channel(const Channel& channel) {
  return checked(implementation_)->add_channel(channel);
}

void Writer::write(const Message& message) { checked(implementation_)->write(message); }

void Writer::flush() { checked(implementation_)->flush(); }

void Writer::write(const Metadata& metadata) { checked(implementation_)->write(metadata); }

void Writer::write(const Attachment& attachment) { checked(implementation_)->write(attachment); }

void Writer::finish() { checked(implementation_)->finish(); }

void Writer::set_compression(Compression compression) {
  checked(implementation_)->set_compression(compression);
}

std::size_t Writer::open_chunk_size() const noexcept {
  return checked(implementation_)->open_chunk_size();
}

}  // namespace trifinger::mcap
