// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "conversion/errors.hpp"
#include "conversion/gil.hpp"
#include "conversion/series.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "docstrings.hpp"
#include "log.hpp"
#include "session/session_info.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using log::Log;
using log::LoggedSession;

template <class Function>
auto without_gil(const Function& function) {
  const GilRelease release;
  return function();
}

template <class T>
auto to_list(const std::vector<T>& values) {
  nb::typed<nb::list, decltype(to_python(values.front()))> list;
  for (const T& value : values) list.append(to_python(value));
  return list;
}

using Files = std::vector<std::filesystem::path>;
using ShownStep = Shown<"int">;
using ShownSeries = Shown<
    "collections.abc.Mapping[str, collections.abc.Sequence[str] | None] | "
    "collections.abc.Sequence[str]">;

nb::typed<nb::list, PythonLoggedSession> to_sessions(std::vector<LoggedSession> sessions,
                                                     const Files& files) {
  nb::list list;
  for (LoggedSession& session : sessions) {
    list.append(nb::cast(std::make_unique<PythonLoggedSession>(std::move(session), files)));
  }
  return list;
}

// Files for a process that may have another working directory.
nb::object to_absolute(Files files) {
  for (std::filesystem::path& file : files) file = std::filesystem::absolute(file);
  return to_list(files);
}

[[noreturn]] void throw_changed(const Files& files) {
  throw Error("the log " + files.front().string() +
              " was replaced by another one after it was pickled; open it again and pickle that");
}

// Pickles keep the names of the files and what tells that these are still the same log.

using PickledLog = std::tuple<nb::object, std::map<std::string, std::string>>;

PickledLog state_of(const Log& log) { return {to_absolute(log.files()), log.origin()}; }

void restore(Log& place, const PickledLog& state) {
  const Files files = to_paths(std::get<0>(state));
  const GilRelease release;
  Log log(files);
  if (log.origin() != std::get<1>(state)) throw_changed(files);
  new (&place) Log(std::move(log));
}

using PickledSession = std::tuple<nb::object, std::string, std::uint64_t>;

PickledSession state_of(const PythonLoggedSession& session) {
  const LoggedSession& logged = session.session();
  return {to_absolute(session.files()), logged.name(), logged.header().session_id};
}

void restore(PythonLoggedSession& place, const PickledSession& state) {
  const auto& [paths, state_name, state_id] = state;
  const Files files = to_paths(paths);
  // clang 14 lets no lambda use the names of a structured binding.
  const auto find = [&files, &name = state_name, session_id = state_id]() -> LoggedSession {
    const GilRelease release;
    for (const LoggedSession& robot : Log(files).sessions()) {
      if (robot.header().session_id != session_id) continue;
      return robot.name() == name ? robot : robot.companion(name);
    }
    throw_changed(files);
  };
  new (&place) PythonLoggedSession(find(), files);
}

nb::object tables() { return nb::module_::import_("trifinger.log.tables"); }

// Returns a method that writes a file: trifinger.log.tables.NAME(session, ...).
auto exported(const char* name) {
  return [name](nb::handle session, const ShownPath& path, const ShownStep& first,
                const ShownStep& last, const ShownSeries& series) {
    tables().attr(name)(session, path, first, last, series);
  };
}

