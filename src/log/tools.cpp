// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/log/tools.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <system_error>
#include <utility>

#include "log_data.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/mcap/sink.hpp"
#include "trifinger/mcap/writer.hpp"

namespace trifinger::log {
namespace {

// A new file. The destructor removes it unless `finish` was called.
class NewFile {
 public:
  explicit NewFile(std::filesystem::path path)
      : path_(std::move(path)), sink_(mcap::FileSink::create(path_)) {}
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;
  ~NewFile() {
    std::error_code ignored;
    if (!is_finished_) std::filesystem::remove(path_, ignored);
  }

  [[nodiscard]] mcap::Sink& sink() noexcept { return sink_; }
  void finish() {
    sink_.sync();
    is_finished_ = true;
  }

 private:
  std::filesystem::path path_;
  mcap::FileSink sink_;
  bool is_finished_{false};
};

// ---- check and recover ----

// Reports on a file. Call this when all chunks have been read.
FileReport report_of(const std::filesystem::path& file, const mcap::Contents& contents,
                     std::uint64_t messages) {
  FileReport report{.size = std::filesystem::file_size(file),
                    .messages = messages,
                    .is_finished = contents.is_finished};
  report.damage = detail::damage_of(file, report.size, contents);
  report.lost_bytes = detail::lost_bytes_of(report.damage, report.size);
  return report;
}

// Writes everything that a reader has found, in the order of the file.
class Rescue {
 public:
  Rescue(mcap::Reader& reader, mcap::Sink& sink)
      : reader_(reader),
        writer_(sink, {.profile = reader.contents().profile,
                       .library = reader.contents().library,
                       .max_chunk_size = std::size_t{64} << 20U}) {}

  // Returns the number of messages written.
  std::uint64_t write_all() {
    const mcap::Contents& contents = reader_.contents();
    std::size_t metadata = 0;
    std::size_t attachment = 0;
    const auto write_records_before = [&](std::uint64_t offset) {
      while (metadata < contents.metadata.size() || attachment < contents.attachments.size()) {
        const auto place_of = [](const auto& places, std::size_t i) {
          return i < places.size() ? places[i].offset : std::numeric_limits<std::uint64_t>::max();
        };
        const std::uint64_t next_metadata = place_of(contents.metadata_places, metadata);
        const std::uint64_t next_attachment = place_of(contents.attachment_places, attachment);
        if (std::min(next_metadata, next_attachment) >= offset) return;
        if (next_metadata < next_attachment) {
          writer_.write(contents.metadata[metadata++]);
        } else {
          writer_.write(contents.attachments[attachment++]);
        }
      }
    };
    std::uint64_t messages = 0;
    for (std::size_t i = 0; i < contents.chunks.size(); ++i) {
      write_records_before(contents.chunks[i].offset);
      const auto found = reader_.read_chunk(i);
      if (!found) continue;
      for (const mcap::Message& message : *found) {
        const std::optional<std::uint16_t> channel = channel_of(message.channel_id);
        if (!channel) continue;
        mcap::Message copy = message;
        copy.channel_id = *channel;
        writer_.write(copy);
        ++messages;
      }
      writer_.flush();
    }
    write_records_before(std::numeric_limits<std::uint64_t>::max());
    return messages;
  }

  [[nodiscard]] mcap::Writer& writer() noexcept { return writer_; }

 private:
  // Returns the channel of the new file for a channel of the old one; nothing if that is unknown.
  [[nodiscard]] std::optional<std::uint16_t> channel_of(std::uint16_t id) {
    if (const auto known = channels_.find(id); known != channels_.end()) return known->second;
    const mcap::Contents& contents = reader_.contents();
    const auto found = contents.channels.find(id);
    if (found == contents.channels.end()) return std::nullopt;
    mcap::Channel channel = found->second;
    const auto schema = contents.schemas.find(channel.schema_id);
    channel.schema_id =
        schema == contents.schemas.end()
            ? std::uint16_t{0}
            : writer_.add_schema(schema->second.name, schema->second.encoding, schema->second.data);
    return channels_[id] = writer_.add_channel(channel);
  }

