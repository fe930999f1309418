// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/core.h>

#include <CLI/App.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/suggestion.hpp"
#include "shared/command_line.hpp"
#include "shared/exit_code.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/realtime/thread.hpp"

// Options whose values are neither plain words nor plain numbers. Each function adds an option that
// sets `value` when it is parsed. Wrong values throw UsageError, which names the option.
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

// One of a few words.
template <class T>
CLI::Option* add_choice(CLI::App& command, const std::string& name, T& value,
                        const Choices<T>& choices, const std::string& description) {
  std::string words;
  for (const auto& choice : choices) words += (words.empty() ? "" : "|") + choice.first;
  const auto set = [name, &value, choices](const std::string& word) {
    value = choose(choices, name, word);
  };
  return command.add_option_function<std::string>(name, set, description)->option_text(words);
}

// --scheduling: how strictly a thread asks for real-time settings.
CLI::Option* add_scheduling(CLI::App& command, Demand& value, const std::string& description);

// A number from `least` to `most`, which `set` gets.
CLI::Option* add_number(CLI::App& command, const std::string& name,
                        const std::function<void(double)>& set, double least, double most,
                        const std::string& description);

// A number of seconds from 0 to `most`. `Time` can be assigned from Nanoseconds.
template <class Time>
CLI::Option* add_seconds(CLI::App& command, const std::string& name, Time& value, double most,
                         const std::string& description) {
  const auto set = [&value](double seconds) {
    value = std::chrono::round<Nanoseconds>(std::chrono::duration<double>(seconds));
  };
  return add_number(command, name, set, 0.0, most, description)->option_text("SECONDS");
}

// A number of bytes: "500MB", "2GiB", "1e6".
CLI::Option* add_size(CLI::App& command, const std::string& name, std::uint64_t& value,
                      const std::string& description);

// -o,--output: a file or a folder that is written.
template <class Path>
CLI::Option* add_output(CLI::App& command, Path& value, const std::string& description,
                        const std::string& what = "FILE") {
  return command.add_option("-o,--output", value, description)->option_text(what);
}

// --json, of a command that reports: standard output is one JSON object.
CLI::Option* add_json(CLI::App& command, bool& value);

// --set, of a command with a configuration; may be given several times.
CLI::Option* add_overrides(CLI::App& command, std::vector<std::string>& value,
                           const std::string& example,
                           const std::string& what = "Change a value of the configuration");

// ROBOT, --name and --set: a robot that a command makes from its configuration. Returns ROBOT.
template <class Options>
CLI::Option* add_configured_robot(CLI::App& command, Options& options,
                                  const std::string& description, const std::string& example) {
  command.add_option("--name", options.name, "Name of the robot; default: the configuration's")
      ->option_text("NAME");
  add_overrides(command, options.overrides, example);
  return command.add_option("ROBOT", options.robot, description);
}

// A duration with its unit: "30s", "10min", "1h", "2d", "500ms".
CLI::Option* add_duration(CLI::App& command, const std::string& name, Nanoseconds& value,
                          const std::string& description);

}  // namespace trifinger::apps
