// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

namespace trifinger::python {

/// Frontend, connect, observe.
void bind_frontend(nanobind::module_& m);
/// Backend, fake, run_fake.
void bind_backend(nanobind::module_& m);
/// list_sessions, recover, Status.
void bind_session(nanobind::module_& m);
/// Log, LoggedSession.
void bind_log(nanobind::module_& m);
/// replay.
void bind_replay(nanobind::module_& m);
/// Simulation, simulate, Kinematics, export_mjcf, export_urdf.
void bind_simulation(nanobind::module_& m);
/// Everything that python/trifinger/control.py names.
void bind_control(nanobind::module_& m);
/// The part of `bind_control` that plans and controls grasps.
void bind_grasping(nanobind::module_& m);
/// Policy.
void bind_learning(nanobind::module_& m);
/// Episodes, EnvironmentBatch: what python/trifinger/environments is made of.
void bind_environment(nanobind::module_& m);
/// TimingRecord, LatenessHistogram, LateStep.
void bind_timing(nanobind::module_& m);

}  // namespace trifinger::python
