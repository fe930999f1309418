// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/base/random.hpp"

#include <cmath>
#include <numbers>

namespace trifinger {
namespace {

// The C libraries' own logarithms differ in their last bits. Additions, multiplications, divisions
// and roots do not differ. CMakeLists.txt keeps compilers from fusing them. `value` must be
// positive.
double logarithm(double value) noexcept {
  int exponent = 0;
  double fraction = std::frexp(value, &exponent);
  if (fraction < 1.0 / std::numbers::sqrt2) {
    fraction *= 2.0;
    --exponent;
  }
  // log(fraction) = 2 artanh(ratio). Since ratio^2 < 0.03, 12 terms of its series reach the last
  // bit.
  const double ratio = (fraction - 1.0) / (fraction + 1.0);
  const double square = ratio * ratio;
  double sum = 0.0;
  for (int i = 11; i >= 0; --i) sum = sum * square + 1.0 / (2 * i + 1);
  return 2.0 * ratio * sum + exponent * std::numbers::ln2;
}

struct Block {
  std::uint64_t first;
  std::uint64_t second;
};

std::uint32_t low_half(std::uint64_t value) noexcept { return static_cast<std::uint32_t>(value); }
std::uint32_t high_half(std::uint64_t value) noexcept {
  return static_cast<std::uint32_t>(value >> 32U);
}
std::uint64_t joined(std::uint32_t low, std::uint32_t high) noexcept {
  return low | static_cast<std::uint64_t>(high) << 32U;
}

Block next(Random& random) noexcept {
  const std::uint64_t count = random.count++;
  const auto numbers = philox4x32_10(
      {low_half(count), high_half(count), low_half(random.episode), high_half(random.episode)},
      {low_half(random.seed), high_half(random.seed)});
  return {joined(numbers[0], numbers[1]), joined(numbers[2], numbers[3])};
}

// A multiple of 2^-53, at least 0 and below 1.
double fraction_of(std::uint64_t bits) noexcept {
  return static_cast<double>(bits >> 11U) * 0x1p-53;
}

}  // namespace

std::array<std::uint32_t, 4> philox4x32_10(std::array<std::uint32_t, 4> counter,
                                           std::array<std::uint32_t, 2> key) noexcept {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t first = std::uint64_t{0xD2511F53} * counter[0];
    const std::uint64_t second = std::uint64_t{0xCD9E8D57} * counter[2];
    counter = {high_half(second) ^ counter[1] ^ key[0], low_half(second),
               high_half(first) ^ counter[3] ^ key[1], low_half(first)};
    key[0] += 0x9E3779B9U;
    key[1] += 0xBB67AE85U;
  }
  return counter;
}

double Random::uniform(double low, double high) noexcept {
  const double value = low + (high - low) * fraction_of(next(*this).first);
  // Each number gets the values that round to it. Only half a share rounds to `low`. The other half
  // is the values that round to `high`.
  return value < high ? value : low;
}

double Random::normal() noexcept {
  // Marsaglia's polar method. It gives two numbers; this uses only one, so there is no state to
  // keep.
  while (true) {
    const Block block = next(*this);
    const double x = 2.0 * fraction_of(block.first) - 1.0;
    const double y = 2.0 * fraction_of(block.second) - 1.0;
    const double square = x * x + y * y;
    if (square > 0.0 && square < 1.0) return x * std::sqrt(-2.0 * logarithm(square) / square);
  }
}

std::int64_t Random::integer(std::int64_t low, std::int64_t high) noexcept {
  if (high <= low) return low;
  // The difference is unsigned because it may be too large for a signed number.
  const std::uint64_t choices = static_cast<std::uint64_t>(high) - static_cast<std::uint64_t>(low);
  // The remainder of 2^64 when all choices have got equal shares. These values are drawn again.
  const std::uint64_t remainder = (0 - choices) % choices;
  std::uint64_t bits = 0;
  do {
    bits = next(*this).first;
  } while (bits < remainder);
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(low) + bits % choices);
}

}  // namespace trifinger
