// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/choice.hpp"
#include "conversion/numbers.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/learning/policy.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace learning;

using WeightMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Weights = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Bias = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using PyLayer = std::tuple<Weights, Bias, std::string>;
using Values = std::vector<double>;

// In the order of the enumerations.
constexpr std::array<std::string_view, 4> kActivations{"identity", "relu", "tanh", "elu"};
constexpr std::array<std::string_view, 2> kBoundings{"scale", "clip"};

Eigen::VectorXd to_vector(const Values& numbers) {
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(),
                                           static_cast<Eigen::Index>(numbers.size()));
}

Values from_vector(const Eigen::VectorXd& vector) { return {vector.begin(), vector.end()}; }

Layer to_layer(const PyLayer& layer) {
  const auto& [weights, bias, activation] = layer;
  return {.weights = Eigen::Map<const WeightMatrix>(weights.data(),
                                                    static_cast<Eigen::Index>(weights.shape(0)),
                                                    static_cast<Eigen::Index>(weights.shape(1))),
          .bias = Eigen::Map<const Eigen::VectorXf>(bias.data(),
                                                    static_cast<Eigen::Index>(bias.shape(0))),
          .activation = choice<Activation>("activation", kActivations, activation)};
}

void require_both(const char* names, bool first, bool second) {
  if (first == second) return;
  throw InvalidArgument(std::string(names) + " go together: give both or none");
}

// Throws an error that says why `observation` was rejected.
void explain(const Policy& policy, std::span<const double> observation) {
  for (std::size_t i = 0; i < observation.size(); ++i) {
    if (std::isfinite(observation[i])) continue;
    throw InvalidArgument("observation[" + std::to_string(i) + "] is " +
                          std::to_string(observation[i]) + ", must be finite");
  }
  throw InvalidArgument("the observation has a number that is too large for this policy of " +
                        std::to_string(policy.num_inputs()) + " inputs");
}

// Reads the observation in place and writes the action into the array that it returns.
nb::object call(Policy& policy, nb::handle observation) {
  // Refuses conversions that would lose something: complex numbers, texts, objects.
  const nb::object array =
      nb::steal(PyArray_FROM_OTF(observation.ptr(), NPY_DOUBLE, NPY_ARRAY_IN_ARRAY));
  if (!array.is_valid()) {
    PyErr_Clear();
    throw InvalidArgument("the observation cannot be taken for an array of float64: " +
                          std::string(nb::repr(observation).c_str()).substr(0, 200));
  }
  auto* const numbers = reinterpret_cast<PyArrayObject*>(array.ptr());
  const auto size = static_cast<npy_intp>(policy.num_inputs());
  if (PyArray_NDIM(numbers) != 1 || PyArray_DIM(numbers, 0) != size) {
    const nb::object shape = array.attr("shape");
    throw InvalidArgument("the observation has the shape " +
                          std::string(nb::str(nb::handle(shape)).c_str()) + ", must have (" +
                          std::to_string(size) + ",)");
  }
  const auto [action, memory] =
      new_array({static_cast<npy_intp>(policy.num_outputs())}, NPY_DOUBLE);
  const std::span<const double> input(static_cast<const double*>(PyArray_DATA(numbers)),
                                      policy.num_inputs());
  const std::span output(static_cast<double*>(memory), policy.num_outputs());
  if (!policy.evaluate(input, output)) explain(policy, input);
  return action;
}

}  // namespace

