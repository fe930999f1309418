// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "conversion/element_type.hpp"
#include "conversion/shown.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::bindings {

using ShownSteps = Shown<"trifinger.log.types.Steps">;

/// Rows of several series that are read at once.
class PythonSteps {
 public:
  /// `series` is a name, several names, or a dict of names and fields; None for all series.
  PythonSteps(const log::LoggedSession& session, nanobind::handle series, nanobind::handle first,
              nanobind::handle last, std::size_t count);

  /// The next rows, as trifinger.Steps. @throws nanobind::stop_iteration at the end
  [[nodiscard]] ShownSteps next();
  /// All rows.
  [[nodiscard]] ShownSteps read_all();

 private:
  [[nodiscard]] std::pair<nanobind::object, std::size_t> read(std::size_t count);

  std::vector<log::Column> columns_;
  std::vector<ElementType> types_;
  log::SeriesReader reader_;
  std::size_t count_;
};

/// A session in a log, for Python. The GIL is released while files are read.
class PythonLoggedSession {
 public:
  /// `files` are those of its log.
  PythonLoggedSession(log::LoggedSession session, std::vector<std::filesystem::path> files)
      : session_(std::move(session)), files_(std::move(files)) {}

  [[nodiscard]] const log::LoggedSession& session() const noexcept { return session_; }
  [[nodiscard]] const std::vector<std::filesystem::path>& files() const noexcept { return files_; }

  /// All whole steps. They are read once and kept, so the array is read-only.
  [[nodiscard]] nanobind::object series(Series series);
  [[nodiscard]] Shown<"numpy.typing.NDArray[numpy.int64]"> time_index();
  [[nodiscard]] Shown<"numpy.typing.NDArray[numpy.datetime64]"> times();

  [[nodiscard]] nanobind::object get(Series series, TimeIndex t) const;
  [[nodiscard]] nanobind::object get_many(Series series, TimeIndex first, TimeIndex last,
                                          nanobind::handle fields) const;
  [[nodiscard]] Shown<"Observation | None"> get_latest_at(TimeIndex t) const;
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range(const std::string& series) const;
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> between(double begin, double end) const;
  [[nodiscard]] nanobind::object dtype(Series series) const;

 private:
  void read_indices();

  log::LoggedSession session_;
  std::vector<std::filesystem::path> files_;
  std::map<Series, nanobind::object> series_;
  nanobind::object time_index_;
  nanobind::object times_;
};

/// Converts one path or several.
[[nodiscard]] std::vector<std::filesystem::path> to_paths(nanobind::handle path);
/// Converts entries of a log to the classes of trifinger.log.types.
[[nodiscard]] Shown<"trifinger.log.types.Gap"> to_python(const log::Gap& gap);
[[nodiscard]] Shown<"trifinger.log.types.Event"> to_python(const log::Event& event);
[[nodiscard]] Shown<"trifinger.log.types.Damage"> to_python(const log::Damage& damage);

}  // namespace trifinger::bindings
