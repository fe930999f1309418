// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/base/time.hpp"

#include <array>
#include <cstdio>

namespace trifinger {

std::string duration_text(Nanoseconds duration) {
  const auto count = static_cast<double>(duration.count());
  const auto text = [](const char* format, double number) {
    std::array<char, 64> buffer{};
    std::snprintf(buffer.data(), buffer.size(), format, number);
    return std::string(buffer.data());
  };
  // Each unit is used up to the value, after rounding, at which the next unit begins.
  if (count < 999.5) return text("%.0f ns", count);
  if (count < 999.5e3) return text("%.0f µs", count / 1e3);
  if (count < 999.5e6) return text("%.3g ms", count / 1e6);
  if (count < 999.5e9) return text("%.3g s", count / 1e9);
  return text("%.0f s", count / 1e9);
}

}  // namespace trifinger
