// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "dynamixel/bus.hpp"
#include "dynamixel/motor_group.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::dynamixel {

/// What was last seen of a group of motors. Plain data.
struct MotorSnapshot {
  enum class Phase : std::uint8_t {
    kReleased,  ///< Motors have no torque.
    kStarting,  ///< Motors are set up.
    kRunning,   ///< Motors are read and follow goals.
    kFailed,    ///< The motors have no torque, or stop by their watchdog; `failure` says why.
  };

  Phase phase{Phase::kReleased};
  std::uint64_t request{0};  ///< Number of the newest request that this answers.
  std::size_t count{0};      ///< Number of motors, sensors included.
  std::array<MotorReading, kMaxMotors> readings{};
  BusCounts counts{};
  std::uint64_t cycles{0};
  GroupFault fault{};
  FixedText failure{};  ///< A sentence with the remedy.
};

/// Motors as a loop at 1 kHz sees them: those of a thread (`MotorLoop`), or emulated ones in
/// simulated time (`SteppedMotors`).
///
/// One thread calls all functions but `cut`. None of them waits, allocates or throws.
class MotorLink {
 public:
  MotorLink() = default;
  MotorLink(const MotorLink&) = delete;
  MotorLink& operator=(const MotorLink&) = delete;
  virtual ~MotorLink() = default;

  /// Copies the newest snapshot. True if it is another one than at the last call.
  virtual bool read(MotorSnapshot& snapshot) noexcept TRIFINGER_REALTIME = 0;
  /// The goals of all motors from the next cycle on, in the units of the group's mode. Missing ones
  /// are not numbers: see `MotorGroup::cycle`.
  virtual void set_goals(std::span<const double> goals) noexcept TRIFINGER_REALTIME = 0;
  /// Sets up the motors, also after a failure. Returns the number of the request: the phase of a
  /// snapshot with this number or a later one says what became of it.
  virtual std::uint64_t request_start() noexcept TRIFINGER_REALTIME = 0;
  /// Switches torque off.
  virtual std::uint64_t request_release() noexcept TRIFINGER_REALTIME = 0;
  /// Switches torque off because the loop hangs. Any thread may call it. The phase is then
  /// `kFailed` until the next start.
  virtual void cut() noexcept = 0;
  /// The clock of `MotorReading::measured`.
  [[nodiscard]] virtual Instant now() const noexcept TRIFINGER_REALTIME = 0;
};

}  // namespace trifinger::dynamixel
