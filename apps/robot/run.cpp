// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/chrono.h>
#include <fmt/core.h>
#include <sched.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "robot/loop_figures.hpp"
#include "robot/run_recorder.hpp"
#include "robot/runnable_robot.hpp"
#include "robot/session_state.hpp"
#include "shared/choice.hpp"
#include "shared/signals.hpp"
#include "shared/terminal.hpp"
#include "shared/text.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/regular_file.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/log_folder.hpp"
#include "trifinger/log/flight_recorder.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::apps {
namespace {

struct RunOptions {
  std::string robot;
  std::optional<std::string> name;
  std::vector<std::string> overrides;
  std::optional<std::filesystem::path> state;
  bool real_time{false};
  bool non_real_time{false};
  Choice<Demand> scheduling{
      "--scheduling",
      "try",
      {{"require", Demand::kRequire}, {"try", Demand::kTry}, {"off", Demand::kOff}}};
  double fault_log{10.0};  // [s]
  std::optional<std::filesystem::path> record;
  RealtimeOptions realtime;
  bool no_memory_lock{false};
  bool let_cpus_sleep{false};
};

// Reports on the robot to the user: a line for each event, and on a terminal one line that is
// always up to date.
class RunReporter {
 public:
  RunReporter(std::string name, const SessionHost& host) : name_(std::move(name)), host_(host) {}

  void print(const std::string& text, Style style = Style::kPlain) {
    console_.print(name_, text, style);
  }
  // Prints a text about something else than the robot.
  void print(const std::string& about, const std::string& text, Style style) {
    console_.print(about, text, style);
  }

  // Reads the current session and reports. `recorder_trouble` says what is wrong with its recorder.
  void look(bool is_stopping, const std::string& recorder_trouble) {
    if (session_) observe(*session_);
    // A next session is searched only when there may be one, because mapping memory costs time in
    // the process of the loop.
    if (!session_ || phase_ == SessionInfo::Phase::kEnded) find_next_session();
    if (session_ && console_.is_live()) {
      console_.draw(status_line(is_stopping, recorder_trouble));
    }
  }

 private:
  void find_next_session() {
    try {
      UntypedFrontend found(host_, {.control = false, .timeout = Timeout::zero()});
      const std::uint64_t id = found.session().info().session_id;
      if (session_ && id == session_->session().info().session_id) return;
      session_.emplace(std::move(found));
      phase_.reset();
      observe(*session_);
    } catch (const Error&) {
      return;  // No session yet, or somebody has damaged it; then another one follows soon.
    }
  }

  // Reports what has changed.
  void observe(const UntypedFrontend& session) {
    const SessionInfo info = session.session().info();
    figures_.update(session);
    if (info.phase != phase_) report(info);
    phase_ = info.phase;
  }

  void report(const SessionInfo& info) {
    switch (info.phase) {
      case SessionInfo::Phase::kPreparing:
        print("prepares");
        break;
      case SessionInfo::Phase::kHolding:
        print("holds its pose and waits for a user");
        break;
      case SessionInfo::Phase::kRunning:
        print("runs, controlled by " + controller_text(info));
        break;
      case SessionInfo::Phase::kEnded:
        report_end(info);
        break;
    }
  }

  void report_end(const SessionInfo& info) {
    const bool is_fault = info.fault.needs_recovery();
    print(info.fault_text, is_fault ? Style::kBad : Style::kPlain);
    if (figures_.total().steps > 0) print(summary(info));
    if (is_fault) print(fmt::format("waits for 'trifinger recover {}'", name_), Style::kWarning);
  }

  // Summarises the session that has ended.
  [[nodiscard]] std::string summary(const SessionInfo& info) const {
    const LoopFigures::Counts& total = figures_.total();
    std::string text =
        fmt::format("{}, {} at the end", counted(info.steps, "step"), rate_text(figures_.rate()));
    if (info.is_real_time) {
      text += fmt::format(", {}, {} skipped", counted(total.repeats, "repeat"), total.skipped);
      if (const auto timing = session_->session().timing()) {
        text += "; lateness " + describe(timing->lateness());
      }
    }
    return text;
  }

  [[nodiscard]] std::vector<Segment> status_line(bool is_stopping,
                                                 const std::string& recorder_trouble) const {
    const SessionInfo info = session_->session().info();
    const Health health = health_of(info);
    const std::string state = is_stopping ? "stopping" : state_text(info);
    std::vector<Segment> segments{{name_, 10, Style::kBold},
                                  {state, 11, is_stopping ? Style::kWarning : style_of(health)}};
    if (!recorder_trouble.empty()) {
      segments.push_back({"recorder " + recorder_trouble, 10, Style::kBad});
    }
    if (info.phase == SessionInfo::Phase::kRunning) {
      const LoopFigures::Counts recent = figures_.last_second();
      segments.push_back({rate_text(figures_.rate()), 9, Style::kPlain});
      segments.push_back({fmt::format("step {}", info.steps), 8, Style::kPlain});
      if (info.is_real_time) {
        const LatenessHistogram lateness = figures_.lateness();
        segments.push_back(
            {fmt::format("late p99 {} max {}", duration_text(lateness.quantile(0.99)),
                         duration_text(lateness.max())),
             6, Style::kPlain});
        segments.push_back({fmt::format("repeats {}", figures_.total().repeats), 7,
                            recent.repeats > 0 ? Style::kWarning : Style::kPlain});
      }
      segments.push_back({controller_text(info), 5, Style::kDim});
    }
    return segments;
  }

