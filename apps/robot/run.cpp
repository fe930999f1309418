// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/chrono.h>
#include <fmt/core.h>
#include <sched.h>
#include <sys/types.h>
#include <unistd.h>

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

#include "base/regular_file.hpp"
#include "commands.hpp"
#include "core/log_folder.hpp"
#include "log/flight_recorder.hpp"
#include "log/options.hpp"
#include "robot/run_recorder.hpp"
#include "robot/run_reporter.hpp"
#include "robot/runnable_robot.hpp"
#include "robot/sensor_processes.hpp"
#include "robot/wear_recorder.hpp"
#include "shared/options.hpp"
#include "shared/signals.hpp"
#include "shared/terminal.hpp"
#include "shared/text.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::apps {
namespace {

struct RunOptions {
  std::string robot;
  std::optional<std::string> name;
  std::vector<std::string> overrides;
  std::optional<std::filesystem::path> state;
  std::optional<BackendOptions::Mode> mode;
  Nanoseconds fault_log{std::chrono::seconds(10)};
  std::optional<std::filesystem::path> record;
  log::ImageStorage images{log::ImageStorage::kJpeg};
  bool has_sensors{true};
  pid_t parent{0};  // ends in order when it has ended, unless 0
  RealtimeOptions realtime;
};

RunnableRobot robot_for(const RunOptions& options) {
  RunnableRobot robot = make_robot({.robot = options.robot,
                                    .name = options.name,
                                    .overrides = options.overrides,
                                    .state = options.state,
                                    .mode = options.mode});
  if (robot.needs_real_time && robot.backend.mode != BackendOptions::Mode::kRealTime) {
    throw InvalidArgument("a robot on motor boards or Dynamixel motors runs in real time only");
  }
  return robot;
}

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

// A robot that runs, with all that looks after it.
class Run {
 public:
  explicit Run(const RunOptions& options)
      : options_(options),
        robot_(robot_for(options)),
        host_(SessionHost::named(robot_.name, robot_.session)),
        flight_recorder_({.length = options.fault_log}),
        backend_(*robot_.driver, host_, robot_.backend),
        reporter_(robot_.name, host_) {
    if (robot_.boards != nullptr) wear_.emplace(robot_.name, *robot_.boards, host_);
    backend_.set_after_session([this](const Fault& fault) {
      if (wear_) wear_->take();
      const SimulationState state = robot_.state_before(fault);
      if (!state.empty()) messages_.add(save(state, robot_.name));
    });
    backend_.set_on_waiting([this](const std::string& problem) {
      messages_.add("the next session waits for memory: " + problem);
    });
    if (options.fault_log > Nanoseconds::zero()) backend_.follow(flight_recorder_);
    if (options.record) {
      recorder_ = RunRecorder::start(robot_.name, *options.record, options.images, robot_.backend,
                                     backend_);
    }
  }

  // Returns the exit code after somebody has stopped the robot. Throws what ended the back-end
  // before.
  int until_end() {
    reporter_.print(timing_text(robot_.backend));
    if (!robot_.calibration.empty()) reporter_.print(robot_.calibration);
    for (const std::string& warning : robot_.warnings) print_warning(warning);
    RealtimeOptions realtime = options_.realtime;
    if (robot_.backend.mode == BackendOptions::Mode::kNonRealTime) realtime.demand = Demand::kOff;
    BackendThread loop(backend_, realtime, Signals::notify);
    for (const std::string& sentence : loop.refused()) reporter_.print(sentence, Style::kWarning);

    if (options_.has_sensors) sensors_.emplace(robot_.sensor_programs);
    while (!loop.wait_for_end(Timeout::zero())) {
      if (const std::optional<int> signal = signals_.wait(kRefresh)) {
        if (is_stopping_) die_of(*signal);
        stop();
        reporter_.print("comes to rest; a second Ctrl-C kills");
      } else if (has_lost_parent() && !is_stopping_) {
        stop();
        reporter_.print("comes to rest: the program that has started it has ended");
      }
      report();
    }
    report();
    finish_sensors();
    finish_recording();
    if (recorder_ != nullptr && !recorder_->failure().empty()) leave_memory_behind(loop);
    loop.stop();
    if (wear_) print_warning(wear_->finish());
    reporter_.print("stopped");
    return kDone;
  }

 private:
  void stop() {
    is_stopping_ = true;
    backend_.request_stop();
  }

  [[nodiscard]] bool has_lost_parent() const {
    return options_.parent > 0 && ::getppid() != options_.parent;
  }

  void report() {
    // Taken before `look`, so that the end of a session is reported before the sentences about it.
    const std::vector<std::string> sentences = messages_.take();
    reporter_.look(is_stopping_, recorder_ != nullptr ? recorder_->error() : "");
    for (const std::string& sentence : sentences) reporter_.print(sentence);
    if (wear_) print_warning(wear_->look());
    for (const std::string& sentence : robot_.messages()) reporter_.print(sentence);
    if (sensors_) {
      for (const std::string& sentence : sensors_->look()) reporter_.print(sentence);
    }
    if (recorder_ != nullptr) {
      for (const RunRecorder::Line& line : recorder_->look()) {
        reporter_.print("recorder", line.text, line.style);
      }
    }
    for (const log::FlightRecorder::Left& left : flight_recorder_.write()) {
      if (left.error.empty()) {
        reporter_.print("what came before the fault is in " + left.file.string());
      } else {
        reporter_.print("what came before the fault is lost: " + left.error, Style::kWarning);
      }
    }
  }

  void print_warning(const std::string& warning) {
    if (!warning.empty()) reporter_.print(warning, Style::kWarning);
  }

