// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/packet.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <string>
#include <vector>

#include "support/allocation_counter.hpp"

namespace trifinger::dynamixel::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

// The bytes as data sheets write them: "ff ff fd 00 01".
std::string hex(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : bytes) {
    if (!text.empty()) text += ' ';
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

Bytes encoded(const Packet& packet) {
  Bytes bytes(kMaxPacket);
  bytes.resize(encode(packet, bytes));
  return bytes;
}

Bytes encoded(MotorId id, Instruction instruction, const Bytes& parameters) {
  return encoded({.id = id, .instruction = instruction, .parameters = parameters});
}

// A packet that keeps its parameters.
struct Kept {
  MotorId id{0};
  Instruction instruction{Instruction::kPing};
  Bytes parameters;

  friend bool operator==(const Kept&, const Kept&) = default;
};

void take_all(PacketParser& parser, std::vector<Kept>& found) {
  while (const auto packet = parser.next()) {
    found.push_back({packet->id, packet->instruction,
                     Bytes(packet->parameters.begin(), packet->parameters.end())});
  }
}

// All packets of a stream that comes in pieces of `piece` bytes and then ends.
std::vector<Kept> parsed(PacketParser& parser, std::span<const std::uint8_t> bytes,
                         std::size_t piece) {
  std::vector<Kept> found;
  for (std::size_t i = 0; i < bytes.size();) {
    const std::size_t size = std::min(piece, bytes.size() - i);
    i += parser.feed(bytes.subspan(i, size));
    take_all(parser, found);
  }
  while (parser.abandon()) take_all(parser, found);
  return found;
}

// Bytes that have headers and stuffing more often than chance would give.
rc::Gen<Bytes> nasty_bytes() {
  return rc::gen::container<Bytes>(
      rc::gen::weightedOneOf<std::uint8_t>({{4, rc::gen::just<std::uint8_t>(0xFF)},
                                            {3, rc::gen::just<std::uint8_t>(0xFD)},
                                            {1, rc::gen::just<std::uint8_t>(0x00)},
                                            {2, rc::gen::arbitrary<std::uint8_t>()}}));
}

rc::Gen<Kept> any_packet() {
  return rc::gen::apply(
      [](std::uint8_t id, std::uint8_t instruction, const Bytes& parameters) {
        constexpr std::array kInstructions{Instruction::kPing,     Instruction::kRead,
                                           Instruction::kWrite,    Instruction::kStatus,
                                           Instruction::kSyncRead, Instruction::kSyncWrite};
        return Kept{static_cast<MotorId>(id % (kMaxId + 1)),
                    kInstructions[instruction % kInstructions.size()], parameters};
      },
      rc::gen::arbitrary<std::uint8_t>(), rc::gen::arbitrary<std::uint8_t>(), nasty_bytes());
}

TEST(Crc16, HasTheCheckValueOfItsPolynomial) {
  const std::string digits = "123456789";
  EXPECT_EQ(crc16(Bytes(digits.begin(), digits.end())), 0xFEE8);
}

TEST(Crc16, ContinuesFromTheCrcOfTheBytesInFront) {
  EXPECT_TRUE(rc::check([](const Bytes& front, const Bytes& back) {
    Bytes all = front;
    all.insert(all.end(), back.begin(), back.end());
    RC_ASSERT(crc16(back, crc16(front)) == crc16(all));
  }));
}

TEST(Encode, GivesThePacketsOfTheDataSheet) {
  EXPECT_EQ(hex(encoded(1, Instruction::kPing, {})), "ff ff fd 00 01 03 00 01 19 4e");
  EXPECT_EQ(hex(encoded(1, Instruction::kRead, {0x84, 0, 4, 0})),
            "ff ff fd 00 01 07 00 02 84 00 04 00 1d 15");
  EXPECT_EQ(hex(encoded(1, Instruction::kWrite, {0x74, 0, 0, 2, 0, 0})),
            "ff ff fd 00 01 09 00 03 74 00 00 02 00 00 ca 89");
  const Bytes all = encoded(kBroadcast, Instruction::kSyncRead,
                            {126, 0, 10, 0, 10, 11, 12, 20, 21, 22, 30, 31, 32});
  EXPECT_EQ(all.size(), 23U);
  EXPECT_EQ(hex(std::span(all).last(5)), "1e 1f 20 48 35");
}

TEST(Encode, PutsAnExtraByteAfterWhatLooksLikeAHeader) {
  const Bytes bytes = encoded(1, Instruction::kWrite, {0xFF, 0xFF, 0xFD, 0xFD});
  EXPECT_EQ(hex(std::span(bytes).subspan(5, 8)), "08 00 03 ff ff fd fd fd");
}

TEST(Encode, RefusesWhatDoesNotFit) {
  const Bytes parameters(20, 0xFF);
  Bytes room(30);
  EXPECT_EQ(encode({.id = 1, .parameters = parameters}, room), 30U);
  room.resize(29);
  EXPECT_EQ(encode({.id = 1, .parameters = parameters}, room), 0U);
  const Bytes too_many(kMaxPacket, 0);
  Bytes large(2 * kMaxPacket);
  EXPECT_EQ(encode({.id = 1, .parameters = too_many}, large), 0U);
}

TEST(Encode, NeverWritesBeyondItsRoom) {
  EXPECT_TRUE(rc::check([] {
    const Kept packet = *any_packet();
    const Bytes whole = encoded(packet.id, packet.instruction, packet.parameters);
    const auto room = *rc::gen::inRange<std::size_t>(0, whole.size() + 4);
    Bytes bytes(room + 4, 0xA5);
    const std::size_t size =
        encode({packet.id, packet.instruction, packet.parameters}, std::span(bytes).first(room));
    RC_ASSERT(size == (room >= whole.size() ? whole.size() : 0U));
    for (std::size_t i = room; i < bytes.size(); ++i) RC_ASSERT(bytes[i] == 0xA5);
  }));
}

TEST(Encode, LeavesNoHeaderInsideAPacket) {
  EXPECT_TRUE(rc::check([] {
    const Kept packet = *any_packet();
    const Bytes bytes = encoded(packet.id, packet.instruction, packet.parameters);
    constexpr std::array<std::uint8_t, 4> kHeader{0xFF, 0xFF, 0xFD, 0x00};
    const auto body = std::span(bytes).subspan(kHeaderSize, bytes.size() - kHeaderSize - 2);
    // clang 14 does not compile std::ranges::search.
    // NOLINTNEXTLINE(modernize-use-ranges)
    RC_ASSERT(std::search(body.begin(), body.end(), kHeader.begin(), kHeader.end()) == body.end());
  }));
}

TEST(PacketParser, FindsThePacketsOfAStreamInPiecesOfAnySize) {
  EXPECT_TRUE(rc::check([] {
    const auto packets = *rc::gen::container<std::vector<Kept>>(any_packet());
    const auto piece = *rc::gen::inRange<std::size_t>(1, 50);
    Bytes stream;
    for (const Kept& packet : packets) {
      const Bytes bytes = encoded(packet.id, packet.instruction, packet.parameters);
      stream.insert(stream.end(), bytes.begin(), bytes.end());
    }
    PacketParser parser;
    RC_ASSERT(parsed(parser, stream, piece) == packets);
    RC_ASSERT(parser.counts().damaged == 0U);
    RC_ASSERT(parser.counts().skipped == 0U);
  }));
}

TEST(PacketParser, FindsAPacketAfterAnyDamage) {
  EXPECT_TRUE(rc::check([] {
    // Noise, a packet with damage, and a whole packet: the last one is always found.
    const Bytes noise = *nasty_bytes();
    const Kept first = *any_packet();
    const Kept last = *any_packet();
    Bytes damaged = encoded(first.id, first.instruction, first.parameters);
    const auto cut = *rc::gen::inRange<std::size_t>(0, damaged.size());
    const auto removed = *rc::gen::inRange<std::size_t>(1, 4);
    damaged.erase(
        damaged.begin() + static_cast<std::ptrdiff_t>(cut),
        damaged.begin() + static_cast<std::ptrdiff_t>(std::min(cut + removed, damaged.size())));
    Bytes stream = noise;
    stream.insert(stream.end(), damaged.begin(), damaged.end());
    const Bytes whole = encoded(last.id, last.instruction, last.parameters);
    stream.insert(stream.end(), whole.begin(), whole.end());
    PacketParser parser;
    const auto found = parsed(parser, stream, *rc::gen::inRange<std::size_t>(1, 60));
    RC_ASSERT(!found.empty());
    RC_ASSERT(found.back() == last);
  }));
}

TEST(PacketParser, RefusesAPacketWithAnyWrongBit) {
  const Bytes whole = encoded(7, Instruction::kStatus, {0, 1, 2, 3, 0xFF, 0xFF, 0xFD, 4});
  for (std::size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    Bytes bytes = whole;
    bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ (1U << (bit % 8)));
    PacketParser parser;
    EXPECT_TRUE(parsed(parser, bytes, bytes.size()).empty()) << "bit " << bit;
  }
}

