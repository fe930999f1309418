// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <cstdio>
#include <exception>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "log/action_replay.hpp"
#include "log/options.hpp"
#include "shared/output.hpp"
#include "shared/signals.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::apps {
namespace {

struct LogReplayOptions {
  std::string log;
  std::string on;
  std::string robot;
  std::optional<std::size_t> session;
  std::optional<TimeIndex> first;
  std::optional<TimeIndex> last;
  ActionReplayOptions how;
  Series what{Series::kDesiredAction};
};

// Ends a wait when a signal arrives.
struct Interrupted : std::exception {
  explicit Interrupted(int number) noexcept : signal(number) {}
  int signal;
};

log::LoggedSession chosen_session(const log::Log& log, const LogReplayOptions& options) {
  log::LoggedSession newest = log.session(options.robot);
  if (!options.session) return newest;
  std::vector<log::LoggedSession> sessions;
  for (const log::LoggedSession& session : log.sessions()) {
    if (session.name() == newest.name()) sessions.push_back(session);
  }
  if (*options.session > sessions.size()) {
    throw UsageError(fmt::format("--session is {}, but the log has {} of '{}'", *options.session,
                                 sessions.size(), newest.name()));
  }
  return sessions[*options.session - 1];
}

int replay(const LogReplayOptions& options) {
  const Signals signals;
  const log::LoggedSession session = chosen_session(log::Log(options.log), options);
  const Motion motion = read_motion(session, options.what, options.first, options.last);
  try {
    UntypedFrontend robot(options.on);
    robot.set_interrupt([&signals] {
      if (const std::optional<int> signal = signals.wait(Nanoseconds::zero())) {
        throw Interrupted(*signal);
      }
    });
    const auto tell = [&options](const std::string& text) {
      print_safely("{}: {}\n", options.on, text);
      std::fflush(stdout);
    };
    replay_actions(motion, session.header().period, robot, options.how, tell);
  } catch (const Interrupted& interrupted) {
    // The robot was released and comes to rest.
    Signals::die_of(interrupted.signal);
  }
  return kDone;
}

}  // namespace

void add_log_replay(CLI::App& log, Action& action) {
  const auto& [command, options] =
      add_command(log, action, "replay", "Let a robot do again what it did in a log", replay);
  add_log_file(command, options.log);
  add_robot_option(command, options.on, "--on");
  command
      .add_option("--robot", options.robot,
                  "Robot whose actions are repeated; needed if the log has several robots")
      ->option_text("NAME");
  command
      .add_option("--session", options.session,
                  "Number of its session in the log, from 1; default: the newest")
      ->check(CLI::Range(1, std::numeric_limits<int>::max()))
      ->option_text("N");
  add_steps(command, options.first, options.last);
  add_choice(command, "--what", options.what,
             {{"desired", Series::kDesiredAction}, {"applied", Series::kAppliedAction}},
             "The actions that the user asked for, or those that were applied; default: desired");
  add_seconds(command, "--blend", options.how.blend, 3600.0,
              "Move to the start pose first, in this time or longer");
  ActionReplayOptions& how = options.how;
  add_number(
      command, "--max-velocity", [&how](double velocity) { how.max_velocity = velocity; }, 0.001,
      10.0, "Largest velocity of a joint on the way there; default: 0.5")
      ->option_text("RAD/S");
  add_number(
      command, "--tolerance", [&how](double tolerance) { how.tolerance = tolerance; }, 0.0, 7.0,
      "How near the robot must be to the start pose; default: 0.05")
      ->option_text("RAD");
  command.add_flag("--force", options.how.force,
                   "Begin in any pose, with a robot that has no joint positions");
  command.footer(
      "The robot must be of the recorded type, and in the pose in which the recording began.\n"
      "--blend moves it to that pose first. Without it, a robot in another pose does nothing.\n"
      "The robot never jumps.\n"
      "With --what applied the motors get the recorded torques. The robot's safety checks still\n"
      "damp them.\n"
      "'trifinger run LOG' lets a program run against a log instead of a robot.\n"
      "Example:\n"
      "  trifinger log replay demo.mcap --on sim --blend 2");
}

}  // namespace trifinger::apps
