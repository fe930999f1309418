// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/policy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "onnx/network.hpp"
#include "policy_file.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::require_finite;
using trifinger::detail::require_positive;

void require_size(const std::string& what, Eigen::Index found, Eigen::Index wanted) {
  if (found == wanted) return;
  throw InvalidArgument(what + " has " + std::to_string(found) + " numbers, must have " +
                        std::to_string(wanted));
}

void check(const Layer& layer, const std::string& name) {
  if (layer.weights.size() == 0) throw InvalidArgument(name + " has no weights");
  require_size("the bias of " + name, layer.bias.size(), layer.weights.rows());
  require_finite("the weight matrix of " + name, layer.weights);
  require_finite("the bias of " + name, layer.bias);
}

void check(const InputNormalization& normalization, Eigen::Index num_inputs) {
  require_size("the mean of the inputs", normalization.mean.size(), num_inputs);
  require_size("the variance of the inputs", normalization.variance.size(), num_inputs);
  require_finite("the mean of the inputs", normalization.mean);
  require_finite("the variance of the inputs", normalization.variance);
  require_positive("epsilon of the normalization", normalization.epsilon);
  require_positive("clip of the normalization", normalization.clip);
  if (normalization.variance.minCoeff() < 0.0) {
    throw InvalidArgument("the variance of an input is below 0");
  }
}

void check(const OutputBounds& bounds, Eigen::Index num_outputs) {
  require_size("the lower bound of the outputs", bounds.low.size(), num_outputs);
  require_size("the upper bound of the outputs", bounds.high.size(), num_outputs);
  require_finite("the lower bound of the outputs", bounds.low);
  require_finite("the upper bound of the outputs", bounds.high);
  for (Eigen::Index i = 0; i < num_outputs; ++i) {
    const double range = bounds.high[i] - bounds.low[i];
    if (range >= 0.0 && std::isfinite(range)) continue;
    throw InvalidArgument("output " + std::to_string(i) + " is bounded by " +
                          std::to_string(bounds.low[i]) + " below and " +
                          std::to_string(bounds.high[i]) + " above");
  }
}

Network checked(Network network) {
  if (network.layers.empty()) throw InvalidArgument("a policy needs at least one layer");
  Eigen::Index width = network.layers.front().weights.cols();
  for (std::size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    const std::string name = "layer " + std::to_string(i);
    check(layer, name);
    if (layer.weights.cols() != width) {
      throw InvalidArgument(name + " has " + std::to_string(layer.weights.cols()) +
                            " inputs, but the layer before it has " + std::to_string(width) +
                            " outputs");
    }
    width = layer.weights.rows();
  }
  const Activation last = network.layers.back().activation;
  if (last != Activation::kIdentity && last != Activation::kTanh) {
    throw InvalidArgument("the last layer's activation must be identity or tanh");
  }
  if (network.normalization) {
    check(*network.normalization, network.layers.front().weights.cols());
  }
  if (network.bounds) check(*network.bounds, width);
  return network;
}

// Computes output = weights * input + bias. Takes four columns at once, because otherwise loading
// and storing `output` would take most of the time.
void apply_affine(const Layer& layer, const double* input, double* output) noexcept {
  const Eigen::Index rows = layer.weights.rows();
  const Eigen::Index columns = layer.weights.cols();
  const float* const bias = layer.bias.data();
  for (Eigen::Index i = 0; i < rows; ++i) output[i] = static_cast<double>(bias[i]);
  Eigen::Index column = 0;
  for (; column + 4 <= columns; column += 4) {
    const float* const first = layer.weights.data() + column * rows;
    const float* const second = first + rows;
    const float* const third = second + rows;
    const float* const fourth = third + rows;
    const double a = input[column];
    const double b = input[column + 1];
    const double c = input[column + 2];
    const double d = input[column + 3];
    for (Eigen::Index i = 0; i < rows; ++i) {
      output[i] += (static_cast<double>(first[i]) * a + static_cast<double>(second[i]) * b) +
                   (static_cast<double>(third[i]) * c + static_cast<double>(fourth[i]) * d);
    }
  }
  for (; column < columns; ++column) {
    const float* const weights = layer.weights.data() + column * rows;
    const double a = input[column];
    for (Eigen::Index i = 0; i < rows; ++i) output[i] += static_cast<double>(weights[i]) * a;
  }
}

// Computes output = weights * input + bias in single precision. Eigen, too, sums four columns at
// once.
void apply_affine(const Layer& layer, const float* input, float* output) noexcept {
  Eigen::Map<Eigen::VectorXf> sums(output, layer.weights.rows());
  sums = layer.bias;
  sums.noalias() += layer.weights * Eigen::Map<const Eigen::VectorXf>(input, layer.weights.cols());
}

template <class Number>
void apply(Activation activation, Eigen::Map<Eigen::ArrayX<Number>> values) noexcept {
  constexpr Number kOne{1};
  constexpr Number kTwo{2};
  switch (activation) {
    case Activation::kIdentity:
      break;
    case Activation::kRelu:
      values = values.max(Number{0});
      break;
    case Activation::kTanh:
      // Eigen computes several exponentials at once. std::tanh would take longer than the sums.
      values = kOne - kTwo / ((kTwo * values).exp() + kOne);
      break;
    case Activation::kElu:
      values = values.max(Number{0}) + values.min(Number{0}).exp() - kOne;
      break;
  }
}

