// SPDX-License-Identifier: BSD-3-Clause
#include "guiding/frame_kinematics.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::guiding::detail {
namespace {

using trifinger::detail::require;
using trifinger::detail::text_of;

// So many metres of a slide count as one radian of a hinge.
constexpr double kArm = 0.1;
// A frame that its joints move by less than this for each radian counts as one that they cannot
// move in that direction [m].
constexpr double kDamping = 0.01;
// A step brings a frame at most so much nearer [m], and a joint at most so far [rad].
constexpr double kStride = 0.01;
constexpr double kLargestStep = 0.2;
// A closed form brings the tip at least so near to its goal, unless the frame is none of its tips
// [m].
constexpr double kExact = 1e-6;

// Returns the model of `robot` if its parts fit together.
std::shared_ptr<const SceneModel> checked_model(const GuidedRobot& robot) {
  require(robot.model != nullptr, "a guided robot must have a model");
  const std::size_t joints = robot.model->joints().size();
  require(robot.limits.size() == joints,
          text_of("there are limits of ", robot.limits.size(), " joints, the model has ", joints));
  require(joints <= kMaxCountedJoints,
          text_of("the model has ", joints, " joints, allowed are ", kMaxCountedJoints));
  require(robot.frames.size() <= kMaxGuidedFrames,
          text_of("there are ", robot.frames.size(), " frames, allowed are ", kMaxGuidedFrames));
  return robot.model;
}

}  // namespace

FrameKinematics::FrameKinematics(const GuidedRobot& robot)
    : model_(checked_model(robot)),
      limits_(robot.limits),
      frames_(robot.model, robot.frames),
      radians_(GuidedJoints::Ones(std::ssize(robot.limits))),
      damping_(GuidedJoints::Zero(std::ssize(robot.limits))),
      friction_(GuidedJoints::Zero(std::ssize(robot.limits))),
      data_(model_->make_data()),
      rows_(static_cast<std::size_t>(3 * model_->mujoco()->nv), 0.0),
      step_(GuidedJoints::Zero(std::ssize(robot.limits))) {
  for (int i = 0; i < num_joints(); ++i) {
    if (model_->joints()[static_cast<std::size_t>(i)].is_slide) radians_[i] = kArm;
  }
  model_->reset(*data_);
  std::fill_n(data_->qvel, model_->mujoco()->nv, 0.0);
  configuration_.assign(data_->qpos, data_->qpos + model_->mujoco()->nq);
  find_friction();
  find_moved(robot);
  find_groups();
  if (!robot.description) return;
  closed_form_.emplace(*robot.description);
  require(closed_form_->num_joints() == num_joints(),
          text_of("the description has ", closed_form_->num_joints(), " joints, the model has ",
                  num_joints()));
}

// Lets each motor alone move its joints, and sees what damps them.
void FrameKinematics::find_friction() {
  const mjModel& model = *model_->mujoco();
  const SceneModel::Data moving = model_->make_data();
  std::vector<double> unit(static_cast<std::size_t>(model.nv), 0.0);
  for (std::size_t joint = 0; joint < limits_.size(); ++joint) {
    const auto i = static_cast<Eigen::Index>(joint);
    model_->reset(*moving);
    for (int dof = 0; dof < static_cast<int>(model.nv); ++dof) {
      unit[static_cast<std::size_t>(dof)] = 1.0;
      const double share = model_->torque_of(joint, unit.data());
      unit[static_cast<std::size_t>(dof)] = 0.0;
      moving->qvel[dof] = share;
      friction_[i] += std::abs(share) * model.dof_frictionloss[dof];
    }
    const int tendon = mj_name2id(&model, mjOBJ_TENDON, model_->joints()[joint].name.c_str());
    const int hinge = mj_name2id(&model, mjOBJ_JOINT, model_->joints()[joint].name.c_str());
    if (hinge < 0 && tendon >= 0) friction_[i] += model.tendon_frictionloss[tendon];
    mj_fwdPosition(&model, moving.get());
    mj_fwdVelocity(&model, moving.get());
    damping_[i] = -model_->torque_of(joint, moving->qfrc_damper);
  }
}

