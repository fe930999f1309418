// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/process.hpp"

#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string_view>

namespace trifinger::ipc {
namespace {

struct Stat {
  char state{'X'};
  std::uint64_t flags{0};
  std::uint64_t start_time{0};
};

// /proc/PID/stat: the second field is the program's name in parentheses and may hold anything, so
// read on from the last parenthesis. State is field 3, flags field 9, start time field 22.
Stat read_stat(std::int64_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  std::getline(file, text);
  const std::size_t end_of_name = text.rfind(')');
  if (end_of_name == std::string::npos) return {};
  std::istringstream rest(text.substr(end_of_name + 1));
  Stat stat;
  rest >> stat.state;
  std::string skipped;
  for (int field = 4; field < 9; ++field) rest >> skipped;
  rest >> stat.flags;
  for (int field = 10; field < 22; ++field) rest >> skipped;
  rest >> stat.start_time;
  return stat;
}

// A kill has reached the process, which has not yet taken notice.
bool is_killed(std::int64_t pid) {
  constexpr std::uint64_t kKill = std::uint64_t{1} << static_cast<unsigned>(SIGKILL - 1);
  std::ifstream file("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(file, line);) {
    // "SigPnd:\t0000000000000100", of the first thread and of the process.
    if (!line.starts_with("SigPnd:") && !line.starts_with("ShdPnd:")) continue;
    if ((std::strtoull(line.c_str() + 7, nullptr, 16) & kKill) != 0) return true;
  }
  return false;
}

}  // namespace

ProcessIdentity ProcessIdentity::of_this_process() noexcept {
  const auto pid = static_cast<std::int64_t>(::getpid());
  return {.pid = pid, .start_time = read_stat(pid).start_time};
}

bool ProcessIdentity::is_alive() const noexcept {
  const Stat stat = read_stat(pid);
  return stat.start_time == start_time && stat.state != 'Z' && stat.state != 'X';
}

bool ProcessIdentity::is_ending() const noexcept {
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
