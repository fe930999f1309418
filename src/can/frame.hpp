// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "trifinger/base/time.hpp"

namespace trifinger::can {

/// A data frame of classic CAN with a standard identifier.
struct Frame {
  static constexpr std::uint32_t kMaxId = 0x7FF;
  static constexpr std::size_t kMaxData = 8;

  std::uint32_t id{0};                        ///< 11 bits. The lowest wins the bus.
  std::uint8_t dlc{0};                        ///< Number of data bytes.
  std::array<std::uint8_t, kMaxData> data{};  ///< Zero from byte `dlc` on.
  Instant time{};                             ///< When it was received. Not used for sending.

  [[nodiscard]] constexpr bool is_valid() const noexcept { return id <= kMaxId && dlc <= kMaxData; }
};

/// True if both frames look the same on the wire. Their times may differ.
[[nodiscard]] constexpr bool is_same_on_wire(const Frame& a, const Frame& b) noexcept {
  return a.id == b.id && a.dlc == b.dlc && a.data == b.data;
}

}  // namespace trifinger::can
