// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>

#include "trifinger/control/motion.hpp"

namespace trifinger::control {

/// The flight of a body that gravity alone moves, from positions seen at known times. Air is left
/// out: in half a second it takes less than 5 mm from a ball of 20 g and 50 mm at 3 m/s.
///
/// The positions `p_i` at times `t_i` fit best, in the sense of least squares, with
///
///     p(t) = p0 + v0 (t - t0) + g (t - t0)^2 / 2
///
/// where only `p0` and `v0` are unknown. If the newest positions do not fit so well together, the
/// oldest ones are forgotten until they do: they were seen before the flight began.
class BallisticEstimator {
 public:
  /// `tolerance` is the root mean square of the distances from the flight that still fits [m].
  /// @throws InvalidArgument if it is not above zero.
  explicit BallisticEstimator(double tolerance = 0.004);

  /// Takes the position at which the body was at `time`. Times must grow; others are ignored.
  void add(Seconds time, const Eigen::Vector3d& position) noexcept;
  /// Forgets all positions.
  void reset() noexcept { count_ = 0; }

  /// Number of positions that fit together.
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  /// Time from the oldest of them to the newest.
  [[nodiscard]] Seconds span() const noexcept;
  /// Time of the newest position. Only if there is one.
  [[nodiscard]] Seconds newest() const noexcept { return sample(count_ - 1).time; }

  /// The motion at `time`. Of a single position, the body is taken to begin its fall there. Only if
  /// there is a position.
  [[nodiscard]] PointMotion at(Seconds time) const noexcept;
  /// When the body falls through a height [m], if it gets so high.
  [[nodiscard]] std::optional<Seconds> falls_through(double height) const noexcept;

 private:
  struct Sample {
    Seconds time{0};
    Eigen::Vector3d position{Eigen::Vector3d::Zero()};
  };
  [[nodiscard]] const Sample& sample(std::size_t i) const noexcept {
    return samples_[(begin_ + i) % samples_.size()];
  }
  [[nodiscard]] double fit() noexcept;

  double tolerance_;
  std::array<Sample, 64> samples_{};
  std::size_t begin_{0};
  std::size_t count_{0};
  // The flight that fits, at the mean of the times.
  Seconds middle_{0};
  Eigen::Vector3d position_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d velocity_{Eigen::Vector3d::Zero()};
};

}  // namespace trifinger::control
