// SPDX-License-Identifier: BSD-3-Clause
#include "onnx/network.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

// Operators are those of https://onnx.ai/onnx/operators/.
namespace trifinger::onnx {
namespace {

using trifinger::detail::text_of;

using Numbers = Eigen::Map<Eigen::ArrayXf>;

// Compiled three times, where that is possible: for any processor, for AVX2 and for AVX-512.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__clang__)
#define TRIFINGER_WIDE __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#define TRIFINGER_HAS_CLONES
#else
#define TRIFINGER_WIDE
#endif

constexpr std::int64_t kMaxMemory = 16'000'000;     // Numbers that a network may need.
constexpr std::int64_t kMaxWork = 16 * kMaxMemory;  // Numbers that are computed while reading.
constexpr std::size_t kMaxIntegers = 1'000'000;
constexpr std::size_t kMaxRank = 16;
constexpr std::size_t kAlignment = 16;  // [numbers]

// ---- steps ----

// out[j] += sum over k of x[k] * rows[k * size + j], for rows of `size` numbers. Takes eight rows
// at once, because otherwise loading and storing `out` would take most of the time.
TRIFINGER_WIDE void add_rows(const float* rows, std::int64_t count, std::int64_t size,
                             const float* x, float* out) noexcept {
  std::int64_t k = 0;
  for (; k + 8 <= count; k += 8, x += 8, rows += 8 * size) {
    for (std::int64_t j = 0; j < size; ++j) {
      out[j] += ((x[0] * rows[j] + x[1] * rows[size + j]) +
                 (x[2] * rows[2 * size + j] + x[3] * rows[3 * size + j])) +
                ((x[4] * rows[4 * size + j] + x[5] * rows[5 * size + j]) +
                 (x[6] * rows[6 * size + j] + x[7] * rows[7 * size + j]));
    }
  }
  for (; k < count; ++k, ++x, rows += size) {
    for (std::int64_t j = 0; j < size; ++j) out[j] += x[0] * rows[j];
  }
}

// Looks at the bits, because sums of them need no order and so become vectors.
TRIFINGER_WIDE bool are_finite(const float* numbers, std::int64_t count) noexcept {
  constexpr std::uint32_t kExponent = 0x7F80'0000;
  std::uint32_t is_wrong = 0;
  for (std::int64_t i = 0; i < count; ++i) {
    const auto bits = std::bit_cast<std::uint32_t>(numbers[i]);
    is_wrong |= static_cast<std::uint32_t>((bits & kExponent) == kExponent);
  }
  return is_wrong == 0;
}

TRIFINGER_WIDE bool has_nan(const float* numbers, std::int64_t count) noexcept {
  constexpr std::uint32_t kSign = 0x8000'0000;
  constexpr std::uint32_t kInfinity = 0x7F80'0000;
  std::uint32_t is_wrong = 0;
  for (std::int64_t i = 0; i < count; ++i) {
    const auto bits = std::bit_cast<std::uint32_t>(numbers[i]);
    is_wrong |= static_cast<std::uint32_t>((bits & ~kSign) > kInfinity);
  }
  return is_wrong != 0;
}

// Returns false if a number is not finite.
TRIFINGER_WIDE bool take(const double* numbers, std::int64_t count, float* out) noexcept {
  for (std::int64_t i = 0; i < count; ++i) out[i] = static_cast<float>(numbers[i]);
  return are_finite(out, count);
}

// x becomes above * x where it is positive, and below * (exp(x) - 1) elsewhere. exp(x) is
// 2^n * exp(rest), with a rest of at most ln(2) / 2, for which the first terms of its series do.
TRIFINGER_WIDE void elu(float* x, std::int64_t count, float above, float below) noexcept {
  constexpr float kRound = 12'582'912.0F;  // Sums with it have no fraction.
  // ln(2) in two parts, the first of which has so few bits that its product is exact.
  constexpr float kFirst = 355.0F / 512.0F;
  constexpr auto kRest = static_cast<float>(std::numbers::ln2 - 355.0 / 512.0);
  for (std::int64_t i = 0; i < count; ++i) {
    // In this order NaN counts as 0 here; what is above keeps it.
    const float negative = std::max(-87.0F, std::min(0.0F, x[i]));
    const float n = (negative * std::numbers::log2e_v<float> + kRound) - kRound;
    const float rest = (negative - n * kFirst) - n * kRest;
    float sum = 1.0F / 720.0F + rest * (1.0F / 5040.0F);
    sum = 1.0F / 24.0F + rest * (1.0F / 120.0F + rest * sum);
    sum = 1.0F + rest * (0.5F + rest * (1.0F / 6.0F + rest * sum));
    const auto exponent = static_cast<std::uint32_t>(static_cast<std::int32_t>(n) + 127) << 23U;
    const auto power = std::bit_cast<float>(exponent);
    // exp(rest) - 1 is sum * rest.
    x[i] = above * std::max(x[i], 0.0F) + below * (power * (sum * rest) + (power - 1.0F));
  }
}

// Functions of one number. `p` are parameters of the operator.
struct Unary {
  std::string_view op;
  void (*apply)(Numbers x, const std::vector<float>& p) noexcept;
};

void sigmoid(Numbers& x) noexcept { x = 1.0F / (1.0F + (-x).exp()); }

constexpr std::array kUnary{
    Unary{"Relu", [](Numbers x, const auto& /*p*/) noexcept { x = x.max(0.0F); }},
    Unary{"Tanh", [](Numbers x, const auto& /*p*/) noexcept { x = x.tanh(); }},
    Unary{"Sigmoid", [](Numbers x, const auto& /*p*/) noexcept { sigmoid(x); }},
    Unary{"Elu", [](Numbers x, const auto& p) noexcept { elu(x.data(), x.size(), 1.0F, p[0]); }},
    Unary{"Selu",
          [](Numbers x, const auto& p) noexcept { elu(x.data(), x.size(), p[1], p[1] * p[0]); }},
    Unary{"LeakyRelu",
          [](Numbers x, const auto& p) noexcept { x = x.max(0.0F) + p[0] * x.min(0.0F); }},
    Unary{
        "Softplus",
        [](Numbers x, const auto& /*p*/) noexcept { x = x.max(0.0F) + (-x.abs()).exp().log1p(); }},
    Unary{"Gelu",
          [](Numbers x, const auto& p) noexcept {
            const auto root = std::numbers::sqrt2_v<float> * std::numbers::inv_sqrtpi_v<float>;
            if (p[0] != 0.0F) {
              x = 0.5F * x * (1.0F + (root * (x + 0.044715F * x.cube())).tanh());
            } else {
              x = x.unaryExpr([](float v) {
                return 0.5F * v * (1.0F + std::erf(v / std::numbers::sqrt2_v<float>));
              });
            }
          }},
    Unary{"Erf",
          [](Numbers x, const auto& /*p*/) noexcept {
            x = x.unaryExpr([](float v) { return std::erf(v); });
          }},
    Unary{"Clip", [](Numbers x, const auto& p) noexcept { x = x.max(p[0]).min(p[1]); }},
    Unary{"Exp", [](Numbers x, const auto& /*p*/) noexcept { x = x.exp(); }},
    Unary{"Log", [](Numbers x, const auto& /*p*/) noexcept { x = x.log(); }},
    Unary{"Sqrt", [](Numbers x, const auto& /*p*/) noexcept { x = x.sqrt(); }},
    Unary{"Neg", [](Numbers x, const auto& /*p*/) noexcept { x = -x; }},
    Unary{"Abs", [](Numbers x, const auto& /*p*/) noexcept { x = x.abs(); }},
    Unary{"Reciprocal", [](Numbers x, const auto& /*p*/) noexcept { x = x.inverse(); }}};

// sizes: count, place in kUnary
bool run_unary(const Step& step, float* memory) noexcept {
  Numbers out(memory + step.out, step.sizes[0]);
  out = Numbers(memory + step.in[0], step.sizes[0]);
  kUnary[static_cast<std::size_t>(step.sizes[1])].apply(out, step.numbers);
  return true;
}

struct Binary {
  std::string_view op;
  float (*apply)(float a, float b) noexcept;
};
constexpr std::array kBinary{
    Binary{"Add", [](float a, float b) noexcept { return a + b; }},
    Binary{"Sub", [](float a, float b) noexcept { return a - b; }},
    Binary{"Mul", [](float a, float b) noexcept { return a * b; }},
    Binary{"Div", [](float a, float b) noexcept { return a / b; }},
    Binary{"Pow", [](float a, float b) noexcept { return std::pow(a, b); }},
    Binary{"Max", [](float a, float b) noexcept { return std::max(a, b); }},
    Binary{"Min", [](float a, float b) noexcept { return std::min(a, b); }},
    // What is true is 1, what is false 0.
    Binary{"Greater", [](float a, float b) noexcept { return a > b ? 1.0F : 0.0F; }},
    Binary{"GreaterOrEqual", [](float a, float b) noexcept { return a >= b ? 1.0F : 0.0F; }},
    Binary{"Less", [](float a, float b) noexcept { return a < b ? 1.0F : 0.0F; }},
    Binary{"LessOrEqual", [](float a, float b) noexcept { return a <= b ? 1.0F : 0.0F; }}};

// sizes: count, place in kBinary; map: pairs of places in both inputs, or none if they are alike
template <std::size_t kOp>
bool run_binary(const Step& step, float* memory) noexcept {
  const float* const a = memory + step.in[0];
  const float* const b = memory + step.in[1];
  float* const out = memory + step.out;
  const std::int64_t count = step.sizes[0];
  if (step.map.empty()) {
    for (std::int64_t i = 0; i < count; ++i) out[i] = kBinary[kOp].apply(a[i], b[i]);
  } else {
    const std::int32_t* pair = step.map.data();
    for (std::int64_t i = 0; i < count; ++i, pair += 2) {
      out[i] = kBinary[kOp].apply(a[pair[0]], b[pair[1]]);
    }
  }
  // Checked here, because functions of it can turn NaN into a number.
  return !has_nan(out, count);
}

template <std::size_t... kOps>
constexpr auto binary_steps(std::index_sequence<kOps...> /*ops*/) {
  return std::array{&run_binary<kOps>...};
}
constexpr auto kBinarySteps = binary_steps(std::make_index_sequence<kBinary.size()>());

// map: places in the three inputs, one after the other
bool run_where(const Step& step, float* memory) noexcept {
  const float* const condition = memory + step.in[0];
  const float* const yes = memory + step.in[1];
  const float* const no = memory + step.in[2];
  float* out = memory + step.out;
  for (std::size_t i = 0; i < step.map.size(); i += 3) {
    *out++ = condition[step.map[i]] != 0.0F ? yes[step.map[i + 1]] : no[step.map[i + 2]];
  }
  return true;
}

// map: where each number comes from
bool run_copy(const Step& step, float* memory) noexcept {
  const float* const in = memory + step.in[0];
  float* const out = memory + step.out;
  for (std::size_t i = 0; i < step.map.size(); ++i) out[i] = in[step.map[i]];
  return true;
}

// Copies rows into wider ones. sizes: rows, numbers of each, numbers from one to the next
bool run_rows(const Step& step, float* memory) noexcept {
  for (std::int64_t row = 0; row < step.sizes[0]; ++row) {
    std::copy_n(memory + step.in[0] + row * step.sizes[1], step.sizes[1],
                memory + step.out + row * step.sizes[2]);
  }
  return true;
}

// out = in * weights + bias. sizes: rows, inputs, outputs; in: input, weights, bias
bool run_dense(const Step& step, float* memory) noexcept {
  const std::int64_t rows = step.sizes[0];
  const std::int64_t inputs = step.sizes[1];
  const std::int64_t outputs = step.sizes[2];
  float* const out = memory + step.out;
  for (std::int64_t row = 0; row < rows; ++row) {
    std::copy_n(memory + step.in[2], outputs, out + row * outputs);
    add_rows(memory + step.in[1], inputs, outputs, memory + step.in[0] + row * inputs,
             out + row * outputs);
  }
  // Checked here, because functions of it can turn NaN into a number.
  return are_finite(out, rows * outputs);
}

// sizes: rows, size; numbers: epsilon; in: input, scale, bias
bool run_layer_norm(const Step& step, float* memory) noexcept {
  const std::int64_t size = step.sizes[1];
  const Numbers scale(memory + step.in[1], size);
  const Numbers bias(memory + step.in[2], size);
  for (std::int64_t row = 0; row < step.sizes[0]; ++row) {
    const Numbers in(memory + step.in[0] + row * size, size);
    Numbers out(memory + step.out + row * size, size);
    out = in - in.mean();
    const float deviation = std::sqrt(out.square().mean() + step.numbers[0]);
    out = out / deviation * scale + bias;
  }
  return true;
}

// Means of `size` numbers each. sizes: rows, size
bool run_mean(const Step& step, float* memory) noexcept {
  const std::int64_t size = step.sizes[1];
  for (std::int64_t row = 0; row < step.sizes[0]; ++row) {
    memory[step.out + static_cast<std::size_t>(row)] =
        Numbers(memory + step.in[0] + row * size, size).mean();
  }
  return true;
}

// What both kinds of recurrent networks have in common. sizes: inputs, units, instants;
// in: sequence, weights, recurrent weights, bias, recurrent bias, first state, room
struct Recurrent {
  Recurrent(const Step& step, float* memory) noexcept
      : inputs(step.sizes[0]),
        units(step.sizes[1]),
        weights(memory + step.in[1]),
        recurrent(memory + step.in[2]),
        bias(memory + step.in[3]),
        recurrent_bias(memory + step.in[4]),
        room(memory + step.in[6]) {}

