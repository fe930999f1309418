// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/moved.hpp"
#include "ipc/forkable_mutex.hpp"
#include "log/read/channel_reader.hpp"
#include "log/read/log_data.hpp"
#include "log/read/series_reader.hpp"
#include "log/read/session_table.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

using Lock = std::scoped_lock<ipc::ForkableMutex>;

// Formats a span: "step 3" or "steps 3 to 5"; for a companion, elements instead of steps.
std::string span_text(const Stream& stream, TimeIndex first, TimeIndex last) {
  const std::string what = stream.is_companion ? "element" : "step";
  if (first == last) return what + " " + std::to_string(first);
  return what + "s " + std::to_string(first) + " to " + std::to_string(last);
}

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
  const SessionRecord& session = *stream.session;
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

void require_same(const std::string& what, const ElementDescription& found,
                  const ElementDescription& expected) {
  if (found == expected) return;
  throw IncompatibleSession(what + " has other fields than this program expects.\nLog:\n" +
                            found.text() + "Program:\n" + expected.text());
}

// The stream of a session that reads `log`. One that was moved from has no log any more, but still
// points to a stream.
const Stream& stream_of(const std::shared_ptr<LogData>& log, const Stream* stream) {
  (void)checked(log);
  return *stream;
}

}  // namespace

LoggedSession::LoggedSession(std::shared_ptr<LogData> log, const Stream& stream)
    : log_(std::move(log)), stream_(&stream) {}

const std::string& LoggedSession::name() const noexcept { return stream_of(log_, stream_).name; }
bool LoggedSession::is_companion() const noexcept { return stream_of(log_, stream_).is_companion; }
const SessionHeader& LoggedSession::header() const noexcept {
  return stream_of(log_, stream_).session->header;
}
std::optional<TimeIndex> LoggedSession::steps() const noexcept {
  return stream_of(log_, stream_).session->steps;
}
const Fault& LoggedSession::fault() const noexcept {
  return stream_of(log_, stream_).session->fault;
}
const std::string& LoggedSession::fault_text() const noexcept {
  return stream_of(log_, stream_).session->fault_text;
}

const std::string& LoggedSession::type() const noexcept {
  static const std::string unknown;
  if (!is_companion()) return header().types.type;
  return stream_->channel == nullptr ? unknown : stream_->channel->types.type;
}

bool LoggedSession::has_elements() const noexcept {
  return stream_of(log_, stream_).channel != nullptr;
}

const ElementDescription& LoggedSession::element(Series series) const {
  return element_of(stream_of(log_, stream_), series);
}

std::pair<TimeIndex, TimeIndex> LoggedSession::range(Series series) const {
  const Lock lock(checked(log_)->mutex);
  (void)element(series);  // throws if there is no such series
  return range_of(*log_, *stream_, series);
}

std::vector<Gap> LoggedSession::gaps() const {
  const Lock lock(checked(log_)->mutex);
  return log_->gaps(*stream_);
}

void LoggedSession::get(Series series, TimeIndex first, std::size_t count, void* elements) const {
  get(Column{.series = series, .fields = {}}, first, count, elements);
}

void LoggedSession::get(const Column& column, TimeIndex first, std::size_t count,
                        void* elements) const {
  constexpr TimeIndex kLargest = std::numeric_limits<TimeIndex>::max();
  if (first > kLargest - static_cast<TimeIndex>(count)) {
    const Lock lock(checked(log_)->mutex);
    throw_not_in_log(*log_, *stream_, column.series, first, kLargest);
  }
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

bool LoggedSession::get_latest_at(TimeIndex t, void* element, TimeIndex* index) const {
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
                [t](const StreamMessage& found) { return arrival_of(found.message) > t; });
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
  if (index != nullptr) *index = wanted;
  return true;
}

SeriesReader LoggedSession::read(const std::vector<Column>& columns, TimeIndex first,
                                 TimeIndex last) const {
  return {log_, stream_of(log_, stream_), columns, first, last};
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
  const Lock lock(checked(log_)->mutex);
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
  const Lock lock(checked(log_)->mutex);
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
