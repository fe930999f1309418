// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger::control {

// Throws unless `value` is a finite number above zero.
inline void require_positive(const char* name, double value) {
  if (std::isfinite(value) && value > 0.0) return;
  throw InvalidArgument(std::string(name) + " is " + std::to_string(value) + ", must be above 0");
}

inline void require_not_negative(const char* name, double value) {
  if (std::isfinite(value) && value >= 0.0) return;
  throw InvalidArgument(std::string(name) + " is " + std::to_string(value) +
                        ", must be at least 0");
}

template <class Numbers>
void require_finite(const char* name, const Numbers& numbers) {
  if (numbers.allFinite()) return;
  throw InvalidArgument(std::string(name) + " has a number that is not finite");
}

}  // namespace trifinger::control