  [[nodiscard]] Numbers part(float* numbers, std::int64_t i) const noexcept {
    return {numbers + i * units, units};
  }

  std::int64_t inputs;
  std::int64_t units;
  const float* weights;    // inputs x gates * units
  const float* recurrent;  // units x gates * units
  const float* bias;
  const float* recurrent_bias;
  float* room;
};

// numbers[0]: whether the reset gate acts after the product; out: the state after each instant
bool run_gru(const Step& step, float* memory) noexcept {
  const Recurrent net(step, memory);
  const std::int64_t width = 3 * net.units;
  float* const gates = net.room;
  float* const fed = gates + width;
  float* const kept = fed + width;
  const float* before = memory + step.in[5];
  const bool is_after = step.numbers[0] != 0.0F;
  for (std::int64_t t = 0; t < step.sizes[2]; ++t) {
    const Eigen::Map<const Eigen::ArrayXf> state(before, net.units);
    std::copy_n(net.bias, width, gates);
    add_rows(net.weights, net.inputs, width, memory + step.in[0] + t * net.inputs, gates);
    std::copy_n(net.recurrent_bias, width, fed);
    add_rows(net.recurrent, net.units, width, before, fed);
    Numbers update = net.part(gates, 0);
    Numbers reset = net.part(gates, 1);
    Numbers next = net.part(gates, 2);
    update += net.part(fed, 0);
    reset += net.part(fed, 1);
    sigmoid(update);
    sigmoid(reset);
    if (is_after) {
      next += reset * net.part(fed, 2);
    } else {
      net.part(kept, 0) = reset * state;
      std::copy_n(net.recurrent_bias, width, fed);
      add_rows(net.recurrent, net.units, width, kept, fed);
      next += net.part(fed, 2);
    }
    if (!are_finite(gates, width)) return false;
    float* const after = memory + step.out + t * net.units;
    Numbers(after, net.units) = (1.0F - update) * next.tanh() + update * state;
    before = after;
  }
  return true;
}

// in[7]: first cell; out: the state after each instant, then the last cell
bool run_lstm(const Step& step, float* memory) noexcept {
  const Recurrent net(step, memory);
  const std::int64_t width = 4 * net.units;
  float* const gates = net.room;
  const float* before = memory + step.in[5];
  Numbers cell(memory + step.out + step.sizes[2] * net.units, net.units);
  cell = Numbers(memory + step.in[7], net.units);
  for (std::int64_t t = 0; t < step.sizes[2]; ++t) {
    std::copy_n(net.bias, width, gates);
    Numbers(gates, width) += Eigen::Map<const Eigen::ArrayXf>(net.recurrent_bias, width);
    add_rows(net.weights, net.inputs, width, memory + step.in[0] + t * net.inputs, gates);
    add_rows(net.recurrent, net.units, width, before, gates);
    if (!are_finite(gates, width)) return false;
    Numbers open(gates, 3 * net.units);  // input, output, forget
    sigmoid(open);
    cell = net.part(gates, 2) * cell + net.part(gates, 0) * net.part(gates, 3).tanh();
    float* const after = memory + step.out + t * net.units;
    Numbers(after, net.units) = net.part(gates, 1) * cell.tanh();
    before = after;
  }
  return true;
}

constexpr std::int64_t kLanes = 16;  // Channels whose weights stand together.
constexpr std::size_t kSums = 12;    // Registers that a processor has for sums.

std::int64_t tiled(std::int64_t channels) noexcept {
  return (channels + kLanes - 1) / kLanes * kLanes;
}

// A vector register of so many numbers.
template <std::int64_t kWidth>
struct Register;
template <>
struct Register<4> {
  using Type = float __attribute__((vector_size(16)));
};
template <>
struct Register<8> {
  using Type = float __attribute__((vector_size(32)));
};
template <>
struct Register<16> {
  using Type = float __attribute__((vector_size(64)));
};

// What a window over an image does. `taps` are the places of its numbers from its first one on,
// `firsts` those of its first number in the image: one for each number of a channel of the result.
// sizes: taps, numbers of a channel of the result, then what the operator needs.
struct Windows {
  explicit Windows(const Step& step) noexcept
      : taps(step.map.data(), static_cast<std::size_t>(step.sizes[0])),
        firsts(step.map.data() + step.sizes[0], static_cast<std::size_t>(step.sizes[1])) {}

