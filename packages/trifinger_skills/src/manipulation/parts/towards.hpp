// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

namespace trifinger::manipulation {

// `value`, nearer to `target` by at most `most`.
[[nodiscard]] inline double towards(double value, double target, double most) noexcept {
  return value + std::clamp(target - value, -most, most);
}

}  // namespace trifinger::manipulation
