// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer feeds the reader of ONNX files with any bytes, and what it accepts is evaluated.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "onnx/model.hpp"
#include "onnx/network.hpp"
#include "trifinger/base/error.hpp"

// NOLINTNEXTLINE(readability-identifier-naming): libFuzzer's name
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace trifinger;
  try {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    onnx::Network network(onnx::model_of(bytes));
    const std::vector<double> observation(network.num_inputs(), 0.5);
    std::vector<double> action(network.num_outputs());
    for (int i = 0; i < 2; ++i) {
      if (!network.evaluate(observation, action)) break;
      for (const double number : action) {
        if (!std::isfinite(number)) std::abort();
      }
    }
  } catch (const InvalidArgument&) {
    return 0;  // refused
  }
  return 0;
}
