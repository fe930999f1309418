// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>

#include "base/suggestion.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::bindings {

/// The enumerators of every `Precision`.
inline constexpr std::array<std::string_view, 2> kPrecisions{"double", "single"};
inline constexpr std::array<std::string_view, 3> kImageStorages{"none", "jpeg", "raw"};

/// Returns the enumerator that has the same index in its enumeration as `word` in `words`.
/// @throws InvalidArgument that names `what`, the value found and the values allowed
template <class Enumeration, std::size_t kCount>
[[nodiscard]] Enumeration choice(const char* what,
                                 const std::array<std::string_view, kCount>& words,
                                 const std::string& word) {
  const auto* const found = std::ranges::find(words, std::string_view(word));
  if (found == words.end()) {
    throw InvalidArgument(std::string(what) + " is '" + word + "', must be " +
                          quoted_list({words.begin(), words.end()}, "or"));
  }
  return static_cast<Enumeration>(found - words.begin());
}

}  // namespace trifinger::bindings
