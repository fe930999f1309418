// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <atomic>
#include <charconv>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "core/log_folder.hpp"
#include "log/options.hpp"
#include "log/recorder.hpp"
#include "log/running_recorder.hpp"
#include "robot/recorder_process.hpp"
#include "shared/options.hpp"
#include "shared/signals.hpp"
#include "shared/terminal.hpp"
#include "shared/text.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/log/event.hpp"

namespace trifinger::apps {
namespace {

using log::Level;

struct RecordOptions {
  std::vector<std::string> names;
  std::filesystem::path folder;
  log::RecorderOptions recorder;
};

ipc::ProcessIdentity parse_process(const std::string& text) {
  ipc::ProcessIdentity process;
  const char* const end = text.data() + text.size();
  const auto pid = std::from_chars(text.data(), end, process.pid);
  if (pid.ec == std::errc() && pid.ptr != end && *pid.ptr == ':') {
    const auto start = std::from_chars(pid.ptr + 1, end, process.start_time);
    if (start.ec == std::errc() && start.ptr == end) return process;
  }
  throw UsageError(fmt::format("--with-process is '{}', must be PID:START", text));
}

void require_room(const char* option, std::uint64_t size, std::uint64_t smallest) {
  if (size >= smallest) return;
  throw UsageError(fmt::format(
      "{} is {}, must be at least {}: every file describes its sessions anew, and would hold "
      "little else",
      option, size_text(size), size_text(smallest)));
}

log::RecorderOptions recorder_options(const RecordOptions& options) {
  log::RecorderOptions recorder = options.recorder;
  recorder.folder = options.folder.empty() ? log_folder() : options.folder;
  // Every file describes its sessions again: their fields and their documents.
  constexpr std::uint64_t kSmallestFile = 1'000'000;
  require_room("--rotate-size", recorder.rotate_size, kSmallestFile);
  // A single file takes at most an eighth of the total.
  if (recorder.max_total > 0) require_room("--max-total", recorder.max_total, 8 * kSmallestFile);
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

// Prints the recorder's events and its state.
class RecordReporter {
 public:
  void print(const std::string& about, const std::string& text, Style style = Style::kPlain) {
    console_.print(about, text, style);
  }

  void look(RunningRecorder& thread, bool is_stopping) {
    for (const log::Event& event : thread.take_events()) {
      print(event.source, event.text, style_of(event.level));
    }
    if (!console_.is_live()) return;
    const log::RecorderState state = thread.recorder().state();
    console_.draw(status_line(state, is_stopping));
  }

  void print_summary(const log::RecorderState& state) {
    print("recorder",
          fmt::format("{} in {}", counted(state.steps, "step"), size_text(state.bytes)));
    if (state.images + state.left_out_images > 0) {
      print(
          "recorder",
          fmt::format(
              "{}{}", counted(state.images, "image"),
              state.left_out_images > 0 ? fmt::format(", {} left out", state.left_out_images) : ""),
          state.left_out_images > 0 ? Style::kBad : Style::kPlain);
    }
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
    if (!state.error.empty()) {
      segments.push_back({"cannot write: " + state.error, 11, Style::kBad});
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
  const bool is_child = options.recorder.until_process_ends.has_value();
  std::vector<std::string> names = options.names;
  if (names.empty()) names.push_back(running_robot());
  RunningRecorder thread(names, recorder_options(options));
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
  thread.require_success();
  reporter.print_summary(thread.recorder().state());
  return kDone;
}

}  // namespace

void add_record(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "record",
                  "Write everything that robots do into a log, without disturbing them", record);
  log::RecorderOptions& recorder = options.recorder;
  command.add_option("NAME", options.names,
                     "Robots to record into one log, with all that belongs to them; "
                     "default: the only one that runs");
  add_output(command, options.folder,
             "Folder for the files; default: $TRIFINGER_LOG_DIR or ~/.local/state/trifinger",
             "FOLDER");
  add_precision(command, recorder.precision);
  add_images(command, recorder.images);
  command.add_option("--jpeg-quality", recorder.jpeg_quality, "1 to 100; default: 90")
      ->check(CLI::Range(1, 100))
      ->option_text("N");
  add_choice(command, "--compression", recorder.compression,
             {{"zstd", mcap::Compression::kZstd},
              {"lz4", mcap::Compression::kLz4},
              {"none", mcap::Compression::kNone}},
             "lz4 takes less time and more space; default: zstd");
  add_size(command, "--rotate-size", recorder.rotate_size,
           "Size at which the next file begins; default: 1GB");
  add_duration(command, "--rotate-time", recorder.rotate_time,
               "Time after which the next file begins; default: never");
  add_size(command, "--max-total", recorder.max_total,
           "Remove the oldest files of this recording above this size; default: never");
  add_size(command, "--keep-free", recorder.keep_free,
           "Wait while the disk has less free space than this; default: 100MB");
  add_duration(command, "--sync", recorder.sync_period,
               "How often the log is made safe against a loss of power; default: 5s");
  command.add_flag("--until-end", recorder.until_end,
                   "End when the back-ends of all these robots have ended");
  const auto set_process = [&recorder](const std::string& text) {
    recorder.until_process_ends = parse_process(text);
  };
  command.add_option_function<std::string>("--with-process", set_process)->group("");
  command.footer(
      "The robots may be started later, stopped and started again. Ctrl-C, SIGTERM and SIGHUP\n"
      "finish the log. If a recorder was killed, start it again soon: it goes on where it was cut\n"
      "off, and nothing is lost. What could not be recorded is noted as a gap. A robot without\n"
      "deadlines may be too fast to record; 'trifinger run --record' makes it wait.\n"
      "Example:\n"
      "  trifinger record sim -o logs\n"
      "  trifinger record left right -o /data --rotate-time 1h --max-total 200GB");
}

}  // namespace trifinger::apps