template <class Activities>
void make_room(Activities& activities, const std::vector<Layer>& layers) {
  Eigen::Index largest = 0;
  for (const Layer& layer : layers) {
    largest = std::max({largest, layer.weights.rows(), layer.weights.cols()});
  }
  for (auto& values : activities) values.setZero(largest);
}

}  // namespace

Policy::Policy(Network network, Precision precision)
    : network_(checked(std::move(network))), precision_(precision) {
  if (precision_ == Precision::kSingle) {
    make_room(single_activities_, network_.layers);
  } else {
    make_room(activities_, network_.layers);
  }
  if (network_.normalization) {
    const InputNormalization& normalization = *network_.normalization;
    input_scale_ = (normalization.variance.array() + normalization.epsilon).sqrt().inverse();
  }
}

struct Policy::Onnx {
  onnx::Network network;
};

Policy::Policy(std::unique_ptr<Onnx> onnx, std::map<std::string, std::string> metadata)
    : network_{.metadata = std::move(metadata)},
      onnx_(std::move(onnx)),
      precision_(Precision::kSingle) {}
Policy::Policy(const Policy& other)
    : network_(other.network_),
      onnx_(other.onnx_ != nullptr ? std::make_unique<Onnx>(*other.onnx_) : nullptr),
      precision_(other.precision_),
      input_scale_(other.input_scale_),
      activities_(other.activities_),
      single_activities_(other.single_activities_) {}
Policy& Policy::operator=(const Policy& other) { return *this = Policy(other); }
Policy::Policy(Policy&&) noexcept = default;
Policy& Policy::operator=(Policy&&) noexcept = default;
Policy::~Policy() = default;

Policy Policy::load(const std::filesystem::path& path, Precision precision) {
  try {
    if (path.extension() == ".onnx") {
      onnx::Model model = onnx::read_model(path);
      return {std::make_unique<Onnx>(Onnx{onnx::Network(model)}), std::move(model.metadata)};
    }
    return Policy(detail::read_policy_file(path), precision);
  } catch (const InvalidArgument& error) {
    throw PolicyFileError(path.string() + " is not a policy that can be used: " + error.what());
  }
}

void Policy::save(const std::filesystem::path& path) const {
  if (onnx_ != nullptr) throw InvalidArgument("a policy of ONNX is saved by copying its file");
  detail::write_policy_file(network_, path);
}

std::size_t Policy::num_inputs() const noexcept {
  if (onnx_ != nullptr) return onnx_->network.num_inputs();
  return static_cast<std::size_t>(network_.layers.front().weights.cols());
}

std::size_t Policy::num_outputs() const noexcept {
  if (onnx_ != nullptr) return onnx_->network.num_outputs();
  return static_cast<std::size_t>(network_.layers.back().weights.rows());
}

bool Policy::has_state() const noexcept { return onnx_ != nullptr && onnx_->network.has_state(); }

void Policy::reset() noexcept {
  if (onnx_ != nullptr) onnx_->network.reset();
}

bool Policy::evaluate(std::span<const double> observation, std::span<double> action) noexcept {
  if (onnx_ != nullptr) return onnx_->network.evaluate(observation, action);
  if (observation.size() != num_inputs() || action.size() != num_outputs()) return false;
  return precision_ == Precision::kSingle ? evaluate_in(single_activities_, observation, action)
                                          : evaluate_in(activities_, observation, action);
}

template <class Number>
bool Policy::evaluate_in(Activities<Number>& activities, std::span<const double> observation,
                         std::span<double> action) const noexcept {
  Number* input = activities[0].data();
  Number* output = activities[1].data();
  if (!take_input(observation, input)) return false;
  for (const Layer& layer : network_.layers) {
    apply_affine(layer, input, output);
    const Eigen::Map<Eigen::ArrayX<Number>> values(output, layer.weights.rows());
    // Checked before the activation, which can turn NaN into a number.
    if (!values.allFinite()) return false;
    apply<Number>(layer.activation, values);
    std::swap(input, output);
  }
  give_output(input, action);
  return true;
}

template <class Number>
bool Policy::take_input(std::span<const double> observation, Number* input) const noexcept {
  for (std::size_t i = 0; i < observation.size(); ++i) {
    double value = observation[i];
    if (!std::isfinite(value)) return false;
    if (network_.normalization) {
      const InputNormalization& normalization = *network_.normalization;
      const auto k = static_cast<Eigen::Index>(i);
      value = std::clamp((value - normalization.mean[k]) * input_scale_[k], -normalization.clip,
                         normalization.clip);
    }
    if (std::abs(value) > static_cast<double>(std::numeric_limits<float>::max())) return false;
    // PyTorch's networks get single precision.
    const auto single = static_cast<float>(value);
    input[i] = static_cast<Number>(single);
  }
  return true;
}

template <class Number>
void Policy::give_output(const Number* output, std::span<double> action) const noexcept {
  if (!network_.bounds) {
    std::copy_n(output, action.size(), action.begin());
    return;
  }
  const OutputBounds& bounds = *network_.bounds;
  for (std::size_t i = 0; i < action.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const double low = bounds.low[k];
    const double high = bounds.high[k];
    const auto unbounded = static_cast<double>(output[i]);
    const double value = bounds.bounding == Bounding::kScale
                             ? low + 0.5 * (unbounded + 1.0) * (high - low)
                             : unbounded;
    action[i] = std::clamp(value, low, high);
  }
}

}  // namespace trifinger::learning
