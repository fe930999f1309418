// SPDX-License-Identifier: BSD-3-Clause
#include "shared/options.hpp"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <span>
#include <string_view>

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

// Returns the number in `text` times its unit, which must be one of `units`.
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

CLI::Option* add_scheduling(CLI::App& command, Demand& value, const std::string& description) {
  return add_choice(command, "--scheduling", value,
                    {{"require", Demand::kRequire}, {"try", Demand::kTry}, {"off", Demand::kOff}},
                    description);
}

CLI::Option* add_number(CLI::App& command, const std::string& name,
                        const std::function<void(double)>& set, double least, double most,
                        const std::string& description) {
  const auto parse_and_set = [name, set, least, most](const std::string& text) {
    char* end = nullptr;
    const double number = std::strtod(text.c_str(), &end);
    const bool is_number = end != text.c_str() && *end == '\0';
    const bool is_within = least <= number && number <= most;  // false for NaN
    if (!is_number || !is_within) {
      throw UsageError(
          fmt::format("{} is '{}', must be a number from {:g} to {:g}", name, text, least, most));
    }
    set(number);
  };
  return command.add_option_function<std::string>(name, parse_and_set, description);
}

CLI::Option* add_size(CLI::App& command, const std::string& name, std::uint64_t& value,
                      const std::string& description) {
  const auto set = [name, &value](const std::string& text) {
    value = static_cast<std::uint64_t>(
        std::llround(parse(name, text, kSizes, "a size such as 500MB or 2GiB")));
  };
  return command.add_option_function<std::string>(name, set, description)->option_text("SIZE");
}

CLI::Option* add_json(CLI::App& command, bool& value) {
  return command.add_flag("--json", value, "Print one JSON object, for programs; SI units");
}

CLI::Option* add_overrides(CLI::App& command, std::vector<std::string>& value,
                           const std::string& example, const std::string& what) {
  return command.add_option("--set", value, what + ", as in " + example)
      ->allow_extra_args(false)
      ->option_text("KEY=VALUE");
}

CLI::Option* add_duration(CLI::App& command, const std::string& name, Nanoseconds& value,
                          const std::string& description) {
  const auto set = [name, &value](const std::string& text) {
    value =
        Nanoseconds(std::llround(parse(name, text, kDurations, "a time such as 30s, 10min or 1h")));
  };
  return command.add_option_function<std::string>(name, set, description)->option_text("TIME");
}

}  // namespace trifinger::apps
