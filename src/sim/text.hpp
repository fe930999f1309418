// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sstream>
#include <string>

namespace trifinger::sim {

// Formats a number as people write it: "0.001", not "0.001000".
inline std::string text_of(double number) {
  std::ostringstream text;
  text << number;
  return text.str();
}

}  // namespace trifinger::sim
