// SPDX-License-Identifier: BSD-3-Clause
#include "chunk_loader.hpp"

#include <algorithm>

namespace trifinger::mcap {

std::string ChunkLoader::load(const ChunkPlace& place) {
  records_ = {};
  messages_.clear();
  definitions_.clear();
  std::string reason = read(place);
  if (reason.empty() && !parse()) reason = "The chunk holds records that make no sense.";
  if (!reason.empty()) messages_.clear();
  return reason;
}

std::string ChunkLoader::read(const ChunkPlace& place) {
  if (place.length > max_record_size_ || place.uncompressed_size > max_record_size_) {
    return "The chunk has " + std::to_string(std::max(place.length, place.uncompressed_size)) +
           " bytes, more than the " + std::to_string(max_record_size_) + " allowed.";
  }
  file_bytes_.resize(place.length);
  if (source_->read(place.offset, {file_bytes_.data(), file_bytes_.size()}) != place.length) {
    return "The file has become shorter.";
  }
  if (!place.is_chunk) {
    records_ = file_bytes_.view();
    return {};
  }

  Decoder decoder(file_bytes_.view());
  const auto opcode = decoder.number<std::uint8_t>();
  const auto length = decoder.number<std::uint64_t>();
  const auto header = decode_chunk_header(decoder.rest(), length);
  if (opcode != static_cast<std::uint8_t>(Opcode::kChunk) || length != decoder.rest().size() ||
      !header) {
    return "There is no chunk where the summary says.";
  }
  if (!compression_of(header->compression)) {
    return "The chunk is compressed by '" + header->compression +
           "', which this version does not know.";
  }
  if (header->uncompressed_size != place.uncompressed_size ||
      header->compression != name_of(place.compression)) {
    return "The header of the chunk is not as the summary says.";
  }
  const auto compressed = decoder.rest().subspan(header->size);
  if (place.compression == Compression::kNone) {
    if (compressed.size() != place.uncompressed_size) return "The size of the chunk is wrong.";
    records_ = compressed;
  } else {
    decompressed_.resize(place.uncompressed_size);
    if (!decompressor_.decompress(place.compression, compressed,
                                  {decompressed_.data(), decompressed_.size()})) {
      return "The chunk cannot be decompressed.";
    }
    records_ = decompressed_.view();
  }
  if (header->uncompressed_checksum != 0 && header->uncompressed_checksum != checksum(records_)) {
    return "The checksum of the chunk is wrong.";
  }
  return {};
}

bool ChunkLoader::parse() {
  Decoder decoder(records_);
  while (!decoder.rest().empty()) {
    const auto opcode = static_cast<Opcode>(decoder.number<std::uint8_t>());
    const auto content = decoder.take(decoder.number<std::uint64_t>());
    if (!decoder.is_whole()) return false;
    if (opcode == Opcode::kMessage) {
      const auto message = decode_message(content);
      if (!message) return false;
      messages_.push_back(*message);
    } else if (opcode == Opcode::kSchema || opcode == Opcode::kChannel) {
      definitions_.push_back({.opcode = opcode, .content = content});
    }
  }
  return true;
}

bool ChunkLoader::has_messages(std::uint16_t channel, const MessageIndex& index) const {
  const auto place_of = [this](const Message& message) { return offset_of(message); };
  for (std::size_t i = 0; i < index.entries.size() / sizeof(MessageIndexEntry); ++i) {
    const MessageIndexEntry entry = entry_of(index, i);
    const auto message = std::ranges::lower_bound(messages_, entry.offset, {}, place_of);
    if (message == messages_.end() || offset_of(*message) != entry.offset ||
        message->channel_id != channel || message->log_time != entry.log_time) {
      return false;
    }
  }
  return true;
}

}  // namespace trifinger::mcap
