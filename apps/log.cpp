// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "external_command.hpp"
#include "log_commands.hpp"

namespace trifinger::apps {

void add_log_in_python(CLI::App& log, Action& action) {
  const auto add = [&log, &action](const std::string& verb, const std::string& description) {
    CLI::App* const command = log.add_subcommand(verb, description);
    // What stands behind the verb, --help too, is for the other program.
    command->set_help_flag();
    command->prefix_command();
    command->callback([&action, command, verb] {
      action = [verb, arguments = command->remaining()] {
        run_external("log-" + verb, arguments);
        throw UsageError("'trifinger log " + verb +
                         "' is part of the Python package, and there is "
                         "no program trifinger-log-" +
                         verb +
                         " on the PATH: pip install "
                         "\"trifinger[" +
                         verb + "]\"");
        return kFailed;
      };
    });
  };
  add("plot", "Draw what happened: a picture, or a page for a browser");
  add("export", "Write tables for other programs: CSV, Parquet");
}

void add_log(CLI::App& program, Action& action) {
  CLI::App* const command =
      program.add_subcommand("log", "Look into logs, check, repair, cut and convert them");
  command->require_subcommand(1);
  command->footer(
      "A LOG is a file, or a folder: the newest recording in it, with all its parts.\n"
      "Example:\n"
      "  trifinger log info run.mcap\n"
      "  trifinger log plot run.mcap -o run.png");
  add_log_info(*command, action);
  add_log_check(*command, action);
  add_log_recover(*command, action);
  add_log_cut(*command, action);
  add_log_rescue(*command, action);
  add_log_replay(*command, action);
  add_log_in_python(*command, action);
}

}  // namespace trifinger::apps
