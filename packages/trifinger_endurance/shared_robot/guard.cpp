// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/guard.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <grp.h>
#include <linux/close_range.h>
#include <poll.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include "shared/child_program.hpp"
#include "shared_robot/control_group.hpp"
#include "shared_robot/process_tree.hpp"
#include "shared_robot/system_call_filter.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {
namespace {

namespace fs = std::filesystem;

// A step on the way to the program that must succeed; the child then exits, and the guard tells the
// error.
void require(bool is_done, int report) noexcept {
  if (is_done) return;
  const int error = errno;
  static_cast<void>(::write(report, &error, sizeof(error)));
  ::_exit(127);
}

bool write_file(const char* path, std::string_view text) noexcept {
  const int file = ::open(path, O_WRONLY | O_CLOEXEC);
  if (file < 0) return false;
  const bool is_written =
      ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  ::close(file);
  return is_written;
}

// Enters new namespaces, so that children are in them.
bool enter_namespaces(ConfinedBy& by) {
  constexpr int kSpaces = CLONE_NEWPID | CLONE_NEWNS | CLONE_NEWIPC;
  if (::geteuid() == 0) {
    by.own_processes = ::unshare(kSpaces) == 0;
    return by.own_processes;
  }
  // An ordinary user may do this in a namespace of users, in which there is only this user.
  const uid_t user = ::geteuid();
  const gid_t group = ::getegid();
  if (::unshare(CLONE_NEWUSER | kSpaces) != 0) return false;
  by.own_users = true;
  by.own_processes = write_file("/proc/self/setgroups", "deny") &&
                     write_file("/proc/self/uid_map", fmt::format("{0} {0} 1", user)) &&
                     write_file("/proc/self/gid_map", fmt::format("{0} {0} 1", group));
  return by.own_processes;
}

std::vector<fs::path> writable_in(const Confinement& confinement) {
  std::vector<fs::path> writable = confinement.writable;
  writable.push_back(confinement.folder);
  return writable;
}

bool is_inside(const fs::path& path, const fs::path& folder) {
  return std::ranges::mismatch(path, folder).in2 == folder.end();
}

// Puts an empty folder over `place`, in which only those of `kept` are that were there.
bool empty_folder(const fs::path& place, const std::vector<fs::path>& kept) {
  std::vector<std::pair<fs::path, ipc::FileDescriptor>> originals;
  for (const fs::path& path : kept) {
    if (path == place) return false;
    if (!is_inside(path, place)) continue;
    originals.emplace_back(path, ipc::FileDescriptor([&path] {
                             return ::open(path.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
                           }));
  }
  if (::mount("tmpfs", place.c_str(), "tmpfs", MS_NOSUID | MS_NODEV, "mode=755,size=1m") != 0)
    return false;
  for (const auto& [path, original] : originals) {
    std::error_code error;
    fs::create_directories(path, error);
    const std::string source = fmt::format("/proc/self/fd/{}", original.get());
    if (error || ::mount(source.c_str(), path.c_str(), nullptr, MS_BIND | MS_REC, nullptr) != 0)
      return false;
  }
  return true;
}

// Hides what others have where everybody may write, and the sockets of services that would start
// something outside for whoever asks. The folders of the job stay where they are.
bool hide_places(const Confinement& confinement) {
  const std::vector<fs::path> kept = writable_in(confinement);
  bool are_hidden = true;
  for (const char* const place : {"/tmp", "/var/tmp", "/run/user", "/run/dbus", "/run/containerd",
                                  "/run/podman", "/run/libvirt", "/run/lxd"}) {
    std::error_code ignored;
    if (fs::symlink_status(place, ignored).type() != fs::file_type::directory) continue;
    are_hidden = empty_folder(place, kept) && are_hidden;
  }
  for (const char* const socket : {"/run/docker.sock", "/run/snapd.socket"}) {
    std::error_code ignored;
    if (!fs::exists(socket, ignored)) continue;
    are_hidden = ::mount("/dev/null", socket, nullptr, MS_BIND, nullptr) == 0 && are_hidden;
  }
  return are_hidden;
}

// Makes everything read-only but the folders of the job. A kernel before 5.12 cannot.
bool make_read_only(const Confinement& confinement) {
  const std::vector<fs::path> writable = writable_in(confinement);
  for (const fs::path& path : writable) {
    if (::mount(path.c_str(), path.c_str(), nullptr, MS_BIND | MS_REC, nullptr) != 0) return false;
  }
  mount_attr read_only{};
  read_only.attr_set = MOUNT_ATTR_RDONLY;
  if (::mount_setattr(AT_FDCWD, "/", AT_RECURSIVE, &read_only, sizeof(read_only)) != 0)
    return false;
  mount_attr as_before{};
  as_before.attr_clr = MOUNT_ATTR_RDONLY;
  for (const fs::path& path : writable) {
    if (::mount_setattr(AT_FDCWD, path.c_str(), AT_RECURSIVE, &as_before, sizeof(as_before)) != 0) {
      return false;
    }
  }
  return true;
}

// Lowers a limit of this process; never raises it.
bool lower(int resource, std::uint64_t soft, std::uint64_t hard) noexcept {
  rlimit limit{};
  // The type of the resource is an enumeration in C++.
  const auto which = static_cast<__rlimit_resource>(resource);
  if (::getrlimit(which, &limit) != 0) return false;
  limit.rlim_max = std::min<rlim_t>(limit.rlim_max, hard);
  limit.rlim_cur = std::min<rlim_t>({limit.rlim_cur, soft, limit.rlim_max});
  return ::setrlimit(which, &limit) == 0;
}

bool lower(int resource, std::uint64_t limit) noexcept { return lower(resource, limit, limit); }

// Gives a child of root what a machine for robots gives to its users. Nobody else can raise limits,
// and some containers do not let root.
bool allow(int resource, std::uint64_t limit) noexcept {
  const rlimit both{.rlim_cur = limit, .rlim_max = limit};
  return ::setrlimit(static_cast<__rlimit_resource>(resource), &both) == 0 ||
         lower(resource, limit);
}

// `priority`: the most that a thread may have.
bool set_limits(const JobLimits& limits, std::uint64_t other_threads, int priority) noexcept {
  const auto cpu = static_cast<std::uint64_t>(
      std::max<std::int64_t>(limits.cpu_time / std::chrono::seconds(1), 1));
  constexpr std::uint64_t kMaxOpen = 1024;
  // So long a thread with real-time priority may go on without waiting [us]. Then it gets a signal
  // that it may catch, and is killed at the second limit.
  constexpr std::uint64_t kMaxRealtimeRun = 200'000;
  // At the soft limit of its time a process gets a signal that it may catch.
  return lower(RLIMIT_CPU, cpu, cpu + 1) && lower(RLIMIT_AS, limits.address_space) &&
         lower(RLIMIT_FSIZE, limits.file_size) && lower(RLIMIT_CORE, 0) &&
         lower(RLIMIT_NOFILE, kMaxOpen) &&
         allow(RLIMIT_RTPRIO, static_cast<std::uint64_t>(priority)) &&
         lower(RLIMIT_RTTIME, kMaxRealtimeRun, 2 * kMaxRealtimeRun) &&
         allow(RLIMIT_MEMLOCK, limits.memory) &&
         lower(RLIMIT_NPROC, other_threads + limits.processes);
}

// Gives up what the program must not have. What root could do besides is lost for good.
bool give_up_rights(const std::optional<SystemUser>& user) noexcept {
  if (::geteuid() == 0) {
    for (unsigned long right = 0; ::prctl(PR_CAPBSET_READ, right) >= 0; ++right) {
      if (::prctl(PR_CAPBSET_DROP, right) != 0) return false;
    }
  }
  if (user && ::geteuid() == 0 &&
      (::setgroups(user->groups.size(), user->groups.data()) != 0 ||
       ::setresgid(user->group, user->group, user->group) != 0 ||
       ::setresuid(user->user, user->user, user->user) != 0)) {
    return false;
  }
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0;
}

// Becomes the program.
[[noreturn]] void become(const Confinement& confinement, int output, int report,
                         std::uint64_t other_threads, int priority) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::setsid();
  for (int signal = 1; signal < NSIG; ++signal) std::signal(signal, SIG_DFL);
  // All memory is taken here, since the limits below may leave none to this process.
  std::vector<char*> words;
  words.reserve(confinement.words.size() + 1);
  for (const std::string& word : confinement.words)
    words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  std::vector<char*> environment;
  environment.reserve(confinement.environment.size() + 1);
  for (const std::string& entry : confinement.environment) {
    environment.push_back(const_cast<char*>(entry.c_str()));
    if (entry.starts_with("PATH=")) ::setenv("PATH", entry.c_str() + 5, 1);  // execvpe searches it
  }
  environment.push_back(nullptr);

  const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  require(::dup2(nothing, STDIN_FILENO) >= 0 && ::dup2(output, STDOUT_FILENO) >= 0 &&
              ::dup2(output, STDERR_FILENO) >= 0 &&
              ::close_range(STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC) == 0,
          report);
  // When memory is scarce the kernel takes a process of the job, not one of the robot. Only what
  // root writes cannot be taken back.
  write_file("/proc/self/oom_score_adj", "1000");
  ::umask(022);
  require(confinement.group == nullptr || confinement.group->enter(), report);
  require(set_limits(confinement.limits, other_threads, priority), report);
  require(give_up_rights(confinement.user), report);
  require(!can_forbid_hidden_memory() || forbid_hidden_memory(), report);
  require(::chdir(confinement.folder.c_str()) == 0, report);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::execvpe(words.front(), words.data(), environment.data());
  require(false, report);
  ::_exit(127);  // never reached
}

// The guard of one program.
class Guard {
 public:
  Guard(const Confinement& confinement, const GuardOptions& options, ConfinedBy by)
      : confinement_(confinement), options_(options), by_(by) {}

