// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "buffer.hpp"
#include "encoding.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::mcap {

struct RecordHeader {
  Opcode opcode{Opcode::kNone};
  std::uint64_t length{0};  // of the content

  // With the header itself; meaningless if the content is longer than the file.
  [[nodiscard]] std::uint64_t record_length() const noexcept { return kRecordHeaderSize + length; }
};

// Reads small pieces of a source through a window, so that few of them are a call to the system.
// What a function returns is there until the next call.
class Window {
 public:
  Window(const Source& source, std::uint64_t max_record_size)
      : source_(&source), size_(source.size()), max_record_size_(max_record_size) {}

  // Of the source, when the window was made.
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

  // The bytes [offset, offset + size); fewer at the end.
  [[nodiscard]] std::span<const std::byte> at(std::uint64_t offset, std::size_t size);
  // As many bytes from `offset` on as there are at hand, at least `size`; fewer at the end.
  [[nodiscard]] std::span<const std::byte> from(std::uint64_t offset, std::size_t size);

  // The header of the record at `offset` if its content is whole before `end`.
  [[nodiscard]] std::optional<RecordHeader> header_at(std::uint64_t offset, std::uint64_t end);
  // The content of the record at `offset`; less if it is larger than allowed.
  [[nodiscard]] std::span<const std::byte> content_at(std::uint64_t offset,
                                                      const RecordHeader& header);
  [[nodiscard]] std::uint32_t checksum_between(std::uint64_t begin, std::uint64_t end);

 private:
  const Source* source_;
  std::uint64_t size_;
  std::uint64_t max_record_size_;
  Buffer buffer_;
  std::uint64_t begin_{0};
};

}  // namespace trifinger::mcap
