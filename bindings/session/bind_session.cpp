// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/chrono.h>
#include <nanobind/stl/vector.h>

#include <chrono>

#include "bindings.hpp"
#include "conversion/errors.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "docstrings.hpp"
#include "session_info.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/status.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

nb::object pid_or_none(const ipc::ProcessIdentity& process) {
  return process.pid == 0 ? nb::none() : nb::cast(process.pid);
}

}  // namespace

Shown<"trifinger.session_info.SessionInfo"> to_python(const SessionInfo& info) {
  const double created = std::chrono::duration<double>(info.created.time_since_epoch()).count();
  return nb::module_::import_("trifinger.session_info")
      .attr("SessionInfo")(
          "name"_a = info.name, "type"_a = info.type, "is_companion"_a = info.is_companion,
          "session_id"_a = info.session_id, "is_real_time"_a = info.is_real_time,
          "realtime_warnings"_a = nb::tuple(nb::cast(info.realtime_warnings)),
          "period"_a = to_seconds(info.period), "created"_a = created, "host"_a = info.host,
          "backend_pid"_a = info.backend.pid, "controller_pid"_a = pid_or_none(info.controller),
          "backend_is_alive"_a = info.backend_is_alive,
          "since_heartbeat"_a = to_seconds(info.since_heartbeat),
          "phase"_a = to_str(name_of(info.phase)), "steps"_a = info.steps,
          "waiting_actions"_a = info.waiting_actions,
          "fault"_a = to_python(std::optional(info.fault)), "fault_text"_a = info.fault_text);
}

ShownTexts to_python(const std::vector<Document>& documents) {
  nb::dict texts;
  for (const Document& document : documents) {
    texts[to_text(document.name)] = to_text(document.text);
  }
  return texts;
}

void bind_session(nb::module_& m) {
  nb::enum_<Status::Flag>(m, "Status", nb::is_flag(), nb::is_arithmetic(), docs::Status::Flag::Flag)
      .value("ACTION_REPEATED", Status::kActionRepeated, docs::Status::Flag::kActionRepeated)
      .value("ACAUSAL", Status::kAcausal, docs::Status::Flag::kAcausal)
      .value("ACTION_REJECTED", Status::kActionRejected, docs::Status::Flag::kActionRejected)
      .value("END", Status::kEnd, docs::Status::Flag::kEnd)
      .value("SCHEDULER_LATE", Status::kSchedulerLate, docs::Status::Flag::kSchedulerLate)
      .value("DRIVER_LATE", Status::kDriverLate, docs::Status::Flag::kDriverLate);

  m.def(
      "list_sessions",
      [] {
        nb::typed<nb::list, Shown<"trifinger.session_info.SessionInfo">> sessions;
        for (const SessionInfo& info : list_sessions()) sessions.append(to_python(info));
        return sessions;
      },
      docs::list_sessions);

  m.def("running_robot", &running_robot, "name"_a = "", docs::running_robot);

  m.def(
      "recover",
      [](const std::string& name, const ShownSeconds& timeout) {
        in_slices(to_timeout(timeout), [&](Timeout slice) { recover(name, slice); });
      },
      "name"_a, "timeout"_a.none() = 5.0, docs::recover);
}

}  // namespace trifinger::bindings
