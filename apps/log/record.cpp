// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <atomic>
#include <charconv>
#include <chrono>
#include <csignal>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "log/text.hpp"
#include "robot/run_recorder.hpp"
#include "robot/session_state.hpp"
#include "shared/choice.hpp"
#include "shared/quantity.hpp"
#include "shared/signals.hpp"
#include "shared/terminal.hpp"
#include "shared/text.hpp"
#include "trifinger/core/log_folder.hpp"
#include "trifinger/log/recorder.hpp"

namespace trifinger::apps {
namespace {

using log::Level;
using RecorderEvent = log::Event;

struct RecordOptions {
  std::vector<std::string> names;
  std::optional<std::string> folder;
  Choice<log::Precision> precision{
      "--precision",
      "double",
      {{"double", log::Precision::kDouble}, {"single", log::Precision::kSingle}}};
  Choice<mcap::Compression> compression{"--compression",
                                        "zstd",
                                        {{"zstd", mcap::Compression::kZstd},
                                         {"lz4", mcap::Compression::kLz4},
                                         {"none", mcap::Compression::kNone}}};
  std::optional<std::string> rotate_size;
  std::optional<std::string> rotate_time;
  std::optional<std::string> max_total;
  std::optional<std::string> keep_free;
  std::optional<std::string> sync;
  bool until_end{false};
  std::string process;  // "PID:START", set by `trifinger run --record`
};

std::optional<ipc::ProcessIdentity> parse_process(const std::string& text) {
  if (text.empty()) return std::nullopt;
  ipc::ProcessIdentity process;
  const char* const end = text.data() + text.size();
  const auto pid = std::from_chars(text.data(), end, process.pid);
  if (pid.ec == std::errc() && pid.ptr != end && *pid.ptr == ':') {
    const auto start = std::from_chars(pid.ptr + 1, end, process.start_time);
    if (start.ec == std::errc() && start.ptr == end) return process;
  }
  throw UsageError(fmt::format("--with-process is '{}', must be PID:START", text));
}

log::RecorderOptions recorder_options(const RecordOptions& options) {
  log::RecorderOptions recorder;
  recorder.folder = options.folder ? std::filesystem::path(*options.folder) : log_folder();
  recorder.precision = options.precision.value();
  recorder.compression = options.compression.value();
  const auto set_size = [](const char* name, const std::optional<std::string>& text,
                           std::uint64_t& size) {
    if (text) size = parse_size(name, *text);
  };
  const auto set_time = [](const char* name, const std::optional<std::string>& text,
                           Nanoseconds& time) {
    if (text) time = parse_duration(name, *text);
  };
  // Every file describes its sessions again: their fields and their documents.
  constexpr std::uint64_t kSmallestFile = 1'000'000;
  const auto require_room = [](const char* name, std::uint64_t size, std::uint64_t smallest) {
    if (size >= smallest) return;
    throw UsageError(fmt::format(
        "{} is {}, must be at least {}: every file describes its sessions anew, and would hold "
        "little else",
        name, size_text(size), size_text(smallest)));
  };
  set_size("--rotate-size", options.rotate_size, recorder.rotate_size);
  require_room("--rotate-size", recorder.rotate_size, kSmallestFile);
  set_size("--max-total", options.max_total, recorder.max_total);
  // A single file takes at most an eighth of the total.
  if (recorder.max_total > 0) require_room("--max-total", recorder.max_total, 8 * kSmallestFile);
  set_size("--keep-free", options.keep_free, recorder.keep_free);
  set_time("--rotate-time", options.rotate_time, recorder.rotate_time);
  set_time("--sync", options.sync, recorder.sync_period);
  recorder.until_end = options.until_end;
  recorder.until_process_ends = parse_process(options.process);
  return recorder;
}

Style style_of(Level level) noexcept {
  switch (level) {
    case Level::kInfo:
      break;
    case Level::kWarning:
      return Style::kWarning;
    case Level::kError:
      return Style::kBad;
  }
  return Style::kPlain;
}

// The recorder in a thread of its own. It notifies `Signals` of every event.
class RunningRecorder {
 public:
  // Throws AlreadyRecorded, InvalidArgument, SystemError.
  RunningRecorder(const std::vector<std::string>& robots, log::RecorderOptions options)
      : recorder_(robots, with_listener(std::move(options))), thread_([this] { run(); }) {}
  RunningRecorder(const RunningRecorder&) = delete;
  RunningRecorder& operator=(const RunningRecorder&) = delete;
  ~RunningRecorder() { recorder_.request_stop(); }

