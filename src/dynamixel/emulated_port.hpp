// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "dynamixel/emulated_bus.hpp"
#include "dynamixel/port.hpp"

namespace trifinger::dynamixel {

/// A port of an emulated bus in the same thread, with simulated time: time passes only while the
/// host waits. So everything can be repeated exactly, and hours take seconds.
class EmulatedPort final : public Port {
 public:
  /// `bus` must outlive the port. Time begins at `now`.
  EmulatedPort(EmulatedBus& bus, int baud, Instant now) noexcept
      : bus_(bus), baud_(baud), now_(now) {}

  /// Unplugs the adapter, or plugs it in again. After that the host must open the line again.
  void set_plugged(bool is_plugged) noexcept {
    is_plugged_ = is_plugged;
    is_open_ = is_open_ && is_plugged;
  }

  [[nodiscard]] Instant now() const noexcept override { return now_; }
  [[nodiscard]] int baud() const noexcept override { return baud_; }
  [[nodiscard]] bool is_open() const noexcept override { return is_open_; }
  void reopen() override;
  [[nodiscard]] bool write(std::span<const std::uint8_t> bytes, Instant deadline) noexcept override;
  [[nodiscard]] std::size_t read(std::span<std::uint8_t> bytes, Instant deadline) noexcept override;
  void sleep_until(Instant instant) noexcept override;

 private:
  EmulatedBus& bus_;
  int baud_;
  Instant now_;
  bool is_plugged_{true};
  bool is_open_{true};
};

}  // namespace trifinger::dynamixel
