// SPDX-License-Identifier: BSD-3-Clause
#include "text.hpp"

#include <fmt/format.h>

namespace trifinger::apps {

std::string text_of(Nanoseconds duration) {
  const auto count = static_cast<double>(duration.count());
  if (count < 1e3) return fmt::format("{:.0f} ns", count);
  if (count < 999.5e3) return fmt::format("{:.0f} µs", count / 1e3);
  if (count < 999.5e6) return fmt::format("{:.3g} ms", count / 1e6);
  return fmt::format("{:.3g} s", count / 1e9);
}

std::string rate_text(double rate) {
  if (rate < 9.95) return fmt::format("{:.1f} Hz", rate);
  if (rate < 99.95e3) return fmt::format("{:.0f} Hz", rate);
  if (rate < 999.5e3) return fmt::format("{:.0f} kHz", rate / 1e3);
  return fmt::format("{:.1f} MHz", rate / 1e6);
}

std::string counted(std::int64_t count, const std::string& what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

std::string lateness_text(Nanoseconds p50, Nanoseconds p99, Nanoseconds max) {
  return fmt::format("p50 {}, p99 {}, max {}", text_of(p50), text_of(p99), text_of(max));
}

std::string lateness_text(const LatenessHistogram& lateness) {
  return lateness_text(lateness.quantile(0.5), lateness.quantile(0.99), lateness.max());
}

std::string worst_text(const TimingRecord& timing) {
  std::string text;
  for (const LateStep& step : timing.worst()) {
    text += fmt::format("{}step {} by {} ({})", text.empty() ? "" : ", ", step.time_index,
                        text_of(step.lateness), name_of(step.cause));
  }
  return text;
}

}  // namespace trifinger::apps