// Reads the four series in the same way: all steps, one element by its step, or a range of steps.
void bind_series(nb::class_<PythonLoggedSession>& type) {
  for (const SeriesNames& names : kSeriesNames) {
    const Series series = names.series;
    const std::string array = " -> numpy.typing.NDArray[" + names.type + "]";
    type.def_prop_ro(
        names.many.c_str(),
        [series](PythonLoggedSession& session) { return session.series(series); },
        nb::sig(("def " + names.many + "(self)" + array).c_str()),
        "The elements of all whole steps: a row for each number in `time_index`. They are read at "
        "the\n"
        "first request and kept.");
    type.def(("get_" + names.one).c_str(),
             [series](const PythonLoggedSession& session, TimeIndex t) {
               return session.get(series, t);
             },
             "t"_a, nb::sig(("def get_" + names.one + "(self, t: int) -> " + names.type).c_str()),
             "Returns the element of step `t`. Raises NotInLog if it is missing.");
    type.def(
        ("get_" + names.many).c_str(),
        [series](const PythonLoggedSession& session, TimeIndex first, TimeIndex last,
                 nb::handle fields) { return session.get_many(series, first, last, fields); },
        "first"_a, "last"_a, "fields"_a = nb::none(),
        nb::sig(("def get_" + names.many +
                 "(self, first: int, last: int, fields: str | collections.abc.Sequence[str] | None "
                 "= None)" +
                 array)
                    .c_str()),
        R"(Returns the steps from `first` to before `last`, with only these `fields` if given. Row
i is step `first + i`, so all steps must be in the log.

If the session ended in step N, the log has an observation and a status N, but no actions N.)");
  }
}

