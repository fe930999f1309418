// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "log/text.hpp"
#include "shared/terminal.hpp"
#include "shared/text.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::apps {
namespace {

using Json = nlohmann::ordered_json;

using log::Column;
using log::Damage;
using log::Event;
using log::Gap;
using log::Log;
using log::LoggedSession;

struct LogInfoOptions {
  std::string log;
  bool json{false};
  bool events{false};
};

// Sums of what the statuses of a session say.
struct LoopSummary {
  TimingRecord timing;
  std::int64_t repeats{0};
  std::int64_t skipped{0};
  std::int64_t rejected{0};
  std::int64_t acausal{0};
};

// Summary of a robot's steps or of a companion's elements.
struct StreamSummary {
  std::string name;
  std::string type;
  std::int64_t count{0};
  TimeIndex first{0};
  TimeIndex last{0};
  std::int64_t begin{0};  // times of the first and the last one, since 1970 [ns]
  std::int64_t end{0};
  std::vector<Gap> gaps;

  [[nodiscard]] double duration() const noexcept { return static_cast<double>(end - begin) / 1e9; }
  [[nodiscard]] double rate() const noexcept {
    return end > begin ? static_cast<double>(last - first) / duration() : 0.0;
  }
};

struct SessionSummary {
  LoggedSession session;
  StreamSummary steps;
  std::optional<LoopSummary> loop;  // only if this version knows the statuses
  std::vector<StreamSummary> companions;
};

constexpr std::size_t kBlock = 4096;

// Reads all elements once. `use(indices, pointers, rows)` gets the elements of the columns.
template <class Use>
StreamSummary summary_of(const LoggedSession& session, const std::vector<Column>& columns,
                         const Use& use) {
  StreamSummary summary{.name = session.name(), .type = session.type(), .gaps = session.gaps()};
  log::SeriesReader reader = session.read(columns);
  std::vector<TimeIndex> indices(kBlock);
  std::vector<std::int64_t> times(kBlock);
  std::vector<std::vector<std::byte>> memory;
  std::vector<void*> addresses;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    memory.emplace_back(kBlock * reader.element(i).size());
    addresses.push_back(memory.back().data());
  }
  while (const std::size_t rows = reader.read(kBlock, {indices.data(), times.data(), addresses})) {
    if (summary.count == 0) {
      summary.first = indices.front();
      summary.begin = times.front();
    }
    summary.last = indices[rows - 1];
    summary.end = times[rows - 1];
    summary.count += static_cast<std::int64_t>(rows);
    use(indices, addresses, rows);
  }
  return summary;
}

SessionSummary summary_of(const LoggedSession& session) {
  SessionSummary summary{.session = session, .steps = {}, .loop = {}, .companions = {}};
  std::vector<Column> columns;
  if (session.has_elements() && session.element(Series::kStatus) == describe<Status>()) {
    columns.push_back({Series::kStatus, {}});
    summary.loop.emplace();
  }
  summary.steps = summary_of(
      session, columns, [&](const auto& indices, const auto& addresses, std::size_t rows) {
        for (std::size_t i = 0; summary.loop && i < rows; ++i) {
          Status status;
          std::memcpy(&status, static_cast<const std::byte*>(addresses[0]) + i * sizeof(status),
                      sizeof(status));
          summary.loop->timing.add(indices[i], status, session.header().period);
          summary.loop->repeats += (status.flags & Status::kActionRepeated) != 0 ? 1 : 0;
          summary.loop->rejected += (status.flags & Status::kActionRejected) != 0 ? 1 : 0;
          summary.loop->acausal += (status.flags & Status::kAcausal) != 0 ? 1 : 0;
          summary.loop->skipped += status.skipped_ticks;
        }
      });
  if (const auto end = session.end_status(); end && summary.loop) {
    summary.loop->timing.add(end->first, end->second, session.header().period);
  }
  for (const LoggedSession& companion : session.companions()) {
    summary.companions.push_back(
        summary_of(companion, {}, [](const auto&, const auto&, std::size_t) {}));
  }
  return summary;
}

std::string end_text(const LoggedSession& session) {
  if (!session.fault()) return "went on when the recording ended";
  return fmt::format("{}: {}", name_of(session.fault().code), session.fault_text());
}

std::string origin_of(const Log& log, const std::string& key) {
  const auto entry = log.origin().find(key);
  return entry == log.origin().end() ? std::string() : entry->second;
}

// ---- text output ----

class InfoSheet {
 public:
  void heading(const std::string& name, const std::string& text) const {
    fmt::print("{}  {}\n", terminal_.paint(name, Style::kBold), text);
  }
  void line(const std::string& label, const std::string& text, Style style = Style::kPlain) const {
    constexpr std::size_t kWidth = 14;
    const std::size_t window = terminal_.is_live() ? terminal_.width() : std::string::npos;
    std::string shown = label;
    for (const std::string& part : wrap(text, std::max(window, kWidth + 20) - kWidth)) {
      fmt::print("  {}{}\n", terminal_.paint(pad(shown, kWidth - 2), Style::kDim),
                 terminal_.paint(part, style));
      shown.clear();
    }
  }

