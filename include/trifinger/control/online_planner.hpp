// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "trifinger/base/time.hpp"
#include "trifinger/control/predictive_planner.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::control {

/// Settings of an `OnlinePlanner`. All times are on the clock of the states.
struct OnlinePlannerOptions {
  /// Least time from the state of one plan to that of the next one. It is longer if `lead` is: the
  /// next plan is made from a state after the newest one has begun.
  Seconds period{0.04};
  /// Time from the state of a plan to the instant from which it is used. Default: as long as plans
  /// took until now.
  std::optional<Seconds> lead{};
};

/// How plans were made. Plain data.
struct OnlinePlannerStatus {
  std::uint64_t num_plans{0};
  std::uint64_t num_refused_states{0};  ///< States with numbers that are not finite.
  Seconds state_time{0};                ///< Time of the state from which the newest plan was made.
  Seconds begin{0};                     ///< Instant from which the newest plan is used.
  Seconds duration{0};                  ///< What the newest plan took, from its state on.
  Seconds lateness{0};                  ///< How long after its `begin` it was ready; 0 if in time.
  double cost{0.0};                     ///< `Plan::cost` of the newest plan.
  double median_cost{0.0};              ///< `Plan::median_cost` of the newest plan.
  int num_masked{0};                    ///< `Plan::num_masked` of the newest plan.
  /// A cost function has thrown, so no other plan will come.
  bool has_failed{false};
};

/// Plans in threads of its own, beside a loop at 1 kHz.
///
/// The loop hands over its newest state, and reads the newest plan at any time. A plan takes tens
/// of milliseconds. So the state is first simulated forward along the plan that the loop follows,
/// to the instant at which the new plan will be ready, and the new plan begins there. Until that
/// instant the loop still follows the old plan.
///
/// The planner's threads are ordinary ones, also if the thread that makes it has real-time
/// priority. Results depend on how fast this machine plans; only with `lead` and `wait_for_plan`
/// after each state they do not.
class OnlinePlanner {
 public:
  /// Starts the threads. Returns when they are ready.
  /// @throws InvalidArgument that names the first value that makes no sense.
  OnlinePlanner(PlanningModel model, PlanningTask task, const PlannerOptions& options = {},
                const OnlinePlannerOptions& online = {});
  /// Waits for the end of the plan under way.
  ~OnlinePlanner();

  /// The model, for making states.
  [[nodiscard]] const PlanningModel& model() const noexcept;

  /// @name For the one thread of the loop
  /// None of these waits or allocates.
  /// @{

  /// Hands over a state, whose time must not be before that of the last one. Ignores a state that
  /// does not fit the model, and then returns false.
  bool set_state(const PlanningState& state) noexcept TRIFINGER_REALTIME;
  /// Computes the commands at `time`, and their rates unless `rate` is empty. Both spans have one
  /// number per joint. False before the first plan; then nothing is written.
  [[nodiscard]] bool at(Seconds time, std::span<double> command,
                        std::span<double> rate = {}) noexcept TRIFINGER_REALTIME;
  /// The status as it is now.
  [[nodiscard]] const OnlinePlannerStatus& status() noexcept TRIFINGER_REALTIME;
  /// Changes the terms of the task from the next plan on. Ignores them and returns false if their
  /// number is not that of the task, or if one of them does not fit the model or has a number that
  /// is not finite.
  bool set_terms(std::span<const CostTerm> terms) noexcept TRIFINGER_REALTIME;
  /// @}

  /// Waits until `count` plans were made since the beginning. Any thread may call it.
  /// @throws TimedOut; and once, the exception of a cost function, which has ended the planning
  void wait_for_plan(std::uint64_t count, Timeout timeout = kForever);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::control
