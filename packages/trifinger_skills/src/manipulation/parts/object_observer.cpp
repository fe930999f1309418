// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/object_observer.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {
namespace {

using control::PlanningModel;
using control::PlanningState;
using control::Pose;
using control::Seconds;
using control::Twist;

// A deviation that no filter explains: somebody has moved the object, or it was flicked away [m].
constexpr double kJump = 0.02;
constexpr double kTurn = 0.35;  // [rad]

// Number of steps of equal length, none longer than `most`, that make up `duration`.
int steps_of(Seconds duration, Seconds most) {
  return std::max(1, static_cast<int>(std::ceil(duration / most - 1e-6)));
}

// The newest sample that is not after `time`; the first one if all are.
const JointSample& sample_at(std::span<const JointSample> history, Seconds time) {
  const auto after =
      std::ranges::upper_bound(history, time + Seconds(1e-6), {}, &JointSample::time);
  return after == history.begin() ? history.front() : *(after - 1);
}

}  // namespace

ObjectObserver::ObjectObserver(PlanningModel model, std::size_t object, double gain)
    : model_(std::move(model)),
      object_(model_.objects().at(object)),
      gain_(gain),
      data_(mj_makeData(model_.mujoco())),
      seen_(model_.initial_state()),
      state_(seen_) {
  if (data_ == nullptr) throw Error("MuJoCo has no memory for a simulation");
}

void ObjectObserver::restart(Seconds captured, const Pose& pose) {
  PlanningModel::set_object(object_, pose, Twist{}, seen_);
  seen_.time = captured;
  is_known_ = true;
}

void ObjectObserver::correct(Seconds captured, const Pose& pose,
                             std::span<const JointSample> history) {
  // What the joints did since the previous pose must be known.
  if (!is_known_ || history.empty() || seen_.time < history.front().time) {
    restart(captured, pose);
    return;
  }
  const Seconds elapsed = captured - seen_.time;
  if (elapsed <= Seconds(0)) return;
  load(seen_);
  follow(seen_.time, captured, history);
  keep(captured, seen_);

  const control::Motion expected = motion_of(seen_);
  const Eigen::Vector3d shift = pose.position - expected.pose.position;
  const Eigen::Vector3d turn = control::rotation_error(pose.orientation, expected.pose.orientation);
  const bool is_finite = shift.allFinite() && turn.allFinite();
  if (!is_finite || shift.norm() > kJump || turn.norm() > kTurn) {
    restart(captured, pose);
    return;
  }
  const double rate = gain_ * gain_ / (2.0 - gain_) / elapsed.count();
  const Pose corrected{
      expected.pose.position + gain_ * shift,
      (control::rotation_from_vector(gain_ * turn) * expected.pose.orientation).normalized()};
  const Twist twist{expected.twist.linear + rate * shift, expected.twist.angular + rate * turn};
  PlanningModel::set_object(object_, corrected, twist, seen_);
}

const PlanningState& ObjectObserver::now(std::span<const JointSample> history) {
  const JointSample& newest = history.back();
  load(seen_);
  if (newest.time > seen_.time) follow(seen_.time, newest.time, history);
  put_joints(newest);
  keep(newest.time, state_);
  return state_;
}

const PlanningState& ObjectObserver::ahead(Seconds time, const control::KnotSpline& targets,
                                           const Servo& servo) {
  const Seconds duration = time - state_.time;
  if (duration <= Seconds(0)) return state_;
  load(state_);
  mjModel& model = *model_.mujoco();
  const int count = steps_of(duration, model_.time_step());
  const double usual = model.opt.timestep;
  model.opt.timestep = duration.count() / count;
  std::array<double, kMaxJoints> target{};
  const auto joints = static_cast<std::size_t>(model_.num_joints());
  for (int step = 0; step < count; ++step) {
    targets.at(state_.time + step * duration / count, std::span(target).first(joints));
    for (std::size_t i = 0; i < joints; ++i) {
      const double most = model_.joints()[i].max_torque;
      data_->ctrl[i] = std::clamp(
          servo.kp * (target[i] - data_->qpos[i]) - servo.kd * data_->qvel[i], -most, most);
    }
    mj_step(&model, data_.get());
  }
  model.opt.timestep = usual;
  keep(time, state_);
  return state_;
}

control::Motion ObjectObserver::motion_of(const PlanningState& state) const {
  return {.pose = PlanningModel::object_pose(object_, state.position),
          .twist = PlanningModel::object_twist(object_, state.position, state.velocity)};
}

void ObjectObserver::load(const PlanningState& state) {
  std::ranges::copy(state.position, data_->qpos);
  std::ranges::copy(state.velocity, data_->qvel);
  std::fill_n(data_->qacc_warmstart, model_.velocity_size(), 0.0);
}

void ObjectObserver::keep(Seconds time, PlanningState& state) const {
  state.time = time;
  const auto is_finite = [](double value) { return std::isfinite(value); };
  const std::span position(data_->qpos, state.position.size());
  const std::span velocity(data_->qvel, state.velocity.size());
  // A simulation that diverged tells nothing: the object is where it was.
  if (!std::ranges::all_of(position, is_finite) || !std::ranges::all_of(velocity, is_finite))
    return;
  std::ranges::copy(position, state.position.begin());
  std::ranges::copy(velocity, state.velocity.begin());
}

void ObjectObserver::put_joints(const JointSample& sample) {
  for (int i = 0; i < model_.num_joints(); ++i) {
    data_->qpos[i] = sample.joints.position[i];
    data_->qvel[i] = sample.joints.velocity[i];
    data_->ctrl[i] = sample.joints.torque[i];
  }
}

void ObjectObserver::follow(Seconds from, Seconds to, std::span<const JointSample> history) {
  mjModel& model = *model_.mujoco();
  const int count = steps_of(to - from, model_.time_step());
  const double usual = model.opt.timestep;
  model.opt.timestep = (to - from).count() / count;
  for (int step = 0; step < count; ++step) {
    put_joints(sample_at(history, from + step * (to - from) / count));
    mj_step(&model, data_.get());
  }
  model.opt.timestep = usual;
}

}  // namespace trifinger::manipulation
