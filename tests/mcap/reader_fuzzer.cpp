// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer feeds the reader with files that were made to do harm (fault_26). The first byte
// chooses how they are read.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "mcap/buffer.hpp"
#include "mcap/compression.hpp"
#include "mcap/encoding.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/writer.hpp"

namespace {

using namespace trifinger::mcap;

constexpr std::uint64_t kMaxRecordSize = std::uint64_t{1} << 20;

void require(bool is_true, const char* law) {
  if (is_true) return;
  std::fprintf(stderr, "broken: %s\n", law);
  std::abort();
}

class NullSink final : public Sink {
 public:
  explicit NullSink(std::uint64_t size) noexcept : size_(size) {}
  void append(std::span<const std::byte> bytes) override { size_ += bytes.size(); }
  void sync() override {}
  [[nodiscard]] std::uint64_t size() const noexcept override { return size_; }

 private:
  std::uint64_t size_;
};

void check_places(const Contents& contents, std::uint64_t size) {
  require(contents.complete_size <= size, "what is complete is in the file");
  require(contents.metadata.size() == contents.metadata_places.size(), "each metadata has a place");
  require(contents.attachments.size() == contents.attachment_places.size(),
          "each attachment has a place");
  std::uint64_t end = 0;
  for (const ChunkPlace& place : contents.chunks) {
    require(place.offset >= end, "chunks do not overlap");
    end = place.offset + place.length;
    require(end >= place.offset && end <= size, "chunks are in the file");
  }
  std::uint64_t offset = 0;
  for (const Damage& damage : contents.damage) {
    require(damage.offset >= offset, "damage is in the order of the file");
    offset = damage.offset;
    require(damage.offset + damage.size <= size, "damage is in the file");
    require(!damage.reason.empty(), "damage has a reason");
  }
  std::uint64_t kept = 0;
  for (const auto& [id, schema] : contents.schemas) kept += schema.data.size();
  for (const auto& attachment : contents.attachments) kept += attachment.data.size();
  require(kept <= kMaxRecordSize, "no more is kept than allowed");
}

// Goes through the file record by record: there must be no chunk, metadata or attachment that the
// reader did not report.
void check_nothing_is_hidden(const Contents& contents, std::span<const std::byte> file) {
  const auto is_at = [](std::uint64_t offset) {
    return [offset](const auto& place) { return place.offset == offset; };
  };
  std::size_t offset = kMagic.size();
  while (offset <= file.size() && file.size() - offset > kRecordHeaderSize) {
    Decoder decoder(file.subspan(offset));
    const auto opcode = static_cast<Opcode>(decoder.number<std::uint8_t>());
    const auto length = decoder.number<std::uint64_t>();
    if (length > decoder.rest().size() || opcode == Opcode::kDataEnd) return;
    if (opcode == Opcode::kChunk || opcode == Opcode::kMetadata || opcode == Opcode::kAttachment) {
      const std::uint64_t end = offset + kRecordHeaderSize + length;
      require(std::ranges::any_of(contents.chunks, is_at(offset)) ||
                  std::ranges::any_of(contents.metadata_places, is_at(offset)) ||
                  std::ranges::any_of(contents.attachment_places, is_at(offset)) ||
                  std::ranges::any_of(contents.damage,
                                      [&](const Damage& damage) {
                                        return damage.offset < end &&
                                               damage.offset + damage.size > offset;
                                      }),
              "a record is returned or named");
    }
    offset += kRecordHeaderSize + length;
  }
}

bool is_covered(const Contents& contents, const ChunkPlace& place) {
  return std::ranges::any_of(contents.damage, [&](const Damage& damage) {
    return damage.offset <= place.offset &&
           damage.offset + damage.size >= place.offset + place.length;
  });
}

// ---- the mutator ----

void put(std::span<std::byte> bytes, std::size_t offset, std::uint32_t value) {
  std::memcpy(bytes.data() + offset, &value, sizeof(value));
}

void mend_chunk(std::span<std::byte> content) {
  constexpr std::size_t kChecksumOffset = 24;
  const auto header = decode_chunk_header(content, content.size());
  const auto compression = header ? compression_of(header->compression) : std::nullopt;
  if (!compression || header->uncompressed_size > kMaxRecordSize) return;
  Buffer records;
  records.resize(header->uncompressed_size);
  if (Decompressor().decompress(*compression, content.subspan(header->size),
                                {records.data(), records.size()})) {
    put(content, kChecksumOffset, checksum(records.view()));
  }
}

void mend_attachment(std::span<std::byte> content) {
  if (content.size() < sizeof(std::uint32_t)) return;
  const std::size_t end = content.size() - sizeof(std::uint32_t);
  put(content, end, checksum(content.first(end)));
}

void mend_metadata(std::span<std::byte> content) {
  const auto metadata = decode_metadata(content);
  if (!metadata || !metadata->has_checksum) return;
  constexpr std::string_view kBefore("crc32\x08\0\0\0", 9);
  const std::string digits = checksum_of(metadata->record);
  const std::string_view text(reinterpret_cast<const char*>(content.data()), content.size());
  const std::size_t place = text.find(kBefore);
  if (place == std::string_view::npos || text.size() - place < kBefore.size() + digits.size()) {
    return;
  }
  std::memcpy(content.data() + place + kBefore.size(), digits.data(), digits.size());
}

void mend_footer(std::span<std::byte> file, std::size_t footer) {
  const auto decoded = decode_footer(file.subspan(footer + kRecordHeaderSize));
  constexpr std::size_t kChecksumOffset = kFooterSize - sizeof(std::uint32_t);
  if (!decoded || decoded->summary_start > footer) return;
  const std::size_t begin = decoded->summary_start == 0 ? footer : decoded->summary_start;
  put(file, footer + kChecksumOffset,
      checksum(file.subspan(begin, footer + kChecksumOffset - begin)));
}

// Without this, hardly any input would pass the checksums.
void mend_checksums(std::span<std::byte> file) {
  for (std::size_t offset = kMagic.size(); file.size() - offset > kRecordHeaderSize;) {
    Decoder decoder(file.subspan(offset));
    const auto opcode = static_cast<Opcode>(decoder.number<std::uint8_t>());
    const auto length = decoder.number<std::uint64_t>();
    if (length > decoder.rest().size()) return;
    const auto content = file.subspan(offset + kRecordHeaderSize, length);
    if (opcode == Opcode::kChunk) mend_chunk(content);
    if (opcode == Opcode::kAttachment) mend_attachment(content);
    if (opcode == Opcode::kMetadata) mend_metadata(content);
    if (opcode == Opcode::kFooter && length == kFooterSize - kRecordHeaderSize) {
      mend_footer(file.first(offset + kFooterSize), offset);
      return;
    }
    offset += kRecordHeaderSize + length;
  }
}

}  // namespace

