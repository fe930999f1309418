// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/pusher.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {
namespace {

using control::CostInput;
using control::PlanningModel;
using control::PlanningTask;

PlanningModel model_of(const SkillContext& context, const PushConfig& config) {
  control::PlanningModelOptions options = config.model;
  options.limits = context.limits;
  return PlanningModel(context.description, options);
}

double distance(const double* one, const double* other) noexcept {
  return std::hypot(one[0] - other[0], one[1] - other[1], one[2] - other[2]);
}

// Weights of a retreat: of the object's shift [1/m] and turn [1/rad], and of tips that are near
// [1/m].
constexpr double kStay = 60.0;
constexpr double kStayTurned = 6.0;
constexpr double kLeave = 3.0;

double square(double value) noexcept { return value * value; }

std::size_t index_of(const RobotDescription& description, const std::string& name) {
  const auto& objects = description.objects;
  const auto found = std::ranges::find(objects, name, &ObjectDescription::name);
  if (found == objects.end()) throw InvalidArgument("the scene has no object '" + name + "'");
  return static_cast<std::size_t>(found - objects.begin());
}

}  // namespace

Deviation deviation_of(const Goal& goal, const Pose& pose) noexcept {
  Deviation deviation;
  deviation.position =
      std::max(0.0, (pose.position - goal.pose.position).norm() - goal.free_radius);
  if (goal.axis) {
    const Eigen::Vector3d wanted = goal.pose.orientation * *goal.axis;
    const Eigen::Vector3d actual = pose.orientation * *goal.axis;
    deviation.orientation = std::atan2(wanted.cross(actual).norm(), wanted.dot(actual));
  } else {
    deviation.orientation = control::rotation_error(goal.pose.orientation, pose.orientation).norm();
  }
  return deviation;
}

Pusher::Pusher(const SkillContext& context, const std::string& object, const PushConfig& config)
    : config_(config),
      servo_{config.planner.kp, config.planner.kd},
      index_(index_of(context.description, object)),
      limits_(context.limits),
      planner_(model_of(context, config),
               PlanningTask{.terms = {},
                            .cost = [this](const CostInput& input) { return cost(input); },
                            .batch_cost = {},
                            .late_share = 0.2,
                            .late_factor = 3.0},
               config.planner),
      observer_(model_of(context, config), index_, config.pose_gain),
      kinematics_(context.description),
      weights_(config.placing),
      planned_(planner_.newest().commands),
      next_(planned_),
      targets_(planned_) {}

void Pusher::hold() noexcept {
  begin_mode(Mode::kIdle);
  has_targets_ = false;
  has_next_ = false;
  forgets_ = true;
}

void Pusher::retreat() noexcept {
  left_ = object_.pose;
  begin_mode(Mode::kRetreat);
}

void Pusher::push(const Goal& goal) noexcept {
  goal_ = goal;
  is_moving_ = false;
  weights_begin_ = Seconds(-1);
  begin_mode(Mode::kPush);
}

void Pusher::begin_mode(Mode mode) noexcept {
  mode_ = mode;
  has_held_ = false;
}

void Pusher::see(Seconds captured, const Pose& pose) noexcept {
  if (num_poses_ > 0 && captured <= poses_[num_poses_ - 1].first) return;
  if (num_poses_ == kPoses) {
    std::move(poses_.begin() + 1, poses_.end(), poses_.begin());
    --num_poses_;
  }
  poses_[num_poses_++] = {captured, pose};
}

void Pusher::choose_weights(Seconds now) noexcept {
  const double away = deviation_of(goal_, object_.pose).position;
  if (num_plans_ > 0) {
    if (away > config_.far) is_moving_ = true;
    if (away < config_.near) is_moving_ = false;
  }
  if (weights_begin_ < Seconds(0)) weights_begin_ = now;
  const auto turn = static_cast<int>((now - weights_begin_) / config_.weights_time);
  const PushWeights& close = turn % 2 == 0 ? config_.placing : config_.turning;
  weights_ = is_moving_ ? config_.moving : close;
}

void Pusher::request(Seconds now) noexcept {
  if (mode_ == Mode::kPush) choose_weights(now);
  request_.mode = mode_;
  request_.goal = goal_;
  request_.left = left_;
  request_.weights = weights_;
  request_.now = now;
  request_.begin = now + config_.plan_delay;
  request_.forgets = std::exchange(forgets_, false);
  request_.num_samples = std::min(samples_, kHistory);
  for (std::size_t i = 0; i < request_.num_samples; ++i)
    request_.history[i] = history_[(samples_ - request_.num_samples + i) % kHistory];
  request_.num_poses = num_poses_;
  std::copy_n(poses_.begin(), num_poses_, request_.poses.begin());
  num_poses_ = 0;
  request_.has_targets = has_targets_;
  last_request_ = now;
  wants_plan_ = true;
  is_planning_ = true;
}

