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

/// The file is not what it says, or uses what this version does not know.
class FormatError : public Error {
 public:
  using Error::Error;
};

/// Bytes with random access.
class Source {
 public:
  virtual ~Source() = default;
  /// Fills `bytes` from `offset`; returns how many there were, less only at the end.
  /// @throws SystemError
  [[nodiscard]] virtual std::size_t read(std::uint64_t offset,
                                         std::span<std::byte> bytes) const = 0;
  [[nodiscard]] virtual std::uint64_t size() const = 0;
};

/// A file; may grow while it is read.
[[nodiscard]] std::unique_ptr<Source> open_file(const std::filesystem::path& path);
/// Bytes in memory, which must outlive the source.
[[nodiscard]] std::unique_ptr<Source> open_memory(std::span<const std::byte> bytes);

/// Where a record is.
struct RecordPlace {
  std::uint64_t offset{0};  ///< In the file.
  std::uint64_t length{0};  ///< With the nine bytes before its content.
};

/// Where a chunk is, and what its header says of it.
struct ChunkPlace {
  std::uint64_t offset{0};      ///< Of the record in the file.
  std::uint64_t length{0};      ///< Of the record, its header included [bytes].
  std::uint64_t first_time{0};  ///< Smallest log time [ns].
  std::uint64_t last_time{0};   ///< Largest log time [ns].
  std::uint64_t uncompressed_size{0};
  Compression compression{Compression::kNone};
  bool is_chunk{true};            ///< False: messages that lie in the file as they are.
  std::uint64_t index_length{0};  ///< Of the message indexes right behind the chunk [bytes].
  /// Channel and offset of its message index.
  std::vector<std::pair<std::uint16_t, std::uint64_t>> indexes{};

  friend bool operator==(const ChunkPlace&, const ChunkPlace&) = default;
};

/// Bytes of the file that could not be used.
struct Damage {
  std::uint64_t offset{0};
  std::uint64_t size{0};
  std::string reason{};  ///< A sentence.
};

/// What is in a file, without the messages.
struct Contents {
  std::string profile;
  std::string library;
  std::map<std::uint16_t, Schema> schemas;
  std::map<std::uint16_t, Channel> channels;
  std::vector<ChunkPlace> chunks;  ///< In the order of the file.
  std::vector<Metadata> metadata;
  std::vector<Attachment> attachments;
  std::vector<RecordPlace> metadata_places;    ///< Of each of `metadata`.
  std::vector<RecordPlace> attachment_places;  ///< Of each of `attachments`.
  /// As the summary says, or the message indexes where there is none.
  std::uint64_t message_count{0};
  std::map<std::uint16_t, std::uint64_t> channel_message_counts;
  bool is_finished{false};  ///< The summary is there and whole.
  /// Everything up to here is whole or named in `damage`; of a file without a summary, the size at
  /// which a writer goes on.
  std::uint64_t complete_size{0};
  std::vector<Damage> damage;  ///< In the order of the file.
  /// Message indexes that were cut off behind the last chunk, by channel.
  std::map<std::uint16_t, std::vector<MessageIndexEntry>> missing_indexes;
};

struct ReaderOptions {
  /// Larger chunks and records are damage, and so is what metadata, attachments, schemas and
  /// channels have more than that together: bounds the memory that a file can ask for to a few
  /// times this and its own size.
  std::uint64_t max_record_size{std::uint64_t{256} << 20};
  /// Looks into every chunk at once rather than when it is read, and trusts no summary.
  bool verify{false};
};

/// Reads MCAP files, whole, cut off or damaged, of any writer: a damaged piece is left out and
/// named.
///
/// A finished file is opened by its summary. Any other is walked through; where the thread is lost
/// because the length of a record is damaged, the next chunk, attachment or metadata with a right
/// checksum is searched. Metadata with a checksum, the entry `crc32` as Writer adds it, is checked
/// and handed out without it.
class Reader {
 public:
  /// @throws FormatError if it is no MCAP file, SystemError
  explicit Reader(std::unique_ptr<Source> source, const ReaderOptions& options = {});
  explicit Reader(const std::filesystem::path& path, const ReaderOptions& options = {});
  Reader(Reader&&) noexcept;
  Reader& operator=(Reader&&) noexcept;
  ~Reader();

  [[nodiscard]] const Contents& contents() const noexcept;

  /// The messages of one chunk, in the order of the file. The bytes live until the next call.
  /// Nothing if the chunk is damaged: then `contents().damage` says so. Schemas and channels found
  /// in the chunk are added to `contents()`; those of its messages are there already when the file
  /// is opened, unless they are lost.
  /// @throws InvalidArgument if there is no chunk `index`, SystemError
  [[nodiscard]] std::optional<std::span<const Message>> read_chunk(std::size_t index);

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::mcap
