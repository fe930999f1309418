// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/core.h>

#include <CLI/App.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "shared/exit_code.hpp"
#include "trifinger/base/suggestion.hpp"

namespace trifinger::apps {

// The words that may be typed, with their meanings.
template <class T>
using Choices = std::vector<std::pair<std::string, T>>;

// Returns the meaning of `word`. Throws UsageError, which names the `option` and the possible
// words.
template <class T>
[[nodiscard]] const T& choose(const Choices<T>& choices, const std::string& option,
                              const std::string& word) {
  std::vector<std::string_view> words;
  words.reserve(choices.size());
  for (const auto& [known, value] : choices) {
    if (word == known) return value;
    words.emplace_back(known);
  }
  throw UsageError(
      fmt::format("{} is '{}', must be {}", option, word, trifinger::quoted_list(words, "or")));
}

// An option whose value is one of a few words.
template <class T>
class Choice {
 public:
  // `word` applies if the option is not given.
  Choice(std::string option, std::string word, Choices<T> choices)
      : option_(std::move(option)), word_(std::move(word)), choices_(std::move(choices)) {}

  CLI::Option* add_to(CLI::App& command, const std::string& description) {
    std::string words;
    for (const auto& choice : choices_) words += (words.empty() ? "" : "|") + choice.first;
    return command.add_option(option_, word_, description)->option_text(words);
  }

  // Throws UsageError.
  [[nodiscard]] const T& value() const { return choose(choices_, option_, word_); }

 private:
  std::string option_;
  std::string word_;
  Choices<T> choices_;
};

}  // namespace trifinger::apps
