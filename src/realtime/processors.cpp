// SPDX-License-Identifier: BSD-3-Clause
#include "realtime/processors.hpp"

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>

#include "base/regular_file.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxSize = 64 * 1024;

// The text of a small file of the kernel; nothing if there is none.
std::string text_of(const fs::path& path) {
  try {
    return read_file(path, kMaxSize);
  } catch (const SystemError&) {
    return {};
  }
}

// Microseconds of work allowed in a period, in processors. No number stands for no limit: "max" in
// version 2 of control groups, -1 in version 1.
double share_of(const std::string& quota, const std::string& period) {
  double allowed = 0.0;
  double time = 0.0;
  if (!(std::istringstream(quota) >> allowed) || !(std::istringstream(period) >> time)) return 0.0;
  return allowed > 0.0 && time > 0.0 ? allowed / time : 0.0;
}

double share_in_version_2(const fs::path& folder) {
  std::istringstream text(text_of(folder / "cpu.max"));
  std::string quota;
  std::string period;
  text >> quota >> period;
  return share_of(quota, period);
}

double share_in_version_1(const fs::path& folder) {
  return share_of(text_of(folder / "cpu.cfs_quota_us"), text_of(folder / "cpu.cfs_period_us"));
}

}  // namespace

int num_processors() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  // Fails on a machine with more than 1024 processors, which all are more than enough.
  const bool is_known = ::sched_getaffinity(0, sizeof(allowed), &allowed) == 0;
  const int count = is_known ? CPU_COUNT(&allowed) : CPU_SETSIZE;
  const int quota = detail::processor_quota("/");
  return std::max(1, quota > 0 ? std::min(count, quota) : count);
}

int detail::processor_quota(const fs::path& root) {
  double least = 0.0;
  std::istringstream groups(text_of(root / "proc/self/cgroup"));
  // Lines like "0::/user.slice" and, in version 1, "4:cpu,cpuacct:/docker/1234".
  for (std::string line; std::getline(groups, line);) {
    const std::size_t first = line.find(':');
    const std::size_t second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const bool is_version_2 = controllers.empty();
    if (!is_version_2 && ("," + controllers + ",").find(",cpu,") == std::string::npos) continue;
    const fs::path top = root / "sys/fs/cgroup" / (is_version_2 ? "" : "cpu");
    // Each group is limited by those above it, too. A container may see none but its own, at the
    // top.
    fs::path group = fs::path(line.substr(second + 1)).relative_path();
    while (true) {
      const double share =
          is_version_2 ? share_in_version_2(top / group) : share_in_version_1(top / group);
      if (share > 0.0) least = least > 0.0 ? std::min(least, share) : share;
      if (group.empty()) break;
      group = group.parent_path();
    }
  }
  return static_cast<int>(std::ceil(std::min(least, 1e6)));
}

}  // namespace trifinger
