// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "trifinger/control/motion.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::control {

/// Up to nine numbers that are measured together. They are stored in place, never on the heap.
using Signal = JointValues;

/// A first-order low-pass for up to nine numbers. Samples may come at uneven intervals.
class LowPassFilter {
 public:
  /// `cutoff_frequency` is the frequency at which half of the power is left [Hz].
  /// @throws InvalidArgument if it is not above zero.
  explicit LowPassFilter(double cutoff_frequency);

  /// Takes the next sample, `elapsed` [s] after the previous one, and returns the filtered signal.
  /// The first sample passes unchanged. A sample with another number of values passes unchanged,
  /// too.
  const Signal& update(const Signal& sample, Seconds elapsed) noexcept;

  /// The filtered signal. It has no numbers before the first sample.
  [[nodiscard]] const Signal& value() const noexcept { return value_; }

  /// Treats the next sample as the first one.
  void reset() noexcept { value_.resize(0); }

 private:
  double angular_frequency_;
  Signal value_;
};

/// The rate at which up to nine numbers change, low-pass filtered.
class Derivative {
 public:
  /// @throws InvalidArgument if `cutoff_frequency` [Hz] is not above zero.
  explicit Derivative(double cutoff_frequency);

  /// Takes the next sample, `elapsed` [s] after the previous one, and returns the rate [1/s]. The
  /// rate of the first sample is zero. A sample with no time since the previous one changes
  /// nothing.
  const Signal& update(const Signal& sample, Seconds elapsed) noexcept;

  /// Treats the next sample as the first one.
  void reset() noexcept;

 private:
  LowPassFilter rate_;
  Signal last_sample_;
};

}  // namespace trifinger::control