  [[noreturn]] void work() {
    // The program of a user has 70 as usual, and never as much as this process.
    constexpr int kUsual = 70;
    priority_ = std::clamp(watch_in_real_time() - 1, 0, kUsual);
    if (by_.own_processes) {
      ::umask(022);  // The program needs to pass through folders that are made here.
      const bool is_private = ::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0;
      by_.hides_places = is_private && hide_places(confinement_);
      by_.read_only = is_private && make_read_only(confinement_);
      // Afterwards, because a process may write about itself there. Without it the program sees the
      // processes outside, but cannot reach them.
      by_.hides_processes =
          ::mount("proc", "/proc", "proc", MS_NOSUID | MS_NODEV | MS_NOEXEC, nullptr) == 0;
    } else {
      ::prctl(PR_SET_CHILD_SUBREAPER, 1);
    }
    by_.filters_calls = can_forbid_hidden_memory();
    by_.counts_memory = confinement_.group != nullptr;
    notify({.kind = GuardMessage::Kind::kConfined, .confined_by = by_});
    for (;;) {
      obey();
      look_at_children();
    }
  }

 private:
  void notify(const GuardMessage& message) const noexcept {
    // Nobody to tell: the next order is the end of the socket.
    static_cast<void>(::send(options_.control, &message, sizeof(message), MSG_NOSIGNAL));
  }

