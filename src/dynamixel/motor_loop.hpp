// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "dynamixel/motor_group.hpp"
#include "dynamixel/motor_link.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::dynamixel {

struct MotorLoopOptions {
  /// Time between two cycles; 0: as fast as the bus allows.
  Nanoseconds period{0};
  /// When no new goals have come for so long, currents and velocities become 0; positions stay.
  Nanoseconds goal_timeout{std::chrono::milliseconds(50)};
  RealtimeOptions realtime{};  ///< What the thread requests from the machine.
};

/// A thread that reads and drives a group of motors at the rate of its bus, beside a loop at 1 kHz.
///
/// The functions of the link exchange the newest values with the thread.
class MotorLoop final : public MotorLink {
 public:
  /// Begins the thread. The motors stay as they are until `request_start`.
  /// @throws InvalidArgument, Error if the machine refuses a real-time setting that is required
  explicit MotorLoop(std::unique_ptr<MotorGroup> group, const MotorLoopOptions& options = {});
  /// Switches torque off and ends the thread. It waits for the cycle that is under way.
  ~MotorLoop() override;

  bool read(MotorSnapshot& snapshot) noexcept override;
  void set_goals(std::span<const double> goals) noexcept override;
  std::uint64_t request_start() noexcept override;
  std::uint64_t request_release() noexcept override;
  void cut() noexcept override;
  [[nodiscard]] Instant now() const noexcept override;

  /// What the machine refused to the thread, one sentence each.
  [[nodiscard]] const std::vector<std::string>& warnings() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::dynamixel
