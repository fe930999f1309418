// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/job_report.hpp"

#include <fmt/chrono.h>
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <span>
#include <system_error>

#include "base/regular_file.hpp"
#include "log/summary.hpp"
#include "shared/exit_code.hpp"
#include "shared/text.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::apps {
namespace {

using Json = nlohmann::ordered_json;

// A program may fail as often as it likes, and its report stays short.
constexpr std::size_t kMaxFaults = 20;

double seconds(Nanoseconds time) { return static_cast<double>(time.count()) / 1e9; }

std::string utc(std::chrono::system_clock::time_point time) {
  const auto whole = std::chrono::floor<std::chrono::seconds>(time.time_since_epoch());
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(whole.count()));
}

std::string_view name_of(SelfTest kind) noexcept {
  switch (kind) {
    case SelfTest::kOff:
      break;
    case SelfTest::kHold:
      return "hold";
    case SelfTest::kJoints:
      return "joints";
  }
  return "off";
}

Json json_of(const RobotTestReport& test) {
  Json joints = Json::array();
  for (const boards::JointReport& joint : test.joints) {
    joints.push_back(Json::object({{"load", joint.sweep ? Json(joint.sweep->load) : Json()},
                                   {"weight", joint.weight ? Json(*joint.weight) : Json()},
                                   {"friction", joint.sweep ? Json(joint.sweep->friction) : Json()},
                                   {"error", joint.sweep ? Json(joint.sweep->error) : Json()}}));
  }
  return Json::object({{"kind", name_of(test.kind)},
                       {"passes", test.problem.empty()},
                       {"problem", test.problem},
                       {"steps", test.steps},
                       {"joints", joints}});
}

Json json_of(const PreparationReport& preparation) {
  return Json::object({{"is_fit", preparation.is_fit},
                       {"problem", preparation.problem},
                       {"recovered", preparation.recovered},
                       {"self_test", preparation.test ? json_of(*preparation.test) : Json()},
                       {"cube", preparation.cube}});
}

Json json_of(const JobLimits& limits) {
  return Json::object({{"time", seconds(limits.time)},
                       {"grace", seconds(limits.grace)},
                       {"cpu_time", seconds(limits.cpu_time)},
                       {"memory", limits.memory},
                       {"address_space", limits.address_space},
                       {"processes", limits.processes},
                       {"files", limits.files},
                       {"file_count", limits.file_count},
                       {"file_size", limits.file_size},
                       {"output", limits.output},
                       {"log", limits.log}});
}

Json json_of(const JobUsage& most) {
  return Json::object({{"time", seconds(most.time)},
                       {"cpu_time", seconds(most.cpu_time)},
                       {"memory", most.memory},
                       {"processes", most.processes},
                       {"files", most.files},
                       {"file_count", most.file_count}});
}

Json json_of(const JobEnd& end) {
  return Json::object(
      {{"kind", name_of(end.kind)},
       {"exit_code", end.kind == JobEnd::Kind::kExited ? Json(end.exit_code) : Json()},
       {"signal", end.signal != 0 ? Json(end.signal) : Json()},
       {"limit", end.limit == Limit::kNone ? Json() : Json(name_of(end.limit))},
       {"was_killed", end.was_killed},
       {"text", end.text}});
}

Json json_of(const Driving& driving) {
  return Json::object({{"sessions", driving.sessions},
                       {"steps", driving.steps},
                       {"faults", driving.faults},
                       {"repeats", driving.repeats},
                       {"rejected", driving.rejected},
                       {"late_steps", driving.late_steps},
                       {"late_by_user", driving.late_by_user},
                       {"lateness_max", seconds(driving.lateness_max)},
                       {"trouble", driving.error}});
}

std::string preparation_text(const PreparationReport& preparation) {
  std::string text = preparation.is_fit ? "fit" : "NOT FIT: " + preparation.problem;
  if (preparation.test && preparation.test->problem.empty()) text += ", passes its self-test";
  if (!preparation.recovered.empty())
    text += fmt::format(
        ", after {}",
        counted(static_cast<std::int64_t>(preparation.recovered.size()), "recovery from a fault"));
  if (!preparation.cube.empty()) text += "; the cube is " + preparation.cube;
  return text;
}

}  // namespace

std::string_view name_of(JobEnd::Kind kind) noexcept {
  switch (kind) {
    case JobEnd::Kind::kNotStarted:
      break;
    case JobEnd::Kind::kExited:
      return "exited";
    case JobEnd::Kind::kSignal:
      return "signal";
    case JobEnd::Kind::kLimit:
      return "limit";
    case JobEnd::Kind::kCancelled:
      return "interrupted";
  }
  return "not_started";
}

