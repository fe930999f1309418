// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/manipulation.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <string_view>
#include <utility>

#include "manipulation/parts/object_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {
namespace {

using control::GraspPhase;

// An object that was not seen for so long is out of sight. Poses come at 10 Hz or more, and are up
// to 0.1 s late.
constexpr Seconds kOutOfSight{0.3};

}  // namespace

constinit const std::array<Manipulation::Row, 10> Manipulation::kPhases{{
    // name, when it is stopped, done, next, entry, during
    {"look", &M::fail, nullptr, kPlan, nullptr, &M::look},
    {"plan", &M::fail},
    {"grasp", &M::release, &M::holds, kLead, &M::begin_trajectory},
    {"lead", &M::give_up, nullptr, kFollow, nullptr, &M::follow_trajectory},
    {"follow", &M::give_up, nullptr, kHold, nullptr, &M::follow_trajectory},
    {"hold", &M::give_up, nullptr, kLower, nullptr, &M::follow_trajectory},
    {"lower", &M::give_up, nullptr, kRelease, nullptr, &M::follow_trajectory},
    {"release", &M::note_failure, nullptr, kDone, nullptr, &M::finish_release},
    {"done"},
    {"failed"},
}};

std::string_view name_of(Phase phase) noexcept { return Manipulation::row_of(phase).name; }

Manipulation::Manipulation(const RobotDescription& description, const GraspingConfig& config,
                           Seconds period)
    : Phased(period),
      look_time_(config.look_time),
      max_grasps_(config.max_grasps),
      half_size_(Eigen::Vector3d::Map(object_of(description, config.object).size.data()) / 2),
      controller_(description, control::rigid_body(object_of(description, config.object)),
                  config.controller),
      estimator_(config.pose_bandwidth),
      error_gain_(config.error_gain),
      last_seen_(std::numeric_limits<TimeIndex>::min()),
      memory_(kMemory) {
  if (!(period > Seconds(0))) throw InvalidArgument("the period of a step is not above zero");
  looked_.restart(clock_.step());
}

void Manipulation::fail(std::string_view failure) noexcept {
  failure_ = failure;
  enter(Phase::kFailed);
}

void Manipulation::look_again() noexcept {
  looked_.restart(clock_.step());
  enter(Phase::kLook);
}

void Manipulation::begin_again(TimeIndex step) noexcept {
  clock_.advance(step);
  failure_ = next_failure_ = {};
  grasps_ = 0;
  look_again();
}

void Manipulation::see(TimeIndex captured, const Pose& pose) noexcept {
  // The pose wanted at the step of the capture may not be known before `update`.
  if (captured > last_seen_) new_pose_ = SeenPose{captured, pose};
}

