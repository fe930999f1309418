// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/policy.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "random_networks.hpp"

namespace trifinger::learning {
namespace {

using test::random_network;
using test::random_observation;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Computes what the header describes, number by number, independently of the implementation.
std::vector<double> recomputed(const Network& network, std::vector<double> values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (network.normalization) {
      const InputNormalization& normalization = *network.normalization;
      const auto k = static_cast<Eigen::Index>(i);
      values[i] = (values[i] - normalization.mean[k]) /
                  std::sqrt(normalization.variance[k] + normalization.epsilon);
      values[i] = std::min(std::max(values[i], -normalization.clip), normalization.clip);
    }
    values[i] = static_cast<double>(static_cast<float>(values[i]));
  }
  for (const Layer& layer : network.layers) {
    std::vector<double> outputs;
    for (Eigen::Index row = 0; row < layer.weights.rows(); ++row) {
      auto output = static_cast<double>(layer.bias[row]);
      for (std::size_t i = 0; i < values.size(); ++i) {
        output += static_cast<double>(layer.weights(row, static_cast<Eigen::Index>(i))) * values[i];
      }
      if (layer.activation == Activation::kRelu && output < 0) output = 0;
      if (layer.activation == Activation::kTanh) output = std::tanh(output);
      if (layer.activation == Activation::kElu && output < 0) output = std::expm1(output);
      outputs.push_back(output);
    }
    values = outputs;
  }
  for (std::size_t i = 0; i < values.size() && network.bounds; ++i) {
    const double low = network.bounds->low[static_cast<Eigen::Index>(i)];
    const double high = network.bounds->high[static_cast<Eigen::Index>(i)];
    if (network.bounds->bounding == Bounding::kScale) {
      const double inside = std::min(std::max(values[i], -1.0), 1.0);
      values[i] = low + (inside + 1) / 2 * (high - low);
    }
    values[i] = std::min(std::max(values[i], low), high);
  }
  return values;
}

// Returns how far an evaluation in single precision may be from one in double precision: the
// rounding of each sum, in any order, and what the layers make of earlier differences.
std::vector<double> bound_of_deviation(const Network& network,
                                       const std::vector<double>& observation) {
  constexpr double kUnit = 0x1p-24;  // of rounding to single precision
  Network unbounded = network;
  unbounded.bounds.reset();
  unbounded.layers.clear();
  std::vector<double> deviations(observation.size(), 0.0);
  for (const Layer& layer : network.layers) {
    // The input of this layer: the result of the layers before it.
    const std::vector<double> inputs = recomputed(unbounded, observation);
    const auto terms = static_cast<double>(inputs.size() + 1);
    const double rounding = terms * kUnit / (1 - terms * kUnit);
    std::vector<double> outputs;
    for (Eigen::Index row = 0; row < layer.weights.rows(); ++row) {
      double size = std::abs(static_cast<double>(layer.bias[row]));
      double deviation = 0;
      for (std::size_t i = 0; i < inputs.size(); ++i) {
        const double weight =
            std::abs(static_cast<double>(layer.weights(row, static_cast<Eigen::Index>(i))));
        size += weight * (std::abs(inputs[i]) + deviations[i]);
        deviation += weight * deviations[i];
      }
      deviation += rounding * size;
      // No activation increases a difference. The exponential in tanh is rounded a few times.
      if (layer.activation == Activation::kTanh || layer.activation == Activation::kElu) {
        deviation += 4 * kUnit;
      }
      outputs.push_back(deviation);
    }
    deviations = outputs;
    unbounded.layers.push_back(layer);
  }
  if (network.bounds && network.bounds->bounding == Bounding::kScale) {
    for (std::size_t i = 0; i < deviations.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      deviations[i] *= (network.bounds->high[k] - network.bounds->low[k]) / 2;
    }
  }
  return deviations;
}

// Two layers with three inputs and two outputs.
Network small_network() {
  return {.layers = {{.weights = Eigen::MatrixXf::Constant(4, 3, 0.25F),
                      .bias = Eigen::VectorXf::Constant(4, 0.5F),
                      .activation = Activation::kRelu},
                     {.weights = Eigen::MatrixXf::Constant(2, 4, -0.125F),
                      .bias = Eigen::VectorXf::Constant(2, 1.0F),
                      .activation = Activation::kTanh}}};
}

TEST(Policy, ComputesNetworksOfEveryShape) {
  Random random{.seed = 1};
  for (int i = 0; i < 300; ++i) {
    const Network network = random_network(random);
    Policy policy(network);
    std::vector<double> action(policy.num_outputs());
    for (int k = 0; k < 5; ++k) {
      const std::vector<double> observation = random_observation(random, policy.num_inputs());
      ASSERT_TRUE(policy.evaluate(observation, action));
      EXPECT_THAT(action,
                  testing::Pointwise(testing::DoubleNear(1e-12), recomputed(network, observation)));
    }
  }
}

TEST(Policy, InSinglePrecisionDeviatesByItsRoundingAlone) {
  Random random{.seed = 5};
  double largest = 0;  // share of the allowed deviation
  bool differs = false;
  for (int i = 0; i < 300; ++i) {
    const Network network = random_network(random);
    Policy policy(network);
    Policy single(network, Precision::kSingle);
    EXPECT_EQ(single.precision(), Precision::kSingle);
    std::vector<double> action(policy.num_outputs());
    std::vector<double> single_action(policy.num_outputs());
    for (int k = 0; k < 5; ++k) {
      const std::vector<double> observation = random_observation(random, policy.num_inputs());
      ASSERT_TRUE(policy.evaluate(observation, action));
      ASSERT_TRUE(single.evaluate(observation, single_action));
      const std::vector<double> bound = bound_of_deviation(network, observation);
      for (std::size_t j = 0; j < action.size(); ++j) {
        const double deviation = std::abs(single_action[j] - action[j]);
        constexpr double kDouble = 1e-12;  // rounding of double precision
        EXPECT_LE(deviation, bound[j] + kDouble);
        largest = std::max(largest, deviation / (bound[j] + kDouble));
        differs = differs || deviation > 1e-10;
      }
    }
  }
  EXPECT_TRUE(differs);  // this proves that it was single precision
  RecordProperty("largest_share_of_the_bound", std::to_string(largest));
}

TEST(Policy, StaysWithinItsBoundsHoweverLargeTheObservation) {
  Random random{.seed = 4};
  for (int i = 0; i < 400; ++i) {
    Network network = random_network(random);
    const auto width = network.layers.back().bias.size();
    const auto low = test::random_numbers<Eigen::VectorXd>(random, width, 1);
    const Eigen::VectorXd high = low.array() + random.uniform(0, 1);
    network.bounds = {
        .low = low, .high = high, .bounding = i % 2 == 0 ? Bounding::kScale : Bounding::kClip};
    Policy policy(network, i < 200 ? Precision::kDouble : Precision::kSingle);
    std::vector<double> action(policy.num_outputs());
    for (const double scale : {0.0, 1.0, 1e3, 1e30}) {
      std::vector<double> observation = random_observation(random, policy.num_inputs());
      for (double& number : observation) number *= scale;
      ASSERT_TRUE(policy.evaluate(observation, action));
      for (Eigen::Index k = 0; k < width; ++k) {
        EXPECT_GE(action[static_cast<std::size_t>(k)], low[k]);
        EXPECT_LE(action[static_cast<std::size_t>(k)], high[k]);
      }
    }
  }
}

TEST(Policy, ReachesBothBoundsBySaturation) {
  Network network{.layers = {{.weights = Eigen::MatrixXf::Constant(1, 1, 100.0F),
                              .bias = Eigen::VectorXf::Zero(1),
                              .activation = Activation::kTanh}},
                  .bounds = OutputBounds{.low = Eigen::VectorXd::Constant(1, -0.36),
                                         .high = Eigen::VectorXd::Constant(1, 0.2)}};
  for (const Precision precision : {Precision::kDouble, Precision::kSingle}) {
    Policy policy(network, precision);
    std::vector<double> action(1);
    ASSERT_TRUE(policy.evaluate(std::vector{1e9}, action));
    EXPECT_EQ(action[0], 0.2);
    ASSERT_TRUE(policy.evaluate(std::vector{-1e9}, action));
    EXPECT_EQ(action[0], -0.36);
  }
}

TEST(Policy, GivesNoActionWithoutAWholeObservation) {
  Network network = small_network();
  for (const int kind : {0, 1, 2, 3}) {
    const bool is_normalized = kind / 2 == 1;
    if (is_normalized) {
      network.normalization = {.mean = Eigen::VectorXd::Zero(3),
                               .variance = Eigen::VectorXd::Ones(3)};
    }
    Policy policy(network, kind % 2 == 0 ? Precision::kDouble : Precision::kSingle);
    const std::vector<double> whole{1, 2, 3};
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const double bad : {kNan, kInfinity, -kInfinity}) {
        std::vector<double> observation = whole;
        observation[i] = bad;
        std::vector<double> action{7, 8};
        EXPECT_FALSE(policy.evaluate(observation, action)) << bad;
        EXPECT_THAT(action, testing::ElementsAre(7, 8));
      }
    }
    std::vector<double> action{7, 8};
    EXPECT_TRUE(policy.evaluate(whole, action));
    // A normalisation cuts off numbers that single precision cannot hold.
    EXPECT_EQ(policy.evaluate(std::vector{1.0, 2.0, 1e300}, action), is_normalized);
  }
}

