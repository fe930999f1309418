// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>
#include <sched.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "core/log_folder.hpp"
#include "log/flight_recorder.hpp"
#include "robot/loop_figures.hpp"
#include "robot/session_state.hpp"
#include "robot/wear_table.hpp"
#include "shared/command_line.hpp"
#include "shared/json.hpp"
#include "shared/options.hpp"
#include "shared/signals.hpp"
#include "shared/terminal.hpp"
#include "shared/text.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::apps {
namespace {

constexpr std::size_t kLabelWidth = 12;

struct StatusOptions {
  std::string name;
  bool once{false};
  bool json{false};
};

// Lines with a label and a text, fitted to the width of the window.
class StatusSheet {
 public:
  StatusSheet(const Terminal& terminal, std::size_t width) : terminal_(terminal), width_(width) {}

  // Wraps the text, because it may be a sentence.
  void add(const std::string& label, const std::string& text, Style style = Style::kPlain) {
    const std::size_t room = width_ > kLabelWidth + 1 ? width_ - kLabelWidth : 1;
    const std::string head = clip(pad(label, kLabelWidth), width_);
    std::ranges::move(hang(terminal_.paint(head, Style::kDim), text, room, terminal_, style),
                      std::back_inserter(lines_));
  }
  // Clips the row, because it belongs to a table.
  void add_row(const std::string& label, const std::string& row) {
    const std::string head = clip(pad(label, kLabelWidth), width_);
    const std::size_t room = width_ > kLabelWidth ? width_ - kLabelWidth : 0;
    lines_.push_back(terminal_.paint(head, Style::kDim) +
                     terminal_.paint(clip(row, room), Style::kPlain));
  }
  void add_line(const std::string& line) { lines_.push_back(line); }

  [[nodiscard]] const std::vector<std::string>& lines() const noexcept { return lines_; }

 private:
  const Terminal& terminal_;
  std::size_t width_;
  std::vector<std::string> lines_;
};

// Formats a count: "3 in the last second, 12 since step 0".
std::string count_text(std::int64_t last_second, std::int64_t total, TimeIndex first) {
  if (total == 0) return "0";
  return fmt::format("{} in the last second, {} since step {}", last_second, total, first);
}

Style warn_if(bool condition) { return condition ? Style::kWarning : Style::kPlain; }

// Returns the real-time priority of the loop in the back-end's process: the lowest of its real-time
// threads, because the watchdog's is one higher. Returns nothing if it has no real-time thread.
std::optional<int> realtime_priority(std::int64_t pid) {
  std::optional<int> lowest;
  std::error_code ignored;
  const std::filesystem::path threads = "/proc/" + std::to_string(pid) + "/task";
  for (const auto& entry : std::filesystem::directory_iterator(threads, ignored)) {
    const auto thread =
        static_cast<pid_t>(std::strtol(entry.path().filename().c_str(), nullptr, 10));
    sched_param parameters{};
    // A thread that has ended meanwhile has no policy.
    if (::sched_getscheduler(thread) != SCHED_FIFO) continue;
    if (::sched_getparam(thread, &parameters) != 0) continue;
    lowest = std::min(lowest.value_or(parameters.sched_priority), parameters.sched_priority);
  }
  return lowest;
}

// Returns the log that the flight recorder has written for a session.
std::optional<std::filesystem::path> fault_log(const SessionInfo& info) {
  try {
    return log::find_fault_log(log_folder(), robot_of(info.name), info.robot_session_id);
  } catch (const Error&) {
    return std::nullopt;  // There is no folder for logs here.
  }
}

// Shows the session `name`. Each look takes whichever session is the current one.
class Observer {
 public:
  explicit Observer(std::string name) : name_(std::move(name)) {}

