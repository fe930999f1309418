// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "manipulation/parts/object_observer.hpp"
#include "trifinger/control/predictive_planner.hpp"
#include "trifinger/manipulation/skill.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::manipulation {

// Where an object shall be.
struct Goal {
  Pose pose{};
  // Only the direction of this axis of the object counts, not the turn about it; for a cube that
  // shall lie on a certain side.
  std::optional<Eigen::Vector3d> axis{};
  double free_radius{0.0};  // Distance from the goal's place that costs nothing [m].
};

// How far an object is from a goal, beyond what is free.
struct Deviation {
  double position{0.0};     // [m]
  double orientation{0.0};  // [rad]
};
[[nodiscard]] Deviation deviation_of(const Goal& goal, const Pose& pose) noexcept;

// Weights of a cost.
struct PushWeights {
  double position;     // Per metre from the goal.
  double orientation;  // Per radian from the goal.
  double tips;         // Per metre that a tip is away from the object.
};

// Settings of a `Pusher`.
struct PushConfig {
  control::PlannerOptions planner;
  control::PlanningModelOptions model;
  Seconds plan_period;  // A plan begins so long after the one before it.
  Seconds plan_delay;   // A plan is followed so long after its begin, unless it took longer.
  double pose_gain;     // Share of a pose's deviation that corrects the estimate.
  PushWeights placing;
  PushWeights turning;
  PushWeights moving;
  Seconds weights_time;     // Time after which `placing` and `turning` change places.
  double far;               // Distance at which the object is moved rather than turned [m].
  double near;              // Distance at which it is turned again [m].
  double tip_distance;      // Of a tip's centre from the object's that costs nothing [m].
  double target_cost;       // Of targets away from the joints, squared [1/rad^2].
  double speed_cost;        // Of the object's speed, squared [s^2/m^2].
  double spin_cost;         // Of its angular speed, squared [s^2/rad^2].
  double retreat_distance;  // Distance of tips that have left the object [m].
};

// Pushes an object on a table to where it shall be, with sampling-based predictive control: no
// grasp, no primitive. Plans are made beside the loop.
//
// Call `update` once per step. When `wants_plan` is true, call `plan`, in any thread, and then
// `begin` between two steps.
class Pusher {
 public:
  enum class Mode : std::uint8_t {
    kIdle,     // The joints stay where they were.
    kPush,     // The object is pushed to its goal.
    kRetreat,  // The tips leave the object where it is.
  };

  // Throws InvalidArgument.
  Pusher(const SkillContext& context, const std::string& object, const PushConfig& config);
  Pusher(const Pusher&) = delete;  // The planner's cost refers to it.
  Pusher& operator=(const Pusher&) = delete;
  ~Pusher() = default;

  void hold() noexcept;
  void push(const Goal& goal) noexcept;
  void retreat() noexcept;
  // The next plan has no predecessor.
  void forget() noexcept { forgets_ = true; }

  void see(Seconds captured, const Pose& pose) noexcept;
  const TriFinger::Action& update(Seconds now, const control::JointState& joints) noexcept;

  [[nodiscard]] bool wants_plan() const noexcept { return wants_plan_; }
  void plan();
  void begin() noexcept;

  [[nodiscard]] Mode mode() const noexcept { return mode_; }
  // The estimated motion of the object at the newest plan's begin.
  [[nodiscard]] const Motion& object() const noexcept { return object_; }
  // Least distance of a tip's centre from the object's [m].
  [[nodiscard]] double nearest_tip() const noexcept { return nearest_tip_; }
  [[nodiscard]] double torque_share() const noexcept { return torque_share_; }
  [[nodiscard]] std::uint64_t num_plans() const noexcept { return num_plans_; }

 private:
  static constexpr std::size_t kHistory = 512;
  static constexpr std::size_t kPoses = 64;

  // What a plan needs to know. It does not change while a plan is made.
  struct Request {
    Mode mode{Mode::kIdle};
    Goal goal{};
    Pose left{};
    PushWeights weights{};
    Seconds now{0};
    Seconds begin{0};
    bool forgets{false};
    bool has_targets{false};
    std::array<JointSample, kHistory> history{};
    std::size_t num_samples{0};
    std::array<std::pair<Seconds, Pose>, kPoses> poses{};
    std::size_t num_poses{0};
  };

  void begin_mode(Mode mode) noexcept;
  void request(Seconds now) noexcept;
  void choose_weights(Seconds now) noexcept;
  [[nodiscard]] double cost(const control::CostInput& input) const noexcept;

  PushConfig config_;
  Servo servo_;
  std::size_t index_;  // Of the object in the model.
  control::SafetyLimits limits_;
  control::PredictivePlanner planner_;
  ObjectObserver observer_;
  Kinematics kinematics_;

  Mode mode_{Mode::kIdle};
  Goal goal_{};
  Pose left_{};  // Where the tips leave the object.
  PushWeights weights_{};
  bool is_moving_{false};
  Seconds weights_begin_{0};
  bool forgets_{true};

  std::array<JointSample, kHistory> history_{};  // A ring; the newest are before `samples_`.
  std::size_t samples_{0};
  std::array<std::pair<Seconds, Pose>, kPoses> poses_{};
  std::size_t num_poses_{0};

  Request request_{};
  bool wants_plan_{false};
  bool is_planning_{false};
  Seconds last_request_{-1e3};
  // Made by `plan`.
  control::KnotSpline planned_;
  Motion planned_object_{};

  control::KnotSpline next_;
  bool has_next_{false};
  control::KnotSpline targets_;
  bool has_targets_{false};
  control::JointState held_{};
  bool has_held_{false};

  Motion object_{};
  double nearest_tip_{0.0};
  double torque_share_{0.0};
  std::uint64_t num_plans_{0};
  TriFinger::Action action_{};
};

}  // namespace trifinger::manipulation
