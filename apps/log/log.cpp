// SPDX-License-Identifier: BSD-3-Clause
#include "commands.hpp"
#include "shared/external_command.hpp"

namespace trifinger::apps {

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
  declare_external(*command);
}

}  // namespace trifinger::apps
