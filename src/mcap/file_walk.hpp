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

// Goes through a file record by record and gathers its contents. What is damaged is named and
// stepped over; where it is not even clear how long it is, the next record with a right checksum is
// searched.
class FileWalk {
 public:
  FileWalk(const Source& source, const ReaderOptions& options);

  [[nodiscard]] Contents& contents() noexcept { return contents_; }
  [[nodiscard]] Window& window() noexcept { return window_; }

  // Takes in the records from `begin` to `end`; returns the end of the last one that is whole.
  std::uint64_t walk(std::uint64_t begin, std::uint64_t end);
  // Believes what a summary says; false if it would take too much memory.
  [[nodiscard]] bool adopt(std::map<std::uint16_t, Schema> schemas,
                           std::map<std::uint16_t, Channel> channels);
  void adopt(ChunkPlace place);
  // To be called behind the last record: who writes one checksum writes all, so where it is missing
  // it is damaged.
  void leave_out_unproven();
  // Cuts off what is damaged at the end of a file that was not finished, `end` being the end of the
  // last whole record. Returns where a writer can go on.
  [[nodiscard]] std::uint64_t cut_damaged_tail(std::uint64_t end);
  // Counts the messages of the chunks that were met on the way.
  void sum_up_counts();

  // Reads a chunk and its schemas and channels. Returns why it cannot be used, as a sentence; empty
  // if it can.
  [[nodiscard]] std::string load(const ChunkPlace& place);
  // Of the chunk that was loaded last.
  [[nodiscard]] std::span<const Message> messages() const noexcept { return loader_.messages(); }
  // Names it if the header of the loaded chunk has wrong times. Its messages are right
  // nevertheless.
  void correct_times(ChunkPlace& place);
  void add_damage(std::uint64_t offset, std::uint64_t size, std::string reason);

 private:
  enum class Step : std::uint8_t {
    kGoOn,     // the record was understood, or its damage was named
    kLost,     // it makes no sense: perhaps its length does not either
    kDataEnd,  // what follows is the summary
  };
  // Number of messages of channels.
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
  // All message indexes of the newest chunk were visited.
  void settle_chunk();
  // Of the chunk that was loaded last.
  [[nodiscard]] bool is_right_index(const std::pair<std::uint16_t, std::uint64_t>& index);
  [[nodiscard]] MessageCounts count_messages() const;
  // What has to be written behind the chunk that was loaded last, which is at the end of the file.
  void find_missing_indexes(const ChunkPlace& place);
  template <class T>
  void leave_out_unproven(std::vector<T>& list, std::vector<RecordPlace>& places,
                          const std::vector<bool>& is_proven);

  // The next record from `begin` on that proves by a checksum to be one.
  [[nodiscard]] std::optional<std::uint64_t> find_record(std::uint64_t begin, std::uint64_t end);
  [[nodiscard]] bool is_proven(std::uint64_t offset, const RecordHeader& header);
  // True if a record could begin here.
  [[nodiscard]] bool is_boundary(std::uint64_t offset, std::uint64_t end);
  // False if the search has cost too much already.
  [[nodiscard]] bool spend(std::uint64_t cost) noexcept;

  // False if there is too much already.
  [[nodiscard]] bool keep(std::uint64_t memory) noexcept;
  // These return why not, as a sentence; empty if it was done.
  [[nodiscard]] std::string define(Opcode opcode, std::span<const std::byte> content);
  template <class T>
  [[nodiscard]] std::string define_in(std::map<std::uint16_t, T>& known, const T& definition,
                                      const char* what);

  ReaderOptions options_;
  Window window_;
  ChunkLoader loader_;
  Contents contents_;
  std::uint64_t kept_{0};        // memory of what `contents_` owns
  std::uint64_t search_budget_;  // bytes

  bool has_chunk_{false};
  bool is_chunk_open_{false};     // message indexes may follow
  bool must_look_inside_{false};  // the open chunk is not described well enough from outside
  std::uint64_t first_indexed_time_{0};
  std::uint64_t last_indexed_time_{0};
  std::vector<MessageCounts> counts_;  // for each chunk of the walk
  bool writes_checksums_{false};       // whoever wrote the file
  std::vector<bool> is_proven_metadata_;
  std::vector<bool> is_proven_attachment_;
};

}  // namespace trifinger::mcap
