// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "trifinger/control/motion.hpp"
#include "trifinger/control/planning_model.hpp"

struct mjData_;

/// \file
/// What a plan shall achieve: a cost as a function of state and torques. It is the integral of a
/// running cost over the horizon, plus a cost of the end.

namespace trifinger::control {

/// A quantity that a cost counts.
enum class CostKind : std::uint8_t {
  kObjectPosition,     ///< Distance of the object's centre from `goal.position` [m].
  kObjectOrientation,  ///< Angle between the object's orientation and `goal.orientation` [rad].
  kObjectVelocity,     ///< Speed of the object's centre [m/s].
  kObjectRotation,     ///< Angular speed of the object [rad/s].
  kTipObject,       ///< Sum over tips of the distance to the object's centre beyond `distance` [m].
  kTipPosition,     ///< Distance of the tip of finger `index` from `goal.position` [m].
  kJointPosition,   ///< Distance of the joints from `joints`, as a vector [rad].
  kJointVelocity,   ///< Length of the vector of joint velocities [rad/s].
  kEffort,          ///< Length of the vector of torques that the plan asks for [Nm].
  kTargetDistance,  ///< Distance of the joints from the plan's targets [rad]; 0 for torques.
};

/// How a quantity becomes a cost.
enum class CostShape : std::uint8_t {
  kLinear,  ///< The quantity itself: the last centimetre counts like the first.
  kSquare,  ///< The square of the quantity.
  /// `sqrt(q^2 + smoothing^2) - smoothing`: like a square below `smoothing`, linear far beyond it.
  kSmooth,
};

/// One ready-made part of a cost: plain data.
struct CostTerm {
  CostKind kind{CostKind::kObjectPosition};
  double weight{1.0};      ///< Weight in the running cost [1/s].
  double end_weight{0.0};  ///< Weight in the cost of the end.
  CostShape shape{CostShape::kLinear};
  int index{0};  ///< The object in the model's list, or the finger.
  Pose goal{};
  double distance{0.0};                     ///< Distance of kTipObject [m].
  double smoothing{0.0};                    ///< Scale of kSmooth, in the unit of the quantity.
  std::array<double, kMaxJoints> joints{};  ///< Joint positions of kJointPosition [rad].
};

/// What a cost may depend on.
struct CostInput {
  const PlanningModel& model;
  /// MuJoCo's data of this state: `qpos`, `qvel`, `ctrl` and all positions are those of this
  /// instant. Contacts and accelerations are so only while `is_end` is false.
  const mjData_& data;
  std::span<const double> target;  ///< Joint targets or torques of the plan at this instant.
  bool has_position_targets;       ///< False if the plan is of torques.
  Seconds time;                    ///< Time of this state, on the clock of the start.
  bool is_end;                     ///< True once per rollout, after the last step.
};

/// The running cost [1/s], and the cost of the end where `is_end` is true. Several threads call it
/// at once. It must not throw; a result that is not finite masks the rollout.
using CostFunction = std::function<double(const CostInput&)>;

/// All rollouts of a round, for costs that judge them together. Each state comes after the one
/// before it, each rollout after the one before it.
struct RolloutBatch {
  int num_rollouts;
  int num_states;  ///< Per rollout: one more than its steps.
  int position_size;
  int velocity_size;
  int num_joints;
  int num_tips;
  Seconds begin;                       ///< Time of the first state.
  Seconds time_step;                   ///< Time from one state to the next one.
  std::span<const double> positions;   ///< MuJoCo's `qpos`.
  std::span<const double> velocities;  ///< MuJoCo's `qvel`.
  std::span<const double> targets;     ///< Joint targets or torques, after the last step repeated.
  std::span<const double> torques;     ///< [Nm]; after the last step 0.
  std::span<const double> tips;        ///< Positions of the tips x y z [m].
};

/// Adds to each cost what the rollout costs. The planning thread calls it, and may get exceptions.
/// In states after a rollout became infinite all numbers are not finite; that rollout is masked
/// whatever its cost.
using BatchCostFunction = std::function<void(const RolloutBatch& batch, std::span<double> costs)>;

/// A cost is the sum of all parts that are given.
struct PlanningTask {
  std::vector<CostTerm> terms{};
  CostFunction cost{};
  /// Needs memory for all states, and runs on one thread only.
  BatchCostFunction batch_cost{};
  /// The running cost of `terms` and `cost` counts `late_factor` times in the last `late_share` of
  /// the horizon.
  double late_share{0.2};
  double late_factor{1.0};
};

/// The quantity of a term, shaped but without weight.
[[nodiscard]] double value_of(const CostTerm& term, const CostInput& input) noexcept;

/// Whether the numbers of a term are finite, and the model has the object or the finger that it
/// names.
[[nodiscard]] bool is_valid(const CostTerm& term, const PlanningModel& model) noexcept;

/// @throws InvalidArgument if a term names an object or a finger that the model lacks, or has a
/// number that is not finite.
void validate(const PlanningTask& task, const PlanningModel& model);

}  // namespace trifinger::control
