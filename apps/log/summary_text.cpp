// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/chrono.h>
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <string>
#include <utility>
#include <vector>

#include "log/summary.hpp"
#include "shared/terminal.hpp"
#include "shared/text.hpp"
#include "trifinger/base/text.hpp"

namespace trifinger::apps {
namespace {

using log::Event;
using log::Gap;
using log::Log;
using log::LoggedSession;

// Formats a date: "2026-11-20 09:57:35 UTC"; `time` since 1970 [ns].
std::string date_text(std::int64_t time) {
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC",
                     fmt::gmtime(static_cast<std::time_t>(time / 1'000'000'000)));
}

std::string end_text(const LoggedSession& session) {
  if (!session.fault()) return "went on when the recording ended";
  return fmt::format("{}: {}", name_of(session.fault().code), session.fault_text());
}

std::string origin_of(const Log& log, const std::string& key) {
  const auto entry = log.origin().find(key);
  return entry == log.origin().end() ? std::string() : entry->second;
}

constexpr std::size_t kInfoLabelWidth = 14;

class InfoSheet {
 public:
  void heading(const std::string& name, const std::string& text) const {
    fmt::print("{}  {}\n", terminal_.paint(name, Style::kBold),
               terminal_.paint(text, Style::kPlain));
  }
  void line(const std::string& label, const std::string& text, Style style = Style::kPlain) const {
    const std::string head = terminal_.paint(pad("  " + label, kInfoLabelWidth), Style::kDim);
    const std::size_t room = std::max(terminal_.width(), kInfoLabelWidth + 20) - kInfoLabelWidth;
    for (const std::string& part : hang(head, text, room, terminal_, style)) {
      fmt::print("{}\n", part);
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
  count("repeats", loop.counts.repeats);
  count("skipped", loop.counts.skipped);
  count("rejected", loop.counts.rejected);
  count("acausal", loop.counts.acausal);
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
  if (header.realtime_warnings) {
    const Style style = header.realtime_warnings->empty() ? Style::kPlain : Style::kWarning;
    std::string label = "realtime";
    for (const std::string& line : realtime_lines(*header.realtime_warnings)) {
      sheet.line(std::exchange(label, {}), line, style);
    }
  }
  if (summary.loop && summary.steps.count > 0) print_loop(sheet, summary);
  for (const StreamSummary& companion : summary.companions) {
    sheet.line(
        companion.name.substr(companion.name.find('.') + 1),
        fmt::format("{}, {}", counted(companion.count, "element"), rate_text(companion.rate())));
  }
  for (const ImageSummary& images : summary.images) {
    const double seconds = summary.steps.duration();
    std::string text = fmt::format("{} in {}, {}", counted(images.count, "image"), images.encoding,
                                   size_text(images.bytes));
    if (seconds > 0) {
      text += fmt::format(", {}", rate_text(static_cast<double>(images.count) / seconds));
    }
    if (images.left_out > 0) text += fmt::format("; {} left out", images.left_out);
    sheet.line(images.camera, text, images.left_out > 0 ? Style::kWarning : Style::kPlain);
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

void print_file(const InfoSheet& sheet, const LogSummary& summary) {
  const Log& log = summary.log;
  std::int64_t steps = 0;
  for (const SessionSummary& session : summary.sessions) steps += session.steps.count;
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
  if (const std::uint64_t lost = log.lost_bytes(); lost > 0) {
    sheet.line("lost", size_text(lost), Style::kBad);
  }
  for (const log::Damage& damage : log.damage()) sheet.line("damage", text_of(damage), Style::kBad);
}

void print_events(const InfoSheet& sheet, std::vector<Event> events, bool all_events) {
  if (events.empty()) return;
  const std::size_t all = events.size();
  if (!all_events) {
    std::erase_if(events, [](const Event& event) { return event.level < log::Level::kWarning; });
  }
  fmt::print("\n");
  sheet.heading("events", events.size() == all ? std::to_string(all)
                                               : fmt::format("{}; --events shows all", all));
  for (const Event& event : events) {
    sheet.line(date_text(event.time).substr(11, 8), fmt::format("{}: {}", event.source, event.text),
               event.level >= log::Level::kError     ? Style::kBad
               : event.level >= log::Level::kWarning ? Style::kWarning
                                                     : Style::kPlain);
  }
}

}  // namespace

std::string text_of(const log::Damage& damage) {
  if (damage.size == 0) return damage.reason;
  return fmt::format("bytes {} to {}: {}", damage.offset, damage.offset + damage.size - 1,
                     damage.reason);
}

void print(const LogSummary& summary, bool all_events) {
  const InfoSheet sheet;
  print_file(sheet, summary);
  for (std::size_t i = 0; i < summary.sessions.size(); ++i) {
    print_session(sheet, summary.sessions[i], i + 1);
  }
  print_events(sheet, summary.log.events(), all_events);
}

void print(const McapSummary& summary) {
  const InfoSheet sheet;
  sheet.heading(summary.file, "");
  sheet.line("size", size_text(summary.size));
  sheet.line("library", summary.library);
  sheet.line("profile", summary.profile);
  sheet.line("messages", fmt::format("{}, {:.6g} s", summary.messages, summary.duration));
  if (!summary.is_finished) sheet.line("state", "not finished or damaged", Style::kWarning);
  for (const McapSummary::Topic& topic : summary.topics) {
    sheet.line("topic", fmt::format("{}  {}  {}", topic.name, topic.type, topic.messages));
  }
  sheet.line("note", summary.reason);
}

}  // namespace trifinger::apps
