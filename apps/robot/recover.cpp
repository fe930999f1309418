// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <chrono>
#include <memory>
#include <string>

#include "commands.hpp"
#include "robot/session_state.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::apps {
namespace {

struct RecoverOptions {
  std::string name;
  double timeout{5.0};  // [s]
};

int recover_session(const RecoverOptions& options) {
  const SessionInfo before = robot_info(options.name);
  if (before.backend_is_alive && !before.fault.needs_recovery()) {
    fmt::print("{}: there is nothing to recover from, it is {}.\n", before.name,
               state_text(before));
    return kDone;
  }
  recover(options.name,
          std::chrono::round<Nanoseconds>(std::chrono::duration<double>(options.timeout)));
  fmt::print("{}: recovered; now {}. The fault was: {}.\n", before.name,
             state_text(Session::open(options.name).info()), before.fault_text);
  return kDone;
}

}  // namespace

void add_recover(CLI::App& program, Action& action) {
  auto options = std::make_shared<RecoverOptions>();
  CLI::App* const command = program.add_subcommand(
      "recover", "Clear the fault of a robot, so that its next session begins");
  command->add_option("NAME", options->name, "Name of the session")->required();
  command
      ->add_option("--timeout", options->timeout,
                   "How long to wait for the next session; default: 5")
      ->check(CLI::Range(0.0, 3600.0))
      ->option_text("SECONDS");
  command->footer(
      "Look at the robot first: it may move when the next session begins.\n"
      "Example:\n"
      "  trifinger status sim --once\n"
      "  trifinger recover sim");
  command->callback(
      [&action, options] { action = [options] { return recover_session(*options); }; });
}

}  // namespace trifinger::apps
