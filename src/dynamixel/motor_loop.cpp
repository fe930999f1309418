// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/dynamixel/motor_loop.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <future>
#include <semaphore>
#include <thread>
#include <utility>

#include "latest.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::dynamixel {
namespace {

using Phase = MotorSnapshot::Phase;

// How long the thread sleeps while it has nothing to do.
constexpr Nanoseconds kIdle = std::chrono::milliseconds(1);

struct Goals {
  std::array<double, kMaxMotors> values{};
};

// A request in one word: its number, and in the lowest bit whether it is a start.
constexpr std::uint64_t request_of(std::uint64_t number, bool is_start) noexcept {
  return 2 * number + (is_start ? 1 : 0);
}

}  // namespace

struct MotorLoop::State {
  void run();
  void obey(std::uint64_t request);
  void cycle() noexcept;
  void fail(const FixedText& why) noexcept;
  void publish() noexcept;

  std::unique_ptr<MotorGroup> group;  // used by the thread only
  MotorLoopOptions options;
  std::vector<std::string> lacks;
  detail::Latest<MotorSnapshot> snapshots;
  detail::Latest<Goals> goals;
  std::atomic<std::uint64_t> request{0};
  std::atomic<bool> shall_end{false};
  std::uint64_t requests{0};  // used by the loop only

  // Used by the thread only.
  MotorSnapshot snapshot{};
  Goals newest{};
  Instant goals_came{};
  Instant next_cycle{};
  bool has_goals{false};

  std::jthread thread;  // the last member: it uses all others
};

void MotorLoop::State::publish() noexcept {
  snapshot.count = group->size();
  std::ranges::copy(group->readings(), snapshot.readings.begin());
  for (std::size_t i = 0; i < group->size(); ++i) {
    const MotorModel& model = group->model(i);
    snapshot.current_limits[i] = model.current_limit * model.current_unit;
  }
  snapshot.counts = group->counts();
  snapshot.cycles = group->cycles();
  snapshot.trouble = group->trouble();
  snapshots.write(snapshot);
}

void MotorLoop::State::fail(const FixedText& why) noexcept {
  group->release();
  snapshot.phase = Phase::kFailed;
  snapshot.failure = why;
}

void MotorLoop::State::obey(std::uint64_t word) {
  snapshot.request = word / 2;
  snapshot.failure = FixedText();
  if (word % 2 == 0) {
    group->release();
    snapshot.phase = Phase::kReleased;
    publish();
    return;
  }
  snapshot.phase = Phase::kStarting;
  publish();
  try {
    group->start();
    has_goals = false;
    // Goals of an earlier run must not act in this one.
    static_cast<void>(goals.read(newest));
    next_cycle = group->bus().port().now();
    snapshot.phase = Phase::kRunning;
  } catch (const std::exception& error) {
    fail(FixedText(error.what()));
  }
  publish();
}

void MotorLoop::State::cycle() noexcept {
  const Instant now = group->bus().port().now();
  if (goals.read(newest)) {
    goals_came = now;
    has_goals = true;
  }
  static const Goals kNone = [] {
    Goals none;
    none.values.fill(std::nan(""));
    return none;
  }();
  const bool is_fresh = has_goals && now - goals_came <= options.goal_timeout;
  group->cycle(std::span((is_fresh ? newest : kNone).values).first(group->size()));
  if (group->trouble().kind != Trouble::kNone) fail(describe(group->trouble()));
  publish();
}

void MotorLoop::State::run() {
  std::uint64_t obeyed = 0;
  // relaxed: the flag carries nothing but itself.
  while (!shall_end.load(std::memory_order_relaxed)) {
    // relaxed: a request carries nothing but itself.
    if (const std::uint64_t word = request.load(std::memory_order_relaxed); word != obeyed) {
      obeyed = word;
      obey(word);
    }
    if (snapshot.phase != Phase::kRunning) {
      std::this_thread::sleep_for(kIdle);
      continue;
    }
    Port& port = group->bus().port();
    if (options.period > Nanoseconds::zero()) {
      port.sleep_until(next_cycle);
      // A late cycle leaves periods out.
      next_cycle = std::max(next_cycle + options.period, port.now());
    }
    cycle();
  }
  group->release();
  group->bus().wait_until_sent();
}

MotorLoop::MotorLoop(std::unique_ptr<MotorGroup> group, const MotorLoopOptions& options)
    : state_(std::make_unique<State>()) {
  using trifinger::detail::require;
  require(group != nullptr, "a loop of motors needs a group, but got none");
  require(
      options.period >= Nanoseconds::zero(),
      "period of a loop of motors is " + duration_text(options.period) + ", must be at least 0");
  require(options.goal_timeout > Nanoseconds::zero(), "goal_timeout of a loop of motors is " +
                                                          duration_text(options.goal_timeout) +
                                                          ", must be above 0");
  state_->group = std::move(group);
  state_->options = options;
  state_->publish();
  std::promise<std::vector<std::string>> entered;
  auto lacks = entered.get_future();
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
  state_->lacks = lacks.get();
}

MotorLoop::~MotorLoop() {
  // relaxed: the flag carries nothing but itself.
  state_->shall_end.store(true, std::memory_order_relaxed);
  state_->thread.join();
}

bool MotorLoop::read(MotorSnapshot& snapshot) noexcept { return state_->snapshots.read(snapshot); }

void MotorLoop::set_goals(std::span<const double> goals) noexcept {
  Goals all;
  all.values.fill(std::nan(""));
  std::copy_n(goals.begin(), std::min(goals.size(), all.values.size()), all.values.begin());
  state_->goals.write(all);
}

std::uint64_t MotorLoop::request_start() noexcept {
  ++state_->requests;
  // relaxed: a request carries nothing but itself.
  state_->request.store(request_of(state_->requests, true), std::memory_order_relaxed);
  return state_->requests;
}

std::uint64_t MotorLoop::request_release() noexcept {
  ++state_->requests;
  // relaxed: a request carries nothing but itself.
  state_->request.store(request_of(state_->requests, false), std::memory_order_relaxed);
  return state_->requests;
}

const std::vector<std::string>& MotorLoop::lacks() const noexcept { return state_->lacks; }

}  // namespace trifinger::dynamixel
