// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer feeds the parser of Dynamixel packets with any bytes, in pieces of any size.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

#include "dynamixel/packet.hpp"

namespace {

using namespace trifinger::dynamixel;

void require(bool is_true, const char* law) {
  if (is_true) return;
  std::fprintf(stderr, "broken: %s\n", law);
  std::abort();
}

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming): libFuzzer's name
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const std::size_t piece = 1U + data[0];
  const std::span bytes(data + 1, size - 1);
  PacketParser parser;
  std::array<std::uint8_t, kMaxPacket> again{};
  std::size_t used = 0;
  const auto take_all = [&] {
    while (const auto packet = parser.next()) {
      require(packet->id <= kMaxId || packet->id == kBroadcast, "a packet has a possible number");
      if (packet->id == kBroadcast && packet->instruction == Instruction::kStatus) {
        used += packet->parameters.size() + kPacketFrame;  // it is not stuffed
        continue;
      }
      const std::size_t encoded = encode(*packet, again);
      require(encoded > 0, "what was accepted can be sent again");
      used += encoded;
    }
  };
  for (std::size_t i = 0; i < bytes.size();) {
    const std::size_t taken = parser.feed(bytes.subspan(i, std::min(piece, bytes.size() - i)));
    require(taken > 0, "the parser always takes bytes after next has returned nothing");
    i += taken;
    take_all();
  }
  while (parser.abandon()) take_all();
  require(used + parser.counts().skipped == bytes.size(), "every byte is counted once");
  return 0;
}
