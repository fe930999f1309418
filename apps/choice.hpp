// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/core.h>

#include <CLI/App.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "suggestion.hpp"

namespace trifinger::apps {

// The words that may be typed, and what they mean.
template <class T>
using Choices = std::vector<std::pair<std::string, T>>;

// What `word` means. Throws UsageError that names the `option` and the words there are.
template <class T>
[[nodiscard]] const T& choose(const Choices<T>& choices, const std::string& option,
                              const std::string& word) {
  std::vector<std::string_view> words;
  for (const auto& [known, value] : choices) {
    if (word == known) return value;
    words.push_back(known);
  }
  throw UsageError(fmt::format("{} is '{}', must be {}", option, word,
                               config::detail::quoted_list(words, "or")));
}

// Adds an option whose value is one of a few words.
template <class T>
CLI::Option* add_choice(CLI::App& command, const std::string& option, T& value,
                        const Choices<T>& choices, const std::string& description) {
  std::string words;
  for (const auto& choice : choices) words += (words.empty() ? "" : "|") + choice.first;
  return command
      .add_option_function<std::string>(
          option,
          [&value, option, choices](const std::string& word) {
            value = choose(choices, option, word);
          },
          description)
      ->option_text(words);
}

}  // namespace trifinger::apps