  std::span<const std::int32_t> taps;
  std::span<const std::int32_t> firsts;
};

// The results of `channels`, which fill `kRegisters` at most: their sums stay there. weights: where
// those of each register begin; for each tap a number of each of the lanes
template <std::int64_t kWidth, std::size_t kRegisters>
TRIFINGER_WIDE void convolve(const Windows& windows, const float* image,
                             const std::array<const float*, kRegisters>& weights, const float* bias,
                             std::int64_t channels, float* out) noexcept {
  using Sum = typename Register<kWidth>::Type;
  constexpr std::size_t kPlaces = kSums / kRegisters;
  const std::size_t size = windows.firsts.size();
  for (std::size_t first = 0; first < size; first += kPlaces) {
    const std::size_t places = std::min(kPlaces, size - first);
    // The loop below fills them, and the one over registers `weight`.
    std::array<const float*, kPlaces> at;                   // NOLINT(*-member-init)
    std::array<std::array<Sum, kPlaces>, kRegisters> sums;  // NOLINT(*-member-init)
    for (std::size_t i = 0; i < kPlaces; ++i) {
      at[i] = image + windows.firsts[first + std::min(i, places - 1)];
      for (std::size_t r = 0; r < kRegisters; ++r) {
        std::memcpy(&sums[r][i], bias + r * kWidth, sizeof(Sum));
      }
    }
    std::array<const float*, kRegisters> next = weights;
    for (const std::int32_t tap : windows.taps) {
      std::array<Sum, kRegisters> weight;  // NOLINT(*-member-init)
      for (std::size_t r = 0; r < kRegisters; ++r) {
        std::memcpy(&weight[r], next[r], sizeof(Sum));
        next[r] += kLanes;
      }
      for (std::size_t i = 0; i < kPlaces; ++i) {
        const float number = at[i][tap];
        for (std::size_t r = 0; r < kRegisters; ++r) sums[r][i] += weight[r] * number;
      }
    }
    for (std::int64_t channel = 0; channel < channels; ++channel) {
      const auto& found = sums[static_cast<std::size_t>(channel / kWidth)];
      float* const row = out + channel * static_cast<std::int64_t>(size) + first;
      for (std::size_t i = 0; i < places; ++i) row[i] = found[i][channel % kWidth];
    }
  }
}

// sizes: as `Windows`, then groups, channels of each, numbers of the image of each;
// in: image, weights, bias
template <std::int64_t kWidth>
bool run_convolution(const Step& step, float* memory) noexcept {
  const Windows windows(step);
  const std::int64_t size = step.sizes[1];
  const std::int64_t channels = step.sizes[3];
  const float* weights = memory + step.in[1];
  const float* bias = memory + step.in[2];
  float* out = memory + step.out;
  for (std::int64_t group = 0; group < step.sizes[2]; ++group) {
    const float* const image = memory + step.in[0] + group * step.sizes[4];
    const auto block = [&](std::int64_t channel) {
      return weights + channel / kLanes * kLanes * step.sizes[0] + channel % kLanes;
    };
    for (std::int64_t first = 0; first < channels;) {
      const std::int64_t left = channels - first;
      if (left > kWidth) {
        const std::array<const float*, 2> both{block(first), block(first + kWidth)};
        convolve<kWidth, 2>(windows, image, both, bias + first, std::min(2 * kWidth, left),
                            out + first * size);
        first += 2 * kWidth;
      } else {
        convolve<kWidth, 1>(windows, image, {block(first)}, bias + first, left, out + first * size);
        first += kWidth;
      }
    }
    weights += tiled(channels) * step.sizes[0];
    bias += tiled(channels);
    out += channels * size;
  }
  return are_finite(memory + step.out, step.sizes[2] * channels * size);
}

// The one for the registers of this processor.
auto* convolution_here() noexcept {
#ifdef TRIFINGER_HAS_CLONES
  if (__builtin_cpu_supports("x86-64-v4") > 0) return &run_convolution<16>;
  if (__builtin_cpu_supports("x86-64-v3") > 0) return &run_convolution<8>;
#endif
  return &run_convolution<4>;
}

// sizes: as `Windows`, then channels, numbers of the image of each; in: image
bool run_max_pool(const Step& step, float* memory) noexcept {
  const Windows windows(step);
  float* out = memory + step.out;
  for (std::int64_t channel = 0; channel < step.sizes[2]; ++channel) {
    const float* const image = memory + step.in[0] + channel * step.sizes[3];
    for (const std::int32_t first : windows.firsts) {
      float largest = image[first];
      for (const std::int32_t tap : windows.taps) largest = std::max(largest, image[first + tap]);
      *out++ = largest;
    }
  }
  return true;
}

// Copies an image into a larger one. sizes: channels, height and width, height and width of the
// larger one, the place there of the first number
bool run_pad(const Step& step, float* memory) noexcept {
  const float* in = memory + step.in[0];
  for (std::int64_t channel = 0; channel < step.sizes[0]; ++channel) {
    float* out = memory + step.out + channel * step.sizes[3] * step.sizes[4] + step.sizes[5];
    for (std::int64_t row = 0; row < step.sizes[1]; ++row) {
      std::copy_n(in, step.sizes[2], out);
      in += step.sizes[2];
      out += step.sizes[4];
    }
  }
  return true;
}

}  // namespace

// ---- from nodes to steps ----

class Compiler {
 public:
  Compiler(const Model& model, Network& network) : model_(model), network_(network) {}

  void compile() {
    if (model_.opset < 7) {
      throw InvalidArgument(
          text_of("its operators are of version ", model_.opset, ", known are those from 7 on"));
    }
    for (const auto& [name, tensor] : model_.tensors) keep(name, tensor);
    for (const Place& place : model_.inputs) make(place.name, shape_of_input(place));
    for (const Node& node : model_.nodes) {
      node_ = &node;
      const auto* const found =
          std::ranges::find(kOperators, std::string_view(node.op), &Operator::op);
      if (found != kOperators.end()) {
        (this->*found->add)();
      } else if (const auto* unary =
                     std::ranges::find(kUnary, std::string_view(node.op), &Unary::op);
                 unary != kUnary.end()) {
        add_unary(unary - kUnary.begin());
      } else if (const auto* binary =
                     std::ranges::find(kBinary, std::string_view(node.op), &Binary::op);
                 binary != kBinary.end()) {
        add_binary(static_cast<std::size_t>(binary - kBinary.begin()));
      } else {
        throw InvalidArgument(text_of("the operator '", node.op, "' is not known"));
      }
    }
    connect();
  }

 private:
  struct Value {
    Shape shape{};
    std::size_t at{0};
    bool is_constant{false};
    std::optional<std::vector<std::int64_t>> integers{};  // of a constant of whole numbers
  };

  struct Operator {
    std::string_view op;
    void (Compiler::*add)();
  };
  static const std::array<Operator, 27> kOperators;

  [[noreturn]] void refuse(const std::string& why) const {
    throw InvalidArgument(text_of("the operator '", node_->op, "' ", why));
  }

  // ---- values ----

  std::size_t room(std::int64_t count) {
    auto& memory = network_.memory_;
    const std::size_t at = (memory.size() + kAlignment - 1) / kAlignment * kAlignment;
    if (count < 0 || count > kMaxMemory || static_cast<std::int64_t>(at) > kMaxMemory - count) {
      throw InvalidArgument(text_of("it needs room for more than ", kMaxMemory, " numbers"));
    }
    memory.resize(at + static_cast<std::size_t>(count));
    return at;
  }

