// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace trifinger {

/// Returns the candidate that `word` most likely misspells; empty if none is similar.
[[nodiscard]] std::string_view closest(std::string_view word,
                                       const std::vector<std::string_view>& candidates);

/// Joins the words like this: "'a', 'b' or 'c'".
[[nodiscard]] std::string quoted_list(const std::vector<std::string_view>& words,
                                      std::string_view conjunction);

}  // namespace trifinger
