// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/manipulation.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <string_view>
#include <utility>

#include "parts/object_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {
namespace {

using control::GraspPhase;

// An object that was not seen for so long is out of sight. Poses come at 10 Hz or more, and are up
// to 0.1 s late.
constexpr Seconds kOutOfSight{0.3};

// In the order of the enumerations.
constexpr std::array<std::string_view, 10> kPhaseNames{
    "look", "plan", "grasp", "lead", "follow", "hold", "lower", "release", "done", "failed"};
constexpr std::array<std::string_view, 5> kFailureTexts{
    "", "nobody has said where the object is",
    "no grasp reaches the whole way from where the object lies", "the object got lost",
    "it was stopped"};

}  // namespace

std::string_view name_of(Phase phase) noexcept {
  return kPhaseNames[static_cast<std::size_t>(phase)];
}

std::string_view text_of(Failure failure) noexcept {
  return kFailureTexts[static_cast<std::size_t>(failure)];
}

Manipulation::Manipulation(const RobotDescription& description, const ManipulationConfig& config,
                           Seconds period)
    : period_(period),
      look_time_(config.look_time),
      max_grasps_(config.max_grasps),
      half_size_(Eigen::Vector3d::Map(object_of(description, config.object).size.data()) / 2),
      controller_(description, control::rigid_body(object_of(description, config.object)),
                  config.controller),
      estimator_(config.pose_bandwidth),
      last_seen_(std::numeric_limits<TimeIndex>::min()),
      memory_(kMemory) {
  if (!(period > Seconds(0))) throw InvalidArgument("the period of a step is not above zero");
  looked_.restart(step_);
}

void Manipulation::enter(Phase phase) noexcept {
  phase_ = phase;
  phase_begin_ = step_;
}

void Manipulation::fail(Failure failure) noexcept {
  failure_ = failure;
  enter(Phase::kFailed);
}

void Manipulation::look_again() noexcept {
  looked_.restart(step_);
  enter(Phase::kLook);
}

void Manipulation::begin_again(TimeIndex step) noexcept {
  step_ = step;
  failure_ = next_failure_ = Failure::kNone;
  grasps_ = 0;
  look_again();
}

void Manipulation::see(TimeIndex captured, const Pose& pose) noexcept {
  // The pose wanted at the step of the capture may not be known before `update`.
  if (captured > last_seen_) news_ = SeenPose{captured, pose};
}

void Manipulation::take_news() noexcept {
  if (!news_) return;
  const auto [captured, pose] = *std::exchange(news_, std::nullopt);
  if (captured > step_ || captured <= step_ - static_cast<TimeIndex>(kMemory)) return;
  last_seen_ = captured;
  if (phase_ == Phase::kLook) {
    looked_.add(captured, pose);
    return;
  }
  const Remembered& then = memory_at(captured);
  if (estimator_.update(time_of(captured), pose, then.desired)) {
    known_ = {estimator_.predict(time_of(captured), then.desired).pose, then.felt};
    return;
  }
  // The tips have told more since. What they have felt brings the pose to the present step.
  (void)estimator_.update(time_of(step_), carried(pose, then.felt), desired_);
  known_ = {estimator_.predict(time_of(step_), desired_).pose, felt_};
}

// A held object in the present step that was at `pose` when the tips had felt `felt`.
Pose Manipulation::carried(const Pose& pose, const Pose& felt) const noexcept {
  const Eigen::Quaterniond turn = felt_.orientation * felt.orientation.conjugate();
  return {pose.position + felt_.position - felt.position, (turn * pose.orientation).normalized()};
}

const Manipulation::Remembered& Manipulation::memory_at(TimeIndex step) const noexcept {
  // Before step 0, the desired object was at rest, as in step 0.
  return memory_[static_cast<std::size_t>(std::max<TimeIndex>(step, 0)) % kMemory];
}

bool Manipulation::is_in_sight() const noexcept {
  return controller_.state().phase != GraspPhase::kHold ||
         time_of(step_) - time_of(last_seen_) <= kOutOfSight;
}

// Takes the motion of an object that is out of sight from the tips.
void Manipulation::feel() noexcept {
  if (is_in_sight()) return;
  (void)estimator_.update(time_of(step_), carried(known_.pose, known_.felt), desired_);
}

void Manipulation::finish_look() noexcept {
  if (looked_.count() == 0) {
    fail(Failure::kNotSeen);
    return;
  }
  Pose rest = upright(looked_.mean());
  const Eigen::Vector3d up = rest.orientation.conjugate() * Eigen::Vector3d::UnitZ();
  rest.position.z() = half_size_.dot(up.cwiseAbs());
  rest_at(rest);
}

