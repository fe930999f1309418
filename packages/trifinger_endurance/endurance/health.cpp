// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/health.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "trifinger/core/timing.hpp"

namespace trifinger::apps {
namespace {

// This share of its way a joint must go in a slow pass.
constexpr double kFollows = 0.5;
// A joint that goes this share less or more has not moved at constant speed.
constexpr double kMeasures = 0.1;

}  // namespace

Health::Health(const RandomMotion& motion) : motion_(motion), joints_(motion.joints()) {
  for (const JointLimit& limit : motion.limits()) {
    saturation_.push_back(limit.max_torque / limit.default_kp);
    lag_.push_back((limit.safety_kd + limit.default_kd) / limit.default_kp);
  }
}

void Health::begin_session() noexcept {
  is_first_ = true;
  is_hindered_ = false;
  pass_.reset();
  forth_steps_ = 0;
  back_steps_ = 0;
  std::ranges::fill(joints_, Joint());
}

void Health::add(const MotionStep& step, std::span<const double> wanted, const StepRecord& record,
                 Tally& tally) noexcept {
  ++tally.steps;
  if (step.begins) ++tally.moves[static_cast<std::size_t>(step.move)];
  std::uint64_t reasons = 0;
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    Joint& joint = joints_[i];
    JointTally& counted = tally.joints[i];
    reasons |= record.reasons[i];
    counted.thermal_margin = std::min(counted.thermal_margin, record.thermal_margin[i]);
    if (!is_first_) {
      // The measurement is from before this step's action: it belongs to what was wanted before.
      const double error = joint.wanted - record.position[i];
      counted.error_squares += error * error;
      counted.travel += std::abs(record.position[i] - joint.position);
      note_collision(i, std::abs(error), counted, tally);
      if (before_.part == PassPart::kForth || before_.part == PassPart::kBack) {
        counted.pass_error_squares += error * error;
        ++counted.pass_steps;
        measure_pass(i, record.position[i], record.torque[i]);
      }
    }
    joint.position = record.position[i];
    joint.wanted_before = is_first_ ? wanted[i] : joint.wanted;
    joint.wanted = wanted[i];
  }
  for (std::uint64_t left = reasons; left != 0; left &= left - 1) {
    const auto reason = static_cast<std::size_t>(std::countr_zero(left));
    if (reason < Tally::kNumReasons) ++tally.reasons[reason];
  }
  if (!is_first_) {
    if (before_.part == PassPart::kForth) ++forth_steps_;
    if (before_.part == PassPart::kBack) ++back_steps_;
    if (before_.move == Move::kPass && before_.ends) end_pass(tally);
  }
  before_ = step;
  is_first_ = false;
}

void Health::add(const Status& status, Nanoseconds period, Tally& tally) noexcept {
  switch (late_cause(status)) {
    case LateCause::kNone:
      break;
    case LateCause::kUser:
      ++tally.late_steps_of_user;
      break;
    case LateCause::kScheduler:
      ++tally.late_steps_of_scheduler;
      break;
    case LateCause::kDriver:
      ++tally.late_steps_of_driver;
      break;
  }
  tally.skipped_ticks += status.skipped_ticks;
  if ((status.flags & Status::kActionRejected) != 0) ++tally.rejected_actions;
  tally.lateness.add(lateness_of(status, period));
}

std::optional<PassResult> Health::take_pass() noexcept {
  const std::optional<PassResult> result = pass_;
  pass_.reset();
  return result;
}

void Health::note_collision(std::size_t i, double error, JointTally& tally, Tally& all) noexcept {
  Joint& joint = joints_[i];
  const double speed =
      std::abs(joint.wanted - joint.wanted_before) / motion_.options().period.count();
  const double most = 2.0 * saturation_[i] + lag_[i] * speed;
  joint.held_up = error > most ? joint.held_up + 1 : 0;
  if (error < 0.5 * most) joint.has_collided = false;
  if (joint.held_up < (joint.has_collided ? kStillHeldUp : kHeldUp)) return;
  joint.held_up = 0;
  is_hindered_ = true;
  if (joint.has_collided) return;
  joint.has_collided = true;
  ++tally.collisions;
  ++all.collisions;
}

void Health::measure_pass(std::size_t i, double position, double torque) noexcept {
  Joint& joint = joints_[i];
  if (before_.part == PassPart::kForth) {
    if (forth_steps_ == 0) joint.forth_begin = position;
    joint.forth_end = position;
    joint.forth_torque += torque;
  } else {
    if (back_steps_ == 0) joint.back_begin = position;
    joint.back_end = position;
    joint.back_torque += torque;
  }
}

void Health::end_pass(Tally& tally) noexcept {
  PassResult result;
  // If the session has lost steps, the pass says nothing.
  const bool is_whole = forth_steps_ > 1 && back_steps_ > 1;
  for (std::size_t i = 0; is_whole && i < joints_.size(); ++i) {
    Joint& joint = joints_[i];
    // A joint of smaller amplitude goes slower: all of them need the same time.
    const double share = static_cast<double>(forth_steps_) * motion_.options().period.count() *
                         motion_.pass_speed(i);
    const double went =
        std::min(joint.forth_end - joint.forth_begin, joint.back_begin - joint.back_end);
    if (went < kFollows * share) {
      if (!result.hindered) result = {.hindered = i, .went = went, .wanted = share};
      continue;
    }
    // Where something was in the way, the torque is not that of friction.
    if (std::abs(went - share) > kMeasures * share) continue;
    const double friction = 0.5 * (joint.forth_torque / static_cast<double>(forth_steps_) -
                                   joint.back_torque / static_cast<double>(back_steps_));
    JointTally& counted = tally.joints[i];
    counted.friction_sum += friction;
    counted.friction_most = std::max(counted.friction_most, friction);
    ++counted.passes;
  }
  for (Joint& joint : joints_) {
    joint.forth_torque = 0.0;
    joint.back_torque = 0.0;
  }
  forth_steps_ = 0;
  back_steps_ = 0;
  if (!is_whole) return;
  if (result.hindered) ++tally.passes_failed;
  pass_ = result;
}

}  // namespace trifinger::apps
