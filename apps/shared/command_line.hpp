// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/App.hpp>
#include <optional>
#include <string>
#include <vector>

// The command lines of all programs in C++: their help and their errors. Those in Python look the
// same (python/trifinger/commands/command_line.py); docs/decisions/command_line.md has the grammar.
namespace trifinger::apps {

// Gives a program our form of help. Comes before its commands and options.
void set_up_help(CLI::App& program);

// A line of help: a name, and what it is; as many lines as it takes.
[[nodiscard]] std::string help_row(const std::string& name, const std::string& description);

// NAME: the running robot that a command is about. --robot: the running robot of a command that is
// about something else. If it is left out, `parse` sets `name` to the only robot that runs.
CLI::Option* add_robot(CLI::App& command, std::string& name,
                       const std::string& description = "Name of the running robot");
CLI::Option* add_robot_option(CLI::App& command, std::string& name,
                              const std::string& option = "--robot");

// Returns the command that is called `verb`; nullptr if there is none.
[[nodiscard]] const CLI::App* find_command(const CLI::App& program, const std::string& verb);

// Returns the command that `words` begin with: "trifinger log info".
[[nodiscard]] std::string full_name(const CLI::App& program, const std::vector<std::string>& words);

// Parses `words`. Returns the exit code if nothing is left to do: help was printed.
// Throws UsageError, and what `running_robot` throws.
[[nodiscard]] std::optional<int> parse(CLI::App& program, const std::vector<std::string>& words);

}  // namespace trifinger::apps