  [[nodiscard]] std::vector<std::string> look(const Terminal& terminal, std::size_t width) {
    const UntypedFrontend session(name_, {.control = false});
    const SessionInfo info = session.session().info();
    StatusSheet sheet(terminal, width);
    sheet.add_line(fit({{info.name, 3, Style::kBold},
                        {state_text(info), 2, style_of(health_of(info))},
                        {info.is_companion ? "companion" : "robot", 0, Style::kDim},
                        {info.type, 1, Style::kDim}},
                       width, terminal));
    if (info.is_companion) {
      sheet.add("rate", rate_text(arrival_rate(session)));
      sheet.add("elements", std::to_string(info.steps));
    } else {
      add_loop(sheet, session, info);
      sheet.add("controller", controller_text(info));
      std::string label = "wear";
      for (const std::string& line : wear_table(session.session())) {
        sheet.add_row(std::exchange(label, {}), line);
      }
    }
    sheet.add("back-end", fmt::format("{} on {}", ipc::describe(info.backend), info.host));
    if (!info.fault_text.empty()) {
      sheet.add("end", info.fault_text, info.fault.needs_recovery() ? Style::kBad : Style::kPlain);
    }
    if (health_of(info) == Health::kFault) {
      sheet.add("remedy", fmt::format("trifinger recover {}", robot_of(info.name)));
      if (const auto log = fault_log(info)) sheet.add("fault log", log->string());
    }
    if (health_of(info) == Health::kDead) {
      sheet.add("remedy", fmt::format("trifinger log rescue {} keeps the last seconds; then start "
                                      "the back-end again",
                                      robot_of(info.name)));
    }
    return sheet.lines();
  }

 private:
  void add_loop(StatusSheet& sheet, const UntypedFrontend& session, const SessionInfo& info) {
    figures_.update(session);
    const double wanted_rate = 1e9 / static_cast<double>(info.period.count());
    sheet.add("mode", info.is_real_time ? "real-time, " + rate_text(wanted_rate)
                                        : "non-real-time, steps of " + duration_text(info.period));
    if (info.is_real_time && info.backend_is_alive) {
      if (is_seen(info.backend)) {
        const auto priority = realtime_priority(info.backend.pid);
        sheet.add("priority",
                  priority ? fmt::format("SCHED_FIFO {}", *priority)
                           : "none, other programs may be first; see 'trifinger doctor'",
                  warn_if(!priority));
      } else {
        sheet.add("priority", "not known here: the back-end runs in another container");
      }
    }
    if (info.is_real_time) {
      std::string label = "realtime";
      for (const std::string& line : realtime_lines(info.realtime_warnings)) {
        sheet.add(std::exchange(label, {}), line, warn_if(!info.realtime_warnings.empty()));
      }
    }
    sheet.add("steps", std::to_string(info.steps));
    if (figures_.total().steps == 0) return;

    const StepCounts recent = figures_.last_second();
    const StepCounts& total = figures_.total();
    const TimeIndex first = figures_.first_step();
    sheet.add("rate", rate_text(figures_.rate()));
    if (info.is_real_time) {
      sheet.add("lateness", describe(figures_.lateness()));
      if (const auto timing = session.session().timing()) add_timing(sheet, *timing);
      sheet.add("repeats", count_text(recent.repeats, total.repeats, first),
                warn_if(recent.repeats > 0));
      sheet.add("skipped", count_text(recent.skipped, total.skipped, first),
                warn_if(recent.skipped > 0));
      sheet.add("discarded", std::to_string(figures_.newest().discarded_actions));
    }
    sheet.add("rejected", count_text(recent.rejected, total.rejected, first),
              warn_if(recent.rejected > 0));
    sheet.add("acausal", count_text(recent.acausal, total.acausal, first),
              warn_if(recent.acausal > 0));
    if (figures_.newest().lost_frames > 0) {
      sheet.add("lost frames", std::to_string(figures_.newest().lost_frames), Style::kWarning);
    }
  }