const TriFinger::Action& Pusher::update(Seconds now, const control::JointState& joints) noexcept {
  history_[samples_++ % kHistory] = {now, joints};
  if (has_next_ && now >= next_.begin()) {
    targets_.move_to(next_.begin());
    std::ranges::copy(next_.values(), targets_.values().begin());
    has_targets_ = true;
    has_next_ = false;
  }
  kinematics_.update(joints.position);
  nearest_tip_ = std::numeric_limits<double>::infinity();
  for (int finger = 0; finger < kMaxFingers; ++finger) {
    nearest_tip_ =
        std::min(nearest_tip_, (kinematics_.tip_position(finger) - object_.pose.position).norm());
  }
  if (mode_ != Mode::kIdle && !is_planning_ && !has_next_ &&
      now - last_request_ >= config_.plan_period - Seconds(1e-6)) {
    request(now);
  }
  if (!has_held_) {
    held_ = joints;
    has_held_ = true;
  }
  std::array<double, TriFinger::kJoints> target{};
  if (mode_ != Mode::kIdle && has_targets_)
    targets_.at(now, target);
  else
    std::ranges::copy(held_.position, target.begin());
  torque_share_ = 0.0;
  for (std::size_t i = 0; i < target.size(); ++i) {
    const auto joint = static_cast<Eigen::Index>(i);
    action_.position[i] = target[i];
    action_.position_kp[i] = servo_.kp;
    action_.position_kd[i] = servo_.kd;
    const double torque =
        servo_.kp * (target[i] - joints.position[joint]) - servo_.kd * joints.velocity[joint];
    torque_share_ = std::max(torque_share_, std::abs(torque) / limits_.max_torque[i]);
  }
  return action_;
}

void Pusher::plan() {
  const std::span history(request_.history.data(), request_.num_samples);
  for (std::size_t i = 0; i < request_.num_poses; ++i)
    observer_.correct(request_.poses[i].first, request_.poses[i].second, history);
  const control::PlanningState& now = observer_.now(history);
  planned_object_ = observer_.motion_of(now);
  if (request_.forgets) planner_.restart();
  const control::PlanningState& start =
      request_.has_targets ? observer_.ahead(request_.begin, planner_.newest().commands, servo_)
                           : now;
  const control::Plan& made = planner_.plan(start);
  planned_.move_to(made.commands.begin());
  std::ranges::copy(made.commands.values(), planned_.values().begin());
}

void Pusher::begin() noexcept {
  wants_plan_ = false;
  is_planning_ = false;
  if (mode_ != Mode::kIdle) {
    next_.move_to(planned_.begin());
    std::ranges::copy(planned_.values(), next_.values().begin());
    has_next_ = true;
  }
  object_ = planned_object_;
  ++num_plans_;
}

// The running cost of a state, by what the request asks for.
double Pusher::cost(const CostInput& input) const noexcept {
  if (input.is_end) return 0.0;
  const mjData& data = input.data;
  const ObjectAddress& object = input.model.objects()[index_];
  const double* const position = data.qpos + object.position;
  const double* const velocity = data.qvel + object.velocity;
  double sum = 0.0;
  double away = 0.0;
  for (const int tip : input.model.tip_sites()) {
    const double from = distance(data.site_xpos + std::ptrdiff_t{3} * tip, position);
    away += request_.mode == Mode::kRetreat ? std::max(0.0, config_.retreat_distance - from)
                                            : std::max(0.0, from - config_.tip_distance);
  }
  for (std::size_t i = 0; i < input.target.size(); ++i)
    sum += config_.target_cost * square(input.target[i] - data.qpos[i]);
  sum += config_.speed_cost * (square(velocity[0]) + square(velocity[1]) + square(velocity[2]));
  sum += config_.spin_cost * (square(velocity[3]) + square(velocity[4]) + square(velocity[5]));
  const Pose pose{Eigen::Vector3d(position),
                  Eigen::Quaterniond(position[3], position[4], position[5], position[6])};
  if (request_.mode == Mode::kRetreat) {
    // The object stays where it is: that counts more than to be away soon.
    sum += kStay * (pose.position - request_.left.position).norm();
    sum +=
        kStayTurned * control::rotation_error(request_.left.orientation, pose.orientation).norm();
    return sum + kLeave * away;
  }
  const Deviation deviation = deviation_of(request_.goal, pose);
  const PushWeights& weights = request_.weights;
  sum += weights.position * deviation.position;
  sum += weights.orientation * deviation.orientation;
  return sum + weights.tips * away;
}

}  // namespace trifinger::manipulation
