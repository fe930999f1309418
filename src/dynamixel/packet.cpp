// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/packet.hpp"

#include <algorithm>

namespace trifinger::dynamixel {
namespace {

constexpr std::array<std::uint8_t, 4> kHeader{0xFF, 0xFF, 0xFD, 0x00};
constexpr std::size_t kIdAt = 4;
constexpr std::size_t kLengthAt = 5;
constexpr std::uint8_t kStuffing = 0xFD;

// Follows a stream of bytes and says where FF FF FD has just ended.
class StuffingWatch {
 public:
  bool ends_pattern(std::uint8_t byte) noexcept {
    const bool ends = last_ == 0xFF && before_ == 0xFF && byte == 0xFD;
    before_ = last_;
    last_ = byte;
    return ends;
  }

 private:
  std::uint8_t before_{0};
  std::uint8_t last_{0};
};

// Takes the extra bytes out. False if one is missing, which no sender does.
bool remove_stuffing(std::span<std::uint8_t> bytes, std::size_t& size) noexcept {
  StuffingWatch watch;
  size = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const std::uint8_t byte = bytes[i];
    bytes[size++] = byte;
    if (!watch.ends_pattern(byte)) continue;
    ++i;
    if (i == bytes.size() || bytes[i] != kStuffing) return false;
    static_cast<void>(watch.ends_pattern(kStuffing));
  }
  return true;
}

}  // namespace

std::string_view name_of(Instruction instruction) noexcept {
  switch (instruction) {
    case Instruction::kPing:
      return "ping";
    case Instruction::kRead:
      return "read";
    case Instruction::kWrite:
      return "write";
    case Instruction::kRegWrite:
      return "reg write";
    case Instruction::kAction:
      return "action";
    case Instruction::kFactoryReset:
      return "factory reset";
    case Instruction::kReboot:
      return "reboot";
    case Instruction::kClear:
      return "clear";
    case Instruction::kStatus:
      return "status";
    case Instruction::kSyncRead:
      return "sync read";
    case Instruction::kSyncWrite:
      return "sync write";
    case Instruction::kFastSyncRead:
      return "fast sync read";
    case Instruction::kBulkRead:
      return "bulk read";
    case Instruction::kBulkWrite:
      return "bulk write";
    case Instruction::kFastBulkRead:
      return "fast bulk read";
  }
  return "unknown";
}

std::size_t encode(const Packet& packet, std::span<std::uint8_t> bytes) noexcept {
  bytes = bytes.first(std::min(bytes.size(), kMaxPacket));
  if (bytes.size() < packet.parameters.size() + kPacketFrame) return 0;
  std::ranges::copy(kHeader, bytes.begin());
  bytes[kIdAt] = packet.id;
  StuffingWatch watch;
  std::size_t size = kHeaderSize;
  bytes[size++] = static_cast<std::uint8_t>(packet.instruction);
  static_cast<void>(watch.ends_pattern(bytes[kHeaderSize]));
  for (const std::uint8_t byte : packet.parameters) {
    const bool needs_stuffing = watch.ends_pattern(byte);
    const std::size_t needed = (needs_stuffing ? 2U : 1U) + 2U;  // and the CRC
    if (bytes.size() - size < needed) return 0;
    bytes[size++] = byte;
    if (needs_stuffing) {
      bytes[size++] = kStuffing;
      static_cast<void>(watch.ends_pattern(kStuffing));
    }
  }
  put_number(bytes.subspan(kLengthAt), static_cast<std::uint32_t>(size - kHeaderSize + 2), 2);
  put_number(bytes.subspan(size), crc16(bytes.first(size)), 2);
  return size + 2;
}

std::size_t PacketParser::feed(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes_.size() - end_ < bytes.size() && begin_ > 0) {
    std::copy(bytes_.begin() + static_cast<std::ptrdiff_t>(begin_),
              bytes_.begin() + static_cast<std::ptrdiff_t>(end_), bytes_.begin());
    end_ -= begin_;
    begin_ = 0;
  }
  const std::size_t taken = std::min(bytes.size(), bytes_.size() - end_);
  std::copy_n(bytes.begin(), taken, bytes_.begin() + static_cast<std::ptrdiff_t>(end_));
  end_ += taken;
  return taken;
}

void PacketParser::skip(std::size_t count) noexcept {
  begin_ += count;
  counts_.skipped += count;
}

// Skips everything that cannot be the beginning of a packet.
void PacketParser::skip_to_header() noexcept {
  const auto bytes = waiting();
  // clang 14 does not compile std::ranges::search.
  // NOLINTNEXTLINE(modernize-use-ranges)
  const auto found = std::search(bytes.begin(), bytes.end(), kHeader.begin(), kHeader.end());
  auto place = static_cast<std::size_t>(found - bytes.begin());
  if (found == bytes.end()) {
    // The last bytes may be the beginning of a header.
    std::size_t begun = std::min(bytes.size(), kHeader.size() - 1);
    while (begun > 0 && !std::ranges::equal(bytes.last(begun), std::span(kHeader).first(begun))) {
      --begun;
    }
    place = bytes.size() - begun;
  }
  skip(place);
}

std::optional<Packet> PacketParser::next() noexcept {
  const auto is_damaged = [this] {
    ++counts_.damaged;
    skip(kHeader.size());
  };
  while (true) {
    skip_to_header();
    const auto bytes = waiting();
    if (bytes.size() < kHeaderSize) return std::nullopt;
    const MotorId id = bytes[kIdAt];
    const std::size_t length = number_in(bytes.subspan(kLengthAt, 2));
    const std::size_t size = kHeaderSize + length;
    if ((id > kMaxId && id != kBroadcast) || length < 3 || size > kMaxPacket) {
      is_damaged();
      continue;
    }
    if (bytes.size() < size) return std::nullopt;
    if (number_in(bytes.subspan(size - 2, 2)) != crc16(bytes.first(size - 2))) {
      is_damaged();
      continue;
    }
    const std::span<std::uint8_t> body =
        std::span(bytes_).subspan(begin_ + kHeaderSize, length - 2);
    const auto instruction = static_cast<Instruction>(body[0]);
    std::size_t body_size = body.size();
    // Several motors make the answer to a fast read together, so none of them can stuff it.
    const bool is_stuffed = id != kBroadcast || instruction != Instruction::kStatus;
    const bool is_well_formed = !is_stuffed || remove_stuffing(body, body_size);
    begin_ += size;
    if (!is_well_formed) {
      ++counts_.damaged;
      counts_.skipped += size;
      continue;
    }
    ++counts_.packets;
    return Packet{
        .id = id, .instruction = instruction, .parameters = body.subspan(1, body_size - 1)};
  }
}

std::span<const std::uint8_t> PacketParser::begun() noexcept {
  skip_to_header();
  return waiting();
}

bool PacketParser::abandon() noexcept {
  skip_to_header();
  const std::size_t left = waiting().size();
  if (left == 0) return false;
  if (left >= kHeader.size()) ++counts_.damaged;
  skip(std::min(left, kHeader.size()));
  return true;
}

}  // namespace trifinger::dynamixel
