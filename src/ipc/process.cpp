// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/process.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <string_view>

namespace trifinger::ipc {
namespace {

struct Stat {
  bool is_readable{false};
  char state{'X'};
  std::uint64_t flags{0};
  std::int64_t threads{0};
  std::uint64_t start_time{0};

  [[nodiscard]] bool has_ended() const noexcept {
    // A process whose first thread has returned continues in its other threads.
    return state == 'X' || (state == 'Z' && threads <= 1);
  }
};

// Reads /proc/PID/stat. The second field is the program's name in parentheses and may contain any
// characters, so parsing begins after the last parenthesis. State is field 3, flags 9, threads 20,
// start time 22. qemu makes up a start time for each thread of its own process, if asked for it by
// its usual path; so the path has two slashes.
Stat read_stat(std::int64_t pid) noexcept {
  std::array<char, 32> path{};
  std::snprintf(path.data(), path.size(), "/proc//%lld/stat", static_cast<long long>(pid));
  std::array<char, 1024> buffer{};
  const int file = ::open(path.data(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return {};
  const ssize_t size = ::read(file, buffer.data(), buffer.size());
  ::close(file);
  if (size <= 0) return {};
  std::string_view rest(buffer.data(), static_cast<std::size_t>(size));
  const std::size_t end_of_name = rest.rfind(')');
  if (end_of_name == std::string_view::npos || end_of_name + 2 >= rest.size()) return {};
  rest.remove_prefix(end_of_name + 2);
  Stat stat{.is_readable = true, .state = rest.front()};
  for (int field = 3; field <= 22; ++field) {
    const std::string_view word = rest.substr(0, rest.find(' '));
    if (field == 9) std::from_chars(word.data(), word.data() + word.size(), stat.flags);
    if (field == 20) std::from_chars(word.data(), word.data() + word.size(), stat.threads);
    if (field == 22) std::from_chars(word.data(), word.data() + word.size(), stat.start_time);
    rest.remove_prefix(std::min(rest.size(), word.size() + 1));
  }
  return stat;
}

// True if a kill is pending for the process, which has not yet reacted to it.
bool is_killed(std::int64_t pid) {
  constexpr std::uint64_t kKill = std::uint64_t{1} << static_cast<unsigned>(SIGKILL - 1);
  std::ifstream file("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(file, line);) {
    // For example "SigPnd:\t0000000000000100": signals pending for the first thread (SigPnd) and
    // for the process (ShdPnd).
    if (!line.starts_with("SigPnd:") && !line.starts_with("ShdPnd:")) continue;
    if ((std::strtoull(line.c_str() + 7, nullptr, 16) & kKill) != 0) return true;
  }
  return false;
}

std::uint64_t own_number_space() noexcept {
  struct stat status{};
  return ::stat("/proc/self/ns/pid", &status) == 0 ? status.st_ino : 0;
}

}  // namespace

ProcessIdentity ProcessIdentity::of_this_process() noexcept {
  return of(static_cast<std::int64_t>(::getpid()));
}

ProcessIdentity ProcessIdentity::of(std::int64_t pid) noexcept {
  return {.pid = pid, .start_time = read_stat(pid).start_time, .number_space = own_number_space()};
}

bool ProcessIdentity::is_alive() const noexcept {
  const Stat stat = read_stat(pid);
  return stat.is_readable && stat.start_time == start_time && !stat.has_ended();
}

bool ProcessIdentity::is_known_dead() const noexcept {
  if (pid <= 0 || pid > std::numeric_limits<pid_t>::max()) return false;
  if (number_space == 0 || number_space != own_number_space()) return false;
  // This works even where /proc hides the processes of others.
  if (::kill(static_cast<pid_t>(pid), 0) != 0 && errno == ESRCH) return true;
  const Stat stat = read_stat(pid);
  return stat.is_readable && (stat.start_time != start_time || stat.has_ended());
}

bool ProcessIdentity::is_ending() const noexcept {
  // Nothing is known of a process in another container.
  if (number_space != 0 && number_space != own_number_space()) return false;
  constexpr std::uint64_t kExiting = 4;  // PF_EXITING of the kernel
  const Stat stat = read_stat(pid);
  const bool is_gone = stat.start_time != start_time || stat.state == 'Z' || stat.state == 'X';
  return is_gone || (stat.flags & kExiting) != 0 || is_killed(pid);
}

std::string describe(const ProcessIdentity& process) {
  std::string name;
  if (process.is_alive()) {
    std::ifstream file("/proc/" + std::to_string(process.pid) + "/comm");
    std::getline(file, name);
  }
  const std::string number = "process " + std::to_string(process.pid);
  return name.empty() ? number : name + " (" + number + ")";
}

}  // namespace trifinger::ipc