  mcap::Reader& reader_;
  mcap::Writer writer_;
  std::map<std::uint16_t, std::uint16_t> channels_;
};

// Writes gaps for everything that is missing in the log `file` and has no gap there yet.
void write_gaps(const std::filesystem::path& file, mcap::Writer& writer) {
  std::unique_ptr<detail::LogData> data;
  try {
    data = std::make_unique<detail::LogData>(std::vector{file}, detail::LogData::Several::kRefuse);
  } catch (const mcap::FormatError&) {
    return;  // another MCAP file, or a log so damaged that it has no sessions
  }
  const std::scoped_lock lock(data->mutex);
  const auto write = [&](const detail::Stream& stream) {
    for (const Gap& gap : data->gaps(stream)) {
      const auto covers = [&gap](const Gap& written) {
        return written.first <= gap.first && gap.last <= written.last;
      };
      if (std::ranges::any_of(stream.gaps, covers)) continue;
      const std::uint64_t session_id = stream.session->header.session_id;
      writer.write(mcap::Metadata{"trifinger.gap",
                                  {{"name", stream.name},
                                   {"session_id", std::to_string(session_id)},
                                   {"first", std::to_string(gap.first)},
                                   {"last", std::to_string(gap.last)},
                                   {"reason", gap.reason}}});
    }
  };
  for (const detail::SessionRecord& session : data->sessions()) {
    write(session.robot);
    for (const detail::Stream& companion : session.companions) write(companion);
  }
}

// ---- copy ----

using Bytes = std::vector<std::byte>;

// Copies elements of a companion, one after the other.
class CompanionCopy {
 public:
  CompanionCopy(const LoggedSession& companion, TimeIndex first, TimeIndex last)
      : reader_(companion.read({Column{}}, first, last)),
        element_(companion.element(Series::kObservation).size()) {
    advance();
  }

  // Writes the elements up to `time`.
  void write(LogWriter& writer, std::size_t session, std::size_t companion, std::int64_t time) {
    for (; has_element_ && time_ <= time; advance()) {
      writer.write_companion(session, companion, index_, 1, element_.data());
    }
  }

 private:
  void advance() {
    void* const element = element_.data();
    has_element_ =
        reader_.read(1, {.indices = &index_, .times = &time_, .columns = {&element, 1}}) == 1;
  }

  SeriesReader reader_;
  Bytes element_;
  TimeIndex index_{0};
  std::int64_t time_{0};
  bool has_element_{false};
};

// Copies the steps [first, last) of a session and everything that belongs to them.
class SessionCopy {
 public:
  SessionCopy(const LoggedSession& session, TimeIndex first, TimeIndex last)
      : session_(session), first_(first), last_(last) {
    if (!session.has_elements()) return;
    if (session.element(Series::kStatus) != describe<Status>()) {
      throw IncompatibleSession("'" + session.name() +
                                "' was logged with another status than this version has");
    }
  }

  void write(LogWriter& writer) {
    SessionHeader header = session_.header();
    header.first_index = std::max(header.first_index, first_);
    const std::size_t number = writer.begin_session(header);
    write_elements(writer, number);
    for (const Gap& gap : session_.gaps()) {
      const TimeIndex begin = std::max(gap.first, first_);
      const TimeIndex end = std::min(gap.last, last_ - 1);
      if (begin <= end) writer.write_gap(number, begin, end, gap.reason);
    }
    const std::vector<LoggedSession> companions = session_.companions();
    for (std::size_t i = 0; i < companions.size(); ++i) {
      for (const Gap& gap : companions[i].gaps()) {
        writer.write_companion_gap(number, i, gap.first, gap.last, gap.reason);
      }
    }
    if (session_.steps() && last_ >= *session_.steps()) write_end(writer, number);
  }

 private:
  static constexpr std::size_t kBlock = 50;  // steps in a chunk, as recorders write them

  void write_elements(LogWriter& writer, std::size_t number) {
    static constexpr std::array kSeries{Series::kDesiredAction, Series::kAppliedAction,
                                        Series::kObservation, Series::kStatus};
    std::vector<Column> columns;
    std::vector<Bytes> blocks;
    std::vector<void*> addresses;
    for (const Series series : kSeries) {
      columns.push_back({.series = series, .fields = {}});
      blocks.emplace_back(kBlock * session_.element(series).size());
      addresses.push_back(blocks.back().data());
    }
    std::array<TimeIndex, kBlock> indices{};
    std::array<std::int64_t, kBlock> times{};
    SeriesReader reader = session_.read(columns, first_, last_);
    const SeriesReader::Rows rows{indices.data(), times.data(), addresses};

    std::size_t count = reader.read(kBlock, rows);
    std::vector<CompanionCopy> companions = companions_from(count > 0 ? times[0] : 0);
    for (; count > 0; count = reader.read(kBlock, rows)) {
      for (std::size_t i = 0; i < count;) {
        std::size_t end = i + 1;
        while (end < count && indices[end] == indices[end - 1] + 1) ++end;
        const auto from = [&](std::size_t series) {
          return blocks[series].data() + i * session_.element(kSeries[series]).size();
        };
        writer.write_steps(number, {indices[i], end - i, from(0), from(1), from(2), from(3)});
        i = end;
      }
      for (std::size_t i = 0; i < companions.size(); ++i) {
        companions[i].write(writer, number, i, times[count - 1]);
      }
      writer.flush();
    }
    // The remaining elements arrived together with the end.
    for (std::size_t i = 0; i < companions.size(); ++i) {
      companions[i].write(writer, number, i, std::numeric_limits<std::int64_t>::max());
    }
  }

