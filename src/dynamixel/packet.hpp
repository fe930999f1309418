// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "trifinger/realtime/annotations.hpp"

namespace trifinger::dynamixel {

// The packets of Dynamixel Protocol 2.0, for both ends of a bus:
//
//     FF FF FD 00 | id | length, 2 bytes | instruction | parameters | CRC, 2 bytes
//
// All numbers are little-endian. The length counts what follows it. Inside instruction and
// parameters every FF FF FD is followed by an extra FD ("stuffing"), which the length counts.

/// The number of a motor on its bus.
using MotorId = std::uint8_t;

inline constexpr MotorId kMaxId = 252;      ///< The largest number that a motor can have.
inline constexpr MotorId kBroadcast = 254;  ///< Every motor listens to it.

/// Sizes of packets [bytes]. No packet here is longer than `kMaxPacket`; longer ones on a line are
/// damage.
inline constexpr std::size_t kMaxPacket = 2048;
inline constexpr std::size_t kHeaderSize = 7;    ///< Everything before the instruction.
inline constexpr std::size_t kPacketFrame = 10;  ///< A packet without parameters.

enum class Instruction : std::uint8_t {
  kPing = 0x01,
  kRead = 0x02,
  kWrite = 0x03,
  kRegWrite = 0x04,  ///< A write that waits for kAction.
  kAction = 0x05,
  kFactoryReset = 0x06,
  kReboot = 0x08,
  kClear = 0x10,
  kStatus = 0x55,  ///< What motors send.
  kSyncRead = 0x82,
  kSyncWrite = 0x83,
  kFastSyncRead = 0x8A,
  kBulkRead = 0x92,
  kBulkWrite = 0x93,
  kFastBulkRead = 0x9A,
};

/// The word for an instruction, such as "sync read"; "unknown" if there is none.
[[nodiscard]] std::string_view name_of(Instruction instruction) noexcept;

/// What a packet says, without stuffing and CRC. The parameters belong to somebody else.
struct Packet {
  MotorId id{0};
  Instruction instruction{Instruction::kPing};
  std::span<const std::uint8_t> parameters{};
};

namespace detail {

inline constexpr auto kCrcTable = [] {
  std::array<std::uint16_t, 256> table{};
  for (unsigned byte = 0; byte < table.size(); ++byte) {
    unsigned value = byte << 8U;
    for (int bit = 0; bit < 8; ++bit) {
      value = (value & 0x8000U) != 0 ? (value << 1U) ^ 0x8005U : value << 1U;
    }
    table[byte] = static_cast<std::uint16_t>(value);
  }
  return table;
}();

}  // namespace detail

/// The CRC of `bytes`: polynomial 0x8005, not reflected, no final xor. It continues from `before`,
/// the CRC of the bytes in front.
[[nodiscard]] constexpr std::uint16_t crc16(std::span<const std::uint8_t> bytes,
                                            std::uint16_t before = 0) noexcept {
  unsigned crc = before;
  for (const std::uint8_t byte : bytes) {
    crc = ((crc << 8U) ^ detail::kCrcTable[((crc >> 8U) ^ byte) & 0xFFU]) & 0xFFFFU;
  }
  return static_cast<std::uint16_t>(crc);
}

/// Writes `packet` as the bytes of the line. Returns their number; 0 if they do not fit into
/// `bytes` or are more than `kMaxPacket`.
[[nodiscard]] std::size_t encode(const Packet& packet,
                                 std::span<std::uint8_t> bytes) noexcept TRIFINGER_REALTIME;

/// Writes the low `size` bytes of `value`, the least significant first.
constexpr void put_number(std::span<std::uint8_t> bytes, std::uint32_t value,
                          std::size_t size) noexcept {
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(value >> (8 * i));
}

/// Reads a number of bytes.size() bytes, at most 4.
[[nodiscard]] constexpr std::uint32_t number_in(std::span<const std::uint8_t> bytes) noexcept {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) value |= std::uint32_t{bytes[i]} << (8 * i);
  return value;
}

/// Reads a number in two's complement of bytes.size() bytes, 1 to 4.
[[nodiscard]] constexpr std::int32_t signed_number_in(
    std::span<const std::uint8_t> bytes) noexcept {
  const auto unused = static_cast<unsigned>(32 - 8 * bytes.size());
  return static_cast<std::int32_t>(number_in(bytes) << unused) >> unused;
}

/// Finds packets in a stream of bytes that may be damaged.
///
/// Bytes come in pieces of any size. Whatever comes, the parser finds every whole packet that no
/// damaged one in front has swallowed, and it finds those, too, after `abandon`. It does not
/// allocate.
class PacketParser {
 public:
  /// Numbers since the parser was made.
  struct Counts {
    std::uint64_t packets{0};
    std::uint64_t damaged{0};  ///< Headers without a packet: wrong CRC, length or number, or cut.
    std::uint64_t skipped{0};  ///< Bytes that belong to no packet.
  };

  /// Takes bytes and returns how many. It takes all unless packets wait: call `next` until it
  /// returns nothing, and go on.
  [[nodiscard]] std::size_t feed(std::span<const std::uint8_t> bytes) noexcept TRIFINGER_REALTIME;

  /// Returns the next whole packet. Its parameters are valid until the next call of any function.
  [[nodiscard]] std::optional<Packet> next() noexcept TRIFINGER_REALTIME;

  /// What has begun will not be completed: the sender has been silent for too long. `next` then
  /// looks for packets in what came after its header. Returns false if nothing was left.
  bool abandon() noexcept TRIFINGER_REALTIME;

  /// The bytes of a packet that has begun, from its header on; empty if none has. They are valid
  /// until the next call of any function.
  [[nodiscard]] std::span<const std::uint8_t> begun() noexcept TRIFINGER_REALTIME;
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

 private:
  [[nodiscard]] std::span<const std::uint8_t> waiting() const noexcept {
    return std::span(bytes_).subspan(begin_, end_ - begin_);
  }
  void skip(std::size_t count) noexcept;
  void skip_to_header() noexcept;

  std::array<std::uint8_t, 2 * kMaxPacket> bytes_{};
  std::size_t begin_{0};  // of what has not been understood
  std::size_t end_{0};
  Counts counts_{};
};

}  // namespace trifinger::dynamixel
