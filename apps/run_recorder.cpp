// SPDX-License-Identifier: BSD-3-Clause
#include "run_recorder.hpp"

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
#include <thread>
#include <utility>

#include "signals.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/ipc/file_descriptor.hpp"
#include "trifinger/ipc/process.hpp"
#include "trifinger/log/recorder.hpp"

namespace trifinger::apps {
namespace {

// `trifinger record` as a child. It notices by itself when we are gone; a byte on its standard
// input says that the robot has stopped.
class RecorderProcess final : public RunRecorder {
 public:
  RecorderProcess(std::string robot, std::filesystem::path folder)
      : robot_(std::move(robot)), folder_(std::move(folder)) {
    spawn();
  }
  // The child goes on until we are gone.
  ~RecorderProcess() override = default;
  RecorderProcess(const RecorderProcess&) = delete;
  RecorderProcess& operator=(const RecorderProcess&) = delete;

  std::vector<std::string> take_lines() override {
    read_output();
    look_after_child();
    return std::exchange(lines_, {});
  }

  bool finish(Nanoseconds timeout) override {
    if (child_ == 0) return true;
    if (!is_told_) {
      // A child that is gone is found below.
      static_cast<void>(::write(input_.get(), "", 1));
      is_told_ = true;
    }
    const Deadline deadline(timeout);
    while (child_ != 0 && !deadline.passed()) {
      // Its output ends with it.
      pollfd output{.fd = output_.get(), .events = POLLIN, .revents = 0};
      const timespec time{.tv_sec = 0, .tv_nsec = deadline.remaining(timeout).count()};
      ::ppoll(&output, 1, &time, nullptr);
      read_output();
      look_after_child();
    }
    return child_ == 0;
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
    // A group of its own: a terminal's Ctrl-C is for the robot, whose last steps are to be
    // recorded.
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
    started_ = std::chrono::steady_clock::now();
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
    // Only whole lines, and of them what this program does not tell itself.
    for (std::size_t end = text_.find('\n'); end != std::string::npos; end = text_.find('\n')) {
      const std::string line = text_.substr(0, end);
      text_.erase(0, end + 1);
      for (const std::string_view head : {"recorder: ", "trifinger: "}) {
        if (line.starts_with(head)) lines_.push_back(line.substr(head.size()));
      }
    }
  }

  // Starts another one for one that was killed: it goes on where that was cut off.
  void look_after_child() {
    if (child_ == 0) return;
    int status = 0;
    if (::waitpid(child_, &status, WNOHANG) != child_) return;
    read_output();
    child_ = 0;
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
    constexpr Nanoseconds kShort = std::chrono::seconds(1);
    const bool was_killed = WIFSIGNALED(status);
    const bool has_just_begun = std::chrono::steady_clock::now() - started_ < kShort;
    if (!was_killed || has_just_begun) {
      lines_.emplace_back("has failed: nothing is recorded any more");
      return;
    }
    lines_.push_back(fmt::format("was killed by signal {}; another one goes on", WTERMSIG(status)));
    is_told_ = false;
    spawn();
  }

  std::string robot_;
  std::filesystem::path folder_;
  pid_t child_{0};
  Instant started_;
  ipc::FileDescriptor input_;
  ipc::FileDescriptor output_;
  std::string text_;
  std::vector<std::string> lines_;
  bool is_told_{false};
};

// A recorder in a thread of this process, which the back-end waits for.
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
        add(error.what());
      }
      returned.set_value();
    });
  }
  RecorderInThread(const RecorderInThread&) = delete;
  RecorderInThread& operator=(const RecorderInThread&) = delete;
  ~RecorderInThread() override { recorder_.request_stop(); }

  std::vector<std::string> take_lines() override {
    const std::lock_guard lock(mutex_);
    return std::exchange(lines_, {});
  }

  bool finish(Nanoseconds timeout) override {
    recorder_.request_stop();
    return returned_.wait_for(timeout) == std::future_status::ready;
  }

 private:
  log::RecorderOptions options(const std::filesystem::path& folder) {
    log::RecorderOptions options;
    options.folder = folder;
    options.is_follower = true;
    options.on_event = [this](const log::RecorderOptions::Event& event) {
      // The program tells by itself what the robot does.
      if (event.source == "recorder") add(event.text);
    };
    return options;
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
  std::future<void> returned_;
  std::jthread thread_;  // last: it uses the others
};

}  // namespace

std::unique_ptr<RunRecorder> RunRecorder::start(const std::string& robot,
                                                const std::filesystem::path& folder,
                                                const BackendOptions& options, Backend& backend) {
  if (options.mode == BackendOptions::Mode::kNonRealTime) {
    return std::make_unique<RecorderInThread>(robot, folder, backend);
  }
  {
    // Whatever speaks against recording is to be said before the robot moves.
    const log::Recorder attempt({robot}, {.folder = folder});
  }
  return std::make_unique<RecorderProcess>(robot, folder);
}

}  // namespace trifinger::apps
