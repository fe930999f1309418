// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

namespace trifinger::bindings {

/// list_sessions, recover, Status.
void bind_session(nanobind::module_& m);
/// TimingRecord, LatenessHistogram, LateStep.
void bind_timing(nanobind::module_& m);
/// Frontend, connect, observe.
void bind_frontend(nanobind::module_& m);
/// Payload, LiveCameras, to_rgb: what python/trifinger/cameras.py is made of.
void bind_cameras(nanobind::module_& m);
/// Backend, fake, run_fake.
void bind_backend(nanobind::module_& m);

/// Recorder.
void bind_recorder(nanobind::module_& m);
/// Log, LoggedSession.
void bind_log(nanobind::module_& m);
void bind_logged_images(nanobind::module_& m);
/// LiveMessages, for packages/trifinger_view/trifinger_view/bridges.
void bind_live(nanobind::module_& m);
/// replay.
void bind_replay(nanobind::module_& m);

/// Simulation, simulate, export_mjcf, export_urdf.
void bind_simulation(nanobind::module_& m);
/// DirectSimulation.
void bind_direct(nanobind::module_& m);
/// FreeRun.
void bind_free_run(nanobind::module_& m);
/// Hand, hand.
void bind_hand(nanobind::module_& m);
/// CameraRenderer.
void bind_rendering(nanobind::module_& m);
/// Kinematics.
void bind_kinematics(nanobind::module_& m);
/// ModelKinematics, JointSolution.
void bind_model_kinematics(nanobind::module_& m);
/// configuration_text, read_joint_facts, kinematics_of: what
/// packages/trifinger_view/trifinger_view/motion is made of.
void bind_joint_facts(nanobind::module_& m);

// What python/trifinger/control.py names:
/// Pose, Twist, Motion and the functions of motions; trajectories.
void bind_motion(nanobind::module_& m);
/// Wrench, Contact, ForceOptimizer; impedances.
void bind_forces(nanobind::module_& m);
/// Filters, PoseEstimator.
void bind_estimation(nanobind::module_& m);
/// GraspPlanner, GraspController.
void bind_grasping(nanobind::module_& m);
/// PlanningModel, PlanningTask, PredictivePlanner, OnlinePlanner.
void bind_planning(nanobind::module_& m);

/// Guide, GuideState, guide.
void bind_guide(nanobind::module_& m);

/// Lens, Camera, CameraCalibration.
void bind_camera_calibration(nanobind::module_& m);

/// Policy.
void bind_policy(nanobind::module_& m);
/// Episodes, EnvironmentBatch: what python/trifinger/environments is made of.
void bind_environment(nanobind::module_& m);

/// Tracker, Estimate: what python/trifinger/tracking.py names.
void bind_tracking(nanobind::module_& m);

}  // namespace trifinger::bindings
