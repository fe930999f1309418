// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/trajectories.hpp"

#include <cmath>
#include <numbers>
#include <string>

#include "line.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using detail::require_finite;
using detail::require_positive;

// Integral from 0 to `s` of a rate that rises by `minimum_jerk`; `s` is the share of the rise.
double rise(double s) { return s * s * s * s * (2.5 + s * (-3.0 + s)); }

void require_pose(const char* name, const Pose& pose) {
  require_finite(name, pose.position);
  require_finite(name, pose.orientation.coeffs());
  if (std::abs(pose.orientation.norm() - 1) > 1e-6)
    throw InvalidArgument(std::string(name) + " has an orientation that is not of unit length");
}

}  // namespace

Progress minimum_jerk(Seconds time, Seconds duration) noexcept {
  if (time >= duration) return {1.0, 0.0, 0.0};
  if (!(time.count() > 0.0)) return {0.0, 0.0, 0.0};
  const double s = time / duration;
  const double left = 1 - s;
  return {s * s * s * (10 + s * (-15 + 6 * s)), 30 * s * s * left * left / duration.count(),
          60 * s * left * (left - s) / (duration.count() * duration.count())};
}

LineTrajectory::LineTrajectory(const Eigen::Vector3d& start, const Eigen::Vector3d& end,
                               Seconds duration)
    : start_(start), displacement_(end - start), duration_(duration) {
  require_finite("start", start);
  require_finite("end", end);
  require_positive("duration", duration.count());
}

PointMotion LineTrajectory::at(Seconds time) const noexcept {
  return on_line(start_, displacement_, minimum_jerk(time, duration_));
}

PoseTrajectory::PoseTrajectory(const Pose& start, const Pose& end, Seconds duration)
    : start_(start),
      displacement_(end.position - start.position),
      turn_(rotation_error(end.orientation, start.orientation)),
      duration_(duration) {
  require_pose("start", start);
  require_pose("end", end);
  require_positive("duration", duration.count());
}

Motion PoseTrajectory::at(Seconds time) const noexcept {
  const Progress progress = minimum_jerk(time, duration_);
  return {.pose = {start_.position + progress.value * displacement_,
                   rotation_from_vector(progress.value * turn_) * start_.orientation},
          .twist = {progress.rate * displacement_, progress.rate * turn_},
          .acceleration = {progress.acceleration * displacement_, progress.acceleration * turn_}};
}

PoseSequence::PoseSequence(const PoseTrajectory& trajectory) { add(trajectory); }

void PoseSequence::add(const PoseTrajectory& trajectory) {
  if (count_ == kMaxTrajectories)
    throw InvalidArgument("a sequence has at most " + std::to_string(kMaxTrajectories) +
                          " trajectories");
  trajectories_[count_++] = trajectory;
}

Seconds PoseSequence::duration() const noexcept {
  Seconds sum{0};
  for (std::size_t i = 0; i < count_; ++i) sum += trajectories_[i]->duration();
  return sum;
}

Motion PoseSequence::at(Seconds time) const noexcept {
  std::size_t i = 0;
  for (; i + 1 < count_ && time >= trajectories_[i]->duration(); ++i)
    time -= trajectories_[i]->duration();
  return trajectories_[i]->at(time);
}

CircleTrajectory::CircleTrajectory(const CircleConfig& config) : config_(config) {
  require_finite("centre", config.centre);
  require_positive("radius", config.radius);
  require_positive("period", config.period.count());
  require_positive("ramp_time", config.ramp_time.count());
  require_positive("the size of turns", std::abs(config.turns));
  if (!std::isfinite(config.start_angle)) throw InvalidArgument("start_angle is not finite");
  if (std::abs(config.turns) * config.period < config.ramp_time) {
    throw InvalidArgument("ramp_time is " + std::to_string(config.ramp_time.count()) +
                          " s, must be at most |turns| * period, " +
                          std::to_string(std::abs(config.turns) * config.period.count()) + " s");
  }
}

Seconds CircleTrajectory::duration() const noexcept {
  return std::abs(config_.turns) * config_.period + config_.ramp_time;
}

PointMotion CircleTrajectory::at(Seconds time) const noexcept {
  // The trajectory to rest is the one from rest, reversed in time.
  const bool is_second_half = time > duration() / 2;
  const Seconds since_rest = is_second_half ? duration() - time : time;
  const Progress ramp = minimum_jerk(since_rest, config_.ramp_time);
  const double ramp_time = config_.ramp_time.count();
  // Distance covered so far, as the time that full speed would take for it [s].
  double carried = 0.0;
  if (since_rest >= config_.ramp_time) {
    carried = since_rest.count() - ramp_time / 2;
  } else if (since_rest.count() > 0.0) {
    carried = ramp_time * rise(since_rest / config_.ramp_time);
  }
  if (is_second_half) carried = (duration() - config_.ramp_time).count() - carried;

  const double speed = std::copysign(2 * std::numbers::pi / config_.period.count(), config_.turns);
  const double angle = config_.start_angle + speed * carried;
  const double rate = speed * ramp.value;
  const double acceleration = (is_second_half ? -speed : speed) * ramp.rate;
  const Eigen::Vector3d out(std::cos(angle), std::sin(angle), 0.0);
  const Eigen::Vector3d along(-out.y(), out.x(), 0.0);
  return {config_.centre + config_.radius * out, config_.radius * rate * along,
          config_.radius * (acceleration * along - rate * rate * out)};
}

}  // namespace trifinger::control
