// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/guiding/guide_controller.hpp"

#include <algorithm>
#include <cmath>

#include "guiding/frame_kinematics.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::guiding {
namespace {

using trifinger::detail::require;
using trifinger::detail::require_finite;
using trifinger::detail::require_positive;

// A frame's line waits while its joints are further behind than this [rad].
constexpr double kMaxLag = 0.15;
// A reference that leads the joint by no more than this merely lags, without an obstacle [rad].
constexpr double kUsualLag = 0.05;
// Joints have arrived within this distance [rad] and below this speed [rad/s].
constexpr double kArrivalDistance = 0.02;
constexpr double kArrivalSpeed = 0.1;
// Motors that refuse torques sag. They have arrived where they have been at rest for so long [s].
constexpr double kRestTime = 0.1;
// A point of a line that is so near to its end is at its end [m].
constexpr double kSamePoint = 1e-9;
// The search for the targets of a group does so many steps in one step of the robot, each so far
// ahead on the lines [m]. If it is so far ahead of a frame that cannot follow, it goes on at the
// end of the line [m].
constexpr int kSearchesPerStep = 6;
constexpr double kSearchStride = 0.01;
constexpr double kMaxAhead = 1.0;
// At the end of the line it goes on until the frame is as near as this [m], or as often as this.
constexpr double kFound = 1e-7;
constexpr int kMaxSettling = 100;
// It ends earlier if so many steps one after the other bring the frame hardly nearer: by less than
// this share of the distance, and by less than this [m].
constexpr int kMaxStuck = 8;
constexpr double kHardly = 0.01;
constexpr double kSlowly = 1e-3;
// A frame that its joints cannot keep nearer to its line than this has left it [m].
constexpr double kMaxGap = 5e-3;
// A frame that stays further away from its point than this does not get there [m].
constexpr double kReached = 1e-4;
// So often a step of the robot brings the joints nearer to the frames' places on their lines.
constexpr int kApproaches = 2;
// Dry friction is compensated fully from this speed on [rad/s]. Below it grows from zero, so that
// noise of the velocity at rest moves nothing.
constexpr double kSlidingSpeed = 0.05;
// A frame accelerates on its line as if its joints were this far away [m].
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

// What the frames are to get to in one step of least squares.
class Goals {
 public:
  void add(const detail::FrameGoal& goal) noexcept { goals_[count_++] = goal; }
  [[nodiscard]] std::span<const detail::FrameGoal> all() const noexcept {
    return std::span(goals_).first(count_);
  }

 private:
  std::array<detail::FrameGoal, kMaxGuidedFrames> goals_;
  std::size_t count_{0};
};

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
    case Mode::kMoveFrame:
      return "move_frame";
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
      kinematics_(std::make_unique<detail::FrameKinematics>(robot)),
      joints_(kinematics_->num_joints()),
      frames_(kinematics_->num_frames()) {
  speeds.validate();
  require_positive("period", period_);
  require(robot.home.size() == joints_, "home has " + std::to_string(robot.home.size()) +
                                            " joints, the robot has " + std::to_string(joints_));
  require_finite("home", robot.home);
  trifinger::validate(robot_.limits);
  for (GuidedJoints* const joints :
       {&state_.measured, &state_.reference, &state_.target, &velocity_, &reference_velocity_,
        &path_, &path_rates_, &command_.torque}) {
    joints->setZero(joints_);
  }
  command_.position.setConstant(joints_, kNotGiven);
  find_frames();
}

GuideController::~GuideController() = default;

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
  find_frames();
  return true;
}

bool GuideController::accept(const Setpoint& setpoint) noexcept TRIFINGER_REALTIME {
  if (!can_accept(setpoint)) return false;
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
    case Mode::kMoveFrame:
      aim_frame(setpoint.frame, setpoint.point);
      break;
    case Mode::kFloat:
      for (int frame = 0; frame < frames_; ++frame) forget_lines(kinematics_->group(frame));
      state_.is_clamped.fill(false);
      break;
  }
  state_.mode = setpoint.mode;
  state_.has_arrived = false;
  rest_time_ = 0.0;
  return true;
}

bool GuideController::can_accept(const Setpoint& setpoint) const noexcept {
  if (!has_begun_) return false;
  switch (setpoint.mode) {
    case Mode::kMoveJoints:
      return setpoint.joints.size() == joints_ && !setpoint.joints.array().isInf().any() &&
             !setpoint.joints.array().isNaN().all();
    case Mode::kMoveFrame:
      return setpoint.frame >= 0 && setpoint.frame < frames_ && setpoint.point.allFinite();
    case Mode::kFloat:
      return !robot_.refuses_torques;
    default:
      return true;
  }
}

