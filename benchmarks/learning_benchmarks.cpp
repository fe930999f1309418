// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <Eigen/Core>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <vector>

#include "harness.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/learning/policy.hpp"
#include "trifinger/learning/random.hpp"

namespace trifinger::benchmarks {
namespace {

using Clock = std::chrono::steady_clock;
using namespace learning;

// Positions and velocities of nine joints, the goals of three tips and the last action; nine
// torques. The widths between are Stable-Baselines3's for SAC.
constexpr std::array<Eigen::Index, 4> kWidths{36, 256, 256, 9};
constexpr int kCalls = 2000;

Network network() {
  Random random{.seed = 1};
  const auto numbers = [&](Eigen::Index rows, Eigen::Index columns) {
    const double deviation = std::sqrt(2.0 / static_cast<double>(columns));
    return Eigen::MatrixXf(Eigen::MatrixXf::NullaryExpr(rows, columns, [&](Eigen::Index) {
      return static_cast<float>(deviation * random.normal());
    }));
  };
  Network network;
  for (std::size_t i = 0; i + 1 < kWidths.size(); ++i) {
    network.layers.push_back(
        {.weights = numbers(kWidths[i + 1], kWidths[i]),
         .bias = numbers(kWidths[i + 1], 1),
         .activation = i + 2 < kWidths.size() ? Activation::kRelu : Activation::kTanh});
  }
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(kWidths[0]);
  network.normalization = {.mean = 0.1 * ones, .variance = 2.0 * ones};
  const Eigen::VectorXd torque = Eigen::VectorXd::Constant(kWidths.back(), 0.36);  // [Nm]
  network.bounds = {.low = -torque, .high = torque};
  return network;
}

double microseconds(Clock::duration time) {
  return std::chrono::duration<double, std::micro>(time).count();
}

}  // namespace

std::vector<Row> learning_rows(const Effort& effort) {
  const Network made_of = network();
  Policy policy(made_of);
  Random random{.seed = 2};
  std::vector<double> observation(policy.num_inputs());
  std::vector<double> action(policy.num_outputs());
  std::size_t allocations = 0;
  double sum = 0;  // Looked at, so that no compiler leaves out what made it.
  bool is_done = true;
  const auto inference = [&] {
    Samples times;
    for (int i = 0; i < kCalls; ++i) {
      for (double& number : observation) number = random.normal();
      const test::AllocationCounter counter;
      const auto begin = Clock::now();
      is_done = policy.evaluate(observation, action) && is_done;
      const auto end = Clock::now();
      allocations += counter.count();
      times.add(microseconds(end - begin));
      sum += action[0];
    }
    return times.median();
  };
  // Neither double precision, nor activations, nor any other work on the numbers.
  std::array<Eigen::VectorXf, kWidths.size()> values;
  for (std::size_t i = 0; i < kWidths.size(); ++i) values[i].setZero(kWidths[i]);
  const auto products = [&] {
    Samples times;
    for (int i = 0; i < kCalls; ++i) {
      for (float& number : values[0]) number = static_cast<float>(random.normal());
      const auto begin = Clock::now();
      for (std::size_t k = 0; k < made_of.layers.size(); ++k) {
        values[k + 1].noalias() = made_of.layers[k].weights * values[k];
      }
      times.add(microseconds(Clock::now() - begin));
      sum += static_cast<double>(values.back()[0]);
    }
    return times.median();
  };
  const Paired paired = alternate(effort.rounds, inference, products);
  Row row = make_row(
      "C++ policy inference, 2 x 256 MLP: p50", "us", paired,
      "bare Eigen products of the same matrices, single precision", "<= 20 us, 0 allocations",
      paired.measure.median() <= 20.0 && allocations == 0 && is_done && std::isfinite(sum));
  row.remark = fmt::format("{} allocations", allocations);
  return {row};
}

}  // namespace trifinger::benchmarks
