// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/online_planner.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <future>
#include <limits>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/latest.hpp"
#include "ipc/futex.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/ipc/fork.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::control {
namespace {

// Nobody sleeps longer than this without a look at what should end the sleep.
constexpr Nanoseconds kSlice = std::chrono::milliseconds(100);

// What the planner hands to the loop.
struct Published {
  KnotSpline before;  // Until `status.begin`; empty in the first plan.
  KnotSpline after;
  OnlinePlannerStatus status;
};

bool is_finite(const PlanningState& state) noexcept {
  const auto finite = [](double value) { return std::isfinite(value); };
  return std::ranges::all_of(state.position, finite) &&
         std::ranges::all_of(state.velocity, finite) && finite(state.time.count());
}

}  // namespace

struct OnlinePlanner::State {
  State(PlanningModel its_model, const PlanningTask& task, const OnlinePlannerOptions& its_online)
      : model(std::move(its_model)),
        online(its_online),
        states(model.initial_state()),
        terms(task.terms),
        predicted(model.initial_state()) {}

  void run(PredictivePlanner& planner);
  void wait_until(Seconds time) noexcept;
  void plan(PredictivePlanner& planner, const PlanningState& state);
  void fail(std::exception_ptr exception);

  PlanningModel model;
  OnlinePlannerOptions online;

  Latest<PlanningState> states;
  Latest<std::vector<CostTerm>> terms;
  Latest<Published> plans;
  // States before this time are of no use for the planner [s].
  std::atomic<double> due{-std::numeric_limits<double>::infinity()};
  std::atomic<std::uint32_t> num_states{0};  // The planner sleeps on it.
  std::atomic<std::uint32_t> num_plans{0};   // Those who wait for a plan sleep on it.
  std::atomic<bool> shall_end{false};
  std::atomic<bool> has_failed{false};
  std::mutex failure_mutex;
  std::exception_ptr failure;

  ipc::ForkGuard fork;
  OnlinePlannerStatus reported;  // Used by the thread of the loop only.

  // Used by the planner's thread only.
  PlanningState predicted;
  KnotSpline current;  // What the loop follows.
  OnlinePlannerStatus made;
  Seconds typical_duration{0};

  std::jthread thread;  // the last member: it uses all others
};

void OnlinePlanner::State::run(PredictivePlanner& planner) {
  std::uint32_t seen = 0;
  // relaxed: the flag carries nothing but itself.
  while (!shall_end.load(std::memory_order_relaxed)) {
    // acquire: the state was handed over before it was counted.
    const std::uint32_t count = num_states.load(std::memory_order_acquire);
    if (count == seen) {
      ipc::futex_wait(num_states, seen, kSlice);
      continue;
    }
    seen = count;
    states.update();
    const PlanningState& state = states.seen();
    // Written so that a time that is not a number is refused, and not waited for.
    if (state.time.count() < due.load(std::memory_order_relaxed)) continue;
    if (terms.update()) planner.set_terms(terms.seen());
    plan(planner, state);
  }
}

void OnlinePlanner::State::wait_until(Seconds time) noexcept {
  // relaxed: whoever reads an older one wakes the planner for nothing.
  due.store(time.count(), std::memory_order_relaxed);
}

void OnlinePlanner::State::plan(PredictivePlanner& planner, const PlanningState& state) {
  const Seconds begun = state.time;
  // A time that is not finite says nothing about the next state.
  if (std::isfinite(begun.count())) wait_until(begun + online.period);
  if (!is_finite(state)) {
    ++made.num_refused_states;
    return;
  }
  Seconds lead{0};
  predicted.position = state.position;
  predicted.velocity = state.velocity;
  predicted.time = state.time;
  if (made.num_plans > 0) {
    lead = online.lead.value_or(typical_duration);
    // A prediction that diverged says nothing.
    if (!std::isfinite(planner.simulate(state, current, lead, predicted)) ||
        !is_finite(predicted)) {
      predicted.position = state.position;
      predicted.velocity = state.velocity;
    }
    predicted.time = begun + lead;
  }
  const Plan& plan = planner.plan(predicted);
  // The loop has gone on meanwhile. Its newest state tells how long, and may be the next start.
  // relaxed: this thread itself looks at the number.
  if (states.update()) num_states.fetch_add(1, std::memory_order_relaxed);
  const Seconds duration = std::max(Seconds(0), states.seen().time - begun);
  // Grows at once and shrinks slowly, so that few plans are late.
  constexpr double kShrink = 0.1;
  typical_duration = std::max(duration, typical_duration + kShrink * (duration - typical_duration));

  ++made.num_plans;
  made.state_time = begun;
  made.begin = plan.commands.begin();
  made.duration = duration;
  made.lateness = std::max(Seconds(0), duration - lead);
  made.cost = plan.cost;
  made.median_cost = plan.median_cost;
  made.num_masked = plan.num_masked;
  // The loop gets two plans. Until this one begins, it follows the one before it, which must not
  // be replaced meanwhile.
  wait_until(std::max(begun + online.period, made.begin));
  Published& next = plans.own();
  next.before = current;
  next.after = plan.commands;
  next.status = made;
  plans.publish();
  current = plan.commands;
  // release: whoever sees the number sees the plan.
  num_plans.store(static_cast<std::uint32_t>(made.num_plans), std::memory_order_release);
  ipc::futex_wake_all(num_plans);
}

