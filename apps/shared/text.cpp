// SPDX-License-Identifier: BSD-3-Clause
#include "shared/text.hpp"

#include <fmt/format.h>

namespace trifinger::apps {

std::string rate_text(double rate) {
  if (rate < 9.95) return fmt::format("{:.1f} Hz", rate);
  if (rate < 99.95e3) return fmt::format("{:.0f} Hz", rate);
  if (rate < 999.5e3) return fmt::format("{:.0f} kHz", rate / 1e3);
  return fmt::format("{:.1f} MHz", rate / 1e6);
}

std::string counted(std::int64_t count, const std::string& what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

std::vector<std::string> realtime_lines(const std::vector<std::string>& warnings) {
  if (warnings.empty()) return {"yes"};
  std::vector<std::string> lines = warnings;
  lines.front() = "no: " + lines.front();
  return lines;
}

std::string worst_text(const TimingRecord& timing) {
  std::string text;
  for (const LateStep& step : timing.worst()) {
    text += fmt::format("{}step {} by {} ({})", text.empty() ? "" : ", ", step.time_index,
                        duration_text(step.lateness), name_of(step.cause));
  }
  return text;
}

}  // namespace trifinger::apps
