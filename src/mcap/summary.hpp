// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "encoding.hpp"
#include "trifinger/mcap/reader.hpp"
#include "window.hpp"

namespace trifinger::mcap {

// The records after the data of a finished file.
struct Summary {
  std::uint64_t data_end{0};  // offset of the record DataEnd, or where it should be
  std::uint64_t begin{0};     // offset of the summary, or of the footer if there is no summary
  std::map<std::uint16_t, Schema> schemas{};
  std::map<std::uint16_t, Channel> channels{};
  std::optional<Statistics> statistics{};
  std::vector<ChunkPlace> chunks{};
  std::vector<RecordPlace> attachments{};
  std::vector<RecordPlace> metadata{};
};

[[nodiscard]] bool ends_with_magic(Window& window);

// Reads the summary. Returns nothing if the file was not finished, or if its end is damaged.
[[nodiscard]] std::optional<Summary> read_summary(Window& window);

// A record that the summary names; a chunk includes its message indexes.
struct IndexedRecord {
  RecordPlace place;
  bool is_chunk{false};
};
// Returns all records that the summary names, in the order of the file. Returns nothing if the
// summary is incomplete or makes no sense.
[[nodiscard]] std::optional<std::vector<IndexedRecord>> index_of(const Summary& summary);

}  // namespace trifinger::mcap
