// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/log/log.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <mutex>
#include <set>
#include <string_view>
#include <system_error>

#include "format/format.hpp"
#include "read/log_data.hpp"
#include "trifinger/base/suggestion.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger::log {

using detail::LogData;
using detail::Run;
using detail::Stream;
using detail::StreamMessage;

namespace {

using Lock = std::scoped_lock<std::mutex>;

// Joins names, as in "'a' and 'b'". Returns a text that says so if there are none.
std::string list_of(const std::vector<std::string_view>& names) {
  return names.empty() ? "none" : quoted_list(names, "and");
}

// Formats a span: "step 3" or "steps 3 to 5"; for a companion, elements instead of steps.
std::string span_text(const Stream& stream, TimeIndex first, TimeIndex last) {
  const std::string what = stream.is_companion ? "element" : "step";
  if (first == last) return what + " " + std::to_string(first);
  return what + "s " + std::to_string(first) + " to " + std::to_string(last);
}

// Returns the robot's part of a name: "sim" for both "sim.object" and "sim".
std::string_view robot_of(std::string_view name) { return name.substr(0, name.find('.')); }

const ElementDescription& element_of(const Stream& stream, Series series) {
  static const ElementDescription nothing;
  if (series == Series::kHolding || series == Series::kStopping ||
      (stream.is_companion && series != Series::kObservation)) {
    throw InvalidArgument("a log has no series '" + std::string(name_of(series)) + "' of " +
                          (stream.is_companion ? "companion '" : "robot '") + stream.name + "'");
  }
  if (stream.channel == nullptr) return nothing;
  switch (series) {
    case Series::kDesiredAction:
      return stream.channel->types.action;
    case Series::kAppliedAction:
      return stream.channel->types.applied_action;
    case Series::kStatus:
      return stream.channel->status;
    default:
      return stream.channel->types.observation;
  }
}

// Returns which part of a message holds the element of `series`.
std::size_t part_of(const StreamMessage& found, Series series) {
  if (found.stream.is_companion) return 1;
  switch (series) {
    case Series::kDesiredAction:
      return StepPart::kDesiredAction;
    case Series::kAppliedAction:
      return StepPart::kAppliedAction;
    case Series::kStatus:
      return StepPart::kStatus;
    default:
      return StepPart::kObservation;
  }
}

// Reads the elements of one column from messages.
class ColumnReader {
 public:
  ColumnReader(const Stream& stream, const Column& column) : series_(column.series) {
    const ElementDescription& whole = element_of(stream, column.series);
    element_ = column.fields.empty() ? whole : select(whole, column.fields);
    if (element_ == whole) return;
    scratch_.resize(whole.size());
    for (const FieldDescription& field : element_.fields()) {
      const std::size_t size = field.count() * size_of(field.type);
      copies_.push_back({whole.find(field.name)->offset, field.offset, size});
    }
  }

  [[nodiscard]] const ElementDescription& element() const noexcept { return element_; }

  void read(const StreamMessage& found, std::byte* element) {
    const std::size_t part = part_of(found, series_);
    const MessageLayout& layout = *found.channel.layout;
    if (scratch_.empty()) {
      layout.decode(found.message.data, part, element);
      return;
    }
    layout.decode(found.message.data, part, scratch_.data());
    for (const Copy& copy : copies_) {
      std::memcpy(element + copy.to, scratch_.data() + copy.from, copy.size);
    }
  }

 private:
  struct Copy {
    std::size_t from;
    std::size_t to;
    std::size_t size;
  };