  // Waits a moment for an order.
  void obey() {
    constexpr int kMoment = 10;  // [ms]
    pollfd orders{.fd = options_.control, .events = POLLIN, .revents = 0};
    if (::poll(&orders, 1, kMoment) <= 0) return;
    Order order{};
    const ssize_t size = ::recv(options_.control, &order, sizeof(order), MSG_DONTWAIT);
    if (size < 0) return;
    if (size == 0) {  // the process that has made us is gone
      end_all();
      ::_exit(0);
    }
    if (order == Order::kStart && program_ < 0) start();
    if (order == Order::kAskToEnd) signal_all(SIGTERM);
    if (order == Order::kKill) end_all();
  }

  void start() {
    // In a namespace of users only those count that are in it.
    const std::uint64_t others = by_.own_users ? 0 : options_.other_threads;
    std::array<int, 2> report{-1, -1};
    if (::pipe2(report.data(), O_CLOEXEC) != 0) {
      notify({.kind = GuardMessage::Kind::kEnded, .error = errno});
      return;
    }
    program_ = ::fork();
    if (program_ == 0) become(confinement_, options_.output, report[1], others, priority_);
    const int fork_error = program_ < 0 ? errno : 0;
    ::close(report[1]);
    // The other end closes when the program begins.
    if (::read(report[0], &start_error_, sizeof(start_error_)) < 0) start_error_ = errno;
    ::close(report[0]);
    // From now on only the job has it, so that its end can be seen.
    ::close(options_.output);
    if (program_ < 0) {
      notify({.kind = GuardMessage::Kind::kEnded, .error = fork_error});
      say_gone();
    }
  }

