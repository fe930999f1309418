// SPDX-License-Identifier: BSD-3-Clause
#include "robot/run_recorder.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <exception>
#include <future>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>

#include "shared/signals.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/ipc/file_descriptor.hpp"
#include "trifinger/ipc/process.hpp"
#include "trifinger/log/recorder.hpp"

namespace trifinger::apps {
namespace {

using Line = RunRecorder::Line;

// A recorder gives a sign several times a second.
constexpr Nanoseconds kWorryingSilence = std::chrono::seconds(2);
// Silence at the end of the program after which a recorder is killed.
constexpr Nanoseconds kPatience = std::chrono::seconds(10);
// Pause before the next start, if a recorder died without having given a sign.
constexpr Nanoseconds kPause = std::chrono::seconds(1);
// Number of recorders that may try to write the end.
constexpr int kMaxEndings = 2;

[[nodiscard]] Instant now() noexcept { return std::chrono::steady_clock::now(); }

// Watches the signs of a recorder, and reports once when it stops or continues to make progress.
class Vigil {
 public:
  // Call this when a recorder is started or makes progress.
  void begin() noexcept { last_sign_ = now(); }
  void see_sign() {
    begin();
    if (trouble_.empty()) return;
    lines_.push_back(
        {fmt::format("is well again after {}", duration_text(now() - trouble_since_))});
    trouble_.clear();
  }
  // `trouble` is a few words, `text` a sentence. Reported if it differs from the last trouble.
  void see_trouble(const std::string& trouble, const std::string& text) {
    if (trouble_.empty()) trouble_since_ = last_sign_;
    if (trouble_ != trouble) lines_.push_back({text, Style::kBad});
    trouble_ = trouble;
  }
  // Call this after the signs so far were seen.
  void look() {
    if (trouble_.empty() && silence() > kWorryingSilence) {
      see_trouble("stands still",
                  fmt::format("has stood still for {}: it was stopped, or its disk hangs. What it "
                              "misses is not lost as long as the history of the session holds it",
                              duration_text(kWorryingSilence)));
    }
  }
  void say(std::string text, Style style = Style::kPlain) {
    lines_.push_back({std::move(text), style});
  }

  [[nodiscard]] Nanoseconds silence() const noexcept { return now() - last_sign_; }
  [[nodiscard]] const std::string& trouble() const noexcept { return trouble_; }
  [[nodiscard]] std::vector<Line> take_lines() { return std::exchange(lines_, {}); }

 private:
  Instant last_sign_{now()};
  Instant trouble_since_;
  std::string trouble_;  // trouble that was reported
  std::vector<Line> lines_;
};

// `trifinger record` as a child process. It notices by itself when this process has ended. A byte
// on its standard input tells it that the robot has stopped. On its output it gives a sign while it
// makes progress.
class RecorderProcess final : public RunRecorder {
 public:
  RecorderProcess(std::string robot, std::filesystem::path folder)
      : robot_(std::move(robot)), folder_(std::move(folder)) {
    spawn();
  }
  // The child continues until this process has ended.
  ~RecorderProcess() override = default;
  RecorderProcess(const RecorderProcess&) = delete;
  RecorderProcess& operator=(const RecorderProcess&) = delete;

  std::vector<Line> look() override {
    look_after_child();
    return vigil_.take_lines();
  }

  std::string trouble() const override { return vigil_.trouble(); }
  std::string failure() const override { return failure_; }

  bool finish(Nanoseconds timeout) override {
    is_ending_ = true;
    const Deadline deadline(timeout);
    look_after_child();
    while (!is_over_ && !deadline.passed()) {
      tell_child();
      end_silence();
      // The child's output ends when the child ends.
      pollfd output{.fd = output_.get(), .events = POLLIN, .revents = 0};
      const timespec time{.tv_sec = 0, .tv_nsec = deadline.remaining(timeout).count()};
      ::ppoll(&output, child_ == 0 ? 0 : 1, &time, nullptr);
      look_after_child();
    }
    return is_over_;
  }

 private:
  struct Pipe {
    ipc::FileDescriptor read;
    ipc::FileDescriptor write;