void FrameKinematics::find_moved(const GuidedRobot& robot) {
  const auto size = static_cast<std::size_t>(model_->mujoco()->nv);
  for (std::size_t frame = 0; frame < frames_.size(); ++frame) {
    std::ranges::fill(rows_, std::nan(""));
    frames_.jacobian(frame, configuration_, rows_);
    // What was filled in belongs to the chain.
    std::vector<double> chain(size);
    std::ranges::transform(std::span(rows_).first(size), chain.begin(),
                           [](double number) { return std::isnan(number) ? 0.0 : 1.0; });
    std::bitset<kMaxCountedJoints> moved;
    for (std::size_t dof = 0; dof < size; ++dof) {
      std::vector<double> unit(size, 0.0);
      unit[dof] = chain[dof];
      for (std::size_t joint = 0; joint < limits_.size(); ++joint) {
        if (model_->torque_of(joint, unit.data()) != 0.0) moved.set(joint);
      }
    }
    require(moved.any(), "no motor moves the frame '" + robot.frames[frame] + "'");
    moves_.push_back(moved);
  }
}

void FrameKinematics::find_groups() {
  for (int frame = 0; frame < num_frames(); ++frame) {
    groups_.push_back(frame);
    for (int other = 0; other < frame; ++other) {
      const bool shares =
          (moves_[static_cast<std::size_t>(frame)] & moves_[static_cast<std::size_t>(other)]).any();
      if (!shares || moves_with(frame, other)) continue;
      const auto [first, second] = std::minmax({group(frame), group(other)});
      std::ranges::replace(groups_, second, first);
    }
  }
}

void FrameKinematics::measure(const GuidedJoints& position, std::span<const double> all) noexcept {
  const std::size_t count = std::min(all.size(), model_->model_joints().size());
  for (std::size_t i = 0; i < count; ++i) {
    if (std::abs(all[i]) <= kLargestJointLimit) model_->set_model_position(i, all[i], *data_);
  }
  for (int i = 0; i < num_joints(); ++i) {
    model_->set_position(static_cast<std::size_t>(i), position[i], *data_);
  }
}

void FrameKinematics::weight(GuidedJoints& torque) noexcept {
  torque.resize(num_joints());
  model_->compute_weight(*model_->mujoco(), *data_,
                         std::span(torque.data(), static_cast<std::size_t>(torque.size())));
}

void FrameKinematics::pose(const GuidedJoints& position) noexcept {
  std::copy_n(data_->qpos, configuration_.size(), configuration_.begin());
  for (int i = 0; i < num_joints(); ++i) {
    model_->set_position(static_cast<std::size_t>(i), position[i], configuration_);
  }
}

Eigen::Vector3d FrameKinematics::point(int frame, const GuidedJoints& position) noexcept {
  pose(position);
  const auto [x, y, z] = frames_.position(static_cast<std::size_t>(frame), configuration_);
  return {x, y, z};
}

void FrameKinematics::points(const GuidedJoints& position, FramePoints& points) noexcept {
  points.resize(3, num_frames());
  if (num_frames() == 0) return;
  pose(position);
  frames_.positions(configuration_,
                    std::span(points.data(), static_cast<std::size_t>(points.size())));
}