  // Returns readers that begin with the newest elements known at `time` and stop at the end of the
  // part.
  [[nodiscard]] std::vector<CompanionCopy> companions_from(std::int64_t time) const {
    const TimeIndex end = session_.range(Series::kAppliedAction).second;
    std::vector<CompanionCopy> companions;
    for (const LoggedSession& companion : session_.companions()) {
      const TimeIndex first = std::max<TimeIndex>(companion.find(time) - 1, 0);
      const TimeIndex last = last_ >= end ? std::numeric_limits<TimeIndex>::max()
                                          : companion.find(time_of(session_, last_));
      companions.emplace_back(companion, first, last);
    }
    return companions;
  }

  void write_end(LogWriter& writer, std::size_t number) {
    const TimeIndex steps = *session_.steps();
    if (session_.range(Series::kStatus).second > steps) {
      Status status;
      session_.get(Series::kStatus, steps, 1, &status);
      Bytes observation(session_.element(Series::kObservation).size());
      const bool has_observation = session_.range(Series::kObservation).second > steps;
      if (has_observation) session_.get(Series::kObservation, steps, 1, observation.data());
      writer.write_end(number, steps, has_observation ? observation.data() : nullptr, status);
    }
    writer.end_session(number, steps, session_.fault(), session_.fault_text());
  }

 public:
  // Returns the time of the first step from `t` on.
  static std::int64_t time_of(const LoggedSession& session, TimeIndex t) {
    std::int64_t time = std::numeric_limits<std::int64_t>::max();
    (void)session.read({}, t).read(1, {.times = &time});
    return time;
  }

 private:
  LoggedSession session_;
  TimeIndex first_;
  TimeIndex last_;
};

// Returns the part of each session that should be copied.
std::vector<SessionCopy> parts_of(const Log& log, const CopyOptions& options) {
  std::vector<SessionCopy> parts;
  if (!options.first && !options.last && options.session.empty()) {
    for (const LoggedSession& session : log.sessions()) {
      parts.emplace_back(session, 0, std::numeric_limits<TimeIndex>::max());
    }
    return parts;
  }
  const LoggedSession chosen = log.session(options.session);
  if (chosen.is_companion()) {
    throw InvalidArgument("'" + chosen.name() + "' is a companion; name its robot");
  }
  const auto [begin, end] = chosen.range(Series::kAppliedAction);
  const TimeIndex first = std::max(options.first.value_or(begin), begin);
  const TimeIndex last = std::min(options.last.value_or(end), end);
  if (first >= last) {
    throw InvalidArgument("nothing is left of '" + chosen.name() + "': the log has the steps " +
                          std::to_string(begin) + " to " + std::to_string(end - 1));
  }
  const std::int64_t begin_time = SessionCopy::time_of(chosen, first);
  const std::int64_t end_time = SessionCopy::time_of(chosen, last);
  for (const LoggedSession& session : log.sessions()) {
    if (session.header().session_id == chosen.header().session_id &&
        session.name() == chosen.name()) {
      parts.emplace_back(session, first,
                         last == end ? std::numeric_limits<TimeIndex>::max() : last);
    } else if (session.name() != chosen.name()) {
      const TimeIndex its_first = session.find(begin_time);
      const TimeIndex its_last = session.find(end_time);
      if (its_first < its_last) parts.emplace_back(session, its_first, its_last);
    }
  }
  return parts;
}

}  // namespace

FileReport check(const std::filesystem::path& file) {
  mcap::Reader reader(file, {.verify = true});
  std::uint64_t messages = 0;
  for (std::size_t i = 0; i < reader.contents().chunks.size(); ++i) {
    if (const auto found = reader.read_chunk(i)) messages += found->size();
  }
  return report_of(file, reader.contents(), messages);
}

FileReport recover(const std::filesystem::path& file, const std::filesystem::path& whole) {
  mcap::Reader reader(file, {.verify = true});
  NewFile result(whole);
  Rescue rescue(reader, result.sink());
  const std::uint64_t messages = rescue.write_all();
  write_gaps(file, rescue.writer());
  rescue.writer().finish();
  result.finish();
  return report_of(file, reader.contents(), messages);
}

void copy(const Log& log, const std::filesystem::path& copy, const CopyOptions& options) {
  std::vector<SessionCopy> parts = parts_of(log, options);
  NewFile result(copy);
  LogOptions log_options;
  log_options.precision = options.precision;
  log_options.compression = options.compression;
  LogWriter writer(result.sink(), log_options);
  for (SessionCopy& part : parts) part.write(writer);
  for (const Event& event : log.events()) {
    writer.write_event(event.level, event.source, event.text, event.time);
  }
  writer.finish();
  result.finish();
}

}  // namespace trifinger::log
