// SPDX-License-Identifier: BSD-3-Clause
#include "control/filters.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "trifinger/base/error.hpp"

namespace trifinger::control {

using detail::require_positive;

LowPassFilter::LowPassFilter(double cutoff_frequency)
    : angular_frequency_(2 * std::numbers::pi * cutoff_frequency) {
  require_positive("cutoff_frequency", cutoff_frequency);
}

const Signal& LowPassFilter::update(const Signal& sample, Seconds elapsed) noexcept {
  if (sample.size() != value_.size()) {
    value_ = sample;
  } else {
    // Share of the old value that remains after `elapsed`, however long that is.
    const double kept = std::exp(-angular_frequency_ * std::max(0.0, elapsed.count()));
    value_ = sample + kept * (value_ - sample);
  }
  return value_;
}

Derivative::Derivative(double cutoff_frequency) : rate_(cutoff_frequency) {}

const Signal& Derivative::update(const Signal& sample, Seconds elapsed) noexcept {
  if (sample.size() != last_sample_.size()) {
    last_sample_ = sample;
    return rate_.update(Signal::Zero(sample.size()), elapsed);
  }
  if (elapsed.count() > 0.0) {
    rate_.update((sample - last_sample_) / elapsed.count(), elapsed);
    last_sample_ = sample;
  }
  return rate_.value();
}

void Derivative::reset() noexcept {
  rate_.reset();
  last_sample_.resize(0);
}

}  // namespace trifinger::control
