// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/repose.hpp"

#include <array>
#include <limits>
#include <utility>

#include "manipulation/parts/object_of.hpp"
#include "manipulation/parts/task.hpp"

namespace trifinger::manipulation {
namespace {

constexpr Seconds kTimeout{2.0};  // Without a pose, the object is not seen.
constexpr std::string_view kNotSeen = "the object was not seen";
// The tips have left the object if they are almost as far away as they should be.
constexpr double kAlmost = 0.95;
// The mean of noisy poses deviates by up to a tenth of the tolerances.
constexpr double kSure = 0.9;
// Progress is that a tenth less is missing.
constexpr double kProgress = 0.9;

}  // namespace

Repose::Repose(const SkillContext& context, ReposeConfig config, NextGoal next_goal)
    : config_(std::move(config)),
      next_goal_(std::move(next_goal)),
      clock_(context.period),
      pusher_(context, config_.object, config_.push),
      fetcher_(context, object_of(context.description, config_.object, ObjectShape::kBox),
               {config_.push.planner.kp, config_.push.planner.kd}),
      carrier_(config_.carry ? std::make_unique<Carrier>(context, *config_.carry) : nullptr) {
  enter(Phase::kLook);
}

void Repose::see(TimeIndex captured, const Pose& pose) noexcept {
  if (!pose.position.allFinite() || !pose.orientation.coeffs().allFinite()) return;
  pusher_.see(clock_.time_of(captured), pose);
  seen_ = pose;
  last_seen_ = clock_.now();
  mean_.add(captured, pose);
  if (phase_ == Phase::kCarry) carrier_->see(captured, pose);
}

const TriFinger::Action& Repose::update(TimeIndex step,
                                        const control::JointState& joints) noexcept {
  clock_.advance(step);
  if (!state_.has_ended) follow_phases(joints);
  // The pusher keeps what it needs of every step.
  const TriFinger::Action* action = &pusher_.update(clock_.now(), joints);
  state_.torque_share = pusher_.torque_share();
  if (phase_ == Phase::kFetch) {
    action = &fetcher_.update(clock_.now(), joints, seen_);
    state_.torque_share = fetcher_.torque_share();
  }
  state_.object = pusher_.object();
  if (phase_ == Phase::kCarry) {
    action = &carrier_->update(step, joints);
    state_.torque_share = carrier_->torque_share();
    state_.object = carrier_->object();
  }
  state_.desired.pose = goal_.pose;
  return *action;
}

void Repose::stop() noexcept {
  if (state_.has_ended || !next_failure_.empty()) return;
  give_up("it was stopped");
}

void Repose::enter(Phase phase) noexcept {
  constexpr std::array<std::string_view, 9> kNames{"look", "fetch", "push", "leave", "check",
                                                   "plan", "carry", "done", "failed"};
  phase_ = phase;
  state_.phase = kNames[static_cast<std::size_t>(phase)];
  clock_.begin_phase();
  if (phase == Phase::kLook || phase == Phase::kCheck) mean_.restart(clock_.step() + 1);
}

void Repose::end(std::string_view failure) noexcept {
  pusher_.hold();
  enter(failure.empty() ? Phase::kDone : Phase::kFailed);
  state_.failure = failure;
  state_.has_ended = true;
}

// Ends when the tips have left the object.
void Repose::give_up(std::string_view failure) noexcept {
  next_failure_ = failure;
  if (phase_ == Phase::kPush)
    leave();
  else if (phase_ == Phase::kFetch)
    fetcher_.stop();
  else if (phase_ == Phase::kCarry)
    carrier_->stop();
  else if (phase_ != Phase::kLeave)
    end(failure);
}

// Begins with an object that rests at `rest`, not at its goal.
void Repose::attempt(const Pose& rest) noexcept {
  ++attempts_;
  rest_ = rest;
  constexpr double kUpright = 0.95;  // Least cosine of the tilt of the side that shall look up.
  if (carrier_ && uprightness(rest) > kUpright)
    enter(Phase::kPlan);
  else
    push(carrier_ != nullptr);
}

// Cosine of the tilt of the side that shall look up.
double Repose::uprightness(const Pose& pose) const noexcept {
  const Eigen::Vector3d up = goal_.pose.orientation.conjugate() * Eigen::Vector3d::UnitZ();
  return (pose.orientation * up).z();
}

// Roughly: in the middle of the arena, where the fingers push best, to an orientation from which
// the object can be carried to its goal.
void Repose::push(bool is_rough) noexcept {
  close_since_.reset();
  least_ = std::numeric_limits<double>::infinity();
  is_rough_ = is_rough;
  target_ = goal_;
  double farthest = config_.fetch_distance;
  if (is_rough) {
    target_.pose.position.head<2>().setZero();
    target_.free_radius = config_.carry->middle;
    farthest += target_.free_radius;
  } else if (carrier_) {
    farthest = config_.carry->drag_distance;
  }
  wants_fetch_ =
      !has_fetched_ && (rest_.position - target_.pose.position).head<2>().norm() > farthest;
  pusher_.push(target_);
  enter(Phase::kPush);
  progress_ = clock_.now();
}

void Repose::plan() {
  // A plan of the pusher may still be under way when the carrier is asked.
  if (pusher_.wants_plan())
    pusher_.plan();
  else
    can_carry_ = carrier_->plan(rest_, goal_.pose);
}

void Repose::begin() noexcept {
  if (pusher_.wants_plan()) {
    pusher_.begin();
    return;
  }
  if (phase_ != Phase::kPlan) return;  // It was stopped meanwhile.
  if (!can_carry_) {
    push(deviation_of(goal_, rest_).orientation > config_.carry->near_angle);
    return;
  }
  ++carries_;
  carrier_->begin(clock_.step());
  enter(Phase::kCarry);
}

void Repose::leave() noexcept {
  has_fetched_ = false;
  pusher_.retreat();
  enter(Phase::kLeave);
}

// The tips rest where they are, and the object is looked at; or it ends, if it has failed.
void Repose::look_again() noexcept {
  pusher_.hold();
  if (next_failure_.empty())
    enter(Phase::kCheck);
  else
    end(next_failure_);
}

bool Repose::is_at_goal(const Pose& rest) const noexcept {
  const Deviation deviation = deviation_of(goal_, rest);
  return deviation.position <= kSure * config_.position_tolerance &&
         deviation.orientation <= kSure * config_.orientation_tolerance;
}

// Takes the first goal from `reached_` on at which the object, at rest, is not yet.
void Repose::take_goal(const Pose& rest) noexcept {
  while (const std::optional<Goal> goal = next_goal_(reached_, rest)) {
    goal_ = *goal;
    if (!is_at_goal(rest)) {
      attempt(rest);
      return;
    }
    ++reached_;
  }
  end("");
}

bool Repose::is_unseen() const noexcept { return clock_.now() - last_seen_ > kTimeout; }

void Repose::follow_phases(const control::JointState& joints) noexcept {
  switch (phase_) {
    case Phase::kLook:
      if (mean_.count() > 0 && clock_.in_phase() >= config_.look_time)
        take_goal(upright(mean_.mean()));
      else if (is_unseen())
        end(kNotSeen);
      break;
    case Phase::kFetch:
      if (is_unseen() && next_failure_.empty()) give_up(kNotSeen);
      if (fetcher_.has_ended()) look_again();
      break;
    case Phase::kPush:
      if (is_unseen()) {
        give_up(kNotSeen);
      } else if (std::exchange(wants_fetch_, false) &&
                 fetcher_.begin(clock_.now(), joints, seen_, target_.pose.position)) {
        ++fetches_;
        has_fetched_ = true;
        pusher_.hold();
        enter(Phase::kFetch);
      } else {
        follow_push();
      }
      break;
    case Phase::kLeave: {
      // At least one plan of this phase has begun.
      const bool has_planned =
          clock_.in_phase() > 2 * (config_.push.plan_period + config_.push.plan_delay);
      const bool is_away = pusher_.nearest_tip() > kAlmost * config_.push.retreat_distance;
      if (clock_.in_phase() < config_.leave_time && !(has_planned && is_away)) break;
      look_again();
      break;
    }
    case Phase::kCheck:
      check();
      break;
    case Phase::kCarry:
      if (is_unseen() && next_failure_.empty() && !carrier_->is_holding()) give_up(kNotSeen);
      if (carrier_->has_ended()) look_again();
      break;
    case Phase::kPlan:
    case Phase::kDone:
    case Phase::kFailed:
      break;
  }
}

void Repose::check() noexcept {
  if (mean_.count() == 0 || clock_.in_phase() < config_.look_time) {
    if (is_unseen()) end(kNotSeen);
    return;
  }
  if (is_at_goal(mean_.mean())) {
    ++reached_;
    take_goal(upright(mean_.mean()));
  } else {
    attempt(upright(mean_.mean()));
  }
}

// Whether the object is where the tips may leave it.
bool Repose::is_close() const noexcept {
  const Pose& pose = pusher_.object().pose;
  const Deviation deviation = deviation_of(target_, pose);
  if (!is_rough_) {
    return deviation.position <= config_.closeness * config_.position_tolerance &&
           deviation.orientation <= config_.closeness * config_.orientation_tolerance;
  }
  constexpr double kFlat = 0.995;  // Least cosine of the tilt of an object that lies.
  return deviation.position <= config_.position_tolerance &&
         deviation.orientation <= config_.carry->near_angle && uprightness(pose) > kFlat;
}

void Repose::follow_push() noexcept {
  if (pusher_.num_plans() == 0) return;
  const Deviation deviation = deviation_of(target_, pusher_.object().pose);
  const double position = deviation.position / config_.position_tolerance;
  const double orientation = deviation.orientation / config_.orientation_tolerance;
  if (!is_close())
    close_since_.reset();
  else if (!close_since_)
    close_since_ = clock_.now();
  if (close_since_ && clock_.now() - *close_since_ >= config_.settle_time) {
    leave();
    return;
  }

  if (position + orientation < kProgress * least_) {
    least_ = position + orientation;
    progress_ = clock_.now();
  }
  const bool is_far = deviation.position > config_.fetch_distance;
  // An object that is far away may still be on its way.
  constexpr Seconds kOnItsWay{1.0};
  if (is_far && clock_.in_phase() > kOnItsWay && clock_.now() - progress_ > kOnItsWay) {
    leave();
    return;
  }
  if (clock_.now() - progress_ > config_.stuck_time) {
    pusher_.forget();
    leave();
  }
}

std::vector<Figure> Repose::figures(const SkillTrace& trace,
                                    std::span<const SeenPose> poses) const {
  const double duration =
      trace.steps.empty() ? 0.0
                          : trace.period.count() * static_cast<double>(trace.steps.back().step + 1);
  std::vector<Figure> all{
      {"duration", duration, "s", "from the first action to the end"},
      {"goals", static_cast<double>(reached_), "", "that were reached"},
      {"attempts", static_cast<double>(attempts_), "", "times that the tips went to the object"},
      {"fetches", static_cast<double>(fetches_), "", "times that a finger dragged it"}};
  if (carrier_)
    all.push_back(
        {"carries", static_cast<double>(carries_), "", "times that it was grasped and carried"});
  if (poses.empty() || attempts_ + reached_ == 0) return all;  // It had no goal yet.
  const Deviation last = deviation_of(goal_, poses.back().pose);
  // A goal may leave the place free.
  if (goal_.free_radius == 0.0)
    all.push_back({"position_error", last.position, "m", "of the last pose"});
  all.push_back({"orientation_error", last.orientation, "rad", "of the last pose"});
  return all;
}

}  // namespace trifinger::manipulation
