// SPDX-License-Identifier: BSD-3-Clause
#include "rollout_weights.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "trifinger/control/predictive_planner.hpp"

namespace trifinger::control {
namespace {

constexpr double kNoCost = std::numeric_limits<double>::infinity();

}  // namespace

double median_of(std::span<const double> costs, std::span<double> scratch) noexcept {
  const auto end = std::ranges::copy_if(costs, scratch.begin(), [](double cost) {
                     return std::isfinite(cost);
                   }).out;
  if (end == scratch.begin()) return kNoCost;
  const auto middle = scratch.begin() + (end - scratch.begin()) / 2;
  std::nth_element(scratch.begin(), middle, end);
  return *middle;
}

void path_integral_weights(std::span<const double> costs, double temperature,
                           std::span<double> weights) noexcept {
  double least = kNoCost;
  for (const double cost : costs) {
    if (std::isfinite(cost)) least = std::min(least, cost);
  }
  // If half of the rollouts are equally good, only these count.
  const double scale = temperature * (median_of(costs, weights) - least);
  double sum = 0.0;
  for (std::size_t i = 0; i < costs.size(); ++i) {
    weights[i] = 0.0;
    if (!std::isfinite(costs[i])) continue;
    if (costs[i] == least) {
      weights[i] = 1.0;
    } else if (scale > 0.0) {
      weights[i] = std::exp(-(costs[i] - least) / scale);
    }
    sum += weights[i];
  }
  if (sum == 0.0) return;
  for (double& weight : weights) weight /= sum;
}

void elite_weights(std::span<const double> costs, int count, std::span<double> weights) noexcept {
  std::ranges::fill(weights, 0.0);
  int found = 0;
  for (; found < count; ++found) {
    std::size_t best = costs.size();
    for (std::size_t i = 0; i < costs.size(); ++i) {
      if (weights[i] != 0.0 || !std::isfinite(costs[i])) continue;
      if (best == costs.size() || costs[i] < costs[best]) best = i;
    }
    if (best == costs.size()) break;
    weights[best] = 1.0;
  }
  if (found == 0) return;
  for (double& weight : weights) weight /= found;
}

}  // namespace trifinger::control
