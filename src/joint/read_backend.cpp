// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/read_backend.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "base/text_of.hpp"

namespace trifinger {

using config::Node;
using config::Range;

Nanoseconds read_period(const Node& period) {
  return std::chrono::round<Nanoseconds>(
      std::chrono::duration<double>(period.as<double>({.unit = "s", .min = 1e-4, .max = 0.1})));
}

BackendOptions read_backend(const Node& section, SessionOptions& session, Nanoseconds step) {
  constexpr double kMaxCount = 1e6;
  BackendOptions options;
  options.mode = section.required_choice<BackendOptions::Mode>(
      "mode", {{"real_time", BackendOptions::Mode::kRealTime},
               {"non_real_time", BackendOptions::Mode::kNonRealTime}});
  const Node period = section.at("period", "s");
  options.period = read_period(period);
  if (options.period % step != Nanoseconds::zero()) {
    period.fail("is " + detail::text_of(std::chrono::duration<double>(options.period).count()) +
                " s, must be a whole number of milliseconds in a simulation");
  }

  const Node late_action = section.section("late_action");
  const bool repeats =
      late_action.required_choice<bool>("policy", {{"stop", false}, {"repeat", true}});
  const Range count{.min = 0, .max = kMaxCount};
  // This key is read for both policies, so that changing the policy for a try needs no other
  // change.
  const auto max_repeats =
      late_action.optional<std::uint32_t>("max_repeats", 0, {.min = 1, .max = kMaxCount});
  if (repeats) {
    static_cast<void>(late_action.at("max_repeats"));
    options.max_action_repeats = max_repeats;
  }
  options.max_rejected_actions = section.required<std::uint32_t>("max_rejected_actions", count);
  options.max_skipped_ticks = section.required<std::uint32_t>("max_skipped_ticks", count);
  options.max_late_steps = section.required<std::uint32_t>("max_late_steps", count);
  const auto timeout = [&section](const char* name) {
    const auto time = section.required<double>(
        name, {.unit = "s", .min = 0, .above_min = true, .allow_infinite = true});
    // Longer times would overflow nanoseconds: more than 30 years counts as for ever.
    constexpr double kLongest = 1e9;
    return time > kLongest ? kForever
                           : std::chrono::ceil<Nanoseconds>(std::chrono::duration<double>(time));
  };
  options.max_measurement_age = timeout("max_measurement_age");
  options.first_action_timeout = timeout("first_action_timeout");
  session.history = section.required<std::size_t>("history", {.min = 16, .max = 1048576});
  session.mode = section.required_choice<unsigned>("access", {{"owner", 0600U}, {"group", 0660U}});
  return options;
}

}  // namespace trifinger
