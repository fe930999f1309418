// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>

#include "trifinger/base/time.hpp"

namespace trifinger::detail {

[[nodiscard]] constexpr double in_seconds(Nanoseconds time) noexcept {
  return std::chrono::duration<double>(time).count();
}

}  // namespace trifinger::detail