  Series series_;
  ElementDescription element_;
  std::vector<std::byte> scratch_;  // a whole element, where only some fields are wanted
  std::vector<Copy> copies_;
};

// Calls `use` with the message about the end of `stream`, if the log has one.
template <class Use>
void with_end(LogData& data, const Stream& stream, const Use& use) {
  if (stream.is_companion) return;
  // The message is in the chunk of the last step or soon after it.
  const Run* const last = data.last_run(stream);
  std::size_t n = last == nullptr ? 0 : data.find_chunk(stream, [last](const Run& run) {
    return run.last >= last->last;
  });
  for (; n < data.num_chunks(); ++n) {
    const auto is_its_end = [&stream](const Run& run) {
      return run.stream == &stream && run.is_end;
    };
    if (std::ranges::any_of(data.runs(n), is_its_end)) {
      data.visit(n, [&](const StreamMessage& found) {
        if (&found.stream != &stream || !found.is_end()) return true;
        use(found);
        return false;
      });
      return;
    }
    if (data.is_behind(stream, n)) return;
  }
}

// Returns the first index of `series`, and the last one plus one.
std::pair<TimeIndex, TimeIndex> range_of(LogData& data, const Stream& stream, Series series) {
  std::pair<TimeIndex, TimeIndex> range = data.range(stream);
  if (stream.is_companion || series == Series::kDesiredAction || series == Series::kAppliedAction) {
    return range;
  }
  const detail::SessionRecord& session = *stream.session;
  with_end(data, stream, [&](const StreamMessage& found) {
    if (found.index != range.second) return;
    const bool has_observation = !session.steps || session.observations > *session.steps;
    if (series == Series::kStatus || has_observation) ++range.second;
  });
  return range;
}

[[noreturn]] void throw_not_in_log(LogData& data, const Stream& stream, Series series,
                                   TimeIndex first, TimeIndex last) {
  const auto [begin, end] = range_of(data, stream, series);
  const std::string log = "the log of '" + stream.name + "'";
  if (begin == end) throw NotInLog(log + " has no " + std::string(name_of(series)));
  if (first < begin || last >= end) {
    throw NotInLog(span_text(stream, first, last) + " of the " + std::string(name_of(series)) +
                   "s: " + log + " has " + span_text(stream, begin, end - 1));
  }
  for (const Gap& gap : data.gaps(stream)) {
    if (gap.last < first || gap.first > last) continue;
    throw NotInLog(log + " lacks " + span_text(stream, gap.first, gap.last) + ": " + gap.reason);
  }
  throw NotInLog(log + " lacks some of the " + span_text(stream, first, last));
}

// Returns the first element of `stream` in chunk `n` or later for which `is_wanted(StreamMessage)`
// holds.
template <class IsWanted>
std::optional<TimeIndex> find_from(LogData& data, const Stream& stream, std::size_t n,
                                   const IsWanted& is_wanted) {
  std::optional<TimeIndex> index;
  for (; n < data.num_chunks() && !index; ++n) {
    data.visit(n, [&](const StreamMessage& found) {
      if (&found.stream == &stream && !found.is_end() && is_wanted(found)) index = found.index;
      return !index;
    });
    if (data.is_behind(stream, n)) break;
  }
  return index;
}

}  // namespace

ElementDescription select(const ElementDescription& element,
                          const std::vector<std::string>& fields) {
  const auto is_meant = [](const FieldDescription& field, const std::string& name) {
    return field.name == name || field.name.starts_with(name + ".");
  };
  for (const std::string& name : fields) {
    if (std::ranges::any_of(element.fields(),
                            [&](const FieldDescription& field) { return is_meant(field, name); })) {
      continue;
    }
    std::vector<std::string_view> names;
    for (const FieldDescription& field : element.fields()) names.push_back(field.name);
    throw InvalidArgument("there is no field '" + name + "'; there are " + list_of(names));
  }
  std::vector<FieldDescription> selected;
  std::size_t offset = 0;
  for (const FieldDescription& field : element.fields()) {
    if (std::ranges::none_of(fields,
                             [&](const std::string& name) { return is_meant(field, name); })) {
      continue;
    }
    selected.push_back(field);
    selected.back().offset = offset;
    offset += field.count() * size_of(field.type);
  }
  return ElementDescription(std::move(selected));
}

// ---- SeriesReader ----

