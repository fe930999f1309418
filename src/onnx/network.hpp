// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "onnx/model.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::onnx {

// A step of a network. `out` and `in` are places in the memory of the network; what `sizes`,
// `numbers` and `map` mean depends on the operator.
struct Step {
  // Returns false if a number is not finite.
  bool (*run)(const Step& step, float* memory) noexcept {nullptr};
  std::size_t out{0};
  std::vector<std::size_t> in{};
  std::vector<std::int64_t> sizes{};
  std::vector<float> numbers{};
  std::vector<std::int32_t> map{};
};

// A network, ready to be evaluated for one observation at a time, in single precision.
//
// Its first output is the action. Each other output is the next state of a recurrent network, which
// the next evaluation gets: as many inputs at the end are the states, which begin with zeros. The
// inputs before them, at least one, are the observation, one after the other.
class Network {
 public:
  // Throws InvalidArgument, which says what the network has that is not known.
  explicit Network(const Model& model);

  [[nodiscard]] std::size_t num_inputs() const noexcept { return num_inputs_; }
  [[nodiscard]] std::size_t num_outputs() const noexcept { return num_outputs_; }
  // True if an action depends on earlier observations.
  [[nodiscard]] bool has_state() const noexcept { return !states_.empty(); }

  // Forgets earlier observations.
  void reset() noexcept TRIFINGER_REALTIME;
  // Computes `action`. Returns false, leaves `action` unchanged and forgets earlier observations if
  // a size is wrong, or if a number is not finite.
  [[nodiscard]] bool evaluate(std::span<const double> observation,
                              std::span<double> action) noexcept TRIFINGER_REALTIME;

 private:
  friend class Compiler;

  struct Input {
    std::size_t at;
    std::size_t size;
  };
  struct State {
    std::size_t input;
    std::size_t output;
    std::size_t size;
  };

  std::vector<float> memory_{};
  std::vector<Step> steps_{};
  std::vector<Input> inputs_{};  // the parts of the observation
  std::vector<State> states_{};
  std::size_t output_{0};
  std::size_t num_inputs_{0};
  std::size_t num_outputs_{0};
};

}  // namespace trifinger::onnx
