// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::learning {

/// The file does not have the format of docs/policies.md. The text names the file and the problem.
class PolicyFileError : public Error {
 public:
  using Error::Error;
};

enum class Activation : std::uint8_t { kIdentity, kRelu, kTanh, kElu };

/// activation(weights * input + bias): PyTorch's `Linear` and the activation after it.
struct Layer {
  Eigen::MatrixXf weights{};  ///< One row per output.
  Eigen::VectorXf bias{};
  Activation activation{Activation::kIdentity};
};

/// (input - mean) / sqrt(variance + epsilon), cut off at `clip` on both sides. This is
/// Stable-Baselines3's `VecNormalize`.
struct InputNormalization {
  Eigen::VectorXd mean{};
  Eigen::VectorXd variance{};
  double epsilon{1e-8};
  double clip{10.0};
};

/// How outputs are brought between their bounds.
enum class Bounding : std::uint8_t {
  kScale,  ///< -1 becomes the lower bound and 1 the upper one; values beyond are cut off.
  kClip,   ///< Values beyond the bounds are cut off.
};

struct OutputBounds {
  Eigen::VectorXd low{};
  Eigen::VectorXd high{};
  Bounding bounding{Bounding::kScale};
};

/// The contents of a policy: a multi-layer perceptron with its normalization, bounds and metadata.
struct Network {
  std::vector<Layer> layers{};  ///< At least one. The last activation is identity or tanh.
  std::optional<InputNormalization> normalization{};
  std::optional<OutputBounds> bounds{};
  /// Facts for the program that runs the policy. docs/policies.md lists the usual names.
  std::map<std::string, std::string> metadata{};
};

/// The type in which a policy computes its sums.
enum class Precision : std::uint8_t {
  kDouble,  ///< The actions are those that PyTorch would give without rounding errors.
  kSingle,  ///< Takes about half the time. It rounds as often as PyTorch, but sums in another
            ///< order.
};

/// A trained policy: it computes actions from observations, in C++ alone. Its file is of ONNX, or
/// of our own format; docs/policies.md describes both.
///
/// One policy must not be used by several threads at once: each needs its own.
class Policy {
 public:
  /// @throws InvalidArgument if sizes do not match or a number is not finite.
  explicit Policy(Network network, Precision precision = Precision::kDouble);
  Policy(const Policy& other);
  Policy& operator=(const Policy& other);
  Policy(Policy&&) noexcept;
  Policy& operator=(Policy&&) noexcept;
  ~Policy();

  /// Reads the file at `path`, of ONNX if that ends in ".onnx". Its content is not trusted.
  /// Networks of ONNX are computed in single precision.
  /// @throws PolicyFileError, SystemError if it cannot be read.
  [[nodiscard]] static Policy load(const std::filesystem::path& path,
                                   Precision precision = Precision::kDouble);

  /// Writes the file at `path` in one step: an old file stays whole until the new one replaces it.
  /// @throws InvalidArgument if the metadata are not UTF-8 or too long, or the policy is of ONNX;
  /// SystemError.
  void save(const std::filesystem::path& path) const;

  /// Computes `action`. Returns false and leaves `action` unchanged if a size is wrong, or if a
  /// number in `observation` or in the result is not finite.
  [[nodiscard]] bool evaluate(std::span<const double> observation,
                              std::span<double> action) noexcept TRIFINGER_REALTIME;
  /// True if an action depends on earlier observations, as that of GRU and LSTM does.
  [[nodiscard]] bool has_state() const noexcept;
  /// Forgets earlier observations: an episode begins.
  void reset() noexcept TRIFINGER_REALTIME;

  [[nodiscard]] std::size_t num_inputs() const noexcept;
  [[nodiscard]] std::size_t num_outputs() const noexcept;
  /// A network of ONNX has no layers here, only metadata.
  [[nodiscard]] const Network& network() const noexcept { return network_; }
  [[nodiscard]] Precision precision() const noexcept { return precision_; }

 private:
  /// The network of an ONNX file.
  struct Onnx;
  Policy(std::unique_ptr<Onnx> onnx, std::map<std::string, std::string> metadata);

  /// The numbers before and after a layer, in turn.
  template <class Number>
  using Activities = std::array<Eigen::Vector<Number, Eigen::Dynamic>, 2>;

  template <class Number>
  [[nodiscard]] bool evaluate_in(Activities<Number>& activities,
                                 std::span<const double> observation,
                                 std::span<double> action) const noexcept;
  template <class Number>
  [[nodiscard]] bool take_input(std::span<const double> observation, Number* input) const noexcept;
  template <class Number>
  void give_output(const Number* output, std::span<double> action) const noexcept;

  Network network_;
  std::unique_ptr<Onnx> onnx_;  ///< nullptr: `network_` has layers.
  Precision precision_;
  Eigen::VectorXd input_scale_;          ///< 1 / sqrt(variance + epsilon)
  Activities<double> activities_;        ///< Used if the precision is double.
  Activities<float> single_activities_;  ///< Used if the precision is single.
};

}  // namespace trifinger::learning
