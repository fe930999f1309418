// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/guiding/guide_controller.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "trifinger/base/error.hpp"

namespace trifinger::guiding {
namespace {

using detail::require;
using detail::require_positive;

// A finger's line waits while its joints are further behind than this [rad].
constexpr double kMaxLag = 0.15;
// A reference that leads the joint by no more than this merely lags, without an obstacle [rad].
constexpr double kUsualLag = 0.05;
// Joints have arrived within this distance [rad] and below this speed [rad/s].
constexpr double kArrivalDistance = 0.02;
constexpr double kArrivalSpeed = 0.1;
// A tip that is so near to its point is at its point [m].
constexpr double kSamePoint = 1e-9;
// Dry friction is compensated fully from this speed on [rad/s]. Below it grows from zero, so that
// noise of the velocity at rest moves nothing.
constexpr double kSlidingSpeed = 0.05;
// A tip accelerates on its line as if its joints were this far away [m].
constexpr double kArm = 0.1;
// The safety checks end a session whose measurements are larger.
constexpr double kLargestMeasurement = 1e6;

// The speed from which a motion with steps of length `period` can stop after `distance`: whole
// steps of braking, distance = v period + (v - change) period + ..., solved for v. No step goes
// beyond.
double stoppable_speed(double distance, double change, double period) noexcept {
  return std::min(change * (std::sqrt(0.25 + 2 * distance / (change * period)) - 0.5),
                  distance / period);
}

bool is_plausible(double number) noexcept {
  return std::isfinite(number) && std::abs(number) <= kLargestMeasurement;
}

}  // namespace

std::string_view name_of(Mode mode) noexcept {
  switch (mode) {
    case Mode::kHold:
      return "hold";
    case Mode::kMoveJoints:
      return "move_joints";
    case Mode::kMoveTip:
      return "move_tip";
    case Mode::kFloat:
      return "float";
    case Mode::kHome:
      return "home";
  }
  return "unknown";
}

void GuideSpeeds::validate() const {
  require_positive("joint_speed", joint_speed);
  require_positive("joint_acceleration", joint_acceleration);
  require_positive("tip_speed", tip_speed);
  require_positive("max_lead", max_lead);
}

GuideController::GuideController(const GuidedRobot& robot, const GuideSpeeds& speeds,
                                 Nanoseconds period)
    : robot_(robot),
      speeds_(speeds),
      period_(std::chrono::duration<double>(period).count()),
      kinematics_(robot.description),
      joints_(kinematics_.num_joints()),
      actuator_(actuator(robot.description)) {
  speeds.validate();
  require_positive("period", period_);
  require(robot.home.size() == joints_, "home has " + std::to_string(robot.home.size()) +
                                            " joints, the robot has " + std::to_string(joints_));
  detail::require_finite("home", robot.home);
  trifinger::validate(std::span(robot_.limits).first(static_cast<std::size_t>(joints_)));
  state_.measured.setZero(joints_);
  state_.reference.setZero(joints_);
  state_.target.setZero(joints_);
  velocity_.setZero(joints_);
  reference_velocity_.setZero(joints_);
  command_.torque.setZero(joints_);
  command_.position.setConstant(joints_, kNotGiven);
}

bool GuideController::begin(const MeasuredJoints& measured) noexcept TRIFINGER_REALTIME {
  if (measured.position.size() != joints_) return false;
  for (int i = 0; i < joints_; ++i) {
    if (!is_plausible(measured.position[i])) return false;
  }
  has_begun_ = true;
  measure(measured);
  state_.mode = Mode::kHold;
  state_.has_arrived = false;
  state_.reference = state_.measured;
  reference_velocity_.setZero();
  is_held_back_.fill(false);
  aim_at_rest();
  return true;
}

bool GuideController::accept(const Setpoint& setpoint) noexcept TRIFINGER_REALTIME {
  if (!has_begun_) return false;
  if (setpoint.mode == Mode::kMoveJoints &&
      (setpoint.joints.size() != joints_ || !setpoint.joints.allFinite())) {
    return false;
  }
  if (setpoint.mode == Mode::kMoveTip &&
      (setpoint.finger < 0 || setpoint.finger >= kinematics_.num_fingers() ||
       !setpoint.tip.allFinite())) {
    return false;
  }
  const bool has_floated = state_.mode == Mode::kFloat;
  if (has_floated) {
    if (setpoint.mode == Mode::kFloat) return true;
    // The joints go on from how they move.
    for (int i = 0; i < joints_; ++i)
      reference_velocity_[i] = std::clamp(velocity_[i], -max_speed(i), max_speed(i));
    aim_at_rest();
  }
  switch (setpoint.mode) {
    case Mode::kHold:
      // A pose that is already held stays the same. Otherwise, a robot that is told so again and
      // again would sag.
      if (state_.mode != Mode::kHold && !has_floated) aim_at_rest();
      break;
    case Mode::kMoveJoints:
      aim(setpoint.joints);
      break;
    case Mode::kHome:
      aim(robot_.home);
      break;
    case Mode::kMoveTip:
      aim_tip(setpoint.finger, setpoint.tip);
      break;
    case Mode::kFloat:
      for (Line& line : lines_) line = {};
      state_.shortfalls.fill({});
      break;
  }
  state_.mode = setpoint.mode;
  state_.has_arrived = false;
  return true;
}

const GuideCommand& GuideController::update(const MeasuredJoints& measured) noexcept
    TRIFINGER_REALTIME {
  if (!has_begun_) return command_;
  measure(measured);
  kinematics_.update(state_.measured);
  if (state_.mode == Mode::kFloat) {
    command_float();
  } else {
    for (int finger = 0; finger < kinematics_.num_fingers(); ++finger) advance_line(finger);
    command_reference();
  }
  find_arrival();
  return command_;
}

double GuideController::max_speed(int joint) const noexcept {
  return std::min(speeds_.joint_speed, robot_.limits[static_cast<std::size_t>(joint)].max_velocity);
}

double GuideController::max_acceleration(int joint) const noexcept {
  return std::min(speeds_.joint_acceleration,
                  robot_.limits[static_cast<std::size_t>(joint)].braking);
}

double GuideController::inside(int joint, double position) const noexcept {
  const JointLimit& limit = robot_.limits[static_cast<std::size_t>(joint)];
  return std::clamp(position, limit.soft_lower, limit.soft_upper);
}

void GuideController::measure(const MeasuredJoints& measured) noexcept {
  for (int i = 0; i < joints_; ++i) {
    if (i < measured.position.size() && is_plausible(measured.position[i]))
      state_.measured[i] = measured.position[i];
    if (i < measured.velocity.size() && is_plausible(measured.velocity[i]))
      velocity_[i] = measured.velocity[i];
  }
}

// Aims where the joints are once they have braked.
void GuideController::aim_at_rest() noexcept {
  JointValues rest(joints_);
  for (int i = 0; i < joints_; ++i) {
    // If something blocks a joint, its reference is somewhere else, and the joint must not go
    // there.
    const bool is_led = std::abs(state_.reference[i] - state_.measured[i]) <= kUsualLag;
    const double begin = is_led ? state_.reference[i] : state_.measured[i];
    const double speed =
        is_led ? reference_velocity_[i] : std::clamp(velocity_[i], -max_speed(i), max_speed(i));
    rest[i] = inside(i, begin + speed * std::abs(speed) / (2 * max_acceleration(i)));
  }
  aim(rest);
  state_.shortfalls.fill({});
}

void GuideController::aim(const JointValues& target) noexcept {
  for (Line& line : lines_) line = {};
  state_.shortfalls.fill({});
  for (int i = 0; i < joints_; ++i) {
    state_.target[i] = inside(i, target[i]);
    if (state_.target[i] != target[i])
      state_.shortfalls[static_cast<std::size_t>(i / kJointsPerFinger)].is_clamped = true;
  }
}

Eigen::Vector3d GuideController::inside(int finger, const Eigen::Vector3d& joints) const noexcept {
  Eigen::Vector3d result;
  for (int j = 0; j < kJointsPerFinger; ++j)
    result[j] = inside(kJointsPerFinger * finger + j, joints[j]);
  return result;
}

Eigen::Vector3d GuideController::tip_of(int finger, const JointValues& joints) const noexcept {
  return kinematics_.tip_positions(joints).segment<3>(3 * finger);
}

void GuideController::aim_tip(int finger, const Eigen::Vector3d& tip) noexcept {
  const int first = kJointsPerFinger * finger;
  Line& line = lines_[static_cast<std::size_t>(finger)];
  const bool is_held_back =
      std::any_of(is_held_back_.begin() + first, is_held_back_.begin() + first + kJointsPerFinger,
                  [](bool is) { return is; });
  // A line goes on from its own last point. The reference is behind that point, and would slow down
  // at each of many setpoints.
  if (!line.is_given || is_held_back) {
    line = {.at = tip_of(finger, state_.reference), .joints = state_.reference.segment<3>(first)};
  }
  FingerPose pose = kinematics_.inverse_kinematics(finger, tip, line.joints);
  Eigen::Vector3d joints = inside(finger, pose.position);
  if (joints != pose.position) {
    // The finger may get there in another way, which is not the nearest.
    const FingerPose other = kinematics_.inverse_kinematics(finger, tip);
    if (const Eigen::Vector3d others = inside(finger, other.position);
        other && others == other.position) {
      pose = other;
      joints = others;
    }
  }
  const bool is_clamped = joints != pose.position;
  state_.target.segment<3>(first) = joints;
  state_.shortfalls[static_cast<std::size_t>(finger)] = {.reach = pose.reach,
                                                         .is_clamped = is_clamped};
  line.is_given = true;
  line.end = pose && !is_clamped ? tip : tip_of(finger, state_.target);
}

void GuideController::advance_line(int finger) noexcept {
  Line& line = lines_[static_cast<std::size_t>(finger)];
  if (!line.is_given) return;
  const int first = kJointsPerFinger * finger;
  const double lag = (line.joints - state_.reference.segment<3>(first)).cwiseAbs().maxCoeff();
  line.rates.setZero();
  if (lag > kMaxLag) {
    line.speed = 0.0;
    return;
  }
  const Eigen::Vector3d displacement = line.end - line.at;
  const double distance = displacement.norm();
  const double change = kArm * speeds_.joint_acceleration * period_;
  if (distance <= kSamePoint) {
    line.at = line.end;
    line.speed = 0.0;
    line.joints = state_.target.segment<3>(first);
    return;
  }
  const Eigen::Vector3d along = displacement / distance;
  // Around a corner only the part of the speed remains that points in the new direction.
  line.speed *= std::max(0.0, line.along.dot(along));
  line.along = along;
  const double wanted = std::min(speeds_.tip_speed, stoppable_speed(distance, change, period_));
  line.speed = std::clamp(wanted, line.speed - change, line.speed + change);
  line.at += along * std::min(line.speed * period_, distance);
  const Eigen::Vector3d before = line.joints;
  line.joints =
      inside(finger, kinematics_.inverse_kinematics(finger, line.at, line.joints).position);
  line.rates = (line.joints - before) / period_;
}

// Moves the reference of a joint by one step towards `goal`, which itself moves with `rate`.
void GuideController::advance(int joint, double goal, double rate) noexcept {
  const double speed = max_speed(joint);
  const double change = max_acceleration(joint) * period_;  // of the speed in one step
  double& velocity = reference_velocity_[joint];
  const double reference = state_.reference[joint];
  const double error = goal - reference - rate * period_;
  const double wanted =
      rate + std::copysign(stoppable_speed(std::abs(error), change, period_), error);
  const double asked =
      std::clamp(std::clamp(wanted, velocity - change, velocity + change), -speed, speed);
  double next = reference + asked * period_;
  if (std::abs(next - goal) < 1e-12) next = goal;

  // What is further away than the largest lead comes back, but no faster than any reference.
  const double measured = state_.measured[joint];
  const double most = speed * period_;
  const double lead = std::clamp(next, measured - speeds_.max_lead, measured + speeds_.max_lead);
  is_held_back_[static_cast<std::size_t>(joint)] = lead != next;
  next = std::clamp(lead, reference - most, reference + most);
  // Nothing leads beyond a soft limit, or further beyond it.
  const JointLimit& limit = robot_.limits[static_cast<std::size_t>(joint)];
  next = std::clamp(next, std::min(limit.soft_lower, reference),
                    std::max(limit.soft_upper, reference));
  const double moved = (next - reference) / period_;
  // A reference that was held back does not go on with a speed that it does not have.
  velocity = std::clamp(moved, std::min(asked, 0.0), std::max(asked, 0.0));
  state_.reference[joint] = next;
}

void GuideController::command_float() noexcept {
  state_.reference = state_.measured;
  state_.target = state_.measured;
  reference_velocity_.setZero();
  is_held_back_.fill(false);
  command_.torque = kinematics_.gravity_torques();
  for (int i = 0; i < joints_; ++i) {
    const double slides = std::tanh(velocity_[i] / kSlidingSpeed);
    command_.torque[i] += actuator_.damping * velocity_[i] + actuator_.friction * slides;
  }
  command_.position.setConstant(joints_, kNotGiven);
}

void GuideController::command_reference() noexcept {
  command_.torque = kinematics_.gravity_torques();
  for (int i = 0; i < joints_; ++i) {
    const Line& line = lines_[static_cast<std::size_t>(i / kJointsPerFinger)];
    const int j = i % kJointsPerFinger;
    advance(i, line.is_given ? line.joints[j] : state_.target[i],
            line.is_given ? line.rates[j] : 0.0);
    // Everything that damps the joint would otherwise hold it back on its way.
    const JointLimit& limit = robot_.limits[static_cast<std::size_t>(i)];
    const double damping = limit.default_kd + limit.safety_kd + actuator_.damping;
    command_.torque[i] += damping * reference_velocity_[i];
  }
  command_.position = state_.reference;
}

void GuideController::find_arrival() noexcept {
  state_.has_arrived =
      state_.mode != Mode::kFloat && state_.reference == state_.target &&
      reference_velocity_.isZero(0.0) &&
      (state_.measured - state_.target).cwiseAbs().maxCoeff() <= kArrivalDistance &&
      velocity_.cwiseAbs().maxCoeff() <= kArrivalSpeed;
  for (const Line& line : lines_)
    state_.has_arrived = state_.has_arrived && (!line.is_given || line.at == line.end);
}

}  // namespace trifinger::guiding