  Value& make(const std::string& name, Shape shape) {
    const bool is_possible = shape.size() <= kMaxRank && count_of(shape) <= kMaxMemory &&
                             std::ranges::all_of(shape, [](auto size) { return size >= 1; });
    if (!is_possible) {
      throw InvalidArgument(text_of("'", name, "' has a shape that is not possible"));
    }
    const std::size_t at = room(count_of(shape));
    if (values_.contains(name)) throw InvalidArgument(text_of("'", name, "' is made twice"));
    return values_[name] = {.shape = std::move(shape), .at = at};
  }
  Value& result(Shape shape, std::size_t i = 0) {
    if (i >= node_->outputs.size() || node_->outputs[i].empty()) refuse("has no output");
    return make(node_->outputs[i], std::move(shape));
  }
  // A result that has the numbers of another value, in another shape.
  void alias(const Value& value, Shape shape, std::size_t i = 0) {
    if (i >= node_->outputs.size()) refuse("has no output");
    if (count_of(shape) != count_of(value.shape)) refuse("gives another number of numbers");
    if (shape.size() > kMaxRank) refuse("has too many axes");
    charge(shape.size() + (value.integers ? value.integers->size() : 0));
    Value& same = values_[node_->outputs[i]] = value;
    same.shape = std::move(shape);
  }
  // Whole numbers and shapes take no room, but memory.
  void charge(std::size_t integers) {
    integers_ += integers;
    if (integers_ > kMaxIntegers) throw InvalidArgument("it has too many whole numbers");
  }
  void keep(const std::string& name, const Tensor& tensor) {
    charge(tensor.integers.size() + tensor.shape.size());
    if (!tensor.integers.empty() || (tensor.floats.empty() && count_of(tensor.shape) == 0)) {
      values_[name] = {.shape = tensor.shape, .is_constant = true, .integers = tensor.integers};
      return;
    }
    Value& value = make(name, tensor.shape);
    value.is_constant = true;
    std::ranges::copy(tensor.floats,
                      network_.memory_.begin() + static_cast<std::ptrdiff_t>(value.at));
  }
  void keep_integers(std::vector<std::int64_t> integers, Shape shape) {
    if (node_->outputs.empty()) refuse("has no output");
    charge(integers.size());
    values_[node_->outputs[0]] = {
        .shape = std::move(shape), .is_constant = true, .integers = std::move(integers)};
  }

  [[nodiscard]] bool has(std::size_t i) const {
    return i < node_->inputs.size() && !node_->inputs[i].empty();
  }
  [[nodiscard]] const Value& any(std::size_t i) const {
    if (!has(i)) refuse(text_of("has no input ", i));
    const auto found = values_.find(node_->inputs[i]);
    if (found == values_.end()) refuse(text_of("needs '", node_->inputs[i], "' before it is made"));
    return found->second;
  }
  [[nodiscard]] Value in(std::size_t i) const {
    const Value& value = any(i);
    if (value.integers) refuse("computes with whole numbers, which is not known");
    return value;
  }
  [[nodiscard]] const std::vector<std::int64_t>& integers(std::size_t i) const {
    const Value& value = any(i);
    if (!value.integers) refuse(text_of("has no constant whole numbers as input ", i));
    return *value.integers;
  }
  void require_constant(const Value& value) const {
    if (!value.is_constant) refuse("has weights that are no constants");
  }
  // Where so many constant numbers are; zeros if there is no such input.
  [[nodiscard]] std::size_t bias(std::size_t i, std::int64_t count) {
    if (!has(i)) return zeros(count);
    const Value given = in(i);
    require_constant(given);
    if (count_of(given.shape) != count) refuse("has a bias of another size");
    return given.at;
  }
  // One constant number.
  [[nodiscard]] float number(std::size_t i) const {
    const Value value = in(i);
    if (count_of(value.shape) != 1) refuse("has several numbers where one is known");
    require_constant(value);
    return network_.memory_[value.at];
  }

  [[nodiscard]] const Attribute* attribute(const char* name) const {
    const auto found = node_->attributes.find(name);
    return found != node_->attributes.end() ? &found->second : nullptr;
  }
  [[nodiscard]] std::int64_t integer(const char* name, std::int64_t usual) const {
    const Attribute* const found = attribute(name);
    return found != nullptr ? found->integer : usual;
  }
  [[nodiscard]] float number(const char* name, float usual) const {
    const Attribute* const found = attribute(name);
    return found != nullptr ? found->number : usual;
  }
  // Whole numbers that newer versions of an operator take as an input, older ones as an attribute.
  [[nodiscard]] std::optional<std::vector<std::int64_t>> listed(const char* name,
                                                                std::size_t input) const {
    if (has(input)) return integers(input);
    const Attribute* const found = attribute(name);
    if (found == nullptr) return {};
    return found->integers;
  }
  void require(const char* name, std::int64_t wanted) const {
    if (integer(name, wanted) != wanted) {
      refuse(text_of("has ", name, " ", integer(name, wanted), ", which is not known"));
    }
  }
  [[nodiscard]] std::int64_t axis_of(std::int64_t axis, const Shape& shape) const {
    const auto rank = static_cast<std::int64_t>(shape.size());
    if (axis < -rank || axis >= rank) refuse(text_of("has the axis ", axis, " of ", rank));
    return axis < 0 ? axis + rank : axis;
  }

  // Adds a step, or takes it at once if all that it needs is constant.
  void add(Step step, Value& out, std::initializer_list<Value> from) {
    step.out = out.at;
    if (!std::ranges::all_of(from, &Value::is_constant)) {
      network_.steps_.push_back(std::move(step));
      return;
    }
    for (const Value& one : from) work_ += count_of(one.shape);
    const bool is_window = step.run == convolution_here() || step.run == run_max_pool;
    work_ += step.run == run_dense ? count_of(step.sizes) : count_of(out.shape);
    if (is_window) work_ += step.sizes[0] * count_of(out.shape);
    if (work_ > kMaxWork) throw InvalidArgument("its constants take too long to compute");
    if (!step.run(step, network_.memory_.data())) refuse("gives a number that is not finite");
    out.is_constant = true;
  }

  // ---- inputs and outputs ----

  // One observation at a time: the first size may have a name.
  [[nodiscard]] static Shape shape_of_input(const Place& place) {
    if (!place.has_shape) {
      throw InvalidArgument(text_of("the input '", place.name, "' has no size"));
    }
    Shape shape = place.shape;
    if (!shape.empty() && shape[0] == -1) shape[0] = 1;
    for (const std::int64_t size : shape) {
      if (size >= 1 && size <= kMaxMemory) continue;
      throw InvalidArgument(text_of("the input '", place.name,
                                    "' has a size that is not fixed: export it with fixed sizes, "
                                    "only the first one may be dynamic"));
    }
    return shape;
  }

  void connect() {
    const auto value = [&](const Place& place) {
      const auto found = values_.find(place.name);
      if (found == values_.end() || found->second.integers) {
        throw InvalidArgument(text_of("nothing makes the output '", place.name, "'"));
      }
      return found->second;
    };
    const Value action = value(model_.outputs[0]);
    // Inputs that can have no next state are parts of the observation.
    const std::size_t outputs = model_.outputs.size();
    const std::size_t parts = std::max(model_.inputs.size() + 1, outputs + 1) - outputs;
    for (std::size_t i = 0; i < parts; ++i) {
      const Value part = value(model_.inputs[i]);
      const auto size = static_cast<std::size_t>(count_of(part.shape));
      network_.inputs_.push_back({part.at, size});
      network_.num_inputs_ += size;
    }
    network_.output_ = action.at;
    network_.num_outputs_ = static_cast<std::size_t>(count_of(action.shape));
    for (std::size_t i = parts; i < model_.inputs.size(); ++i) {
      const Value before = value(model_.inputs[i]);
      const Value after = value(model_.outputs[i - parts + 1]);
      if (count_of(after.shape) != count_of(before.shape)) {
        throw InvalidArgument(text_of("the input '", model_.inputs[i].name,
                                      "' has no output of its size that would be its next state"));
      }
      // A copy, because the next state may be where another state is.
      const std::int64_t size = count_of(before.shape);
      const std::size_t next = room(size);
      network_.steps_.push_back(
          {.run = run_rows, .out = next, .in = {after.at}, .sizes = {1, size, size}});
      network_.states_.push_back({before.at, next, static_cast<std::size_t>(size)});
    }
  }

  // ---- operators ----