class SeriesReader::Implementation {
 public:
  Implementation(std::shared_ptr<LogData> data, const Stream& stream,
                 const std::vector<Column>& columns, TimeIndex first, TimeIndex last)
      : data_(std::move(data)), stream_(&stream) {
    const Lock lock(data_->mutex);
    for (const Column& column : columns) columns_.emplace_back(stream, column);
    const auto [begin, end] = data_->range(stream);
    next_ = std::max(first, begin);
    last_ = std::min(last, end);
    if (next_ >= last_) return;
    chunk_ = data_->find_chunk(stream, [this](const Run& run) { return run.last >= next_; });
    auto rows = static_cast<std::uint64_t>(last_ - next_);
    for (const Gap& gap : stream.gaps) {
      const TimeIndex missing = std::min(gap.last + 1, last_) - std::max(gap.first, next_);
      rows -= std::min(rows, static_cast<std::uint64_t>(std::max<TimeIndex>(missing, 0)));
    }
    max_rows_ = std::min<std::size_t>(rows, data_->max_messages(stream));
  }

  [[nodiscard]] const ElementDescription& element(std::size_t i) const {
    return columns_.at(i).element();
  }
  [[nodiscard]] std::size_t max_rows() const noexcept { return max_rows_; }

  std::size_t read(std::size_t count, const Rows& rows) {
    const Lock lock(data_->mutex);
    if (rows.columns.size() > columns_.size()) {
      throw InvalidArgument("there are " + std::to_string(columns_.size()) + " columns");
    }
    std::size_t done = 0;
    bool is_full = count == 0;
    const auto take = [&](const StreamMessage& found) {
      if (&found.stream != stream_ || found.is_end() || found.index < next_) return true;
      is_full = done == count || found.index >= last_;
      if (is_full) return false;
      if (rows.indices != nullptr) rows.indices[done] = found.index;
      if (rows.times != nullptr) rows.times[done] = found.time();
      for (std::size_t i = 0; i < rows.columns.size(); ++i) {
        auto* const elements = static_cast<std::byte*>(rows.columns[i]);
        if (elements != nullptr) {
          columns_[i].read(found, elements + done * columns_[i].element().size());
        }
      }
      next_ = found.index + 1;
      ++done;
      return true;
    };
    while (!is_full && next_ < last_ && chunk_ < data_->num_chunks()) {
      const auto is_of_use = [this](const Run& run) {
        return run.stream == stream_ && !run.is_end && run.last >= next_;
      };
      if (std::ranges::any_of(data_->runs(chunk_), is_of_use)) {
        data_->visit(chunk_, take);
        if (is_full) break;
      } else if (data_->is_behind(*stream_, chunk_)) {
        next_ = last_;
      }
      ++chunk_;
    }
    return done;
  }

 private:
  std::shared_ptr<LogData> data_;
  const Stream* stream_;
  std::vector<ColumnReader> columns_;
  TimeIndex next_{0};  // first index not yet read
  TimeIndex last_{0};
  std::size_t chunk_{0};
  std::size_t max_rows_{0};
};

SeriesReader::SeriesReader(std::unique_ptr<Implementation> implementation)
    : implementation_(std::move(implementation)) {}
SeriesReader::SeriesReader(SeriesReader&&) noexcept = default;
SeriesReader& SeriesReader::operator=(SeriesReader&&) noexcept = default;
SeriesReader::~SeriesReader() = default;

const ElementDescription& SeriesReader::element(std::size_t i) const {
  return implementation_->element(i);
}
std::size_t SeriesReader::max_rows() const noexcept { return implementation_->max_rows(); }
std::size_t SeriesReader::read(std::size_t count, const Rows& rows) {
  return implementation_->read(count, rows);
}

// ---- LoggedSession ----

LoggedSession::LoggedSession(std::shared_ptr<LogData> log, const Stream& stream)
    : log_(std::move(log)), stream_(&stream) {}

