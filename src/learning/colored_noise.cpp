// SPDX-License-Identifier: BSD-3-Clause
#include "learning/colored_noise.hpp"

#include <cmath>

namespace trifinger::learning {

ColoredNoise::ColoredNoise(std::size_t size) : parts_(size), value_(size) { begin(0, 0); }

void ColoredNoise::begin(std::uint64_t seed, std::uint64_t episode) noexcept {
  constexpr std::uint64_t kOther = 0x9e3779b97f4a7c15;  // not the numbers of the episode's start
  random_ = {.seed = seed ^ kOther, .episode = episode};
  for (auto& octaves : parts_) {
    for (double& part : octaves) part = random_.normal();
  }
}

void ColoredNoise::advance(double color) noexcept {
  std::array<double, kOctaves> share{1.0};  // of the variance
  double sum = 1.0;
  for (std::size_t octave = 1; octave < kOctaves && color > 0.0; ++octave) {
    share[octave] = std::exp2(static_cast<double>(octave) * (color - 1.0));
    sum += share[octave];
  }
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    value_[i] = 0.0;
    for (std::size_t octave = 0; octave < kOctaves; ++octave) {
      // The first part is white; the next ones forget within 1, 2, 4, ... actions.
      const double kept =
          octave == 0 ? 0.0 : std::exp(-std::exp2(1.0 - static_cast<double>(octave)));
      double& part = parts_[i][octave];
      part = kept * part + std::sqrt(1.0 - kept * kept) * random_.normal();
      value_[i] += std::sqrt(share[octave] / sum) * part;
    }
  }
}

}  // namespace trifinger::learning
