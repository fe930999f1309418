// SPDX-License-Identifier: BSD-3-Clause
#include "shared/command_line.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <sstream>
#include <utility>

#include "shared/exit_code.hpp"
#include "shared/terminal.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::apps {
namespace {

constexpr std::size_t kWidth = 100;
constexpr std::size_t kColumn = 30;  // where descriptions begin

// Breaks only lines that are too long.
std::string wrapped(const std::string& text) {
  std::string result;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const auto parts = columns_of(line) > kWidth ? wrap(line, kWidth) : std::vector{line};
    result += fmt::format("{}\n", fmt::join(parts, "\n"));
  }
  return result;
}

// Returns what stands for the value of an option: "NAME", "" for a flag.
std::string value_of(const CLI::Option& option) {
  if (!option.get_option_text().empty()) return option.get_option_text();
  if (option.get_type_size() == 0) return "";
  const std::string type = option.get_type_name();
  const bool is_number = type.starts_with("INT") || type.starts_with("UINT") || type == "FLOAT";
  return is_number ? "NUMBER" : type;
}

class HelpFormatter : public CLI::Formatter {
 public:
  HelpFormatter() {
    label("Positionals", "Arguments");
    label("SUBCOMMAND", "COMMAND");
  }

  std::string make_help(const CLI::App* app, std::string name,
                        CLI::AppFormatMode mode) const override {
    const std::string about = app->get_description();
    const bool is_sentence = about.ends_with('.') || about.ends_with('\n');
    std::string text = make_usage(app, std::move(name)) + "\n" + about +
                       (is_sentence ? "\n" : ".\n") + make_positionals(app) +
                       make_groups(app, mode) + make_subcommands(app, mode) + "\n" +
                       make_footer(app);
    text = CLI::detail::find_and_replace(text, "\nSubcommands:", "\nCommands:");
    while (text.find("\n\n\n") != std::string::npos) {
      text = CLI::detail::find_and_replace(text, "\n\n\n", "\n\n");
    }
    return wrapped(text);
  }

  std::string make_subcommand(const CLI::App* command) const override {
    return help_row(command->get_name(), command->get_description());
  }

  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::string about = option->get_description();
    if (!option->get_default_str().empty()) about += "; default: " + option->get_default_str();
    if (is_positional) return help_row(option->get_name(true, false), about);
    std::string name = CLI::detail::find_and_replace(option->get_name(false, true), ",-", ", -");
    if (const std::string value = value_of(*option); !value.empty()) name += " " + value;
    return help_row(name, option->get_required() ? about + "; required" : about);
  }
};

struct NamedRobot {
  const CLI::App* command;
  std::string* name;
};

std::vector<NamedRobot>& named_robots() {
  static std::vector<NamedRobot> all;
  return all;
}

}  // namespace

std::string help_row(const std::string& name, const std::string& description) {
  std::string text = "  " + name;
  if (columns_of(text) + 2 > kColumn) text += '\n';
  const std::string indent(kColumn, ' ');
  for (const std::string& line : wrap(description, kWidth - kColumn)) {
    text = text.ends_with('\n') ? text.append(indent) : pad(text, kColumn);
    text.append(line) += '\n';
  }
  if (!text.ends_with('\n')) text += '\n';
  return text;
}

void set_up_help(CLI::App& program) {
  program.formatter(std::make_shared<HelpFormatter>());
  program.set_help_flag("-h,--help", "Print this help");
}

CLI::Option* add_robot(CLI::App& command, std::string& name, const std::string& description) {
  named_robots().push_back({&command, &name});
  return command.add_option("NAME", name, description + "; default: the only one that runs");
}

CLI::Option* add_robot_option(CLI::App& command, std::string& name, const std::string& option) {
  named_robots().push_back({&command, &name});
  return command
      .add_option(option, name, "Name of the running robot; default: the only one that runs")
      ->option_text("NAME");
}

const CLI::App* find_command(const CLI::App& program, const std::string& verb) {
  const auto commands = program.get_subcommands({});
  const auto found = std::ranges::find(commands, verb, &CLI::App::get_name);
  return found == commands.end() ? nullptr : *found;
}

std::string full_name(const CLI::App& program, const std::vector<std::string>& words) {
  std::string name = program.get_name();
  const CLI::App* command = &program;
  for (const std::string& word : words) {
    command = find_command(*command, word);
    if (command == nullptr) break;
    name += " " + word;
  }
  return name;
}

std::optional<int> parse(CLI::App& program, const std::vector<std::string>& words) {
  try {
    program.parse(std::vector<std::string>(words.rbegin(), words.rend()));  // wants them backwards
  } catch (const CLI::Success& success) {                                   // help or version
    return program.exit(success);
  } catch (const CLI::ParseError& error) {
    throw UsageError(
        fmt::format("{}; '{} --help' tells more", error.what(), full_name(program, words)));
  }
  for (const auto& [command, name] : named_robots()) {
    if (command->parsed() && name->empty()) *name = running_robot();
  }
  return std::nullopt;
}

}  // namespace trifinger::apps
