// SPDX-License-Identifier: BSD-3-Clause
// The program `trifinger`: starts back-ends and looks after them.
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/suggestion.hpp"
#include "commands.hpp"
#include "shared/command_line.hpp"
#include "shared/external_command.hpp"

namespace trifinger::apps {
namespace {

using Commands = std::vector<std::string>;

Commands commands_of(const CLI::App& program) {
  Commands names;
  for (const CLI::App* command : program.get_subcommands({})) names.push_back(command->get_name());
  return names;
}

std::string footer(const CLI::App& program) {
  std::string text =
      "Example:\n"
      "  trifinger run sim           a simulated robot, in one terminal\n"
      "  trifinger status sim        how it is doing, in another\n"
      "'trifinger COMMAND --help' tells more.";
  if (const Commands verbs = foreign_verbs(program); !verbs.empty()) {
    text += fmt::format("\nFrom other packages: {}", fmt::join(verbs, ", "));
  }
  return text;
}

[[noreturn]] void refuse_verb(const CLI::App& program, const std::string& verb) {
  Commands known = foreign_verbs(program);
  std::ranges::copy(commands_of(program), std::back_inserter(known));
  std::string_view near = trifinger::closest(verb, {known.begin(), known.end()});
  for (const std::string& name : known) {
    if (near.empty() && name.starts_with(verb)) near = name;
  }
  throw UsageError(
      fmt::format("there is no command '{}', and no program trifinger-{} on the PATH{} 'trifinger "
                  "--help' lists the commands.",
                  verb, verb, near.empty() ? "." : fmt::format("; did you mean '{}'?", near)));
}

// Refuses an unknown verb after a command that needs one of its own: "trifinger log inof".
void require_known_verb(const CLI::App& command, const std::vector<std::string>& words) {
  const Commands names = commands_of(command);
  if (command.get_require_subcommand_min() == 0 || words.size() < 2 || words[1].starts_with('-') ||
      std::ranges::find(names, words[1]) != names.end()) {
    return;
  }
  const std::vector<std::string_view> known{names.begin(), names.end()};
  const std::string_view near = trifinger::closest(words[1], known);
  throw UsageError(fmt::format("'trifinger {}' has no command '{}'; {}", words[0], words[1],
                               near.empty() ? "it has " + trifinger::quoted_list(known, "and")
                                            : fmt::format("did you mean '{}'?", near)));
}

int run_program(const std::vector<std::string>& words, std::string& name) {
  CLI::App program("Starts the back-ends of robots, looks after them, and works with their logs.",
                   "trifinger");
  set_up_help(program);
  program.set_version_flag("--version", "trifinger " TRIFINGER_VERSION, "Print the version");
  program.require_subcommand(1);
  program.footer([&program] { return footer(program); });

  Action action;
  add_run(program, action);
  add_list(program, action);
  add_status(program, action);
  add_read(program, action);
  add_record(program, action);
  add_stop(program, action);
  add_emulate(program, action);
  add_cameras(program, action);
  add_look(program, action);
  add_track(program, action);
  add_home(program, action);
  add_calibrate(program, action);
  add_self_test(program, action);
  add_recover(program, action);
  add_log(program, action);
  add_config(program, action);
  add_model(program, action);
  add_new(program, action);
  add_doctor(program, action);
  add_completion(program, action);
  declare_external(program);

  if (words.empty()) {
    fmt::print(stderr, "{}", program.help());
    return kWrongUsage;
  }
  if (words.front() == "__complete") return complete({words.begin() + 1, words.end()});
  name = full_name(program, words);
  run_declared_external(program, words);
  const std::string& verb = words.front();
  if (const CLI::App* const command = find_command(program, verb)) {
    require_known_verb(*command, words);
  } else if (!verb.starts_with('-')) {
    run_external(verb, {words.begin() + 1, words.end()});
    refuse_verb(program, verb);
  } else if (program.get_option_no_throw(verb) == nullptr) {
    throw UsageError(fmt::format("'{}' is not an option; 'trifinger --help' tells more", verb));
  }

  if (const std::optional<int> done = parse(program, words)) return *done;
  return action();
}

}  // namespace
}  // namespace trifinger::apps

int main(int argument_count, char** arguments) {
  std::string name = "trifinger";  // and the command, once it is known
  return trifinger::apps::run_and_report(name, [&] {
    return trifinger::apps::run_program({arguments + 1, arguments + argument_count}, name);
  });
}
