// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <memory>
#include <span>
#include <utility>

namespace trifinger::mcap {

// Bytes that can grow. The memory is kept when the buffer is emptied. Unlike std::vector, `resize`
// does not fill bytes that are about to be overwritten.
class Buffer {
 public:
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] std::byte* data() noexcept { return bytes_.get(); }
  [[nodiscard]] std::span<const std::byte> view() const noexcept { return {bytes_.get(), size_}; }

  void reserve(std::size_t capacity) {
    if (capacity <= capacity_) return;
    capacity = std::max(capacity, capacity_ + capacity_ / 2);
    auto bytes = std::make_unique_for_overwrite<std::byte[]>(capacity);
    if (size_ > 0) std::memcpy(bytes.get(), bytes_.get(), size_);
    bytes_ = std::move(bytes);
    capacity_ = capacity;
  }
  // New bytes have no defined value.
  void resize(std::size_t size) {
    reserve(size);
    size_ = size;
  }
  void clear() noexcept { size_ = 0; }
  // `bytes` may be nullptr if `size` is 0.
  void append(const void* bytes, std::size_t size) {
    reserve(size_ + size);
    if (size > 0) std::memcpy(bytes_.get() + size_, bytes, size);
    size_ += size;
  }

 private:
  std::unique_ptr<std::byte[]> bytes_;
  std::size_t size_{0};
  std::size_t capacity_{0};
};

}  // namespace trifinger::mcap
