// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/confined_program.hpp"

#include <fcntl.h>
#include <grp.h>
#include <poll.h>
#include <pwd.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <utility>

#include "shared_robot/guard.hpp"
#include "shared_robot/process_tree.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

void order(int control, Order what) noexcept {
  static_cast<void>(::send(control, &what, sizeof(what), MSG_NOSIGNAL));
}

void close(int& file) noexcept {
  if (file >= 0) ::close(std::exchange(file, -1));
}

}  // namespace

int watch_in_real_time() noexcept {
  constexpr int kHighest = 75;
  rlimit limit{};
  ::getrlimit(RLIMIT_RTPRIO, &limit);
  const int allowed = static_cast<int>(std::min<rlim_t>(limit.rlim_cur, kHighest));
  for (const int priority : {kHighest, allowed}) {
    const sched_param wanted{.sched_priority = priority};
    if (::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &wanted) == 0) return priority;
  }
  return 0;
}

void watch_ordinarily() noexcept {
  const sched_param none{};
  ::sched_setscheduler(0, SCHED_OTHER | SCHED_RESET_ON_FORK, &none);
}

SystemUser SystemUser::find(const std::string& name) {
  errno = 0;
  const passwd* const entry = ::getpwnam(name.c_str());  // This program has no threads yet.
  if (entry == nullptr) throw InvalidArgument("there is no user '" + name + "'");
  SystemUser user{.name = name,
                  .user = entry->pw_uid,
                  .group = entry->pw_gid,
                  .groups = std::vector<gid_t>(64)};
  int count = static_cast<int>(user.groups.size());
  while (::getgrouplist(name.c_str(), user.group, user.groups.data(), &count) < 0) {
    user.groups.resize(static_cast<std::size_t>(count));
  }
  user.groups.resize(static_cast<std::size_t>(count));
  return user;
}

ConfinedProgram::ConfinedProgram(Confinement confinement) {
  // What a killed guard leaves behind comes to us.
  ::prctl(PR_SET_CHILD_SUBREAPER, 1);
  // Who has started us may have said that children need not be waited for.
  std::signal(SIGCHLD, SIG_DFL);
  std::array<int, 2> control{-1, -1};
  std::array<int, 2> output{-1, -1};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, control.data()) != 0 ||
      ::pipe2(output.data(), O_CLOEXEC) != 0) {
    throw SystemError("make a pipe to another process", errno);
  }
  constexpr std::uint64_t kOwnThreads = 16;  // which this program may still start
  const uid_t user = confinement.user ? confinement.user->user : ::geteuid();
  const GuardOptions options{.control = control[1],
                             .output = output[1],
                             .parent = ::getpid(),
                             .other_threads = threads_of(user) + kOwnThreads};
  house_ = ::fork();
  if (house_ < 0) throw SystemError("start a process", errno);
  if (house_ == 0) {
    ::close(control[0]);
    ::close(output[0]);
    keep_house(confinement, options);
  }
  ::close(control[1]);
  ::close(output[1]);
  control_ = control[0];
  output_ = output[0];
  ::fcntl(output_, F_SETFL, O_NONBLOCK);
  // The house tells who the guard is, and the guard how it holds the program. These come in any
  // order, and none if the guard ends. A guard that is not known must not be killed: to the kernel,
  // -1 is all processes of the user.
  for (bool is_confined = false; !is_confined || guard_ <= 0;) {
    GuardMessage message;
    const ssize_t size = ::recv(control_, &message, sizeof(message), 0);
    if (size < 0 && errno == EINTR) continue;
    if (std::cmp_not_equal(size, sizeof(message))) {
      forget_guard();
      throw Error("the process that should guard the program has ended");
    }
    if (message.kind == GuardMessage::Kind::kGuard) guard_ = message.value;
    if (message.kind == GuardMessage::Kind::kConfined) {
      confined_by_ = message.confined_by;
      is_confined = true;
    }
  }
}

ConfinedProgram::~ConfinedProgram() {
  kill();
  close(control_);
  forget_guard();
  close(output_);
}

void ConfinedProgram::start() const { order(control_, Order::kStart); }

std::string ConfinedProgram::take_output(Nanoseconds timeout) {
  std::array<pollfd, 2> wanted{pollfd{.fd = output_, .events = POLLIN, .revents = 0},
                               pollfd{.fd = control_, .events = POLLIN, .revents = 0}};
  const timespec time{.tv_sec = timeout / std::chrono::seconds(1),
                      .tv_nsec = (timeout % std::chrono::seconds(1)).count()};
  ::ppoll(wanted.data(), wanted.size(), &time, nullptr);
  take_messages();
  std::string text;
  if (output_ < 0) return text;
  constexpr std::size_t kMost = 65536;
  text.resize(kMost);
  const ssize_t size = ::read(output_, text.data(), text.size());
  // Nobody can write any more when all processes are gone: what is in the pipe is the rest.
  const bool has_ended = size == 0 || (size < 0 && errno == EAGAIN && is_guard_gone_);
  if (has_ended) close(output_);
  text.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  return text;
}

void ConfinedProgram::ask_to_end() const noexcept { order(control_, Order::kAskToEnd); }

void ConfinedProgram::kill() const noexcept {
  if (is_guard_gone_) return;
  if (confined_by_.own_processes) {
    ::kill(guard_, SIGKILL);  // The kernel ends the namespace with it.
  } else {
    order(control_, Order::kKill);
  }
}

void ConfinedProgram::take_messages() {
  while (!is_guard_gone_) {
    GuardMessage message;
    const ssize_t size = ::recv(control_, &message, sizeof(message), MSG_DONTWAIT);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0 && errno == EAGAIN) return;
    if (std::cmp_equal(size, sizeof(message)) && message.kind == GuardMessage::Kind::kEnded &&
        !end_) {
      end_ = ProgramEnd{.start_error = message.error, .status = message.value};
    }
    const bool is_last = message.kind == GuardMessage::Kind::kAllGone;
    if (size <= 0 || is_last) forget_guard();
  }
}

// Waits for the end of the guard, and ends what it may have left.
void ConfinedProgram::forget_guard() {
  if (is_guard_gone_) return;
  close(control_);  // To the guard this is the order to end.
  while (::waitpid(house_, nullptr, 0) < 0 && errno == EINTR) {
  }
  end_descendants();
  is_guard_gone_ = true;
  if (!end_) end_ = ProgramEnd{.start_error = 0, .status = SIGKILL};
}

}  // namespace trifinger::apps
