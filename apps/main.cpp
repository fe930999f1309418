// SPDX-License-Identifier: BSD-3-Clause
// The program `trifinger`: starts back-ends and looks after them.
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "commands.hpp"
#include "external_command.hpp"
#include "trifinger/base/suggestion.hpp"

namespace trifinger::apps {
namespace {

std::string footer() {
  std::string text =
      "Example:\n"
      "  trifinger run sim           a simulated robot, in one terminal\n"
      "  trifinger status sim        how it is doing, in another\n"
      "'trifinger COMMAND --help' tells more.";
  if (const std::vector<std::string> verbs = external_verbs(); !verbs.empty()) {
    text += fmt::format("\nFrom other packages: {}", fmt::join(verbs, ", "));
  }
  return text;
}

[[noreturn]] void refuse_verb(const CLI::App& program, const std::string& verb) {
  std::vector<std::string> known = external_verbs();
  for (const CLI::App* command : program.get_subcommands({})) known.push_back(command->get_name());
  std::string_view near = trifinger::closest(verb, {known.begin(), known.end()});
  for (const std::string& name : known) {
    if (near.empty() && name.starts_with(verb)) near = name;
  }
  throw UsageError(
      fmt::format("there is no command '{}', and no program trifinger-{} on the PATH{} 'trifinger "
                  "--help' lists "
                  "the commands.",
                  verb, verb, near.empty() ? "." : fmt::format("; did you mean '{}'?", near)));
}

// The command called `verb`; nullptr if there is none.
const CLI::App* find_command(const CLI::App& program, const std::string& verb) {
  for (const CLI::App* command : program.get_subcommands({})) {
    if (command->get_name() == verb) return command;
  }
  return nullptr;
}

// Refuses the unknown verb behind a command that has some of its own: "trifinger log inof".
void require_known_verb(const CLI::App& command, const std::vector<std::string>& words) {
  std::vector<std::string> names;
  for (const CLI::App* verb : command.get_subcommands({})) names.push_back(verb->get_name());
  if (names.empty() || words.size() < 2 || words[1].starts_with('-') ||
      std::ranges::find(names, words[1]) != names.end()) {
    return;
  }
  const std::vector<std::string_view> known{names.begin(), names.end()};
  const std::string_view near = trifinger::closest(words[1], known);
  throw UsageError(fmt::format("'trifinger {}' has no command '{}'; {}", words[0], words[1],
                               near.empty() ? "it has " + trifinger::quoted_list(known, "and")
                                            : fmt::format("did you mean '{}'?", near)));
}

int run_program(const std::vector<std::string>& words) {
  CLI::App program("Robots behind time series: starts back-ends and looks after them.",
                   "trifinger");
  program.set_version_flag("--version", "trifinger " TRIFINGER_VERSION, "Print the version");
  program.set_help_flag("-h,--help", "Print this help");
  program.require_subcommand(1);
  program.footer(footer);

  Action action;
  add_run(program, action);
  add_list(program, action);
  add_status(program, action);
  add_read(program, action);
  add_record(program, action);
  add_stop(program, action);
  add_recover(program, action);
  add_log(program, action);
  add_model(program, action);
  add_doctor(program, action);

  if (words.empty()) {
    fmt::print(stderr, "{}", program.help());
    return kWrongUsage;
  }
  const std::string& verb = words.front();
  const CLI::App* const command = find_command(program, verb);
  const bool is_known = command != nullptr;
  if (is_known) require_known_verb(*command, words);
  if (!verb.starts_with('-') && !is_known) {
    run_external(verb, {words.begin() + 1, words.end()});
    refuse_verb(program, verb);
  }

  try {
    program.parse(std::vector<std::string>(words.rbegin(), words.rend()));  // wants them backwards
  } catch (const CLI::Success& wish) {                                      // help or version
    return program.exit(wish);
  } catch (const CLI::ParseError& error) {
    throw UsageError(fmt::format("{}; 'trifinger {}--help' tells more", error.what(),
                                 is_known ? verb + " " : ""));
  }
  return action();
}

}  // namespace
}  // namespace trifinger::apps

int main(int argument_count, char** arguments) {
  return trifinger::apps::run_and_report("trifinger", [&] {
    return trifinger::apps::run_program({arguments + 1, arguments + argument_count});
  });
}
