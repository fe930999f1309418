// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>
#include <utility>

#include "manipulation/parts/phased.hpp"
#include "manipulation/parts/pose_average.hpp"
#include "manipulation/parts/tip_servo.hpp"
#include "manipulation/parts/tip_trajectory.hpp"
#include "manipulation/parts/torque_action.hpp"
#include "trifinger/control/pose_estimator.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// A skill that moves the tips with forces, in phases. `S` is the skill itself; its table `kPhases`
// has a row for each `Phase`, in their order. It has these functions, too:
//
//     void sense_object(const control::JointState& joints, Seconds elapsed) noexcept;
//     void press(TipsCommand& command, Seconds elapsed) noexcept;
//     [[nodiscard]] Motion desired() const noexcept;
template <class S, class Phase>
class TipsSkill : public Phased<S, Phase> {
  friend S;
  using Phases = Phased<S, Phase>;

  explicit TipsSkill(const SkillContext& context)
      : Phases(context.period), servo_(context.description, context.limits) {
    enter(Phase::kLook);
  }

 public:
  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override {
    const Seconds elapsed = clock_.advance(step);
    servo_.sense(joints);
    if (!std::exchange(has_sensed_, true)) {
      for (int i = 0; i < control::kContacts; ++i)
        trajectories_[static_cast<std::size_t>(i)].rest_at(servo_.tip(i));
      clock_.begin_phase();
    }
    self().sense_object(joints, elapsed);
    Phases::follow_phases(elapsed);
    TipsCommand command;
    self().press(command, elapsed);
    set_torques(action_, servo_.torques(command, elapsed));
    state_.torque_share = servo_.torque_share();
    state_.object = estimator_.predict(clock_.now());
    state_.desired = self().desired();
    state_.has_ended = phase_ == Phase::kDone || phase_ == Phase::kFailed;
    if (phase_ == Phase::kFailed) state_.failure = next_failure_;
    return action_;
  }
  void stop() noexcept override {
    if (std::exchange(is_stopped_, true) || state_.has_ended) return;
    Phases::stop_phase("it was stopped");
  }
  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }
  [[nodiscard]] bool wants_plan() const noexcept override { return phase_ == Phase::kPlan; }

 protected:
  using Phases::clock_;
  using Phases::phase_;

  void enter(Phase phase) noexcept {
    Phases::enter(phase);
    state_.phase = Phases::row_of(phase).name;
  }
  void fail(std::string_view failure) noexcept {
    next_failure_ = failure;
    enter(Phase::kFailed);
  }
  // The failure to report at the end, unless there is an earlier one.
  void note_failure(std::string_view failure) noexcept {
    if (next_failure_.empty()) next_failure_ = failure;
  }
  [[nodiscard]] bool are_tips_there() const noexcept {
    return std::ranges::all_of(trajectories_, &TipTrajectory::is_complete);
  }
  // The tips are away from an object that nothing has happened to.
  [[nodiscard]] bool has_let_go() const noexcept {
    return next_failure_.empty() && are_tips_there();
  }

  TipServo servo_;
  control::PoseEstimator estimator_{3.0};
  PoseAverage average_;
  std::array<TipTrajectory, control::kContacts> trajectories_;
  std::string_view next_failure_;
  bool is_stopped_{false};

 private:
  [[nodiscard]] S& self() noexcept { return static_cast<S&>(*this); }
  bool has_sensed_{false};
  SkillState state_;
  TriFinger::Action action_;
};

}  // namespace trifinger::manipulation