 private:
  Terminal terminal_;
};

std::string gap_text(const StreamSummary& stream, const Gap& gap, const std::string& what) {
  const std::string missing = gap.first == gap.last
                                  ? fmt::format("{} {}", what, gap.first)
                                  : fmt::format("{}s {} to {}", what, gap.first, gap.last);
  return fmt::format("{} of '{}': {}", missing, stream.name, gap.reason);
}

void print_loop(const InfoSheet& sheet, const SessionSummary& summary) {
  const LoopSummary& loop = *summary.loop;
  if (summary.session.header().is_real_time) {
    const bool is_late = loop.timing.late_steps() > 0;
    sheet.line("lateness", describe(loop.timing.lateness()));
    sheet.line("late", describe(loop.timing), is_late ? Style::kWarning : Style::kPlain);
    if (is_late) sheet.line("worst", worst_text(loop.timing));
  }
  const auto count = [&sheet](const std::string& label, std::int64_t number) {
    if (number > 0) sheet.line(label, std::to_string(number), Style::kWarning);
  };
  count("repeats", loop.repeats);
  count("skipped", loop.skipped);
  count("rejected", loop.rejected);
  count("acausal", loop.acausal);
}

void print_session(const InfoSheet& sheet, const SessionSummary& summary, std::size_t number) {
  const LoggedSession& session = summary.session;
  const log::SessionHeader& header = session.header();
  fmt::print("\n");
  const std::string mode =
      header.is_real_time
          ? "real-time at " + rate_text(1e9 / static_cast<double>(header.period.count()))
          : "non-real-time, steps of " + duration_text(header.period);
  sheet.heading(session.name(), session.type() + ", " + mode);
  sheet.line("session", fmt::format("{}, id {}", number, header.session_id));
  sheet.line("began", fmt::format("{} on {}", date_text(header.created), header.host));
  const auto [first, end] = session.range(Series::kAppliedAction);
  sheet.line("steps", first < end ? fmt::format("{} ({} to {}), {:.6g} s, {}", summary.steps.count,
                                                first, end - 1, summary.steps.duration(),
                                                rate_text(summary.steps.rate()))
                                  : "none");
  if (header.realtime_lacks) {
    const Style style = header.realtime_lacks->empty() ? Style::kPlain : Style::kWarning;
    std::string label = "realtime";
    for (const std::string& line : realtime_lines(*header.realtime_lacks)) {
      sheet.line(std::exchange(label, {}), line, style);
    }
  }
  if (summary.loop && summary.steps.count > 0) print_loop(sheet, summary);
  for (const StreamSummary& companion : summary.companions) {
    sheet.line(
        companion.name.substr(companion.name.find('.') + 1),
        fmt::format("{}, {}", counted(companion.count, "element"), rate_text(companion.rate())));
  }
  sheet.line("end", end_text(session),
             session.fault().needs_recovery() ? Style::kBad : Style::kPlain);
  for (const Gap& gap : summary.steps.gaps) {
    sheet.line("gap", gap_text(summary.steps, gap, "step"), Style::kWarning);
  }
  for (const StreamSummary& companion : summary.companions) {
    for (const Gap& gap : companion.gaps) {
      sheet.line("gap", gap_text(companion, gap, "element"), Style::kWarning);
    }
  }
  std::vector<std::string> documents;
  documents.reserve(header.documents.size());
  for (const Document& document : header.documents) documents.push_back(document.name);
  if (!documents.empty()) sheet.line("documents", fmt::format("{}", fmt::join(documents, ", ")));
}