  std::string name_;
  const SessionHost& host_;
  Console console_;
  LoopFigures figures_;
  std::optional<UntypedFrontend> session_;
  std::optional<SessionInfo::Phase> phase_;  // the phase that was reported last
};

// Describes what the back-end was told, in a sentence.
std::string timing_text(const BackendOptions& options) {
  if (options.mode == BackendOptions::Mode::kNonRealTime) {
    return fmt::format(
        "non-real-time mode, steps of {}: time stands still until the next action is there",
        duration_text(options.period));
  }
  const std::string late = options.max_action_repeats == 0
                               ? "a late action ends the session with a fault"
                               : fmt::format(
                                     "a late action is repeated at most {} times in a row, then "
                                     "the session ends with a fault",
                                     options.max_action_repeats);
  return fmt::format("real-time mode, {}; {}",
                     rate_text(1e9 / static_cast<double>(options.period.count())), late);
}

// Saves the state of the simulation `name` before it diverged. Returns a sentence that says where.
std::string save(const SimulationState& state, const std::string& name) {
  try {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    const auto seconds = std::chrono::floor<std::chrono::seconds>(now);
    const auto milliseconds = std::chrono::floor<std::chrono::milliseconds>(now - seconds);
    const std::filesystem::path path =
        log_folder() / fmt::format("{}_{:%Y-%m-%d_%H-%M-%S}.{:03}_fault.state", name,
                                   fmt::gmtime(seconds.count()), milliseconds.count());
    write_new_file(path, state);
    return "the state before the divergence is in " + path.string();
  } catch (const Error& error) {
    return fmt::format("the state before the divergence could not be saved: {}", error.what());
  }
}

// Carries sentences from the loop's thread to the thread that prints.
class Messages {
 public:
  void add(std::string sentence) {
    const std::lock_guard lock(mutex_);
    sentences_.push_back(std::move(sentence));
    Signals::notify();
  }
  [[nodiscard]] std::vector<std::string> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(sentences_, {});
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> sentences_;
};

// A robot cannot be paused, and it must not fail because nobody reads its messages any more.
void ignore_signals_of_terminals() {
  for (const int signal : {SIGTSTP, SIGTTOU, SIGPIPE}) std::signal(signal, SIG_IGN);
}

// Ends the program like a kill would, so that the memory of the last session remains: it holds what
// the log lacks. The robot is at rest by now.
[[noreturn]] void leave_memory_behind(int exit_code) {
  std::fflush(nullptr);
  std::_Exit(exit_code);
}

int run(const RunOptions& options) {
  const Signals signals;
  ignore_signals_of_terminals();
  RunnableRobot robot = make_robot(options.robot, options.overrides, options.state);
  const std::string name = options.name.value_or(robot.name);
  if (options.real_time) robot.backend.mode = BackendOptions::Mode::kRealTime;
  if (options.non_real_time) robot.backend.mode = BackendOptions::Mode::kNonRealTime;
  RealtimeOptions realtime = options.realtime;
  realtime.demand = options.scheduling.value();
  realtime.lock_memory = !options.no_memory_lock;
  realtime.keep_cpus_awake = !options.let_cpus_sleep;
  if (robot.backend.mode == BackendOptions::Mode::kNonRealTime) realtime.demand = Demand::kOff;

  SessionHost host = SessionHost::named(name, robot.session);
  log::FlightRecorder flight_recorder({.length = std::chrono::round<Nanoseconds>(
                                           std::chrono::duration<double>(options.fault_log))});
  std::unique_ptr<RunRecorder> recorder;  // declared before the back-end, which it must outlive
  Backend backend(*robot.driver, host, robot.backend);
  Messages messages;
  backend.set_after_session([&](const Fault& fault) {
    const SimulationState state = robot.state_before(fault);
    if (!state.empty()) messages.add(save(state, name));
  });
  backend.set_on_waiting([&](const std::string& problem) {
    messages.add("the next session waits for memory: " + problem);
  });
  if (options.fault_log > 0.0) backend.follow(flight_recorder);
  if (options.record) recorder = RunRecorder::start(name, *options.record, robot.backend, backend);
  RunReporter reporter(name, host);
  reporter.print(timing_text(robot.backend));
  BackendThread loop(backend, realtime, Signals::notify);
  for (const std::string& sentence : loop.refused()) reporter.print(sentence, Style::kWarning);

  const auto report = [&](bool is_stopping) {
    // Taken before `look`, so that the end of a session is reported before the sentences about it.
    const std::vector<std::string> sentences = messages.take();
    reporter.look(is_stopping, recorder != nullptr ? recorder->trouble() : "");
    for (const std::string& sentence : sentences) reporter.print(sentence);
    if (recorder != nullptr) {
      for (const RunRecorder::Line& line : recorder->look()) {
        reporter.print("recorder", line.text, line.style);
      }
    }
    for (const log::FlightRecorder::Left& left : flight_recorder.write()) {
      if (left.trouble.empty()) {
        reporter.print("what came before the fault is in " + left.file.string());
      } else {
        reporter.print("what came before the fault is lost: " + left.trouble, Style::kWarning);
      }
    }
  };
  bool is_stopping = false;
  while (!loop.wait_for_end(Timeout::zero())) {
    if (const std::optional<int> signal = signals.wait(kRefresh)) {
      if (is_stopping) Signals::die_of(*signal);
      is_stopping = true;
      backend.request_stop();
      reporter.print("comes to rest; a second Ctrl-C kills");
    }
    report(is_stopping);
  }
  report(is_stopping);
  if (recorder != nullptr) {
    while (!recorder->finish(kRefresh)) {
      if (const std::optional<int> signal = signals.wait(Nanoseconds::zero())) {
        Signals::die_of(*signal);
      }
      report(is_stopping);
    }
    report(is_stopping);
  }
  const std::string missing = recorder != nullptr ? recorder->failure() : "";
  if (!missing.empty()) {
    reporter.print("recorder",
                   fmt::format("{}. The log in {} lacks the end; it is still in memory: 'trifinger "
                               "record {} --until-end --to {}' writes it, here or in another "
                               "folder, until a back-end of this name is started",
                               missing, options.record->string(), name, options.record->string()),
                   Style::kBad);
    leave_memory_behind(run_and_report("trifinger", [&loop] {
      loop.stop();
      return static_cast<int>(kIncomplete);
    }));
  }
  loop.stop();
  reporter.print("stopped");
  return kDone;
}

}  // namespace

