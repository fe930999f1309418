// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/unique_ptr.h>

#include <map>
#include <string>

#include "bindings.hpp"
#include "conversion/errors.hpp"
#include "conversion/garbage.hpp"
#include "conversion/series.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "conversion/with.hpp"
#include "docstrings.hpp"
#include "frontend.hpp"
#include "session_info.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

// A back-end whose user was ended by a signal needs up to half a second to begin a new session. A
// slice must be longer than that.
constexpr Nanoseconds kAttachSlice = std::chrono::milliseconds(600);

// All four series are read in the same way: one element by its step, many by a range of steps.
void bind_series(nb::class_<PythonFrontend>& type) {
  const std::map<Series, const char*> comments{
      {Series::kObservation, docs::Frontend::get_observation},
      {Series::kDesiredAction, docs::Frontend::get_desired_action},
      {Series::kAppliedAction, docs::Frontend::get_applied_action},
      {Series::kStatus, docs::Frontend::get_status}};
  for (const SeriesNames& names : kSeriesNames) {
    const Series series = names.series;
    const std::string returns = "timeout: float | None = None) -> ";
    type.def(("get_" + names.one).c_str(),
             [series](const PythonFrontend& frontend, TimeIndex t, const ShownSeconds& timeout) {
               return frontend.get(series, t, timeout);
             },
             "t"_a, "timeout"_a = nb::none(),
             nb::sig(("def get_" + names.one + "(self, t: int, " + returns + names.type).c_str()),
             comments.at(series));
    type.def(("get_" + names.many).c_str(),
             [series](const PythonFrontend& frontend, TimeIndex first, TimeIndex last,
                      const ShownSeconds& timeout) {
               return frontend.get_many(series, first, last, timeout);
             },
             "first"_a, "last"_a, "timeout"_a = nb::none(),
             nb::sig(("def get_" + names.many + "(self, first: int, last: int, " + returns +
                      "numpy.typing.NDArray[" + names.type + "]")
                         .c_str()),
             "Returns the steps from `first` to before `last`; waits for the last one.");
  }
}

}  // namespace

std::unique_ptr<PythonFrontend> attach(const std::string& name, FrontendOptions options,
                                       nb::handle timeout) {
  UntypedFrontend frontend = in_slices(
      to_timeout(timeout),
      [&](Timeout slice) {
        options.timeout = slice;
        return UntypedFrontend(name, options);
      },
      kAttachSlice);
  return std::make_unique<PythonFrontend>(std::move(frontend),
                                          PythonFrontend::Role{.controls = options.control});
}

