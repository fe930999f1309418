// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "trifinger/base/random.hpp"

namespace trifinger::learning {

/// Noise for exploration that motors like: its power falls with the frequency f about as
/// 1 / f^color. 0 is white noise, 1 is pink noise (Eberhard et al. 2023, "Pink noise is all you
/// need"), and 2 is nearly red noise. Each number is normal with a standard deviation of 1.
///
/// It is a sum of first-order autoregressive processes, each half as fast as the one before, so it
/// does not need to know how long an episode is. Below a hundredth of the rate of the actions it is
/// white.
class ColoredNoise {
 public:
  /// For actions of `size` numbers.
  explicit ColoredNoise(std::size_t size);

  /// Begins anew. The same numbers give the same noise.
  void begin(std::uint64_t seed, std::uint64_t episode) noexcept;

  /// Goes on by one action. `color` is from 0 to 2 and may differ from call to call.
  void advance(double color) noexcept;
  /// The noise of number `i` of the action.
  [[nodiscard]] double operator[](std::size_t i) const noexcept { return value_[i]; }

 private:
  static constexpr std::size_t kOctaves = 8;

  Random random_;
  std::vector<std::array<double, kOctaves>> parts_;
  std::vector<double> value_;
};

}  // namespace trifinger::learning