void add_run(CLI::App& program, Action& action) {
  auto options = std::make_shared<RunOptions>();
  CLI::App* const command =
      program.add_subcommand("run", "Start the back-end of a robot and keep it running");
  command
      ->add_option(
          "ROBOT", options->robot,
          "sim, fake, another configuration by name, the file of one, or a log to be played")
      ->required();
  command->add_option("--name", options->name, "Name of the session; default: the configuration's")
      ->option_text("NAME");
  command
      ->add_option("--set", options->overrides,
                   "Change a value of the configuration, as in fingers.height=0.3")
      ->allow_extra_args(false)
      ->option_text("KEY=VALUE ...");
  command
      ->add_option("--state", options->state,
                   "Begin every session of a simulation in a saved state, as one from before a "
                   "divergence")
      ->option_text("FILE");
  CLI::Option* const real_time = command->add_flag("--real-time", options->real_time,
                                                   "One step per period, whatever the user does");
  command
      ->add_flag("--non-real-time", options->non_real_time,
                 "Wait for every action, as long as it takes")
      ->excludes(real_time);
  command
      ->add_option("--fault-log", options->fault_log,
                   "Length of the log that a fault leaves behind; default: 10, none: 0")
      ->check(CLI::Range(0.0, 3600.0))
      ->option_text("SECONDS");
  command
      ->add_option("--record", options->record,
                   "Record everything into this folder, as 'trifinger record' does")
      ->option_text("DIR");
  options->scheduling.add_to(*command,
                             "Real-time priority, locked memory, processors that stay awake; "
                             "default: try, and go on without");
  command
      ->add_option("--priority", options->realtime.priority,
                   "SCHED_FIFO priority of the loop, 1 to 99; default: 80")
      ->check(CLI::Range(1, 99))
      ->option_text("N");
  command
      ->add_option("--cpu", options->realtime.cpu,
                   "Processor on which the loop stays; default: any")
      ->check(CLI::Range(0, CPU_SETSIZE - 1))
      ->option_text("N");
  command->add_flag("--no-memory-lock", options->no_memory_lock,
                    "Let the kernel move memory out when it is scarce");
  command->add_flag("--let-cpus-sleep", options->let_cpus_sleep,
                    "Save power: processors may enter states that they wake from slowly");
  command->footer(
      "Ctrl-C, SIGTERM and SIGHUP bring the robot to rest, exit code 0; a second one kills.\n"
      "A recorder that dies is replaced, one that stands still is told of. Exit code 3 says that\n"
      "the log lacks the end of the last session, and how to get it.\n"
      "A fault leaves a log of the last seconds in $TRIFINGER_LOG_DIR, default\n"
      "~/.local/state/trifinger; a simulation that diverges leaves the state before, too.\n"
      "Example:\n"
      "  trifinger run sim --set fingers.height=0.3\n"
      "  trifinger run sim --record logs\n"
      "  trifinger run ./my_robot.yml --name left --scheduling require --cpu 3\n"
      "  trifinger run demo.mcap --name again --set first=2000");
  command->callback([&action, options] { action = [options] { return run(*options); }; });
}

}  // namespace trifinger::apps
