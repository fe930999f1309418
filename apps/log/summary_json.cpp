// SPDX-License-Identifier: BSD-3-Clause
#include <string>
#include <vector>

#include "log/summary.hpp"
#include "shared/json.hpp"

namespace trifinger::apps {
namespace {

Json json_of(const std::vector<log::Gap>& gaps) {
  return list_of(gaps, [](const log::Gap& gap) {
    return Json::object({{"first", gap.first}, {"last", gap.last}, {"reason", gap.reason}});
  });
}

// Returns why the session ended; null if it went on.
Json fault_of(const log::LoggedSession& session) {
  const Fault& fault = session.fault();
  if (!fault) return nullptr;
  return Json::object({{"code", name_of(fault.code)},
                       {"detail", fault.detail},
                       {"time_index", fault.time_index},
                       {"needs_recovery", fault.needs_recovery()},
                       {"text", session.fault_text()}});
}

Json json_of(const StreamSummary& companion) {
  return Json::object({{"name", companion.name},
                       {"type", companion.type},
                       {"elements", companion.count},
                       {"rate", companion.rate()},
                       {"gaps", json_of(companion.gaps)}});
}

Json json_of(const ImageSummary& images) {
  return Json::object({{"camera", images.camera},
                       {"images", images.count},
                       {"left_out", images.left_out},
                       {"bytes", images.bytes},
                       {"encoding", images.encoding}});
}

Json json_of(const SessionSummary& summary) {
  const log::LoggedSession& session = summary.session;
  const log::SessionHeader& header = session.header();
  const auto [first, end] = session.range(Series::kAppliedAction);
  return Json::object(
      {{"name", session.name()},
       {"type", session.type()},
       {"session_id", header.session_id},
       {"is_real_time", header.is_real_time},
       {"realtime_lacks", header.realtime_warnings ? Json(*header.realtime_warnings) : Json()},
       {"period", seconds(header.period)},
       {"created", static_cast<double>(header.created) / 1e9},
       {"host", header.host},
       {"steps", summary.steps.count},
       {"first", first},
       {"end", end},
       {"duration", summary.steps.duration()},
       {"rate", summary.steps.rate()},
       {"loop", summary.loop ? json_of(summary.loop->timing, summary.loop->counts) : Json()},
       {"fault", fault_of(session)},
       {"gaps", json_of(summary.steps.gaps)},
       {"companions",
        list_of(summary.companions, [](const StreamSummary& one) { return json_of(one); })},
       {"images", list_of(summary.images, [](const ImageSummary& one) { return json_of(one); })},
       {"documents",
        list_of(header.documents, [](const Document& document) { return document.name; })}});
}

}  // namespace

void print_json(const LogSummary& summary) {
  const log::Log& log = summary.log;
  const auto damage = [](const log::Damage& one) {
    return Json::object({{"file", one.file.string()},
                         {"offset", one.offset},
                         {"size", one.size},
                         {"reason", one.reason}});
  };
  const auto event = [](const log::Event& one) {
    return Json::object({{"time", static_cast<double>(one.time) / 1e9},
                         {"level", static_cast<int>(one.level)},
                         {"source", one.source},
                         {"text", one.text}});
  };
  print_json(
      Json::object({{"files", list_of(log.files(), [](const auto& file) { return file.string(); })},
                    {"size", log.size()},
                    {"is_log", true},
                    {"is_finished", log.is_finished()},
                    {"lost_bytes", log.lost_bytes()},
                    {"damage", list_of(log.damage(), damage)},
                    {"origin", log.origin()},
                    {"sessions", list_of(summary.sessions,
                                         [](const SessionSummary& one) { return json_of(one); })},
                    {"events", list_of(log.events(), event)}}));
}

void print_json(const McapSummary& summary) {
  const auto topic = [](const McapSummary::Topic& one) {
    return Json::object({{"topic", one.name}, {"type", one.type}, {"messages", one.messages}});
  };
  print_json(Json::object({{"files", Json::array({summary.file})},
                           {"size", summary.size},
                           {"is_log", false},
                           {"is_finished", summary.is_finished},
                           {"profile", summary.profile},
                           {"library", summary.library},
                           {"messages", summary.messages},
                           {"duration", summary.duration},
                           {"topics", list_of(summary.topics, topic)}}));
}

}  // namespace trifinger::apps
