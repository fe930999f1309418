// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "shared/shipped_file.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

const std::vector<std::string> kShells{"bash", "zsh", "fish"};

struct CompletionOptions {
  std::string shell;
};

// What the help of a command says, in C++ or Python: that is the only list of its words.
struct Help {
  std::vector<std::string> commands;
  std::vector<std::string> tasks;
  std::map<std::string, std::string> options;  // with what stands for their values
  std::vector<std::string> places;             // what stands for arguments: "NAME"
};

void take_row(Help& help, const std::string& cell, std::string_view heading) {
  if (cell.starts_with('-')) {
    std::istringstream words(cell);
    std::string name;
    std::string value;
    while (words >> value && value.starts_with('-')) name = std::exchange(value, "");
    help.options[name] = value;
  } else if (heading == "Tasks:") {
    help.tasks.push_back(cell);
  } else if (heading == "Commands:" || heading.starts_with("Programs of their own") ||
             heading.starts_with("Python package")) {
    help.commands.push_back(cell);
  }
}

Help read_help(const std::string& command) {
  const std::string program = std::filesystem::canonical("/proc/self/exe").string();
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(
      // NOLINTNEXTLINE(bugprone-command-processor): only names of commands are among the words
      ::popen(fmt::format("'{}'{} --help 2>/dev/null", program, command).c_str(), "r"), &::pclose);
  std::string text;
  for (int c = 0; pipe && (c = std::fgetc(pipe.get())) != EOF;) text += static_cast<char>(c);
  Help help;
  std::string heading;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("Usage: ")) {
      std::istringstream words(line.substr(line.find(']') + 1));
      for (std::string word; words >> word;) {
        std::erase_if(word, [](char c) { return c == '[' || c == ']' || c == '.'; });
        help.places.push_back(word);
      }
    } else if (!line.starts_with(' ')) {
      heading = line;
    } else if (line.size() > 2 && line[2] != ' ') {
      take_row(help, line.substr(2, line.find("  ", 2) - 2), heading);
    }
  }
  return help;
}

// Returns the words that may stand for "NAME|LOG" or "mjcf|urdf".
std::vector<std::string> values_of(const std::string& place, const Help& help) {
  std::vector<std::string> values;
  std::istringstream parts(place);
  for (std::string part; std::getline(parts, part, '|');) {
    if (part == "NAME") {
      for (const SessionInfo& info : list_sessions()) {
        if (info.backend_is_alive && !info.is_companion) values.push_back(info.name);
      }
    } else if (part == "ROBOT") {
      std::ranges::move(config_names(), std::back_inserter(values));
    } else if (part == "SHELL") {
      values = kShells;
    } else if (part == "TASK") {
      std::ranges::copy(help.tasks, std::back_inserter(values));
    } else if (place.find('|') != std::string::npos) {
      values.push_back(part);
    }
  }
  return values;
}

int print_script(const CompletionOptions& options) {
  fmt::print("{}", read_shipped_file("completion", "trifinger." + options.shell));
  return kDone;
}

}  // namespace

int complete(std::vector<std::string> words) {
  const std::string last = words.empty() ? "" : words.back();
  if (!words.empty()) words.pop_back();
  Help help = read_help("");
  std::string command;
  std::string waiting;  // stands for the value of an option that comes next
  std::size_t position = 0;
  for (const std::string& word : words) {
    const auto option = help.options.find(word);
    if (std::ranges::find(help.commands, word) != help.commands.end()) {
      command += " " + word;
      help = read_help(command);
      position = 0;
    } else if (waiting.empty() && option == help.options.end()) {
      ++position;
    }
    waiting = option == help.options.end() ? "" : option->second;
  }
  std::vector<std::string> found;
  if (!waiting.empty()) {
    found = values_of(waiting, help);
  } else if (last.starts_with('-')) {
    for (const auto& option : help.options) found.push_back(option.first);
  } else if (!help.commands.empty()) {
    found = help.commands;
  } else if (!help.places.empty()) {
    found = values_of(help.places[std::min(position, help.places.size() - 1)], help);
  }
  fmt::print("{}\n", fmt::join(found, "\n"));
  return kDone;
}

void add_completion(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "completion",
                  "Print a script that lets a shell complete commands and robots", print_script);
  command.add_option("SHELL", options.shell, "bash, zsh or fish")
      ->check(CLI::IsMember(kShells))
      ->required();
  command.footer(
      "Example:\n"
      "  source <(trifinger completion bash)              in ~/.bashrc\n"
      "  source <(trifinger completion zsh)               in ~/.zshrc, after compinit\n"
      "  trifinger completion fish | source               in ~/.config/fish/config.fish");
}

}  // namespace trifinger::apps