  void look_at_children() {
    for (;;) {
      int status = 0;
      const pid_t ended = ::waitpid(-1, &status, WNOHANG);
      if (ended < 0 && errno == ECHILD && has_ended_) say_gone();
      if (ended <= 0) return;
      if (ended != program_) continue;
      notify({.kind = GuardMessage::Kind::kEnded, .value = status, .error = start_error_});
      has_ended_ = true;
      end_all();
    }
  }

  void signal_all(int signal) const {
    if (by_.own_processes) {
      ::kill(-1, signal);  // all in the namespace but this one
      return;
    }
    for (const ProcessEntry& process : descendants_of(::getpid(), all_processes())) {
      ::kill(process.pid, signal);
    }
  }

  void end_all() {
    // In the namespace the kernel kills all of them in one step, in which none can start another.
    if (by_.own_processes) {
      ::kill(-1, SIGKILL);
    } else {
      int status = 0;
      // end_descendants takes the ends of children; that of the program is to be reported.
      if (!has_ended_ && program_ > 0) {
        ::kill(program_, SIGKILL);
        if (::waitpid(program_, &status, 0) == program_) {
          notify({.kind = GuardMessage::Kind::kEnded, .value = status, .error = start_error_});
          has_ended_ = true;
        }
      }
      end_descendants();
    }
  }

  [[noreturn]] void say_gone() const {
    notify({.kind = GuardMessage::Kind::kAllGone});
    ::_exit(0);
  }

  const Confinement& confinement_;
  GuardOptions options_;
  ConfinedBy by_;
  int priority_{0};  // the most that the program may have
  pid_t program_{-1};
  int start_error_{0};
  bool has_ended_{false};
};

}  // namespace

void keep_house(const Confinement& confinement, const GuardOptions& options) {
  ::setsid();  // Ctrl-C on a terminal is not for us
  end_with_parent(options.parent);
  ConfinedBy by;
  if (confinement.with_namespaces && enter_namespaces(by)) {
    // The kernel forgets this when the user namespace changes.
    end_with_parent(options.parent);
    const pid_t guard = ::fork();
    if (guard == 0) {
      // If the parent has ended already, the socket has ended, too.
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      Guard(confinement, options, by).work();
    }
    ::close(options.output);
    const GuardMessage message{.kind = GuardMessage::Kind::kGuard, .value = guard};
    static_cast<void>(::send(options.control, &message, sizeof(message), MSG_NOSIGNAL));
    ::close(options.control);
    int status = 0;
    while (::waitpid(guard, &status, 0) < 0 && errno == EINTR) {
    }
    ::_exit(0);
  }
  // This guard must live to end the others: the end of the socket tells it that its parent is gone.
  ::prctl(PR_SET_PDEATHSIG, 0);
  by.own_processes = false;
  const GuardMessage message{.kind = GuardMessage::Kind::kGuard, .value = ::getpid()};
  static_cast<void>(::send(options.control, &message, sizeof(message), MSG_NOSIGNAL));
  Guard(confinement, options, by).work();
}

}  // namespace trifinger::apps