const std::string& LoggedSession::name() const noexcept { return stream_->name; }
bool LoggedSession::is_companion() const noexcept { return stream_->is_companion; }
const SessionHeader& LoggedSession::header() const noexcept { return stream_->session->header; }
std::optional<TimeIndex> LoggedSession::steps() const noexcept { return stream_->session->steps; }
const Fault& LoggedSession::fault() const noexcept { return stream_->session->fault; }
const std::string& LoggedSession::fault_text() const noexcept {
  return stream_->session->fault_text;
}

const std::string& LoggedSession::type() const noexcept {
  static const std::string unknown;
  if (!is_companion()) return header().types.type;
  return stream_->channel == nullptr ? unknown : stream_->channel->types.type;
}

bool LoggedSession::has_elements() const noexcept { return stream_->channel != nullptr; }

const ElementDescription& LoggedSession::element(Series series) const {
  return element_of(*stream_, series);
}

std::pair<TimeIndex, TimeIndex> LoggedSession::range(Series series) const {
  const Lock lock(log_->mutex);
  (void)element(series);  // throws if there is no such series
  return range_of(*log_, *stream_, series);
}

std::vector<Gap> LoggedSession::gaps() const {
  const Lock lock(log_->mutex);
  return log_->gaps(*stream_);
}

void LoggedSession::get(Series series, TimeIndex first, std::size_t count, void* elements) const {
  get(Column{.series = series, .fields = {}}, first, count, elements);
}

void LoggedSession::get(const Column& column, TimeIndex first, std::size_t count,
                        void* elements) const {
  const TimeIndex last = first + static_cast<TimeIndex>(count);
  SeriesReader reader = read({column}, first, last);
  std::size_t done = first < 0 ? 0 : reader.read(count, {.columns = {&elements, 1}});
  if (done == count) return;

  const Lock lock(log_->mutex);
  // The last element may be in the message about the end.
  if (first >= 0 && done + 1 == count && range_of(*log_, *stream_, column.series).second == last &&
      log_->range(*stream_).second == last - 1) {
    with_end(*log_, *stream_, [&](const StreamMessage& found) {
      ColumnReader end(*stream_, column);
      end.read(found, static_cast<std::byte*>(elements) + done * end.element().size());
      ++done;
    });
    if (done == count) return;
  }
  throw_not_in_log(*log_, *stream_, column.series, first, last - 1);
}

bool LoggedSession::get_latest_at(TimeIndex t, void* element) const {
  if (!is_companion()) {
    throw InvalidArgument("get_latest_at reads companions; robot '" + name() +
                          "' has one element per step: use get_observation");
  }
  const Lock lock(log_->mutex);
  const Stream& robot = stream_->session->robot;
  if (t >= range_of(*log_, robot, Series::kStatus).second) {
    throw_not_in_log(*log_, robot, Series::kObservation, t, t);
  }
  // The element wanted is the one before the first that came later.
  const std::size_t n =
      log_->find_chunk(*stream_, [t](const Run& run) { return run.last_arrival > t; });
  const std::optional<TimeIndex> later =
      find_from(*log_, *stream_, n,
                [t](const StreamMessage& found) { return detail::arrival_of(found.message) > t; });
  TimeIndex wanted = 0;
  if (later) {
    wanted = *later - 1;
  } else {
    const Run* const last = log_->last_run(*stream_);
    wanted = last == nullptr ? -1 : last->last;
  }
  if (wanted < 0) return false;
  bool is_found = false;
  ColumnReader column(*stream_, {});
  (void)find_from(*log_, *stream_,
                  log_->find_chunk(*stream_, [=](const Run& run) { return run.last >= wanted; }),
                  [&](const StreamMessage& found) {
                    if (found.index == wanted) {
                      column.read(found, static_cast<std::byte*>(element));
                      is_found = true;
                    }
                    return found.index >= wanted;
                  });
  if (!is_found) throw_not_in_log(*log_, *stream_, Series::kObservation, wanted, wanted);
  return true;
}

