// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/unique_ptr.h>

#include <string>

#include "bindings.hpp"
#include "errors.hpp"
#include "frontend.hpp"
#include "garbage.hpp"
#include "series.hpp"
#include "session_info.hpp"
#include "text.hpp"
#include "timeout.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::python {
namespace {

// A back-end that has lost its user to a signal gets half a second to begin anew; a slice must
// leave it that.
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
  // The four series are read alike: one element by its step, many by a range of steps.
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

Reading step t waits until the back-end has filled it in, so a loop that reads y[t] and appends
a[t+1] is paced by the robot and needs no sleep of its own.

`y.position` and `y["position"]` read a field of an Element. Ranges of steps are structured
arrays of NumPy, `ys["position"]` is their field.

Any number of threads may read; one appends. Every wait ends: with the value, with TimedOut
(`timeout` is in seconds, None for as long as it takes), with RobotStopped once the session has
ended and the value will never come, or with Ctrl-C. A handle that went through os.fork() raises
InheritedHandle.

As a context manager it calls finish() after a clean end of the block and lets go after an
exception.)")
      .def(
          "append_desired_action", &PythonFrontend::append_desired_action, "action"_a.none(),
          "timeout"_a = nb::none(),
          nb::sig("def append_desired_action(self, action: Action, timeout: float | None = None) "
                  "-> int"),
          R"(Appends `action` and returns the step it is scheduled for: the next one, or the first still open
if the loop fell behind. The first call starts time 0. Waits only if the queue is full.

Raises RobotStopped, TimedOut, AcausalAction if strict, InvalidArgument for anything but an
action of this robot: see new_action.)")
      .def(
          "append_desired_actions", &PythonFrontend::append_desired_actions, "actions"_a.none(),
          "timeout"_a = nb::none(),
          nb::sig("def append_desired_actions(self, actions: numpy.typing.NDArray[Action], "
                  "timeout: float | None = None) -> int"),
          R"(Appends a burst: the elements of a one-dimensional array of `action_dtype`, one behind the
other. Returns the step of the last one.)")
      .def(
          "new_action", &PythonFrontend::new_action, "fields"_a,
          nb::sig("def new_action(self, **fields: numpy.typing.ArrayLike) -> Action"),
          R"(Returns the robot's default action with `fields` filled in; a number fills the whole field. It
can be changed and appended as often as you like.)")
      .def(
          "get_observation", get(Series::kObservation), "t"_a, "timeout"_a = nb::none(),
          nb::sig("def get_observation(self, t: int, timeout: float | None = None) -> Observation"),
          R"(Returns y[t], waiting for it if `t` lies in the future.

Raises HistoryLost if y[t] was already overwritten, RobotStopped if it will never come,
TimedOut.)")
      .def("get_desired_action", get(Series::kDesiredAction), "t"_a, "timeout"_a = nb::none(),
           nb::sig("def get_desired_action(self, t: int, timeout: float | None = None) -> Action"),
           R"(Returns a[t] as the back-end took it; raises as get_observation, like all below.)")
      .def("get_applied_action", get(Series::kAppliedAction), "t"_a, "timeout"_a = nb::none(),
           nb::sig("def get_applied_action(self, t: int, timeout: float | None = None) -> "
                   "AppliedAction"),
           "Returns a'[t]: what was applied.")
      .def("get_status", get(Series::kStatus), "t"_a, "timeout"_a = nb::none(),
           nb::sig("def get_status(self, t: int, timeout: float | None = None) -> StatusElement"),
           "Returns what the back-end has to say about step t.")
      .def(
          "get_observations", get_many(Series::kObservation), "first"_a, "last"_a,
          "timeout"_a = nb::none(),
          nb::sig("def get_observations(self, first: int, last: int, timeout: float | None = None) "
                  "-> numpy.typing.NDArray[Observation]"),
          "Returns the steps from `first` to before `last`, waiting for the last one.")
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
      .def(
          "latest_observation", &PythonFrontend::latest_observation, "timeout"_a = nb::none(),
          nb::sig("def latest_observation(self, timeout: float | None = None) -> Observation"),
          R"(Returns the newest observation, before step 0 too: nobody has to act in order to look.)")
      .def(
          "get_latest_at", &PythonFrontend::get_latest_at, "t"_a, "timeout"_a = nb::none(),
          nb::sig("def get_latest_at(self, t: int, timeout: float | None = None) -> Observation "
                  "| None"),
          R"(Companions: returns the newest element that arrived at or before the robot's step `t`, waiting
for that step. None if there was none by then.)")
      .def("wait_until_time_index", &PythonFrontend::wait_until_time_index, "t"_a,
           "timeout"_a = nb::none(),
           nb::sig("def wait_until_time_index(self, t: int, timeout: float | None = None) -> None"),
           "Waits until y[t] is there.")
      .def("current_time_index", &PythonFrontend::current_time_index,
           "The newest step whose observation is there, -1 before step 0.")
      .def(
          "range",
          [](const PythonFrontend& frontend, const std::string& series) {
            return frontend.range(series_of(series));
          },
          "series"_a, nb::sig("def range(self, series: str) -> tuple[int, int]"),
          R"(The first step of `series` that can still be read, and the first that has not been written: as
in `robot.get_observations(*robot.range("observation"))`. Series are "desired_action",
"applied_action", "observation" and "status".)")
      .def(
          "finish", &PythonFrontend::finish, "timeout"_a = nb::none(),
          nb::sig("def finish(self, timeout: float | None = None) -> None"),
          R"(Says that no further action will come: the session ends, without a fault, behind the last action
appended. Returns when it has ended.)")
      .def(
          "recover", &PythonFrontend::recover, "timeout"_a = nb::none(),
          nb::sig("def recover(self, timeout: float | None = None) -> None"),
          R"(Clears the fault that ended the session and waits until the back-end has begun the next one.
This handle remains stopped: connect again.)")
      .def(
          "fault", [](const PythonFrontend& frontend) { return to_python(frontend.fault()); },
          nb::sig("def fault(self) -> trifinger.session_info.Fault | None"),
          "Why the session ended; None while it goes on.")
      .def(
          "timing", &PythonFrontend::timing,
          R"(How the session keeps its time, so far or in the end; None outside real-time mode and before the
first whole step.)")
      .def("companion", &PythonFrontend::companion, "name"_a,
           "Reads the companion `name` of this robot, as in \"object\".")
      .def(
          "session_info",
          [](const PythonFrontend& frontend) { return to_python(frontend.session_info()); },
          nb::sig("def session_info(self) -> trifinger.session_info.SessionInfo"),
          R"(What anybody may know about the session: name, type, period, who takes part.)")
      .def(
          "documents",
          [](const PythonFrontend& frontend) { return to_python(frontend.documents()); },
          nb::sig("def documents(self) -> dict[str, str]"),
          R"(Texts that belong to the session, by name: "configuration.yml", "model.xml".)")
      .def(
          "close", &PythonFrontend::close,
          R"(Lets go of the session. If actions were appended and it still runs, it ends ("detached").)")
      .def_prop_ro("action_dtype", dtype(Series::kDesiredAction),
                   nb::sig("def action_dtype(self) -> numpy.dtype[Action]"),
                   "The layout of an action.")
      .def_prop_ro("applied_action_dtype", dtype(Series::kAppliedAction),
                   nb::sig("def applied_action_dtype(self) -> numpy.dtype[AppliedAction]"),
                   "The layout of what the robot says it has applied.")
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
      R"(Takes control of the robot `name`, which runs in a back-end of its own: `trifinger run`.

`strict` makes an action that comes after its step was read an error (AcausalAction) instead of
a mark in the status. `timeout` is how long to wait for a session that is about to begin.

Raises SessionNotFound with the names there are, ControlHeld naming the process that controls
it, RobotStopped if a fault must be cleared with recover() first.)");

  m.def(
      "observe",
      [](const std::string& name) { return attach(name, {.control = false}, nb::none()); },
      "name"_a, "Looks at the robot or companion `name` without controlling it.");
}

}  // namespace trifinger::python
