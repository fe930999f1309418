// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <random>
#include <string>

namespace trifinger::log {

// Returns 64 random bits in hexadecimal. They tell one recording from all others.
[[nodiscard]] inline std::string random_id() {
  std::random_device random;
  std::string id;
  for (int i = 0; i < 16; ++i) id += "0123456789abcdef"[random() % 16];
  return id;
}

}  // namespace trifinger::log