    Pipe() {
      std::array<int, 2> ends{-1, -1};
      read = ipc::FileDescriptor(
          [&ends] { return ::pipe2(ends.data(), O_CLOEXEC) == 0 ? ends[0] : -1; });
      if (!read) throw SystemError("make a pipe to the recorder", errno);
      write = ipc::FileDescriptor([&ends] { return ends[1]; });
    }
  };

  void spawn() {
    Pipe input;
    Pipe output;
    const auto self = ipc::ProcessIdentity::of_this_process();
    const std::string process = fmt::format("{}:{}", self.pid, self.start_time);
    const std::string folder = folder_.string();
    std::vector<std::string> words{"trifinger", "record",         robot_, "--to",
                                   folder,      "--with-process", process};
    std::vector<char*> arguments;
    arguments.reserve(words.size() + 1);
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);

    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input.read.get(), STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, output.write.get(), STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, output.write.get(), STDERR_FILENO);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    // The child gets its own process group: Ctrl-C on a terminal must only reach the robot, whose
    // last steps are still to be recorded.
    posix_spawnattr_setpgroup(&attributes, 0);
    sigset_t none;
    sigemptyset(&none);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK);
    pid_t child = 0;
    const int error =
        ::posix_spawn(&child, "/proc/self/exe", &actions, &attributes, arguments.data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw SystemError("start a recorder", error);

    child_ = child;
    has_given_sign_ = is_told_ = was_killed_ = false;
    text_.clear();
    last_words_.clear();
    vigil_.begin();
    input_ = std::move(input.write);
    output_ = std::move(output.read);
    ::fcntl(output_.get(), F_SETFL, O_NONBLOCK);
  }

  void read_output() {
    std::array<char, 4096> buffer;
    while (output_) {
      const ssize_t size = ::read(output_.get(), buffer.data(), buffer.size());
      if (size < 0 && errno == EINTR) continue;
      if (size <= 0) break;
      text_.append(buffer.data(), static_cast<std::size_t>(size));
    }
    // Whole lines only. Lines that this program writes itself are skipped.
    for (std::size_t end = text_.find('\n'); end != std::string::npos; end = text_.find('\n')) {
      const std::string line = text_.substr(0, end);
      text_.erase(0, end + 1);
      if (line == kRecorderSign) {
        has_given_sign_ = true;
        vigil_.see_sign();
      } else if (line.starts_with(kSaid)) {
        vigil_.say(line.substr(kSaid.size()));
      } else if (line.starts_with(kFailed)) {
        last_words_ = line.substr(kFailed.size());
      }
    }
  }

  // Starts a new recorder if the last one has ended; it continues where the file was cut off.
  void look_after_child() {
    if (is_over_) return;
    read_output();
    if (child_ == 0) {
      if (now() >= next_start_) start_again();
      return;
    }
    int status = 0;
    if (::waitpid(child_, &status, WNOHANG) != child_) {
      vigil_.look();
      return;
    }
    read_output();
    child_ = 0;
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
      is_over_ = true;
      return;
    }
    const std::string how =
        was_killed_           ? "stood still at the end and was killed"
        : WIFSIGNALED(status) ? fmt::format("was killed by signal {}", WTERMSIG(status))
        : last_words_.empty() ? fmt::format("has failed with exit code {}", WEXITSTATUS(status))
                              : "has failed: " + last_words_;
    if (is_ending_ && ++endings_ >= kMaxEndings) {
      give_up(how);
      return;
    }
    vigil_.see_trouble("is gone", how + "; another one goes on");
    // If a recorder fails at once, the next one is started only after a pause.
    next_start_ = has_given_sign_ ? Instant{} : now() + kPause;
    if (now() >= next_start_) start_again();
  }

  void start_again() {
    try {
      spawn();
    } catch (const SystemError& error) {
      vigil_.see_trouble("cannot be started", error.what());
      next_start_ = now() + kPause;
      if (is_ending_ && ++endings_ >= kMaxEndings) give_up(error.what());
    }
  }

  // Tells the child that the robot has stopped.
  void tell_child() {
    if (child_ == 0 || is_told_) return;
    // If the child is gone, `look_after_child` will notice.
    static_cast<void>(::write(input_.get(), "", 1));
    is_told_ = true;
  }

  // Ends a silence at the end of the program: a recorder that hangs is killed, and another one
  // takes over. If the system cannot kill it, recording is given up.
  void end_silence() {
    if (child_ == 0 || vigil_.silence() < kPatience) return;
    if (was_killed_) {
      give_up(fmt::format("stands still, and process {} cannot be killed", child_));
      return;
    }
    ::kill(child_, SIGKILL);
    was_killed_ = true;
    vigil_.begin();
  }

  void give_up(const std::string& why) {
    is_over_ = true;
    failure_ = why;
  }

  static constexpr std::string_view kSaid = "recorder: ";
  static constexpr std::string_view kFailed = "trifinger: ";

  std::string robot_;
  std::filesystem::path folder_;
  pid_t child_{0};  // 0: there is none now
  ipc::FileDescriptor input_;
  ipc::FileDescriptor output_;
  std::string text_;  // output that is not a whole line yet
  std::string last_words_;
  bool has_given_sign_{false};
  bool is_told_{false};
  bool was_killed_{false};

  Vigil vigil_;
  Instant next_start_;
  bool is_ending_{false};
  int endings_{0};  // number of endings that have failed
  bool is_over_{false};
  std::string failure_;
};

