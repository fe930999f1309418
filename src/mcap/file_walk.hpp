// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "chunk_loader.hpp"
#include "encoding.hpp"
#include "trifinger/mcap/reader.hpp"
#include "window.hpp"

namespace trifinger::mcap {

// Goes through a file record by record and collects its contents. Damaged records are reported and
// skipped. If the length of a damaged record is unknown, the search goes on to the next record with
// a right checksum.
class FileWalk {
 public:
  FileWalk(const Source& source, const ReaderOptions& options);

  [[nodiscard]] Contents& contents() noexcept { return contents_; }
  [[nodiscard]] Window& window() noexcept { return window_; }

  // Reads the records from `begin` to `end`. Returns the end of the last whole record.
  std::uint64_t walk(std::uint64_t begin, std::uint64_t end);
  // Takes over what a summary says. Returns false if it would need too much memory.
  [[nodiscard]] bool adopt(std::map<std::uint16_t, Schema> schemas,
                           std::map<std::uint16_t, Channel> channels);
  void adopt(ChunkPlace place);
  // Removes attached data without a checksum, because a writer that adds one checksum adds all:
  // where it is missing, the record is damaged. Call this after the last record.
  void leave_out_unproven();
  // Cuts off damage at the end of a file that was not finished. `end` is the end of the last whole
  // record. Returns the offset at which a writer can continue.
  [[nodiscard]] std::uint64_t cut_damaged_tail(std::uint64_t end);
  // Adds up the messages of the chunks found so far.
  void sum_up_counts();

  // Reads a chunk and its schemas and channels. Returns why the chunk cannot be used, as a
  // sentence; empty if it can.
  [[nodiscard]] std::string load(const ChunkPlace& place);
  // Returns the messages of the chunk that was loaded last.
  [[nodiscard]] std::span<const Message> messages() const noexcept { return loader_.messages(); }
  // Corrects the times of the loaded chunk, and reports damage if its header has wrong ones. The
  // messages are right nevertheless.
  void correct_times(ChunkPlace& place);
  void add_damage(std::uint64_t offset, std::uint64_t size, std::string reason);

 private:
  enum class Step : std::uint8_t {
    kGoOn,     // the record was understood, or its damage was reported
    kLost,     // the record makes no sense, and its length may be wrong
    kDataEnd,  // what follows is the summary
  };
  // Number of messages by channel.
  using MessageCounts = std::map<std::uint16_t, std::uint64_t>;

  [[nodiscard]] Step visit(std::uint64_t offset, const RecordHeader& header, std::uint64_t end);
  [[nodiscard]] Step visit_message(std::uint64_t offset, const RecordHeader& header);
  [[nodiscard]] Step visit_chunk(std::uint64_t offset, const RecordHeader& header);
  [[nodiscard]] Step visit_message_index(std::uint64_t offset, const RecordHeader& header);
  template <class T>
  [[nodiscard]] Step visit_checked(std::uint64_t offset, const RecordHeader& header,
                                   std::optional<Checked<T>> decoded, std::vector<T>& list,
                                   std::vector<RecordPlace>& places, std::vector<bool>& is_proven);
  [[nodiscard]] std::optional<ChunkPlace> describe_chunk(std::uint64_t offset,
                                                         const RecordHeader& header);
  // Call this when all message indexes of the newest chunk were visited.
  void settle_chunk();
  // Checks a message index of the chunk that was loaded last.
  [[nodiscard]] bool is_right_index(const std::pair<std::uint16_t, std::uint64_t>& index);
  [[nodiscard]] MessageCounts count_messages() const;
  // Finds message indexes that a writer must add after the loaded chunk, which ends the file.
  void find_missing_indexes(const ChunkPlace& place);
  template <class T>
  void leave_out_unproven(std::vector<T>& list, std::vector<RecordPlace>& places,
                          const std::vector<bool>& is_proven);

  // Returns the next record from `begin` on whose checksum proves that it is a record.
  [[nodiscard]] std::optional<std::uint64_t> find_record(std::uint64_t begin, std::uint64_t end);
  [[nodiscard]] bool is_proven(std::uint64_t offset, const RecordHeader& header);
  // True if a record could begin at `offset`.
  [[nodiscard]] bool is_boundary(std::uint64_t offset, std::uint64_t end);
  // Returns false if the search would cost too much.
  [[nodiscard]] bool spend(std::uint64_t cost) noexcept;

  // Returns false if the contents would take too much memory.
  [[nodiscard]] bool keep(std::uint64_t memory) noexcept;
  // These functions return why the definition was refused, as a sentence; empty if it was not.
  [[nodiscard]] std::string define(Opcode opcode, std::span<const std::byte> content);
  template <class T>
  [[nodiscard]] std::string define_in(std::map<std::uint16_t, T>& known, const T& definition,
                                      const char* what);

  ReaderOptions options_;
  Window window_;
  ChunkLoader loader_;
  Contents contents_;
  std::uint64_t kept_{0};        // memory that `contents_` owns [bytes]
  std::uint64_t search_budget_;  // cost that is left for searching [bytes]

  bool has_chunk_{false};
  bool is_chunk_open_{false};     // message indexes may follow
  bool must_look_inside_{false};  // the header and the indexes do not describe the open chunk
  std::uint64_t first_indexed_time_{0};
  std::uint64_t last_indexed_time_{0};
  std::vector<MessageCounts> counts_;  // one entry per chunk
  bool writes_checksums_{false};       // the writer of the file adds checksums
  std::vector<bool> is_proven_metadata_;
  std::vector<bool> is_proven_attachment_;
};

}  // namespace trifinger::mcap
