// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "shared/exit_code.hpp"

// The commands of the program. Each has a file of its name in the folder of its theme. Each
// function adds one command to the command line. If the user asks for that command, it sets the
// action, which runs after the whole command line was parsed.
namespace trifinger::apps {

// Does the work of a command and returns the exit code. May throw.
using Action = std::function<int()>;

// Adds the command `name` to `parent` and returns it with its options, which belong to it. Its
// action is `work`, unless a command of its own is given.
template <class Options>
[[nodiscard]] std::pair<CLI::App&, Options&> add_command(CLI::App& parent, Action& action,
                                                         const std::string& name,
                                                         const std::string& description,
                                                         int (*work)(const Options&)) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command = parent.add_subcommand(name, description);
  command->callback([&action, command, options, work] {
    if (!command->get_subcommands().empty()) return;  // that one does the work
    action = [options, work] { return work(*options); };
  });
  return {*command, *options};
}

// robot/
void add_run(CLI::App& program, Action& action);
void add_list(CLI::App& program, Action& action);
void add_status(CLI::App& program, Action& action);
void add_read(CLI::App& program, Action& action);
void add_stop(CLI::App& program, Action& action);
void add_emulate(CLI::App& program, Action& action);
void add_cameras(CLI::App& program, Action& action);
void add_look(CLI::App& program, Action& action);
void add_track(CLI::App& program, Action& action);
void add_home(CLI::App& program, Action& action);
void add_calibrate(CLI::App& program, Action& action);
void add_self_test(CLI::App& program, Action& action);
void add_recover(CLI::App& program, Action& action);
void add_doctor(CLI::App& program, Action& action);
// log/
void add_record(CLI::App& program, Action& action);
void add_log(CLI::App& program, Action& action);
void add_log_info(CLI::App& log, Action& action);
void add_log_check(CLI::App& log, Action& action);
void add_log_recover(CLI::App& log, Action& action);
void add_log_cut(CLI::App& log, Action& action);
void add_log_rescue(CLI::App& log, Action& action);
void add_log_replay(CLI::App& log, Action& action);
// shared/
void add_completion(CLI::App& program, Action& action);
// Prints the words that may follow `words`, of which the last one is still being typed.
int complete(std::vector<std::string> words);
// model/
void add_config(CLI::App& program, Action& action);
void add_model(CLI::App& program, Action& action);
void add_new(CLI::App& program, Action& action);

}  // namespace trifinger::apps
