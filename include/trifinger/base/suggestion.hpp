// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace trifinger {

/// The candidate that `word` is most likely a misspelling of; empty if none comes near.
[[nodiscard]] std::string_view closest(std::string_view word,
                                       const std::vector<std::string_view>& candidates);

/// "'a', 'b' or 'c'"
[[nodiscard]] std::string quoted_list(const std::vector<std::string_view>& words,
                                      std::string_view conjunction);

}  // namespace trifinger
