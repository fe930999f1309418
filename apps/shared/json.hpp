// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>

#include "shared/step_counts.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/timing.hpp"

// What commands print for programs: one JSON object in SI units.
namespace trifinger::apps {

using Json = nlohmann::ordered_json;

[[nodiscard]] inline double seconds(Nanoseconds time) {
  return static_cast<double>(time.count()) / 1e9;
}

// Returns a list with `make` of each value.
template <class Values, class Make>
[[nodiscard]] Json list_of(const Values& values, const Make& make) {
  Json list = Json::array();
  for (const auto& value : values) list.push_back(make(value));
  return list;
}

[[nodiscard]] Json json_of(const TimingRecord& timing, const StepCounts& counts);
[[nodiscard]] Json json_of(const SessionInfo& info);

void print_json(const Json& json);

}  // namespace trifinger::apps
