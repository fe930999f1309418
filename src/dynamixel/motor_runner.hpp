// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "dynamixel/motor_group.hpp"
#include "dynamixel/motor_link.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::dynamixel::detail {

struct Goals {
  std::array<double, kMaxMotors> values{};
};

// The goals of the first motors; the others get none.
[[nodiscard]] Goals goals_of(std::span<const double> goals) noexcept;

// A request in one word: its number, and in the lowest bit whether it is a start.
[[nodiscard]] constexpr std::uint64_t request_of(std::uint64_t number, bool is_start) noexcept {
  return 2 * number + (is_start ? 1 : 0);
}

// What a link does with its group, in one thread.
class MotorRunner {
 public:
  // `tell` sees every snapshot: the phase of each before anything that takes time.
  // Throws InvalidArgument.
  MotorRunner(
      std::unique_ptr<MotorGroup> group, Nanoseconds period, Nanoseconds goal_timeout,
      std::function<void(const MotorSnapshot&)> report = [](const MotorSnapshot&) {});

  // Carries out a request, see `request_of`.
  void obey(std::uint64_t word) noexcept;
  // One cycle of the bus, if the next one is due. `newest` are goals that have come since the last
  // cycle; nullptr if none have.
  void cycle(const Goals* newest) noexcept;
  // Waits for the next cycle, if there is a period.
  void wait_for_cycle() noexcept;
  void fail(const FixedText& why) noexcept;

  [[nodiscard]] const MotorSnapshot& snapshot() const noexcept { return snapshot_; }
  [[nodiscard]] bool is_running() const noexcept {
    return snapshot_.phase == MotorSnapshot::Phase::kRunning;
  }
  [[nodiscard]] MotorGroup& group() noexcept { return *group_; }
  [[nodiscard]] const MotorGroup& group() const noexcept { return *group_; }

 private:
  void release() noexcept;
  void start() noexcept;
  // Takes what is known of the motors, and tells it.
  void look() noexcept;

  std::unique_ptr<MotorGroup> group_;
  Nanoseconds period_;
  Nanoseconds goal_timeout_;
  std::function<void(const MotorSnapshot&)> report_;
  MotorSnapshot snapshot_{};
  Goals newest_{};
  Instant goals_came_{};
  Instant next_cycle_{};
  bool has_goals_{false};
};

}  // namespace trifinger::dynamixel::detail