const GuideCommand& GuideController::update(const MeasuredJoints& measured) noexcept
    TRIFINGER_REALTIME {
  if (!has_begun_) return command_;
  measure(measured);
  if (state_.mode == Mode::kFloat) {
    command_float();
  } else {
    for (int frame = 0; frame < frames_; ++frame) {
      if (kinematics_->group(frame) == frame) search(frame);
    }
    advance_lines();
    command_reference();
  }
  if (robot_.refuses_torques) command_.torque.setZero();
  find_arrival();
  find_frames();
  return command_;
}

double GuideController::radian(int joint) const noexcept { return kinematics_->radian(joint); }

double GuideController::max_speed(int joint) const noexcept {
  return std::min(speeds_.joint_speed * radian(joint), limit(joint).max_velocity);
}

double GuideController::max_acceleration(int joint) const noexcept {
  return std::min(speeds_.joint_acceleration * radian(joint), limit(joint).braking);
}

const JointLimit& GuideController::limit(int joint) const noexcept {
  return robot_.limits[static_cast<std::size_t>(joint)];
}

double GuideController::inside(int joint, double position) const noexcept {
  return std::clamp(position, limit(joint).soft_lower, limit(joint).soft_upper);
}

void GuideController::measure(const MeasuredJoints& measured) noexcept {
  for (int i = 0; i < joints_; ++i) {
    if (i < measured.position.size() && is_plausible(measured.position[i]))
      state_.measured[i] = measured.position[i];
    if (i < measured.velocity.size() && is_plausible(measured.velocity[i]))
      velocity_[i] = measured.velocity[i];
  }
  kinematics_->measure(state_.measured, measured.all);
}

// Where a joint is once it has braked.
double GuideController::rest(int joint) const noexcept {
  // If something blocks a joint, its reference is somewhere else, and the joint must not go there.
  // A joint that sags under its weight is not blocked.
  const double lag = std::abs(state_.reference[joint] - state_.measured[joint]);
  const bool is_led = robot_.refuses_torques ? !is_held_back_[static_cast<std::size_t>(joint)]
                                             : lag <= kUsualLag * radian(joint);
  const double begin = is_led ? state_.reference[joint] : state_.measured[joint];
  const double speed = is_led ? reference_velocity_[joint]
                              : std::clamp(velocity_[joint], -max_speed(joint), max_speed(joint));
  return inside(joint, begin + speed * std::abs(speed) / (2 * max_acceleration(joint)));
}

void GuideController::aim_at_rest() noexcept {
  GuidedJoints target(joints_);
  for (int i = 0; i < joints_; ++i) target[i] = rest(i);
  aim(target);
}

// Aims the joints at `target`, except for those that keep theirs: NaN.
void GuideController::aim(const GuidedJoints& target) noexcept {
  for (int i = 0; i < joints_; ++i) {
    if (std::isnan(target[i])) continue;
    for (int frame = 0; frame < frames_; ++frame) {
      const bool has_line = lines_[static_cast<std::size_t>(frame)].is_given;
      if (has_line && kinematics_->moves(i, frame)) forget_lines(kinematics_->group(frame));
    }
    state_.target[i] = inside(i, target[i]);
    state_.is_clamped[static_cast<std::size_t>(i)] = state_.target[i] != target[i];
  }
}

// Ends the lines of a group. Joints whose targets are still searched brake.
void GuideController::forget_lines(int group) noexcept {
  for (int frame = group; frame < frames_; ++frame) {
    Line& line = lines_[static_cast<std::size_t>(frame)];
    if (!line.is_given || !kinematics_->moves_with(frame, group)) continue;
    for (int i = 0; i < joints_; ++i) {
      if (!kinematics_->moves(i, frame)) continue;
      is_led_[static_cast<std::size_t>(i)] = false;
      if (!line.is_found) state_.target[i] = rest(i);
    }
    line = {};
    state_.missing[static_cast<std::size_t>(frame)] = 0.0;
  }
}

void GuideController::aim_frame(int frame, const Eigen::Vector3d& point) noexcept {
  Line& line = lines_[static_cast<std::size_t>(frame)];
  bool is_held_back = false;
  for (int i = 0; i < joints_; ++i) {
    is_held_back = is_held_back ||
                   (kinematics_->moves(i, frame) && is_held_back_[static_cast<std::size_t>(i)]);
  }
  // A line goes on from its own last point. The reference is behind that point, and would slow down
  // at each of many setpoints.
  if (!line.is_given || is_held_back) begin_line(frame);
  line.end = point;
  // All frames that share joints are searched together.
  for (int other = 0; other < frames_; ++other) {
    Line& searched = lines_[static_cast<std::size_t>(other)];
    if (!searched.is_given || !kinematics_->moves_with(frame, other)) continue;
    searched.is_found = false;
    searched.ahead = searched.at;
    for (int i = 0; i < joints_; ++i) {
      if (!kinematics_->moves(i, other)) continue;
      state_.target[i] = path_[i];
      state_.is_clamped[static_cast<std::size_t>(i)] = false;
    }
  }
  searches_[static_cast<std::size_t>(kinematics_->group(frame))] = {};
}