  [[nodiscard]] log::Recorder& recorder() noexcept { return recorder_; }
  [[nodiscard]] bool has_ended() const noexcept {
    // acquire: the failure was stored before.
    return has_ended_.load(std::memory_order_acquire);
  }
  // Returns what ended the recorder before it was asked to. Call this at the end.
  [[nodiscard]] std::exception_ptr failure() const noexcept { return failure_; }
  // Returns the events since the last call.
  [[nodiscard]] std::vector<RecorderEvent> take_events() {
    const std::lock_guard lock(mutex_);
    return std::exchange(events_, {});
  }

 private:
  log::RecorderOptions with_listener(log::RecorderOptions options) {
    options.on_event = [this](const RecorderEvent& event) {
      {
        const std::lock_guard lock(mutex_);
        events_.push_back(event);
      }
      Signals::notify();
    };
    return options;
  }

  void run() noexcept {
    try {
      recorder_.run();
    } catch (...) {
      failure_ = std::current_exception();
    }
    // release: the failure was stored before.
    has_ended_.store(true, std::memory_order_release);
    Signals::notify();
  }

  std::mutex mutex_;
  std::vector<RecorderEvent> events_;
  log::Recorder recorder_;
  std::exception_ptr failure_;
  std::atomic<bool> has_ended_{false};
  std::jthread thread_;  // last member, because the thread uses the others
};

// Prints the recorder's events and its state.
class RecordReporter {
 public:
  void print(const std::string& about, const std::string& text, Style style = Style::kPlain) {
    console_.print(about, text, style);
  }

  void look(RunningRecorder& thread, bool is_stopping) {
    for (const RecorderEvent& event : thread.take_events()) {
      print(event.source, event.text, style_of(event.level));
    }
    if (!console_.is_live()) return;
    const log::RecorderState state = thread.recorder().state();
    console_.draw(status_line(state, is_stopping));
  }

  void print_summary(const log::RecorderState& state) {
    print("recorder",
          fmt::format("{} in {}", counted(state.steps, "step"), size_text(state.bytes)));
    if (state.lost_steps > 0) {
      print("recorder",
            fmt::format("{} are not in the log; 'trifinger log info' says which",
                        counted(state.lost_steps, "step")),
            Style::kBad);
    }
  }

 private:
  std::vector<Segment> status_line(const log::RecorderState& state, bool is_stopping) {
    update_rates(state);
    std::vector<std::string> names;
    TimeIndex step = 0;
    double lag = 0.0;
    bool is_recording = false;
    for (const log::RecorderState::Robot& robot : state.robots) {
      names.push_back(robot.name);
      is_recording = is_recording || robot.is_recording;
      step = std::max(step, robot.next_step);
      lag = std::max(lag, robot.lag);
    }
    std::vector<Segment> segments{{fmt::format("{}", fmt::join(names, ", ")), 10, Style::kBold}};
    if (!state.trouble.empty()) {
      segments.push_back({"cannot write: " + state.trouble, 11, Style::kBad});
    } else if (is_stopping) {
      segments.push_back({"finishing", 11, Style::kWarning});
    } else {
      segments.push_back(
          {is_recording ? "recording" : "waiting", 11, is_recording ? Style::kGood : Style::kDim});
    }
    if (is_recording) {
      segments.push_back({rate_text(step_rate_), 9, Style::kPlain});
      segments.push_back({fmt::format("step {}", step), 7, Style::kPlain});
    }
    segments.push_back({size_text(state.bytes), 8, Style::kPlain});
    if (is_recording) {
      segments.push_back(
          {size_text(static_cast<std::uint64_t>(byte_rate_)) + "/s", 4, Style::kPlain});
    }
    if (lag > 0.1)
      segments.push_back({fmt::format("{:.0f} % behind", 100.0 * lag), 10, Style::kBad});
    if (state.lost_steps > 0) {
      segments.push_back({fmt::format("{} lost", state.lost_steps), 10, Style::kBad});
    }
    segments.push_back({state.file.filename().string(), 5, Style::kDim});
    return segments;
  }

  // Averages over about the last second.
  void update_rates(const log::RecorderState& state) {
    constexpr double kWindow = 1.0;  // [s]
    const auto now = std::chrono::steady_clock::now();
    const double time = std::chrono::duration<double>(now - rates_since_).count();
    if (time < kWindow) return;
    step_rate_ = static_cast<double>(state.steps - steps_before_) / time;
    byte_rate_ = static_cast<double>(state.bytes - bytes_before_) / time;
    steps_before_ = state.steps;
    bytes_before_ = state.bytes;
    rates_since_ = now;
  }

