// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "buffer.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::mcap {

// Reads small pieces of a source through a window, so that few of them are a call to the system.
class Window {
 public:
  explicit Window(const Source& source) noexcept : source_(&source) {}

  // The bytes [offset, offset + size) until the next call; fewer at the end of the source.
  [[nodiscard]] std::span<const std::byte> at(std::uint64_t offset, std::size_t size) {
    const auto bytes = from(offset, size);
    return bytes.first(std::min(bytes.size(), size));
  }

  // As many bytes from `offset` on as there are at hand, at least `size`.
  [[nodiscard]] std::span<const std::byte> from(std::uint64_t offset, std::size_t size) {
    if (offset < begin_ || offset - begin_ > buffer_.size() ||
        buffer_.size() - (offset - begin_) < size) {
      begin_ = offset;
      buffer_.clear();
      buffer_.resize(std::max(size, kMinSize));
      buffer_.resize(source_->read(offset, {buffer_.data(), buffer_.size()}));
    }
    return buffer_.view().subspan(offset - begin_);
  }

 private:
  static constexpr std::size_t kMinSize = std::size_t{64} << 10;

  const Source* source_;
  Buffer buffer_;
  std::uint64_t begin_{0};
};

}  // namespace trifinger::mcap