TEST(PacketParser, GivesBackWhatAWrongLengthHasSwallowed) {
  Bytes stream = encoded(1, Instruction::kStatus, {0, 1, 2});
  stream[5] = 200;  // the length
  const Bytes next = encoded(2, Instruction::kStatus, {0, 3, 4});
  stream.insert(stream.end(), next.begin(), next.end());
  PacketParser parser;
  EXPECT_EQ(parser.feed(stream), stream.size());
  EXPECT_FALSE(parser.next());
  EXPECT_TRUE(parser.abandon());
  const auto packet = parser.next();
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->id, 2);
  EXPECT_EQ(parser.counts().damaged, 1U);
  EXPECT_FALSE(parser.abandon());
}

TEST(PacketParser, CountsEveryByteOfAStream) {
  EXPECT_TRUE(rc::check([] {
    const Bytes noise = *nasty_bytes();
    const Kept packet = *any_packet();
    Bytes stream = noise;
    const Bytes whole = encoded(packet.id, packet.instruction, packet.parameters);
    stream.insert(stream.end(), whole.begin(), whole.end());
    PacketParser parser;
    const auto found = parsed(parser, stream, 7);
    std::size_t used = 0;
    for (const Kept& kept : found) {
      used += encoded(kept.id, kept.instruction, kept.parameters).size();
    }
    RC_ASSERT(used + parser.counts().skipped == stream.size());
  }));
}

