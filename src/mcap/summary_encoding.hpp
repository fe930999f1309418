// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "buffer.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/records.hpp"

namespace trifinger::mcap {

// A schema or channel in its encoded form.
struct Definition {
  Buffer record{};
  int num_copies{0};  // number of chunks that contain it
};

struct SchemaEntry {
  Schema schema;
  Definition definition{};
};

struct ChannelEntry {
  Channel channel;
  Definition definition{};
  std::uint64_t message_count{0};            // messages in closed chunks
  std::vector<MessageIndexEntry> entries{};  // entries of the open chunk
  bool is_sorted{true};
};

struct AttachmentEntry {
  RecordPlace place;
  std::uint64_t log_time;
  std::uint64_t create_time;
  std::uint64_t data_size;
  std::string name;
  std::string media_type;
};

struct MetadataEntry {
  RecordPlace place;
  std::string name;
};

// What a writer has written so far, as the summary at the end of the file lists it.
struct WrittenRecords {
  std::map<std::uint16_t, SchemaEntry> schemas;
  std::map<std::uint16_t, ChannelEntry> channels;
  std::vector<ChunkPlace> chunks;
  std::vector<MetadataEntry> metadata;
  std::vector<AttachmentEntry> attachments;
};

// Appends the record that ends the data. `data_checksum` is 0 if it is not known.
void encode_data_end(Buffer& output, std::uint32_t data_checksum);
// Appends the summary and everything after it. The first byte of `output` is at `offset` in the
// file.
void encode_summary(Buffer& output, const WrittenRecords& records, std::uint64_t offset);

}  // namespace trifinger::mcap