SeriesReader LoggedSession::read(const std::vector<Column>& columns, TimeIndex first,
                                 TimeIndex last) const {
  return SeriesReader(
      std::make_unique<SeriesReader::Implementation>(log_, *stream_, columns, first, last));
}

std::optional<std::pair<TimeIndex, Status>> LoggedSession::end_status() const {
  if (is_companion() || !has_elements() || element(Series::kStatus) != describe<Status>()) {
    return std::nullopt;
  }
  const TimeIndex t = range(Series::kAppliedAction).second;
  if (t >= range(Series::kStatus).second) return std::nullopt;
  Status status;
  try {
    get(Series::kStatus, t, 1, &status);
  } catch (const NotInLog&) {
    return std::nullopt;
  }
  return std::pair(t, status);
}

std::optional<TimingRecord> LoggedSession::timing(TimeIndex first, TimeIndex last) const {
  if (is_companion() || !header().is_real_time || !has_elements() ||
      element(Series::kStatus) != describe<Status>()) {
    return std::nullopt;
  }
  constexpr std::size_t kBlock = 4096;
  TimingRecord timing;
  std::vector<TimeIndex> indices(kBlock);
  std::vector<Status> statuses(kBlock);
  const std::array<void*, 1> columns{statuses.data()};
  SeriesReader reader = read({{Series::kStatus, {}}}, first, last);
  while (const std::size_t rows =
             reader.read(kBlock, {.indices = indices.data(), .columns = columns})) {
    for (std::size_t i = 0; i < rows; ++i) timing.add(indices[i], statuses[i], header().period);
  }
  if (const auto end = end_status(); end && end->first >= first && end->first < last) {
    timing.add(end->first, end->second, header().period);
  }
  return timing;
}

TimeIndex LoggedSession::find(std::int64_t time) const {
  const Lock lock(log_->mutex);
  const std::size_t n =
      log_->find_chunk(*stream_, [time](const Run& run) { return run.last_time >= time; });
  const std::optional<TimeIndex> index = find_from(
      *log_, *stream_, n, [time](const StreamMessage& found) { return found.time() >= time; });
  return index ? *index : log_->range(*stream_).second;
}

std::pair<TimeIndex, TimeIndex> LoggedSession::between(Nanoseconds begin, Nanoseconds end) const {
  std::int64_t start = 0;
  if (read({}).read(1, {.times = &start}) == 0) return {0, 0};
  const auto time_of = [start](Nanoseconds time) {
    const std::int64_t since = std::max<std::int64_t>(time.count(), 0);
    const bool is_past_all = since > std::numeric_limits<std::int64_t>::max() - start;
    return is_past_all ? std::numeric_limits<std::int64_t>::max() : start + since;
  };
  return {find(time_of(begin)), find(time_of(end))};
}

std::vector<LoggedSession> LoggedSession::companions() const {
  const Lock lock(log_->mutex);
  std::vector<LoggedSession> companions;
  if (is_companion()) return companions;
  for (const Stream& stream : stream_->session->companions) companions.emplace_back(log_, stream);
  return companions;
}

LoggedSession LoggedSession::companion(const std::string& name) const {
  std::vector<std::string_view> names;
  const std::vector<LoggedSession> all = companions();
  for (const LoggedSession& companion : all) {
    const std::string_view full = companion.name();
    names.push_back(full.substr(full.find('.') + 1));
    if (name == full || name == names.back()) return companion;
  }
  throw InvalidArgument("'" + this->name() + "' has no companion '" + name +
                        "' in this log; it has " + list_of(names));
}

// ---- Log ----

std::vector<std::filesystem::path> files_of(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_directory(path, error)) return {path};
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(path, error)) {
    std::error_code ignored;
    if (entry.path().extension() == kLogSuffix && entry.is_regular_file(ignored)) {
      files.push_back(entry.path());
    }
  }
  if (error) throw SystemError("look into " + path.string(), error.value());
  if (files.empty()) throw InvalidArgument("the folder " + path.string() + " has no .mcap files");
  std::ranges::sort(files);
  return files;
}

