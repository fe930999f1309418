// SPDX-License-Identifier: BSD-3-Clause
#include "can/scripted_bus.hpp"

#include <utility>

#include "can/unix_bus.hpp"

namespace trifinger::can {

ScriptedBus::ScriptedBus(std::unique_ptr<Bus> bus, std::uint64_t seed)
    : outer_(std::move(bus)),
      wire_(clock_, {.seed = seed}),
      inner_(wire_.connect()),
      bridge_(wire_.connect()) {}

std::size_t ScriptedBus::do_receive(std::span<Frame> budget) noexcept {
  // What exceeds these frames waits for the next call.
  static_cast<void>(bridge_->send(outer_->receive(frames_)));
  pass_on();
  const std::size_t count = inner_->receive(budget).size();
  state_.link = inner_->state().link;
  return count;
}

SendResult ScriptedBus::do_send(std::span<const Frame> frames) noexcept {
  const SendResult result = inner_->send(frames);
  pass_on();
  state_.link = inner_->state().link;
  return result;
}

// Hands what has crossed the wire by now to the bus outside.
void ScriptedBus::pass_on() noexcept {
  for (;;) {
    const auto crossed = bridge_->receive(frames_);
    static_cast<void>(outer_->send(crossed));
    if (crossed.size() < frames_.size()) break;
  }
  if (auto* const between = dynamic_cast<UnixBus*>(outer_.get())) {
    between->set_link(bridge_->state().link);
  }
}

}  // namespace trifinger::can
