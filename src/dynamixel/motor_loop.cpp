// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/motor_loop.hpp"

#include <atomic>
#include <chrono>
#include <exception>
#include <future>
#include <thread>
#include <utility>

#include "base/latest.hpp"
#include "motor_runner.hpp"

namespace trifinger::dynamixel {
namespace {

// How long the thread sleeps while it has nothing to do.
constexpr Nanoseconds kIdle = std::chrono::milliseconds(1);

}  // namespace

struct MotorLoop::State {
  State(std::unique_ptr<MotorGroup> motors, const MotorLoopOptions& options)
      : runner(std::move(motors), options.period, options.goal_timeout,
               [this](const MotorSnapshot& snapshot) { snapshots.write(snapshot); }) {}
  void run();

  Latest<MotorSnapshot> snapshots;
  detail::MotorRunner runner;  // used by the thread only, and tells the snapshots
  std::vector<std::string> warnings;
  Latest<detail::Goals> goals;
  std::atomic<std::uint64_t> request{0};
  std::atomic<bool> is_cut{false};
  std::atomic<bool> shall_end{false};
  std::uint64_t requests{0};  // used by the loop only

  std::jthread thread;  // the last member: it uses all others
};

void MotorLoop::State::run() {
  std::uint64_t obeyed = 0;
  detail::Goals newest;
  // relaxed: the flags and the request carry nothing but themselves.
  while (!shall_end.load(std::memory_order_relaxed)) {
    if (const std::uint64_t word = request.load(std::memory_order_relaxed); word != obeyed) {
      obeyed = word;
      is_cut.store(false, std::memory_order_relaxed);
      runner.obey(word);
      // Goals of an earlier run must not act in this one.
      static_cast<void>(goals.read(newest));
    }
    if (is_cut.exchange(false, std::memory_order_relaxed)) {
      runner.fail(FixedText("the motors were switched off because the loop hung"));
    }
    if (!runner.is_running()) {
      std::this_thread::sleep_for(kIdle);
      continue;
    }
    runner.wait_for_cycle();
    runner.cycle(goals.read(newest) ? &newest : nullptr);
  }
  runner.group().release();
  runner.group().bus().wait_until_sent();
}

MotorLoop::MotorLoop(std::unique_ptr<MotorGroup> group, const MotorLoopOptions& options)
    : state_(std::make_unique<State>(std::move(group), options)) {
  std::promise<std::vector<std::string>> entered;
  auto warnings = entered.get_future();
  state_->thread = std::jthread(
      [state = state_.get(), realtime = options.realtime, entered = std::move(entered)]() mutable {
        try {
          entered.set_value(enter_realtime(realtime));
        } catch (...) {
          entered.set_exception(std::current_exception());
          return;
        }
        state->run();
      });
  state_->warnings = warnings.get();
}

MotorLoop::~MotorLoop() {
  // relaxed: the flag carries nothing but itself.
  state_->shall_end.store(true, std::memory_order_relaxed);
  state_->thread.join();
}

bool MotorLoop::read(MotorSnapshot& snapshot) noexcept { return state_->snapshots.read(snapshot); }

void MotorLoop::set_goals(std::span<const double> goals) noexcept {
  state_->goals.write(detail::goals_of(goals));
}

std::uint64_t MotorLoop::request_start() noexcept {
  ++state_->requests;
  // relaxed: a request carries nothing but itself.
  state_->request.store(detail::request_of(state_->requests, true), std::memory_order_relaxed);
  return state_->requests;
}

std::uint64_t MotorLoop::request_release() noexcept {
  ++state_->requests;
  // relaxed: a request carries nothing but itself.
  state_->request.store(detail::request_of(state_->requests, false), std::memory_order_relaxed);
  return state_->requests;
}

// relaxed: the flag carries nothing but itself.
void MotorLoop::cut() noexcept { state_->is_cut.store(true, std::memory_order_relaxed); }

Instant MotorLoop::now() const noexcept { return std::chrono::steady_clock::now(); }

const std::vector<std::string>& MotorLoop::warnings() const noexcept { return state_->warnings; }

}  // namespace trifinger::dynamixel
