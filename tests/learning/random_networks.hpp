// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/learning/policy.hpp"

namespace trifinger::learning::test {

/// Returns numbers around zero.
template <class Vector>
Vector random_numbers(Random& random, Eigen::Index count, double deviation) {
  return Vector::NullaryExpr(count, [&](Eigen::Index) {
    return static_cast<typename Vector::Scalar>(deviation * random.normal());
  });
}

/// Returns a network of any shape, with or without the optional parts.
inline Network random_network(Random& random) {
  Network network;
  auto width = random.integer(1, 40);
  const auto inputs = width;
  const auto depth = random.integer(1, 6);
  for (std::int64_t i = 0; i < depth; ++i) {
    const auto outputs = random.integer(1, random.integer(0, 5) == 0 ? 300 : 40);
    const double deviation = 1 / std::sqrt(static_cast<double>(width));
    const auto weights = random_numbers<Eigen::VectorXf>(random, outputs * width, deviation);
    // The last layer is identity or tanh.
    auto activation = static_cast<Activation>(random.integer(0, 4));
    if (i + 1 == depth && activation != Activation::kIdentity) activation = Activation::kTanh;
    network.layers.push_back({.weights = weights.reshaped(outputs, width),
                              .bias = random_numbers<Eigen::VectorXf>(random, outputs, 0.3),
                              .activation = activation});
    width = outputs;
  }
  if (random.integer(0, 2) == 0) {
    network.normalization = {
        .mean = random_numbers<Eigen::VectorXd>(random, inputs, 3),
        .variance = random_numbers<Eigen::VectorXd>(random, inputs, 2).cwiseAbs2(),
        .clip = random.uniform(1, 10)};
  }
  if (random.integer(0, 2) == 0) {
    const auto low = random_numbers<Eigen::VectorXd>(random, width, 1);
    network.bounds = {.low = low,
                      .high = low + random_numbers<Eigen::VectorXd>(random, width, 1).cwiseAbs(),
                      .bounding = random.integer(0, 2) == 0 ? Bounding::kScale : Bounding::kClip};
  }
  return network;
}

/// Returns a random input, including numbers that are cut off.
inline std::vector<double> random_observation(Random& random, std::size_t size) {
  std::vector<double> observation(size);
  for (double& number : observation) number = 3 * random.normal();
  return observation;
}

}  // namespace trifinger::learning::test
