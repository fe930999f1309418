// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/emulated_port.hpp"

#include <algorithm>

#include "trifinger/base/error.hpp"

namespace trifinger::dynamixel {

void EmulatedPort::reopen() {
  if (!is_plugged_) throw Error("the emulated adapter is not plugged in; plug it in");
  is_open_ = true;
}

bool EmulatedPort::write(std::span<const std::uint8_t> bytes, Instant /*deadline*/) noexcept {
  if (!is_open_) return false;
  bus_.write(bytes, now_, baud_);
  return true;
}

std::size_t EmulatedPort::read(std::span<std::uint8_t> bytes, Instant deadline) noexcept {
  if (const auto arrival = is_open_ ? bus_.next_arrival() : std::nullopt;
      arrival && *arrival <= deadline) {
    now_ = std::max(now_, *arrival);
    bus_.advance(now_);
    return bus_.read(bytes, now_);
  }
  sleep_until(deadline);
  return is_open_ ? bus_.read(bytes, now_) : 0;
}

void EmulatedPort::sleep_until(Instant instant) noexcept {
  now_ = std::max(now_, instant);
  bus_.advance(now_);
}

}  // namespace trifinger::dynamixel
