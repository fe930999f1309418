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
  Pose desired{};                                              ///< Desired pose of the object.
  Pose estimated{};                                            ///< Estimated pose of the object.
  Eigen::Vector3d normal_forces{Eigen::Vector3d::Zero()};      ///< Measured at the tips [N].
  Eigen::Vector3d tangential_forces{Eigen::Vector3d::Zero()};  ///< Measured at the tips [N].
  Eigen::Vector3d travel{Eigen::Vector3d::Zero()};  ///< Travel of the tips along their faces [m].
  bool is_in_sight{true};                           ///< The object was seen lately.
  bool is_slipping{false};   ///< A tip moves along its face faster than tips roll.
  double torque_share{0.0};  ///< Largest requested torque, as a share of its limit.
  control::ForceStatus status{control::ForceStatus::kInvalid};
  Seconds cycle_time{0};  ///< Time that the controller took.
};

/// The record of a run. Steps and poses are in order.
struct Trace {
  Seconds period{1e-3};
  std::vector<TraceStep> steps;
  std::vector<SeenPose> seen;  ///< Measured poses, each only once.
  Phase end{Phase::kFailed};
  Failure failure{Failure::kNone};
  int grasps{0};
  double planned_torque_share{0.0};
};

/// How well an object was manipulated, from the beginning of its line or circle until its release.
/// `hold_...` is about the time when it is held at the end of a line.
struct Report {
  bool is_done{false};
  Failure failure{Failure::kNone};
  int grasps{0};
  std::size_t num_poses{0};  ///< Number of poses from which the errors are computed.

  double position_rms{0.0};  ///< Distance from the desired position [m].
  double position_max{0.0};
  double orientation_rms{0.0};  ///< Angle from the desired orientation [rad].
  double orientation_max{0.0};
  double height{0.0};  ///< Greatest height above its place on the table [m].

  double hold_drift{
      0.0};               ///< From the mean of the first second of holding to that of the last [m].
  double hold_slip{0.0};  ///< Slip of the tips along their faces while holding [m].

  double normal_force_min{0.0};  ///< Smallest normal force of any tip [N].
  double normal_force_mean{0.0};
  double normal_force_max{0.0};
  double tangential_force_max{0.0};
  double friction_used{0.0};   ///< Tangential by normal force at the worst tip [1], 99.9 %
                               ///< quantile.
  double travel_max{0.0};      ///< Travel of a tip along its face, by rolling and slipping [m].
  Seconds blind_time{0};       ///< Time in which the object was out of sight.
  Seconds slip_time{0};        ///< Time in which a tip slipped.
  double torque_margin{0.0};   ///< Smallest distance to the torque limit, as a share of the limit.
  double exact_wrenches{0.0};  ///< Share of steps in which the wrench was exactly the wanted one.

  double cycle_p50{0.0};  ///< Time that the controller took in a step [s].
  double cycle_p999{0.0};
};

/// Makes the report of `trace`. `poses` are the true or the measured poses of the object.
[[nodiscard]] Report make_report(const Trace& trace, const std::vector<SeenPose>& poses);

}  // namespace trifinger::manipulation
