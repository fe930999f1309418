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

// What stands behind the data of a finished file.
struct Summary {
  std::uint64_t data_end{0};  // where the record DataEnd is, or should be
  std::uint64_t begin{0};     // of the summary; where the footer begins if there is none
  std::map<std::uint16_t, Schema> schemas{};
  std::map<std::uint16_t, Channel> channels{};
  std::optional<Statistics> statistics{};
  std::vector<ChunkPlace> chunks{};
  std::vector<RecordPlace> attachments{};
  std::vector<RecordPlace> metadata{};
};

[[nodiscard]] bool ends_with_magic(Window& window);

// Nothing if the file was not finished, or its end is damaged.
[[nodiscard]] std::optional<Summary> read_summary(Window& window);

// All records that a summary names, in the order of the file; a chunk with its message indexes.
struct IndexedRecord {
  RecordPlace place;
  bool is_chunk{false};
};
// Nothing if the summary does not tell of all that there is, or tells nonsense.
[[nodiscard]] std::optional<std::vector<IndexedRecord>> index_of(const Summary& summary);

}  // namespace trifinger::mcap