// The names of these functions are libFuzzer's.
// NOLINTBEGIN(readability-identifier-naming)
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned seed) {
  size = LLVMFuzzerMutate(data, size, max_size);
  if (seed % 4 != 0 && size > 1 + kMagic.size()) {
    mend_checksums(std::as_writable_bytes(std::span(data + 1, size - 1)));
  }
  return size;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const bool verify = (data[0] & 1U) != 0;
  const auto bytes = std::as_bytes(std::span(data + 1, size - 1));
  try {
    Reader reader(open_memory(bytes), {.max_record_size = kMaxRecordSize, .verify = verify});
    const Contents& contents = reader.contents();
    check_places(contents, bytes.size());
    if (!contents.is_finished && contents.complete_size < bytes.size()) {
      require(!contents.damage.empty(), "what was cut off is named");
    }

    // The reader trusts a summary if its checksum is right.
    if (verify || !contents.is_finished) check_nothing_is_hidden(contents, bytes);

    std::uint64_t sum = 0;
    std::uint64_t num_bytes = 0;
    std::uint64_t num_messages = 0;
    const std::size_t num_chunks = contents.chunks.size();
    for (std::size_t i = 0; i < num_chunks; ++i) {
      const auto messages = reader.read_chunk(i);
      if (!messages) {
        require(is_covered(contents, contents.chunks[i]), "a chunk that is not returned is named");
        continue;
      }
      for (const Message& message : *messages) {
        require(message.log_time >= contents.chunks[i].first_time &&
                    message.log_time <= contents.chunks[i].last_time,
                "messages are of the times of their chunk");
        for (const std::byte byte : message.data) sum += std::to_integer<unsigned>(byte);
        num_bytes += message.data.size();
      }
      num_messages += messages->size();
    }
    require(contents.chunks.size() == num_chunks, "reading changes no places");
    check_places(contents, bytes.size());
    if (verify) require(contents.message_count == num_messages, "what was looked at is counted");
    if (!contents.is_finished) {
      NullSink sink(contents.complete_size);
      Writer writer(sink, {}, contents);
      writer.finish();
    }
    require(sum <= 255 * num_bytes, "all bytes can be read");
  } catch (const FormatError&) {
    // The reader has reported that.
  }
  return 0;
}
// NOLINTEND(readability-identifier-naming)
