// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "trifinger/control/knot_spline.hpp"
#include "trifinger/control/planning_model.hpp"
#include "trifinger/control/planning_task.hpp"

namespace trifinger::control {

/// How the next plan follows from the rollouts of a round. docs/planning.md has the equations.
enum class PlanningMethod : std::uint8_t {
  /// The best rollout. T. Howell et al.: Predictive Sampling: Real-time Behaviour Synthesis with
  /// MuJoCo. 2022.
  kPredictiveSampling,
  /// The mean of the best rollouts, around which the next round samples with their deviation.
  /// R. Y. Rubinstein: Optimization of computer simulation models with rare events. 1997;
  /// M. Kobilarov: Cross-entropy motion planning. 2012.
  kCrossEntropy,
  /// The mean of all rollouts, weighted with the exponentials of their costs. G. Williams et al.:
  /// Information theoretic MPC for model-based reinforcement learning. 2017.
  kPathIntegral,
};

/// What the numbers of a plan are.
enum class PlannedCommand : std::uint8_t {
  kPosition,  ///< Joint targets [rad], which the joints follow like springs with dampers.
  kTorque,    ///< Torques [Nm].
};

/// Settings of a planner. The defaults turn and flip cubes; docs/planning.md says what each does.
struct PlannerOptions {
  PlanningMethod method{PlanningMethod::kPathIntegral};
  int samples{64};       ///< Rollouts per round. The first one is the plan before the round.
  int rounds{1};         ///< Rounds per plan.
  Seconds horizon{0.5};  ///< Rounded to whole steps of the model, at least one.
  int knots{4};
  SplineKind spline{SplineKind::kLinear};
  PlannedCommand command{PlannedCommand::kPosition};
  double kp{10.0};   ///< Stiffness with which joints follow their targets [Nm/rad].
  double kd{0.015};  ///< Damping with which they follow [Nms/rad].
  /// Each rollout changes the knots by normal numbers with a standard deviation between these two,
  /// in the unit of the command. Its logarithm is spread evenly. Cross-entropy begins each plan
  /// with the larger one and does not go below the smaller one.
  double least_sigma{0.035};
  double most_sigma{0.35};
  double one_finger_share{0.4};  ///< Share of rollouts that change one finger only.
  double constant_share{0.3};    ///< Share of rollouts that change all knots equally.
  /// The costs' scale of kPathIntegral, as a share of the median's distance from the least cost.
  double temperature{0.1};
  int elites{8};          ///< Number of best rollouts of kCrossEntropy.
  int num_threads{0};     ///< The calling thread included; 0: one per processor that
                          ///< the process may use.
  std::uint64_t seed{0};  ///< Seed of all random numbers.
};

/// @throws InvalidArgument that names the first value that makes no sense.
void validate(const PlannerOptions& options);

/// The states of one rollout, from its start on: one more than its steps.
struct PlannedStates {
  Seconds begin{0};
  Seconds time_step{0};
  std::size_t count{0};
  std::vector<double> positions;   ///< `qpos`, one state after the other.
  std::vector<double> velocities;  ///< `qvel`, one state after the other.
};

/// A plan, and how good it is. All is from the planning model.
struct Plan {
  KnotSpline commands;        ///< Its `begin` is the time of the start.
  double cost{0.0};           ///< Cost of a rollout of this plan; infinite if it diverged.
  double previous_cost{0.0};  ///< Cost of the plan with which this one began.
  double least_cost{0.0};     ///< Cost of the best rollout of the last round.
  double median_cost{0.0};    ///< Median cost of the last round, without masked rollouts.
  int num_masked{0};          ///< Rollouts of the last round that diverged.
  std::uint64_t number{0};    ///< Counts plans from 1.
  PlannedStates states;       ///< What this plan leads to.
};

/// Finds joint targets or torques that make a cost small, by trying many in simulations.
///
/// `plan` begins with the previous plan, moved to the new start. In each round it changes this plan
/// at random, simulates every change over the horizon, and takes the best or a mean. Only the start
/// and the task count, so it plans through contacts that nobody described.
///
/// Results depend on options, seed, task and the starts so far, and not on the number of threads.
/// `plan` does not allocate after the first call, unless a cost function does. One planner must not
/// be used by several threads at once; its own threads run while `plan` does.
class PredictivePlanner {
 public:
  /// @throws InvalidArgument that names the first value that makes no sense.
  PredictivePlanner(PlanningModel model, PlanningTask task, const PlannerOptions& options = {});
  ~PredictivePlanner();
  PredictivePlanner(PredictivePlanner&&) noexcept;
  PredictivePlanner& operator=(PredictivePlanner&&) noexcept;

  /// Plans from `start`. The result is valid until the next call. If all rollouts diverge, the
  /// previous plan stays and its cost is infinite.
  /// @throws InvalidArgument if `start` does not fit the model or is not finite
  const Plan& plan(const PlanningState& start);
  /// The newest plan.
  [[nodiscard]] const Plan& newest() const noexcept;

  /// Forgets the previous plan: the next one begins with targets where the joints are at the start,
  /// or with zero torques.
  void restart() noexcept;
  /// Makes the next plan begin with these commands.
  /// @throws InvalidArgument if their width is not the number of joints
  void begin_with(const KnotSpline& commands);

  /// Simulates `commands` from `start` for `duration` in the planning model. Writes the last state,
  /// and returns its cost as a plan of that duration; infinite if it diverged.
  /// @throws InvalidArgument as `plan` does
  double simulate(const PlanningState& start, const KnotSpline& commands, Seconds duration,
                  PlanningState& end);

  /// Changes what the next plans shall achieve.
  /// @throws InvalidArgument as the constructor does
  void set_task(PlanningTask task);
  /// Changes the terms only. Allocates nothing if they are not more than before.
  void set_terms(std::span<const CostTerm> terms);

  [[nodiscard]] const PlanningModel& model() const noexcept;
  [[nodiscard]] const PlanningTask& task() const noexcept;
  [[nodiscard]] const PlannerOptions& options() const noexcept;
  [[nodiscard]] int num_threads() const noexcept;
  [[nodiscard]] int num_steps() const noexcept;  ///< Steps of a rollout.

  /// Costs of the rollouts of the last round; infinite for those that diverged.
  [[nodiscard]] std::span<const double> costs() const noexcept;
  /// Weights of these rollouts in the plan; their sum is 1.
  [[nodiscard]] std::span<const double> weights() const noexcept;
  /// The knots of one of these rollouts, as in `KnotSpline::values`.
  [[nodiscard]] std::span<const double> knots_of(int rollout) const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// @name Weights of rollouts
/// Each function writes one weight per cost. Their sum is 1; or 0 if no cost is finite. Costs that
/// are not finite get no weight.
/// @{

/// `exp(-(cost - least) / scale)`, divided by the sum, where `scale` is `temperature` times the
/// median's distance from the least cost. Adding a number to all costs, or multiplying them all,
/// changes nothing.
void path_integral_weights(std::span<const double> costs, double temperature,
                           std::span<double> weights) noexcept;
/// Equal weights for the `count` least costs; of equal costs the first ones.
void elite_weights(std::span<const double> costs, int count, std::span<double> weights) noexcept;
/// @}

}  // namespace trifinger::control
