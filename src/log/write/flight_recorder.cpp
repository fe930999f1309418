// SPDX-License-Identifier: BSD-3-Clause
#include "log/flight_recorder.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/log_folder.hpp"
#include "log/format/extra_series.hpp"
#include "log/format/format.hpp"
#include "log/format/records.hpp"
#include "log/format/text.hpp"
#include "log/log_writer.hpp"
#include "log/write/next_date.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/sink.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

// Reads element `i`. False if it does not exist or is not whole.
bool try_read(const UntypedFrontend& session, Series series, TimeIndex i, void* element) {
  try {
    return session.try_get(series, i, element);
  } catch (const HistoryLost&) {
    return false;
  }
}

// A series of observations outside of the steps, which becomes a companion of the log.
struct ExtraSeries {
  Series series;
  std::size_t number;  // among the companions of the log
};

ElementDescription stamped(const ElementDescription& observation) {
  std::vector<FieldDescription> fields;
  for (FieldDescription field : describe<Stamp>().fields()) {
    field.name = "stamp." + field.name;
    fields.push_back(std::move(field));
  }
  for (FieldDescription field : observation.fields()) {
    field.name = "observation." + field.name;
    field.offset += sizeof(Stamp);
    fields.push_back(std::move(field));
  }
  return ElementDescription(std::move(fields));
}

// Copies the newest part of a session from its memory to a log.
class Snapshot {
 public:
  Snapshot(const Session& robot, const std::vector<Session>& companions, LogWriter& log,
           Nanoseconds length)
      : info_(robot.info()),
        robot_(robot),
        log_(log),
        header_(SessionHeader::of(robot, companions)) {
    for (const Session& companion : companions) companions_.emplace_back(companion);
    find_steps(length);
    header_.first_index = first_;
    for (std::size_t i = 0; i < companions_.size(); ++i) {
      header_.companions[i].first_index = first_element(i);
    }
    // The observations before step 0 belong to the log only if it begins at step 0.
    if (first_ == 0) add_series(Series::kHolding);
    add_series(Series::kStopping);
  }

  void write() {
    session_ = log_.begin_session(header_);
    for (const ExtraSeries& extra : extra_) {
      if (extra.series == Series::kHolding) write_series(extra);
    }
    for (std::size_t i = 0; i < companions_.size(); ++i) write_companion(i);
    write_steps();
    write_end();
    for (const ExtraSeries& extra : extra_) {
      if (extra.series == Series::kStopping) write_series(extra);
    }
    log_.end_session(session_, end_, info_.fault, info_.fault_text);
  }

 private:
  struct Step {
    explicit Step(const RobotTypes& types)
        : desired(types.action.size()),
          applied(types.applied_action.size()),
          observation(types.observation.size()) {}

    std::vector<std::byte> desired;
    std::vector<std::byte> applied;
    std::vector<std::byte> observation;
    Status status;
  };

  [[nodiscard]] bool read(TimeIndex t, Step& step) const {
    return try_read(robot_, Series::kStatus, t, &step.status) &&
           try_read(robot_, Series::kObservation, t, step.observation.data()) &&
           try_read(robot_, Series::kAppliedAction, t, step.applied.data()) &&
           try_read(robot_, Series::kDesiredAction, t, step.desired.data());
  }

  void find_steps(Nanoseconds length) {
    TimeIndex oldest = 0;
    end_ = robot_.range(Series::kStatus).second;
    for (const Series series :
         {Series::kDesiredAction, Series::kAppliedAction, Series::kObservation}) {
      end_ = std::min(end_, robot_.range(series).second);
      oldest = std::max(oldest, robot_.range(series).first);
    }
    oldest = std::max(oldest, robot_.range(Series::kStatus).first);
    const TimeIndex count =
        info_.period > Nanoseconds::zero() ? length / info_.period : TimeIndex{0};
    first_ = std::min(std::max(oldest, end_ - std::min(count, end_)), end_);
    // The oldest step may have been half overwritten when the back-end died.
    Step step(header_.types);
    while (first_ < end_ && !read(first_, step)) ++first_;
  }

  // Returns the newest element that was known at the first step, or the oldest that exists.
  [[nodiscard]] TimeIndex first_element(std::size_t companion) const {
    const auto [oldest, end] = companions_[companion].range(Series::kObservation);
    std::vector<std::byte> element(header_.companions[companion].element.size());
    TimeIndex first = end;
    while (first > oldest) {
      if (!try_read(companions_[companion], Series::kObservation, first - 1, element.data())) break;
      --first;
      Stamp stamp;
      std::memcpy(&stamp, element.data(), sizeof(stamp));
      if (stamp.arrival_index <= first_) break;
    }
    return first;
  }

  void add_series(Series series) {
    const auto [first, end] = robot_.range(series);
    const std::string name = info_.name + "." + std::string(name_of(series));
    const bool is_taken = std::ranges::any_of(
        header_.companions, [&](const auto& companion) { return companion.name == name; });
    if (first == end || is_taken) return;
    extra_.push_back({series, header_.companions.size()});
    header_.companions.push_back({.name = name,
                                  .type = extra_type(info_.type, series),
                                  .element = stamped(header_.types.observation),
                                  .first_index = first});
  }

