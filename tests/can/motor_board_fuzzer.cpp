// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer feeds the decoders of a motor board's frames, and the reader of an interface's state,
// with any bytes (fault_39).
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <type_traits>
#include <variant>

#include "can/interface_state.hpp"
#include "can/motor_board.hpp"

namespace {

using namespace trifinger::can;

void require(bool is_true, const char* law) {
  if (is_true) return;
  std::fprintf(stderr, "broken: %s\n", law);
  std::abort();
}

void check_frame(const Frame& frame) {
  const auto check = [&frame](const auto& message) {
    if constexpr (!std::is_same_v<std::decay_t<decltype(message)>, Rejection>) {
      require(is_same_on_wire(encode(message), frame), "what is accepted has the same bytes again");
    }
    return !std::is_same_v<std::decay_t<decltype(message)>, Rejection>;
  };
  const bool is_from_board = std::visit(check, decode_from_board(frame));
  const bool is_from_host = std::visit(check, decode_from_host(frame));
  require(!is_from_board || !is_from_host, "no frame has two senders");
}

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming): libFuzzer's name
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static_cast<void>(parse_interface_state(std::as_bytes(std::span(data, size))));
  if (size < 3) return 0;
  Frame frame{.id = data[0] | std::uint32_t{data[1]} << 8U, .dlc = data[2]};
  std::copy_n(data + 3, std::min<std::size_t>({size - 3, frame.dlc, Frame::kMaxData}),
              frame.data.begin());
  check_frame(frame);
  return 0;
}
