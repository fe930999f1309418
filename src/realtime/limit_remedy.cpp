// SPDX-License-Identifier: BSD-3-Clause
#include "realtime/limit_remedy.hpp"

#include <fstream>
#include <system_error>

namespace trifinger {
namespace {

struct Texts {
  const char* container;
  const char* service;
  const char* machine;
};

constexpr Texts texts_of(RealtimeLimit limit) noexcept {
  if (limit == RealtimeLimit::kPriority) {
    return {.container = "start the container with '--ulimit rtprio=99' or '--cap-add=SYS_NICE'",
            .service = "write 'LimitRTPRIO=99' into the unit of the service",
            .machine =
                "add '@realtime - rtprio 99' to /etc/security/limits.conf, yourself to the "
                "group, and log in again"};
  }
  return {.container = "start the container with '--ulimit memlock=-1' or '--cap-add=IPC_LOCK'",
          .service = "write 'LimitMEMLOCK=infinity' into the unit of the service",
          .machine =
              "add '@realtime - memlock unlimited' to /etc/security/limits.conf, yourself "
              "to the group, and log in again"};
}

// True in a service that systemd itself runs. What a user's own systemd runs has the limits of that
// user.
bool is_service(const std::filesystem::path& root) {
  std::ifstream groups(root / "proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    // For example "0::/system.slice/system-trifinger.slice/trifinger@sim.service".
    if (line.find("::/system.slice/") != std::string::npos && line.ends_with(".service")) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::string remedy_for(RealtimeLimit limit, const std::filesystem::path& root) {
  const Texts texts = texts_of(limit);
  std::error_code ignored;
  if (std::filesystem::exists(root / ".dockerenv", ignored)) return texts.container;
  if (std::filesystem::exists(root / "run/.containerenv", ignored)) {
    return std::string(texts.container) +
           "; podman without root gives no more than its user has on the machine";
  }
  return is_service(root) ? texts.service : texts.machine;
}

}  // namespace trifinger
