// SPDX-License-Identifier: BSD-3-Clause
#include "shared/json.hpp"

#include <fmt/core.h>

#include <string>

#include "robot/session_state.hpp"

namespace trifinger::apps {
namespace {

Json json_of(const ipc::ProcessIdentity& process) {
  if (process.pid == 0) return nullptr;
  return Json::object({{"process", process.pid}, {"text", ipc::describe(process)}});
}

}  // namespace

Json json_of(const TimingRecord& timing, const StepCounts& counts) {
  Json late = Json::object();
  for (const LateCause cause : {LateCause::kUser, LateCause::kScheduler, LateCause::kDriver}) {
    late[std::string(name_of(cause))] = timing.late_steps(cause);
  }
  const Json worst = list_of(timing.worst(), [](const LateStep& step) {
    return Json::object({{"time_index", step.time_index},
                         {"lateness", seconds(step.lateness)},
                         {"cause", name_of(step.cause)}});
  });
  return Json::object({{"lateness_p50", seconds(timing.lateness().quantile(0.5))},
                       {"lateness_p99", seconds(timing.lateness().quantile(0.99))},
                       {"lateness_max", seconds(timing.lateness().max())},
                       {"late", late},
                       {"worst", worst},
                       {"repeats", counts.repeats},
                       {"skipped", counts.skipped},
                       {"rejected", counts.rejected},
                       {"acausal", counts.acausal}});
}

Json json_of(const SessionInfo& info) {
  const Json fault = Json::object({{"code", name_of(info.fault.code)},
                                   {"needs_recovery", info.fault.needs_recovery()},
                                   {"text", info.fault_text}});
  return Json::object({{"name", info.name},
                       {"state", state_text(info)},
                       {"is_alive", info.backend_is_alive},
                       {"type", info.type},
                       {"is_companion", info.is_companion},
                       {"session_id", info.session_id},
                       {"is_real_time", info.is_real_time},
                       {"realtime_lacks", info.realtime_warnings},
                       {"period", seconds(info.period)},
                       {"steps", info.steps},
                       {"waiting_actions", info.waiting_actions},
                       {"host", info.host},
                       {"backend", json_of(info.backend)},
                       {"controller", json_of(info.controller)},
                       {"fault", info.fault ? fault : Json()}});
}

void print_json(const Json& json) {
  // Paths and texts from others need not be UTF-8, but JSON must be.
  fmt::print("{}\n", json.dump(2, ' ', false, Json::error_handler_t::replace));
}

}  // namespace trifinger::apps
