// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "format/format.hpp"

namespace trifinger::log::detail {

// Writes a CDR message (little endian) field by field: numbers, texts and lengths of arrays.
class CdrWriter {
 public:
  CdrWriter() { bytes_ = {std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}}; }

  template <class Number>
  void add(Number number) {
    // Alignment counts from the end of the header.
    while ((bytes_.size() - kCdrHeaderSize) % sizeof(number) != 0) bytes_.push_back(std::byte{0});
    append(&number, sizeof(number));
  }
  void add(std::string_view text) {
    add(static_cast<std::uint32_t>(text.size() + 1));
    append(text.data(), text.size());
    bytes_.push_back(std::byte{0});
  }
  // Adds a builtin_interfaces/Time. `nanoseconds` count from 1970.
  void add_time(std::int64_t nanoseconds) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    add(static_cast<std::int32_t>(nanoseconds / kSecond));
    add(static_cast<std::uint32_t>(nanoseconds % kSecond));
  }

  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::vector<std::byte> take() noexcept { return std::move(bytes_); }

 private:
  void append(const void* data, std::size_t size) {
    const auto* begin = static_cast<const std::byte*>(data);
    bytes_.insert(bytes_.end(), begin, begin + size);
  }

  std::vector<std::byte> bytes_;
};

}  // namespace trifinger::log::detail