TEST(PacketParser, DoesNotAllocate) {
  const Bytes whole = encoded(7, Instruction::kStatus, Bytes(40, 0xFF));
  PacketParser parser;
  std::array<std::uint8_t, 100> room{};
  const trifinger::test::AllocationCounter allocations;
  for (int i = 0; i < 1000; ++i) {
    static_cast<void>(parser.feed(whole));
    EXPECT_TRUE(parser.next());
    static_cast<void>(encode({.id = 1, .parameters = std::span(whole).first(20)}, room));
  }
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(Numbers, AreLittleEndianInTwosComplement) {
  std::array<std::uint8_t, 4> bytes{};
  put_number(bytes, static_cast<std::uint32_t>(-2), 2);
  EXPECT_EQ(hex(bytes), "fe ff 00 00");
  EXPECT_EQ(signed_number_in(std::span(bytes).first(2)), -2);
  EXPECT_EQ(signed_number_in(std::span(bytes).first(1)), -2);
  EXPECT_EQ(number_in(std::span(bytes).first(2)), 0xFFFEU);
  EXPECT_EQ(signed_number_in(bytes), 0xFFFE);
}

TEST(Numbers, ComeBackAsTheyWere) {
  EXPECT_TRUE(rc::check([](std::int32_t value) {
    std::array<std::uint8_t, 4> bytes{};
    put_number(bytes, static_cast<std::uint32_t>(value), 4);
    RC_ASSERT(signed_number_in(bytes) == value);
  }));
}

}  // namespace
}  // namespace trifinger::dynamixel::test
