// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <chrono>
#include <string>

#include "commands.hpp"
#include "robot/session_state.hpp"
#include "shared/command_line.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::apps {
namespace {

struct RecoverOptions {
  std::string name;
  Nanoseconds timeout{std::chrono::seconds(5)};
};

int recover_session(const RecoverOptions& options) {
  const SessionInfo before = robot_info(options.name);
  if (before.backend_is_alive && !before.fault.needs_recovery()) {
    print_safely("{}: there is nothing to recover from, it is {}.\n", before.name,
                 state_text(before));
    return kDone;
  }
  recover(options.name, options.timeout);
  print_safely("{}: recovered; now {}. The fault was: {}.\n", before.name,
               state_text(Session::open(options.name).info()), before.fault_text);
  return kDone;
}

}  // namespace

void add_recover(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "recover",
                  "Clear the fault of a robot, so that its next session begins", recover_session);
  add_robot(command, options.name);
  add_seconds(command, "--timeout", options.timeout, 3600.0,
              "How long to wait for the next session; default: 5");
  command.footer(
      "Look at the robot first: it may move when the next session begins.\n"
      "Example:\n"
      "  trifinger status sim --once\n"
      "  trifinger recover sim");
}

}  // namespace trifinger::apps