TEST(Policy, GivesNoActionIfASizeIsNotItsOwn) {
  Policy policy(small_network());
  for (const std::size_t inputs : {std::size_t{0}, std::size_t{2}, std::size_t{4}}) {
    std::vector<double> action{7, 8};
    EXPECT_FALSE(policy.evaluate(std::vector<double>(inputs), action));
    EXPECT_THAT(action, testing::ElementsAre(7, 8));
  }
  for (const std::size_t outputs : {std::size_t{0}, std::size_t{1}, std::size_t{3}}) {
    std::vector<double> action(outputs, 7.0);
    EXPECT_FALSE(policy.evaluate(std::vector<double>(3), action));
    EXPECT_THAT(action, testing::Each(7));
  }
}

TEST(Policy, GivesNoActionWhereItsSumsOverflow) {
  Network network;
  for (int i = 0; i < 10; ++i) {
    network.layers.push_back({.weights = Eigen::MatrixXf::Constant(2, 2, 3e38F),
                              .bias = Eigen::VectorXf::Zero(2),
                              .activation = Activation::kRelu});
  }
  // Infinity - infinity: relu and tanh would turn the result into a number.
  network.layers.push_back({.weights = Eigen::MatrixXf{{1.0F, -1.0F}},
                            .bias = Eigen::VectorXf::Zero(1),
                            .activation = Activation::kTanh});
  for (const Precision precision : {Precision::kDouble, Precision::kSingle}) {
    Policy policy(network, precision);
    std::vector<double> action{7};
    EXPECT_FALSE(policy.evaluate(std::vector<double>{1e38, 1e38}, action));
    EXPECT_THAT(action, testing::ElementsAre(7));
    EXPECT_TRUE(policy.evaluate(std::vector<double>{-0.1, -0.1}, action));
  }
}