void print_for_people(const Log& log, const std::vector<SessionSummary>& sessions, bool events) {
  const InfoSheet sheet;
  std::int64_t steps = 0;
  for (const SessionSummary& session : sessions) steps += session.steps.count;
  sheet.heading(
      log.files().front().filename().string(),
      log.files().size() > 1
          ? "and " + counted(static_cast<std::int64_t>(log.files().size()) - 1, "more part")
          : "");
  sheet.line("size", size_text(log.size()) +
                         (steps > 0 ? fmt::format(", {} bytes per step",
                                                  log.size() / static_cast<std::uint64_t>(steps))
                                    : ""));
  sheet.line("recorded",
             fmt::format("{} on {}, trifinger {}, precision {}", origin_of(log, "created"),
                         origin_of(log, "host"), origin_of(log, "trifinger_version"),
                         origin_of(log, "precision")));
  if (!log.is_finished()) {
    sheet.line("state", "not finished: the recording goes on, or was cut off", Style::kWarning);
  }
  const std::vector<Damage> damage = log.damage();
  if (const std::uint64_t lost = log.lost_bytes(); lost > 0) {
    sheet.line("lost", size_text(lost), Style::kBad);
  }
  for (const Damage& one : damage) sheet.line("damage", text_of(one), Style::kBad);
  for (std::size_t i = 0; i < sessions.size(); ++i) print_session(sheet, sessions[i], i + 1);

  std::vector<Event> shown = log.events();
  const std::size_t all = shown.size();
  if (!events)
    std::erase_if(shown, [](const Event& event) { return event.level < log::Level::kWarning; });
  if (all > 0) fmt::print("\n");
  if (all > 0) {
    sheet.heading("events", shown.size() == all ? std::to_string(all)
                                                : fmt::format("{}; --events shows all", all));
  }
  for (const Event& event : shown) {
    sheet.line(date_text(event.time).substr(11, 8), fmt::format("{}: {}", event.source, event.text),
               event.level >= log::Level::kError     ? Style::kBad
               : event.level >= log::Level::kWarning ? Style::kWarning
                                                     : Style::kPlain);
  }
}

// ---- JSON output ----

Json json_of(const std::vector<Gap>& gaps) {
  Json values = Json::array();
  for (const Gap& gap : gaps) {
    values.push_back(
        Json::object({{"first", gap.first}, {"last", gap.last}, {"reason", gap.reason}}));
  }
  return values;
}

Json json_of(const SessionSummary& summary) {
  const LoggedSession& session = summary.session;
  const log::SessionHeader& header = session.header();
  const auto seconds = [](Nanoseconds time) { return static_cast<double>(time.count()) / 1e9; };
  const auto [first, end] = session.range(Series::kAppliedAction);
  Json companions = Json::array();
  for (const StreamSummary& companion : summary.companions) {
    companions.push_back(Json::object({{"name", companion.name},
                                       {"type", companion.type},
                                       {"elements", companion.count},
                                       {"rate", companion.rate()},
                                       {"gaps", json_of(companion.gaps)}}));
  }
  Json documents = Json::array();
  for (const Document& document : header.documents) documents.emplace_back(document.name);
  const auto loop = [&]() -> Json {
    if (!summary.loop) return nullptr;
    const TimingRecord& timing = summary.loop->timing;
    Json late = Json::object();
    for (const LateCause cause : {LateCause::kUser, LateCause::kScheduler, LateCause::kDriver}) {
      late[std::string(name_of(cause))] = timing.late_steps(cause);
    }
    Json worst = Json::array();
    for (const LateStep& step : timing.worst()) {
      worst.push_back(Json::object({{"time_index", step.time_index},
                                    {"lateness", seconds(step.lateness)},
                                    {"cause", name_of(step.cause)}}));
    }
    return Json::object({{"lateness_p50", seconds(timing.lateness().quantile(0.5))},
                         {"lateness_p99", seconds(timing.lateness().quantile(0.99))},
                         {"lateness_max", seconds(timing.lateness().max())},
                         {"late", late},
                         {"worst", worst},
                         {"repeats", summary.loop->repeats},
                         {"skipped", summary.loop->skipped},
                         {"rejected", summary.loop->rejected},
                         {"acausal", summary.loop->acausal}});
  };
  const auto fault = [&]() -> Json {
    if (!session.fault()) return nullptr;
    return Json::object({{"code", name_of(session.fault().code)},
                         {"detail", session.fault().detail},
                         {"time_index", session.fault().time_index},
                         {"needs_recovery", session.fault().needs_recovery()},
                         {"text", session.fault_text()}});
  };
  const Json lacks = header.realtime_lacks ? Json(*header.realtime_lacks) : Json();
  return Json::object({{"name", session.name()},
                       {"type", session.type()},
                       {"session_id", header.session_id},
                       {"is_real_time", header.is_real_time},
                       {"realtime_lacks", lacks},
                       {"period", seconds(header.period)},
                       {"created", static_cast<double>(header.created) / 1e9},
                       {"host", header.host},
                       {"steps", summary.steps.count},
                       {"first", first},
                       {"end", end},
                       {"duration", summary.steps.duration()},
                       {"rate", summary.steps.rate()},
                       {"loop", loop()},
                       {"fault", fault()},
                       {"gaps", json_of(summary.steps.gaps)},
                       {"companions", companions},
                       {"documents", documents}});
}

