// SPDX-License-Identifier: BSD-3-Clause
#include "shared/child_program.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

struct Pipe {
  ipc::FileDescriptor read;
  ipc::FileDescriptor write;

  Pipe() {
    std::array<int, 2> ends{-1, -1};
    read = ipc::FileDescriptor(
        [&ends] { return ::pipe2(ends.data(), O_CLOEXEC) == 0 ? ends[0] : -1; });
    if (!read) throw SystemError("make a pipe to another process", errno);
    write = ipc::FileDescriptor([&ends] { return ends[1]; });
  }
};

pid_t start(std::vector<std::string>& words, int input, int output) {
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
  if (error != 0) throw SystemError("start 'trifinger " + words.at(1) + "'", error);
  return process;
}

}  // namespace

ChildProgram::ChildProgram(std::vector<std::string> words) {
  // Who starts this program may have said that children need not be waited for.
  std::signal(SIGCHLD, SIG_DFL);
  words.insert(words.begin(), "trifinger");
  Pipe input;
  Pipe output;
  pid_ = start(words, input.read.get(), output.write.get());
  ::fcntl(output.read.get(), F_SETFL, O_NONBLOCK);
  input_ = std::move(input.write);
  output_ = std::move(output.read);
}

void ChildProgram::wait(Nanoseconds timeout) const noexcept {
  // poll leaves out what is no file, and would not wait at the end of one.
  constexpr Nanoseconds kShort = std::chrono::milliseconds(20);
  pollfd output{.fd = output_.get(), .events = POLLIN, .revents = 0};
  const Nanoseconds wait = output_ ? timeout : std::min(timeout, kShort);
  const timespec time{.tv_sec = wait / std::chrono::seconds(1),
                      .tv_nsec = (wait % std::chrono::seconds(1)).count()};
  ::ppoll(&output, 1, &time, nullptr);
}

std::vector<std::string> ChildProgram::take_lines() {
  std::array<char, 4096> buffer;
  while (output_) {
    const ssize_t size = ::read(output_.get(), buffer.data(), buffer.size());
    if (size < 0 && errno == EINTR) continue;
    if (size == 0) output_ = {};
    if (size <= 0) break;
    text_.append(buffer.data(), static_cast<std::size_t>(size));
  }
  std::vector<std::string> lines;
  for (std::size_t end = text_.find('\n'); end != std::string::npos; end = text_.find('\n')) {
    lines.push_back(text_.substr(0, end));
    text_.erase(0, end + 1);
  }
  return lines;
}

std::optional<int> ChildProgram::has_ended() const {
  int status = 0;
  const pid_t ended = ::waitpid(pid_, &status, WNOHANG);
  if (ended < 0 && errno == ECHILD) return 0;  // somebody else has waited for it
  return ended == pid_ ? std::optional(status) : std::nullopt;
}

void ChildProgram::signal(int number) const noexcept { ::kill(pid_, number); }

void end_with_parent(pid_t parent) noexcept {
  // Not SIGTERM: a program that hangs does not look whether this signal has come.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::raise(SIGKILL);  // it has ended already
}

std::string ending_text(int status) {
  if (WIFSIGNALED(status)) return fmt::format("was killed by signal {}", WTERMSIG(status));
  return fmt::format("has failed with exit code {}", WEXITSTATUS(status));
}

}  // namespace trifinger::apps
