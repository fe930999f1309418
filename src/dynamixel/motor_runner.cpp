// SPDX-License-Identifier: BSD-3-Clause
#include "motor_runner.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::dynamixel::detail {
namespace {

using trifinger::detail::require;
using Phase = MotorSnapshot::Phase;

}  // namespace

Goals goals_of(std::span<const double> goals) noexcept {
  Goals all;
  all.values.fill(std::nan(""));
  std::copy_n(goals.begin(), std::min(goals.size(), all.values.size()), all.values.begin());
  return all;
}

MotorRunner::MotorRunner(std::unique_ptr<MotorGroup> group, Nanoseconds period,
                         Nanoseconds goal_timeout, std::function<void(const MotorSnapshot&)> report)
    : group_(std::move(group)),
      period_(period),
      goal_timeout_(goal_timeout),
      report_(std::move(report)) {
  require(group_ != nullptr, "a loop of motors needs a group, but got none");
  require(period >= Nanoseconds::zero(),
          "period of a loop of motors is " + duration_text(period) + ", must be at least 0");
  require(
      goal_timeout > Nanoseconds::zero(),
      "goal_timeout of a loop of motors is " + duration_text(goal_timeout) + ", must be above 0");
  look();
}

void MotorRunner::look() noexcept {
  snapshot_.count = group_->size();
  std::ranges::copy(group_->readings(), snapshot_.readings.begin());
  snapshot_.counts = group_->counts();
  snapshot_.cycles = group_->cycles();
  snapshot_.fault = group_->fault();
  report_(snapshot_);
}

void MotorRunner::fail(const FixedText& why) noexcept {
  snapshot_.phase = Phase::kFailed;
  snapshot_.failure = why;
  // Motors may take their time to confirm it, and nobody may wait so long for the reason.
  look();
  group_->release();
  look();
}

void MotorRunner::release() noexcept {
  snapshot_.phase = Phase::kReleased;
  if (const auto motor = group_->release()) {
    snapshot_.phase = Phase::kFailed;
    snapshot_.failure = FixedText("motor ");
    snapshot_.failure.append(std::size_t{*motor})
        .append(" does not confirm that its torque is off; switch its supply off");
  }
  look();
}

void MotorRunner::obey(std::uint64_t word) noexcept {
  snapshot_.request = word / 2;
  snapshot_.failure = FixedText();
  word % 2 != 0 ? start() : release();
}

void MotorRunner::start() noexcept {
  snapshot_.phase = Phase::kStarting;
  look();
  try {
    group_->start();
    has_goals_ = false;
    next_cycle_ = group_->bus().port().now();
    snapshot_.phase = Phase::kRunning;
    look();
  } catch (const std::exception& error) {
    fail(FixedText(error.what()));
  }
}

void MotorRunner::wait_for_cycle() noexcept {
  if (period_ == Nanoseconds::zero()) return;
  Port& port = group_->bus().port();
  port.sleep_until(next_cycle_);
  // A late cycle leaves periods out.
  next_cycle_ = std::max(next_cycle_ + period_, port.now());
}

void MotorRunner::cycle(const Goals* newest) noexcept {
  const Instant now = group_->bus().port().now();
  if (newest != nullptr) {
    newest_ = *newest;
    goals_came_ = now;
    has_goals_ = true;
  }
  const bool is_fresh = has_goals_ && now - goals_came_ <= goal_timeout_;
  group_->cycle(is_fresh ? std::span<const double>(newest_.values) : std::span<const double>());
  if (group_->fault().kind != MotorFault::kNone) {
    fail(describe(group_->fault()));
    return;
  }
  look();
}

}  // namespace trifinger::dynamixel::detail