Json json_of(const Log& log, const std::vector<SessionSummary>& sessions) {
  Json files = Json::array();
  for (const std::filesystem::path& file : log.files()) files.emplace_back(file.string());
  Json damage = Json::array();
  for (const Damage& one : log.damage()) {
    damage.push_back(Json::object({{"file", one.file.string()},
                                   {"offset", one.offset},
                                   {"size", one.size},
                                   {"reason", one.reason}}));
  }
  Json events = Json::array();
  for (const Event& event : log.events()) {
    events.push_back(Json::object({{"time", static_cast<double>(event.time) / 1e9},
                                   {"level", static_cast<int>(event.level)},
                                   {"source", event.source},
                                   {"text", event.text}}));
  }
  Json all = Json::array();
  for (const SessionSummary& session : sessions) all.push_back(json_of(session));
  return Json::object({{"files", files},
                       {"size", log.size()},
                       {"is_log", true},
                       {"is_finished", log.is_finished()},
                       {"lost_bytes", log.lost_bytes()},
                       {"damage", damage},
                       {"origin", log.origin()},
                       {"sessions", all},
                       {"events", events}});
}

// Paths and texts from others need not be UTF-8, but JSON must be.
constexpr auto kReplace = Json::error_handler_t::replace;

// ---- other MCAP files ----

struct Topic {
  std::string name;
  std::string type;
  std::uint64_t messages{0};
};

int tell_of_another_file(const LogInfoOptions& options, const std::string& reason) {
  const mcap::Reader reader{std::filesystem::path(options.log)};
  const mcap::Contents& contents = reader.contents();
  std::vector<Topic> topics;
  for (const auto& [id, channel] : contents.channels) {
    const auto schema = contents.schemas.find(channel.schema_id);
    const auto count = contents.channel_message_counts.find(id);
    topics.push_back({channel.topic,
                      schema == contents.schemas.end() ? std::string() : schema->second.name,
                      count == contents.channel_message_counts.end() ? 0 : count->second});
  }
  std::ranges::sort(topics, {}, &Topic::name);
  std::uint64_t begin = contents.chunks.empty() ? 0 : contents.chunks.front().first_time;
  std::uint64_t end = begin;
  for (const mcap::ChunkPlace& chunk : contents.chunks) {
    begin = std::min(begin, chunk.first_time);
    end = std::max(end, chunk.last_time);
  }
  const double duration = static_cast<double>(end - begin) / 1e9;
  if (options.json) {
    Json list = Json::array();
    for (const Topic& topic : topics) {
      list.push_back(Json::object(
          {{"topic", topic.name}, {"type", topic.type}, {"messages", topic.messages}}));
    }
    fmt::print("{}\n", Json::object({{"files", Json::array({options.log})},
                                     {"size", std::filesystem::file_size(options.log)},
                                     {"is_log", false},
                                     {"is_finished", contents.is_finished},
                                     {"profile", contents.profile},
                                     {"library", contents.library},
                                     {"messages", contents.message_count},
                                     {"duration", duration},
                                     {"topics", list}})
                           .dump(2, ' ', false, kReplace));
    return kDone;
  }
  const InfoSheet sheet;
  sheet.heading(options.log, "");
  sheet.line("size", size_text(std::filesystem::file_size(options.log)));
  sheet.line("library", contents.library);
  sheet.line("profile", contents.profile);
  sheet.line("messages", fmt::format("{}, {:.6g} s", contents.message_count, duration));
  if (!contents.is_finished) sheet.line("state", "not finished or damaged", Style::kWarning);
  for (const Topic& topic : topics) {
    sheet.line("topic", fmt::format("{}  {}  {}", topic.name, topic.type, topic.messages));
  }
  sheet.line("note", reason);
  return kDone;
}

int info(const LogInfoOptions& options) {
  std::optional<Log> log;
  try {
    log.emplace(std::filesystem::path(options.log));
  } catch (const mcap::FormatError& error) {
    if (std::filesystem::is_directory(options.log)) throw;
    return tell_of_another_file(options, error.what());
  }
  std::vector<SessionSummary> sessions;
  for (const LoggedSession& session : log->sessions()) sessions.push_back(summary_of(session));
  if (options.json) {
    fmt::print("{}\n", json_of(*log, sessions).dump(2, ' ', false, kReplace));
  } else {
    print_for_people(*log, sessions, options.events);
  }
  return kDone;
}

}  // namespace

void add_log_info(CLI::App& log, Action& action) {
  auto options = std::make_shared<LogInfoOptions>();
  CLI::App* const command = log.add_subcommand(
      "info", "Tell what is in a log: sessions, duration, rates, faults, gaps, damage");
  command->add_option("LOG", options->log, "A file, or a folder: the newest recording in it")
      ->required();
  command->add_flag("--json", options->json, "For programs: times in seconds");
  command->add_flag("--events", options->events, "Show all events, not only warnings and errors");
  command->footer(
      "Reads the whole log. Of other MCAP files it tells the topics.\n"
      "Example:\n"
      "  trifinger log info run.mcap");
  command->callback([&action, options] { action = [options] { return info(*options); }; });
}

}  // namespace trifinger::apps
