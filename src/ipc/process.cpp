// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/process.hpp"

#include <unistd.h>

#include <charconv>
#include <fstream>
#include <sstream>
#include <string_view>

namespace trifinger::ipc {
namespace {

struct Stat {
  char state{'X'};
  std::uint64_t start_time{0};
};

// /proc/PID/stat: the second field is the program's name in parentheses and may hold anything, so
// read on from the last parenthesis. State is field 3, start time field 22.
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
  for (int field = 4; field < 22; ++field) rest >> skipped;
  rest >> stat.start_time;
  return stat;
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
