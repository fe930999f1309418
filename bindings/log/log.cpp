// SPDX-License-Identifier: BSD-3-Clause
#include "log.hpp"

#include <algorithm>
#include <limits>

#include "conversion/element.hpp"
#include "conversion/gil.hpp"
#include "conversion/numbers.hpp"
#include "conversion/series.hpp"
#include "conversion/text.hpp"
#include "trifinger/base/error.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

constexpr std::size_t kBlock = 1U << 16U;  // rows between checks for Ctrl-C

nb::object types() { return nb::module_::import_("trifinger.log.types"); }

std::vector<std::string> to_fields(nb::handle fields) {
  if (fields.is_none()) return {};
  if (nb::isinstance<nb::str>(fields)) return {nb::cast<std::string>(fields)};
  std::vector<std::string> names;
  for (const nb::handle name : nb::iter(fields)) names.push_back(nb::cast<std::string>(name));
  if (names.empty()) throw InvalidArgument("fields is empty; None stands for all");
  return names;
}

std::vector<log::Column> to_columns(const log::LoggedSession& session, nb::handle series) {
  std::vector<log::Column> columns;
  if (series.is_none()) {
    if (session.is_companion()) return {log::Column{}};
    for (const Series each : kSeries) columns.push_back({each, {}});
    return columns;
  }
  const auto add = [&columns](nb::handle name, std::vector<std::string> fields) {
    const Series each = series_of(nb::cast<std::string>(name));
    for (const log::Column& column : columns) {
      if (column.series == each) {
        throw InvalidArgument("series '" + std::string(name_of(each)) + "' is there twice");
      }
    }
    columns.push_back({each, std::move(fields)});
  };
  if (nb::isinstance<nb::str>(series)) {
    add(series, {});
  } else if (nb::isinstance<nb::dict>(series)) {
    for (const auto [name, fields] : nb::borrow<nb::dict>(series)) add(name, to_fields(fields));
  } else {
    for (const nb::handle name : nb::iter(series)) add(name, {});
  }
  if (columns.empty()) throw InvalidArgument("series is empty; None stands for all");
  return columns;
}

TimeIndex to_index(nb::handle index, TimeIndex otherwise) {
  return index.is_none() ? otherwise : nb::cast<TimeIndex>(index);
}

ElementType type_of(const log::LoggedSession& session, Series series) {
  const ElementDescription& element = session.element(series);
  if (!element.fields().empty()) return ElementType(element, class_of(series));
  throw log::NotInLog("the log has no elements of '" + session.name() + "'");
}

log::SeriesReader reader_of(const log::LoggedSession& session,
                            const std::vector<log::Column>& columns, TimeIndex first,
                            TimeIndex last) {
  const GilRelease release;
  return session.read(columns, first, last);
}

// A one-dimensional array of NumPy and its numbers.
std::pair<nb::object, std::int64_t*> new_numbers(std::size_t count) {
  auto [array, memory] = new_array({static_cast<npy_intp>(count)}, NPY_INT64);
  return {std::move(array), static_cast<std::int64_t*>(memory)};
}

// Returns the first `rows` of `array`. If it has more, the result is a copy that does not keep the
// rest in memory.
nb::object trimmed(const nb::object& array, std::size_t rows) {
  if (nb::len(array) == rows) return array;
  return array[nb::slice(static_cast<Py_ssize_t>(rows))].attr("copy")();
}

nb::object to_datetime(const nb::object& nanoseconds) {
  return nanoseconds.attr("view")("datetime64[ns]");
}

void forbid_writing(const nb::object& array) { array.attr("setflags")("write"_a = false); }

const char* plural_of(Series series) {
  return std::ranges::find(kSeriesNames, series, &SeriesNames::series)->many.c_str();
}

}  // namespace

// ---- Steps ----

PythonSteps::PythonSteps(const log::LoggedSession& session, nb::handle series, nb::handle first,
                         nb::handle last, std::size_t count)
    : columns_(to_columns(session, series)),
      reader_(reader_of(session, columns_, to_index(first, 0),
                        to_index(last, std::numeric_limits<TimeIndex>::max()))),
      count_(count) {
  if (count == 0) throw InvalidArgument("count is 0, must be at least 1");
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    (void)type_of(session, columns_[i].series);
    types_.emplace_back(reader_.element(i), class_of(columns_[i].series));
  }
}

std::pair<nb::object, std::size_t> PythonSteps::read(std::size_t count) {
  auto [indices, index] = new_numbers(count);
  auto [times, time] = new_numbers(count);
  std::vector<nb::object> arrays;
  std::vector<std::byte*> memory;
  for (const ElementType& type : types_) {
    auto [array, bytes] = type.new_array(count);
    arrays.push_back(std::move(array));
    memory.push_back(bytes);
  }
  std::size_t done = 0;
  while (done < count) {
    const std::size_t wanted = std::min(kBlock, count - done);
    std::vector<void*> rows;
    rows.reserve(memory.size());
    for (std::size_t i = 0; i < memory.size(); ++i) {
      rows.push_back(memory[i] + done * types_[i].size());
    }
    std::size_t found = 0;
    {
      const GilRelease release;
      found = reader_.read(wanted, {index + done, time + done, rows});
    }
    done += found;
    if (found < wanted) break;
    check_signals();
  }
  nb::dict parts;
  parts["time_index"] = trimmed(indices, done);
  parts["times"] = to_datetime(trimmed(times, done));
  for (std::size_t i = 0; i < arrays.size(); ++i) {
    parts[plural_of(columns_[i].series)] = trimmed(arrays[i], done);
  }
  return {types().attr("Steps")(**parts), done};
}

