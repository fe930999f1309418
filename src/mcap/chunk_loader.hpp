// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "buffer.hpp"
#include "compression.hpp"
#include "encoding.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::mcap {

// Reads one chunk at a time, with all checks. Keeps its memory for the next chunk.
class ChunkLoader {
 public:
  ChunkLoader(const Source& source, std::uint64_t max_record_size) noexcept
      : source_(&source), max_record_size_(max_record_size) {}

  // Loads a chunk, whose content the functions below then return. Returns why the chunk cannot be
  // used, as a sentence; empty if it can.
  [[nodiscard]] std::string load(const ChunkPlace& place);

  [[nodiscard]] std::span<const Message> messages() const noexcept { return messages_; }
  // Returns the offset of a message in the uncompressed chunk.
  [[nodiscard]] std::uint64_t offset_of(const Message& message) const noexcept {
    return static_cast<std::uint64_t>(message.data.data() - records_.data()) - kMessageHeaderSize -
           kRecordHeaderSize;
  }
  // True if all entries of the index are messages of `channel` in the chunk.
  [[nodiscard]] bool has_messages(std::uint16_t channel, const MessageIndex& index) const;
  // The content of a schema or channel.
  struct DefinitionRecord {
    Opcode opcode;
    std::span<const std::byte> content;
  };
  [[nodiscard]] std::span<const DefinitionRecord> definitions() const noexcept {
    return definitions_;
  }

 private:
  [[nodiscard]] std::string read(const ChunkPlace& place);
  [[nodiscard]] bool parse();

  const Source* source_;
  std::uint64_t max_record_size_;
  Decompressor decompressor_;
  Buffer file_bytes_;
  Buffer decompressed_;
  std::span<const std::byte> records_;
  std::vector<Message> messages_;
  std::vector<DefinitionRecord> definitions_;
};

}  // namespace trifinger::mcap