Log::Log(const std::filesystem::path& path)
    : data_(std::make_shared<LogData>(files_of(path), LogData::Several::kTakeNewest)) {}

Log::Log(const std::vector<std::filesystem::path>& parts) {
  if (parts.empty()) throw InvalidArgument("a log has at least one file");
  data_ = std::make_shared<LogData>(parts, LogData::Several::kRefuse);
}

const std::vector<std::filesystem::path>& Log::files() const noexcept { return data_->paths(); }
std::uint64_t Log::size() const noexcept { return data_->size(); }
bool Log::is_finished() const noexcept { return data_->is_finished(); }
const std::map<std::string, std::string>& Log::origin() const noexcept { return data_->origin(); }

std::vector<LoggedSession> Log::sessions() const {
  const Lock lock(data_->mutex);
  std::vector<LoggedSession> sessions;
  for (const detail::SessionRecord& session : data_->sessions()) {
    sessions.emplace_back(data_, session.robot);
  }
  std::ranges::stable_sort(sessions, {},
                           [](const LoggedSession& session) { return session.header().created; });
  return sessions;
}

LoggedSession Log::session(const std::string& name) const {
  const std::vector<LoggedSession> all = sessions();
  std::set<std::string_view> names;
  for (const LoggedSession& session : all) names.insert(session.name());
  const std::string_view robot =
      name.empty() && names.size() == 1 ? *names.begin() : robot_of(name);
  if (!names.contains(robot)) {
    const std::string known = list_of({names.begin(), names.end()});
    throw InvalidArgument(name.empty() ? "this log has the robots " + known + "; name one of them"
                                       : "this log has no robot or companion '" + name +
                                             "'; it has " + known);
  }
  const LoggedSession* found = nullptr;
  for (const LoggedSession& session : all) {
    if (session.name() != robot) continue;
    // A robot that waits for its next session has a session without steps, which is skipped.
    const auto [first, end] = session.range(Series::kAppliedAction);
    if (found == nullptr || first < end) found = &session;
  }
  return name.empty() || name == robot ? *found : found->companion(name);
}

std::vector<Event> Log::events() const {
  const Lock lock(data_->mutex);
  return data_->events();
}
std::vector<Damage> Log::damage() const {
  const Lock lock(data_->mutex);
  return data_->damage();
}
std::uint64_t Log::lost_bytes() const {
  const Lock lock(data_->mutex);
  return data_->lost_bytes();
}

// ---- typed ----

namespace {

void require_same(const std::string& what, const ElementDescription& found,
                  const ElementDescription& expected) {
  if (found == expected) return;
  throw IncompatibleSession(what + " has other fields than this program expects.\nLog:\n" +
                            found.text() + "Program:\n" + expected.text());
}

}  // namespace

void require_same_robot(const LoggedSession& session, const RobotTypes& expected) {
  const std::string name = "'" + session.name() + "' in the log";
  if (session.is_companion()) throw IncompatibleSession(name + " is a companion, not a robot");
  if (session.type() != expected.type) {
    throw IncompatibleSession(name + " is a robot of type '" + session.type() +
                              "'; this program expects '" + expected.type + "'");
  }
  require_same("the action of " + name, session.element(Series::kDesiredAction), expected.action);
  require_same("the applied action of " + name, session.element(Series::kAppliedAction),
               expected.applied_action);
  require_same("the observation of " + name, session.element(Series::kObservation),
               expected.observation);
  require_same("the status of " + name, session.element(Series::kStatus), describe<Status>());
}

void require_same_elements(const LoggedSession& session, const ElementDescription& expected) {
  require_same("'" + session.name() + "' in the log", session.element(Series::kObservation),
               expected);
}

}  // namespace trifinger::log
