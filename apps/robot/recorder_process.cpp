// SPDX-License-Identifier: BSD-3-Clause
#include "robot/recorder_process.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <utility>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger::apps {
namespace {

// Pause before the next start, if a recorder died without having given a sign.
constexpr Nanoseconds kPause = std::chrono::seconds(1);
// Number of recorders that may try to write the end.
constexpr int kMaxEndings = 2;

// Beginnings of the lines that a recorder prints.
constexpr std::string_view kMessage = "recorder: ";
constexpr std::string_view kFailure = "trifinger: ";

[[nodiscard]] Instant now() noexcept { return std::chrono::steady_clock::now(); }

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

// Starts this program with `words` in a process group of its own, because Ctrl-C on a terminal must
// only reach the robot, whose last steps are still to be recorded. Returns the process.
pid_t start_program(std::vector<std::string> words, int input, int output) {
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setpgroup(&attributes, 0);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK);
  pid_t process = 0;
  const int error =
      ::posix_spawn(&process, "/proc/self/exe", &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw SystemError("start a recorder", error);
  return process;
}

}  // namespace

RecorderProcess::RecorderProcess(std::string robot, std::filesystem::path folder)
    : robot_(std::move(robot)), folder_(std::move(folder)) {
  spawn();
}

bool RecorderProcess::finish(Nanoseconds timeout) {
  is_ending_ = true;
  const Deadline deadline(timeout);
  look_after();
  while (!is_over_ && !deadline.passed()) {
    tell_child();
    end_silence();
    // The child's output ends when the child ends.
    pollfd output{.fd = child_ ? child_->output.get() : -1, .events = POLLIN, .revents = 0};
    const timespec time{.tv_sec = 0, .tv_nsec = deadline.remaining(timeout).count()};
    ::ppoll(&output, 1, &time, nullptr);
    look_after();
  }
  return is_over_;
}

void RecorderProcess::look_after() {
  if (is_over_) return;
  if (!child_) {
    if (now() >= next_start_) start_again();
    return;
  }
  read_output();
  int status = 0;
  if (::waitpid(child_->pid, &status, WNOHANG) != child_->pid) {
    see_silence();
    return;
  }
  read_output();
  replace(status);
}

void RecorderProcess::spawn() {
  Pipe input;
  Pipe output;
  const auto self = ipc::ProcessIdentity::of_this_process();
  const pid_t process =
      start_program({"trifinger", "record", robot_, "--to", folder_.string(), "--with-process",
                     fmt::format("{}:{}", self.pid, self.start_time)},
                    input.read.get(), output.write.get());
  ::fcntl(output.read.get(), F_SETFL, O_NONBLOCK);
  child_ = Child{.pid = process, .input = std::move(input.write), .output = std::move(output.read)};
  begin_watch();
}

void RecorderProcess::start_again() {
  try {
    spawn();
  } catch (const SystemError& error) {
    see_trouble("cannot be started", error.what());
    next_start_ = now() + kPause;
    if (is_ending_ && ++endings_ >= kMaxEndings) give_up(error.what());
  }
}

void RecorderProcess::read_output() {
  std::array<char, 4096> buffer;
  while (true) {
    const ssize_t size = ::read(child_->output.get(), buffer.data(), buffer.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) break;
    child_->text.append(buffer.data(), static_cast<std::size_t>(size));
  }
  // Whole lines only. Lines that this program writes itself are skipped.
  std::string& text = child_->text;
  for (std::size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n')) {
    const std::string line = text.substr(0, end);
    text.erase(0, end + 1);
    if (line == kRecorderSign) {
      child_->has_given_sign = true;
      see_sign();
    } else if (line.starts_with(kMessage)) {
      say(line.substr(kMessage.size()));
    } else if (line.starts_with(kFailure)) {
      child_->last_words = line.substr(kFailure.size());
    }
  }
}

// The new recorder continues where the file was cut off.
void RecorderProcess::replace(int status) {
  const Child child = std::move(*child_);
  child_.reset();
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
    is_over_ = true;
    return;
  }
  const std::string how =
      child.was_killed           ? "stood still at the end and was killed"
      : WIFSIGNALED(status)      ? fmt::format("was killed by signal {}", WTERMSIG(status))
      : child.last_words.empty() ? fmt::format("has failed with exit code {}", WEXITSTATUS(status))
                                 : "has failed: " + child.last_words;
  if (is_ending_ && ++endings_ >= kMaxEndings) {
    give_up(how);
    return;
  }
  see_trouble("is gone", how + "; another one goes on");
  // If a recorder fails at once, the next one is started only after a pause.
  next_start_ = child.has_given_sign ? Instant{} : now() + kPause;
  if (now() >= next_start_) start_again();
}

// Tells the child that the robot has stopped.
void RecorderProcess::tell_child() {
  if (!child_ || child_->is_told) return;
  // If the child is gone, `look_after` will notice.
  static_cast<void>(::write(child_->input.get(), "", 1));
  child_->is_told = true;
}

// Ends a silence at the end of the program: a recorder that hangs is killed, and another one takes
// over. If the system cannot kill it, recording is given up.
void RecorderProcess::end_silence() {
  if (!child_ || silence() < kPatience) return;
  if (child_->was_killed) {
    give_up(fmt::format("stands still, and process {} cannot be killed", child_->pid));
    return;
  }
  ::kill(child_->pid, SIGKILL);
  child_->was_killed = true;
  begin_watch();
}

void RecorderProcess::give_up(const std::string& why) {
  is_over_ = true;
  fail(why);
}

}  // namespace trifinger::apps