// A recorder in a thread of this process. The back-end waits for it.
class RecorderInThread final : public RunRecorder {
 public:
  RecorderInThread(const std::string& robot, const std::filesystem::path& folder, Backend& backend)
      : recorder_({robot}, options(folder)) {
    backend.follow(recorder_);
    std::promise<void> returned;
    returned_ = returned.get_future();
    thread_ = std::jthread([this, returned = std::move(returned)]() mutable {
      try {
        recorder_.run();
      } catch (const std::exception& error) {
        failure_ = error.what();
      }
      returned.set_value();
    });
  }
  RecorderInThread(const RecorderInThread&) = delete;
  RecorderInThread& operator=(const RecorderInThread&) = delete;
  ~RecorderInThread() override { recorder_.request_stop(); }

  std::vector<Line> look() override {
    look_at_progress();
    std::vector<Line> lines = vigil_.take_lines();
    const std::lock_guard lock(mutex_);
    for (std::string& line : std::exchange(lines_, {})) lines.push_back({std::move(line)});
    return lines;
  }

  std::string trouble() const override { return vigil_.trouble(); }

  bool finish(Nanoseconds timeout) override {
    recorder_.request_stop();
    if (returned_.wait_for(timeout) == std::future_status::ready) return true;
    look_at_progress();
    is_given_up_ = vigil_.silence() >= kPatience;
    return is_given_up_;
  }

  std::string failure() const override { return is_given_up_ ? "stands still" : failure_; }

 private:
  log::RecorderOptions options(const std::filesystem::path& folder) {
    log::RecorderOptions options;
    options.folder = folder;
    options.is_follower = true;
    options.on_event = [this](const log::Event& event) {
      // The program itself reports what the robot does.
      if (event.source == "recorder") add(event.text);
    };
    return options;
  }

  void look_at_progress() {
    if (const std::uint64_t progress = recorder_.state().progress; progress != progress_) {
      progress_ = progress;
      vigil_.see_sign();
    }
    vigil_.look();
  }

  void add(const std::string& line) {
    {
      const std::lock_guard lock(mutex_);
      lines_.push_back(line);
    }
    Signals::notify();
  }

  std::mutex mutex_;
  std::vector<std::string> lines_;
  log::Recorder recorder_;
  Vigil vigil_;
  std::uint64_t progress_{0};
  bool is_given_up_{false};
  std::string failure_;  // failure of the thread, set when it has returned
  std::future<void> returned_;
  std::jthread thread_;  // last member, because the thread uses the others
};

}  // namespace

std::unique_ptr<RunRecorder> RunRecorder::start(const std::string& robot,
                                                const std::filesystem::path& folder,
                                                const BackendOptions& options, Backend& backend) {
  if (options.mode == BackendOptions::Mode::kNonRealTime) {
    return std::make_unique<RecorderInThread>(robot, folder, backend);
  }
  {
    // Any reason not to record is reported before the robot moves.
    const log::Recorder attempt({robot}, {.folder = folder});
  }
  return std::make_unique<RecorderProcess>(robot, folder);
}

}  // namespace trifinger::apps