  void finish_sensors() {
    while (sensors_ && !sensors_->finish(kRefresh)) {
      if (const std::optional<int> signal = signals_.wait(Nanoseconds::zero())) {
        die_of(*signal);
      }
    }
    sensors_.reset();
  }

  void finish_recording() {
    if (recorder_ == nullptr) return;
    while (!recorder_->finish(kRefresh)) {
      if (const std::optional<int> signal = signals_.wait(Nanoseconds::zero())) {
        Signals::die_of(*signal);
      }
      report();
    }
    report();
  }

  // Ends the program at once. Nobody finds the sessions of a robot that has gone, unless the log
  // may lack what they have in memory.
  [[noreturn]] void die_of(int signal) {
    if (recorder_ == nullptr) host_.withdraw();
    Signals::die_of(signal);
  }

  // Ends the program like a kill would, so that the memory of the last session remains: it has what
  // the log lacks. The robot is at rest by now.
  [[noreturn]] void leave_memory_behind(BackendThread& loop) {
    const std::string folder = options_.record->string();
    reporter_.print(
        "recorder",
        fmt::format("{}. The log in {} lacks the end; it is still in memory: 'trifinger record {} "
                    "--until-end -o {}' writes it, here or in another folder, until a back-end "
                    "of this name is started",
                    recorder_->failure(), folder, robot_.name, folder),
        Style::kBad);
    const int exit_code = run_and_report("trifinger", [&loop] {
      loop.stop();
      return static_cast<int>(kIncomplete);
    });
    std::fflush(nullptr);
    std::_Exit(exit_code);
  }

  const Signals signals_;  // before any thread
  const RunOptions& options_;
  RunnableRobot robot_;
  SessionHost host_;
  log::FlightRecorder flight_recorder_;
  Messages messages_;
  std::optional<WearRecorder> wear_;
  std::unique_ptr<RunRecorder> recorder_;  // before the back-end, which it must outlive
  Backend backend_;
  RunReporter reporter_;
  std::optional<SensorProcesses> sensors_;
  bool is_stopping_{false};
};

int run(const RunOptions& options) {
  // A robot cannot be paused, and it must not fail because nobody reads its messages any more.
  for (const int signal : {SIGTSTP, SIGTTOU, SIGPIPE}) std::signal(signal, SIG_IGN);
  return Run(options).until_end();
}

void add_realtime(CLI::App& command, RealtimeOptions& realtime) {
  add_scheduling(command, realtime.demand,
                 "Whether real-time priority, locked memory and awake processors are required; "
                 "default: try, and go on without");
  command
      .add_option("--priority", realtime.priority,
                  "SCHED_FIFO priority of the loop, 1 to 99; default: 80")
      ->check(CLI::Range(1, 99))
      ->option_text("N");
  command.add_option("--cpu", realtime.cpu, "Processor on which the loop stays; default: any")
      ->check(CLI::Range(0, CPU_SETSIZE - 1))
      ->option_text("N");
  command.add_flag_callback(
      "--no-memory-lock", [&realtime] { realtime.lock_memory = false; },
      "Let the kernel move memory out when it is scarce");
  command.add_flag_callback(
      "--let-cpus-sleep", [&realtime] { realtime.keep_cpus_awake = false; },
      "Save power: processors may enter states from which they wake slowly");
}

}  // namespace

void add_run(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "run", "Start the back-end of a robot and keep it running", run);
  add_configured_robot(
      command, options,
      "'sim', 'fake', another configuration by name, the file of one, or a log to play",
      "fingers.height=0.3")
      ->required();
  command
      .add_option("--state", options.state,
                  "Begin every session of a simulation in this saved state, such as the one from "
                  "before a divergence")
      ->option_text("FILE");
  using Mode = BackendOptions::Mode;
  CLI::Option* const real_time = command.add_flag_callback(
      "--real-time", [&mode = options.mode] { mode = Mode::kRealTime; },
      "One step per period, whatever the user does");
  command
      .add_flag_callback(
          "--non-real-time", [&mode = options.mode] { mode = Mode::kNonRealTime; },
          "Wait for every action, as long as it takes")
      ->excludes(real_time);
  add_seconds(command, "--fault-log", options.fault_log, 3600.0,
              "Length of the log that is written after a fault; default: 10, none: 0");
  command
      .add_option("--record", options.record,
                  "Record everything into this folder, as 'trifinger record' does")
      ->option_text("FOLDER");
  add_images(command, options.images);
  command.add_flag_callback(
      "--no-sensors", [&options = options] { options.has_sensors = false; },
      "Do not start 'trifinger cameras' and 'trifinger track' beside a robot with cameras");
  command.add_option("--with-process", options.parent)->group("");
  add_realtime(command, options.realtime);
  command.footer(
      "Ctrl-C, SIGTERM and SIGHUP bring the robot to rest, exit code 0; a second one kills.\n"
      "A recorder that dies is replaced. One that stands still is reported. Exit code 3 means "
      "that\n"
      "the log lacks the end of the last session; a message says how to get it.\n"
      "After a fault, a log of the last seconds is written to $TRIFINGER_LOG_DIR, default\n"
      "~/.local/state/trifinger. If a simulation diverged, its state before that is saved there.\n"
      "Example:\n"
      "  trifinger run sim --set fingers.height=0.3\n"
      "  trifinger run sim --record logs\n"
      "  trifinger run ./my_robot.yml --name left --scheduling require --cpu 3\n"
      "  trifinger run demo.mcap --name again --set first=2000");
}

}  // namespace trifinger::apps