void bind_policy(nb::module_& m) {
  const InputNormalization usual;
  nb::class_<Policy>(m, "Policy", docs::Policy::Policy)
      .def(
          "__init__",
          [](Policy* self, const ShownPath& path, const std::string& precision) {
            new (self) Policy(Policy::load(to_path(path),
                                           choice<Precision>("precision", kPrecisions, precision)));
          },
          "path"_a, nb::kw_only(), "precision"_a = "double",
          "Reads the file at `path`. Sums have 'double' or 'single' precision. 'single' takes "
          "about half the\ntime and rounds as much as PyTorch does.")
      .def_static(
          "from_layers",
          [](const std::vector<PyLayer>& layers, const std::optional<Values>& mean,
             const std::optional<Values>& variance, double epsilon, double clip,
             const std::optional<Values>& low, const std::optional<Values>& high,
             const std::string& bounding, const std::map<std::string, std::string>& metadata,
             const std::string& precision) {
            Network network{.metadata = metadata};
            std::ranges::transform(layers, std::back_inserter(network.layers), to_layer);
            require_both("mean and variance", mean.has_value(), variance.has_value());
            if (mean && variance) {
              network.normalization = {.mean = to_vector(*mean),
                                       .variance = to_vector(*variance),
                                       .epsilon = epsilon,
                                       .clip = clip};
            }
            require_both("low and high", low.has_value(), high.has_value());
            if (low && high) {
              network.bounds = {.low = to_vector(*low),
                                .high = to_vector(*high),
                                .bounding = choice<Bounding>("bounding", kBoundings, bounding)};
            }
            return Policy(std::move(network),
                          choice<Precision>("precision", kPrecisions, precision));
          },
          "layers"_a, nb::kw_only(), "mean"_a = nb::none(), "variance"_a = nb::none(),
          "epsilon"_a = usual.epsilon, "clip"_a = usual.clip, "low"_a = nb::none(),
          "high"_a = nb::none(), "bounding"_a = "scale", "metadata"_a = nb::dict(),
          "precision"_a = "double",
          "Makes a policy from layers: weights with one row per output, bias, and 'identity', "
          "'relu', 'tanh' or 'elu'.\nInputs are normalised with `mean` and `variance`. Outputs are "
          "brought between `low` and `high`, by\n'scale' from -1 to 1, or by 'clip'. "
          "`trifinger.policy_file` makes policies from networks of PyTorch.")
      .def(
          "save", [](const Policy& policy, const ShownPath& path) { policy.save(to_path(path)); },
          "path"_a, docs::Policy::save)
      .def("__call__", &call, "observation"_a,
           nb::sig("def __call__(self, observation: numpy.typing.ArrayLike) -> "
                   "numpy.typing.NDArray[numpy.float64]"),
           "Computes the action for `observation`. An array of float64 is read in place.")
      .def("reset", &Policy::reset, docs::Policy::reset)
      .def("__copy__", [](const Policy& policy) { return Policy(policy); })
      .def_prop_ro("has_state", &Policy::has_state, docs::Policy::has_state)
      .def_prop_ro("num_inputs", &Policy::num_inputs)
      .def_prop_ro("num_outputs", &Policy::num_outputs)
      .def_prop_ro(
          "layers",
          [](const Policy& policy) {
            std::vector<std::tuple<Array<RowMajor>, Array<Eigen::VectorXd>, std::string>> layers;
            for (const Layer& layer : policy.network().layers) {
              layers.emplace_back(
                  Array{RowMajor(layer.weights.cast<double>())},
                  Array{Eigen::VectorXd(layer.bias.cast<double>())},
                  std::string(kActivations.at(static_cast<std::size_t>(layer.activation))));
            }
            return layers;
          },
          "Weights with one row per output, bias and activation of each layer; none of ONNX.")
      .def_prop_ro(
          "normalization",
          [](const Policy& policy) -> std::optional<std::tuple<Values, Values, double, double>> {
            const auto& of = policy.network().normalization;
            if (!of) return std::nullopt;
            return std::tuple(from_vector(of->mean), from_vector(of->variance), of->epsilon,
                              of->clip);
          },
          "Mean, variance, epsilon and clip of the inputs. None if they are not normalised.")
      .def_prop_ro(
          "precision",
          [](const Policy& policy) {
            return std::string(kPrecisions.at(static_cast<std::size_t>(policy.precision())));
          },
          "Precision of the policy's sums: 'double' or 'single'.")
      .def_prop_ro(
          "bounds",
          [](const Policy& policy) -> std::optional<std::tuple<Values, Values, std::string>> {
            const auto& bounds = policy.network().bounds;
            if (!bounds) return std::nullopt;
            return std::tuple(
                from_vector(bounds->low), from_vector(bounds->high),
                std::string(kBoundings.at(static_cast<std::size_t>(bounds->bounding))));
          },
          "Bounds of the outputs: low, high, and 'scale' or 'clip'. None if there are no bounds.")
      .def_prop_ro(
          "metadata", [](const Policy& policy) { return policy.network().metadata; },
          docs::Network::metadata);
}

}  // namespace trifinger::bindings
