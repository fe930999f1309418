// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "trifinger/manipulation/manipulation.hpp"

namespace trifinger::manipulation {

/// One step of a manipulation.
struct TraceStep {
  TimeIndex step{0};
  Phase phase{Phase::kLook};
  Pose desired{};                                              ///< Of the object.
  Pose estimated{};                                            ///< Likewise.
  Eigen::Vector3d normal_forces{Eigen::Vector3d::Zero()};      ///< Of the tips, felt [N].
  Eigen::Vector3d tangential_forces{Eigen::Vector3d::Zero()};  ///< Likewise.
  Eigen::Vector3d travel{Eigen::Vector3d::Zero()};  ///< Of the tips along their faces [m].
  bool is_slipping{false};   ///< A tip moves along its face faster than tips roll.
  double torque_share{0.0};  ///< The largest torque asked for, as a share of the largest allowed.
  control::ForceStatus status{control::ForceStatus::kInvalid};
  Seconds cycle_time{0};  ///< That the controller has taken.
};

/// What happened. Steps are in order, and so are poses.
struct Trace {
  Seconds period{1e-3};
  std::vector<TraceStep> steps;
  std::vector<SeenPose> seen;  ///< As measured, each once.
  Phase end{Phase::kFailed};
  Failure failure{Failure::kNone};
  int grasps{0};
  double planned_torque_share{0.0};
};

/// How well an object was manipulated, from the beginning of its line or circle until it is
/// released; `hold_...` while it is held at the end of a line.
struct Report {
  bool is_done{false};
  Failure failure{Failure::kNone};
  int grasps{0};
  std::size_t num_poses{0};  ///< That the errors are made of.

  double position_rms{0.0};  ///< Distance from where the object should be [m].
  double position_max{0.0};
  double orientation_rms{0.0};  ///< Angle from how it should be turned [rad].
  double orientation_max{0.0};
  double height{0.0};  ///< By how much it was highest above its place on the table [m].

  double hold_drift{
      0.0};               ///< From the mean of the first second of holding to that of the last [m].
  double hold_slip{0.0};  ///< Of the tips along their faces, likewise [m].

  double normal_force_min{0.0};  ///< Of any tip [N].
  double normal_force_mean{0.0};
  double normal_force_max{0.0};
  double tangential_force_max{0.0};
  double friction_used{0.0};   ///< The largest tangential by normal force [1]; its 99.9 % quantile.
  double travel_max{0.0};      ///< Of a tip along its face, by rolling and slipping [m].
  Seconds slip_time{0};        ///< In which a tip slipped.
  double torque_margin{0.0};   ///< What was always left of the largest torque, as a share of it.
  double exact_wrenches{0.0};  ///< Share of the steps in which the wrench was the one wanted.

  double cycle_p50{0.0};  ///< Time of the controller in a step [s].
  double cycle_p999{0.0};
};

/// The report of `trace`, judged by `poses`: where the object was in truth, or was seen.
[[nodiscard]] Report make_report(const Trace& trace, const std::vector<SeenPose>& poses);

}  // namespace trifinger::manipulation
