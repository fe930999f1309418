// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/pose_estimator.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using detail::require_positive;

constexpr Seconds kNever{-std::numeric_limits<double>::infinity()};

}  // namespace

PoseEstimator::PoseEstimator(double bandwidth)
    : angular_frequency_(2 * std::numbers::pi * bandwidth), time_(kNever) {
  require_positive("bandwidth", bandwidth);
}

bool PoseEstimator::update(Seconds time, const Pose& pose, const Motion& known) noexcept {
  if (!(time > time_) || !std::isfinite(time.count()) || !pose.position.allFinite() ||
      !pose.orientation.coeffs().allFinite()) {
    return false;
  }
  const Pose measured{pose.position - known.pose.position,
                      (pose.orientation * known.pose.orientation.conjugate()).normalized()};
  if (time_ == kNever) {
    deviation_ = measured;
  } else {
    const Seconds elapsed = time - time_;
    deviation_ = moved(deviation_, rate_, elapsed);
    const Twist error{measured.position - deviation_.position,
                      rotation_error(measured.orientation, deviation_.orientation)};
    // Gains that put both poles of the filter at `forgotten`.
    const double forgotten = std::exp(-angular_frequency_ * elapsed.count());
    const double gain = 1 - forgotten * forgotten;
    const double rate_gain = (1 - forgotten) * (1 - forgotten) / elapsed.count();
    deviation_ = moved(deviation_, error, Seconds(gain));
    rate_.linear += rate_gain * error.linear;
    rate_.angular += rate_gain * error.angular;
  }
  time_ = time;
  return true;
}

Motion PoseEstimator::predict(Seconds time, const Motion& known) const noexcept {
  if (time_ == kNever) return known;
  const Pose deviation = moved(deviation_, rate_, time - time_);
  return {.pose = {known.pose.position + deviation.position,
                   deviation.orientation * known.pose.orientation},
          .twist = {known.twist.linear + rate_.linear,
                    rate_.angular + deviation.orientation * known.twist.angular},
          .acceleration = {known.acceleration.linear,
                           deviation.orientation * known.acceleration.angular}};
}

void PoseEstimator::reset() noexcept {
  time_ = kNever;
  deviation_ = {};
  rate_ = {};
}

}  // namespace trifinger::control
