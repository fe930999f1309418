// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "trifinger/base/time.hpp"

// Figures in words, the same in every command.
namespace trifinger::apps {

// "850 ns", "12 µs", "1.28 ms", "2 s".
[[nodiscard]] std::string text_of(Nanoseconds duration);
// "1000 Hz", "184 kHz".
[[nodiscard]] std::string rate_text(double rate);
// "1 step", "12 steps".
[[nodiscard]] std::string counted(std::int64_t count, const std::string& what);

}  // namespace trifinger::apps