  void add_unary(std::ptrdiff_t kind) {
    const Value x = in(0);
    std::vector<float> numbers;
    const std::string_view op = node_->op;
    if (op == "Elu") numbers = {number("alpha", 1.0F)};
    if (op == "LeakyRelu") numbers = {number("alpha", 0.01F)};
    if (op == "Selu") numbers = {number("alpha", 1.67326319F), number("gamma", 1.05070102F)};
    if (op == "Gelu") {
      const Attribute* const how = attribute("approximate");
      numbers = {how != nullptr && how->text == "tanh" ? 1.0F : 0.0F};
    }
    if (op == "Clip") {
      constexpr float kMost = std::numeric_limits<float>::max();
      numbers = {has(1) ? number(1) : number("min", -kMost),
                 has(2) ? number(2) : number("max", kMost)};
    }
    Value& out = result(x.shape);
    add({.run = run_unary,
         .in = {x.at},
         .sizes = {count_of(x.shape), kind},
         .numbers = std::move(numbers)},
        out, {x});
  }

  // The shape of both together: sizes of 1 are repeated.
  [[nodiscard]] Shape broadcast(const Shape& a, const Shape& b) const {
    Shape shape(std::max(a.size(), b.size()), 1);
    for (const Shape& one : {a, b}) {
      for (std::size_t i = 0; i < one.size(); ++i) {
        std::int64_t& size = shape[shape.size() - one.size() + i];
        if (one[i] == 1) continue;
        if (size != 1 && size != one[i]) refuse("has inputs whose shapes do not fit together");
        size = one[i];
      }
    }
    return shape;
  }
  // The place in a value, of an index in a shape to which it is repeated.
  [[nodiscard]] static std::int64_t place_of(const Shape& index, const Shape& shape) {
    std::int64_t place = 0;
    for (std::size_t i = 0; i < shape.size(); ++i) {
      place = place * shape[i] + (shape[i] == 1 ? 0 : index[index.size() - shape.size() + i]);
    }
    return place;
  }
  // Calls `visit` with each index of a shape, in order.
  template <class Visitor>
  static void for_each_index(const Shape& shape, const Visitor& visit) {
    Shape index(shape.size(), 0);
    for (std::int64_t n = count_of(shape); n > 0; --n) {
      visit(std::as_const(index));
      for (std::size_t i = shape.size(); i > 0; --i) {
        if (++index[i - 1] < shape[i - 1]) break;
        index[i - 1] = 0;
      }
    }
  }

  void add_binary(std::size_t kind) {
    if (node_->inputs.size() != 2) refuse("has not two inputs");
    const Value a = in(0);
    const Value b = in(1);
    const Shape shape = broadcast(a.shape, b.shape);
    Value& out = result(shape);
    Step step{.run = kBinarySteps[kind], .in = {a.at, b.at}, .sizes = {count_of(shape)}};
    if (a.shape != b.shape) {
      for_each_index(shape, [&](const Shape& index) {
        step.map.push_back(static_cast<std::int32_t>(place_of(index, a.shape)));
        step.map.push_back(static_cast<std::int32_t>(place_of(index, b.shape)));
      });
    }
    add(std::move(step), out, {a, b});
  }

  void where() {
    const std::array values{in(0), in(1), in(2)};
    const Shape shape = broadcast(broadcast(values[0].shape, values[1].shape), values[2].shape);
    Value& out = result(shape);
    Step step{.run = run_where, .in = {values[0].at, values[1].at, values[2].at}};
    for_each_index(shape, [&](const Shape& index) {
      for (const Value& one : values) {
        step.map.push_back(static_cast<std::int32_t>(place_of(index, one.shape)));
      }
    });
    add(std::move(step), out, {values[0], values[1], values[2]});
  }

  // A result each number of which is one of `from`: `place` says which, for an index.
  template <class Where>
  void add_copy(const Value& from, const Shape& shape, const Where& place, std::size_t i = 0) {
    Value& out = result(shape, i);
    Step step{.run = run_copy, .in = {from.at}};
    const std::int64_t count = count_of(from.shape);
    for_each_index(shape, [&](const Shape& index) {
      const std::int64_t at = place(index);
      if (at < 0 || at >= count) refuse("takes numbers that are not there");
      step.map.push_back(static_cast<std::int32_t>(at));
    });
    add(std::move(step), out, {from});
  }

  // Weights in rows for each input, as `add_rows` takes them.
  [[nodiscard]] Value transposed(const Value& value, std::int64_t rows, std::int64_t columns) {
    const Value out{.shape = {columns, rows}, .at = room(rows * columns), .is_constant = true};
    require_constant(value);
    float* const memory = network_.memory_.data();
    for (std::int64_t r = 0; r < rows; ++r) {
      for (std::int64_t c = 0; c < columns; ++c) {
        memory[out.at + static_cast<std::size_t>(c * rows + r)] =
            memory[value.at + static_cast<std::size_t>(r * columns + c)];
      }
    }
    return out;
  }
  [[nodiscard]] std::size_t zeros(std::int64_t count) {
    const std::size_t at = room(count);
    std::fill_n(network_.memory_.begin() + static_cast<std::ptrdiff_t>(at), count, 0.0F);
    return at;
  }

  void add_dense(const Value& x, const Value& weights, std::size_t bias, std::int64_t inputs,
                 std::int64_t outputs, Shape shape) {
    Value& out = result(std::move(shape));
    add({.run = run_dense,
         .in = {x.at, weights.at, bias},
         .sizes = {count_of(x.shape) / inputs, inputs, outputs}},
        out, {x, weights});
  }

  void gemm() {
    require("transA", 0);
    const Value x = in(0);
    Value weights = in(1);
    if (x.shape.size() != 2 || weights.shape.size() != 2) refuse("has inputs that are no matrices");
    const bool is_transposed = integer("transB", 0) != 0;
    const std::int64_t inputs = weights.shape[is_transposed ? 1 : 0];
    const std::int64_t outputs = weights.shape[is_transposed ? 0 : 1];
    if (x.shape[1] != inputs) refuse("has inputs whose shapes do not fit together");
    if (number("alpha", 1.0F) != 1.0F || number("beta", 1.0F) != 1.0F) {
      refuse("has a factor, which is not known");
    }
    if (x.shape[0] > 1 && has(2) && (any(2).shape.empty() || any(2).shape.back() != outputs)) {
      refuse("has a bias for each row, which is not known");
    }
    if (is_transposed) weights = transposed(weights, outputs, inputs);
    add_dense(x, weights, bias(2, outputs), inputs, outputs, {x.shape[0], outputs});
  }

  void mat_mul() {
    const Value x = in(0);
    const Value weights = in(1);
    if (x.shape.empty() || weights.shape.size() != 2 || x.shape.back() != weights.shape[0]) {
      refuse("has inputs whose shapes do not fit together");
    }
    Shape shape = x.shape;
    shape.back() = weights.shape[1];
    add_dense(x, weights, zeros(weights.shape[1]), weights.shape[0], weights.shape[1],
              std::move(shape));
  }

  void layer_norm() {
    const Value x = in(0);
    const Value scale = in(1);
    const std::int64_t axis = axis_of(integer("axis", -1), x.shape);
    const Shape normed(x.shape.begin() + axis, x.shape.end());
    const std::int64_t size = count_of(normed);
    require_constant(scale);
    if (count_of(scale.shape) != size) refuse("has a scale of another size");
    const std::size_t shift = bias(2, size);
    Value& out = result(x.shape);
    add({.run = run_layer_norm,
         .in = {x.at, scale.at, shift},
         .sizes = {count_of(x.shape) / size, size},
         .numbers = {number("epsilon", 1e-5F)}},
        out, {x, scale});
  }

  void batch_norm() {
    const Value x = in(0);
    require("training_mode", 0);
    if (x.shape.size() < 2) refuse("has an input without channels");
    const std::int64_t channels = x.shape[1];
    std::array<std::size_t, 4> at{};
    for (std::size_t i = 0; i < 4; ++i) {
      static_cast<void>(in(i + 1));
      at[i] = bias(i + 1, channels);
    }
    const std::size_t scale = room(channels);
    const std::size_t shift = room(channels);
    float* const memory = network_.memory_.data();
    for (std::size_t c = 0; std::cmp_less(c, channels); ++c) {
      memory[scale + c] =
          memory[at[0] + c] / std::sqrt(memory[at[3] + c] + number("epsilon", 1e-5F));
      memory[shift + c] = memory[at[1] + c] - memory[at[2] + c] * memory[scale + c];
    }
    const Value scaled{
        .shape = x.shape, .at = room(count_of(x.shape)), .is_constant = x.is_constant};
    Value& out = result(x.shape);
    Step multiply{.run = kBinarySteps[2], .out = scaled.at, .in = {x.at, scale}};
    Step add_shift{.run = kBinarySteps[0], .in = {scaled.at, shift}};
    for (Step* step : {&multiply, &add_shift}) {
      step->sizes = {count_of(x.shape)};
      for_each_index(x.shape, [&](const Shape& index) {
        step->map.push_back(static_cast<std::int32_t>(place_of(index, x.shape)));
        step->map.push_back(static_cast<std::int32_t>(index[1]));
      });
    }
    if (x.is_constant) refuse("has a constant input");
    network_.steps_.push_back(std::move(multiply));
    add(std::move(add_shift), out, {x});
  }

