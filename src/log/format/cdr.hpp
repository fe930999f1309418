// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "log/format/format.hpp"

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
  // Adds an array of bytes.
  void add(std::span<const std::byte> bytes) {
    add(static_cast<std::uint32_t>(bytes.size()));
    append(bytes.data(), bytes.size());
  }
  // Adds a builtin_interfaces/Time. `nanoseconds` count from 1970.
  void add_time(std::int64_t nanoseconds) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    add(static_cast<std::int32_t>(nanoseconds / kSecond));
    add(static_cast<std::uint32_t>(nanoseconds % kSecond));
  }

  void reserve(std::size_t size) { bytes_.reserve(size); }
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::vector<std::byte> take() noexcept { return std::move(bytes_); }

 private:
  void append(const void* data, std::size_t size) {
    const auto* begin = static_cast<const std::byte*>(data);
    bytes_.insert(bytes_.end(), begin, begin + size);
  }

  std::vector<std::byte> bytes_;
};

// Reads a CDR message (little endian) field by field. Fields that are missing read as zero, and
// then the message does not count as whole.
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

  // An array of bytes, in the message itself.
  [[nodiscard]] std::span<const std::byte> bytes() {
    const auto size = number<std::uint32_t>();
    if (size > bytes_.size() - position_) {
      is_whole_ = false;
      return {};
    }
    position_ += size;
    return bytes_.subspan(position_ - size, size);
  }

  [[nodiscard]] bool is_whole() const noexcept { return is_whole_; }

 private:
  std::span<const std::byte> bytes_;
  bool is_whole_;
  std::size_t position_;
};

}  // namespace trifinger::log::detail