  Console console_;
  std::chrono::steady_clock::time_point rates_since_{std::chrono::steady_clock::now()};
  std::int64_t steps_before_{0};
  std::uint64_t bytes_before_{0};
  double step_rate_{0.0};
  double byte_rate_{0.0};
};

// For `trifinger run --record`: a byte on the standard input says that the robot has stopped. The
// end of the input does not: it means that our parent was killed, and then the recorder looks for
// what it left.
std::shared_ptr<const std::atomic<bool>> watch_standard_input() {
  auto has_byte = std::make_shared<std::atomic<bool>>(false);
  std::thread([has_byte] {
    char byte = 0;
    if (::read(STDIN_FILENO, &byte, 1) != 1) return;
    // relaxed: no other data depends on it.
    has_byte->store(true, std::memory_order_relaxed);
    Signals::notify();
  }).detach();  // The thread may wait for ever; it owns what it uses.
  return has_byte;
}

// For `trifinger run --record`: prints a sign if the recorder has made progress since the last
// call.
void give_sign(const log::RecorderState& state, std::uint64_t& progress) {
  if (std::exchange(progress, state.progress) == state.progress) return;
  fmt::print("{}\n", kRecorderSign);
  std::fflush(stdout);
}

int record(const RecordOptions& options) {
  const Signals signals;
  for (const int signal : {SIGTTOU, SIGPIPE}) std::signal(signal, SIG_IGN);
  const bool is_child = !options.process.empty();
  RunningRecorder thread(options.names, recorder_options(options));
  const auto robot_has_stopped = is_child ? watch_standard_input() : nullptr;
  RecordReporter reporter;

  bool is_stopping = false;
  std::uint64_t progress = 0;
  while (!thread.has_ended()) {
    if (const std::optional<int> signal = signals.wait(kRefresh)) {
      if (is_stopping) Signals::die_of(*signal);
      is_stopping = true;
      if (is_child) {
        reporter.print("recorder", "ends with the robot; a second signal kills");
      } else {
        thread.recorder().request_stop();
        reporter.print("recorder", "finishes the log; a second Ctrl-C kills");
      }
    }
    if (is_child && robot_has_stopped->load(std::memory_order_relaxed)) {
      thread.recorder().request_stop();
    }
    reporter.look(thread, is_stopping);
    if (is_child) give_sign(thread.recorder().state(), progress);
  }
  reporter.look(thread, is_stopping);
  if (thread.failure() != nullptr) std::rethrow_exception(thread.failure());
  reporter.print_summary(thread.recorder().state());
  return kDone;
}

}  // namespace

void add_record(CLI::App& program, Action& action) {
  auto options = std::make_shared<RecordOptions>();
  CLI::App* const command = program.add_subcommand(
      "record", "Write everything that robots do into a log, without disturbing them");
  command
      ->add_option("NAME", options->names,
                   "Robots to record into one log, with all that belongs to them")
      ->required()
      ->option_text("...");
  command
      ->add_option("--to", options->folder,
                   "Folder for the files; default: $TRIFINGER_LOG_DIR or "
                   "~/.local/state/trifinger")
      ->option_text("DIR");
  options->precision.add_to(*command, "Single takes half the room, and cannot be replayed exactly");
  options->compression.add_to(*command, "Default: zstd; lz4 takes less time and more room");
  command
      ->add_option("--rotate-size", options->rotate_size,
                   "Size at which the next file is begun; default: 1GB")
      ->option_text("SIZE");
  command
      ->add_option("--rotate-time", options->rotate_time,
                   "Time after which the next file is begun; default: never")
      ->option_text("TIME");
  command
      ->add_option("--max-total", options->max_total,
                   "Remove the oldest files of this recording above this size; default: never")
      ->option_text("SIZE");
  command
      ->add_option("--keep-free", options->keep_free,
                   "Wait while there is less room on the disk; default: 100MB")
      ->option_text("SIZE");
  command
      ->add_option("--sync", options->sync,
                   "How often to make the log survive a loss of power; default: 5s")
      ->option_text("TIME");
  command->add_flag("--until-end", options->until_end,
                    "End when the back-ends of all these robots have ended");
  command->add_option("--with-process", options->process)->group("");  // set by trifinger run
  command->footer(
      "The robots may be started later, stopped and started again. Ctrl-C, SIGTERM and SIGHUP\n"
      "finish the log. A recorder that was killed loses nothing: start it again in time, and it\n"
      "goes on where it was cut off. What could not be recorded is noted as a gap. A robot "
      "without\n"
      "deadlines may be too fast for whoever only looks; 'trifinger run --record' makes it wait.\n"
      "Example:\n"
      "  trifinger record sim --to logs\n"
      "  trifinger record left right --to /data --rotate-time 1h --max-total 200GB");
  command->callback([&action, options] { action = [options] { return record(*options); }; });
}

}  // namespace trifinger::apps
