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
  std::uint64_t length{0};  // length of the content

  // Returns the length including this header. Meaningless if the content is longer than the file.
  [[nodiscard]] std::uint64_t record_length() const noexcept { return kRecordHeaderSize + length; }
};

// Reads small pieces of a source through a window, so that few of them need a system call. The
// bytes that a function returns are valid until the next call.
class Window {
 public:
  Window(const Source& source, std::uint64_t max_record_size)
      : source_(&source), size_(source.size()), max_record_size_(max_record_size) {}

  // Returns the size of the source at the time when the window was made.
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

  // Returns the bytes [offset, offset + size); fewer at the end of the source.
  [[nodiscard]] std::span<const std::byte> at(std::uint64_t offset, std::size_t size);
  // Returns the buffered bytes from `offset` on, at least `size`; fewer at the end of the source.
  [[nodiscard]] std::span<const std::byte> from(std::uint64_t offset, std::size_t size);

  // Returns the header of the record at `offset`, if the content of the record ends before `end`.
  [[nodiscard]] std::optional<RecordHeader> header_at(std::uint64_t offset, std::uint64_t end);
  // Returns the content of the record at `offset`, cut off at the largest size allowed.
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
