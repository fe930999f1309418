// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/mcap/records.hpp"

namespace trifinger::mcap {

/// The file is not a valid MCAP file, or uses something that this version does not know.
class FormatError : public Error {
 public:
  using Error::Error;
};

/// Bytes with random access.
class Source {
 public:
  virtual ~Source() = default;
  /// Fills `bytes` from `offset` and returns the number of bytes read. It is smaller than requested
  /// only at the end.
  /// @throws SystemError
  [[nodiscard]] virtual std::size_t read(std::uint64_t offset,
                                         std::span<std::byte> bytes) const = 0;
  [[nodiscard]] virtual std::uint64_t size() const = 0;
};

/// A file, which may grow while it is read.
[[nodiscard]] std::unique_ptr<Source> open_file(const std::filesystem::path& path);
/// Bytes in memory, which must outlive the source.
[[nodiscard]] std::unique_ptr<Source> open_memory(std::span<const std::byte> bytes);

/// The place of a record.
struct RecordPlace {
  std::uint64_t offset{0};  ///< Offset in the file [bytes].
  std::uint64_t length{0};  ///< Size, including the nine bytes before its content [bytes].
};

/// The place of a chunk and the contents of its header.
struct ChunkPlace {
  std::uint64_t offset{0};      ///< Offset of the record in the file [bytes].
  std::uint64_t length{0};      ///< Size of the record, including its header [bytes].
  std::uint64_t first_time{0};  ///< Smallest log time [ns].
  std::uint64_t last_time{0};   ///< Largest log time [ns].
  std::uint64_t uncompressed_size{0};
  Compression compression{Compression::kNone};
  bool is_chunk{true};            ///< False for messages that are in the file without a chunk.
  std::uint64_t index_length{0};  ///< Size of the message indexes directly after the chunk [bytes].
  /// Channels and the offsets of their message indexes.
  std::vector<std::pair<std::uint16_t, std::uint64_t>> indexes{};

  friend bool operator==(const ChunkPlace&, const ChunkPlace&) = default;
};

/// Bytes of the file that could not be used.
struct Damage {
  std::uint64_t offset{0};
  std::uint64_t size{0};
  std::string reason{};  ///< A sentence.
};

/// The contents of a file, without the messages.
struct Contents {
  std::string profile;
  std::string library;
  std::map<std::uint16_t, Schema> schemas;
  std::map<std::uint16_t, Channel> channels;
  std::vector<ChunkPlace> chunks;  ///< In the order of the file.
  std::vector<Metadata> metadata;
  std::vector<Attachment> attachments;
  std::vector<RecordPlace> metadata_places;    ///< Places of `metadata`, in the same order.
  std::vector<RecordPlace> attachment_places;  ///< Places of `attachments`, in the same order.
  /// Number of messages from the summary, or from the message indexes if there is no summary.
  std::uint64_t message_count{0};
  std::map<std::uint16_t, std::uint64_t> channel_message_counts;
  bool is_finished{false};  ///< The file has a complete summary.
  /// Everything up to this offset is whole or named in `damage`. In a file without a summary, this
  /// is the size at which a writer continues.
  std::uint64_t complete_size{0};
  std::vector<Damage> damage;  ///< In the order of the file.
  /// Message indexes that should follow the last chunk but were cut off, by channel.
  std::map<std::uint16_t, std::vector<MessageIndexEntry>> missing_indexes;
};

struct ReaderOptions {
  /// Larger chunks and records count as damage. The same holds for metadata, attachments, schemas
  /// and channels beyond this size in total. A file can therefore only take memory of a few times
  /// this value and its own size.
  std::uint64_t max_record_size{std::uint64_t{256} << 20};
  /// Reads every chunk at once, not only on demand, and does not trust the summary.
  bool verify{false};
};

/// Reads MCAP files of any writer, whole, cut off or damaged. Damaged pieces are left out and
/// named.
///
/// A finished file is opened by its summary. Any other file is read record by record. If the length
/// of a record is damaged, the reader searches for the next chunk, attachment or metadata whose
/// checksum is right. If metadata has the entry `crc32`, which Writer adds, this checksum is
/// verified and the entry is removed.
class Reader {
 public:
  /// @throws FormatError if it is not an MCAP file, SystemError
  explicit Reader(std::unique_ptr<Source> source, const ReaderOptions& options = {});
  explicit Reader(const std::filesystem::path& path, const ReaderOptions& options = {});
  Reader(Reader&&) noexcept;
  Reader& operator=(Reader&&) noexcept;
  ~Reader();

  [[nodiscard]] const Contents& contents() const noexcept;

  /// The messages of one chunk, in the order of the file. The bytes are valid until the next call.
  /// Nothing if the chunk is damaged; then `contents().damage` says so. Schemas and channels found
  /// in the chunk are added to `contents()`. Those of its messages are there from the beginning,
  /// unless they are lost.
  /// @throws InvalidArgument if there is no chunk `index`, SystemError
  [[nodiscard]] std::optional<std::span<const Message>> read_chunk(std::size_t index);

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::mcap
