// SPDX-License-Identifier: BSD-3-Clause
#include "bindings.hpp"
#include "control/planning.hpp"
#include "conversion/element.hpp"
#include "conversion/errors.hpp"
#include "conversion/gil.hpp"
#include "conversion/numpy.hpp"
#include "guiding/guide.hpp"
#include "log/start_recorder.hpp"
#include "session/running_backend.hpp"

namespace nb = nanobind;

NB_MODULE(_trifinger, m) {
  if (PyArray_ImportNumPyAPI() < 0) throw nb::python_error();
  m.attr("version") = TRIFINGER_VERSION;
  using namespace trifinger::bindings;
  register_errors();
  bind_element(m);
  bind_session(m);
  bind_timing(m);
  bind_cameras(m);
  bind_frontend(m);
  bind_backend(m);
  bind_recorder(m);
  bind_simulation(m);
  bind_direct(m);
  bind_free_run(m);
  bind_hand(m);
  bind_rendering(m);
  bind_kinematics(m);
  bind_model_kinematics(m);
  bind_joint_facts(m);
  bind_motion(m);
  bind_forces(m);
  bind_estimation(m);
  bind_grasping(m);
  bind_planning(m);
  bind_guide(m);
  bind_camera_calibration(m);
  bind_policy(m);
  bind_environment(m);
  bind_log(m);
  bind_logged_images(m);
  bind_live(m);
  bind_replay(m);
  bind_tracking(m);
  // Handlers run in reverse order at exit. Threads are parked first, so that they do not notice
  // that their robots stop.
  stop_recorders_at_exit();
  stop_backends_at_exit();
  stop_guides_at_exit();
  park_threads_at_exit();
  // Before that: their ends wait for functions of Python.
  stop_planners_at_exit();
}