// Fills in the Jacobian and the error of one goal, for the configuration of this moment.
void FrameKinematics::add_columns(const FrameGoal& goal, int row) noexcept {
  const auto frame = static_cast<std::size_t>(goal.frame);
  const auto [x, y, z] = frames_.position(frame, configuration_);
  error_.segment<3>(row) = goal.point - Eigen::Vector3d(x, y, z);
  std::ranges::fill(rows_, 0.0);
  frames_.jacobian(frame, configuration_, rows_);
  const std::size_t size = rows_.size() / 3;
  for (int joint = 0; joint < num_joints(); ++joint) {
    for (int axis = 0; axis < 3; ++axis) {
      columns_(row + axis, joint) =
          moves(joint, goal.frame)
              ? radians_[joint] *
                    model_->torque_of(static_cast<std::size_t>(joint),
                                      rows_.data() + static_cast<std::size_t>(axis) * size)
              : 0.0;
    }
  }
}

double FrameKinematics::approach(std::span<const FrameGoal> goals,
                                 GuidedJoints& position) noexcept {
  if (goals.empty()) return 0.0;
  const auto rows = static_cast<int>(3 * goals.size());
  columns_.resize(rows, num_joints());
  error_.resize(rows);
  pose(position);
  double farthest = 0.0;
  for (int row = 0; row < rows; row += 3) {
    add_columns(goals[static_cast<std::size_t>(row / 3)], row);
    const double distance = error_.segment<3>(row).stableNorm();
    farthest = std::max(farthest, distance);
    if (distance > kStride) error_.segment<3>(row) *= kStride / distance;
  }
  square_ = columns_.lazyProduct(columns_.transpose());
  square_.diagonal().array() += kDamping * kDamping;
  // A joint at its limit leaves its part to the others, so each turn has fewer joints.
  for (num_turns_ = 1; num_turns_ <= kMaxTurns; ++num_turns_) {
    solver_.compute(square_);
    solved_ = solver_.solve(error_);
    step_ = columns_.transpose().lazyProduct(solved_);
    const double largest = step_.cwiseAbs().maxCoeff();
    if (largest > kLargestStep) step_ *= kLargestStep / largest;
    if (stop_at_limits(position) && num_turns_ < kMaxTurns) continue;
    position += step_.cwiseProduct(radians_);
    break;
  }
  return farthest;
}

bool FrameKinematics::stop_at_limits(GuidedJoints& position) noexcept {
  bool has_stopped = false;
  for (int i = 0; i < num_joints(); ++i) {
    const JointLimit& limit = limits_[static_cast<std::size_t>(i)];
    const double wanted = position[i] + step_[i] * radians_[i];
    const double allowed = std::clamp(wanted, limit.soft_lower, limit.soft_upper);
    if (allowed == wanted || step_[i] == 0.0) continue;
    error_ -= columns_.col(i) * ((allowed - position[i]) / radians_[i]);
    position[i] = allowed;
    step_[i] = 0.0;
    square_ -= columns_.col(i).lazyProduct(columns_.col(i).transpose());
    columns_.col(i).setZero();
    has_stopped = true;
  }
  return has_stopped;
}

bool FrameKinematics::find_posture(const FrameGoal& goal, GuidedJoints& position) noexcept {
  if (!closed_form_) return false;
  int first = 0;
  while (!moves(first, goal.frame)) ++first;
  const int finger = first / kJointsPerFinger;
  first = kJointsPerFinger * finger;
  GuidedJoints other = position;
  for (const FingerPose& pose : {closed_form_->inverse_kinematics(
                                     finger, goal.point, position.segment<kJointsPerFinger>(first)),
                                 closed_form_->inverse_kinematics(finger, goal.point)}) {
    other.segment<kJointsPerFinger>(first) = pose.position;
    if (!is_within_limits(other) || (point(goal.frame, other) - goal.point).norm() > kExact)
      continue;
    position = other;
    return true;
  }
  return false;
}

bool FrameKinematics::is_within_limits(const GuidedJoints& position) const noexcept {
  for (int i = 0; i < num_joints(); ++i) {
    const JointLimit& limit = limits_[static_cast<std::size_t>(i)];
    if (position[i] < limit.soft_lower || position[i] > limit.soft_upper) return false;
  }
  return true;
}

}  // namespace trifinger::guiding::detail