Driving driving_in(const std::filesystem::path& folder) {
  Driving driving;
  try {
    const LogSummary summary = summary_of(log::Log(folder));
    for (const SessionSummary& session : summary.sessions) {
      const TimeIndex steps = session.steps.count;
      if (steps == 0) continue;
      ++driving.sessions;
      driving.steps += steps;
      if (session.session.fault().needs_recovery() && driving.faults.size() < kMaxFaults) {
        driving.faults.push_back(session.session.fault_text());
      }
      if (!session.loop) continue;
      driving.repeats += session.loop->counts.repeats;
      driving.rejected += session.loop->counts.rejected;
      driving.late_steps += session.loop->timing.late_steps();
      driving.late_by_user += session.loop->timing.late_steps(LateCause::kUser);
      driving.lateness_max = std::max(driving.lateness_max, session.loop->timing.lateness().max());
    }
  } catch (const Error& error) {
    driving.error = error.what();
  } catch (const std::filesystem::filesystem_error& error) {
    driving.error = error.what();
  }
  return driving;
}

int exit_code_of(const JobReport& report) noexcept {
  if (!report.before.is_fit && report.end.kind == JobEnd::Kind::kNotStarted) return kNotFit;
  if (report.after && !report.after->is_fit) return kNeedsOperator;
  switch (report.end.kind) {
    case JobEnd::Kind::kNotStarted:
      return kFailed;
    case JobEnd::Kind::kExited:
      return report.end.exit_code == 0 ? kDone : kProgramFailed;
    case JobEnd::Kind::kSignal:
      return kProgramFailed;
    case JobEnd::Kind::kLimit:
      return kLimitReached;
    case JobEnd::Kind::kCancelled:
      return 128 + report.end.signal;
  }
  return kFailed;
}

void write_json(const JobReport& report, const std::filesystem::path& folder) {
  Json confined;
  if (report.confined_by) {
    confined = Json::object({{"own_processes", report.confined_by->own_processes},
                             {"own_users", report.confined_by->own_users},
                             {"read_only", report.confined_by->read_only},
                             {"hides_processes", report.confined_by->hides_processes},
                             {"hides_places", report.confined_by->hides_places},
                             {"filters_calls", report.confined_by->filters_calls},
                             {"counts_memory", report.confined_by->counts_memory}});
  }
  const Json json = Json::object(
      {{"robot", report.robot},
       {"program", report.words},
       {"user", report.user ? Json(*report.user) : Json()},
       {"begin", utc(report.begin)},
       {"end_time", utc(report.end_time)},
       {"exit_code", exit_code_of(report)},
       {"end", json_of(report.end)},
       {"driving", json_of(report.driving)},
       {"before", json_of(report.before)},
       {"after", report.after ? json_of(*report.after) : Json()},
       {"limits", json_of(report.limits)},
       {"most_used", json_of(report.most)},
       {"confined_by", confined},
       {"output", {{"bytes", report.output_bytes}, {"left_out", report.output_left_out}}},
       {"leftovers", report.leftovers},
       {"troubles", report.errors}});
  // Words of the program need not be UTF-8, but JSON must be.
  const std::string text = json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  std::filesystem::create_directories(folder);
  const std::filesystem::path path = folder / "job.json";
  const std::filesystem::path fresh = folder / "job.json.new";
  std::error_code ignored;
  std::filesystem::remove(fresh, ignored);
  write_new_file(fresh, std::as_bytes(std::span(text)));
  std::filesystem::permissions(fresh, std::filesystem::perms(0644), ignored);
  std::filesystem::rename(fresh, path);
}

std::vector<std::string> lines_of(const JobReport& report) {
  std::vector<std::string> lines{"the program " + report.end.text};
  const Driving& driving = report.driving;
  if (report.end.kind != JobEnd::Kind::kNotStarted) {
    lines.push_back(
        fmt::format("it drove {} in {}, {} late ({} by the program), at most {}; {} rejected",
                    counted(driving.steps, "step"), counted(driving.sessions, "session"),
                    driving.late_steps, driving.late_by_user, duration_text(driving.lateness_max),
                    counted(driving.rejected, "action")));
    for (const std::string& fault : driving.faults) lines.push_back("fault: " + fault);
    if (!driving.error.empty()) lines.push_back("its log: " + driving.error);
    lines.push_back(
        fmt::format("it used {} of processors, {} of memory, {}, {} in {}",
                    duration_text(report.most.cpu_time), size_text(report.most.memory),
                    counted(static_cast<std::int64_t>(report.most.processes), "thread"),
                    size_text(report.most.files),
                    counted(static_cast<std::int64_t>(report.most.file_count), "file")));
  }
  if (report.output_left_out > 0) {
    lines.push_back(
        fmt::format("{} of its output are left out", size_text(report.output_left_out)));
  }
  for (const std::string& path : report.leftovers) lines.push_back("removed what it left: " + path);
  for (const std::string& error : report.errors) lines.push_back(error);
  lines.push_back("before: " + preparation_text(report.before));
  if (report.after) lines.push_back("after: " + preparation_text(*report.after));
  return lines;
}

}  // namespace trifinger::apps