  void write_companion(std::size_t number) {
    const std::size_t size = header_.companions[number].element.size();
    const TimeIndex end = companions_[number].range(Series::kObservation).second;
    std::vector<std::byte> element(size);
    for (TimeIndex i = header_.companions[number].first_index; i < end; ++i) {
      if (try_read(companions_[number], Series::kObservation, i, element.data())) {
        log_.write_companion(session_, number, i, 1, element.data());
      } else {
        log_.write_companion_gap(session_, number, i, i, kDamaged);
      }
    }
  }

  void write_steps() {
    Step step(header_.types);
    for (TimeIndex t = first_; t < end_; ++t) {
      if (read(t, step)) {
        log_.write_steps(session_, {.first = t,
                                    .count = 1,
                                    .desired_actions = step.desired.data(),
                                    .applied_actions = step.applied.data(),
                                    .observations = step.observation.data(),
                                    .statuses = &step.status});
      } else {
        log_.write_gap(session_, t, t, kDamaged);
      }
    }
  }

  void write_end() {
    Status status;
    if (!try_read(robot_, Series::kStatus, end_, &status)) return;
    std::vector<std::byte> observation(header_.types.observation.size());
    const bool is_there = try_read(robot_, Series::kObservation, end_, observation.data());
    log_.write_end(session_, end_, is_there ? observation.data() : nullptr, status);
  }

  // Writes an extra series. The back-end gives these observations no times, so the times are
  // computed: one period apart, either up to step 0 or from the end on.
  void write_series(const ExtraSeries& extra) {
    const bool is_before = extra.series == Series::kHolding;
    const auto [first, end] = robot_.range(extra.series);
    const std::int64_t period = info_.period.count();
    std::int64_t time = last_beat() - (end - 1) * period;  // time of element 0
    Status status;
    if (try_read(robot_, Series::kStatus, is_before ? 0 : end_, &status)) {
      time = status.time + (is_before ? -(end - 1) * period : period);
    }
    std::vector<std::byte> element(header_.companions[extra.number].element.size());
    for (TimeIndex i = first; i < end; ++i) {
      if (!try_read(robot_, extra.series, i, element.data() + sizeof(Stamp))) continue;
      Stamp stamp;
      stamp.arrival_index = stamp.capture_index = is_before ? -1 : end_ + 1 + i;
      stamp.arrival_time = stamp.capture_time = time + i * period;
      std::memcpy(element.data(), &stamp, sizeof(stamp));
      log_.write_companion(session_, extra.number, i, 1, element.data());
    }
  }

  [[nodiscard]] std::int64_t last_beat() const {
    return Nanoseconds(std::chrono::steady_clock::now().time_since_epoch() - info_.since_heartbeat)
        .count();
  }

  static constexpr std::string_view kDamaged = "damaged in the memory of the session";

  SessionInfo info_;
  UntypedFrontend robot_;
  std::vector<UntypedFrontend> companions_;
  LogWriter& log_;
  SessionHeader header_;
  std::vector<ExtraSeries> extra_;
  std::size_t session_{0};
  TimeIndex first_{0};
  TimeIndex end_{0};  // number of whole steps
};

// The log of a fault, found by its name.
struct FaultLog {
  std::filesystem::path path;
  std::string robot;
  std::string time;
};

// True for an empty text and for a number such as "_2". Logs of one second are numbered.
bool is_number(std::string_view text) {
  return text.empty() ||
         (text.size() > 1 && text.front() == '_' && std::ranges::all_of(text.substr(1), is_digit));
}

// Lists the logs of faults. Their names look like "sim_2026-11-20_09-05-12_fault.mcap".
std::vector<FaultLog> fault_logs(const std::filesystem::path& folder) {
  constexpr std::string_view kMark = "_fault";
  std::vector<FaultLog> logs;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().stem().string();
    const std::size_t mark = name.rfind(kMark);
    if (entry.path().extension() != kLogSuffix || mark == std::string::npos ||
        mark < kDatePattern.size() + 2) {
      continue;
    }
    const std::size_t begin = mark - kDatePattern.size();
    const std::string time = name.substr(begin, kDatePattern.size());
    const std::string number = name.substr(mark + kMark.size());
    if (name[begin - 1] != '_' || !is_date(time) || !is_number(number)) continue;
    logs.push_back({entry.path(), name.substr(0, begin - 1), time + number});
  }
  std::ranges::sort(logs, {}, [](const FaultLog& log) { return std::pair(log.time, log.path); });
  return logs;
}

