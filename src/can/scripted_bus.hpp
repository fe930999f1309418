// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "can/bus.hpp"
#include "can/memory_bus.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/realtime/clock.hpp"

namespace trifinger::can {

/// A node on any bus, with faults as a script between the two: a bus in memory on which this node
/// has number 0 and all others have number 1.
///
/// If the bus is one between processes, the others learn that their interface is off, down or gone.
class ScriptedBus final : public Bus {
 public:
  /// `seed` decides about everything random.
  explicit ScriptedBus(std::unique_ptr<Bus> bus, std::uint64_t seed = 0);

  /// Frames are carried, and faults begin and end, at this time. It must not decrease.
  void set_time(Instant now) noexcept { clock_.time = now; }
  /// Adds a fault to the script. @throws InvalidArgument for a fault that makes no sense
  void add(const BusFault& fault) { wire_.add(fault); }

 private:
  struct SetClock final : Clock {
    [[nodiscard]] Instant now() const noexcept override { return time; }
    void sleep_until(Instant) noexcept override {}
    [[nodiscard]] Nanoseconds suspended_time() const noexcept override { return {}; }
    Instant time{};
  };

  std::size_t do_receive(std::span<Frame> budget) noexcept override;
  SendResult do_send(std::span<const Frame> frames) noexcept override;
  void pass_on() noexcept;

  std::unique_ptr<Bus> outer_;
  SetClock clock_;
  MemoryBus wire_;
  std::unique_ptr<Bus> inner_;   // node 0
  std::unique_ptr<Bus> bridge_;  // node 1
  std::array<Frame, 64> frames_{};
};

}  // namespace trifinger::can
