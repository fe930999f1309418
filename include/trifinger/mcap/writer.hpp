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
  std::string profile{};  ///< As in "ros2"; may be empty.
  std::string library{};  ///< Name and version of the program that writes.
  Compression compression{Compression::kZstd};
  int level{1};  ///< Of the compression; zstd: 1 to 19.
  /// Bytes of messages after which a chunk is closed by itself.
  std::size_t max_chunk_size{std::size_t{1} << 20};
};

/// Writes one MCAP file: chunks with checksums and message indexes, the summary at the end. Schemas
/// and channels are in the first chunk that uses them, in the next, in every hundredth and in the
/// summary.
///
/// Every prefix of what has reached the sink is readable. If the sink throws, nothing is lost and
/// nothing was done: the same call, or `flush`, tries again.
class Writer {
 public:
  /// Begins a file. `sink` must be empty and outlive the writer.
  /// @throws InvalidArgument, SystemError
  Writer(Sink& sink, WriterOptions options);
  /// Goes on with a file that was not finished; `contents` is what a reader has found in it, and
  /// `sink` has `contents.complete_size` bytes. The summary will list what is there already.
  /// @throws InvalidArgument, SystemError
  Writer(Sink& sink, WriterOptions options, const Contents& contents);
  Writer(Writer&&) noexcept;
  Writer& operator=(Writer&&) noexcept;
  /// Writes nothing: a writer that is not finished leaves a file without a summary.
  ~Writer();

  /// Returns the id of the schema; the same for the same arguments.
  std::uint16_t add_schema(std::string_view name, std::string_view encoding, std::string_view data);
  /// Returns the id of the channel; the same for the same arguments. `channel.id` is not looked at.
  std::uint16_t add_channel(const Channel& channel);

  /// Adds a message to the open chunk.
  /// @throws InvalidArgument if there is no such channel; SystemError if the chunk was full and the
  /// sink refused it: then the message was not added
  void write(const Message& message);
  /// Closes the open chunk and hands it to the sink; nothing if it is empty.
  void flush();
  /// Closes the open chunk and writes `metadata` behind it, with the entry `crc32` besides: the
  /// checksum of the name and the other entries. @throws InvalidArgument if it has that entry
  void write(const Metadata& metadata);
  /// Closes the open chunk and writes `attachment` behind it.
  void write(const Attachment& attachment);
  /// Closes the open chunk and writes the summary. Whatever is written afterwards throws
  /// InvalidArgument.
  void finish();

  /// Bytes of messages in the open chunk.
  [[nodiscard]] std::size_t open_chunk_size() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::mcap
