// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/stepped_motors.hpp"

#include <atomic>
#include <utility>

#include "motor_runner.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::dynamixel {

struct SteppedMotors::State {
  State(std::unique_ptr<MotorGroup> motors, const SteppedMotorsOptions& options)
      : runner(std::move(motors), options.period, options.goal_timeout),
        step(options.step),
        end(runner.group().bus().port().now()) {}

  std::uint64_t request(bool is_start) {
    ++requests;
    runner.obey(detail::request_of(requests, is_start));
    // What passed meanwhile is not made up for.
    end = runner.group().bus().port().now();
    is_new = true;
    return requests;
  }

  detail::MotorRunner runner;
  Nanoseconds step;
  Instant end;  // of the newest step
  detail::Goals goals{};
  bool has_goals{false};
  bool is_new{true};
  std::uint64_t requests{0};
  std::atomic<bool> is_cut{false};
};

SteppedMotors::SteppedMotors(std::unique_ptr<MotorGroup> group, const SteppedMotorsOptions& options)
    : state_(std::make_unique<State>(std::move(group), options)) {
  trifinger::detail::require(
      options.step > Nanoseconds::zero(),
      "step of stepped motors is " + duration_text(options.step) + ", must be above 0");
}

SteppedMotors::~SteppedMotors() = default;

bool SteppedMotors::read(MotorSnapshot& snapshot) noexcept {
  State& state = *state_;
  Port& port = state.runner.group().bus().port();
  state.end += state.step;
  // relaxed: the flag carries nothing but itself.
  if (state.is_cut.exchange(false, std::memory_order_relaxed)) {
    state.runner.fail(FixedText("the motors were switched off because the loop hung"));
    state.is_new = true;
  }
  while (state.runner.is_running() && port.now() < state.end) {
    state.runner.wait_for_cycle();
    state.runner.cycle(std::exchange(state.has_goals, false) ? &state.goals : nullptr);
    state.is_new = true;
  }
  port.sleep_until(state.end);
  snapshot = state.runner.snapshot();
  return std::exchange(state.is_new, false);
}

void SteppedMotors::set_goals(std::span<const double> goals) noexcept {
  state_->goals = detail::goals_of(goals);
  state_->has_goals = true;
}

std::uint64_t SteppedMotors::request_start() noexcept { return state_->request(true); }

std::uint64_t SteppedMotors::request_release() noexcept { return state_->request(false); }

// relaxed: the flag carries nothing but itself.
void SteppedMotors::cut() noexcept { state_->is_cut.store(true, std::memory_order_relaxed); }

Instant SteppedMotors::now() const noexcept { return state_->runner.group().bus().port().now(); }

}  // namespace trifinger::dynamixel