// Begins the line of a frame where the reference is.
void GuideController::begin_line(int frame) noexcept {
  for (int i = 0; i < joints_; ++i) {
    if (!kinematics_->moves(i, frame)) continue;
    is_led_[static_cast<std::size_t>(i)] = true;
    path_[i] = inside(i, state_.reference[i]);
  }
  lines_[static_cast<std::size_t>(frame)] = {.is_given = true};
  for (int other = 0; other < frames_; ++other) {
    Line& line = lines_[static_cast<std::size_t>(other)];
    if (line.is_given && kinematics_->moves_with(frame, other))
      line.at = kinematics_->point(other, path_);
  }
}

// Goes on to search the joints with which the frames of a group are at the ends of their lines. It
// goes ahead on the lines, so it finds the posture to which they lead.
void GuideController::search(int group) noexcept {
  Search& search = searches_[static_cast<std::size_t>(group)];
  for (int i = 0; i < kSearchesPerStep; ++i) {
    Goals goals;
    bool is_ahead = true;  // at the ends of all lines
    for (int frame = group; frame < frames_; ++frame) {
      Line& line = lines_[static_cast<std::size_t>(frame)];
      if (!line.is_given || line.is_found || !kinematics_->moves_with(frame, group)) continue;
      go_ahead(frame);
      goals.add({.frame = frame, .point = line.ahead});
      is_ahead = is_ahead && line.ahead == line.end;
    }
    if (goals.all().empty()) return;
    const double farthest = kinematics_->approach(goals.all(), state_.target);
    if (!is_ahead) continue;
    const double hardly = std::min(kHardly * farthest, kSlowly);
    search.stuck_steps = farthest >= search.nearest - hardly ? search.stuck_steps + 1 : 0;
    search.nearest = farthest;
    if (farthest <= kFound || search.stuck_steps >= kMaxStuck || ++search.steps >= kMaxSettling)
      end_search(group);
  }
}

// Moves the search for the target of a frame by one stride on its line.
void GuideController::go_ahead(int frame) noexcept {
  Line& line = lines_[static_cast<std::size_t>(frame)];
  if (line.ahead == line.end) return;
  const Eigen::Vector3d rest = line.end - line.ahead;
  const bool follows = (line.ahead - kinematics_->point(frame, state_.target)).norm() <= kMaxAhead;
  if (follows && rest.stableNorm() > kSearchStride) {
    // The length of the longest line is no number.
    line.ahead += kSearchStride * (rest / rest.lpNorm<Eigen::Infinity>()).normalized();
  } else {
    line.ahead = line.end;
  }
}

void GuideController::end_search(int group) noexcept {
  int num_lines = 0;
  for (int frame = group; frame < frames_; ++frame) {
    const bool has_line = lines_[static_cast<std::size_t>(frame)].is_given;
    if (has_line && kinematics_->moves_with(frame, group)) ++num_lines;
  }
  for (int frame = group; frame < frames_; ++frame) {
    Line& line = lines_[static_cast<std::size_t>(frame)];
    if (!line.is_given || line.is_found || !kinematics_->moves_with(frame, group)) continue;
    line.is_found = true;
    const Eigen::Vector3d point = kinematics_->point(frame, state_.target);
    const double missing = (point - line.end).stableNorm();
    // Another posture would take other frames of the group away from their points.
    const bool is_reached =
        missing <= kReached ||
        (num_lines == 1 &&
         kinematics_->find_posture({.frame = frame, .point = line.end}, state_.target));
    state_.missing[static_cast<std::size_t>(frame)] = is_reached ? 0.0 : missing;
    if (!is_reached) line.end = point;
  }
}

// True if this frame, and each other one that moves with it, is at the end of its line.
bool GuideController::is_at_end(int frame) const noexcept {
  for (int other = 0; other < frames_; ++other) {
    const Line& line = lines_[static_cast<std::size_t>(other)];
    if (line.is_given && !line.is_at_end() && kinematics_->moves_with(frame, other)) return false;
  }
  return true;
}

