// SPDX-License-Identifier: BSD-3-Clause
// The program `trifinger-endurance`: random motion with collisions for weeks, without an operator.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "controller/user_program.hpp"
#include "endurance/drive.hpp"
#include "endurance/history.hpp"
#include "endurance/page.hpp"
#include "endurance/simulated.hpp"
#include "shared/exit_code.hpp"
#include "shared/options.hpp"
#include "shared/signals.hpp"
#include "shared/terminal.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::apps {
namespace {

constexpr int kNeedsOperator = 4;
constexpr Nanoseconds kLook = std::chrono::milliseconds(200);

struct EnduranceOptions {
  std::string robot;
  SimulatedOptions simulated;
  DriveOptions drive;
  std::optional<Nanoseconds> duration;
  std::filesystem::path output{"endurance"};
  std::filesystem::path identified{};
  Nanoseconds write_every{std::chrono::seconds(10)};
  Demand scheduling{Demand::kTry};

  [[nodiscard]] bool is_simulated() const noexcept { return !simulated.robot.empty(); }
};

// Short names for legends: "120 middle" is the middle joint of finger 120.
std::vector<std::string> joint_names(const std::string& type, std::size_t count) {
  std::vector<std::string> names;
  names.reserve(count);
  const bool has_fingers = (type == "trifinger" && count == 9) || (type == "finger" && count == 3);
  for (std::size_t i = 0; i < count; ++i) {
    names.push_back(has_fingers ? fmt::format("{} {}", 120 * (i / 3),
                                              i % 3 == 0   ? "upper"
                                              : i % 3 == 1 ? "middle"
                                                           : "lower")
                                : fmt::format("joint {}", i));
  }
  return names;
}

std::int64_t wall_clock() {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// Keeps the history of a robot and its files, beside the thread that drives it.
class HealthRecorder {
 public:
  HealthRecorder(const EnduranceOptions& options, const Owner& owner)
      : name_(owner.robot), every_(options.write_every), folder_(options.output) {
    if (!options.identified.empty()) checks_ = options.identified / "history.jsonl";
    std::optional<History> history = folder_.read(owner);
    if (!folder_.damage().empty()) console_.print(name_, folder_.damage(), Style::kWarning);
    if (history) {
      console_.print(name_, fmt::format("goes on counting after {} steps, from {}",
                                        history->total().steps, folder_.data_file().string()));
    }
    history_.emplace(history ? std::move(*history) : History(owner));
    history_->count_start();
    // What cannot be written at all is better known now than in a week.
    folder_.write(*history_, page(false, false));
    console_.print(name_, "its health is in " + folder_.page_file().string());
  }

  [[nodiscard]] std::uint64_t sessions() const noexcept { return history_->total().sessions; }

  // Takes what the drive has counted, and writes the files if it is time.
  void look(Drive& drive) {
    take(drive);
    const Instant now = std::chrono::steady_clock::now();
    // A page after a minute of the robot's time lets one see something soon, but simulated minutes
    // are short.
    const bool has_new_interval = history_->intervals().size() != shown_intervals_;
    const Nanoseconds since = now - written_;
    if (since >= every_ || (has_new_interval && since >= kLeast) ||
        (has_new_events_ && since >= kLeast)) {
      write(false, false);
    }
    draw();
  }

  // Writes the last page. Returns whether everything is on disk.
  bool finish(Drive& drive, const Outcome& outcome) {
    take(drive);
    if (outcome.needs_operator) state_ = "An operator is needed: " + outcome.why;
    write(true, outcome.needs_operator);
    const Tally& total = history_->total();
    console_.print(name_, fmt::format("{} steps, {} collisions, {} failures, {} recoveries; {}",
                                      total.steps, total.collisions, total.all_failures(),
                                      total.recoveries, folder_.page_file().string()));
    if (outcome.needs_operator)
      console_.print(name_, "an operator is needed: " + outcome.why, Style::kBad);
    return !is_full_;
  }

 private:
  static constexpr Nanoseconds kLeast = std::chrono::seconds(1);

  void take(Drive& drive) {
    Tally tally(history_->num_joints());
    events_.clear();
    drive.take(tally, events_);
    if (tally != Tally(history_->num_joints())) history_->add(tally, wall_clock());
    for (const Event& event : events_) {
      has_new_events_ = true;
      if (event.is_over) {
        state_ = "It moves.";
        console_.print(name_, event.text, Style::kGood);
        continue;
      }
      history_->set_last_words(event.failure, event.text);
      state_ = "It recovers from a failure: " + event.text;
      console_.print(name_, fmt::format("{}: {}", name_of(event.failure), event.text),
                     Style::kWarning);
    }
  }

  void write(bool is_over, bool needs_operator) {
    written_ = std::chrono::steady_clock::now();
    shown_intervals_ = history_->intervals().size();
    has_new_events_ = false;
    try {
      folder_.write(*history_, page(is_over, needs_operator));
      if (is_full_) console_.print(name_, "its health is written again", Style::kGood);
      is_full_ = false;
    } catch (const Error& error) {
      if (!is_full_) {
        console_.print(
            name_,
            fmt::format("its health cannot be written: {}. The robot goes on, and what is "
                        "counted is kept in memory until it can",
                        error.what()),
            Style::kWarning);
      }
      is_full_ = true;
    }
  }

  [[nodiscard]] std::string page(bool is_over, bool needs_operator) const {
    const std::string state = is_over && !needs_operator ? "It has ended as requested." : state_;
    return make_page(*history_, {.state = state,
                                 .needs_operator = needs_operator,
                                 .is_over = is_over,
                                 .now = wall_clock(),
                                 .checks = checks_});
  }

  void draw() {
    const Tally& total = history_->total();
    console_.draw({{.text = fmt::format("{}: {} steps", name_, total.steps), .importance = 3},
                   {.text = fmt::format("{} collisions", total.collisions), .importance = 1},
                   {.text = fmt::format("{} failures", total.all_failures()), .importance = 2},
                   {.text = fmt::format("{} recoveries", total.recoveries), .importance = 2}});
  }

  std::string name_;
  Nanoseconds every_;
  std::filesystem::path checks_;
  HistoryFolder folder_;
  std::optional<History> history_;
  std::vector<Event> events_;
  Console console_;
  std::string state_{"It moves."};
  bool has_new_events_{false};
  bool is_full_{false};
  std::size_t shown_intervals_{0};
  Instant written_{std::chrono::steady_clock::now()};
};

int endure(EnduranceOptions options) {
  // Nobody may read the messages of weeks.
  for (const int signal : {SIGPIPE, SIGTTOU}) std::signal(signal, SIG_IGN);
  const Signals signals;  // before any thread
  std::atomic<bool> stop{false};
  std::unique_ptr<Place> place;
  std::optional<Session> session;
  if (options.is_simulated()) {
    options.simulated.seed = options.drive.motion.seed;
    auto simulated = std::make_unique<SimulatedPlace>(options.simulated, stop);
    session.emplace(simulated->session());
    place = std::move(simulated);
  } else {
    place = std::make_unique<RunningRobot>(options.robot, stop);
    session.emplace(Session::open(options.robot));
  }
  const SessionInfo info = session->info();
  if (!options.is_simulated()) {
    options.drive.realtime = realtime_beside(info, options.scheduling);
  }
  if (options.duration) options.drive.most_time = *options.duration;
  const std::size_t joints = JointLayout(session->description()).joints();
  HealthRecorder recorder(
      options, {.robot = info.name, .type = info.type, .joints = joint_names(info.type, joints)});
  options.drive.first_session = recorder.sessions();
  Drive drive(*place, *session, options.drive, stop);
  session.reset();

  Outcome outcome;
  std::exception_ptr failure;
  std::atomic<bool> has_ended{false};
  {
    std::jthread driver([&] {
      try {
        outcome = drive.run();
      } catch (...) {
        failure = std::current_exception();
      }
      has_ended = true;
      Signals::notify();
    });
    while (!has_ended) {
      if (const std::optional<int> signal = signals.wait(kLook)) {
        if (stop) Signals::die_of(*signal);
        stop = true;
      }
      recorder.look(drive);
    }
  }
  const bool is_written = recorder.finish(drive, outcome);
  if (failure) std::rethrow_exception(failure);
  if (outcome.needs_operator) return kNeedsOperator;
  return is_written ? kDone : kIncomplete;
}

void add_simulation_options(CLI::App& program, SimulatedOptions& simulated) {
  program
      .add_option("--simulate", simulated.robot,
                  "Instead of a running robot, simulate this configuration, as fast as it goes")
      ->option_text("CONFIG");
  add_overrides(program, simulated.overrides, "fingers.height=0.3",
                "With --simulate: change a value of the configuration");
  add_number(
      program, "--faults-every",
      [&simulated](double value) { simulated.faults_every = static_cast<std::uint64_t>(value); }, 0,
      1e15, "With --simulate: steps from one injected fault to the next; default: none")
      ->option_text("STEPS");
}

void add_recovery_options(CLI::App& program, RecoveryOptions& recovery) {
  add_number(
      program, "--attempts",
      [&recovery](double value) { recovery.attempts = static_cast<int>(value); }, 1, 1000,
      "Attempts in a row to recover before an operator is asked for; default: 8");
  add_duration(program, "--timeout", recovery.timeout,
               "How long to wait for a robot that nobody runs; default: 10min");
  add_number(
      program, "--max-failures", [&recovery](double value) { recovery.most_per_hour = value; }, 1,
      1e9, "Failures in an hour before an operator is asked for; default: 30");
}

int endurance_command(const std::vector<std::string>& words) {
  EnduranceOptions options;
  CLI::App program(
      "Moves a robot at random, with collisions, for weeks. It recovers by itself from what needs "
      "no operator,\ncounts everything, and writes a page of the robot's health.",
      "trifinger endurance");
  set_up_help(program);
  program.add_option("NAME", options.robot,
                     "Name of the running robot; default: the only one that runs");
  add_output(program, options.output,
             "Folder of the page and the counts; earlier counts there go on", "FOLDER")
      ->capture_default_str();
  program
      .add_option("--identified", options.identified,
                  "Folder of 'trifinger identify': the page shows what its checks have found")
      ->option_text("FOLDER");
  Nanoseconds duration{0};
  add_duration(program, "--duration", duration, "How long, as in 12h or 7d; default: until Ctrl-C");
  double steps = 0.0;
  add_number(
      program, "--steps", [&steps](double value) { steps = value; }, 1, 1e15,
      "Number of steps; default: any");
  add_simulation_options(program, options.simulated);
  add_number(
      program, "--seed",
      [&options](double value) { options.drive.motion.seed = static_cast<std::uint64_t>(value); },
      0, 9e15, "Seed of the motions and of what is injected; default: 0");
  add_number(
      program, "--speed", [&options](double value) { options.drive.motion.speed = value; }, 0.01,
      1.0, "Share of the joints' greatest speed; default: 0.5");
  Nanoseconds pass_every = std::chrono::minutes(10);
  add_duration(program, "--pass-every", pass_every,
               "Time from one measurement of friction to the next; default: 10min");
  add_recovery_options(program, options.drive.recovery);
  add_duration(program, "--write-every", options.write_every,
               "Time from one writing of the files to the next; default: 10s");
  add_user_scheduling(program, options.scheduling);
  program.footer(
      "Ctrl-C, SIGTERM and SIGHUP bring the robot to rest and write the page; a second one kills.\n"
      "Exit code 0: it has ended as requested. 4: an operator is needed; the text says what for. "
      "3: "
      "the files\ncould not be written at the end.\n"
      "Example:\n"
      "  trifinger run sim                     in one terminal\n"
      "  trifinger endurance --duration 12h    in another\n"
      "  trifinger endurance --simulate trifinger_edu_emulated --steps 1e6 --faults-every 1e5");
  return run_user_program(program, words, [&] {
    if (duration > Nanoseconds::zero()) options.duration = duration;
    if (steps > 0.0) options.drive.most_steps = static_cast<std::uint64_t>(steps);
    options.drive.motion.pass_every = pass_every;
    if (!options.is_simulated() &&
        (options.simulated.faults_every > 0 || !options.simulated.overrides.empty())) {
      throw UsageError("--faults-every and --set are for --simulate");
    }
    if (!options.is_simulated() && options.robot.empty()) options.robot = running_robot();
    return endure(std::move(options));
  });
}

}  // namespace
}  // namespace trifinger::apps

int main(int argument_count, char** arguments) {
  return trifinger::apps::endurance_command({arguments + 1, arguments + argument_count});
}
