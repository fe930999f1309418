// SPDX-License-Identifier: BSD-3-Clause
#include "can/bus.hpp"

#include <algorithm>

namespace trifinger::can {

Refusal refusal_of(Link link) noexcept {
  return link == Link::kBusOff ? Refusal::kBusOff
         : link == Link::kDown ? Refusal::kDown
         : link == Link::kGone ? Refusal::kGone
                               : Refusal::kNone;
}

std::span<const Frame> Bus::receive(std::span<Frame> budget) noexcept {
  if (is_inherited()) {
    state_.link = Link::kGone;
    return {};
  }
  const std::size_t count = do_receive(budget);
  state_.received += count;
  return budget.first(count);
}

SendResult Bus::send(std::span<const Frame> frames) noexcept {
  if (is_inherited()) {
    state_.link = Link::kGone;
    return {.refusal = Refusal::kGone};
  }
  const auto invalid = std::ranges::find_if_not(frames, &Frame::is_valid);
  const auto valid = static_cast<std::size_t>(invalid - frames.begin());
  SendResult result = do_send(frames.first(valid));
  state_.sent += result.sent;
  if (result.refusal == Refusal::kNone && valid < frames.size()) {
    result.refusal = Refusal::kInvalidFrame;
  }
  return result;
}

}  // namespace trifinger::can
