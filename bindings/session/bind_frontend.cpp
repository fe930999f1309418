// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/unique_ptr.h>

#include <string>

#include "bindings.hpp"
#include "conversion/errors.hpp"
#include "conversion/garbage.hpp"
#include "conversion/series.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "frontend.hpp"
#include "session_info.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

// A back-end whose user was ended by a signal needs up to half a second to begin a new session. A
// slice must be longer than that.
constexpr Nanoseconds kAttachSlice = std::chrono::milliseconds(600);

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

}  // namespace

void bind_frontend(nb::module_& m) {
  // All four series are read in the same way: one element by its step, many by a range of steps.
  const auto get = [](Series series) {
    return [series](const PythonFrontend& frontend, TimeIndex t, nb::handle timeout) {
      return frontend.get(series, t, timeout);
    };
  };
  const auto get_many = [](Series series) {
    return [series](const PythonFrontend& frontend, TimeIndex first, TimeIndex last,
                    nb::handle timeout) { return frontend.get_many(series, first, last, timeout); };
  };
  const auto dtype = [](Series series) {
    return [series](const PythonFrontend& frontend) { return frontend.dtype(series); };
  };

  nb::class_<PythonFrontend>(
      m, "Frontend", nb::type_slots(garbage_collected<PythonFrontend>()),
      R"(The user's view of a running robot: append desired actions, read back what happened.

Reading step t waits until the back-end has filled it in. A loop that reads y[t] and appends
a[t+1] is therefore paced by the robot and needs no sleep of its own.

`y.position` and `y["position"]` read a field of an Element. Ranges of steps `ys` are structured
arrays of NumPy; `ys["position"]` is the field of all steps.

Any number of threads may read; one thread appends. Every wait ends with the value, with TimedOut,
with Ctrl-C, or with RobotStopped if the session has ended and the value will never come. `timeout`
is in seconds; None waits as long as it takes. A handle that went through os.fork() raises
InheritedHandle.

A `with` block calls finish() at its end. If the block raises an exception, it calls close()
instead.)")
      .def("append_desired_action", &PythonFrontend::append_desired_action, "action"_a.none(),
           "timeout"_a = nb::none(),
           nb::sig("def append_desired_action(self, action: Action, timeout: float | None = None) "
                   "-> int"),
           R"(Appends `action` and returns the step for which it is scheduled. This is the next step
or, if the user's loop is late, the first step that is still open. The first call starts step 0. The
call waits only if the queue is full.

Raises RobotStopped, TimedOut, AcausalAction if strict, InvalidArgument for anything but an action
of this robot: see new_action.)")
      .def("append_desired_actions", &PythonFrontend::append_desired_actions, "actions"_a.none(),
           "timeout"_a = nb::none(),
           nb::sig("def append_desired_actions(self, actions: numpy.typing.NDArray[Action], "
                   "timeout: float | None = None) -> int"),
           R"(Appends several actions, one per step: the elements of a one-dimensional array of
`action_dtype`. Returns the step of the last one.)")
      .def("new_action", &PythonFrontend::new_action, "fields"_a,
           nb::sig("def new_action(self, **fields: numpy.typing.ArrayLike) -> Action"),
           R"(Returns the robot's default action with `fields` filled in; a number fills the whole
field. The action can be changed and appended as often as you like.)")
      .def(
          "get_observation", get(Series::kObservation), "t"_a, "timeout"_a = nb::none(),
          nb::sig("def get_observation(self, t: int, timeout: float | None = None) -> Observation"),
          R"(Returns y[t]; waits for it if `t` lies in the future.

Raises HistoryLost if y[t] was already overwritten, RobotStopped if it will never come, TimedOut.)")
      .def("get_desired_action", get(Series::kDesiredAction), "t"_a, "timeout"_a = nb::none(),
           nb::sig("def get_desired_action(self, t: int, timeout: float | None = None) -> Action"),
           R"(Returns a[t] as the back-end took it. This and the functions below raise like
get_observation.)")
      .def("get_applied_action", get(Series::kAppliedAction), "t"_a, "timeout"_a = nb::none(),
           nb::sig("def get_applied_action(self, t: int, timeout: float | None = None) -> "
                   "AppliedAction"),
           "Returns a'[t], the applied action.")
      .def("get_status", get(Series::kStatus), "t"_a, "timeout"_a = nb::none(),
           nb::sig("def get_status(self, t: int, timeout: float | None = None) -> StatusElement"),
           "Returns the status that the back-end has written for step t.")
      .def(
          "get_observations", get_many(Series::kObservation), "first"_a, "last"_a,
          "timeout"_a = nb::none(),
          nb::sig("def get_observations(self, first: int, last: int, timeout: float | None = None) "
                  "-> numpy.typing.NDArray[Observation]"),
          "Returns the steps from `first` to before `last`; waits for the last one.")
      .def("get_desired_actions", get_many(Series::kDesiredAction), "first"_a, "last"_a,
           "timeout"_a = nb::none(),
           nb::sig(
               "def get_desired_actions(self, first: int, last: int, timeout: float | None = None) "
               "-> numpy.typing.NDArray[Action]"))
      .def("get_applied_actions", get_many(Series::kAppliedAction), "first"_a, "last"_a,
           "timeout"_a = nb::none(),
           nb::sig(
               "def get_applied_actions(self, first: int, last: int, timeout: float | None = None) "
               "-> numpy.typing.NDArray[AppliedAction]"))
      .def("get_statuses", get_many(Series::kStatus), "first"_a, "last"_a, "timeout"_a = nb::none(),
           nb::sig("def get_statuses(self, first: int, last: int, timeout: float | None = None) "
                   "-> numpy.typing.NDArray[StatusElement]"))
      .def("latest_observation", &PythonFrontend::latest_observation, "timeout"_a = nb::none(),
           nb::sig("def latest_observation(self, timeout: float | None = None) -> Observation"),
           R"(Returns the newest observation, also before step 0: a user can look without acting.)")
      .def("get_latest_at", &PythonFrontend::get_latest_at, "t"_a, "timeout"_a = nb::none(),
           nb::sig("def get_latest_at(self, t: int, timeout: float | None = None) -> Observation "
                   "| None"),
           R"(For companions: returns the newest element that arrived at or before the robot's step
`t`, and waits for that step. None if no element had arrived by then.)")
      .def("wait_until_time_index", &PythonFrontend::wait_until_time_index, "t"_a,
           "timeout"_a = nb::none(),
           nb::sig("def wait_until_time_index(self, t: int, timeout: float | None = None) -> None"),
           "Waits until y[t] exists.")
      .def("current_time_index", &PythonFrontend::current_time_index,
           "Newest step whose observation exists; -1 before step 0.")
      .def(
          "range",
          [](const PythonFrontend& frontend, const std::string& series) {
            return frontend.range(series_of(series));
          },
          "series"_a, nb::sig("def range(self, series: str) -> tuple[int, int]"),
          R"(The first step of `series` that can still be read, and the first step not yet written,
for example for `robot.get_observations(*robot.range("observation"))`. Series are "desired_action",
"applied_action", "observation" and "status".)")
      .def(
          "finish", &PythonFrontend::finish, "timeout"_a = nb::none(),
          nb::sig("def finish(self, timeout: float | None = None) -> None"),
          R"(Says that no further action will come. The session ends without a fault, after the last
appended action. Returns when it has ended.)")
      .def(
          "recover", &PythonFrontend::recover, "timeout"_a = nb::none(),
          nb::sig("def recover(self, timeout: float | None = None) -> None"),
          R"(Clears the fault that ended the session and waits until the back-end has begun the next
one. This handle remains stopped: connect again.)")
      .def(
          "fault", [](const PythonFrontend& frontend) { return to_python(frontend.fault()); },
          nb::sig("def fault(self) -> trifinger.session_info.Fault | None"),
          "Why the session ended; None while it runs.")
      .def(
          "timing", &PythonFrontend::timing,
          R"(How well the session keeps its time, up to now or up to its end. None outside real-time
mode and before the first whole step.)")
      .def("companion", &PythonFrontend::companion, "name"_a,
           "Reads the companion `name` of this robot, for example \"object\".")
      .def(
          "session_info",
          [](const PythonFrontend& frontend) { return to_python(frontend.session_info()); },
          nb::sig("def session_info(self) -> trifinger.session_info.SessionInfo"),
          R"(Facts about the session for everybody: name, type, period, who takes part.)")
      .def(
          "documents",
          [](const PythonFrontend& frontend) { return to_python(frontend.documents()); },
          nb::sig("def documents(self) -> dict[str, str]"),
          R"(Texts that belong to the session, by name: "configuration.yml", "model.xml".)")
      .def("close", &PythonFrontend::close,
           R"(Gives the session and its control back. If actions were appended and the session still
runs, it ends ("detached").)")
      .def_prop_ro("action_dtype", dtype(Series::kDesiredAction),
                   nb::sig("def action_dtype(self) -> numpy.dtype[Action]"),
                   "The layout of an action.")
      .def_prop_ro("applied_action_dtype", dtype(Series::kAppliedAction),
                   nb::sig("def applied_action_dtype(self) -> numpy.dtype[AppliedAction]"),
                   "The layout of an applied action.")
      .def_prop_ro("observation_dtype", dtype(Series::kObservation),
                   nb::sig("def observation_dtype(self) -> numpy.dtype[Observation]"),
                   "The layout of an observation.")
      .def_prop_ro("status_dtype", dtype(Series::kStatus),
                   nb::sig("def status_dtype(self) -> numpy.dtype[StatusElement]"),
                   "The layout of a status, the same for every robot.")
      .def("__repr__", &PythonFrontend::text, nb::sig("def __repr__(self) -> str"))
      .def(
          "__enter__", [](nb::object self) { return self; },
          nb::sig("def __enter__(self) -> Frontend"))
      .def(
          "__exit__",
          [](PythonFrontend& frontend, nb::handle type, nb::handle, nb::handle) {
            frontend.exit(type.is_none());
          },
          "type"_a.none(), "value"_a.none(), "traceback"_a.none(),
          nb::sig("def __exit__(self, type: builtins.type[BaseException] | None, "
                  "value: BaseException | None, traceback: types.TracebackType | None) -> None"));

  m.def(
      "connect",
      [](const std::string& name, bool strict, nb::handle timeout) {
        return attach(name, {.control = true, .strict = strict}, timeout);
      },
      "name"_a, nb::kw_only(), "strict"_a = false, "timeout"_a.none() = 5.0,
      nb::sig("def connect(name: str, *, strict: bool = False, timeout: float | None = 5.0) -> "
              "Frontend"),
      R"(Takes control of the robot `name`, which runs in a back-end of its own (`trifinger run`).

With `strict`, an action that comes after its step was read is an error (AcausalAction) instead of a
mark in the status. `timeout` is how long to wait for a session that is about to begin.

Raises SessionNotFound with the names of running robots, ControlHeld with the process that controls
the robot, RobotStopped if a fault must first be cleared with recover().)");

  m.def(
      "observe",
      [](const std::string& name) { return attach(name, {.control = false}, nb::none()); },
      "name"_a, "Observes the robot or companion `name` without controlling it.");
}

}  // namespace trifinger::bindings
