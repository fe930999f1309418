// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/prctl.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <exception>
#include <stdexcept>

#include "trifinger/base/error.hpp"

namespace trifinger::test {

/// A forked child that runs a function. Make it before the test starts threads, because a sanitizer
/// needs that.
class ChildProcess {
 public:
  /// `function` returns the exit code. An exception is printed and makes the code 1.
  template <class Function>
  explicit ChildProcess(const Function& function) : pid_(::fork()) {
    if (pid_ < 0) throw SystemError("fork", errno);
    if (pid_ > 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    int code = 1;
    try {
      code = function();
    } catch (const std::exception& error) {
      std::fprintf(stderr, "child process: %s\n", error.what());
    }
    // The child must not clean up anything that belongs to the parent.
    ::_exit(code);
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;
  ~ChildProcess() { kill(); }

  [[nodiscard]] pid_t pid() const noexcept { return pid_; }

  void send(int signal) const noexcept {
    if (is_running_) ::kill(pid_, signal);
  }
  /// Stops the process like Ctrl-Z does. Returns when it has stopped.
  void stop() {
    send(SIGSTOP);
    wait_until_stopped();
  }
  /// Returns when a signal has stopped the process.
  void wait_until_stopped() {
    look(WUNTRACED);
    if (!is_running_) throw std::logic_error("a process that should stop has ended");
  }
  /// Sends SIGKILL. Returns when the process has ended.
  void kill() noexcept {
    send(SIGKILL);
    static_cast<void>(wait());
  }
  /// Returns the exit code, or minus the number of the signal that ended the process.
  int wait() noexcept {
    if (is_running_) look(0);
    return result_;
  }
  [[nodiscard]] bool is_running() noexcept {
    if (is_running_) look(WNOHANG);
    return is_running_;
  }

 private:
  void look(int options) noexcept {
    int status = 0;
    pid_t ended = 0;
    do {
      ended = ::waitpid(pid_, &status, options);
    } while (ended < 0 && errno == EINTR);
    if (ended == 0 || WIFSTOPPED(status)) return;
    is_running_ = false;
    result_ = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  pid_t pid_;
  bool is_running_{true};
  int result_{0};
};

}  // namespace trifinger::test
