// SPDX-License-Identifier: BSD-3-Clause
#include "shared/quantity.hpp"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <span>
#include <string_view>

#include "shared/exit_code.hpp"

namespace trifinger::apps {
namespace {

struct Unit {
  std::string_view name;
  double factor;
};

constexpr std::array<Unit, 11> kSizes{{{"", 1.0},
                                       {"B", 1.0},
                                       {"bytes", 1.0},
                                       {"kB", 1e3},
                                       {"MB", 1e6},
                                       {"GB", 1e9},
                                       {"TB", 1e12},
                                       {"KiB", 1024.0},
                                       {"MiB", 1024.0 * 1024.0},
                                       {"GiB", 1024.0 * 1024.0 * 1024.0},
                                       {"TiB", 1024.0 * 1024.0 * 1024.0 * 1024.0}}};
constexpr std::array<Unit, 5> kDurations{
    {{"ms", 1e6}, {"s", 1e9}, {"min", 60e9}, {"h", 3600e9}, {"d", 86400e9}}};

// Returns the number in `text` times its unit, if the unit is one of `units` and the result is
// below `limit`.
double parse(const std::string& option, const std::string& text, std::span<const Unit> units,
             std::string_view examples) {
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  std::string_view unit(end);
  while (unit.starts_with(' ')) unit.remove_prefix(1);
  // Far below overflow.
  constexpr double kLimit = 9e18;
  for (const Unit& known : units) {
    const bool is_known = end != text.c_str() && unit == known.name;
    if (is_known && std::isfinite(number) && number >= 0.0 && number * known.factor < kLimit) {
      return number * known.factor;
    }
  }
  throw UsageError(fmt::format("{} is '{}', must be {}", option, text, examples));
}

}  // namespace

std::uint64_t parse_size(const std::string& option, const std::string& text) {
  return static_cast<std::uint64_t>(
      std::llround(parse(option, text, kSizes, "a size such as 500MB or 2GiB")));
}

Nanoseconds parse_duration(const std::string& option, const std::string& text) {
  return Nanoseconds(
      std::llround(parse(option, text, kDurations, "a time such as 30s, 10min or 1h")));
}

}  // namespace trifinger::apps