void Manipulation::rest_at(const Pose& pose) noexcept {
  if (phase_ != Phase::kLook) return;
  rest_ = pose;
  plan_.reset();
  desired_ = {.pose = rest_};
  memory_.assign(kMemory, {.desired = desired_});
  felt_ = {};
  known_ = {.pose = rest_};
  estimator_.reset();
  enter(Phase::kPlan);
}

void Manipulation::begin(const std::optional<Plan>& plan) noexcept {
  if (phase_ != Phase::kPlan) return;
  if (!plan) {
    fail(Failure::kNoPlan);
    return;
  }
  plan_ = plan;
  ++grasps_;
  controller_.grasp(plan_->touches, plan_->start);
  enter(Phase::kGrasp);
}

void Manipulation::release(Failure failure) noexcept {
  next_failure_ = failure;
  controller_.release();
  enter(Phase::kRelease);
}

void Manipulation::stop() noexcept {
  if (has_ended()) return;
  next_failure_ = Failure::kStopped;
  switch (phase_) {
    case Phase::kLook:
    case Phase::kPlan:
      fail(Failure::kStopped);
      return;
    case Phase::kGrasp:
      release(Failure::kStopped);
      return;
    default:
      if (plan_ && phase_ != Phase::kRelease) plan_->way.give_up(time_of(step_ - way_begin_));
  }
}

void Manipulation::follow_way() noexcept {
  const auto enter_once = [this](Phase phase) {
    if (phase_ != phase) enter(phase);
  };
  switch (plan_->way.leg_at(time_of(step_ - way_begin_))) {
    case Leg::kLead:
      break;
    case Leg::kFollow:
      enter_once(Phase::kFollow);
      break;
    case Leg::kHold:
      enter_once(Phase::kHold);
      break;
    case Leg::kLower:
      enter_once(Phase::kLower);
      break;
    case Leg::kRest:
      release(next_failure_);
      break;
  }
}

void Manipulation::follow_phases() noexcept {
  const GraspPhase grasp = controller_.state().phase;
  if (phase_ != Phase::kRelease && grasp == GraspPhase::kLost) {
    release(next_failure_ == Failure::kNone ? Failure::kLost : next_failure_);
    return;
  }
  const Seconds elapsed = time_of(step_ - phase_begin_);
  switch (phase_) {
    case Phase::kLook:
      if (elapsed >= (looked_.count() > 0 ? look_time_ : kLongestLook)) finish_look();
      break;
    case Phase::kGrasp:
      if (grasp != GraspPhase::kHold) break;
      way_begin_ = step_;
      enter(Phase::kLead);
      break;
    case Phase::kLead:
    case Phase::kFollow:
    case Phase::kHold:
    case Phase::kLower:
      follow_way();
      break;
    case Phase::kRelease:
      if (grasp != GraspPhase::kIdle) break;
      if (next_failure_ == Failure::kNone) {
        enter(Phase::kDone);
      } else if (next_failure_ == Failure::kLost && grasps_ < max_grasps_) {
        next_failure_ = Failure::kNone;
        look_again();
      } else {
        fail(next_failure_);
      }
      break;
    case Phase::kPlan:
    case Phase::kDone:
    case Phase::kFailed:
      break;
  }
}

void Manipulation::set_desired() noexcept {
  switch (phase_) {
    case Phase::kGrasp:
      desired_ = plan_->way.at(Seconds(0));
      return;
    case Phase::kLead:
    case Phase::kFollow:
    case Phase::kHold:
    case Phase::kLower:
      desired_ = plan_->way.at(time_of(step_ - way_begin_));
      return;
    default:
      // In these phases the object should stay at rest.
      desired_ = {.pose = desired_.pose};
      return;
  }
}

const JointValues& Manipulation::update(TimeIndex step,
                                        const control::JointState& joints) noexcept {
  const TimeIndex elapsed = std::max<TimeIndex>(step - step_, 1);
  // Skipped steps get the previous entry.
  for (TimeIndex i = std::max<TimeIndex>(step_ + 1, 0);
       i < std::min(step, step_ + static_cast<TimeIndex>(kMemory)); ++i)
    memory_[static_cast<std::size_t>(i) % kMemory] = {.desired = desired_, .felt = felt_};
  step_ = step;
  follow_phases();
  set_desired();
  felt_ = moved(felt_, controller_.state().felt, time_of(elapsed));
  if (step >= 0)
    memory_[static_cast<std::size_t>(step) % kMemory] = {.desired = desired_, .felt = felt_};
  take_news();
  feel();
  object_ = estimator_.predict(time_of(step), desired_);
  return controller_.update(time_of(elapsed), joints, object_, desired_);
}

}  // namespace trifinger::manipulation