void OnlinePlanner::State::fail(std::exception_ptr exception) {
  const std::lock_guard lock(failure_mutex);
  failure = std::move(exception);
  // release: whoever sees the flag sees the exception.
  has_failed.store(true, std::memory_order_release);
  ipc::futex_wake_all(num_plans);
}

OnlinePlanner::OnlinePlanner(PlanningModel model, PlanningTask task, const PlannerOptions& options,
                             const OnlinePlannerOptions& online) {
  detail::require_not_negative("period", online.period.count());
  if (online.lead) detail::require_not_negative("lead", online.lead->count());
  PlanningModel own(*model.mujoco(), model.joints(), model.tip_sites(), model.objects());
  state_ = std::make_unique<State>(std::move(own), task, online);
  std::promise<void> started;
  std::future<void> ready = started.get_future();
  state_->thread =
      std::jthread([state = state_.get(), model = std::move(model), task = std::move(task), options,
                    started = std::move(started)]() mutable {
        // The planner makes threads, which inherit the priority of this one.
        leave_realtime();
        std::optional<PredictivePlanner> planner;
        try {
          planner.emplace(std::move(model), std::move(task), options);
        } catch (...) {
          started.set_exception(std::current_exception());
          return;
        }
        started.set_value();
        try {
          state->run(*planner);
        } catch (...) {
          state->fail(std::current_exception());
        }
      });
  ready.get();
}

OnlinePlanner::~OnlinePlanner() {
  if (state_->fork.is_inherited()) {
    // The thread stayed in the parent and uses what this copy has.
    [[maybe_unused]] const State* const left = state_.release();
    return;
  }
  // relaxed: the flag carries nothing but itself.
  state_->shall_end.store(true, std::memory_order_relaxed);
  state_->num_states.fetch_add(1, std::memory_order_relaxed);
  ipc::futex_wake_all(state_->num_states);
  state_->thread.join();
}

const PlanningModel& OnlinePlanner::model() const noexcept { return state_->model; }

bool OnlinePlanner::set_state(const PlanningState& state) noexcept {
  State& self = *state_;
  PlanningState& own = self.states.own();
  if (state.position.size() != own.position.size() ||
      state.velocity.size() != own.velocity.size()) {
    return false;
  }
  std::ranges::copy(state.position, own.position.begin());
  std::ranges::copy(state.velocity, own.velocity.begin());
  own.time = state.time;
  self.states.publish();
  // relaxed: it carries nothing but itself. Written so that NaN is handed over and counted.
  if (state.time.count() < self.due.load(std::memory_order_relaxed)) return true;
  // release: the planner sees the state that is counted.
  self.num_states.fetch_add(1, std::memory_order_release);
  ipc::futex_wake_all(self.num_states);
  return true;
}

bool OnlinePlanner::at(Seconds time, std::span<double> command, std::span<double> rate) noexcept {
  state_->plans.update();
  const Published& newest = state_->plans.seen();
  if (newest.status.num_plans == 0) return false;
  const bool is_old = time < newest.status.begin && newest.before.num_knots() > 0;
  (is_old ? newest.before : newest.after).at(time, command, rate);
  return true;
}

const OnlinePlannerStatus& OnlinePlanner::status() noexcept {
  State& self = *state_;
  self.plans.update();
  self.reported = self.plans.seen().status;
  // relaxed: the flag carries nothing but itself here.
  self.reported.has_failed = self.has_failed.load(std::memory_order_relaxed);
  return self.reported;
}

bool OnlinePlanner::set_terms(std::span<const CostTerm> terms) noexcept {
  std::vector<CostTerm>& own = state_->terms.own();
  if (terms.size() != own.size()) return false;
  for (const CostTerm& term : terms) {
    if (!is_valid(term, state_->model)) return false;
  }
  std::ranges::copy(terms, own.begin());
  state_->terms.publish();
  return true;
}

void OnlinePlanner::wait_for_plan(std::uint64_t count, Timeout timeout) {
  State& self = *state_;
  if (self.fork.is_inherited()) {
    throw InheritedHandle(
        "this planner was made before fork(); make a new one in the child process");
  }
  const Deadline deadline(timeout);
  while (true) {
    // acquire: see `fail`.
    if (self.has_failed.load(std::memory_order_acquire)) {
      const std::lock_guard lock(self.failure_mutex);
      if (self.failure) std::rethrow_exception(std::exchange(self.failure, nullptr));
      throw Error("the planner has ended, because its cost function failed");
    }
    // acquire: see `plan`.
    const std::uint32_t made = self.num_plans.load(std::memory_order_acquire);
    if (made >= count) return;
    if (deadline.passed())
      throw TimedOut("only " + std::to_string(made) + " plans were made, " + std::to_string(count) +
                     " were awaited");
    ipc::futex_wait(self.num_plans, made, deadline.remaining(kSlice));
  }
}

}  // namespace trifinger::control
