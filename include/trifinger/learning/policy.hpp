// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::learning {

/// The file is not what docs/policies.md says of it. The text names the file and what is wrong.
class PolicyFileError : public Error {
 public:
  using Error::Error;
};

enum class Activation : std::uint8_t { kIdentity, kRelu, kTanh };

/// activation(weights * input + bias), as PyTorch's `Linear` with what follows it.
struct Layer {
  Eigen::MatrixXf weights{};  ///< A row for each output.
  Eigen::VectorXf bias{};
  Activation activation{Activation::kIdentity};
};

/// (input - mean) / sqrt(variance + epsilon), cut off at `clip` on both sides, as
/// Stable-Baselines3's `VecNormalize`.
struct InputNormalization {
  Eigen::VectorXd mean{};
  Eigen::VectorXd variance{};
  double epsilon{1e-8};
  double clip{10.0};
};

/// How outputs come between their bounds.
enum class Bounding : std::uint8_t {
  kScale,  ///< -1 becomes the lower bound and 1 the upper one, what is beyond is cut off.
  kClip,   ///< What is beyond them is cut off.
};

struct OutputBounds {
  Eigen::VectorXd low{};
  Eigen::VectorXd high{};
  Bounding bounding{Bounding::kScale};
};

/// What a policy is made of: a multi-layer perceptron, and what goes with it.
struct Network {
  std::vector<Layer> layers{};  ///< At least one. The last one's activation is identity or tanh.
  std::optional<InputNormalization> normalization{};
  std::optional<OutputBounds> bounds{};
  /// What a program needs to know that runs it: docs/policies.md has the usual names.
  std::map<std::string, std::string> metadata{};
};

/// What a policy computes its sums in.
enum class Precision : std::uint8_t {
  kDouble,  ///< The actions are those that PyTorch would give if it did not round.
  kSingle,  ///< About half the time. It rounds as often as PyTorch, but sums in another order.
};

/// A trained policy: actions from observations, without Python.
///
/// Not for several threads at once: make a copy for each.
class Policy {
 public:
  /// @throws InvalidArgument if sizes do not fit together or a number is not finite.
  explicit Policy(Network network, Precision precision = Precision::kDouble);

  /// Reads the file at `path`, which may come from anywhere.
  /// @throws PolicyFileError, SystemError if it cannot be read.
  [[nodiscard]] static Policy load(const std::filesystem::path& path,
                                   Precision precision = Precision::kDouble);

  /// Writes the file at `path`, in one step: what was there is whole until the new one is.
  /// @throws InvalidArgument if the metadata are no text in UTF-8 or too long, SystemError.
  void save(const std::filesystem::path& path) const;

  /// Fills `action` in. False, and `action` is as it was, if one of the two has another size than
  /// the policy or a number in `observation`, or one that follows from it, is not finite.
  [[nodiscard]] bool evaluate(std::span<const double> observation,
                              std::span<double> action) noexcept TRIFINGER_REALTIME;

  [[nodiscard]] std::size_t num_inputs() const noexcept;
  [[nodiscard]] std::size_t num_outputs() const noexcept;
  [[nodiscard]] const Network& network() const noexcept { return network_; }
  [[nodiscard]] Precision precision() const noexcept { return precision_; }

 private:
  /// Before and after a layer, in turn.
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
  Precision precision_;
  Eigen::VectorXd input_scale_;          ///< 1 / sqrt(variance + epsilon)
  Activities<double> activities_;        ///< Where the precision is double.
  Activities<float> single_activities_;  ///< Where it is single.
};

}  // namespace trifinger::learning