  void reduce_mean() {
    const Value x = in(0);
    const auto axes = listed("axes", 1);
    if (!axes || axes->empty()) refuse("has no axes");
    const bool keeps = integer("keepdims", 1) != 0;
    auto first = static_cast<std::int64_t>(x.shape.size());
    for (const std::int64_t axis : *axes) first = std::min(first, axis_of(axis, x.shape));
    if (first + static_cast<std::int64_t>(axes->size()) !=
        static_cast<std::int64_t>(x.shape.size())) {
      refuse("takes the mean over other axes than the last ones, which is not known");
    }
    Shape shape(x.shape.begin(), x.shape.begin() + first);
    const std::int64_t rows = count_of(shape);
    if (keeps) shape.resize(x.shape.size(), 1);
    Value& out = result(shape);
    add({.run = run_mean, .in = {x.at}, .sizes = {rows, count_of(x.shape) / rows}}, out, {x});
  }

  // Gates of ONNX are one after the other: W is gates * units x inputs, B both biases.
  void add_recurrent(std::int64_t gates, bool (*run)(const Step&, float*) noexcept) {
    const Value x = in(0);
    const Value weights = in(1);
    const Value recurrent = in(2);
    const Attribute* const direction = attribute("direction");
    if (direction != nullptr && !direction->text.empty() && direction->text != "forward") {
      refuse("does not go forward, which is not known");
    }
    require("layout", 0);
    require("input_forget", 0);
    if (attribute("activations") != nullptr || attribute("clip") != nullptr || has(4) || has(7)) {
      refuse("has activations, a clip, lengths or peepholes, which are not known");
    }
    if (x.shape.size() != 3 || x.shape[1] != 1) refuse("has not one sequence as its input");
    const std::int64_t inputs = x.shape[2];
    const std::int64_t units = integer("hidden_size", 0);
    if (units < 1 || units > kMaxMemory || weights.shape != Shape{1, gates * units, inputs} ||
        recurrent.shape != Shape{1, gates * units, units}) {
      refuse("has weights of other sizes");
    }
    const std::int64_t width = gates * units;
    const Value turned = transposed(weights, width, inputs);
    const Value fed = transposed(recurrent, width, units);
    const std::size_t both = bias(3, 2 * width);
    const auto first = [&](std::size_t input) {
      if (!has(input)) return zeros(units);
      const Value state = in(input);
      if (count_of(state.shape) != units) refuse("has a first state of another size");
      return state.at;
    };
    Step step{.run = run,
              .in = {x.at, turned.at, fed.at, both, both + static_cast<std::size_t>(width),
                     first(5), room(7 * units), gates == 4 ? first(6) : 0},
              .sizes = {inputs, units, x.shape[0]},
              .numbers = {static_cast<float>(integer("linear_before_reset", 0))}};
    // All states, then the last cell.
    const std::int64_t count = x.shape[0] * units;
    const std::size_t out = step.out = room(count + units);
    network_.steps_.push_back(std::move(step));
    const auto name = [&](std::size_t i, Shape shape, std::int64_t at) {
      if (i >= node_->outputs.size() || node_->outputs[i].empty()) return;
      values_[node_->outputs[i]] = {.shape = std::move(shape),
                                    .at = out + static_cast<std::size_t>(at)};
    };
    name(0, {x.shape[0], 1, 1, units}, 0);
    name(1, {1, 1, units}, count - units);
    name(2, {1, 1, units}, count);
  }
  void gru() { add_recurrent(3, run_gru); }
  void lstm() { add_recurrent(4, run_lstm); }

  // What slides over an image.
  struct Window {
    Value image;          // with its padding
    std::int64_t height;  // of the result
    std::int64_t width;
    Step step{};  // with the map, the first sizes and the image
  };

  // `channels` of the image are in a window at once; the result has `results`.
  Window window(const Value& x, std::int64_t channels, std::int64_t height, std::int64_t width,
                std::int64_t results, float padding) {
    const auto numbers = [&](const char* name, std::size_t count, std::int64_t usual) {
      const Attribute* const found = attribute(name);
      std::vector<std::int64_t> all(count, usual);
      if (found != nullptr) all = found->integers;
      const bool is_fine = all.size() == count && std::ranges::all_of(all, [&](std::int64_t one) {
                             return one >= usual && one <= 65'536;
                           });
      if (!is_fine) refuse(text_of("has ", name, " that make no sense"));
      return all;
    };
    const Attribute* const automatic = attribute("auto_pad");
    if (automatic != nullptr && !automatic->text.empty() && automatic->text != "NOTSET") {
      refuse("pads by itself, which is not known");
    }
    const auto stride = numbers("strides", 2, 1);
    const auto dilation = numbers("dilations", 2, 1);
    if (height < 1 || height > 65'536 || width < 1 || width > 65'536) {
      refuse("has a window of no size");
    }
    const Value image = padded(x, numbers("pads", 4, 0), padding);
    const std::int64_t rows = image.shape[2];
    const std::int64_t columns = image.shape[3];
    const std::int64_t down = rows - dilation[0] * (height - 1) - 1;
    const std::int64_t right = columns - dilation[1] * (width - 1) - 1;
    if (down < 0 || right < 0) refuse("has a window that is larger than the image");
    Window made{.image = image, .height = down / stride[0] + 1, .width = right / stride[1] + 1};
    const std::int64_t taps = channels * height * width;
    if (taps > kMaxWork / results / (made.height * made.width)) refuse("takes too long");
    charge(static_cast<std::size_t>(taps));
    const auto add_all = [&](std::int64_t of, std::int64_t count_down, std::int64_t count_right,
                             std::int64_t step_down, std::int64_t step_right) {
      for (std::int64_t channel = 0; channel < of; ++channel) {
        for (std::int64_t i = 0; i < count_down; ++i) {
          for (std::int64_t j = 0; j < count_right; ++j) {
            made.step.map.push_back(static_cast<std::int32_t>(
                (channel * rows + i * step_down) * columns + j * step_right));
          }
        }
      }
      made.step.sizes.push_back(of * count_down * count_right);
    };
    add_all(channels, height, width, dilation[0], dilation[1]);
    add_all(1, made.height, made.width, stride[0], stride[1]);
    made.step.in = {image.at};
    return made;
  }

  // An image with more numbers above, left, below and right.
  Value padded(const Value& x, const std::vector<std::int64_t>& pads, float padding) {
    if (std::ranges::all_of(pads, [](std::int64_t one) { return one == 0; })) return x;
    Value image{.shape = x.shape};
    image.shape[2] += pads[0] + pads[2];
    image.shape[3] += pads[1] + pads[3];
    if (count_of(image.shape) > kMaxMemory) refuse("needs too much room");
    image.at = room(count_of(image.shape));
    std::fill_n(network_.memory_.begin() + static_cast<std::ptrdiff_t>(image.at),
                count_of(image.shape), padding);
    Step step{.run = run_pad,
              .in = {x.at},
              .sizes = {x.shape[1], x.shape[2], x.shape[3], image.shape[2], image.shape[3],
                        pads[0] * image.shape[3] + pads[1]}};
    add(std::move(step), image, {x});
    return image;
  }