ShownSteps PythonSteps::next() {
  auto [steps, count] = read(std::min(count_, std::max<std::size_t>(reader_.max_rows(), 1)));
  if (count == 0) throw nb::stop_iteration();
  return std::move(steps);
}

ShownSteps PythonSteps::read_all() { return read(reader_.max_rows()).first; }

// ---- PythonLoggedSession ----

nb::object PythonLoggedSession::series(Series series) {
  nb::object& kept = series_[series];
  if (!kept.is_valid()) {
    PythonSteps steps(session_, to_str(name_of(series)), nb::none(), nb::none(), kBlock);
    nb::object array = steps.read_all().attr(plural_of(series));
    forbid_writing(array);
    kept = std::move(array);
  }
  return kept;
}

void PythonLoggedSession::read_indices() {
  if (time_index_.is_valid()) return;
  log::SeriesReader reader = reader_of(session_, {}, 0, std::numeric_limits<TimeIndex>::max());
  const std::size_t count = reader.max_rows();
  auto [indices, index] = new_numbers(count);
  auto [times, time] = new_numbers(count);
  std::size_t done = 0;
  {
    const GilRelease release;
    done = reader.read(count, {index, time, {}});
  }
  time_index_ = trimmed(indices, done);
  times_ = to_datetime(trimmed(times, done));
  forbid_writing(time_index_);
  forbid_writing(times_);
}

Shown<"numpy.typing.NDArray[numpy.int64]"> PythonLoggedSession::time_index() {
  read_indices();
  return time_index_;
}

Shown<"numpy.typing.NDArray[numpy.datetime64]"> PythonLoggedSession::times() {
  read_indices();
  return times_;
}

nb::object PythonLoggedSession::get(Series series, TimeIndex t) const {
  auto [element, memory] = type_of(session_, series).new_element();
  const GilRelease release;
  session_.get(series, t, 1, memory);
  return std::move(element);
}

nb::object PythonLoggedSession::get_many(Series series, TimeIndex first, TimeIndex last,
                                         nb::handle fields) const {
  if (last < first) {
    throw InvalidArgument("last is " + std::to_string(last) + ", must be at least first, " +
                          std::to_string(first));
  }
  (void)type_of(session_, series);
  const auto [begin, end] = range(std::string(name_of(series)));
  // Checked before memory is allocated: steps out of range are not in the log.
  if (first < last && (first < begin || last > end))
    (void)get(series, first < begin ? first : last - 1);
  const log::Column column{series, to_fields(fields)};
  const ElementDescription& whole = session_.element(series);
  const ElementType type(column.fields.empty() ? whole : log::select(whole, column.fields),
                         class_of(column.series));
  const auto count = static_cast<std::size_t>(last - first);
  auto [array, memory] = type.new_array(count);
  const GilRelease release;
  session_.get(column, first, count, memory);
  return std::move(array);
}

Shown<"Observation | None"> PythonLoggedSession::get_latest_at(TimeIndex t) const {
  if (!session_.has_elements()) return nb::none();
  auto [element, memory] = type_of(session_, Series::kObservation).new_element();
  bool is_there = false;
  {
    const GilRelease release;
    is_there = session_.get_latest_at(t, memory);
  }
  if (!is_there) return nb::none();
  return element;
}

std::pair<TimeIndex, TimeIndex> PythonLoggedSession::range(const std::string& series) const {
  const Series each = series_of(series);
  const GilRelease release;
  return session_.range(each);
}

std::pair<TimeIndex, TimeIndex> PythonLoggedSession::between(double begin, double end) const {
  if (!(begin <= end)) throw InvalidArgument("the end must not lie before the beginning");
  const auto to_time = [](double seconds) {
    constexpr double kMost = 9e9;  // [s]: limit of nanoseconds in 64 bits
    return Nanoseconds(static_cast<std::int64_t>(std::clamp(seconds, 0.0, kMost) * 1e9));
  };
  const GilRelease release;
  return session_.between(to_time(begin), to_time(end));
}

nb::object PythonLoggedSession::dtype(Series series) const {
  return type_of(session_, series).dtype();
}

// ---- conversions ----

std::vector<std::filesystem::path> to_paths(nb::handle path) {
  if (!nb::isinstance<nb::list>(path) && !nb::isinstance<nb::tuple>(path)) return {to_path(path)};
  std::vector<std::filesystem::path> paths;
  for (const nb::handle one : nb::iter(path)) paths.push_back(to_path(one));
  return paths;
}

Shown<"trifinger.log.types.Gap"> to_python(const log::Gap& gap) {
  return types().attr("Gap")(gap.first, gap.last, to_text(gap.reason));
}

Shown<"trifinger.log.types.Event"> to_python(const log::Event& event) {
  using log::Level;
  const char* const level = event.level >= Level::kError     ? "error"
                            : event.level >= Level::kWarning ? "warning"
                                                             : "info";
  return types().attr("Event")(static_cast<double>(event.time) * 1e-9, level, to_text(event.source),
                               to_text(event.text));
}

Shown<"trifinger.log.types.Damage"> to_python(const log::Damage& damage) {
  return types().attr("Damage")(to_python(damage.file), damage.offset, damage.size, damage.reason);
}

}  // namespace trifinger::bindings