void bind_frontend(nb::module_& m) {
  nb::class_<PythonFrontend> type(
      m, "Frontend", nb::type_slots(garbage_collected<PythonFrontend>()),
      also(
          docs::Frontend::Frontend,
          R"(`y.position` and `y["position"]` read a field of an Element. Ranges of steps `ys` are structured
arrays of NumPy; `ys["position"]` is the field of all steps.

`timeout` is in seconds; None waits as long as it takes. Waits end with Ctrl-C, too.

A `with` block calls finish() at its end. If the block raises an exception, it calls close()
instead.)"));
  type.def(
          "append_desired_action", &PythonFrontend::append_desired_action, "action"_a.none(),
          "timeout"_a = nb::none(),
          nb::sig("def append_desired_action(self, action: Action, timeout: float | None = None) "
                  "-> int"),
          also(
              docs::Frontend::append_desired_action,
              R"(Raises InvalidArgument for anything but an action of this robot: see new_action.)"))
      .def("append_desired_actions", &PythonFrontend::append_desired_actions, "actions"_a.none(),
           "timeout"_a = nb::none(),
           nb::sig("def append_desired_actions(self, actions: numpy.typing.NDArray[Action], "
                   "timeout: float | None = None) -> int"),
           also(docs::Frontend::append_desired_actions,
                R"(`actions` are a one-dimensional array of `action_dtype`.)"))
      .def(
          "set_on_late", &PythonFrontend::set_on_late, "on_late"_a,
          nb::sig("def set_on_late(self, on_late: typing.Literal['nothing', 'repeat', 'hold']) -> "
                  "None"),
          R"(Says what happens from now on if no action is there when nine tenths of the period before its step
are over, in real-time mode: "nothing", so that the back-end repeats the last action or ends the
session; "repeat", so that the last action acts on; "hold", so that it acts on for 10 ms, at least a
step, and then the robot is held where it is. A thread does this, which needs nothing of Python: so
the program can think as long as it likes. What it appends next is delayed once more, by the time
that it was late, and at most by 10 ms. Nothing happens before the first action and after finish().
Raises InvalidArgument for a handle that only observes, and for "hold" if the robot has no joint
positions; ControlHeld if another thread is appending.)")
      .def("is_late", &PythonFrontend::is_late, docs::UntypedFrontend::is_late)
      .def("new_action", &PythonFrontend::new_action, "fields"_a,
           nb::sig("def new_action(self, **fields: numpy.typing.ArrayLike) -> Action"),
           R"(Returns the robot's default action with `fields` filled in; a number fills the whole
field. The action can be changed and appended as often as you like.)")
      .def("latest_observation", &PythonFrontend::latest_observation, "timeout"_a = nb::none(),
           docs::Frontend::latest_observation)
      .def("get_latest_at", &PythonFrontend::get_latest_at, "t"_a, "timeout"_a = nb::none(),
           also(docs::Companion::get_latest_at, R"(Only companions have this.)"))
      .def("payload", &PythonFrontend::payload, "element"_a.none(),
           nb::sig("def payload(self, element: Observation) -> Payload"),
           also(docs::Companion::payload, R"(Only companions have this.)"))
      .def("wait_until_time_index", &PythonFrontend::wait_until_time_index, "t"_a,
           "timeout"_a = nb::none(), docs::Frontend::wait_until_time_index)
      .def("current_time_index", &PythonFrontend::current_time_index,
           docs::Frontend::current_time_index)
      .def(
          "range",
          [](const PythonFrontend& frontend, const std::string& series) {
            return frontend.range(series_of(series));
          },
          "series"_a,
          also(
              docs::UntypedFrontend::range,
              R"(Example: `robot.get_observations(*robot.range("observation"))`. Series are "desired_action",
"applied_action", "observation" and "status".)"))
      .def("finish", &PythonFrontend::finish, "timeout"_a = nb::none(), docs::Frontend::finish)
      .def("recover", &PythonFrontend::recover, "timeout"_a = nb::none(), docs::Frontend::recover)
      .def(
          "fault", [](const PythonFrontend& frontend) { return to_python(frontend.fault()); },
          docs::Frontend::fault)
      .def("timing", &PythonFrontend::timing, docs::Frontend::timing)
      .def("companion", &PythonFrontend::companion, "name"_a, docs::Frontend::companion)
      .def(
          "session_info",
          [](const PythonFrontend& frontend) { return to_python(frontend.session_info()); },
          docs::SessionInfo::SessionInfo)
      .def(
          "documents",
          [](const PythonFrontend& frontend) { return to_python(frontend.documents()); },
          docs::Session::documents)
      .def("close", &PythonFrontend::close,
           R"(Gives the session and its control back. If actions were appended and the session still
runs, it ends ("detached").)")
      .def("__repr__", &PythonFrontend::text);
  bind_series(type);
  bind_dtypes(type);
  bind_with(type, "Frontend",
            [](PythonFrontend& frontend, bool is_clean) { frontend.exit(is_clean); });

  m.def(
      "connect",
      [](const std::string& name, bool strict, const ShownSeconds& timeout) {
        return attach(name, {.control = true, .strict = strict}, timeout);
      },
      "name"_a, nb::kw_only(), "strict"_a = false, "timeout"_a.none() = 5.0,
      also(
          docs::connect,
          R"(With `strict`, an action that comes after its step was read is an error (AcausalAction) instead of
a mark in the status. `timeout` is how long to wait for a session that is about to begin [s].)"));

  m.def(
      "observe",
      [](const std::string& name) { return attach(name, {.control = false}, nb::none()); },
      "name"_a,
      also(docs::observe, R"(`name` may also be that of a companion, for example "sim.object".)"));
}

}  // namespace trifinger::bindings
