// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/timing.hpp"

// Texts for figures; all commands use the same words.
namespace trifinger::apps {

// Formats a rate: "1000 Hz", "184 kHz".
[[nodiscard]] std::string rate_text(double rate);
// Formats a count: "1 step", "12 steps".
[[nodiscard]] std::string counted(std::int64_t count, const std::string& what);
// Says whether a loop runs as a real-time thread, one line each: "yes", or "no: " and what it
// lacks.
[[nodiscard]] std::vector<std::string> realtime_lines(const std::vector<std::string>& warnings);
// Formats the worst steps: "step 77 by 1.2 ms (user), step 12 by 800 µs (driver)".
[[nodiscard]] std::string worst_text(const TimingRecord& timing);

}  // namespace trifinger::apps
