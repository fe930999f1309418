// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "trifinger/mcap/records.hpp"
#include "trifinger/mcap/sink.hpp"

namespace trifinger::mcap {

struct Contents;

struct WriterOptions {
  std::string profile{};  ///< For example "ros2"; may be empty.
  std::string library{};  ///< Name and version of the writing program.
  Compression compression{Compression::kZstd};
  int level{1};  ///< Level of the compression; zstd: 1 to 19.
  /// Size of the messages after which a chunk is closed automatically [bytes].
  std::size_t max_chunk_size{std::size_t{1} << 20};
};

/// Writes one MCAP file: chunks with checksums and message indexes, and the summary at the end.
/// Schemas and channels are in the first chunk that uses them, in the next one, in every hundredth
/// one and in the summary.
///
/// If writing stops at any byte, the file up to there is readable. If the sink throws, nothing is
/// lost and nothing is done: the same call, or `flush`, tries again.
class Writer {
 public:
  /// Begins a file. `sink` must be empty and outlive the writer.
  /// @throws InvalidArgument, SystemError
  Writer(Sink& sink, WriterOptions options);
  /// Continues an unfinished file. `contents` is what a reader has found in it, and `sink` has
  /// `contents.complete_size` bytes. The summary will also list what is already there.
  /// @throws InvalidArgument, SystemError
  Writer(Sink& sink, WriterOptions options, const Contents& contents);
  Writer(Writer&&) noexcept;
  Writer& operator=(Writer&&) noexcept;
  /// Writes nothing. Without a call of `finish` the file has no summary.
  ~Writer();

  /// Returns the id of the schema. Equal arguments give the same id.
  std::uint16_t add_schema(std::string_view name, std::string_view encoding, std::string_view data);
  /// Returns the id of the channel. Equal arguments give the same id. `channel.id` is ignored.
  std::uint16_t add_channel(const Channel& channel);

  /// Adds a message to the open chunk.
  /// @throws InvalidArgument if there is no such channel; SystemError if the chunk was full and the
  /// sink refused it: then the message was not added
  void write(const Message& message);
  /// Closes the open chunk and hands it to the sink. Does nothing if the chunk is empty.
  void flush();
  /// Closes the open chunk and writes `metadata` after it. Adds the entry `crc32`, the checksum of
  /// the name and the other entries. @throws InvalidArgument if `metadata` already has that entry
  void write(const Metadata& metadata);
  /// Closes the open chunk and writes `attachment` after it.
  void write(const Attachment& attachment);
  /// Closes the open chunk and writes the summary. Later writes throw InvalidArgument.
  void finish();

  /// How chunks that are closed from now on are compressed, for messages that compress otherwise.
  void set_compression(Compression compression);

  /// Size of the messages in the open chunk [bytes].
  [[nodiscard]] std::size_t open_chunk_size() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::mcap