void Manipulation::take_pose() noexcept {
  if (!new_pose_) return;
  const auto [captured, pose] = *std::exchange(new_pose_, std::nullopt);
  const TimeIndex step = clock_.step();
  if (captured > step || captured <= step - static_cast<TimeIndex>(kMemory)) return;
  last_seen_ = captured;
  if (phase_ == Phase::kLook) {
    looked_.add(captured, pose);
    return;
  }
  const Remembered& then = memory_at(captured);
  const Seconds time = clock_.time_of(captured);
  if (estimator_.update(time, pose, then.desired)) {
    known_ = {estimator_.predict(time, then.desired).pose, then.felt};
    return;
  }
  // The tips have told more since. What they have felt brings the pose to the present step.
  (void)estimator_.update(clock_.now(), carried(pose, then.felt), desired_);
  known_ = {estimator_.predict(clock_.now(), desired_).pose, felt_};
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

bool Manipulation::is_visible() const noexcept {
  return !holds() || clock_.now() - clock_.time_of(last_seen_) <= kOutOfSight;
}

// Takes the motion of an object that is out of sight from the tips.
void Manipulation::feel() noexcept {
  if (is_visible()) return;
  (void)estimator_.update(clock_.now(), carried(known_.pose, known_.felt), desired_);
}

void Manipulation::look(Seconds /*elapsed*/) noexcept {
  if (clock_.in_phase() >= (looked_.count() > 0 ? look_time_ : kLongestLook)) finish_look();
}

void Manipulation::finish_look() noexcept {
  if (looked_.count() == 0) {
    fail("nobody has said where the object is");
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
    fail("no grasp reaches the whole way from where the object lies");
    return;
  }
  plan_ = plan;
  shift_.setZero();
  turn_.setZero();
  ++grasps_;
  controller_.grasp(plan_->touches, plan_->start);
  enter(Phase::kGrasp);
}

void Manipulation::release(std::string_view failure) noexcept {
  next_failure_ = failure;
  controller_.release();
  enter(Phase::kRelease);
}

void Manipulation::stop() noexcept {
  if (!has_ended()) stop_phase(kStopped);
}

void Manipulation::give_up(std::string_view failure) noexcept {
  note_failure(failure);
  plan_->trajectory.give_up(trajectory_time());
}

void Manipulation::follow_trajectory(Seconds /*elapsed*/) noexcept {
  const Leg leg = plan_->trajectory.leg_at(trajectory_time());
  if (leg == Leg::kRest) {
    release(next_failure_);
    return;
  }
  constexpr std::array kPhaseOfLeg{Phase::kLead, Phase::kFollow, Phase::kHold, Phase::kLower};
  const Phase phase = kPhaseOfLeg[static_cast<std::size_t>(leg)];
  if (phase != phase_ && leg != Leg::kLead) enter(phase);
}

void Manipulation::finish_release(Seconds /*elapsed*/) noexcept {
  if (controller_.state().phase != GraspPhase::kIdle) return;
  if (next_failure_.empty()) {
    enter(Phase::kDone);
  } else if (next_failure_ == kLost && grasps_ < max_grasps_) {
    next_failure_ = {};
    look_again();
  } else {
    fail(next_failure_);
  }
}

void Manipulation::set_desired() noexcept {
  switch (phase_) {
    case Phase::kGrasp:
      desired_ = plan_->trajectory.at(Seconds(0));
      return;
    case Phase::kLead:
    case Phase::kFollow:
    case Phase::kHold:
    case Phase::kLower:
      desired_ = plan_->trajectory.at(trajectory_time());
      return;
    default:
      // In these phases the object should stay at rest.
      desired_ = {.pose = desired_.pose};
      return;
  }
}

const JointValues& Manipulation::update(TimeIndex step,
                                        const control::JointState& joints) noexcept {
  const TimeIndex before = clock_.step();
  // Skipped steps get the previous entry.
  for (TimeIndex i = std::max<TimeIndex>(before + 1, 0);
       i < std::min(step, before + static_cast<TimeIndex>(kMemory)); ++i)
    memory_[static_cast<std::size_t>(i) % kMemory] = {.desired = desired_, .felt = felt_};
  const Seconds elapsed = clock_.advance(step);
  if (phase_ != Phase::kRelease && controller_.state().phase == GraspPhase::kLost)
    release(next_failure_.empty() ? kLost : next_failure_);
  else
    follow_phases(elapsed);
  set_desired();
  felt_ = moved(felt_, controller_.state().felt, elapsed);
  if (step >= 0)
    memory_[static_cast<std::size_t>(step) % kMemory] = {.desired = desired_, .felt = felt_};
  take_pose();
  feel();
  object_ = estimator_.predict(clock_.now(), desired_);
  Motion corrected = desired_;
  if (holds()) {
    constexpr double kFarthest = 0.01;   // [m]
    constexpr double kMostTurned = 0.2;  // [rad]
    constexpr double kOnTable = 0.001;   // [m]
    const double share = error_gain_ * elapsed.count();
    const auto add = [share](Eigen::Vector3d& sum, const Eigen::Vector3d& error, double most) {
      sum += share * error;
      sum *= most / std::max(sum.norm(), most);
    };
    Eigen::Vector3d error = desired_.pose.position - object_.pose.position;
    Eigen::Vector3d turn =
        control::rotation_error(desired_.pose.orientation, object_.pose.orientation);
    if (desired_.pose.position.z() - rest_.position.z() < kOnTable) {
      // The table says how high the object is there and how level it lies. Where cameras say
      // something else, their calibration is off, and a growing force would press it down.
      error.z() = 0;
      turn.head<2>().setZero();
    }
    add(shift_, error, kFarthest);
    add(turn_, turn, kMostTurned);
    corrected.pose.position += shift_;
    corrected.pose.orientation = control::rotation_from_vector(turn_) * corrected.pose.orientation;
  }
  return controller_.update(elapsed, joints, object_, corrected);
}

}  // namespace trifinger::manipulation