  void convolution() {
    const Value x = in(0);
    const Value weights = in(1);
    const std::int64_t groups = integer("group", 1);
    if (x.shape.size() != 4 || weights.shape.size() != 4 || x.shape[0] != 1) {
      refuse("has not one image with two directions as its input");
    }
    const std::int64_t channels = weights.shape[0];
    if (groups < 1 || channels % groups != 0 || groups > x.shape[1] ||
        weights.shape[1] * groups != x.shape[1]) {
      refuse("has weights for another number of channels");
    }
    require_constant(weights);
    Window made = window(x, weights.shape[1], weights.shape[2], weights.shape[3], channels, 0.0F);
    const std::int64_t taps = made.step.sizes[0];
    const std::size_t given = bias(2, channels);
    // The channels of a group in blocks of `kLanes`: for each tap the weights of a block.
    const std::int64_t of_group = channels / groups;
    const std::size_t packed = zeros(groups * tiled(of_group) * taps);
    const std::size_t shift = zeros(groups * tiled(of_group));
    float* const memory = network_.memory_.data();
    for (std::int64_t channel = 0; channel < channels; ++channel) {
      const std::int64_t at = channel / of_group * tiled(of_group) + channel % of_group;
      const std::int64_t lane = channel % of_group % kLanes;
      memory[shift + static_cast<std::size_t>(at)] =
          memory[given + static_cast<std::size_t>(channel)];
      for (std::int64_t k = 0; k < taps; ++k) {
        memory[packed + static_cast<std::size_t>((at - lane) * taps + k * kLanes + lane)] =
            memory[weights.at + static_cast<std::size_t>(channel * taps + k)];
      }
    }
    Value& out = result({1, channels, made.height, made.width});
    made.step.run = convolution_here();
    made.step.in.insert(made.step.in.end(), {packed, shift});
    made.step.sizes.insert(
        made.step.sizes.end(),
        {groups, of_group, weights.shape[1] * made.image.shape[2] * made.image.shape[3]});
    add(std::move(made.step), out, {made.image, weights});
  }

  void max_pool() {
    const Value x = in(0);
    const Attribute* const kernel = attribute("kernel_shape");
    if (x.shape.size() != 4 || x.shape[0] != 1 || kernel == nullptr ||
        kernel->integers.size() != 2) {
      refuse("has not one image with two directions as its input");
    }
    require("ceil_mode", 0);
    Window made = window(x, 1, kernel->integers[0], kernel->integers[1], x.shape[1],
                         -std::numeric_limits<float>::max());
    Value& out = result({1, x.shape[1], made.height, made.width});
    made.step.run = run_max_pool;
    made.step.sizes.insert(made.step.sizes.end(),
                           {x.shape[1], made.image.shape[2] * made.image.shape[3]});
    add(std::move(made.step), out, {made.image});
  }

  // The mean of each channel.
  void global_mean() {
    const Value x = in(0);
    if (x.shape.size() < 3) refuse("has no image as its input");
    Shape shape(x.shape.size(), 1);
    std::copy_n(x.shape.begin(), 2, shape.begin());
    const std::int64_t rows = shape[0] * shape[1];
    Value& out = result(shape);
    add({.run = run_mean, .in = {x.at}, .sizes = {rows, count_of(x.shape) / rows}}, out, {x});
  }

  // ---- operators that compute nothing ----

  void same() {
    if (has(2)) refuse("is for training");
    alias(any(0), any(0).shape);
  }

  void cast() {
    const Value& value = any(0);
    const bool is_float = integer("to", 1) == 1 || integer("to", 1) == 11;
    if (value.integers && is_float) {
      const std::vector<std::int64_t> integers = *value.integers;
      Value& out = result(value.shape);
      out.is_constant = true;
      std::ranges::transform(integers,
                             network_.memory_.begin() + static_cast<std::ptrdiff_t>(out.at),
                             [](std::int64_t one) { return static_cast<float>(one); });
      return;
    }
    const bool is_whole = integer("to", 1) == 6 || integer("to", 1) == 7;
    if (value.integers ? !is_whole : !is_float) refuse("makes numbers of a type that is not known");
    same();
  }

  void flatten() {
    const Value x = in(0);
    const std::int64_t axis = integer("axis", 1);
    const auto rank = static_cast<std::int64_t>(x.shape.size());
    if (axis < -rank || axis > rank) refuse("has an axis that is not there");
    const auto middle = x.shape.begin() + (axis < 0 ? axis + rank : axis);
    alias(x, {count_of({x.shape.begin(), middle}), count_of({middle, x.shape.end()})});
  }

  void reshape() {
    const Value x = any(0);
    Shape shape = integers(1);
    std::int64_t known = 1;
    std::int64_t* open = nullptr;
    for (std::size_t i = 0; i < shape.size(); ++i) {
      if (shape[i] == 0 && i < x.shape.size()) shape[i] = x.shape[i];
      if (shape[i] == -1 && open == nullptr) {
        open = &shape[i];
        continue;
      }
      if (shape[i] < 1 || known > kMaxMemory / shape[i]) refuse("has a shape that makes no sense");
      known *= shape[i];
    }
    if (open != nullptr) *open = count_of(x.shape) / known;
    alias(x, std::move(shape));
  }

  void squeeze() {
    const Value x = any(0);
    const auto axes = listed("axes", 1);
    std::vector<std::int64_t> gone;
    for (const std::int64_t axis : axes.value_or(std::vector<std::int64_t>{})) {
      gone.push_back(axis_of(axis, x.shape));
    }
    Shape shape;
    for (std::size_t i = 0; i < x.shape.size(); ++i) {
      const bool is_gone = axes
                               ? std::ranges::find(gone, static_cast<std::int64_t>(i)) != gone.end()
                               : x.shape[i] == 1;
      if (!is_gone) shape.push_back(x.shape[i]);
    }
    alias(x, std::move(shape));
  }

  void unsqueeze() {
    const Value x = any(0);
    const auto axes = listed("axes", 1);
    if (!axes) refuse("has no axes");
    Shape shape(x.shape.size() + axes->size(), 0);
    for (const std::int64_t axis : *axes) {
      shape[static_cast<std::size_t>(axis_of(axis, shape))] = 1;
    }
    auto next = x.shape.begin();
    for (std::int64_t& size : shape) {
      if (size == 0 && next != x.shape.end()) size = *next++;
    }
    alias(x, std::move(shape));
  }

  void constant_node() {
    const Attribute* const value = attribute("value");
    const Attribute* const one = attribute("value_float");
    const Attribute* const whole = attribute("value_int");
    const Attribute* const several = attribute("value_ints");
    if (node_->outputs.empty()) refuse("has no output");
    if (value != nullptr) {
      keep(node_->outputs[0], value->tensor);
    } else if (one != nullptr) {
      keep(node_->outputs[0], {.floats = {one->number}});
    } else if (whole != nullptr) {
      keep_integers({whole->integer}, {});
    } else if (several != nullptr) {
      keep_integers(several->integers, {static_cast<std::int64_t>(several->integers.size())});
    } else {
      refuse("has no numbers");
    }
  }

  void constant_of_shape() {
    const Shape shape = integers(0);
    const Attribute* const value = attribute("value");
    if (value != nullptr && value->tensor.floats.empty()) {
      refuse("makes whole numbers, which is not known");
    }
    Value& out = result(shape);
    out.is_constant = true;
    std::fill_n(network_.memory_.begin() + static_cast<std::ptrdiff_t>(out.at), count_of(shape),
                value != nullptr ? value->tensor.floats.front() : 0.0F);
  }

  void shape() {
    const Shape shape = any(0).shape;
    if (attribute("start") != nullptr || attribute("end") != nullptr) {
      refuse("takes a part of a shape, which is not known");
    }
    keep_integers(shape, {static_cast<std::int64_t>(shape.size())});
  }

  void gather() {
    const Value x = any(0);
    const std::vector<std::int64_t> chosen = integers(1);
    const Shape chosen_shape = any(1).shape;
    const std::int64_t axis = axis_of(integer("axis", 0), x.shape);
    const auto size = x.shape[static_cast<std::size_t>(axis)];
    const auto row = [&](std::size_t i) {
      const std::int64_t one = chosen[i] < 0 ? chosen[i] + size : chosen[i];
      if (one < 0 || one >= size) refuse("takes numbers that are not there");
      return one;
    };
    if (x.integers) {
      if (x.shape.size() != 1) refuse("takes whole numbers of a matrix, which is not known");
      std::vector<std::int64_t> taken;
      taken.reserve(chosen.size());
      for (std::size_t i = 0; i < chosen.size(); ++i) {
        taken.push_back(x.integers->at(static_cast<std::size_t>(row(i))));
      }
      keep_integers(std::move(taken), chosen_shape);
      return;
    }
    Shape shape(x.shape.begin(), x.shape.begin() + axis);
    shape.insert(shape.end(), chosen_shape.begin(), chosen_shape.end());
    shape.insert(shape.end(), x.shape.begin() + axis + 1, x.shape.end());
    add_copy(x, shape, [&](const Shape& index) {
      const auto begin = index.begin() + axis;
      const auto end = begin + static_cast<std::ptrdiff_t>(chosen_shape.size());
      Shape from(index.begin(), begin);
      std::int64_t place = 0;
      for (std::size_t i = 0; i < chosen_shape.size(); ++i) {
        place = place * chosen_shape[i] + begin[static_cast<std::ptrdiff_t>(i)];
      }
      from.push_back(row(static_cast<std::size_t>(place)));
      from.insert(from.end(), end, index.end());
      return place_of(from, x.shape);
    });
  }

