// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/carrier.hpp"

#include <algorithm>
#include <utility>

#include "manipulation/parts/torque_action.hpp"

namespace trifinger::manipulation {
namespace {

// Height at which tips pass above an object [m].
constexpr double kRaised = 0.11;
// Points of the way that are checked, beside its begin.
constexpr int kCarryPoints = 8;

}  // namespace

Carrier::Carrier(const SkillContext& context, CarrierConfig config)
    : description_(context.description),
      config_(std::move(config)),
      period_(context.period),
      planner_(context.description, config_.grasp.object, config_.grasp.planner),
      drive_(context.description, context.limits, config_.grasp.controller.tips),
      home_() {
  const Kinematics at_home(context.description);  // It starts in the initial pose.
  for (std::size_t k = 0; k < home_.size(); ++k) {
    home_[k] = at_home.tip_position(static_cast<int>(k));
    home_[k].z() = std::max(home_[k].z(), control::kApproachHeight);
  }
}

bool Carrier::plan(const Pose& object, const Pose& goal) {
  Pose rest = object;
  rest.position.z() = goal.position.z();  // Both rest on the same side.
  const Eigen::Vector3d shift = goal.position - rest.position;
  const double angle = control::rotation_error(goal.orientation, rest.orientation).norm();
  const Seconds time =
      std::max({config_.least_time, Seconds(shift.head<2>().norm() / config_.speed),
                Seconds(angle / config_.turn_speed)});
  Pose above = goal;
  above.position.z() += config_.height;
  // A lift by nothing: the way ends with putting it down.
  const LiftTask task{.height = 0.0,
                      .lift_time = period_,
                      .hold_time = Seconds(0),
                      .lower_time = config_.lower_time};
  const ObjectTrajectory trajectory(task, time, rest, above);
  std::vector<Motion> points;
  for (int i = 0; i <= kCarryPoints; ++i)
    points.push_back(trajectory.at(trajectory.duration() * i / kCarryPoints));
  const auto grasp = planner_.plan(points);
  if (!grasp) return false;
  next_ = std::make_unique<Manipulation>(description_, config_.grasp, period_);
  next_->rest_at(rest);
  next_->begin(Plan{grasp->touches, grasp->torque_share, rest, trajectory});
  return true;
}

void Carrier::begin(TimeIndex step) noexcept {
  std::swap(carry_, next_);
  step_ = step;
  is_rising_ = true;
  has_trajectories_ = false;
  has_ended_ = false;
}

void Carrier::see(TimeIndex captured, const Pose& pose) noexcept {
  if (!is_rising_ && captured >= first_) carry_->see(captured - first_, pose);
}

const TriFinger::Action& Carrier::update(TimeIndex step,
                                         const control::JointState& joints) noexcept {
  const Seconds elapsed = period_ * static_cast<double>(std::max<TimeIndex>(step - step_, 1));
  step_ = step;
  const JointValues& torques =
      is_rising_ ? rise(elapsed, joints) : carry_->update(step - first_, joints);
  set_torques(action_, torques);
  if (is_rising_) {
    torque_share_ = drive_.torque_share();
    is_rising_ = !std::ranges::all_of(trajectories_, &TipTrajectory::is_complete);
    first_ = step + 1;
  } else {
    torque_share_ = carry_->grasp().torque_share;
    has_ended_ = carry_->has_ended();
  }
  return action_;
}

// Straight up, and back to where they begin: a grasp is planned from there.
const JointValues& Carrier::rise(Seconds elapsed, const control::JointState& joints) noexcept {
  drive_.sense(joints);
  TipsDrive::Motions motions;
  for (std::size_t k = 0; k < trajectories_.size(); ++k) {
    const Eigen::Vector3d& tip = drive_.tips()[k];
    if (!has_trajectories_) {
      trajectories_[k].rest_at(tip);
      const Eigen::Vector3d up(tip.x(), tip.y(), std::max(tip.z(), kRaised));
      trajectories_[k].begin({up, home_[k]}, config_.grasp.controller.approach_speed);
    }
    motions[k] = trajectories_[k].advance(elapsed);
  }
  has_trajectories_ = true;
  return drive_.torques(motions, TipsCommand::zeros(), true, elapsed);
}

void Carrier::stop() noexcept {
  if (is_rising_)
    has_ended_ = true;
  else
    carry_->stop();
}

}  // namespace trifinger::manipulation
