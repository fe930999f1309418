// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/fetcher.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "manipulation/parts/soft_limits.hpp"

namespace trifinger::manipulation {
namespace {

using Eigen::Vector3d;

constexpr double kDragHeight =
    0.022;                           // Of the tip's centre: low, so that the box does not tip over.
constexpr double kGap = 0.014;       // Between tip and box where the tip comes down [m].
constexpr double kAbove = 0.045;     // Of the tip's centre over the box [m].
constexpr double kSpeed = 0.25;      // Of the tip on its way [m/s].
constexpr double kDragSpeed = 0.07;  // [m/s]
constexpr double kCloseEnough = 0.005;  // The box is dragged until it is so near [m].
constexpr double kMargin = 0.03;        // Of joints from their soft limits [rad].
constexpr Seconds kRestTime{1.0};       // In which the other fingers leave.

}  // namespace

Fetcher::Fetcher(const SkillContext& context, const ObjectDescription& box, const Servo& servo)
    : kinematics_(context.description),
      limits_(context.limits),
      servo_(servo),
      half_(Vector3d::Map(box.size.data()) / 2),
      rest_(kinematics_.num_joints()),
      begin_(rest_),
      targets_(rest_) {
  const FingerJoints& initial = figures(context.description).initial_position;
  for (int i = 0; i < rest_.size(); ++i)
    rest_[i] = initial[static_cast<std::size_t>(i % kJointsPerFinger)];
}

double Fetcher::half_width(const Pose& object, const Vector3d& direction) const noexcept {
  return (object.orientation.conjugate() * direction).cwiseAbs().dot(half_);
}

FingerPose Fetcher::pose_for(int finger, const Vector3d& tip, const Vector3d& near) const noexcept {
  FingerPose pose = kinematics_.inverse_kinematics(finger, tip, near);
  if (!is_within_soft_limits(pose, finger, limits_, kMargin)) pose.reach = Reach::kOutsideLimits;
  return pose;
}

bool Fetcher::begin(Seconds now, const control::JointState& joints, const Pose& object,
                    const Vector3d& goal) noexcept {
  Vector3d displacement = goal - object.position;
  displacement.z() = 0.0;
  const double distance = displacement.norm();
  if (!(distance > kCloseEnough)) return false;
  const Vector3d direction = displacement / distance;
  const double radius = figures(kinematics_.description()).tip_radius;
  const double reach = half_width(object, direction) + radius;
  const double over = 2 * half_width(object, Vector3d::UnitZ()) + kAbove;
  Vector3d behind = object.position - (reach + kGap) * direction;
  behind.z() = kDragHeight;
  kinematics_.update(joints.position);

  // The finger that needs to turn its joints least.
  double least = std::numeric_limits<double>::infinity();
  for (int finger = 0; finger < kinematics_.num_fingers(); ++finger) {
    Vector3d near = rest_.segment<3>(kJointsPerFinger * static_cast<Eigen::Index>(finger));
    double turn = 0.0;
    bool reaches = true;
    const Vector3d end = behind + (distance + kGap) * direction;
    for (const Vector3d& tip :
         {Vector3d(behind.x(), behind.y(), over), behind, Vector3d((behind + end) / 2), end}) {
      const FingerPose pose = pose_for(finger, tip, near);
      reaches = reaches && pose.reach == Reach::kYes;
      turn = std::max(turn, (pose.position - near).norm());
      near = pose.position;
    }
    if (!reaches || turn >= least) continue;
    least = turn;
    finger_ = finger;
  }
  if (!std::isfinite(least)) return false;
  goal_ = goal;
  direction_ = direction;
  behind_ = behind;
  begin_ = joints.position;
  targets_ = joints.position;
  begin_time_ = now;
  now_ = now;
  tip_ = kinematics_.tip_position(finger_);
  to_ = tip_;
  to_.z() = std::max(over, tip_.z());
  begin_leg(Leg::kUp);
  return true;
}

void Fetcher::begin_leg(Leg leg) noexcept {
  leg_ = leg;
  from_ = tip_;
  leg_begin_ = now_;
  const double speed = leg == Leg::kDrag ? kDragSpeed : kSpeed;
  leg_time_ = Seconds(std::max(0.1, (to_ - from_).norm() / speed));
}

void Fetcher::next_leg() noexcept {
  const double height = to_.z();
  switch (leg_) {
    case Leg::kUp:
      to_ = {behind_.x(), behind_.y(), height};
      begin_leg(Leg::kOver);
      return;
    case Leg::kOver:
      to_ = behind_;
      begin_leg(Leg::kDown);
      return;
    case Leg::kDown: {
      const double distance = direction_.dot(goal_ - behind_);
      to_ = behind_ + std::max(0.0, distance) * direction_;
      begin_leg(Leg::kDrag);
      return;
    }
    case Leg::kDrag:
      to_ = tip_ - 0.03 * direction_;
      begin_leg(Leg::kBack);
      return;
    case Leg::kBack:
      to_ = tip_;
      to_.z() = kDragHeight + 0.09;
      begin_leg(Leg::kLift);
      return;
    case Leg::kLift:
    case Leg::kEnd:
      leg_ = Leg::kEnd;
  }
}

void Fetcher::stop() noexcept {
  if (leg_ == Leg::kDrag)
    next_leg();
  else if (leg_ == Leg::kUp || leg_ == Leg::kOver || leg_ == Leg::kDown)
    leg_ = Leg::kEnd;
}

const TriFinger::Action& Fetcher::update(Seconds now, const control::JointState& joints,
                                         const Pose& object) noexcept {
  now_ = now;
  const bool is_there = direction_.dot(goal_ - object.position) < kCloseEnough;
  if (leg_ == Leg::kDrag && is_there) next_leg();
  const double share = std::min(1.0, (now - leg_begin_) / leg_time_);
  // Dragging has an even speed.
  const double progress =
      leg_ == Leg::kDrag ? share : share * share * share * (10 - 15 * share + 6 * share * share);
  if (leg_ != Leg::kEnd) tip_ = from_ + progress * (to_ - from_);

  const double leaving = std::clamp((now - begin_time_) / kRestTime, 0.0, 1.0);
  const double smooth = leaving * leaving * leaving * (10 - 15 * leaving + 6 * leaving * leaving);
  const Eigen::Index first = kJointsPerFinger * static_cast<Eigen::Index>(finger_);
  const Vector3d near = targets_.segment<3>(first);
  targets_ = begin_ + smooth * (rest_ - begin_);
  const FingerPose pose = pose_for(finger_, tip_, near);
  targets_.segment<3>(first) = pose.reach == Reach::kYes ? pose.position : near;

  torque_share_ = 0.0;
  for (std::size_t i = 0; i < TriFinger::kJoints; ++i) {
    const auto joint = static_cast<Eigen::Index>(i);
    action_.position[i] = targets_[joint];
    action_.position_kp[i] = servo_.kp;
    action_.position_kd[i] = servo_.kd;
    const double torque =
        servo_.kp * (targets_[joint] - joints.position[joint]) - servo_.kd * joints.velocity[joint];
    torque_share_ = std::max(torque_share_, std::abs(torque) / limits_.max_torque[i]);
  }
  if (leg_ != Leg::kEnd && share >= 1.0) next_leg();
  return action_;
}

}  // namespace trifinger::manipulation
