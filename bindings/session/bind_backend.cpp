// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/unique_ptr.h>

#include <memory>
#include <string>

#include "bindings.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "conversion/with.hpp"
#include "core/fake_robot.hpp"
#include "frontend.hpp"
#include "running_backend.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

std::unique_ptr<FakeDriver> fake_driver(TimeIndex sensor_period, TimeIndex sensor_delay,
                                        TimeIndex observation_fault_after,
                                        TimeIndex action_fault_after) {
  return std::make_unique<FakeDriver>(
      FakeDriver::Options{.sensor_period = sensor_period,
                          .sensor_delay = sensor_delay,
                          .observation_fault_after = observation_fault_after,
                          .action_fault_after = action_fault_after});
}

}  // namespace

void bind_backend(nb::module_& m) {
  nb::class_<RunningBackend> type(
      m, "Backend",
      R"(A back-end in a thread of this process, offered to all processes under a name.

It runs session after session until stop(), or until the end of its `with` block.)");
  type.def("__repr__",
           [](const RunningBackend& backend) {
             return "<Backend of '" + backend.name() + "'" +
                    (backend.is_running() ? ">" : ", stopped>");
           })
      .def_prop_ro("name", &RunningBackend::name, "Name for connect() and observe().")
      .def(
          "wait",
          [](const RunningBackend& backend, const ShownSeconds& timeout) {
            backend.wait(to_timeout(timeout));
          },
          "timeout"_a = nb::none(),
          "Waits until the back-end has ended, or until Ctrl-C is pressed.")
      .def("stop", &RunningBackend::stop,
           "Ends the session, brings the robot to rest and gives the name back.");
  bind_with(type, "Backend", [](RunningBackend& backend, bool /*is_clean*/) { backend.stop(); });

  m.def(
      "fake",
      [](bool strict, std::size_t history, TimeIndex sensor_period, TimeIndex sensor_delay,
         TimeIndex observation_fault_after, TimeIndex action_fault_after) {
        auto driver =
            fake_driver(sensor_period, sensor_delay, observation_fault_after, action_fault_after);
        return std::make_unique<PythonFrontend>(
            start_inline("fake", std::move(driver), {}, {.history = history}, {.strict = strict}),
            PythonFrontend::Role{.controls = true, .is_inline = true});
      },
      nb::kw_only(), "strict"_a = false, "history"_a = SessionOptions{}.history,
      "sensor_period"_a = 0, "sensor_delay"_a = 0, "observation_fault_after"_a = -1,
      "action_fault_after"_a = -1,
      R"(Starts the fake robot inside this program: no physics and no joints, for tests of your own
code.

It runs inside the waits of the returned front-end: without threads, deterministic and fast. An
action has the field `setpoint`. An observation has the fields `setpoint` (the last one applied) and
`applied_actions` (how many there were). `history` is the number of steps kept. With a
`sensor_period` [steps] the robot has the companion "sensor". `observation_fault_after` and
`action_fault_after` inject a fault after that many calls.)");

  m.def(
      "run_fake",
      [](const std::string& name, bool real_time, double period, std::uint32_t max_action_repeats,
         std::uint32_t max_skipped_ticks, nb::handle first_action_timeout, std::size_t history,
         TimeIndex sensor_period, TimeIndex sensor_delay, TimeIndex observation_fault_after,
         TimeIndex action_fault_after) {
        auto driver =
            fake_driver(sensor_period, sensor_delay, observation_fault_after, action_fault_after);
        const BackendOptions options{.mode = real_time ? BackendOptions::Mode::kRealTime
                                                       : BackendOptions::Mode::kNonRealTime,
                                     .period = to_time(period),
                                     .max_action_repeats = max_action_repeats,
                                     .max_skipped_ticks = max_skipped_ticks,
                                     .first_action_timeout = to_timeout(first_action_timeout)};
        return std::make_unique<RunningBackend>(name, std::move(driver), options,
                                                SessionOptions{.history = history});
      },
      "name"_a, nb::kw_only(), "real_time"_a = false, "period"_a = 0.001,
      "max_action_repeats"_a = BackendOptions{}.max_action_repeats,
      "max_skipped_ticks"_a = BackendOptions{}.max_skipped_ticks,
      "first_action_timeout"_a = nb::none(), "history"_a = SessionOptions{}.history,
      "sensor_period"_a = 0, "sensor_delay"_a = 0, "observation_fault_after"_a = -1,
      "action_fault_after"_a = -1,
      nb::sig(
          "def run_fake(name: str, *, real_time: bool = False, period: float = 0.001, "
          "max_action_repeats: int = 0, max_skipped_ticks: int = 5, "
          "first_action_timeout: float | None = None, history: int = 16384, sensor_period: int = "
          "0, "
          "sensor_delay: int = 0, observation_fault_after: int = -1, action_fault_after: int = -1) "
          "-> Backend"),
      R"(Runs the fake robot (see fake()) in a thread of this process, for every process of this
machine.

In real-time mode a step takes `period` [s], and a missing action is replaced up to
`max_action_repeats` times in a row. Otherwise the robot waits for every action.

Raises RobotOwned if another back-end has this name.)");
}

}  // namespace trifinger::bindings
