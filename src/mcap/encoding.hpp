// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "buffer.hpp"
#include "trifinger/mcap/records.hpp"

// The bytes of the records. A record consists of its opcode (1 byte), the length of its content (8)
// and its content. Numbers are little endian. A string begins with its length (4). A map or an
// array begins with the number of its bytes (4).
namespace trifinger::mcap {

static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");

enum class Opcode : std::uint8_t {
  kNone = 0x00,
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

// These bytes stand at both ends of a file. Byte 5 is the version.
inline constexpr std::array kMagic{std::byte{0x89}, std::byte{'M'}, std::byte{'C'},
                                   std::byte{'A'},  std::byte{'P'}, std::byte{'0'},
                                   std::byte{'\r'}, std::byte{'\n'}};
inline constexpr std::size_t kVersionByte = 5;
inline constexpr std::size_t kRecordHeaderSize = 9;
// Size of a message without its data.
inline constexpr std::size_t kMessageHeaderSize = 22;
inline constexpr std::size_t kDataEndSize = kRecordHeaderSize + 4;
inline constexpr std::size_t kFooterSize = kRecordHeaderSize + 20;
// Key of the entry with which metadata carries its own checksum.
inline constexpr const char* kChecksumEntry = "crc32";

using Entries = std::map<std::string, std::string>;

// Returns the checksum of MCAP (CRC-32 as in zlib) of `bytes`. `before`: checksum of the bytes
// before.
[[nodiscard]] std::uint32_t checksum(std::span<const std::byte> bytes, std::uint32_t before = 0);
// Returns the checksum of the name and of all entries except kChecksumEntry, as eight hexadecimal
// digits.
[[nodiscard]] std::string checksum_of(const Metadata& metadata);
[[nodiscard]] std::optional<Compression> compression_of(std::string_view name) noexcept;

// Sorts the entries of a message index. (std::stable_sort would allocate.)
void sort_by_time(std::span<MessageIndexEntry> entries) noexcept;

// ---- writing ----

// Appends records to a buffer.
class Encoder {
 public:
  explicit Encoder(Buffer& buffer) noexcept : buffer_(buffer) {}

  template <std::unsigned_integral T>
  void number(T value) {
    buffer_.append(&value, sizeof(T));
  }
  void bytes(std::span<const std::byte> bytes) { buffer_.append(bytes.data(), bytes.size()); }
  // @throws InvalidArgument if it is not UTF-8
  void string(std::string_view text);
  // Appends bytes with their length before them.
  void blob(std::string_view bytes);
  void map(const Entries& entries);

  // Begins a record. Returns its offset, which `end` needs.
  [[nodiscard]] std::size_t begin(Opcode opcode);
  void end(std::size_t begin);

  void header(std::string_view profile, std::string_view library);
  void schema(const Schema& schema);
  void channel(const Channel& channel);
  void message(const Message& message);
  void message_index(std::uint16_t channel, std::span<const MessageIndexEntry> entries);
  // Adds the checksum, too.
  void metadata(const Metadata& metadata);
  void attachment(const Attachment& attachment);

 private:
  Buffer& buffer_;
};

// ---- reading ----

// Decodes the content of a record. Fields beyond the end, and texts that are not UTF-8, read as
// empty and make the record malformed.
class Decoder {
 public:
  explicit Decoder(std::span<const std::byte> bytes) noexcept : rest_(bytes) {}

  template <std::unsigned_integral T>
  [[nodiscard]] T number() noexcept {
    T value{0};
    const auto bytes = take(sizeof(T));
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), sizeof(T));
    return value;
  }
  [[nodiscard]] std::span<const std::byte> take(std::uint64_t size) noexcept;
  [[nodiscard]] std::string_view string() noexcept;
  // Reads bytes that have their length before them.
  [[nodiscard]] std::string_view blob() noexcept;
  [[nodiscard]] Entries map();
  // Reads an array or a map as bytes.
  [[nodiscard]] std::span<const std::byte> array() noexcept {
    return take(number<std::uint32_t>());
  }

  [[nodiscard]] std::span<const std::byte> rest() const noexcept { return rest_; }
  [[nodiscard]] bool is_whole() const noexcept { return is_whole_; }
  // True if the record was well formed and nothing is left of it.
  [[nodiscard]] bool is_exact() const noexcept { return is_whole_ && rest_.empty(); }
  void reject() noexcept { is_whole_ = false; }

 private:
  std::span<const std::byte> rest_;
  bool is_whole_{true};
};

struct Header {
  std::string profile;
  std::string library;
};

// The content of a chunk record, except the compressed records.
struct ChunkHeader {
  std::uint64_t first_time{0};
  std::uint64_t last_time{0};
  std::uint64_t uncompressed_size{0};
  std::uint32_t uncompressed_checksum{0};  // 0: there is none
  std::string compression;
  std::uint64_t compressed_size{0};
  std::size_t size{0};  // size of the encoded header
};
// Returns the size of a chunk without its compressed records, including the record header.
[[nodiscard]] inline std::size_t chunk_header_size(Compression compression) noexcept {
  return kRecordHeaderSize + 40 + name_of(compression).size();
}

struct MessageIndex {
  std::uint16_t channel{0};
  std::span<const std::byte> entries;  // 16 bytes each
};

struct Footer {
  std::uint64_t summary_start{0};  // 0: there is none
  std::uint64_t summary_offset_start{0};
  std::uint32_t summary_checksum{0};  // 0: there is none
};

struct Statistics {
  std::uint64_t message_count{0};
  std::uint16_t schema_count{0};
  std::uint32_t channel_count{0};
  std::uint32_t attachment_count{0};
  std::uint32_t metadata_count{0};
  std::uint32_t chunk_count{0};
  std::uint64_t first_time{0};
  std::uint64_t last_time{0};
  std::map<std::uint16_t, std::uint64_t> channel_message_counts;
};

// Decoders return nothing if the content of the record makes no sense. Records of the data section
// must have no bytes after their fields: extra bytes are a sign of a damaged length.
[[nodiscard]] std::optional<Header> decode_header(std::span<const std::byte> content);
[[nodiscard]] std::optional<Schema> decode_schema(std::span<const std::byte> content);
[[nodiscard]] std::optional<Channel> decode_channel(std::span<const std::byte> content);
[[nodiscard]] std::optional<Message> decode_message(std::span<const std::byte> content) noexcept;
// `content` may end after the header; `length` is the length of the whole content.
[[nodiscard]] std::optional<ChunkHeader> decode_chunk_header(std::span<const std::byte> content,
                                                             std::uint64_t length);
[[nodiscard]] std::optional<MessageIndex> decode_message_index(
    std::span<const std::byte> content) noexcept;
[[nodiscard]] MessageIndexEntry entry_of(const MessageIndex& index, std::size_t i) noexcept;
// Records of the summary may have more fields than this version knows.
[[nodiscard]] std::optional<Footer> decode_footer(std::span<const std::byte> content) noexcept;
[[nodiscard]] std::optional<Statistics> decode_statistics(std::span<const std::byte> content);

// A record whose structure is right, with the result of its checksum.
template <class T>
struct Checked {
  T record;
  bool has_checksum{false};
  bool is_right{true};  // false: the checksum does not fit
};
// Removes the checksum from the entries.
[[nodiscard]] std::optional<Checked<Metadata>> decode_metadata(std::span<const std::byte> content);
[[nodiscard]] std::optional<Checked<Attachment>> decode_attachment(
    std::span<const std::byte> content);

}  // namespace trifinger::mcap
