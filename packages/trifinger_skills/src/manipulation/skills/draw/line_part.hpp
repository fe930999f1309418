// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "manipulation/skills/draw/drawing.hpp"
#include "trifinger/control/motion.hpp"

namespace trifinger::manipulation {

// Where a nib is on a line.
struct NibMotion {
  Eigen::Vector2d position{Eigen::Vector2d::Zero()};
  Eigen::Vector2d velocity{Eigen::Vector2d::Zero()};
  Eigen::Vector2d acceleration{Eigen::Vector2d::Zero()};
};

// A smooth part of a stroke, from rest to rest: constant speed between two ramps of least jerk.
class LinePart {
 public:
  LinePart(PenStroke points, double speed, control::Seconds ramp);

  [[nodiscard]] control::Seconds duration() const noexcept { return duration_; }
  [[nodiscard]] NibMotion at(control::Seconds time) const noexcept;

 private:
  PenStroke points_;
  std::vector<double> lengths_;  // From the beginning to each point.
  double speed_;
  control::Seconds ramp_;
  control::Seconds duration_;
};

// A stroke as its smooth parts: the nib rests at sharp corners.
[[nodiscard]] std::vector<LinePart> parts_of(const PenStroke& stroke, double speed,
                                             control::Seconds ramp);

}  // namespace trifinger::manipulation
