// SPDX-License-Identifier: BSD-3-Clause
#include "window.hpp"

#include <algorithm>

namespace trifinger::mcap {
namespace {

constexpr std::size_t kMinSize = std::size_t{64} << 10;

}  // namespace

std::span<const std::byte> Window::at(std::uint64_t offset, std::size_t size) {
  const auto bytes = from(offset, size);
  return bytes.first(std::min(bytes.size(), size));
}

std::span<const std::byte> Window::from(std::uint64_t offset, std::size_t size) {
  if (offset < begin_ || offset - begin_ > buffer_.size() ||
      buffer_.size() - (offset - begin_) < size) {
    begin_ = offset;
    buffer_.clear();
    buffer_.resize(std::max(size, kMinSize));
    buffer_.resize(source_->read(offset, {buffer_.data(), buffer_.size()}));
  }
  return buffer_.view().subspan(offset - begin_);
}

std::optional<RecordHeader> Window::header_at(std::uint64_t offset, std::uint64_t end) {
  if (offset > end || end - offset < kRecordHeaderSize) return std::nullopt;
  Decoder decoder(at(offset, kRecordHeaderSize));
  const auto opcode = static_cast<Opcode>(decoder.number<std::uint8_t>());
  const auto length = decoder.number<std::uint64_t>();
  if (!decoder.is_whole() || length > end - offset - kRecordHeaderSize) return std::nullopt;
  return RecordHeader{.opcode = opcode, .length = length};
}

std::span<const std::byte> Window::content_at(std::uint64_t offset, const RecordHeader& header) {
  return at(offset + kRecordHeaderSize, std::min(header.length, max_record_size_));
}

std::uint32_t Window::checksum_between(std::uint64_t begin, std::uint64_t end) {
  std::uint32_t sum = 0;
  while (begin < end) {
    const auto bytes = at(begin, std::min<std::uint64_t>(kMinSize, end - begin));
    if (bytes.empty()) break;  // the file has become shorter
    sum = checksum(bytes, sum);
    begin += bytes.size();
  }
  return sum;
}

}  // namespace trifinger::mcap