  void transpose() {
    const Value x = in(0);
    std::vector<std::int64_t> order(x.shape.size());
    std::iota(order.rbegin(), order.rend(), 0);
    if (const Attribute* const given = attribute("perm")) order = given->integers;
    std::vector<std::int64_t> sorted = order;
    std::ranges::sort(sorted);
    for (std::size_t i = 0; i < sorted.size(); ++i) {
      if (std::cmp_not_equal(sorted[i], i)) refuse("has an order that makes no sense");
    }
    if (order.size() != x.shape.size()) refuse("has an order that makes no sense");
    Shape shape;
    for (const std::int64_t axis : order) shape.push_back(x.shape[static_cast<std::size_t>(axis)]);
    add_copy(x, shape, [&](const Shape& index) {
      Shape from(index.size());
      for (std::size_t i = 0; i < order.size(); ++i) {
        from[static_cast<std::size_t>(order[i])] = index[i];
      }
      return place_of(from, x.shape);
    });
  }

  void slice() {
    const Value x = in(0);
    const auto starts = listed("starts", 1);
    const auto ends = listed("ends", 2);
    if (!starts || !ends || starts->size() != ends->size()) refuse("has no starts and ends");
    std::vector<std::int64_t> axes(starts->size());
    std::iota(axes.begin(), axes.end(), 0);
    if (const auto given = listed("axes", 3)) axes = *given;
    const std::vector<std::int64_t> steps =
        has(4) ? integers(4) : std::vector<std::int64_t>(starts->size(), 1);
    if (axes.size() != starts->size() || steps.size() != starts->size()) {
      refuse("has no axis or step for a start");
    }
    Shape shape = x.shape;
    Shape first(x.shape.size(), 0);
    Shape stride(x.shape.size(), 1);
    for (std::size_t i = 0; i < axes.size(); ++i) {
      const auto axis = static_cast<std::size_t>(axis_of(axes[i], x.shape));
      const std::int64_t size = x.shape[axis];
      const auto inside = [size](std::int64_t at) {
        return std::clamp<std::int64_t>(at < 0 ? at + size : at, 0, size);
      };
      if (steps[i] < 1) refuse("goes backward, which is not known");
      first[axis] = inside(std::max((*starts)[i], -size));
      stride[axis] = std::min(steps[i], size);
      const std::int64_t length = inside(std::max((*ends)[i], -size)) - first[axis];
      shape[axis] = (length + stride[axis] - 1) / stride[axis];
    }
    add_copy(x, shape, [&](Shape index) {
      for (std::size_t i = 0; i < index.size(); ++i) index[i] = first[i] + index[i] * stride[i];
      return place_of(index, x.shape);
    });
  }

  void split() {
    const Value x = in(0);
    const auto axis = static_cast<std::size_t>(axis_of(integer("axis", 0), x.shape));
    const auto parts = static_cast<std::int64_t>(node_->outputs.size());
    if (parts < 1) refuse("has no output");
    std::vector<std::int64_t> sizes(node_->outputs.size(), (x.shape[axis] + parts - 1) / parts);
    sizes.back() = x.shape[axis] - sizes.front() * (parts - 1);
    if (const auto given = listed("split", 1)) sizes = *given;
    if (sizes.size() != node_->outputs.size()) refuse("has sizes for another number of outputs");
    std::int64_t first = 0;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      Shape shape = x.shape;
      shape[axis] = sizes[i];
      add_copy(
          x, shape,
          [&](Shape index) {
            index[axis] += first;
            return index[axis] < x.shape[axis] ? place_of(index, x.shape) : -1;
          },
          i);
      first += sizes[i];
    }
  }

  void expand() {
    const Value x = in(0);
    const Shape shape = broadcast(x.shape, integers(1));
    add_copy(x, shape, [&](const Shape& index) { return place_of(index, x.shape); });
  }

  void concat() {
    const Value first = any(0);
    const auto axis = static_cast<std::size_t>(axis_of(integer("axis", 0), first.shape));
    if (first.integers) {
      std::vector<std::int64_t> all;
      for (std::size_t i = 0; i < node_->inputs.size(); ++i) {
        if (any(i).shape.size() != 1) refuse("joins matrices of whole numbers, which is not known");
        charge(integers(i).size());
        all.insert(all.end(), integers(i).begin(), integers(i).end());
      }
      const auto count = static_cast<std::int64_t>(all.size());
      keep_integers(std::move(all), {count});
      return;
    }
    Shape shape = first.shape;
    shape[axis] = 0;
    for (std::size_t i = 0; i < node_->inputs.size(); ++i) {
      Shape one = in(i).shape;
      if (one.size() != shape.size()) refuse("has inputs whose shapes do not fit together");
      shape[axis] += std::exchange(one[axis], first.shape[axis]);
      if (one != first.shape) refuse("has inputs whose shapes do not fit together");
    }
    Value& out = result(shape);
    out.is_constant = true;
    const auto axis_place = static_cast<std::ptrdiff_t>(axis);
    const std::int64_t rows = count_of({shape.begin(), shape.begin() + axis_place});
    const std::int64_t width = count_of(shape) / rows;
    std::size_t begin = out.at;
    for (std::size_t i = 0; i < node_->inputs.size(); ++i) {
      const Value one = in(i);
      const std::int64_t size = count_of(one.shape) / rows;
      Step step{.run = run_rows, .out = begin, .in = {one.at}, .sizes = {rows, size, width}};
      begin += static_cast<std::size_t>(size);
      if (one.is_constant) {
        (void)step.run(step, network_.memory_.data());
      } else {
        network_.steps_.push_back(std::move(step));
        out.is_constant = false;
      }
    }
  }

  const Model& model_;
  Network& network_;
  const Node* node_{nullptr};
  std::map<std::string, Value> values_{};
  std::size_t integers_{0};
  std::int64_t work_{0};  // of steps that were taken at once
};

const std::array<Compiler::Operator, 27> Compiler::kOperators{
    {{"Gemm", &Compiler::gemm},
     {"MatMul", &Compiler::mat_mul},
     {"LayerNormalization", &Compiler::layer_norm},
     {"BatchNormalization", &Compiler::batch_norm},
     {"ReduceMean", &Compiler::reduce_mean},
     {"GRU", &Compiler::gru},
     {"LSTM", &Compiler::lstm},
     {"Conv", &Compiler::convolution},
     {"MaxPool", &Compiler::max_pool},
     {"GlobalAveragePool", &Compiler::global_mean},
     {"Where", &Compiler::where},
     {"Identity", &Compiler::same},
     {"Dropout", &Compiler::same},
     {"Cast", &Compiler::cast},
     {"Flatten", &Compiler::flatten},
     {"Reshape", &Compiler::reshape},
     {"Squeeze", &Compiler::squeeze},
     {"Unsqueeze", &Compiler::unsqueeze},
     {"Constant", &Compiler::constant_node},
     {"ConstantOfShape", &Compiler::constant_of_shape},
     {"Shape", &Compiler::shape},
     {"Gather", &Compiler::gather},
     {"Transpose", &Compiler::transpose},
     {"Slice", &Compiler::slice},
     {"Split", &Compiler::split},
     {"Expand", &Compiler::expand},
     {"Concat", &Compiler::concat}}};

Network::Network(const Model& model) { Compiler(model, *this).compile(); }

void Network::reset() noexcept {
  for (const State& state : states_) {
    std::fill_n(memory_.begin() + static_cast<std::ptrdiff_t>(state.input), state.size, 0.0F);
  }
}

bool Network::evaluate(std::span<const double> observation, std::span<double> action) noexcept {
  const auto fails = [this] {
    reset();
    return false;
  };
  if (observation.size() != num_inputs_ || action.size() != num_outputs_) return fails();
  float* const memory = memory_.data();
  const double* from = observation.data();
  for (const Input& input : inputs_) {
    if (!take(from, static_cast<std::int64_t>(input.size), memory + input.at)) return fails();
    from += input.size;
  }
  for (const Step& step : steps_) {
    if (!step.run(step, memory)) return fails();
  }
  const float* const out = memory + output_;
  if (!are_finite(out, static_cast<std::int64_t>(num_outputs_))) return fails();
  for (const State& state : states_) {
    if (!are_finite(memory + state.output, static_cast<std::int64_t>(state.size))) return fails();
  }
  std::copy_n(out, num_outputs_, action.begin());
  for (const State& state : states_) {
    std::copy_n(memory + state.output, state.size, memory + state.input);
  }
  return true;
}

}  // namespace trifinger::onnx