void GuideController::advance_lines() noexcept {
  path_rates_ = path_;
  for (int frame = 0; frame < frames_; ++frame) advance_line(frame);
  for (int group = 0; group < frames_; ++group) {
    Goals goals;
    for (int frame = group; frame < frames_; ++frame) {
      const Line& line = lines_[static_cast<std::size_t>(frame)];
      if (line.is_given && !is_at_end(frame) && kinematics_->group(frame) == group)
        goals.add({.frame = frame, .point = line.at});
    }
    for (int i = 0; i < kApproaches; ++i) kinematics_->approach(goals.all(), path_);
  }
  path_rates_ = (path_ - path_rates_) / period_;
  for (int frame = 0; frame < frames_; ++frame) {
    if (!lines_[static_cast<std::size_t>(frame)].is_given || !is_at_end(frame)) continue;
    for (int i = 0; i < joints_; ++i) {
      if (!kinematics_->moves(i, frame)) continue;
      path_[i] = state_.target[i];
      path_rates_[i] = 0.0;
    }
  }
}

// Moves the point of a line by one step.
void GuideController::advance_line(int frame) noexcept {
  Line& line = lines_[static_cast<std::size_t>(frame)];
  if (!line.is_given) return;
  double lag = 0.0;
  for (int i = 0; i < joints_; ++i) {
    if (kinematics_->moves(i, frame))
      lag = std::max(lag, std::abs(path_[i] - state_.reference[i]) / radian(i));
  }
  if (lag > kMaxLag) {
    line.speed = 0.0;
    return;
  }
  const Eigen::Vector3d point = kinematics_->point(frame, path_);
  if ((point - line.at).norm() > kMaxGap) {
    // The line goes on from where the frame really is. Otherwise, the frame would not follow when
    // somebody leads it back. If the target is known, the joints go there without a line.
    line.at = line.is_found ? line.end : point;
  }
  const Eigen::Vector3d displacement = line.end - line.at;
  const double distance = displacement.stableNorm();
  const double change = kArm * speeds_.joint_acceleration * period_;
  if (distance <= kSamePoint) {
    line.at = line.end;
    line.speed = 0.0;
    return;
  }
  const Eigen::Vector3d along = displacement.stableNormalized();
  // Around a corner only the part of the speed remains that points in the new direction.
  line.speed *= std::max(0.0, line.along.dot(along));
  line.along = along;
  const double wanted = std::min(speeds_.tip_speed, stoppable_speed(distance, change, period_));
  line.speed = std::clamp(wanted, line.speed - change, line.speed + change);
  line.at += along * std::min(line.speed * period_, distance);
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
  const double max_lead = speeds_.max_lead * radian(joint);
  const double lead = std::clamp(next, measured - max_lead, measured + max_lead);
  is_held_back_[static_cast<std::size_t>(joint)] = lead != next;
  next = std::clamp(lead, reference - most, reference + most);
  // Nothing leads beyond a soft limit, or further beyond it.
  next = std::clamp(next, std::min(limit(joint).soft_lower, reference),
                    std::max(limit(joint).soft_upper, reference));
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
  kinematics_->weight(command_.torque);
  for (int i = 0; i < joints_; ++i) {
    const double slides = std::tanh(velocity_[i] / (kSlidingSpeed * radian(i)));
    command_.torque[i] +=
        kinematics_->damping(i) * velocity_[i] + kinematics_->friction(i) * slides;
  }
  command_.position.setConstant(joints_, kNotGiven);
}

void GuideController::command_reference() noexcept {
  kinematics_->weight(command_.torque);
  for (int i = 0; i < joints_; ++i) {
    const bool is_led = is_led_[static_cast<std::size_t>(i)];
    advance(i, is_led ? path_[i] : state_.target[i], is_led ? path_rates_[i] : 0.0);
    // Everything that damps the joint would otherwise hold it back on its way.
    const double damping = limit(i).default_kd + limit(i).safety_kd + kinematics_->damping(i);
    command_.torque[i] += damping * reference_velocity_[i];
  }
  command_.position = state_.reference;
}

void GuideController::find_arrival() noexcept {
  const double distance = robot_.refuses_torques ? speeds_.max_lead : kArrivalDistance;
  bool is_near = true;
  bool is_slow = true;
  for (int i = 0; i < joints_; ++i) {
    is_near = is_near && std::abs(state_.measured[i] - state_.target[i]) <= distance * radian(i);
    is_slow = is_slow && std::abs(velocity_[i]) <= kArrivalSpeed * radian(i);
  }
  rest_time_ = is_slow ? rest_time_ + period_ : 0.0;
  state_.has_arrived = state_.mode != Mode::kFloat && state_.reference == state_.target &&
                       reference_velocity_.isZero(0.0) && is_near && is_slow &&
                       (!robot_.refuses_torques || rest_time_ >= kRestTime);
  for (const Line& line : lines_)
    state_.has_arrived = state_.has_arrived && (!line.is_given || line.is_at_end());
}

void GuideController::find_frames() noexcept {
  kinematics_->points(state_.measured, state_.measured_frames);
  kinematics_->points(state_.reference, state_.reference_frames);
  kinematics_->points(state_.target, state_.target_frames);
}

}  // namespace trifinger::guiding
