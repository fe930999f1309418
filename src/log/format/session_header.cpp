// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/log/session_header.hpp"

#include <chrono>

#include "log/format/text.hpp"

namespace trifinger::log {

using namespace detail;

SessionHeader SessionHeader::of(const Session& robot, const std::vector<Session>& companions) {
  const SessionInfo info = robot.info();
  SessionHeader header;
  header.name = info.name;
  header.session_id = info.session_id;
  header.is_real_time = info.is_real_time;
  if (info.is_real_time) header.realtime_warnings = info.realtime_warnings;
  header.period = info.period;
  header.created = std::chrono::duration_cast<Nanoseconds>(info.created.time_since_epoch()).count();
  header.time_offset = header.created;
  if (info.is_real_time) {
    const auto monotonic = std::chrono::steady_clock::now().time_since_epoch();
    header.time_offset = wall_time() - Nanoseconds(monotonic).count();
  }
  header.host = info.host;
  header.backend_pid = info.backend.pid;
  header.types = robot.description();
  for (const Session& companion : companions) {
    const RobotTypes& types = companion.description();
    header.companions.push_back(
        {.name = companion.info().name, .type = types.type, .element = types.observation});
  }
  header.documents = robot.documents();
  return header;
}

}  // namespace trifinger::log
