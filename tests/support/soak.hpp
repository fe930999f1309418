// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstdlib>
#include <string_view>

namespace trifinger::test {

/// True in `./run soak`, where tests may take hours.
[[nodiscard]] inline bool is_soak() {
  const char* const value = std::getenv("TRIFINGER_SOAK");
  return value != nullptr && std::string_view(value) == "1";
}

/// How often a test tries what it tries: `usual` times in `./run test`, `soak` times in `./run
/// soak`.
[[nodiscard]] inline std::int64_t repetitions(std::int64_t usual, std::int64_t soak) {
  return is_soak() ? soak : usual;
}

}  // namespace trifinger::test