void bind_logged_session(nb::module_& m) {
  const auto header = [](auto member) {
    return
        [member](const PythonLoggedSession& session) { return session.session().header().*member; };
  };

  nb::class_<PythonLoggedSession> type(
      m, "LoggedSession",
      also(docs::LoggedSession::LoggedSession,
           R"(    session = trifinger.Log("run.mcap").session("sim")
    session.observations["position"]             # all steps
    session.get_observations(1000, 2000)         # like those of a front-end
    session.get_observations(*session.between(1.5, 3.0), fields=("position",))
    for steps in session.chunks():               # a log larger than memory
        steps.time_index, steps.observations, steps.applied_actions)"));
  type.def("__getstate__", [](const PythonLoggedSession& session) { return state_of(session); })
      .def("__setstate__",
           [](PythonLoggedSession& place, const PickledSession& state) { restore(place, state); })
      .def("__repr__",
           [](const PythonLoggedSession& session) {
             const log::LoggedSession& logged = session.session();
             const std::string steps = !logged.steps() ? "not ended"
                                       : *logged.steps() == 1
                                           ? "1 step"
                                           : std::to_string(*logged.steps()) + " steps";
             const std::string text = "<LoggedSession of '" + logged.name() + "', " + logged.type();
             return to_text(logged.is_companion() ? text + ">" : text + ", " + steps + ">");
           })
      .def_prop_ro(
          "name", [](const PythonLoggedSession& session) { return session.session().name(); },
          docs::LoggedSession::name)
      .def_prop_ro(
          "type", [](const PythonLoggedSession& session) { return session.session().type(); },
          docs::LoggedSession::type)
      .def_prop_ro(
          "is_companion",
          [](const PythonLoggedSession& session) { return session.session().is_companion(); })
      .def_prop_ro("session_id", header(&log::SessionHeader::session_id))
      .def_prop_ro("is_real_time", header(&log::SessionHeader::is_real_time))
      .def_prop_ro("realtime_warnings", header(&log::SessionHeader::realtime_warnings),
                   docs::log::SessionHeader::realtime_warnings)
      .def_prop_ro(
          "period",
          [](const PythonLoggedSession& session) {
            return to_seconds(session.session().header().period);
          },
          "Length of the robot's steps [s].")
      .def_prop_ro(
          "created",
          [](const PythonLoggedSession& session) {
            return static_cast<double>(session.session().header().created) * 1e-9;
          },
          "When the session began, seconds since 1970.")
      .def_prop_ro("host", header(&log::SessionHeader::host))
      .def_prop_ro("backend_pid", header(&log::SessionHeader::backend_pid))
      .def_prop_ro(
          "documents",
          [](const PythonLoggedSession& session) {
            return to_python(session.session().header().documents);
          },
          docs::Session::documents)
      .def_prop_ro(
          "steps", [](const PythonLoggedSession& session) { return session.session().steps(); },
          docs::LoggedSession::steps)
      .def_prop_ro(
          "fault",
          [](const PythonLoggedSession& session) {
            return to_python(std::optional(session.session().fault()));
          },
          docs::LoggedSession::fault)
      .def_prop_ro(
          "fault_text",
          [](const PythonLoggedSession& session) {
            return to_text(session.session().fault_text());
          },
          docs::LoggedSession::fault_text)
      .def_prop_ro(
          "gaps",
          [](const PythonLoggedSession& session) {
            return to_list(without_gil([&] { return session.session().gaps(); }));
          },
          docs::LoggedSession::gaps)

      .def_prop_ro(
          "time_index", &PythonLoggedSession::time_index,
          "The whole steps that are in the log; for a companion, the numbers of its elements.")
      .def_prop_ro("times", &PythonLoggedSession::times,
                   "Times at which the observations were measured, by the wall clock (UTC).")

      .def("get_latest_at", &PythonLoggedSession::get_latest_at, "t"_a,
           R"(For companions: returns the newest element that arrived at or before the robot's step
`t`. None if none had arrived by then.)")
      .def("range", &PythonLoggedSession::range, "series"_a, docs::LoggedSession::range)
      .def("between", &PythonLoggedSession::between, "begin"_a, "end"_a,
           also(docs::LoggedSession::between, R"(Both are in seconds.)"))
      .def(
          "timing",
          [](const PythonLoggedSession& session, TimeIndex first, std::optional<TimeIndex> last) {
            const TimeIndex end = last.value_or(std::numeric_limits<TimeIndex>::max());
            return without_gil([&] { return session.session().timing(first, end); });
          },
          "first"_a = 0, "last"_a = nb::none(), docs::LoggedSession::timing)
      .def(
          "read",
          [](const PythonLoggedSession& session, const ShownStep& first, const ShownStep& last,
             const ShownSeries& series) {
            return PythonSteps(session.session(), series, first, last, 1).read_all();
          },
          "first"_a = nb::none(), "last"_a = nb::none(), "series"_a = nb::none(),
          also(
              docs::LoggedSession::read,
              R"(Reading several series at once takes no longer than reading one. `series` are names,
"desired_action", "applied_action", "observation" and "status", or a dict of names and fields:
`{"observation": ("position",), "status": None}`.)"))
      .def(
          "chunks",
          [](const PythonLoggedSession& session, std::size_t count, const ShownStep& first,
             const ShownStep& last, const ShownSeries& series) {
            return std::make_unique<PythonSteps>(session.session(), series, first, last, count);
          },
          "count"_a = 10'000, "first"_a = nb::none(), "last"_a = nb::none(),
          "series"_a = nb::none(),
          "Reads like read(), but `count` rows at a time, for a log larger than memory.")

      .def_prop_ro(
          "companions",
          [](const PythonLoggedSession& session) {
            return to_sessions(session.session().companions(), session.files());
          },
          docs::LoggedSession::companions)
      .def(
          "companion",
          [](const PythonLoggedSession& session, const std::string& name) {
            return std::make_unique<PythonLoggedSession>(session.session().companion(name),
                                                         session.files());
          },
          "name"_a, docs::LoggedSession::companion)
      .def_prop_ro(
          "units",
          [](const PythonLoggedSession& session) {
            nb::dict units;
            for (const Series each : kSeries) {
              if (session.session().is_companion() && each != Series::kObservation) continue;
              nb::dict fields;
              for (const FieldDescription& field : session.session().element(each).fields()) {
                fields[field.name.c_str()] = field.unit;
              }
              units[nb::str(name_of(each).data(), name_of(each).size())] = fields;
            }
            return units;
          },
          nb::sig("def units(self) -> dict[str, dict[str, str]]"),
          R"(Units of the fields of each series: `units["observation"]["position"]` is "rad".)")

      .def(
          "to_pandas",
          [](nb::handle session, const ShownStep& first, const ShownStep& last,
             const ShownSeries& series) {
            return Shown<"pandas.DataFrame">(
                tables().attr("to_pandas")(session, first, last, series));
          },
          "first"_a = nb::none(), "last"_a = nb::none(), "series"_a = nb::none(),
          R"(Reads like read() into a pandas.DataFrame: a row per step, a column per number, for
example "observation.position[0]". Needs the extra "export".)")
      .def("to_csv", exported("to_csv"), "path"_a, "first"_a = nb::none(), "last"_a = nb::none(),
           "series"_a = nb::none(),
           "Writes the table of to_pandas() to a CSV file, in parts, so that it may be larger than "
           "memory.")
      .def("to_parquet", exported("to_parquet"), "path"_a, "first"_a = nb::none(),
           "last"_a = nb::none(), "series"_a = nb::none(),
           "Writes the table of to_pandas() to a Parquet file, in parts.");
  bind_series(type);
  bind_dtypes(type);
}

}  // namespace

void bind_log(nb::module_& m) {
  // Users cannot make one; `chunks` returns it.
  nb::class_<PythonSteps>(m, "StepsIterator", "Iterator that LoggedSession.chunks() returns.")
      .def(
          "__iter__", [](nb::object self) { return self; },
          nb::sig("def __iter__(self) -> StepsIterator"))
      .def("__next__", &PythonSteps::next);
  bind_logged_session(m);

  nb::class_<Log>(
      m, "Log",
      also(docs::Log::Log,
           R"(`path` is a file, a list of its parts, or a folder, whose newest recording is taken.

Raises Error if it is not a log or is one of a later version; InvalidArgument if a folder has no
recording or the parts belong to several recordings; OSError.)"))
      .def(
          "__init__",
          [](Log* place,
             const Shown<
                 "str | os.PathLike[str] | collections.abc.Sequence[str | os.PathLike[str]]">&
                 path) {
            const std::vector<std::filesystem::path> paths = to_paths(path);
            const GilRelease release;
            if (paths.size() == 1) {
              new (place) Log(paths.front());
            } else {
              new (place) Log(paths);
            }
          },
          "path"_a)
      .def("__getstate__", [](const Log& log) { return state_of(log); })
      .def("__setstate__", [](Log& place, const PickledLog& state) { restore(place, state); })
      .def("__repr__",
           [](const Log& log) {
             const auto& files = log.files();
             const std::string parts =
                 files.size() == 1 ? "" : ", " + std::to_string(files.size()) + " parts";
             return to_text("<Log of '" + files.front().string() + "'" + parts + ">");
           })
      .def_prop_ro(
          "files", [](const Log& log) { return to_list(log.files()); }, docs::Log::files)
      .def_prop_ro("size", &Log::size, docs::Log::size)
      .def_prop_ro("is_finished", &Log::is_finished, docs::Log::is_finished)
      .def_prop_ro("origin", &Log::origin, docs::Log::origin)
      .def_prop_ro(
          "sessions", [](const Log& log) { return to_sessions(log.sessions(), log.files()); },
          docs::Log::sessions)
      .def(
          "session",
          [](const Log& log, const std::string& name) {
            return std::make_unique<PythonLoggedSession>(log.session(name), log.files());
          },
          "name"_a = "", docs::Log::session)
      .def_prop_ro(
          "events",
          [](const Log& log) { return to_list(without_gil([&] { return log.events(); })); },
          docs::Log::events)
      .def_prop_ro(
          "damage",
          [](const Log& log) { return to_list(without_gil([&] { return log.damage(); })); },
          docs::Log::damage)
      .def_prop_ro(
          "lost_bytes",
          [](const Log& log) { return without_gil([&] { return log.lost_bytes(); }); },
          docs::Log::lost_bytes);
}

}  // namespace trifinger::bindings
