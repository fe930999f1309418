// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>

#include "format/format.hpp"

namespace trifinger::log::detail {

/// Reads a CDR message (little endian) field by field. Fields that are missing read as zero, and
/// then the message does not count as whole.
class CdrReader {
 public:
  explicit CdrReader(std::span<const std::byte> message)
      : bytes_(message),
        is_whole_(message.size() >= kCdrHeaderSize && message[1] == std::byte{1}),
        position_(is_whole_ ? kCdrHeaderSize : message.size()) {}

  template <class T>
  [[nodiscard]] T number() {
    // Alignment counts from the end of the header.
    while (position_ < bytes_.size() && (position_ - kCdrHeaderSize) % sizeof(T) != 0) ++position_;
    T value{};
    if (bytes_.size() - position_ < sizeof(T)) {
      is_whole_ = false;
    } else {
      std::memcpy(&value, bytes_.data() + position_, sizeof(T));
      position_ += sizeof(T);
    }
    return value;
  }

  [[nodiscard]] std::string text() {
    const auto size = number<std::uint32_t>();  // including the zero at the end
    if (size == 0 || size > bytes_.size() - position_) {
      is_whole_ = false;
      return {};
    }
    std::string text(reinterpret_cast<const char*>(bytes_.data()) + position_, size - 1);
    position_ += size;
    return text;
  }

  [[nodiscard]] bool is_whole() const noexcept { return is_whole_; }

 private:
  std::span<const std::byte> bytes_;
  bool is_whole_;
  std::size_t position_;
};

}  // namespace trifinger::log::detail