// Returns an unused path in `folder`.
std::filesystem::path new_fault_log(const std::filesystem::path& folder, const std::string& robot) {
  const std::string name = robot + "_" + next_date(folder) + "_fault";
  std::filesystem::path path = folder / (name + std::string(kLogSuffix));
  // A dangling link occupies its name, too.
  for (int i = 2; std::filesystem::exists(std::filesystem::symlink_status(path)); ++i) {
    path = folder / (name + "_" + std::to_string(i) + std::string(kLogSuffix));
  }
  return path;
}

}  // namespace

void write_last(const Session& robot, const std::vector<Session>& companions,
                const std::filesystem::path& file, Nanoseconds length, std::string_view event) {
  mcap::FileSink sink = mcap::FileSink::create(file);
  LogWriter log(sink, {});
  const SessionInfo info = robot.info();
  Snapshot(robot, companions, log, length).write();
  if (!info.fault_text.empty()) {
    log.write_event(Level::kError, info.name, info.fault_text, wall_time());
  }
  log.write_event(Level::kInfo, info.name, event, wall_time());
  log.finish();
  sink.sync();
}

std::filesystem::path rescue(const std::string& name, std::optional<std::filesystem::path> file,
                             Nanoseconds length) {
  const Session robot = Session::open(name);
  const SessionInfo info = robot.info();
  if (info.is_companion) {
    throw InvalidArgument("'" + name + "' is a companion; rescue its robot, '" +
                          name.substr(0, name.find('.')) + "'");
  }
  if (info.backend_is_alive && info.phase != SessionInfo::Phase::kEnded) {
    throw InvalidArgument("the back-end of '" + name + "', process " +
                          std::to_string(info.backend.pid) +
                          ", is alive: record it with 'trifinger record " + name + "'");
  }
  std::vector<Session> companions;
  for (const std::string& companion : robot.companion_names()) {
    try {
      companions.push_back(robot.companion(companion));
    } catch (const Error&) {
      // The companion is lost with its file. The robot's own series are still worth saving.
    }
  }
  if (!file) file = new_fault_log(log_folder(), name);
  write_last(robot, companions, *file, length, "rescued from what the back-end has left in memory");
  return *file;
}

std::optional<std::filesystem::path> find_fault_log(const std::filesystem::path& folder,
                                                    const std::string& name,
                                                    std::uint64_t session_id) {
  const std::vector<FaultLog> logs = fault_logs(folder);
  const auto newest = std::ranges::find(logs.rbegin(), logs.rend(), name, &FaultLog::robot);
  if (newest == logs.rend()) return std::nullopt;
  try {
    const mcap::Reader reader(newest->path);
    for (const mcap::Metadata& record : reader.contents().metadata) {
      if (record.name == kSessionRecord && entry_of(record.entries, "name") == name &&
          number_of<std::uint64_t>(entry_of(record.entries, "session_id")) == session_id) {
        return newest->path;
      }
    }
  } catch (const Error&) {
    // A file that cannot be read tells nothing of the session.
  }
  return std::nullopt;
}

FlightRecorder::FlightRecorder(FlightRecorderOptions options) : options_(std::move(options)) {}

void FlightRecorder::begin_session(const Session& robot,
                                   const std::vector<Session>& companions) noexcept {
  // Histories are large. Those of clean ends are released at once. When faults follow each other
  // faster than they are written, the newest are kept.
  constexpr std::size_t kMaxWaiting = 4;
  const std::lock_guard lock(mutex_);
  std::erase_if(sessions_, [](const Followed& session) {
    return !session.robot.info().fault.needs_recovery();
  });
  if (sessions_.size() >= kMaxWaiting) sessions_.erase(sessions_.begin());
  sessions_.push_back({robot, companions});
}

std::vector<FlightRecorder::Followed> FlightRecorder::take_ended() {
  const std::lock_guard lock(mutex_);
  std::vector<Followed> ended;
  for (auto session = sessions_.begin(); session != sessions_.end();) {
    const SessionInfo info = session->robot.info();
    const bool is_over = info.is_at_rest || session + 1 != sessions_.end();
    if (!is_over || !info.fault.needs_recovery()) {
      ++session;
      continue;
    }
    ended.push_back(std::move(*session));
    session = sessions_.erase(session);
  }
  return ended;
}

std::vector<FlightRecorder::Left> FlightRecorder::write() {
  std::vector<Left> all;
  for (const Followed& session : take_ended()) {
    Left left;
    try {
      if (options_.folder.empty()) options_.folder = log_folder();
      left.file = new_fault_log(options_.folder, session.robot.info().name);
      write_last(session.robot, session.companions, left.file, options_.length,
                 "left by the flight recorder");
      remove_oldest();
    } catch (const std::exception& error) {
      left.error = error.what();
    }
    all.push_back(std::move(left));
  }
  return all;
}

void FlightRecorder::remove_oldest() const {
  const std::vector<FaultLog> logs = fault_logs(options_.folder);
  std::error_code ignored;
  for (std::size_t i = options_.max_files; i < logs.size(); ++i) {
    std::filesystem::remove(logs[i - options_.max_files].path, ignored);
  }
}

}  // namespace trifinger::log
