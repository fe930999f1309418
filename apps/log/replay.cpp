// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <chrono>
#include <cstdio>
#include <exception>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "log/action_replay.hpp"
#include "shared/choice.hpp"
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
  std::optional<double> blend;  // [s]
  ActionReplayOptions how;
  Choice<Series> what{"--what",
                      "desired",
                      {{"desired", Series::kDesiredAction}, {"applied", Series::kAppliedAction}}};
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
  const Series what = options.what.value();
  const log::LoggedSession session = chosen_session(log::Log(options.log), options);
  const Motion motion = read_motion(session, what, options.first, options.last);
  ActionReplayOptions how = options.how;
  if (options.blend) {
    how.blend = std::chrono::round<Nanoseconds>(std::chrono::duration<double>(*options.blend));
  }
  try {
    UntypedFrontend robot(options.on);
    robot.set_interrupt([&signals] {
      if (const std::optional<int> signal = signals.wait(Nanoseconds::zero())) {
        throw Interrupted(*signal);
      }
    });
    replay_actions(motion, session.header().period, robot, how, [&](const std::string& text) {
      fmt::print("{}: {}\n", options.on, text);
      std::fflush(stdout);
    });
  } catch (const Interrupted& interrupted) {
    // The robot was released and comes to rest.
    Signals::die_of(interrupted.signal);
  }
  return kDone;
}

}  // namespace

void add_log_replay(CLI::App& log, Action& action) {
  auto options = std::make_shared<LogReplayOptions>();
  CLI::App* const command =
      log.add_subcommand("replay", "Let a robot do again what it did in a log");
  command->add_option("LOG", options->log, "A file, or a folder: the newest recording in it")
      ->required();
  command->add_option("--on", options->on, "The robot that shall do it")
      ->required()
      ->option_text("NAME");
  command
      ->add_option("--robot", options->robot,
                   "Whose actions; needed if there are several robots in the log")
      ->option_text("NAME");
  command
      ->add_option("--session", options->session,
                   "Which of its sessions, counted from 1; default: the newest")
      ->check(CLI::Range(1, std::numeric_limits<int>::max()))
      ->option_text("N");
  const CLI::Range steps(TimeIndex{0}, std::numeric_limits<TimeIndex>::max());
  command->add_option("--first", options->first, "First step")->check(steps)->option_text("T");
  command->add_option("--last", options->last, "First step left out")
      ->check(steps)
      ->option_text("T");
  options->what.add_to(*command, "What the user asked for, or what became of that");
  command
      ->add_option("--blend", options->blend,
                   "Move to the start pose first, in this time or longer")
      ->check(CLI::Range(0.0, 3600.0))
      ->option_text("SECONDS");
  command
      ->add_option("--max-velocity", options->how.max_velocity,
                   "Largest velocity of a joint on the way there; default: 0.5")
      ->check(CLI::Range(0.001, 10.0))
      ->option_text("RAD/S");
  command
      ->add_option("--tolerance", options->how.tolerance,
                   "How near the start pose must be; default: 0.05")
      ->check(CLI::Range(0.0, 7.0))
      ->option_text("RAD");
  command->add_flag("--force", options->how.force,
                    "Begin wherever a robot without joint positions is");
  command->footer(
      "The robot must be of the recorded type and in the pose in which the recording began; it is\n"
      "brought there with --blend, or nothing is done. It never jumps.\n"
      "--what applied gives the motors the recorded torques, on top of which the robot's safety\n"
      "checks damp as always.\n"
      "To let a program run against a log instead of a robot: trifinger run LOG.\n"
      "Example:\n"
      "  trifinger log replay demo.mcap --on sim --blend 2");
  command->callback([&action, options] { action = [options] { return replay(*options); }; });
}

}  // namespace trifinger::apps
