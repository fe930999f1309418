// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>
#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <optional>
#include <string>

#include "commands.hpp"
#include "robot/session_state.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {
namespace {

struct StopOptions {
  std::string name;
  Nanoseconds timeout{std::chrono::seconds(15)};
};

// Returns the process that runs the robot, even if its files were damaged or removed. Returns
// nothing if the process has ended.
std::optional<ipc::ProcessIdentity> backend_of(const std::string& name) {
  const bool is_robot = robot_of(name) == name;
  if (is_robot) {
    if (const auto backend = find_backend(name)) return backend;
  }
  // The process may belong to another user, whose processes cannot be examined.
  const SessionInfo info = robot_info(name);
  if (!info.backend_is_alive) return std::nullopt;
  if (!is_seen(info.backend)) {
    throw Error(
        fmt::format("the back-end of '{}' runs in another container, on {}, as process {} "
                    "there: call 'trifinger stop {}' in that container",
                    name, info.host, info.backend.pid, name));
  }
  return info.backend;
}

int stop(const StopOptions& options) {
  const auto already_gone = [&] {
    print_safely("{}: its back-end is already gone.\n", options.name);
    return kDone;
  };
  const std::optional<ipc::ProcessIdentity> backend = backend_of(options.name);
  if (!backend) return already_gone();

  // The descriptor refers to this one process, even if its number is used again later.
  const auto pid = static_cast<pid_t>(backend->pid);
  const std::string who = ipc::describe(*backend);
  const ipc::FileDescriptor process(
      [pid] { return static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)); });
  if (!process && errno == ESRCH) return already_gone();
  if (!process) throw SystemError("find " + who, errno);
  if (!backend->is_alive()) return already_gone();
  if (::syscall(SYS_pidfd_send_signal, process.get(), SIGTERM, nullptr, 0) != 0) {
    if (errno == ESRCH) return already_gone();
    throw SystemError("stop " + who, errno);
  }

  const Deadline deadline(options.timeout);
  pollfd wanted{.fd = process.get(), .events = POLLIN, .revents = 0};
  while (::poll(&wanted, 1, 100) <= 0) {  // a signal may have interrupted the wait, too
    if (deadline.passed()) {
      throw Error(fmt::format(
          "{} has not ended within {}: it is still bringing the robot to rest, or it hangs; "
          "'kill -KILL {}' ends it at once, without an orderly stop",
          who, duration_text(options.timeout), pid));
    }
  }
  print_safely("{}: stopped {}.\n", options.name, who);
  return kDone;
}

}  // namespace

void add_stop(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "stop", "Bring a robot to rest and end its back-end", stop);
  add_robot(command, options.name);
  add_seconds(command, "--timeout", options.timeout, 3600.0,
              "How long to wait for the end; default: 15");
  command.footer(
      "Example:\n"
      "  trifinger stop sim");
}

}  // namespace trifinger::apps