  // Adds what the back-end has recorded since step 0, including steps that the history has lost.
  static void add_timing(StatusSheet& sheet, const TimingRecord& timing) {
    sheet.add("since 0", describe(timing.lateness()));
    sheet.add("in time",
              fmt::format("{:.1f} % of the last {} steps", 100.0 * timing.success_rate(),
                          std::min(timing.steps(), TimingRecord::kRecentSteps)),
              warn_if(timing.success_rate() < 1.0));
    sheet.add("late", describe(timing), warn_if(timing.late_steps() > 0));
    if (timing.late_steps() > 0) sheet.add("worst", worst_text(timing));
  }

  std::string name_;
  LoopFigures figures_;
};

int print_status(const std::string& name) {
  const UntypedFrontend session(name, {.control = false});
  const SessionInfo info = session.session().info();
  Json json = json_of(info);
  if (info.is_companion) {
    json["rate"] = arrival_rate(session);
  } else {
    LoopFigures figures;
    figures.update(session);
    json["rate"] = figures.rate();
    const auto timing = session.session().timing();
    json["loop"] = timing ? json_of(*timing, figures.total()) : Json();
    const auto log = health_of(info) == Health::kFault ? fault_log(info) : std::nullopt;
    json["fault_log"] = log ? Json(log->string()) : Json();
  }
  print_json(json);
  return kDone;
}

int status(const StatusOptions& options) {
  if (options.json) return print_status(options.name);
  const Terminal terminal;
  Observer observer(options.name);
  if (options.once || !terminal.is_live()) {
    for (const std::string& line : observer.look(terminal, terminal.width()))
      fmt::print("{}\n", line);
    return kDone;
  }

  const Signals signals;
  LiveLines live(terminal);
  bool was_seen = false;
  while (true) {
    const std::size_t width = terminal.width();
    std::vector<std::string> lines;
    try {
      lines = observer.look(terminal, width);
    } catch (const SessionNotFound&) {
      // If it was seen before, its back-end is being restarted.
      if (!was_seen) throw;
      lines.push_back(terminal.paint(
          clip(options.name + " is gone; waiting for its next session", width), Style::kPlain));
    }
    was_seen = true;
    lines.push_back(terminal.paint(clip("Ctrl-C leaves", width), Style::kDim));
    live.draw(lines);
    if (signals.wait(kRefresh)) return kDone;
  }
}

}  // namespace

void add_status(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "status",
                  "Show how a session is doing: live on a terminal, otherwise once", status);
  add_robot(command, options.name, "Name of the session, as in sim or sim.object");
  command.add_flag("--once", options.once, "Look once, also on a terminal");
  add_json(command, options.json);
  command.footer(
      "This command only reads. It never slows the robot.\n"
      "  realtime   whether the loop got what it asked for: priority, locked memory, ...\n"
      "  lateness   how long after its deadline each step of the last second began; if steps were\n"
      "             skipped before it, how long after the deadline of the first skipped one\n"
      "  since 0    the lateness of all steps\n"
      "  in time    the share of the last 1000 steps that were in time\n"
      "  late       steps that were not in time, by cause:\n"
      "             user       the action was missing\n"
      "             scheduler  half a period late, because the back-end did not get the processor\n"
      "             driver     half a period late, because the driver's calls took too long\n"
      "  repeats    steps whose action was missing, so the action before it was repeated\n"
      "  skipped    steps left out because the back-end itself was late\n"
      "  discarded  actions that came too late: their step was already closed\n"
      "  rejected   actions that the robot could not apply\n"
      "  acausal    actions appended after the observation of their step was read\n"
      "  wear       the running hours of a robot on motor boards, joint by joint: time with the "
      "motor\n"
      "             on, travel of the motor, its mechanical work, the integral of its squared "
      "current\n"
      "             (times a winding's resistance: its heat), and index pulses in a wrong place\n"
      "Example:\n"
      "  trifinger status sim");
}

}  // namespace trifinger::apps
