// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/dynamixel/motor_group.hpp"
#include "trifinger/realtime/annotations.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::dynamixel {

struct MotorLoopOptions {
  /// Time between two cycles; 0: as fast as the bus allows.
  Nanoseconds period{0};
  /// When no new goals have come for so long, currents and velocities become 0; positions stay.
  Nanoseconds goal_timeout{std::chrono::milliseconds(50)};
  RealtimeOptions realtime{};  ///< What the thread requests from the machine.
};

/// What the thread of a `MotorLoop` has last seen. Plain data.
struct MotorSnapshot {
  enum class Phase : std::uint8_t {
    kReleased,  ///< Motors have no torque.
    kStarting,  ///< Motors are set up.
    kRunning,   ///< Motors are read and follow goals.
    kFailed,    ///< The motors have no torque, or stop by their watchdog; `failure` says why.
  };

  Phase phase{Phase::kReleased};
  std::uint64_t request{0};  ///< Number of the newest request that this answers.
  std::size_t count{0};      ///< Number of motors.
  std::array<MotorReading, kMaxMotors> readings{};
  std::array<double, kMaxMotors> current_limits{};  ///< Of each model [A].
  BusCounts counts{};
  std::uint64_t cycles{0};
  GroupTrouble trouble{};
  FixedText failure{};  ///< A sentence with the remedy.
};

/// A thread that reads and drives a group of motors at the rate of its bus, beside a loop at 1 kHz.
///
/// The loop calls `read`, `set_goals`, `request_start` and `request_release`, from one thread. None
/// of these waits, allocates or throws: they exchange the newest values with the thread.
class MotorLoop {
 public:
  /// Begins the thread. The motors stay as they are until `request_start`.
  /// @throws InvalidArgument, Error if the machine refuses a real-time setting that is required
  MotorLoop(std::unique_ptr<MotorGroup> group, const MotorLoopOptions& options = {});
  MotorLoop(const MotorLoop&) = delete;
  MotorLoop& operator=(const MotorLoop&) = delete;
  /// Switches torque off and ends the thread. It waits for the cycle that is under way.
  ~MotorLoop();

  /// Copies the newest snapshot. True if it is another one than at the last call.
  bool read(MotorSnapshot& snapshot) noexcept TRIFINGER_REALTIME;
  /// The goals of all motors from the next cycle on, in the units of the group's mode. Missing ones
  /// are not numbers: see `MotorGroup::cycle`.
  void set_goals(std::span<const double> goals) noexcept TRIFINGER_REALTIME;
  /// Sets up the motors, also after a failure. Returns the number of the request: the phase of a
  /// snapshot with this number or a later one says what became of it.
  std::uint64_t request_start() noexcept TRIFINGER_REALTIME;
  /// Switches torque off.
  std::uint64_t request_release() noexcept TRIFINGER_REALTIME;

  /// What the machine refused to the thread, one sentence each.
  [[nodiscard]] const std::vector<std::string>& lacks() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::dynamixel