TEST(Policy, SharesNothingWithItsCopies) {
  Policy policy(small_network());
  Policy copy = policy;
  std::vector<double> first(2), second(2), third(2);
  ASSERT_TRUE(policy.evaluate(std::vector<double>{1, 2, 3}, first));
  ASSERT_TRUE(copy.evaluate(std::vector<double>{-9, 0, 5}, second));
  policy = copy;
  ASSERT_TRUE(policy.evaluate(std::vector<double>{1, 2, 3}, third));
  EXPECT_EQ(first, third);
}

struct Mistake {
  std::string name;
  std::function<void(Network&)> make;
  std::string said;
};

TEST(Policy, SaysWhatIsWrongWithANetwork) {
  const Eigen::VectorXd two = Eigen::VectorXd::Ones(2);
  const Eigen::VectorXd three = Eigen::VectorXd::Ones(3);
  const std::vector<Mistake> mistakes{
      {"none", [](Network& n) { n.layers.clear(); }, "at least one layer"},
      {"empty", [](Network& n) { n.layers[1].weights.resize(0, 4); }, "layer 1 has no weights"},
      {"gap", [](Network& n) { n.layers[1].weights.setZero(2, 5); },
       "layer 1 has 5 inputs, but the layer before it has 4 outputs"},
      {"bias", [](Network& n) { n.layers[0].bias.setZero(3); },
       "the bias of layer 0 has 3 numbers, must have 4"},
      {"weight", [](Network& n) { n.layers[0].weights(1, 2) = std::nanf(""); },
       "the weight matrix of layer 0 has a number that is not finite"},
      {"infinite bias", [](Network& n) { n.layers[1].bias[0] = HUGE_VALF; }, "the bias of layer 1"},
      {"relu", [](Network& n) { n.layers[1].activation = Activation::kRelu; },
       "the last layer's activation must be"},
      {"elu", [](Network& n) { n.layers[1].activation = Activation::kElu; },
       "the last layer's activation must be"},
      {"mean", [&](Network& n) { n.normalization = {.mean = two, .variance = three}; },
       "the mean of the inputs has 2 numbers, must have 3"},
      {"variance", [&](Network& n) { n.normalization = {.mean = three, .variance = -three}; },
       "the variance of an input is below 0"},
      {"nan variance",
       [&](Network& n) { n.normalization = {.mean = three, .variance = kNan * three}; },
       "the variance of the inputs has a number that is not finite"},
      {"clip", [&](Network& n) { n.normalization = {.mean = three, .variance = three, .clip = 0}; },
       "clip of the normalization"},
      {"epsilon",
       [&](Network& n) { n.normalization = {.mean = three, .variance = three, .epsilon = kNan}; },
       "epsilon of the normalization"},
      {"bounds", [&](Network& n) { n.bounds = {.low = three, .high = two}; },
       "the lower bound of the outputs has 3 numbers, must have 2"},
      {"crossed", [&](Network& n) { n.bounds = {.low = two, .high = -two}; },
       "output 0 is bounded by 1.000000 below and -1.000000 above"},
      {"wide", [&](Network& n) { n.bounds = {.low = -1e308 * two, .high = 1e308 * two}; },
       "output 0 is bounded"},
  };
  for (const Mistake& mistake : mistakes) {
    Network network = small_network();
    mistake.make(network);
    try {
      const Policy policy(network);
      ADD_FAILURE() << mistake.name << " was taken";
    } catch (const InvalidArgument& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(mistake.said)) << mistake.name;
    }
  }
}

}  // namespace
}  // namespace trifinger::learning
