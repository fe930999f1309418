// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "dynamixel/motor_group.hpp"
#include "dynamixel/motor_link.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::dynamixel {

struct SteppedMotorsOptions {
  Nanoseconds step{std::chrono::milliseconds(1)};  ///< Time that passes in each `read`.
  /// As in `MotorLoopOptions`.
  Nanoseconds period{0};
  Nanoseconds goal_timeout{std::chrono::milliseconds(50)};
};

/// Motors without a thread, on a line with simulated time (`EmulatedPort`): each `read` lets one
/// step pass, with as many cycles of the bus as fit into it. So everything can be repeated exactly.
///
/// Starting takes no steps. Unlike a `MotorLoop`, it allocates while it starts.
class SteppedMotors final : public MotorLink {
 public:
  /// @throws InvalidArgument
  explicit SteppedMotors(std::unique_ptr<MotorGroup> group,
                         const SteppedMotorsOptions& options = {});
  ~SteppedMotors() override;

  bool read(MotorSnapshot& snapshot) noexcept override;
  void set_goals(std::span<const double> goals) noexcept override;
  std::uint64_t request_start() noexcept override;
  std::uint64_t request_release() noexcept override;
  void cut() noexcept override;
  [[nodiscard]] Instant now() const noexcept override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::dynamixel
