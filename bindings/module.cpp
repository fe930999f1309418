// SPDX-License-Identifier: BSD-3-Clause
#include "bindings.hpp"
#include "element.hpp"
#include "errors.hpp"
#include "gil.hpp"
#include "numpy.hpp"
#include "recorder.hpp"
#include "running_backend.hpp"

namespace nb = nanobind;

NB_MODULE(_trifinger, m) {
  if (PyArray_ImportNumPyAPI() < 0) throw nb::python_error();
  m.attr("version") = TRIFINGER_VERSION;
  trifinger::python::register_errors();
  trifinger::python::bind_element(m);
  trifinger::python::bind_session(m);
  trifinger::python::bind_timing(m);
  trifinger::python::bind_frontend(m);
  trifinger::python::bind_backend(m);
  trifinger::python::bind_simulation(m);
  trifinger::python::bind_control(m);
  trifinger::python::bind_learning(m);
  trifinger::python::bind_environment(m);
  trifinger::python::bind_log(m);
  trifinger::python::bind_replay(m);
  // Handlers run in reverse order at exit. Threads are parked first, so that they do not notice
  // that their robots stop.
  trifinger::python::stop_recorders_at_exit();
  trifinger::python::stop_backends_at_exit();
  trifinger::python::park_threads_at_exit();
}
