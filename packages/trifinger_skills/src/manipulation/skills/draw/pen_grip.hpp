// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "trifinger/control/safety_limits.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::manipulation {

// How three tips hold a pen. The first presses from one side; the two others press from the other
// side, above and below it.
struct PenGripConfig {
  double height;     // From the nib to the first tip, along the pen [m].
  double spread;     // From this height to each of the two others, along the pen [m].
  double force;      // The first tip presses with it [N].
  double clearance;  // Between tips and pen, before and after [m].
  double detour;     // Distance from the pen at which tips pass around it [m].
};

// The axis of a pen: a line from the centre of its round nib.
struct PenAxis {
  Eigen::Vector3d nib{Eigen::Vector3d::Zero()};  // [m]
  Eigen::Vector3d up{Eigen::Vector3d::UnitZ()};  // Away from the nib.
};

struct PenGrip {
  std::array<int, 3> fingers{};  // First, upper, lower.
  Eigen::Vector3d inward{
      Eigen::Vector3d::UnitX()};  // Direction of the first's force, across the pen.
};

// Centres of the tips, in the order of the grip, at this distance of their surfaces from the pen.
[[nodiscard]] std::array<Eigen::Vector3d, 3> tips_of(const PenGrip& grip, const PenAxis& pen,
                                                     const PenGripConfig& config, double radii,
                                                     double distance) noexcept;

// Chooses the fingers and the direction: all tips must reach the pen where it rests and wherever
// else it will be, their links must keep clear of each other and of the pen, and among all such
// grips the motors have least to do. `radii` is the sum of the radii of a tip and the pen.
[[nodiscard]] std::optional<PenGrip> choose_pen_grip(Kinematics& kinematics,
                                                     const control::SafetyLimits& limits,
                                                     const std::array<Eigen::Vector3d, 3>& tips,
                                                     const PenAxis& rest, double length,
                                                     const std::vector<Eigen::Vector3d>& nibs,
                                                     const PenGripConfig& config, double radii);

}  // namespace trifinger::manipulation
