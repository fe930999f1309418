// SPDX-License-Identifier: BSD-3-Clause
#include "log/copy.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "log/format/image_messages.hpp"
#include "log/log_writer.hpp"
#include "log/logged_images.hpp"
#include "log/repair/new_file.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/status.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

using Bytes = std::vector<std::byte>;

// Copies elements of a companion, one after the other.
class CompanionPart {
 public:
  // `cameras` if it is the companion with their images.
  CompanionPart(const LoggedSession& companion, TimeIndex first, TimeIndex last,
                std::optional<LoggedCameras> cameras)
      : reader_(companion.read({Column{}}, first, last)),
        element_(companion.element(Series::kObservation).size()),
        cameras_(std::move(cameras)) {
    advance();
  }

  // Writes the elements up to `time`.
  void write(LogWriter& writer, std::size_t session, std::size_t companion, std::int64_t time) {
    for (; has_element_ && time_ <= time; advance()) {
      writer.write_companion(session, companion, index_, 1, element_.data());
      if (cameras_) write_images(writer, session);
    }
  }

 private:
  void write_images(LogWriter& writer, std::size_t session) const {
    const LoggedImages images = cameras_->at(index_);
    for (std::size_t i = 0; i < images.cameras().size(); ++i) {
      if (!images.has(i)) continue;
      const RecordedImage image = images.recorded(i);
      const auto bytes = std::as_bytes(std::span(image.bytes));
      const camera::Camera& camera = images.cameras()[i];
      const std::string frame = frame_of(cameras_->companion().header().name, camera);
      const bool is_compressed = image.encoding == kJpegImages;
      writer.write_image(session,
                         {.camera = i,
                          .element = index_,
                          .time = images.times()[i],
                          .is_compressed = is_compressed,
                          .message = is_compressed ? compressed_image(frame, bytes)
                                                   : raw_image(frame, camera.format, bytes)});
    }
    if (writer.waiting_images_size() > kMaxWaitingImages) writer.flush();
  }

  static constexpr std::size_t kMaxWaitingImages = std::size_t{16} << 20U;

  void advance() {
    void* const element = element_.data();
    has_element_ =
        reader_.read(1, {.indices = &index_, .times = &time_, .columns = {&element, 1}}) == 1;
  }

  SeriesReader reader_;
  Bytes element_;
  std::optional<LoggedCameras> cameras_;
  TimeIndex index_{0};
  std::int64_t time_{0};
  bool has_element_{false};
};

// Returns the time of the first step from `t` on.
std::int64_t time_of(const LoggedSession& session, TimeIndex t) {
  std::int64_t time = std::numeric_limits<std::int64_t>::max();
  (void)session.read({}, t).read(1, {.times = &time});
  return time;
}

// Copies the steps [first, last) of a session and everything that belongs to them.
class SessionPart {
 public:
  SessionPart(const LoggedSession& session, TimeIndex first, TimeIndex last)
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
    std::vector<CompanionPart> companions = companions_from(count > 0 ? times[0] : 0);
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
  [[nodiscard]] std::vector<CompanionPart> companions_from(std::int64_t time) const {
    const TimeIndex end = session_.range(Series::kAppliedAction).second;
    std::vector<CompanionPart> companions;
    const std::optional<SessionCameras> cameras = cameras_of(session_.header());
    std::size_t number = 0;
    for (const LoggedSession& companion : session_.companions()) {
      const bool has_images = cameras && cameras->companion == number++ && companion.has_elements();
      const TimeIndex first = std::max<TimeIndex>(companion.find(time) - 1, 0);
      const TimeIndex last = last_ >= end ? std::numeric_limits<TimeIndex>::max()
                                          : companion.find(time_of(session_, last_));
      companions.emplace_back(
          companion, first, last,
          has_images ? std::optional<LoggedCameras>(std::in_place, session_) : std::nullopt);
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

  LoggedSession session_;
  TimeIndex first_;
  TimeIndex last_;
};

// Returns the part of each session that should be copied.
std::vector<SessionPart> parts_of(const Log& log, const CopyOptions& options) {
  std::vector<SessionPart> parts;
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
  const std::int64_t begin_time = time_of(chosen, first);
  const std::int64_t end_time = time_of(chosen, last);
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

void copy(const Log& log, const std::filesystem::path& copy, const CopyOptions& options) {
  std::vector<SessionPart> parts = parts_of(log, options);
  NewFile result(copy);
  LogOptions log_options;
  log_options.precision = options.precision;
  log_options.compression = options.compression;
  LogWriter writer(result.sink(), log_options);
  for (SessionPart& part : parts) part.write(writer);
  for (const Event& event : log.events()) {
    writer.write_event(event.level, event.source, event.text, event.time);
  }
  writer.finish();
  result.finish();
}

}  // namespace trifinger::log
